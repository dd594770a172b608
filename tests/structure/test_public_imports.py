"""Tests, benchmarks and examples import public names from packages, not from inner modules."""

import ast
import importlib
import pkgutil
from collections import defaultdict
from pathlib import Path

import mbs

ROOT = Path(__file__).parents[2]
FILES = sorted(
    path for folder in ("tests", "benchmarks", "examples") for path in (ROOT / folder).rglob("*.py")
)


def public_names():
    """Packages that export a name, and the object: {name: [(package, object), ...]}."""
    found = defaultdict(list)
    inner = (info.name for info in pkgutil.walk_packages(mbs.__path__, "mbs.") if info.ispkg)
    for package in ("mbs", *(name for name in inner if ".app.web" not in name)):
        module = importlib.import_module(package)
        for name in getattr(module, "__all__", ()):
            found[name].append((package, getattr(module, name)))
    return found


def inner_imports(path):
    """Module and name of each import from mbs in a file."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("mbs."):
            yield from ((node.module, alias.name) for alias in node.names)


def test_public_names_are_imported_from_their_packages():
    public, found, count = public_names(), [], 0
    for path in FILES:
        for inner, name in inner_imports(path):
            count += 1
            module = importlib.import_module(inner)
            if name in getattr(module, "__all__", ()) and hasattr(module, "__path__"):
                continue
            value = getattr(module, name, None)
            found += [
                f"{path.relative_to(ROOT)}: import {name} from {package}, not from {inner}"
                for package, other in public[name]
                if other is value and inner.startswith(package + ".")
            ]
    assert count > 3000
    assert found == []
