"""Which cases of the tests run."""

import ast
from collections import Counter
from pathlib import Path

import pytest
from support.sweeps import left_out


class Case:
    """What the choice reads of a collected test."""

    def __init__(self, nodeid, params=None, sweep=False, slow=False):
        self.nodeid, self.marks = nodeid, {"sweep": sweep, "slow": slow}
        if params is not None:
            self.callspec = type("Spec", (), {"params": params})

    def get_closest_marker(self, name):
        return self.marks[name]


KINDS = ("open", "closed", "free")


@pytest.fixture
def cases():
    """A sweep of 45, one of 4, a rule with 5 seeds for each of three kinds, and two tests.

    A case of each is slow, and one of the two tests.
    """
    return [
        *(Case(f"a.py::long[{k}]", {"k": k}, sweep=True) for k in range(45)),
        *(Case(f"a.py::short[{k}]", {"k": k}, sweep=True) for k in range(4)),
        *(
            Case(f"a.py::rule[{kind}-{seed}]", {"kind": kind, "seed": seed})
            for seed in range(5)
            for kind in KINDS
        ),
        Case("a.py::alone"),
        Case("a.py::long[slow]", {"k": 45}, sweep=True, slow=True),
        Case("a.py::rule[open-slow]", {"kind": "open", "seed": 5}, slow=True),
        Case("a.py::thorough", slow=True),
    ]


def run(cases, seed):
    left = left_out(cases, seed)
    return [case.nodeid for case in cases if case not in left]


def test_a_tenth_of_a_sweep_and_one_seed_of_each_kind_run(cases):
    names = run(cases, "1")
    found = Counter(name.partition("[")[0] for name in names)
    assert found == {"a.py::long": 5, "a.py::short": 3, "a.py::rule": 3, "a.py::alone": 1}
    assert {name[11:].partition("-")[0] for name in names if "rule" in name} == set(KINDS)


def test_the_part_is_the_same_each_time_and_another_with_another_seed(cases):
    assert run(cases, "1") == run(cases, "1")
    parts = [set(run(cases, str(seed))) for seed in range(60)]
    assert len({frozenset(part) for part in parts}) > 50
    assert set.union(*parts) == {case.nodeid for case in cases if not case.marks["slow"]}


def is_slow(node):
    """Whether a whole test, class or module is marked as slow."""
    marks = getattr(node, "decorator_list", None)
    if marks is None:
        assigned = [n for n in node.body if isinstance(n, ast.Assign)]
        marks = [n.value for n in assigned if ast.unparse(n.targets[0]) == "pytestmark"]
    texts = [ast.unparse(mark) for mark in marks]
    return any("mark.slow" in text and "parametrize" not in text for text in texts)


def quick_tests(node):
    """Names of the tests that are not marked as slow."""
    if is_slow(node):
        return
    for part in node.body:
        if isinstance(part, ast.FunctionDef) and part.name.startswith("test"):
            if not is_slow(part):
                yield part.name
        elif isinstance(part, ast.ClassDef) and part.name.startswith("Test"):
            yield from quick_tests(part)


TESTS = Path(__file__).parents[1]
MARKED = [file for file in sorted(TESTS.rglob("test_*.py")) if "mark.slow" in file.read_text()]


@pytest.mark.parametrize("file", MARKED, ids=lambda file: str(file.relative_to(TESTS)))
def test_no_file_has_slow_tests_alone(file):
    """What a file tests is tested by `make test` too."""
    assert list(quick_tests(ast.parse(file.read_text())))
