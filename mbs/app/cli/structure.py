"""Structure of a mechanism from its description, without assembly."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mbs.components import Joint
    from mbs.mechanism import Mechanism

_Port = tuple[str, str]


@dataclass(frozen=True, slots=True)
class StructureRow:
    """Numbers of the connection graph of a mechanism.

    Attributes:
        kind: "serial", "tree" or "closed".
        joints: number of moving joints and constraints.
        dofs: degrees of freedom of all joints.
        loops: number of joints that must be cut, and of couplings.
    """

    kind: str
    joints: int
    dofs: int
    loops: int


def structure(mechanism: Mechanism) -> StructureRow:
    """Count joints and loops of a mechanism: rigid bodies are nodes, moving joints are edges.

    Args:
        mechanism: mechanism before its assembly.
    """
    home: dict[_Port, _Port] = {}
    for a, b in mechanism.connections:
        _join(home, (a.owner.name, a.port), (b.owner.name, b.port))
    moving: list[Joint] = []
    for joint in mechanism.joints():
        if joint.freedoms or not joint.places:
            moving.append(joint)
        else:
            _join(home, (joint.name, "a"), (joint.name, "b"))
    ends = [(_root(home, (j.name, "a")), _root(home, (j.name, "b"))) for j in moving]
    world = _root(home, (mechanism.world.name, ""))
    nodes = {world, *(node for pair in ends for node in pair)}
    loops = len(moving) - (len(nodes) - 1) + len(list(mechanism.couplings()))
    dofs = sum(joint.nv for joint in moving)
    return StructureRow(_kind(ends, world, loops), len(moving), dofs, loops)


def _kind(ends: list[tuple[_Port, _Port]], world: _Port, loops: int) -> str:
    """Return "closed" if there are loops, "tree" if a body has several children, else "serial".

    `ends` are the bodies that each joint connects; a body is represented by one of its ports.
    """
    if loops:
        return "closed"
    joints_at = Counter(node for pair in ends for node in pair)
    forked = [node for node, count in joints_at.items() if count > (1 if node == world else 2)]
    return "tree" if forked else "serial"


def _root(home: dict[_Port, _Port], port: _Port) -> _Port:
    """Return the port that represents the rigidly connected ports of a port.

    `home` is a disjoint-set forest: parent of each port that is not a root.
    """
    while port in home:
        port = home[port]
    return port


def _join(home: dict[_Port, _Port], a: _Port, b: _Port) -> None:
    """Record in the forest `home` that the ports a and b are rigidly connected."""
    a, b = _root(home, a), _root(home, b)
    if a != b:
        home[a] = b
