"""The grammar of numbers: what it reads, what it refuses, and that it says what it means."""

import math

import casadi
import numpy as np
import pytest
from casadi import SX
from hypothesis import given, settings
from hypothesis import strategies as st
from support.messages import refused

from mbs.errors import ExpressionError
from mbs.expressions import (
    Number,
    Operation,
    Parameter,
    expression,
    parameters_of,
    renamed,
    to_float,
    to_sx,
)
from mbs.units import UNITS

VALUES = {"A": 0.7, "B": -1.3, "L2": 2.5, "arm.L": 0.4}

NUMBERS = [
    ("1", 1),
    ("  -2.5e-3 ", -2.5e-3),
    (".5", 0.5),
    ("5.", 5),
    ("1.E+2", 100),
    ("pi", math.pi),
    ("Pi/2", math.pi / 2),
    ("1+2*3", 7),
    ("(1+2)*3", 9),
    ("7-3-2", 2),
    ("8/4/2", 1),
    ("2*3/4*2", 3),
    ("2^3^2", 512),
    ("2**3", 8),
    ("2^-1", 0.5),
    ("-2^2", -4),
    ("(-2)^2", 4),
    ("2*-3", -6),
    ("2--3", 5),
    ("-+-+3", 3),
    ("+4", 4),
    ("-3^2*2", -18),
    ("2^-2^2", 2**-4),
    ("sin(pi/6)", 0.5),
    ("cos(0)", 1),
    ("tan(pi/4)", 1),
    ("sqrt(2)^2", 2),
    ("atan2(1, -1)", 3 * math.pi / 4),
    ("atan2(-1,-1)", -3 * math.pi / 4),
    ("((((3))))", 3),
]


@pytest.mark.parametrize(("text", "value"), NUMBERS)
def test_numbers(text, value):
    read = expression(text)
    assert isinstance(read, Number)
    assert read.value == pytest.approx(value, rel=1e-15)


SYMBOLIC = [
    ("A", lambda A, B: A),
    ("-A^2", lambda A, B: -(A**2)),
    ("(-A)^2", lambda A, B: A**2),
    ("A-B-A", lambda A, B: -B),
    ("A-(B-A)", lambda A, B: 2 * A - B),
    ("A/B/2", lambda A, B: A / B / 2),
    ("A/(B/2)", lambda A, B: 2 * A / B),
    ("A^-B", lambda A, B: A**-B),
    ("A^2^B", lambda A, B: A ** (2**B)),
    ("(A^2)^B", lambda A, B: (A**2) ** B),
    ("A*-B", lambda A, B: -A * B),
    ("sin(A)*cos(B)-tan(A*B)", lambda A, B: math.sin(A) * math.cos(B) - math.tan(A * B)),
    ("atan2(A, B)", math.atan2),
    ("sqrt(A)+pi", lambda A, B: math.sqrt(A) + math.pi),
]


@pytest.mark.parametrize(("text", "value"), SYMBOLIC)
def test_symbols(text, value):
    wanted = value(VALUES["A"], VALUES["B"])
    assert to_float(text, VALUES) == pytest.approx(wanted, rel=1e-14)
    assert number_of_sx(expression(text)) == pytest.approx(wanted, rel=1e-14)
    assert to_float(str(expression(text)), VALUES) == pytest.approx(wanted, rel=1e-14)


def number_of_sx(value, values=VALUES):
    symbols = {name: SX.sym(name) for name in values}
    f = casadi.Function("f", list(symbols.values()), [to_sx(value, symbols)])
    return float(f(*values.values()))


# Numbers of the size of rounding are left out: functions near -1, 0 and 1 are put exactly there.
leaves = st.one_of(
    st.floats(-1e3, 1e3).filter(lambda x: x == 0 or abs(x) > 1e-9).map(Number),
    st.sampled_from(list(VALUES)).map(Parameter),
)


def grown(inner):
    binary = st.tuples(st.sampled_from("+-*/"), st.tuples(inner, inner))
    power = st.tuples(st.just("^"), st.tuples(inner, inner | st.sampled_from([Number(2.0)])))
    unary = st.tuples(st.sampled_from(["negate", "sin", "cos"]), st.tuples(inner))
    right = st.sampled_from([Parameter("A"), Parameter("L2")])  # where no sign of a zero matters
    arcs = st.tuples(st.just("atan2"), st.tuples(inner, right))
    return (binary | power | unary | arcs).map(lambda parts: Operation(*parts))


def test_a_negative_zero_keeps_its_brackets():
    power = Operation("^", (Number(-0.0), Number(0.0)))
    assert str(power) == "(-0)^0"
    assert to_float(str(power)) == to_float(power) == 1.0


def read_or_refused(text, where="value"):
    """The expression and no message, or no expression and the message."""
    try:
        return expression(text, where), ""
    except ExpressionError as refusal:
        return None, str(refusal)


