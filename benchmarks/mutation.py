"""Whether the tests notice when one thing in the numeric core is wrong.

A mutant is a module with one changed operator, constant, condition, index or statement. The change
is made in memory during the import. The tests that execute the changed line run, the quickest of
the package first, until one fails. A mutant survives if no test fails: the tests have a gap, or the
change has no effect.

    python benchmarks/mutation.py cover --count 60 --seed 1 tests/spatial
                                                            which tests execute which lines of the
                                                            files of the sample; adds up
    python benchmarks/mutation.py run --count 60 --seed 1   the sample; continues an interrupted run
    python benchmarks/mutation.py report                    killed by package; survivors with lines
    python benchmarks/mutation.py again NUMBER ...          these mutants of the sample once more
    python benchmarks/mutation.py check                     the tests that killed pass without

Results are stored in build/mutation. The number of mutants of a package is proportional to its
lines of code. Imports, docstrings, annotations, decorators, text, assertions and raise statements
are not mutated. Mutants do not exist in processes that tests start.
"""

from __future__ import annotations

import argparse
import ast
import copy
import importlib.util
import json
import os
import random
import subprocess
import sys
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from importlib.machinery import SourceFileLoader
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
KEPT = ROOT / "build" / "mutation"
PACKAGES = tuple(sorted(p.parent.name for p in (ROOT / "mbs").glob("*/__init__.py")))

CAP = 40.0
"""Seconds of tests for a mutant: those that notice one mostly do in the first few."""

FIRST = 8
"""Tests that are tried before the others: to collect those of many files takes longer."""

HANGS = 45.0
"""Seconds beyond three times those of its tests after which a mutant counts as one that does not
end: starting takes 2 to 10, on a busy computer."""


# What is changed.

Change = tuple[str, Callable[[ast.AST], ast.AST]]

OPERATORS: dict[type[ast.AST], tuple[type[ast.AST], ...]] = {
    ast.Add: (ast.Sub,),
    ast.Sub: (ast.Add,),
    ast.Mult: (ast.Div,),
    ast.Div: (ast.Mult,),
    ast.Pow: (ast.Mult,),
    ast.Lt: (ast.LtE, ast.Gt),
    ast.LtE: (ast.Lt, ast.Gt),
    ast.Gt: (ast.GtE, ast.Lt),
    ast.GtE: (ast.Gt, ast.Lt),
    ast.Eq: (ast.NotEq,),
    ast.NotEq: (ast.Eq,),
    ast.Is: (ast.IsNot,),
    ast.IsNot: (ast.Is,),
    ast.In: (ast.NotIn,),
    ast.NotIn: (ast.In,),
    ast.And: (ast.Or,),
    ast.Or: (ast.And,),
}

NAMES = {"min": "max", "fmin": "fmax", "any": "all", "sin": "cos", "argmin": "argmax"}
NAMES |= {other: name for name, other in NAMES.items()}


def _text(node: ast.AST) -> bool:
    """Whether a sum with it joins text or lists, where a difference fails at once."""
    return isinstance(node, (ast.JoinedStr, ast.List, ast.Tuple, ast.ListComp)) or (
        isinstance(node, ast.Constant) and isinstance(node.value, str)
    )


def _with(**fields: object) -> Callable[[ast.AST], ast.AST]:
    """The same node with other fields."""

    def change(node: ast.AST) -> ast.AST:
        for name, value in fields.items():
            setattr(node, name, value)
        return node

    return change


def _moved(node: ast.expr, by: int) -> ast.expr:
    return ast.BinOp(node, ast.Add() if by > 0 else ast.Sub(), ast.Constant(abs(by)))


def _constant(node: ast.Constant) -> Iterator[Change]:
    x = node.value
    if isinstance(x, bool):
        yield f"{x} -> {not x}", _with(value=not x)
    elif isinstance(x, int):
        yield f"{x} -> {x + 1}", _with(value=x + 1)
    elif isinstance(x, float):
        other = 10 * x if x else 1.0
        yield f"{x} -> {other}", _with(value=other)


