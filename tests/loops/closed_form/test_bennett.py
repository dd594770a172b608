"""Bennett's loop of four turns: one way to close, tan(t/2) tan(u/2) constant all the way round."""

import casadi
import numpy as np
import pytest
from support.bennett import TWISTS, bennett
from support.configurations import active, same, searched

from mbs import Parameter
from mbs.loops import assembly_modes, function, reduction_matrix
from mbs.loops.plan import plan


@pytest.mark.parametrize(("driven", "cut"), [(0, 3), (1, 3), (2, 0), (3, 1)])
def test_there_is_one_way_all_the_way_round(driven, cut):
    system = bennett(driven, cut)
    (stage,) = plan(system)
    assert stage.labels == ("",)
    for x in np.linspace(-3, 3, 13):
        (mode,) = assembly_modes(system, [x])
        assert mode.residual < 1e-12
        assert mode.branch == ()
    for x in (0.3, 2.9):
        (mode,), (found,) = assembly_modes(system, [x]), searched(system, [x], starts=40)
        assert same(system, mode.q, found)


def test_the_product_of_the_half_tangents_is_constant():
    system = bennett()
    names = [coordinate.name for coordinate in system.coordinates]
    alpha, beta = TWISTS
    for x in (-2.0, 0.4, 1.5):
        q = dict(zip(names, np.array(function(system)(x)).ravel(), strict=True))
        product = abs(np.tan(q["j0"] / 2) * np.tan(q["j1"] / 2))
        wanted = abs(np.sin((alpha + beta) / 2) / np.sin((alpha - beta) / 2))
        assert min(abs(product - wanted), abs(product - 1 / wanted)) < 1e-12


def test_derivatives_are_finite_where_the_loop_is_flat():
    system = bennett()
    x = casadi.SX.sym("x")
    slope = casadi.jacobian(function(system)(x), x)
    bend = casadi.Function("bend", [x], [slope, casadi.jacobian(slope, x)])
    for angle in (0.0, 1.0, np.pi):
        first, second = (np.array(m) for m in bend(angle))
        assert np.isfinite(first).all()
        assert np.isfinite(second).all()
    G = np.array(reduction_matrix(system)(assembly_modes(system, [1.0])[0].q))
    np.testing.assert_allclose(np.array(bend(1.0)[0]), G, atol=1e-10)


def test_the_length_stays_a_symbol():
    system = bennett(length=Parameter("L", 0.8))
    q = function(system)(active(system), [1.3])
    np.testing.assert_allclose(
        np.array(q), np.array(function(bennett())(active(bennett()))), atol=1e-12
    )
