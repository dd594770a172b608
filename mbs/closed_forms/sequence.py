"""Solution of a loop in steps: each step is one equation, and signs distinguish its roots."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import casadi
import numpy as np
from casadi import DM, SX, Function
from numpy.typing import NDArray

from mbs.numbers import NONZERO
from mbs.recursions.chain import Ring

# Problem: a loop, the symbols in it, and numeric samples at which it closes.


Matrix = NDArray[np.float64]

ZERO = 1e-9
"""Largest absolute value that counts as zero at the samples of a problem, for lengths [m] and
dimensionless numbers: samples are closed to about 1e-12, and an expression that does not vanish has
a value of about one at a sample."""


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """Loop whose joint positions are unknown.

    Attributes:
        ring: loop chain. The index of each joint is its index in x.
        x: (2 n, 1) symbols of the positions of its n joints [rad or m], then of n further angles
            that a solution may use, such as sums of joint angles.
        given: (m, 1) symbols of all known quantities: parameters, and the target pose.
        samples: values (n,) of x[:n] and (m,) of given at which the loop closes. Positions and
            symbolic lengths are generic.
    """

    ring: Ring
    x: SX
    given: SX
    samples: Sequence[tuple[Matrix, Matrix]]

    @property
    def size(self) -> int:
        """Number of joints."""
        return len(self.ring.joints)

    def at_samples(self, values: SX) -> list[Matrix]:
        """Return the value of an expression of x and given at every sample.

        Further angles, which are not joint positions, are zero.

        Args:
            values: expression.
        """
        function = Function("values", [self.x, self.given], [values])
        rest = np.zeros(self.x.numel() - self.size)
        return [
            np.array(DM(function(np.concatenate([x, rest]), given))) for x, given in self.samples
        ]

    def always_zero(self, values: SX) -> bool:
        """Whether all elements of an expression of x and given are zero at all samples.

        Args:
            values: expression.
        """
        return all(bool(np.all(np.abs(sample) < ZERO)) for sample in self.at_samples(values))


# Step of a solution: an equation that gives some joints, and the signs of its roots.


@dataclass(frozen=True, slots=True, eq=False)
class SequenceStep:
    """Step that solves some joints of a loop from known quantities and earlier joints.

    Attributes:
        indices: indices in x of the solved positions. Indices from n on are further angles.
        names: names of these positions in the equation.
        kind: type of the equation, such as "type 2" or "quartic".
        equation: readable equation in terms of the coefficients, such as
            "X3 cos(q3) + Y3 sin(q3) = Z3".
        signs: names of the signs, +1 or -1, that distinguish its roots; empty for a single root.
        coefficients: names of the coefficients in the equation.
        function: (x, given, s) -> (values, real, regular, coefficients). `values` has one row per
            index and is finite for all arguments. `real` has one row per dimensionless radicand;
            the root is real if no radicand is negative. `regular` has one row per dimensionless
            quantity that vanishes if the step does not determine a joint.
    """

    indices: tuple[int, ...]
    names: tuple[str, ...]
    kind: str
    equation: str
    signs: tuple[str, ...]
    coefficients: tuple[str, ...]
    function: Function


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """Expressions of x, given and signs that define a step.

    Attributes:
        values: expression by index in x.
        real: dimensionless radicands; negative if the root is not real.
        regular: dimensionless quantities; zero if a joint is undetermined.
        coefficients: expression by name.
    """

    values: Mapping[int, SX]
    real: Sequence[SX] = ()
    regular: Sequence[SX] = ()
    coefficients: Mapping[str, SX] | None = None


def step(
    problem: Problem, kind: str, equation: str, signs: Mapping[str, SX], found: Found
) -> SequenceStep:
    """Return a step that is defined by expressions.

    Args:
        problem: problem that the step solves in part.
        kind: type of the equation.
        equation: readable equation.
        signs: symbol of each sign, by name.
        found: expressions of the step.
    """
    s = casadi.vertcat(*signs.values())
    coefficients = dict(found.coefficients or {})
    columns = (found.values.values(), found.real, found.regular, coefficients.values())
    outputs = [casadi.densify(SX(casadi.vertcat(*column))) for column in columns]
    function = Function("step", [problem.x, problem.given, SX(s)], outputs, {"cse": True})
    indices = tuple(found.values)
    names = tuple(_name(problem, index) for index in indices)
    return SequenceStep(indices, names, kind, equation, tuple(signs), tuple(coefficients), function)


def _name(problem: Problem, index: int) -> str:
    """Return the name of the joint with this index in x, else the name of its symbol."""
    names = {joint.index: joint.name for joint in problem.ring.joints}
    return names.get(index, str(problem.x[index]))


# Sequence of steps: one configuration for each combination of signs.


@dataclass(frozen=True, slots=True, eq=False)
class Leaf:
    """Configuration for one combination of all signs.

    Attributes:
        x: (n, 1) positions of the joints.
        real: (r, 1) radicands of all steps.
        regular: (e, 1) quantities of all steps that must not vanish.
        coefficients: coefficients of all steps by name.
    """

    x: SX
    real: SX
    regular: SX
    coefficients: dict[str, SX]


@dataclass(frozen=True, slots=True, eq=False)
class StepSequence:
    """Solution of a loop in steps.

    The branch index b defines the signs: sign k, in the order of `signs`, is +1 if bit k of b,
    counted from the highest, is zero.

    Attributes:
        size: number of joints.
        steps: steps in their order. Together they solve every joint.
    """

    size: int
    steps: Sequence[SequenceStep]

    @property
    def signs(self) -> tuple[str, ...]:
        """Names of all signs, in the order of the steps."""
        return tuple(name for step in self.steps for name in step.signs)

    @property
    def branches(self) -> int:
        """Number of branches: combinations of signs."""
        return int(2 ** len(self.signs))

    def choice(self, branch: int) -> tuple[int, ...]:
        """Return the signs, +1 or -1, of branch b as a tuple in the order of `signs`."""
        count = len(self.signs)
        return tuple(-1 if branch >> (count - 1 - k) & 1 else 1 for k in range(count))

    def label(self, branch: int) -> str:
        """Return the label of a branch from its signs, such as "q3:+ q2:- q5:+"."""
        signs = zip(self.signs, self.choice(branch), strict=True)
        return " ".join(f"{name}:{'+' if sign > 0 else '-'}" for name, sign in signs)

    def leaf(self, given: SX, s: SX) -> Leaf:
        """Return the configuration for known quantities `given` and a vector s of all signs."""
        leaf, first = self._empty_leaf(), 0
        for step in self.steps:
            chosen = s[first : first + len(step.signs)]
            leaf, first = _after_step(leaf, step, given, chosen), first + len(step.signs)
        return self._without_sums(leaf)

    def leaves(self, given: SX) -> list[Leaf]:
        """Return the configurations of all branches in order, with common steps computed once.

        `given` (m, 1) are the known quantities.
        """
        leaves = [self._empty_leaf()]
        for step in self.steps:
            choices = list(itertools.product((1, -1), repeat=len(step.signs)))
            leaves = [
                _after_step(leaf, step, given, SX(casadi.DM(choice)))
                for leaf in leaves
                for choice in choices
            ]
        return [self._without_sums(leaf) for leaf in leaves]

    def _empty_leaf(self) -> Leaf:
        """Return the empty configuration before the first step."""
        return Leaf(SX(2 * self.size, 1), SX(0, 1), SX(0, 1), {})

    def _without_sums(self, leaf: Leaf) -> Leaf:
        """Return the configuration `leaf` without the positions that are sums of joint angles."""
        return Leaf(leaf.x[: self.size], leaf.real, leaf.regular, leaf.coefficients)


def _after_step(leaf: Leaf, step: SequenceStep, given: SX, s: SX) -> Leaf:
    """Return the configuration after a further `step`, with signs s that select its root.

    `leaf` is the configuration before, `given` are the known quantities.
    """
    values, real, regular, coefficients = step.function(leaf.x, given, s)
    x = SX(leaf.x)
    x[list(step.indices)] = values
    named = dict(zip(step.coefficients, casadi.vertsplit(coefficients), strict=True))
    return Leaf(
        x,
        casadi.vertcat(leaf.real, real),
        casadi.vertcat(leaf.regular, regular),
        leaf.coefficients | named,
    )


# Equations with two roots that one sign distinguishes: X cos t + Y sin t = Z, a r^2 + b r + c = 0.
#
# Both return a finite number for all arguments. If the roots are not real, it is the double root of
# the nearest fold.


@dataclass(frozen=True, slots=True, eq=False)
class Root:
    """Root of an equation, and measures of its validity.

    Attributes:
        value: angle in (-pi, pi] [rad], or number.
        real: dimensionless radicand; the root is real if it is not negative.
        regular: dimensionless; zero if every number is a root, or none.
    """

    value: SX
    real: SX
    regular: SX


def cosine_root(X: SX, Y: SX, Z: SX, sign: SX, scale: SX | float = 1.0) -> Root:
    """Return the root of X cos t + Y sin t = Z on one side of the direction (X, Y).

    Source: Khalil & Creusot 1997, section 3.3, equation of type 2.

    Args:
        X: factor of cos t.
        Y: factor of sin t.
        Z: right side.
        sign: +1 for the root at a positive angle from that direction, else -1.
        scale: typical size of the terms of the coefficients, in their unit.
    """
    size = X * X + Y * Y
    radicand = size - Z * Z
    W = sign * casadi.sqrt(casadi.fmax(radicand, NONZERO))
    angle = casadi.atan2(Y * Z + X * W, X * Z - Y * W)
    return Root(SX(angle), SX(radicand / (size + Z * Z + NONZERO)), SX(size / (scale * scale)))


def angle_of(s: SX, c: SX, scale: SX | float = 1.0) -> Root:
    """Return the angle whose sine and cosine are s and c times one positive factor.

    Args:
        s: sine times the factor.
        c: cosine times the factor.
        scale: typical size of s and c.
    """
    return Root(SX(casadi.atan2(s, c)), SX(1), SX((s * s + c * c) / (scale * scale)))


def square_root(square: SX, sign: SX, scale: SX | float = 1.0) -> Root:
    """Return the root of r^2 = square with a given sign.

    Args:
        square: square of the root.
        sign: +1 or -1.
        scale: typical size of r.
    """
    value = sign * casadi.sqrt(casadi.fmax(square, NONZERO))
    return Root(SX(value), SX(square / (scale * scale)), SX(1))


# Equations with four roots that two signs distinguish: quartics, as intersections of two conics.
#
# A trigonometric polynomial of degree 2 is a conic in the plane of (cos t, sin t); its roots are
# the intersections with the unit circle. The roots of a quartic in r are the intersections of a
# conic in the plane of (r^2, r) with the parabola. The pencil of the two conics contains a pair of
# real lines through all four points, which a cubic equation finds. The first sign selects the line,
# the second its intersection: the root at which the polynomial rises, or falls. A few Newton steps
# on the polynomial complete the solution.
#
# All results are finite for all arguments. If the roots are not real, the radicands are negative.
#
# Source: Richter-Gebert 2011, chapter 11, for the pencil and its lines.


TINY_SQUARE, _TINY_NUMBER = 1e-280, 1e-140
"""Values added to squares, and to numbers, to prevent division by zero: the second is the root of
the first, and its square is still a nonzero double."""
_NOISE = 1e-11  # rounding of a dimensionless trace that decides whether the lines are real
_FAR = 1e8  # largest root, relative to its scale
_STEPS = 3  # number of Newton steps
_MOST_STEP = 0.1  # twice the longest step [rad, or of the scale]: slopes are small near a fold


@dataclass(frozen=True, slots=True)
class _Curve:
    """Conic that contains all points of the unknown, and so the roots.

    Attributes:
        C: (3, 3) symmetric matrix of the conic, with determinant `determinant`.
        side: vector that distinguishes the pair of lines (l, m) from (m, l), by the sign of
            side . (l x m).
    """

    C: DM
    determinant: float
    side: tuple[float, float, float]


# not along an axis: for equations in cos t or sin t only, the lines intersect on an axis
_CIRCLE = _Curve(DM([[1, 0, 0], [0, 1, 0], [0, 0, -1]]), -1.0, (1.0, 0.6, 0.0))
_PARABOLA = _Curve(DM([[0, 0, -0.5], [0, 1, 0], [-0.5, 0, 0]]), -0.25, (0.0, 0.0, 1.0))


def trigonometric_quartic(a: SX, signs: SX, scale: SX | float = 1.0) -> Root:
    """Return a root of a0 cos 2t + a1 sin 2t + a2 cos t + a3 sin t + a4 = 0, selected by two signs.

    If the second sign is +1, the polynomial rises with t at the root.

    Args:
        a: (5, 1) coefficients.
        signs: (2, 1) signs, +1 or -1.
        scale: typical size of the terms of the coefficients, in their unit.

    Returns:
        Angle in (-pi, pi] [rad]; `real` has two rows.
    """
    size = casadi.sumsqr(a[:4])
    b = a / casadi.sqrt(casadi.sumsqr(a) + TINY_SQUARE)
    A = _symmetric((b[0] + b[4] / 3, b[1], b[2] / 2), (b[4] / 3 - b[0], b[3] / 2), 2 * b[4] / 3)
    line, other, split = _conic_line(A, _CIRCLE, signs[0])
    X, Y, Z = line[0], line[1], -line[2]
    square = X * X + Y * Y
    radicand = square - Z * Z
    foot = (other[0] * X + other[1] * Y) * Z + other[2] * square
    W = signs[1] * _minus_sign(foot) * casadi.sqrt(casadi.fmax(radicand, TINY_SQUARE))
    t = casadi.atan2(Y * Z + X * W, X * Z - Y * W + _TINY_NUMBER)
    for _ in range(_STEPS):
        t = t + _newton(*_trigonometric(b, t), _MOST_STEP)
    t = casadi.atan2(casadi.sin(t), casadi.cos(t))
    real = casadi.vertcat(split, radicand / (square + Z * Z + TINY_SQUARE))
    return Root(SX(t), SX(real), SX(size / (scale * scale)))


def real_quartic(
    coefficients: SX, signs: SX, scale: SX | float = 1.0, unit: SX | float = 1.0
) -> Root:
    """Return a root of a0 r^4 + a1 r^3 + a2 r^2 + a3 r + a4 = 0, selected by two signs.

    If the second sign is +1, the polynomial rises with r at the root. With four real roots and a
    positive first coefficient, the first sign +1 selects the larger two, and the second the larger
    of these. The first coefficient may vanish. An infinite root is replaced by a large number and
    is not regular.

    Args:
        coefficients: (5, 1) coefficients from the highest power.
        signs: (2, 1) signs, +1 or -1.
        scale: typical size of r, in its unit.
        unit: typical size of the terms of the coefficients, in the unit of the polynomial.

    Returns:
        Number in the unit of scale; `real` has two rows.
    """
    powers = casadi.vertcat(*(scale**k for k in (4, 3, 2, 1, 0)))
    scaled = coefficients * powers
    size = casadi.sumsqr(scaled[:4])
    b = scaled / casadi.sqrt(casadi.sumsqr(scaled) + TINY_SQUARE)
    A = _symmetric((b[0], b[1] / 2, b[2] / 6), (2 * b[2] / 3, b[3] / 2), b[4])
    line, other, split = _conic_line(A, _PARABOLA, signs[0])
    radicand = line[1] * line[1] - 4 * line[0] * line[2]
    foot = (
        other[0] * (line[1] * line[1] - 2 * line[0] * line[2])
        - other[1] * line[0] * line[1]
        + 2 * other[2] * line[0] * line[0]
    )
    sign = -signs[1] * _minus_sign(foot)
    r = _quadratic_root(line, sign * casadi.sqrt(casadi.fmax(radicand, TINY_SQUARE)))
    for _ in range(_STEPS):
        r = r + _newton(*_quartic(b, r), _MOST_STEP * casadi.sqrt(1 + r * r))
    r = casadi.fmax(casadi.fmin(r, _FAR), -_FAR)
    size_line = line[1] * line[1] + 4 * casadi.fabs(line[0] * line[2])
    real = casadi.vertcat(split, radicand / (size_line + TINY_SQUARE))
    finite = (line[0] ** 2 + line[1] ** 2) / (casadi.sumsqr(line) + TINY_SQUARE) / (1 + r * r) ** 2
    return Root(SX(r * scale), SX(real), SX(finite * size / (unit * unit)))


def _symmetric(row: tuple[SX, SX, SX], second: tuple[SX, SX], last: SX) -> SX:
    """Return the symmetric matrix (3, 3) [[a, b, c], [b, d, e], [c, e, last]].

    `row` is (a, b, c), `second` is (d, e).
    """
    (a, b, c), (d, e) = row, second
    return casadi.reshape(casadi.vertcat(a, b, c, b, d, e, c, e, last), 3, 3)


def _conic_line(A: SX, curve: _Curve, sign: SX) -> tuple[SX, SX, SX]:
    """Return one line of the degenerate conic of A and `curve`, the other line, and the radicand.

    Args:
        A: (3, 3) symmetric matrix with a norm of about 1 and no part along the curve: the trace of
            adj(C) A is zero.
        curve: conic of the unknown.
        sign: sign that selects the line.
    """
    M = _degenerate(A, curve)
    adjugate = _adjugate(M)
    sizes = [casadi.fabs(adjugate[k, k]) for k in range(3)]
    column = _of_largest(sizes, [adjugate[:, k] for k in range(3)])
    minor = -_of_largest(sizes, [adjugate[k, k] for k in range(3)])
    root = casadi.sqrt(casadi.fmax(minor, 0) + TINY_SQUARE)
    p = -column * root / (casadi.fabs(minor) + TINY_SQUARE)
    side = p[0] * curve.side[0] + p[1] * curve.side[1] + p[2] * curve.side[2]
    p = -sign * _minus_sign(side) * p
    N = M - casadi.skew(p)
    sums = [casadi.sumsqr(N[:, k]) for k in range(3)]
    line = _of_largest(sums, [N[:, k] for k in range(3)])
    weights = [casadi.fabs(line[k]) for k in range(3)]
    other = _of_largest(weights, [N[k, :].T * -_minus_sign(line[k]) for k in range(3)])
    return SX(line), SX(other), SX(minor / (casadi.sumsqr(M) + TINY_SQUARE))


def _degenerate(A: SX, curve: _Curve) -> SX:
    """Return A (3, 3) plus the multiple of the curve that gives two lines, real if possible."""
    adjugate = _adjugate(A)
    linear = casadi.sum1(casadi.sum2(adjugate * SX(curve.C))) / curve.determinant
    constant = casadi.dot(A[:, 0], adjugate[:, 0]) / curve.determinant
    pairs = [A + root * SX(curve.C) for root in _outer_roots(linear, constant)]
    first, second = (casadi.trace(_adjugate(M)) for M in pairs)
    keep = casadi.logic_or(first < -_NOISE, first <= second)
    return SX(casadi.if_else(keep, pairs[0], pairs[1]))


def _outer_roots(c: SX, d: SX) -> list[SX]:
    """Return the smallest and the largest real root of x^3 + c x + d = 0."""
    Q, R = -c / 3, d / 2
    D = R * R - Q * Q * Q
    angle = casadi.atan2(casadi.sqrt(casadi.fmax(-D, TINY_SQUARE)), R)
    size = -2 * casadi.sqrt(casadi.fmax(Q, TINY_SQUARE))
    cube = casadi.fabs(R) + casadi.sqrt(casadi.fmax(D, TINY_SQUARE))
    large = _minus_sign(R) * cube ** (1 / 3)
    single = large + Q * large / (large * large + TINY_SQUARE)
    several = [size * casadi.cos((angle + 2 * math.pi) / 3), size * casadi.cos(angle / 3)]
    roots = []
    for x in (casadi.if_else(D > 0, single, root) for root in several):
        for _ in range(2):
            x = x + _newton((x * x + c) * x + d, 3 * x * x + c, _MOST_STEP)
        roots.append(SX(x))
    return roots[::-1]


def _adjugate(M: SX) -> SX:
    """Return the adjugate (3, 3) of a symmetric matrix M (3, 3)."""
    a, b, c, d, e, f = M[0, 0], M[0, 1], M[0, 2], M[1, 1], M[1, 2], M[2, 2]
    off = (c * e - b * f, b * e - c * d, b * c - a * e)
    return _symmetric((d * f - e * e, off[0], off[1]), (a * f - c * c, off[2]), a * d - b * b)


def _of_largest(sizes: list[SX], values: list[SX]) -> SX:
    """Return the element (1, 1) of three `values` that belongs to the largest of three `sizes`."""
    late = casadi.if_else(sizes[2] > sizes[1], values[2], values[1])
    first = casadi.logic_and(sizes[0] >= sizes[1], sizes[0] >= sizes[2])
    return SX(casadi.if_else(first, values[0], late))


def _minus_sign(value: SX) -> SX:
    """Return -1 if the value is positive or zero, else 1."""
    return SX(casadi.if_else(value >= 0, -1.0, 1.0))


def _newton(value: SX, slope: SX, most: SX | float) -> SX:
    """Return Newton's step for a value and its slope, bounded by half of `most`."""
    # for slopes below 1e-15, which are rounding, the step tends to zero instead of infinity
    step = -value * slope / (slope * slope + 1e-30)
    return SX(step / (1 + (step / most) ** 2))