def _operator(node: ast.AST) -> Iterator[Change]:
    """Other operators, and operators left out."""
    match node:
        case ast.BinOp() | ast.AugAssign() | ast.BoolOp():
            sides = [node.left, node.right] if isinstance(node, ast.BinOp) else []
            if not any(_text(side) for side in sides):
                for other in OPERATORS.get(type(node.op), ()):
                    yield f"{type(node.op).__name__} -> {other.__name__}", _with(op=other())
        case ast.Compare():
            for k, op in enumerate(node.ops):
                for other in OPERATORS[type(op)]:
                    ops = [other() if k == n else o for n, o in enumerate(node.ops)]
                    yield f"{type(op).__name__} -> {other.__name__}", _with(ops=ops)
        case ast.UnaryOp(op=ast.USub() | ast.Not()):
            yield f"{type(node.op).__name__} dropped", lambda node: node.operand
        case ast.IfExp():
            yield "condition denied", _with(test=ast.UnaryOp(ast.Not(), node.test))


def _name_or_index(node: ast.AST) -> Iterator[Change]:
    """Other names, and indices that are one off."""
    match node:
        case ast.Attribute(attr="T"):
            yield "transposition dropped", lambda node: node.value
        case ast.Name(id=name) if name in NAMES:
            yield f"{name} -> {NAMES[name]}", _with(id=NAMES[name])
        case ast.Attribute(attr=name) if name in NAMES:
            yield f"{name} -> {NAMES[name]}", _with(attr=NAMES[name])
        case ast.Call(func=ast.Name(id="reversed")):
            yield "reversed dropped", lambda node: node.args[0]
        case ast.Call(func=ast.Name(id="range")):
            end = min(1, len(node.args) - 1)
            args = [_moved(x, -1) if n == end else x for n, x in enumerate(node.args)]
            yield "range one shorter", _with(args=args)
        case ast.Slice():
            for side in ("lower", "upper"):
                bound = getattr(node, side)
                if bound is not None and not isinstance(bound, ast.Constant):
                    yield f"slice {side} + 1", _with(**{side: _moved(bound, 1)})


def _statement(node: ast.AST) -> Iterator[Change]:
    """Denied conditions, removed statements and branches."""
    match node:
        case ast.If() | ast.While():
            yield "condition denied", _with(test=ast.UnaryOp(ast.Not(), node.test))
            if isinstance(node.body[-1], ast.Return | ast.Continue | ast.Break):
                yield "early end removed", _with(test=ast.Constant(False))
        case ast.Expr(value=ast.Call()):
            yield "statement removed", lambda node: ast.Pass()
        case ast.AugAssign():
            yield "statement removed", lambda node: ast.Pass()
        case ast.Assign(targets=[ast.Subscript() | ast.Attribute()]):
            yield "statement removed", lambda node: ast.Pass()
        case ast.Break():
            yield "break -> continue", lambda node: ast.Continue()
        case ast.Continue():
            yield "continue -> break", lambda node: ast.Break()


def _changes(node: ast.AST) -> Iterator[Change]:
    match node:
        case ast.Constant():
            yield from _constant(node)
        case ast.comprehension():
            for k in range(len(node.ifs)):
                tests = [ast.UnaryOp(ast.Not(), x) if n == k else x for n, x in enumerate(node.ifs)]
                yield "condition denied", _with(ifs=tests)
        case ast.expr() | ast.stmt():
            yield from _operator(node)
            yield from _name_or_index(node)
            yield from _statement(node)


LEFT_ALONE = (ast.Import, ast.ImportFrom, ast.Raise, ast.Assert, ast.JoinedStr, ast.arg)


def _children(node: ast.AST) -> Iterator[ast.AST]:
    """What may be changed in a node: no annotations, decorators, imports, text or errors."""
    for name, value in ast.iter_fields(node):
        if name in ("annotation", "returns", "decorator_list", "bases"):
            continue
        if isinstance(node, ast.keyword) and node.arg == "strict":
            continue  # of zip: a promise that nothing else asks
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            continue
        for child in value if isinstance(value, list) else [value]:
            if isinstance(child, ast.AST) and not isinstance(child, LEFT_ALONE):
                yield child


def _walk(node: ast.AST) -> Iterator[ast.AST]:
    yield node
    for child in _children(node):
        yield from _walk(child)