@settings(max_examples=300, deadline=None, derandomize=True)
@given(st.recursive(leaves, grown, max_leaves=12))
def test_text_round_trip(value):
    wanted = to_float(value, VALUES)
    back, refusal = read_or_refused(str(value))
    if back is None:  # constants such as 1/0 are refused
        assert "is not a finite number" in refusal
        return
    found = to_float(back, VALUES)
    if wanted is None or found is None:
        assert wanted is None
        assert found is None
    elif abs(wanted) < 1e12:
        scale = max(1.0, abs(wanted))
        # products and sums are flat in a text, so that rounding may differ
        assert found == pytest.approx(wanted, rel=1e-6, abs=1e-6 * scale)
    assert str(expression(str(back))) == str(back)


def finite_throughout(value):
    found = to_float(value, VALUES)
    parts = value.arguments if isinstance(value, Operation) else ()
    return found is not None and np.isfinite(found) and all(map(finite_throughout, parts))


@settings(max_examples=200, deadline=None, derandomize=True)
@given(st.recursive(leaves, grown, max_leaves=10))
def test_sx_and_float_agree(value):
    wanted = to_float(value, VALUES)
    # CasADi knows no sign of zero, so that what an infinity becomes may differ
    if wanted is not None and abs(wanted) < 1e12 and finite_throughout(value):
        assert number_of_sx(value) == pytest.approx(wanted, rel=1e-9, abs=1e-9)


@settings(max_examples=300, deadline=None, derandomize=True)
@given(st.text(alphabet="AB12.+-*/^(),sincopt e_", max_size=14) | st.text(max_size=10))
def test_any_text_is_read_or_refused_with_our_error(text):
    value, refusal = read_or_refused(text, "link")
    if value is None:
        assert refusal.startswith("link: ")
    else:
        assert expression(str(value)) is not None


def test_arithmetic_of_parameters():
    A, B = Parameter("A", 0.7), Parameter("B", -1.3)
    built = 2 * A - B / 4 + 1 - (-A) ** 2 + (3 - A) / (+B) + 2**A
    wanted = 2 * 0.7 + 1.3 / 4 + 1 - 0.7**2 + 2.3 / -1.3 + 2**0.7
    assert to_float(built) == pytest.approx(wanted, rel=1e-14)
    assert to_float(A * "B^2", {"B": 3.0}) == pytest.approx(6.3)
    assert [p.name for p in parameters_of(A * B + A)] == ["A", "B", "A"]
    assert Number(2.0) * 3 == Number(6.0)


def test_defaults_and_given_values():
    A = Parameter("A", 0.7)
    assert to_float(A) == 0.7
    assert to_float(A, {"A": 2.0}) == 2.0
    assert to_float(Parameter("A")) is None
    assert to_float("0*A") is None
    for text, values in (("1/A", {"A": 0.0}), ("sqrt(A)", {"A": -1.0}), ("A^A", {"A": 1e300})):
        assert to_float(text, values) is None


REFUSED = [
    ("__import__('os').system('x')", 'unexpected "\'"'),
    ("__import__(os)", "'__import__' is not a function here"),
    ("eval(1)", "'eval' is not a function here"),
    ("exec(A)", "'exec' is not a function here"),
    ("a.b()", "'a.b' is not a function here"),
    ("A.__class__.__mro__()", "is not a function here"),
    ("().__class__", "unexpected '.'"),
    ("[1]", "unexpected '['"),
    ("lambda: 1", "unexpected ':'"),
    ("A if B else 1", "unexpected 'if'"),
    ("A;B", "unexpected ';'"),
    ("A\nB", "unexpected 'B'"),
    ("A=1", "unexpected '='"),
    ("'A'", 'unexpected "\'"'),
    ("A%B", "unexpected '%'"),
    ("A//B", "unexpected '/'"),
    ("0x10", "unexpected 'x10'"),
    ("1_000", "unexpected '_000'"),
    ("2A", "unexpected 'A'"),
    ("2 A", "unexpected 'A'"),
    ("1e", "unexpected 'e'"),
    ("1.2.3", "unexpected '.3'"),
    ("a..b", "unexpected '.'"),
    ("", "it ends too early"),
    ("   ", "it ends too early"),
    ("A+", "it ends too early"),
    ("(A", "')' is missing"),
    ("A)", "unexpected ')'"),
    ("()", "unexpected ')'"),
    ("*A", "unexpected '*'"),
    ("A^^2", "unexpected '^'"),
    ("1,2", "unexpected ','"),
    ("sin", "sin needs its arguments in brackets"),
    ("sin 2", "sin needs its arguments in brackets"),
    ("sin(A, B)", "sin takes 1 argument(s), not 2"),
    ("atan2(1)", "atan2 takes 2 argument(s), not 1"),
    ("pi()", "unexpected '('"),
    ("nan", "nan is not a finite number"),
    ("-Inf", "Inf is not a finite number"),
    ("\u0663", "unexpected '\u0663'"),  # an Arabic digit
    ("\uff21", "unexpected '\uff21'"),  # a full-width A
    ("\u22121", "unexpected '\u2212'"),  # a minus sign
    ("\u03c0", "unexpected '\u03c0'"),  # a Greek pi
    ("A\u00a0+1", "unexpected"),  # a blank that is none
    ("A\u200b", "unexpected"),
    ("(" * 200 + "A" + ")" * 200, "it is nested too deeply"),
    ("sin(" * 5000 + "A" + ")" * 5000, "it is nested too deeply"),
    ("^".join(["A"] * 500), "it is nested too deeply"),
    ("+".join(["A"] * 5000), "more than 200 operations"),
    ("1/0", "'1/0' is not a finite number; correct it"),
    ("A + 0/0", "'0/0' is not a finite number"),
    ("sqrt(-1)", "'sqrt(-1)' is not a finite number"),
    ("(-1)^0.5", "is not a finite number"),
    ("1e400", "is not a finite number"),
    ("9" * 500, "is not a finite number"),
    ("10^400", "'10^400' is not a finite number"),
]