def _trigonometric(b: SX, t: SX) -> tuple[SX, SX]:
    """Return the polynomial of `trigonometric_quartic` with coefficients b at t, and its slope."""
    c, s = casadi.cos(t), casadi.sin(t)
    c2, s2 = c * c - s * s, 2 * s * c
    value = b[0] * c2 + b[1] * s2 + b[2] * c + b[3] * s + b[4]
    return value, 2 * (b[1] * c2 - b[0] * s2) + b[3] * c - b[2] * s


def _quartic(b: SX, r: SX) -> tuple[SX, SX]:
    """Return (value, slope) of the quartic with coefficients b (5, 1) at r, divided by (1 + r^2)^2.

    The slope is the derivative of the quartic by r.
    """
    value = (((b[0] * r + b[1]) * r + b[2]) * r + b[3]) * r + b[4]
    slope = ((4 * b[0] * r + 3 * b[1]) * r + 2 * b[2]) * r + b[3]
    size = (1 + r * r) ** 2
    return value / size, slope / size


def _quadratic_root(line: SX, root: SX) -> SX:
    """Return (-b + root) / (2 a) for `line` = (a, b, c), without cancellation and bounded."""
    a, b, c = line[0], line[1], line[2]
    up, down = root - b, -b - root
    steady = b * root <= 0
    over = casadi.if_else(steady, up, 2 * c)
    under = casadi.if_else(steady, 2 * a, down)
    r = over / (under - _minus_sign(under) * _TINY_NUMBER)
    return SX(casadi.fmax(casadi.fmin(r, _FAR), -_FAR))