@dataclass(frozen=True)
class Mutant:
    """One change in one file.

    Attributes:
        file: from the root of the project.
        node, change: numbers in the order of the tree.
        lines: first and last of what is changed.
        what: in words.
    """

    file: str
    node: int
    change: int
    lines: tuple[int, int]
    what: str

    def tree(self) -> ast.Module:
        """The changed module."""
        module = ast.parse((ROOT / self.file).read_text("utf-8"))
        wanted = list(_walk(module))[self.node]
        change = list(_changes(wanted))[self.change][1]
        changed = change(copy.copy(wanted))
        for parent in ast.walk(module):
            for name, value in ast.iter_fields(parent):
                if value is wanted:
                    setattr(parent, name, changed)
                elif isinstance(value, list):
                    setattr(parent, name, [changed if x is wanted else x for x in value])
        ast.copy_location(changed, wanted)
        return ast.fix_missing_locations(module)


def mutants(file: str) -> list[Mutant]:
    """Every one of a file."""
    module = ast.parse((ROOT / file).read_text("utf-8"))
    found = []
    for number, node in enumerate(_walk(module)):
        for k, (what, _) in enumerate(_changes(node)):
            place = node.test if isinstance(node, ast.If | ast.While) else node
            place = place.ifs[k] if isinstance(place, ast.comprehension) else place
            found.append(Mutant(file, number, k, (place.lineno, place.end_lineno), what))
    return found


def sample(count: int, seed: int) -> list[Mutant]:
    """Mutants of every package, by its lines."""
    files = {p: sorted((ROOT / "mbs" / p).rglob("*.py")) for p in PACKAGES}
    lines = {p: sum(len(f.read_text("utf-8").splitlines()) for f in files[p]) for p in PACKAGES}
    shares = {p: count * lines[p] / sum(lines.values()) for p in PACKAGES}
    numbers = {p: int(shares[p]) for p in PACKAGES}
    for p in sorted(PACKAGES, key=lambda p: numbers[p] - shares[p])[
        : count - sum(numbers.values())
    ]:
        numbers[p] += 1
    chosen = []
    for p in PACKAGES:
        every = [m for file in files[p] for m in mutants(str(file.relative_to(ROOT)))]
        chosen += random.Random(f"{seed} {p}").sample(every, numbers[p])
    return chosen


# Which tests execute a line.


class Recorder:
    """Duration of each test, and the lines of the given files that it executes."""

    def __init__(self, files: list[str]) -> None:
        import coverage

        self.data = KEPT / f"coverage-{os.getpid()}"
        include = [str(ROOT / file) for file in files]
        self.cover = coverage.Coverage(str(self.data), include=include, config_file=False)
        self.durations: dict[str, float] = defaultdict(float)
        self.failed: set[str] = set()

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        self.cover.switch_context(item.nodeid)
        result = yield
        self.cover.switch_context("")
        return result

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        self.durations[report.nodeid] += report.duration
        if not report.passed:
            self.failed.add(report.nodeid)


def cover(count: int, seed: int, paths: list[str]) -> None:
    """Run tests, and add the lines that they execute in files of the sample to tests.json."""
    KEPT.mkdir(parents=True, exist_ok=True)
    recorder = Recorder(sorted({mutant.file for mutant in sample(count, seed)}))
    recorder.data.unlink(missing_ok=True)
    recorder.cover.start()
    pytest.main([*paths, "-q", "-p", "no:cacheprovider"], plugins=[recorder])
    recorder.cover.stop()
    recorder.cover.save()
    known = _read("tests.json") or {}
    data = recorder.cover.get_data()
    lines: dict[str, dict[str, list[int]]] = defaultdict(dict)
    for file in data.measured_files():
        for line, tests in data.contexts_by_lineno(file).items():
            for test in tests:
                lines[test].setdefault(str(Path(file).relative_to(ROOT)), []).append(line)
    for test, seconds in recorder.durations.items():
        if test not in recorder.failed and test in lines:
            known[test] = {"seconds": round(seconds, 3), "lines": lines[test]}
    _write("tests.json", known)
    recorder.data.unlink()


