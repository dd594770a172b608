"""Beside every number that was chosen stands why: what it separates, and why it is this size."""

import ast
import io
import itertools
import tokenize
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path

import pytest

import mbs

ROOT = Path(mbs.__file__).parent

PLAIN = {0.0, 0.25, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 10.0}
"""Numbers of formulas, signs and halves, of which most were not chosen."""

PARAGRAPHS = ("view",)
"""Where sizes and widths of pictures stand together: a comment is for all lines below it, as far as
the next empty line."""

DATA = ("robots",)
"""Numbers of robots, whose source stands in the docstring."""

LEFT = {"export/fmu": 3}
"""Unexplained numbers that a package still has: a count may only be lowered, and goes at zero."""


def argument_defaults(function: ast.FunctionDef) -> Iterator[tuple[str, ast.expr]]:
    """Names and defaults of the arguments that a caller may leave out."""
    positional = [*function.args.posonlyargs, *function.args.args]
    last = positional[len(positional) - len(function.args.defaults) :]
    named = zip(function.args.kwonlyargs, function.args.kw_defaults, strict=True)
    yield from ((a.arg, d) for a, d in zip(last, function.args.defaults, strict=True))
    yield from ((a.arg, d) for a, d in named if d is not None)


def field_defaults(described: ast.ClassDef) -> Iterator[tuple[str, ast.expr]]:
    """Names and defaults of the fields of a class, and of the arguments that make one."""
    for part in described.body:
        match part:
            case ast.AnnAssign(target=ast.Name(id=name), value=ast.expr() as default):
                yield name, default
            case ast.Assign(targets=[ast.Name(id=name)], value=ast.Call() as declared):
                yield name, declared  # as components declare what they have
            case ast.FunctionDef(name="__init__"):
                yield from argument_defaults(part)


def lines_of(node: ast.AST) -> range:
    return range(node.lineno, node.end_lineno + 1)


def with_docstring_below(tree: ast.Module) -> set[int]:
    """Lines of the constants with a docstring below."""
    found: set[int] = set()
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        for pair in itertools.pairwise(body) if isinstance(body, list) else ():
            match pair:
                case (ast.Assign() | ast.AnnAssign() as one, ast.Expr(ast.Constant(str()))):
                    found.update(lines_of(one))
    return found


def told_by_docstring(tree: ast.Module) -> set[int]:
    """Lines of the defaults whose name a docstring explains, as "lower, upper: ..." does both."""
    found: set[int] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            text = ast.get_docstring(node) or ""
            heads = [line.strip().partition(":")[0] for line in text.splitlines()]
            told = {name for head in heads for name in head.split(", ")}
            of = argument_defaults if isinstance(node, ast.FunctionDef) else field_defaults
            for name, default in of(node):
                found.update(lines_of(default) if name in told else ())
    return found


def comments_of(text: str) -> dict[int, bool]:
    """Lines with a comment, and whether it has the line to itself; none that are for tools."""
    return {
        token.start[0]: not token.line[: token.start[1]].strip()
        for token in tokenize.generate_tokens(io.StringIO(text).readline)
        if token.type == tokenize.COMMENT
        if not token.string.lstrip("# ").startswith(("noqa", "type:", "pragma", "fmt:"))
    }


def in_comments(tree: ast.Module, comments: Mapping[int, bool]) -> set[int]:
    """Lines with a comment, lines below one, and the simple statements that begin there."""
    above = {k + 1 for k, alone in comments.items() if alone}
    found = set(comments) | above
    for node in ast.walk(tree):
        if isinstance(node, ast.stmt) and not hasattr(node, "body") and node.lineno in above:
            found.update(lines_of(node))
    return found


def in_paragraphs(lines: list[str], comments: Mapping[int, bool]) -> set[int]:
    """Lines below a comment, as far as the next empty one."""
    found, told = set(), False
    for k, line in enumerate(lines, start=1):
        told = bool(line.strip()) and (told or comments.get(k, False))
        found.update([k] if told else ())
    return found


def unexplained(text: str, *, paragraphs: bool = False) -> list[int]:
    """Lines with a number that was chosen and no reason beside it."""
    tree = ast.parse(text)
    chosen = {
        node.lineno
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant) and isinstance(node.value, float)
        if node.value not in PLAIN
    }
    chosen -= with_docstring_below(tree) | told_by_docstring(tree) if chosen else set()
    if not chosen:  # most files
        return []
    comments = comments_of(text)
    explained = in_comments(tree, comments)
    explained |= in_paragraphs(text.splitlines(), comments) if paragraphs else set()
    # the unit of what is printed stands in the text
    for node in ast.walk(tree):
        explained.update(lines_of(node) if isinstance(node, ast.JoinedStr) else ())
    return sorted(chosen - explained)


def package_of(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    nested = parts[:2] in (("models", "inverse_geometry"), ("export", "fmu"))
    return "/".join(parts[: 2 if nested else 1])


def found_in_package() -> dict[str, list[str]]:
    found: dict[str, list[str]] = {}
    for path in sorted(ROOT.rglob("*.py")):
        package = package_of(path)
        if package not in DATA:
            numbers = unexplained(path.read_text("utf-8"), paragraphs=package in PARAGRAPHS)
            places = [f"{path.relative_to(ROOT)}:{k}" for k in numbers]
            found[package] = found.get(package, []) + places
    return found


def test_every_chosen_number_has_its_reason():
    found = found_in_package()
    counts = Counter({package: len(places) for package, places in found.items() if places})
    more = [place for name, at in found.items() if counts[name] > LEFT.get(name, 0) for place in at]
    assert not more, "write one line why beside each: " + ", ".join(more)


@pytest.mark.parametrize(
    ("text", "lines"),
    [
        ("A = 1e-9\n", [1]),
        ("A = 1e-9  # rounding of lengths [m]\n", []),
        ("# rounding\nA = (\n    1e-9,\n    1e-6,\n)\nB = 1e-3\n", [6]),
        ('A = 1e-9\n"""Rounding."""\nB = 1e-6\n', [3]),
        ("A = 2.0 * x\n", []),
        ('A = f("#fff", 1e-9)\n', [1]),
        ("A = 1e-9  # noqa: N806\n", [1]),
        ("# all of it\nif x:\n    y = 1e-9\n", [3]),
        ('def f(t=1e-9):\n    """F.\n\n    Args:\n        t: a tolerance.\n    """\n', []),
        ('def f(t=1e-9):\n    """F of t."""\n', [1]),
        ('class A:\n    """A.\n\n    t, s: [m].\n    """\n\n    t: float = 0.1\n', []),
        ('x = f"{n / 1e6} MB"\n', []),
    ],
)
def test_what_counts_as_a_reason(text, lines):
    assert unexplained(text) == lines


def test_a_paragraph_of_a_picture_has_one_comment():
    text = "# parts of the width\na = 0.3\nb = 0.4\n\nc = 0.6\n"
    assert unexplained(text) == [3, 5]
    assert unexplained(text, paragraphs=True) == [5]