@pytest.mark.parametrize(("text", "reason"), REFUSED, ids=range(len(REFUSED)))
def test_texts_that_are_refused(text, reason):
    message = refused(
        ExpressionError, "arm/j3, d: ", reason, by=lambda: expression(text, "arm/j3, d")
    )
    assert len(message) < 400


@pytest.mark.parametrize(
    "value",
    [
        None,
        True,
        False,
        math.nan,
        math.inf,
        -math.inf,
        np.nan,
        [1],
        (1,),
        1j,
        b"1",
        10**400,
        np.zeros(2),
        np.array(True),
        casadi.DM(math.nan),
        casadi.DM([1, 2]),
    ],
    ids=repr,
)
def test_values_that_are_refused(value):
    refused(
        ExpressionError,
        "b, mass: ",
        "is not a finite number; give a number, a Parameter or a text such as 'pi/2 + A'",
        by=lambda: expression(value, "b, mass"),
    )


@pytest.mark.parametrize(
    "value", [3, 3.0, np.float32(3), np.int64(3), np.array(3), casadi.DM(3), "3", Number(3.0)]
)
def test_values_that_are_numbers(value):
    assert expression(value) == Number(3.0)


def test_long_chains_of_operations_can_still_be_used():
    value = expression("+".join(["A"] * 150))
    assert to_float(value, {"A": 2.0}) == 300
    assert number_of_sx(value, {"A": 2.0}) == 300
    assert to_float(str(renamed(value, "x")), {"x.A": 1.0}) == 150
    with pytest.raises(ExpressionError, match="split it into shorter ones"):
        sum([Parameter("A")] * 300)


def test_constants_fold():
    assert expression("2*pi/4 + 1 - 1") == Number(math.pi / 2)
    assert str(expression("A*(2-2)")) == "A*0"
    assert to_sx("A*(2-2)", {"A": SX.sym("A")}).is_zero()


@pytest.mark.parametrize(
    "name",
    [
        "",
        " A",
        "A ",
        "A\n",
        "2A",
        "a b",
        "a-b",
        "a..b",
        ".a",
        "é",
        "sin",
        "sqrt",
        "pi",
        "nan",
        "Inf",
        3,
        None,
    ],
)
def test_names_that_are_refused(name):
    refused(
        ExpressionError, f"parameter {name!r}: ", "choose another name", by=lambda: Parameter(name)
    )


@pytest.mark.parametrize("name", ["A", "_x", "L2", "arm.L2", "a.b.c_1", "sine", "PI", "lambda"])
def test_names_that_are_accepted(name):
    assert expression(name) == Parameter(name)


def test_units():
    for unit in UNITS:
        assert Parameter("A", unit=unit).unit == unit
    refused(
        ExpressionError,
        "parameter A: unit 'kg m' is unknown; use one of 1, s, rad",
        by=lambda: Parameter("A", unit="kg m"),
    )


@pytest.mark.parametrize("value", ["x", True, math.nan, "1"])
def test_defaults_are_numbers(value):
    refused(
        ExpressionError, "parameter A: ", "is not a finite number", by=lambda: Parameter("A", value)
    )


def test_scopes():
    A = Parameter("A", 0.3, "m", "length")
    moved = renamed(2 * A + sin_of(Parameter("in.B")), "left")
    assert str(moved) == "2*left.A+sin(left.in.B)"
    assert renamed(A, "left") == Parameter("left.A", 0.3, "m", "length")
    assert renamed(Number(2.0), "left") == Number(2.0)


def sin_of(value):
    return Operation("sin", (value,))