def tests_of(mutant: Mutant, known: dict) -> list[str]:
    """Tests that execute what is changed, as many as the cap allows.

    The quickest of the package's own tests come first, then those of all files in turn, of each
    the quickest that is left: tests of one file notice the same.
    """
    module = ast.parse((ROOT / mutant.file).read_text("utf-8"))
    lines = _lines(mutant, module)
    found = {t for t, of in known.items() if not lines.isdisjoint(of["lines"].get(mutant.file, ()))}
    quickest = sorted(found, key=lambda test: (known[test]["seconds"], test))
    own = f"tests/{mutant.file.split('/')[1]}/"
    first = [test for test in quickest if test.startswith(own)][:FIRST]
    turn: dict[str, int] = Counter()
    turns = {}
    for test in quickest:
        turns[test] = turn[test.partition("::")[0]]
        turn[test.partition("::")[0]] += 1
    rest = sorted(quickest, key=lambda test: (turns[test], known[test]["seconds"]))
    chosen, total = list(first), sum(known[test]["seconds"] for test in first)
    for test in rest:
        total += known[test]["seconds"]
        if total > CAP and chosen:
            break
        if test not in first:
            chosen.append(test)
    return chosen


def _lines(mutant: Mutant, module: ast.Module) -> set[int]:
    """Lines that execute it; of what is executed by the import, the functions that use its name."""
    first, last = mutant.lines
    functions = [node for node in ast.walk(module) if isinstance(node, ast.FunctionDef)]
    inside = [f for f in functions if f.body[0].lineno <= first <= f.end_lineno]
    if inside:
        # a line of an expression over several lines counts as its statement
        for node in ast.walk(inside[-1]):
            plain = isinstance(node, ast.stmt) and not hasattr(node, "body")
            if plain and node.lineno <= first <= node.end_lineno:
                first, last = node.lineno, node.end_lineno
        return set(range(first, last + 1))
    top = next(node for node in module.body if node.lineno <= first <= node.end_lineno)
    if isinstance(top, ast.FunctionDef | ast.ClassDef):
        return set(range(top.lineno, top.end_lineno + 1))
    nodes = [node for node in ast.walk(top) if isinstance(node, ast.Name)]
    names = {node.id for node in nodes if isinstance(node.ctx, ast.Store)}
    users = [f for f in functions if names & {n.id for n in ast.walk(f) if isinstance(n, ast.Name)}]
    return {k for f in users or functions for k in range(f.body[0].lineno, f.end_lineno + 1)}


# Running.


class _Loader(SourceFileLoader):
    """Imports the changed module; machine code of Python is neither read nor written."""

    def __init__(self, name: str, mutant: Mutant) -> None:
        super().__init__(name, str(ROOT / mutant.file))
        self.mutant = mutant

    def get_code(self, fullname: str) -> object:
        return compile(self.mutant.tree(), self.path, "exec", dont_inherit=True)


class Changed:
    """Finds the changed module before Python does, and runs chosen tests in their order."""

    def __init__(self, mutant: Mutant | None, tests: list[str]) -> None:
        self.mutant, self.tests = mutant, tests
        self.failed = ""
        if mutant is not None:
            self.name = mutant.file.removesuffix(".py").replace("/", ".").removesuffix(".__init__")

    def find_spec(self, name: str, path: object, target: object = None) -> object:
        if self.mutant is None or name != self.name:
            return None
        file = ROOT / self.mutant.file
        inside = [str(file.parent)] if file.name == "__init__.py" else None
        return importlib.util.spec_from_file_location(
            name, file, loader=_Loader(name, self.mutant), submodule_search_locations=inside
        )

    @pytest.hookimpl(wrapper=True)
    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> Iterator[None]:
        every = {item.nodeid: item for item in items}
        yield  # the part of a sweep was chosen when the lines were recorded
        items[:] = [every[test] for test in self.tests if test in every]

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.failed and not self.failed:
            self.failed = report.nodeid


def one(given: dict) -> None:
    """In a process of its own: the tests of a mutant; the last line says what came out."""
    mutant = Mutant(**given["mutant"]) if given["mutant"] else None
    changed = Changed(mutant, given["tests"])
    sys.meta_path.insert(0, changed)
    stop = ["-x"] if mutant is not None else []
    files = list(dict.fromkeys(test.partition("::")[0] for test in given["tests"]))
    code = pytest.main([*files, *stop, "-q", "-p", "no:cacheprovider"], plugins=[changed])
    print("\n" + json.dumps({"code": int(code), "failed": changed.failed}), flush=True)
    os._exit(0)


