"""What benchmarks/mutation.py changes, and what it leaves alone."""

import ast

import mutation
import pytest
from mutation import mutants

CHANGED = [  # a source, and each of its mutants
    ("y = a + 2.0", ["y = a - 2.0", "y = a + 20.0"]),
    ("y = a <= b", ["y = a < b", "y = a > b"]),
    ("y = not a and -b", ["y = not a or -b", "y = a and -b", "y = not a and b"]),
    ("y = max(a[k:], b.T)",
     ["y = min(a[k:], b.T)", "y = max(a[k + 1:], b.T)", "y = max(a[k:], b)"]),
    ("f(a)\nx[k] += b", ["pass\nx[k] += b", "f(a)\nx[k] -= b", "f(a)\npass"]),
    ("y = [k for k in reversed(a) if k]",
     ["y = [k for k in reversed(a) if not k]", "y = [k for k in a if k]"]),
    ("for k in range(n):\n    break",
     ["for k in range(n - 1):\n    break", "for k in range(n):\n    continue"]),
    ("def f(a):\n    if a:\n        return b",
     ["def f(a):\n    if not a:\n        return b", "def f(a):\n    if False:\n        return b"]),
]  # fmt: skip

LEFT = [
    "import a",
    "'''Text of 2 lines.'''",
    "y = 'a' + b",
    "y = f'{a + 2}'",
    "assert a == 2",
    "raise ValueError(2)",
    "y: Tuple[2] = a",
    "@f(2)\nclass A:\n    x: int",
    "y = zip(a, b, strict=True)",
]


def texts(source, tmp_path, monkeypatch):
    monkeypatch.setattr(mutation, "ROOT", tmp_path)
    (tmp_path / "source.py").write_text(source)
    return [ast.unparse(m.tree()) for m in mutants("source.py")]


@pytest.mark.parametrize(("source", "changed"), CHANGED)
def test_each_mutant_is_one_change(source, changed, tmp_path, monkeypatch):
    assert sorted(texts(source, tmp_path, monkeypatch)) == sorted(changed)


@pytest.mark.parametrize("source", LEFT)
def test_text_types_and_errors_are_left_alone(source, tmp_path, monkeypatch):
    assert texts(source, tmp_path, monkeypatch) == []


def test_the_sample_is_that_of_the_seed():
    first = mutation.sample(20, 5)
    assert first == mutation.sample(20, 5) != mutation.sample(20, 6)
    assert len(first) == 20


def test_a_vector_product_with_a_wrong_sign_is_noticed():
    mutant = next(m for m in mutants("mbs/spatial/vectors.py") if m.what == "Sub -> Add")
    tests = ["tests/spatial/test_inertia.py::test_momentum_of_a_moving_body"]
    seen = mutation.outcome(mutant, tests, 120.0)
    assert (seen["outcome"], seen["by"]) == ("killed", tests[0])
    assert mutation.outcome(None, tests, 120.0)["outcome"] == "survived"
