"""Public names, so that a name in backticks leads to its entry in the reference."""

import importlib
import re
from functools import cache

PACKAGES = (
    "mbs.components",
    "mbs.assembly",
    "mbs.loops",
    "mbs.models",
    "mbs.models.inverse_geometry",
    "mbs.models.catalogue",
    "mbs.identification",
    "mbs.export",
    "mbs.simulate",
    "mbs.bridges",
    "mbs.view",
    "mbs.formats",
    "mbs.robots",
    "mbs.operations",
    "mbs.native",
    "mbs.solvers",
    "mbs.expressions",
    "mbs.spatial",
)
_CALL = re.compile(r"([A-Za-z_][\w.]*)(\([^`]*\))?")


@cache
def _entries() -> tuple[dict[str, str], frozenset[str]]:
    short: dict[str, set[str]] = {
        "Result": {"mbs.result.Result"},
        "MbsError": {"mbs.errors.MbsError"},
    }
    for package in PACKAGES:
        for name in importlib.import_module(package).__all__:
            short.setdefault(name, set()).add(f"{package}.{name}")
    paths = frozenset(path for found in short.values() for path in found)
    return {name: found.pop() for name, found in short.items() if len(found) == 1}, paths


def target_of(code: str) -> str | None:
    """The path of the public thing that `code` names, None where it names none or is not clear."""
    call = _CALL.fullmatch(code)
    if call is None:
        return None
    short, paths = _entries()
    name = call[1]
    if name in paths:
        return name
    if name.startswith("mbs.") and name.count(".") == 1:
        return short.get(name[4:])
    plain = name.islower() and "_" not in name
    return None if plain else short.get(name)
