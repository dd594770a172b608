import casadi
import numpy as np
from casadi import SX, Function
from hypothesis import given, settings
from hypothesis import strategies as st
from operations.expressions import require_equal

from mbs.operations import PASSES, count, simplify, split
from mbs.operations.graph import function_of, graph_of

_UNARY = (
    lambda a: -a,
    lambda a: a * a,
    lambda a: 2 * a,
    lambda a: a * 0.5,
    lambda a: a - 1,
    casadi.sin,
    casadi.cos,
    casadi.tanh,
    casadi.fabs,
    lambda a: 1 / (a * a + 2),
)
_BINARY = (
    lambda a, b: a + b,
    lambda a, b: a - b,
    lambda a, b: a * b,
    lambda a, b: casadi.sin(a) * b,
    lambda a, b: casadi.cos(a) * b,
    lambda a, b: a / (b * b + 1),
    lambda a, b: casadi.if_else(a > b, a, -b),
    lambda a, b: casadi.atan2(a, b + 3),
)


@st.composite
def functions(draw):
    """Expressions of x, angles q and parameters p, each made of any before it."""
    q, x, p = (SX.sym(name, 3) for name in "qxp")
    known = [*(casadi.sin(q[k]) for k in range(3)), *(casadi.cos(q[k]) for k in range(3))]
    known += [x[k] for k in range(3)] + [p[k] for k in range(3)]
    pick = st.integers(0, 10**6)
    for _ in range(draw(st.integers(1, 30))):
        a, b = (known[-1 - draw(pick) % len(known)] for _ in range(2))
        kind = draw(st.integers(0, 3 * len(_BINARY) + len(_UNARY) - 1))
        if kind < 3 * len(_BINARY):
            value = _BINARY[kind % 3 if kind >= len(_BINARY) else kind](a, b)
        else:
            value = _UNARY[kind - 3 * len(_BINARY)](a)
        known.append(casadi.fmax(casadi.fmin(value, 50), -50) if draw(pick) % 9 == 0 else value)
    outputs = [known[-1 - draw(pick) % min(8, len(known))] for _ in range(draw(st.integers(1, 5)))]
    return Function("f", [q, x, p], [casadi.vertcat(*outputs)], ["q", "x", "p"], ["o"])


@settings(max_examples=60, deadline=None)
@given(functions())
def test_simplified_functions_are_equal_and_no_dearer(f):
    g = simplify(f)
    require_equal(f, g, -1.0, 1.0)
    assert count(g).total <= count(f).total
    assert count(simplify(g)).total <= count(g).total


@settings(max_examples=40, deadline=None)
@given(functions())
def test_each_pass_keeps_the_function(f):
    for one in PASSES:
        require_equal(f, function_of(one.apply(graph_of(f), ("p",))), -1.0, 1.0)


@settings(max_examples=20, deadline=None)
@given(functions())
def test_setup_and_main_are_the_function(f):
    parts = split(f)
    require_equal(f, parts.joined(), -1.0, 1.0)
    assert count(parts.main, ()).total == count(f).total


@settings(max_examples=20, deadline=None)
@given(functions())
def test_derivatives_are_the_same(f):
    point = [np.random.default_rng(k).uniform(-1, 1, 3) for k in range(3)]
    one, other = (np.array(h.jacobian()(*point, 0)[1]) for h in (f, simplify(f)))
    known = np.isfinite(one)
    assert np.all(np.isfinite(other[known]))
    np.testing.assert_allclose(other[known], one[known], rtol=1e-7, atol=1e-8)
