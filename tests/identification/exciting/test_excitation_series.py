"""Fourier series of joints and the criteria of their observations."""

import casadi
import numpy as np
import pytest

from mbs.errors import ModelError
from mbs.identification.exciting import CRITERIA, CriterionFunction
from mbs.identification.trajectory import (
    FourierSeries,
    between_samples,
    harmonic_terms,
    resting_coefficients,
)


def _series(seed: int = 3, period: float = 8.0) -> FourierSeries:
    rng = np.random.default_rng(seed)
    return FourierSeries(period, *(rng.standard_normal(s) for s in ((2,), (2, 4), (2, 4))))


def test_rates_are_derivatives() -> None:
    series, t, h = _series(), np.linspace(0, 8, 17), 1e-5
    assert series.q(t) == pytest.approx(series.q(t + 8.0), abs=1e-12)
    assert (series.q(t + h) - series.q(t - h)) / (2 * h) == pytest.approx(series.v(t), abs=1e-8)
    assert (series.v(t + h) - series.v(t - h)) / (2 * h) == pytest.approx(series.a(t), abs=1e-8)


@pytest.mark.parametrize("kind", [casadi.SX, casadi.MX])
def test_law_is_the_motion_as_an_expression(kind: type) -> None:
    series, t = _series(), kind.sym("t")
    laws = casadi.Function("laws", [t], [series.law(t, order) for order in range(3)])
    for instant in (0.0, 1.3, 7.9):
        found = [np.array(value).ravel() for value in laws(instant)]
        known = [series.q(instant), series.v(instant), series.a(instant)]
        assert np.array(found) == pytest.approx(np.array(known), abs=1e-12)
    with pytest.raises(ModelError, match=r"use law\(t\)"):
        series.q(t)


def test_definition_of_the_coefficients() -> None:
    series = FourierSeries(2 * np.pi, np.array([0.5]), np.array([[0, 3.0]]), np.array([[0, 4.0]]))
    t = 0.3
    expected = 0.5 + 3.0 / 2 * np.sin(2 * t) - 4.0 / 2 * np.cos(2 * t)
    assert series.q(t) == pytest.approx(np.array([expected]), abs=1e-15)
    assert series.harmonics == 2


def test_resting_motions_start_at_rest_and_are_all_there_are() -> None:
    basis = resting_coefficients(5.0, 4)
    assert basis.shape == (8, 6)
    assert basis.T @ basis == pytest.approx(np.eye(6), abs=1e-12)
    for order in (1, 2):
        assert harmonic_terms(np.zeros(1), 5.0, 4, order) @ basis == pytest.approx(0, abs=1e-12)


def test_samples_bound_the_motion_between_them() -> None:
    part = between_samples(20, 4)
    fine = np.linspace(0, 8, 4001)
    sampled = np.arange(20) * 8 / 20
    ratios = []
    for seed in range(40):
        series = _series(seed)
        ratios.append(np.abs(series.v(sampled)).max(axis=0) / np.abs(series.v(fine)).max(axis=0))
    assert part == pytest.approx(0.8090169943749475)
    assert np.min(ratios) >= part
    assert np.min(ratios) < 0.99


@pytest.mark.parametrize("name", list(CRITERIA))
def test_gradient_of_a_criterion(name: str) -> None:
    rng = np.random.default_rng(5)
    W = rng.standard_normal((30, 6)) * np.array([1, 10, 0.1, 3, 1, 2])
    G, criterion = W.T @ W, CRITERIA[name]
    direction = rng.standard_normal((6, 6)) * np.sqrt(np.outer(np.diag(G), np.diag(G)))
    direction = direction + direction.T
    h = 1e-6
    slope = (criterion(G + h * direction)[0] - criterion(G - h * direction)[0]) / (2 * h)
    assert np.sum(criterion(G)[1] * direction) == pytest.approx(slope, rel=1e-6)


def test_values_of_the_criteria() -> None:
    rng = np.random.default_rng(6)
    W = rng.standard_normal((40, 5)) * np.array([1, 5, 0.2, 1, 3])
    G = W.T @ W
    scaled = W / np.linalg.norm(W, axis=0)
    assert CRITERIA["log_det"](G)[0] == pytest.approx(-np.log(np.linalg.det(G)) / 5)
    for name, matrix in (("condition", W), ("scaled_condition", scaled)):
        found, exact = CRITERIA[name](G)[0], np.log(np.linalg.cond(matrix))
        assert exact <= found <= exact + np.log(5) / 8


def test_criterion_of_dependent_columns_is_no_number() -> None:
    G = np.ones((2, 2))
    assert not np.isfinite(CRITERIA["condition"](G - 1e-9 * np.eye(2))[0])


def test_criterion_within_a_graph_has_its_gradient() -> None:
    import casadi

    rng = np.random.default_rng(7)
    W = rng.standard_normal((9, 3))
    function = CriterionFunction(CRITERIA["log_det"], 3)
    x = casadi.MX.sym("x", 3)
    A = casadi.DM(W) @ casadi.diag(x)
    f = function(A.T @ A)
    slope = casadi.Function("slope", [x], [casadi.gradient(f, x)])
    assert np.array(slope([1, 2, 4])).ravel() == pytest.approx(-2 / 3 / np.array([1, 2, 4]))
