"""Bennett's loop of four turns: one way to close, tan(t/2) tan(u/2) constant all the way round."""

import casadi
import numpy as np
import pytest
from support.postures import active, same, searched
from support.random_trees import random_body

from mbs import Parameter
from mbs.components import Mechanism, Revolute
from mbs.loops import function, modes, reduction_matrix
from mbs.loops.closed_form.plan import plan

TWISTS = (0.9, 1.7)
STARTS = {"j0": 1.0, "j1": 2.0, "j2": -1.0, "j3": -2.0}


def loop(driven=0, cut=3, twists=TWISTS, length=0.8):
    """Links 0 and 2 of one length and twist, 1 and 3 of the other; joint k after link k."""
    rng = np.random.default_rng(0)
    m = Mechanism("bennett")
    alpha, beta = twists
    ratio = np.sin(beta) / np.sin(alpha)
    long = f"{ratio} * {length.name}" if isinstance(length, Parameter) else ratio * length
    bodies = [m.world, *(m.add(random_body(rng, f"b{k}")) for k in range(1, 4))]
    for k in range(4):
        given = {"actuated": True} if k == driven else {}
        size, twist = ((length, alpha), (long, beta))[k % 2]
        joint = Revolute(f"j{k}", **given)
        m.connect(bodies[k].at(size, 0, 0, rotation=_tilt(twist)), joint, bodies[(k + 1) % 4].at())
        if k == cut:
            m.cut(joint)
    return m.assemble(guess={name: x for name, x in STARTS.items() if name != f"j{cut}"})


def _tilt(angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1.0, 0, 0], [0, c, -s], [0, s, c]])


@pytest.mark.parametrize(("driven", "cut"), [(0, 3), (1, 3), (2, 0), (3, 1)])
def test_there_is_one_way_all_the_way_round(driven, cut):
    system = loop(driven, cut)
    (stage,) = plan(system)
    assert stage.labels == ("",)
    for x in np.linspace(-3, 3, 13):
        (mode,) = modes(system, [x])
        assert mode.residual < 1e-12
        assert mode.branch == ()
    for x in (0.3, 2.9):
        (mode,), (found,) = modes(system, [x]), searched(system, [x], starts=40)
        assert same(system, mode.q, found)


def test_the_product_of_the_half_tangents_is_constant():
    system = loop()
    names = [coordinate.name for coordinate in system.coordinates]
    alpha, beta = TWISTS
    for x in (-2.0, 0.4, 1.5):
        q = dict(zip(names, np.array(function(system)(x)).ravel(), strict=True))
        product = abs(np.tan(q["j0"] / 2) * np.tan(q["j1"] / 2))
        wanted = abs(np.sin((alpha + beta) / 2) / np.sin((alpha - beta) / 2))
        assert min(abs(product - wanted), abs(product - 1 / wanted)) < 1e-12


def test_derivatives_are_finite_where_the_loop_is_flat():
    system = loop()
    x = casadi.SX.sym("x")
    slope = casadi.jacobian(function(system)(x), x)
    bend = casadi.Function("bend", [x], [slope, casadi.jacobian(slope, x)])
    for angle in (0.0, 1.0, np.pi):
        first, second = (np.array(m) for m in bend(angle))
        assert np.isfinite(first).all()
        assert np.isfinite(second).all()
    G = np.array(reduction_matrix(system)(modes(system, [1.0])[0].q))
    np.testing.assert_allclose(np.array(bend(1.0)[0]), G, atol=1e-10)


def test_the_length_stays_a_symbol():
    system = loop(length=Parameter("L", 0.8))
    q = function(system)(active(system), [1.3])
    np.testing.assert_allclose(np.array(q), np.array(function(loop())(active(loop()))), atol=1e-12)
