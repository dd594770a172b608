"""Polynomials in sines and cosines against the expressions that they come from."""

import casadi
import numpy as np
import pytest
from casadi import SX, cos, sin
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from mbs.models._singularities import (
    NotTrigonometric,
    factored,
    lowered,
    polynomial_of,
    value,
    with_sums_of_angles,
)

x = SX.sym("x", 5)
a, b, c, d, e = (x[k] for k in range(5))


def difference(first, second, seed=0):
    f = casadi.Function("f", [x], [first - second])
    rng = np.random.default_rng(seed)
    return max(abs(float(f(rng.uniform(-2, 2, 5)))) for _ in range(5))


@st.composite
def expressions(draw):
    """Sums of products of lengths, sines and cosines of sums."""
    total = SX(0)
    for _ in range(draw(st.integers(1, 4))):
        term = SX(draw(st.sampled_from([1.0, -2.0, 0.25])))
        for _ in range(draw(st.integers(0, 3))):
            angle = sum(
                (draw(st.integers(-2, 2)) * x[k] for k in range(3)), SX(draw(st.sampled_from([0])))
            )
            term *= draw(st.sampled_from([sin(angle), cos(angle), d, e]))
        total += term
    return total


@settings(max_examples=25, deadline=None, derandomize=True)
@given(expressions())
def test_every_form_has_the_same_value(expression):
    try:
        polynomial = polynomial_of(expression, x)
        found = factored(polynomial)
    except NotTrigonometric:
        assume(False)
    for form in (
        polynomial,
        lowered(polynomial, "s"),
        lowered(polynomial, "c"),
        with_sums_of_angles(polynomial),
    ):
        assert difference(value(form, x), expression) < 1e-11
    product = SX(float(found.number))
    for factor, power in found.factors:
        product *= value(factor, x) ** power
    assert difference(product, expression) < 1e-10


@pytest.mark.parametrize(
    ("expression", "terms"),
    [
        (sin(a) ** 2 * sin(b) + cos(a) ** 2 * sin(b), [1]),
        (cos(a + b) * cos(b) * d + sin(a + b) * sin(b) * d, [1, 1]),
        (d * sin(a) * cos(b) + d * cos(a) * sin(b), [1, 1]),
        (cos(a) * sin(b) * d - cos(a) * e * cos(b), [1, 2]),
    ],
)
def test_factors_are_short(expression, terms):
    found = factored(polynomial_of(expression, x))
    assert sorted(len(factor) for factor, _ in found.factors) == terms


def test_zero_is_found():
    expression = cos(a) ** 2 + sin(a) ** 2 - 1
    assert polynomial_of(expression, x) == {}
    assert factored({}).number == 0


def test_small_terms_stay_and_rounding_goes():
    tiny = d * sin(a) + 1e-14 * e * cos(a)
    assert len(polynomial_of(tiny, x)) == 2
    ((factor, _),) = factored(polynomial_of(tiny, x)).factors
    assert len(factor) == 2
    lengths = 1e-9 * d * sin(a) + 3e-18 * d * cos(b)
    assert len(polynomial_of(lengths, x)) == 2
    cancelled = d * sin(a) + (0.1 * e) * (0.7 * cos(a)) - (0.1 * 0.7) * e * cos(a)
    assert len(polynomial_of(cancelled, x)) == 1
    folded = 0.4 * d * sin(a) + (0.1 + 0.2 - 0.3) * e * cos(a)
    assert len(polynomial_of(folded, x)) == 1


@pytest.mark.parametrize("number", [np.inf, -np.inf, np.nan])
def test_what_is_no_number_is_refused(number):
    with pytest.raises(NotTrigonometric):
        polynomial_of(number * a + 0.1 * b, x)


@pytest.mark.parametrize(
    "expression", [1 / a, sin(0.5 * a), sin(a * b), sin(a + 0.3), casadi.tanh(a)]
)
def test_other_expressions_are_refused(expression):
    with pytest.raises(NotTrigonometric):
        polynomial_of(expression, x)
