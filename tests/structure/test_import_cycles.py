"""The import graph has no cycle, with imports in functions and under TYPE_CHECKING included."""

import ast
from graphlib import TopologicalSorter
from pathlib import Path

ROOT = Path(__file__).parents[2]


def imports(package: Path) -> dict[str, set[str]]:
    """Return the modules of a package that each of its modules imports."""
    files = {}
    for path in package.rglob("*.py"):
        parts = path.relative_to(package.parent).with_suffix("").parts
        files[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    graph: dict[str, set[str]] = {}
    for module, path in files.items():
        found = set()
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                found.update(alias.name for alias in node.names)
            elif isinstance(node, ast.ImportFrom) and node.module:
                names = (f"{node.module}.{alias.name}" for alias in node.names)
                found.update(name if name in files else node.module for name in names)
        graph[module] = (found & set(files)) - {module}
    return graph


def test_the_import_graph_has_no_cycle():
    graph = imports(ROOT / "mbs")
    assert len(graph) > 300
    TopologicalSorter(graph).prepare()  # raises an error that contains the cycle


def test_a_cycle_is_found(tmp_path):
    package = tmp_path / "p"
    package.mkdir()
    (package / "__init__.py").write_text("")
    (package / "a.py").write_text("def f():\n    from p.b import x\n")
    (package / "b.py").write_text("import p.a\nx = 1\n")
    assert imports(package) == {"p": set(), "p.a": {"p.b"}, "p.b": {"p.a"}}
