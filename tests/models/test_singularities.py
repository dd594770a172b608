"""Factors are compared with the determinant whatever its size."""

import importlib
from fractions import Fraction

import pytest

import mbs

module = importlib.import_module("mbs.models._singularities")


def planar_arm(size):
    rows = [
        {"antecedent": k, "joint": "revolute", "d": d * size} for k, d in enumerate((0, 0.5, 0.4))
    ]
    bodies = [{"frame": k + 1, "M": 1.0} for k in range(3)]
    return mbs.load({"name": "arm", "frame": rows, "body": bodies}).assemble()


@pytest.mark.parametrize("size", [1e-8, 1.0, 1e5])
def test_wrong_factors_leave_the_block_whole(monkeypatch, size):
    right = module.factored

    def wrong(polynomial):
        found = right(polynomial)
        return module.Factored(found.number * (1 + Fraction(1, 10**6)), found.factors)

    monkeypatch.setattr(module, "factored", wrong)
    found = module.singularities(planar_arm(size), 3, rows=["Vx", "Vy"], columns=[0, 1])
    assert {f.text.partition(" x ")[0] for f in found.factors} == {"determinant of the 1"}
    assert found.constant in ("1", "-1")


@pytest.mark.parametrize("size", [1e-8, 1.0, 1e5])
def test_right_factors_are_taken(size):
    found = module.singularities(planar_arm(size), 3, rows=["Vx", "Vy"], columns=[0, 1])
    assert [f.text for f in found.factors] == ["S2"]
