"""Runs the Python blocks of a page, in order, in the current folder.

A program for any Python that has mbs: `python page.py PAGE [HIDDEN [CODE]]`. HIDDEN lists modules
between commas, which the page cannot import. `absent(extras)` lists the modules that an
installation with some extras does not have. With them, an environment with all tools represents
that installation. CODE runs after the page, with the names of the page.
"""

import importlib.metadata
import re
import sys
from collections.abc import Iterable, Mapping
from functools import cache
from importlib.machinery import ModuleSpec
from pathlib import Path
from typing import Any

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


class Hiding:
    """A finder of modules that does not find some of them."""

    def __init__(self, finder: Any, modules: Iterable[str]) -> None:
        self._finder = finder
        self._modules = frozenset(modules)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._finder, name)

    def find_spec(self, name: str, path: Any = None, target: Any = None) -> ModuleSpec | None:
        """Return the place of a module, or None if the module is hidden or not installed."""
        if name.partition(".")[0] in self._modules:
            return None
        return self._finder.find_spec(name, path, target)


def main(page: str, hidden: str = "", code: str = "") -> None:
    """Run a page."""
    sys.meta_path[:] = [Hiding(finder, hidden.split(",")) for finder in sys.meta_path]
    names: dict[str, object] = {"__name__": "__main__"}
    run(Path(page), names)
    exec(code, names)


if __name__ == "__main__":
    main(*sys.argv[1:])