def outcome(mutant: Mutant | None, tests: list[str], seconds: float) -> dict:
    """What becomes of a mutant, in a process of its own."""
    given = {"mutant": asdict(mutant) if mutant else None, "tests": tests}
    with subprocess.Popen(
        [sys.executable, __file__, "one"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        cwd=ROOT,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        start_new_session=True,
    ) as process:
        try:
            text, _ = process.communicate(json.dumps(given), timeout=seconds)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, 9)
            return {"outcome": "killed", "by": "does not end"}
    last = text.strip().splitlines()[-1] if text.strip() else ""
    if not last.startswith('{"code"'):
        return {"outcome": "killed", "by": f"process ended: {last[-200:]}"}
    said = json.loads(last)
    if said["code"] in (0, pytest.ExitCode.NO_TESTS_COLLECTED):
        return {"outcome": "survived", "by": ""}
    return {"outcome": "killed", "by": said["failed"] or "import"}


def try_mutant(mutant: Mutant, known: dict) -> dict:
    """One line of the results."""
    tests = tests_of(mutant, known)
    start = time.monotonic()
    said = {"outcome": "no test", "by": ""}
    for wave in filter(None, (tests[:FIRST], tests[FIRST:])):
        said = outcome(mutant, wave, 3 * sum(known[test]["seconds"] for test in wave) + HANGS)
        if said["outcome"] == "killed":
            break
    return {
        **asdict(mutant),
        **said,
        "tests": len(tests),
        "seconds": round(time.monotonic() - start, 1),
    }


def run(count: int, seed: int, again: list[int]) -> None:
    """Try the sample, or some of the last one again."""
    results = _read("results.json") or {"seed": seed, "count": count, "mutants": {}}
    count, seed = (results["count"], results["seed"]) if again else (count, seed)
    if (results["seed"], results["count"]) != (seed, count):
        results = {"seed": seed, "count": count, "mutants": {}}
    known = _read("tests.json")
    for number, mutant in enumerate(sample(count, seed)):
        if number in again or (not again and str(number) not in results["mutants"]):
            said = results["mutants"][str(number)] = try_mutant(mutant, known)
            _write("results.json", results)
            by = said["by"].splitlines()[0] if said["by"] else ""
            print(number, f"{mutant.file}:{mutant.lines[0]}", mutant.what, said["outcome"], by,
                  f"{said['seconds']} s of {said['tests']} tests", flush=True)  # fmt: skip


def report() -> None:
    """Killed and survived by package, and every survivor."""
    results = _read("results.json")
    print(f"seed {results['seed']}, {len(results['mutants'])} of {results['count']} mutants")
    by = defaultdict(Counter)
    for said in results["mutants"].values():
        by[said["file"].split("/")[1]][said["outcome"]] += 1
    for package in PACKAGES:
        print(f"  {package:14}", dict(by[package]))
    for number, said in results["mutants"].items():
        if said["outcome"] != "killed":
            line = (ROOT / said["file"]).read_text("utf-8").splitlines()[said["lines"][0] - 1]
            print(f"{number}: {said['file']}:{said['lines'][0]} {said['what']}: {line.strip()}"
                  f" ({said['outcome']}, {said['tests']} tests)")  # fmt: skip


def check() -> None:
    """Every test that killed passes where nothing is changed, alone in its process."""
    results = _read("results.json")["mutants"].values()
    tests = sorted({said["by"] for said in results if said["by"].startswith("tests/")})
    print(f"{len(tests)} tests:", outcome(None, tests, 600.0))


def _read(name: str) -> dict:
    path = KEPT / name
    return json.loads(path.read_text("utf-8")) if path.exists() else {}


def _write(name: str, content: dict) -> None:
    (KEPT / name).write_text(json.dumps(content), "utf-8")


if __name__ == "__main__":
    if sys.argv[1:] == ["one"]:
        one(json.load(sys.stdin))
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    commands = parser.add_subparsers(dest="command", required=True)
    for command in ("cover", "run"):
        chosen = commands.add_parser(command)
        chosen.add_argument("--count", type=int, default=60)
        chosen.add_argument("--seed", type=int, default=1)
    commands.choices["cover"].add_argument("paths", nargs="+")
    commands.add_parser("report")
    commands.add_parser("again").add_argument("numbers", type=int, nargs="+")
    commands.add_parser("check")
    given = parser.parse_args()
    if given.command == "cover":
        cover(given.count, given.seed, given.paths)
    elif given.command in ("run", "again"):
        run(getattr(given, "count", 0), getattr(given, "seed", 0), getattr(given, "numbers", []))
    else:
        {"report": report, "check": check}[given.command]()
