"""Which links and joints a URDF file has, and how they hang together."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from xml.etree.ElementTree import Element

from mbs.errors import DescriptionError
from mbs.formats.files import component_name
from mbs.formats.urdf_values import Reader
from mbs.messages import did_you_mean


@dataclass(frozen=True, slots=True)
class JointElement:
    """A joint and the links on either side."""

    name: str
    parent: str
    child: str
    element: Element

    @property
    def kind(self) -> str:
        """Its type."""
        return self.element.get("type", "")


@dataclass(frozen=True, slots=True)
class UrdfTree:
    """The links by name, and the joints in an order in which parents come first."""

    path: str
    root: str
    links: Mapping[str, Element]
    joints: tuple[JointElement, ...]

    def reader(self, what: str) -> Reader:
        """A reader of numbers whose messages name the file and the element."""
        return Reader(f"{self.path}: {what}")

    def body_name(self, link: str) -> str:
        """The name of the body of a link; joints, and the base of all models, keep theirs."""
        name = component_name(link)
        taken = {component_name(joint.name) for joint in self.joints if joint.kind != "fixed"}
        if link != self.root:
            taken.add("base")
        return f"{name}_link" if name in taken else name


def read_tree(path: str, root: Element) -> UrdfTree:
    """The links and joints of a <robot>, checked to be a tree.

    Raises:
        DescriptionError: a name is missing, unknown or used twice, or there is not one root.
    """
    _check_elements(path, root)
    links = _named(path, root, "link")
    if not links:
        raise DescriptionError(f"{path}: there is no <link>; give a URDF file with links")
    joints = [
        _joint(path, name, element, links) for name, element in _named(path, root, "joint").items()
    ]
    parents: dict[str, str] = {}
    for joint in joints:
        if joint.child in parents:
            raise DescriptionError(
                f"{path}: link {joint.child!r} is the child of joints {parents[joint.child]!r} and"
                f" {joint.name!r}; a link has one parent, so close loops with mbs components"
            )
        parents[joint.child] = joint.name
    roots = [name for name in links if name not in parents]
    if len(roots) != 1:
        found = f"the roots {', '.join(map(repr, roots))}" if roots else "no root but a cycle"
        raise DescriptionError(f"{path}: the links have {found}; connect them as one tree")
    return UrdfTree(path, roots[0], links, _ordered(path, roots[0], links, joints))


def _check_elements(path: str, root: Element) -> None:
    for element in root.iter():
        if "xacro" in element.tag:
            raise DescriptionError(
                f"{path}: the file holds xacro macros; expand it with xacro first"
            )
    if root.find("constraint") is not None:
        raise DescriptionError(
            f"{path}: <constraint> is not read; close the loop with mbs components instead"
        )


def _named(path: str, root: Element, tag: str) -> dict[str, Element]:
    named: dict[str, Element] = {}
    for element in root.findall(tag):
        name = (element.get("name") or "").strip()
        if not name:
            raise DescriptionError(f"{path}: a <{tag}> has no name; give it one")
        if name in named:
            raise DescriptionError(f"{path}: two {tag}s are named {name!r}; rename one")
        named[name] = element
    return named


def _joint(path: str, name: str, element: Element, links: Iterable[str]) -> JointElement:
    ends = []
    for side in ("parent", "child"):
        end = element.find(side)
        link = "" if end is None else (end.get("link") or "").strip()
        if link not in links:
            raise DescriptionError(
                f"{path}: joint {name!r}: {side} link {link!r} does not exist;"
                f" {did_you_mean(link, links)}"
            )
        ends.append(link)
    return JointElement(name, ends[0], ends[1], element)


def _ordered(
    path: str, root: str, links: Iterable[str], joints: Iterable[JointElement]
) -> tuple[JointElement, ...]:
    children: dict[str, list[JointElement]] = {name: [] for name in links}
    for joint in joints:
        children[joint.parent].append(joint)
    ordered: list[JointElement] = []
    pending = list(reversed(children[root]))
    while pending:
        joint = pending.pop()
        ordered.append(joint)
        pending.extend(reversed(children[joint.child]))
    reached = {root, *(joint.child for joint in ordered)}
    missing = [name for name in links if name not in reached]
    if missing:
        raise DescriptionError(
            f"{path}: link {missing[0]!r} is in a cycle of joints; connect the links as one tree"
        )
    return tuple(ordered)
