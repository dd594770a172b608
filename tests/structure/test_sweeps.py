"""Which cases of the tests run."""

from collections import Counter

import pytest
from support.sweeps import left_out


class Case:
    """What the choice reads of a collected test."""

    def __init__(self, nodeid, params=None, sweep=False):
        self.nodeid, self.sweep = nodeid, sweep
        if params is not None:
            self.callspec = type("Spec", (), {"params": params})

    def get_closest_marker(self, name):
        return self.sweep and name == "sweep"


KINDS = ("open", "closed", "free")


@pytest.fixture
def cases():
    """A sweep of 45, one of 4, a rule with 5 seeds for each of three kinds, and one test."""
    return [
        *(Case(f"a.py::long[{k}]", {"k": k}, sweep=True) for k in range(45)),
        *(Case(f"a.py::short[{k}]", {"k": k}, sweep=True) for k in range(4)),
        *(
            Case(f"a.py::rule[{kind}-{seed}]", {"kind": kind, "seed": seed})
            for seed in range(5)
            for kind in KINDS
        ),
        Case("a.py::alone"),
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
    assert set.union(*parts) == {case.nodeid for case in cases}
