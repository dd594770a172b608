"""Runs the Python blocks of a page, in order, in the current folder.

A program for any Python that has mbs: `python page.py PAGE [REFUSED [CODE]]`. REFUSED are names of
modules between commas, which cannot be imported: those of `absent(extras)` are what an installation
with these extras alone would not have, so that an environment with every tool stands for it. CODE
runs after the page, with its names.
"""

import importlib.metadata
import re
import sys
from collections.abc import Iterable, Mapping
from functools import cache
from importlib.abc import MetaPathFinder
from pathlib import Path

PROGRAM = Path(__file__)
DISTRIBUTION = "casadi-mbs"
_BLOCK = re.compile(r"^```python\n(.*?)^```$", re.DOTALL | re.MULTILINE)
_INSTALL = re.compile(r"^(?:    |Runs with `)pip install \"casadi-mbs\[([a-z,]+)\]\"", re.MULTILINE)
_REQUIREMENT = re.compile(r"([\w.-]+)(?:\[([\w,-]+)\])?")
_CONDITION = re.compile(r"extra == ['\"]([\w-]+)['\"]")


def blocks(page: Path) -> list[tuple[int, str]]:
    """The Python blocks of a page, each with the lines above it."""
    text = page.read_text(encoding="utf-8")
    found = _BLOCK.finditer(text)
    return [(text.count("\n", 0, block.start(1)), block[1]) for block in found]


def run(page: Path, names: dict[str, object]) -> None:
    """Run the blocks of a page; a traceback tells the line of the page."""
    for line, block in blocks(page):
        exec(compile("\n" * line + block, str(page), "exec"), names)


def documented_extras(page: Path) -> tuple[str, ...]:
    """The extras of the installation that a page documents.

    They stand in its first line that is, or begins by "Runs with", a command that installs.
    """
    found = _INSTALL.search(page.read_text(encoding="utf-8"))
    return tuple(found[1].split(",")) if found else ()


def needed(extras: tuple[str, ...]) -> set[str]:
    """The distributions that an installation with some extras has, in normal spelling."""
    found: set[str] = set()
    pending: list[tuple[str, tuple[str, ...]]] = [(DISTRIBUTION, ()), (DISTRIBUTION, extras)]
    done = set()
    while pending:
        name, chosen = pending.pop()
        if (name, chosen) in done:
            continue
        done.add((name, chosen))
        found.add(name)
        try:
            requirements = importlib.metadata.requires(name) or []
        except importlib.metadata.PackageNotFoundError:
            continue  # for another platform or another Python
        for requirement in requirements:
            condition = _CONDITION.search(requirement)
            matched = _REQUIREMENT.match(requirement)
            if matched and (condition is None or condition[1] in chosen):
                further = tuple((matched[2] or "").split(",")) if matched[2] else ()
                pending.append((re.sub(r"[-_.]+", "-", matched[1]).lower(), further))
    return found


@cache
def absent(extras: tuple[str, ...]) -> tuple[str, ...]:
    """The modules here that an installation with some extras does not have."""
    present = needed(extras)
    return tuple(
        module
        for module, bringers in _provided().items()
        if not {re.sub(r"[-_.]+", "-", name).lower() for name in bringers} & present
    )


@cache
def _provided() -> Mapping[str, list[str]]:
    return importlib.metadata.packages_distributions()


class Absent(MetaPathFinder):
    """Refuses to import some modules."""

    def __init__(self, modules: Iterable[str]) -> None:
        self.modules = frozenset(modules)

    def find_spec(self, name: str, path: object = None, target: object = None) -> None:
        """Not there, as Python itself says it."""
        if name.partition(".")[0] in self.modules:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)


def main(page: str, refused: str = "", code: str = "") -> None:
    """Run a page."""
    sys.meta_path.insert(0, Absent(refused.split(",")))
    names: dict[str, object] = {"__name__": "__main__"}
    run(Path(page), names)
    exec(code, names)


if __name__ == "__main__":
    main(*sys.argv[1:])
