"""Pieper's method: arms with three intersecting axes, or with three prismatic joints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi
import numpy as np
from casadi import SX

from mbs.closed_forms.sequence import (
    TINY_SQUARE,
    ZERO,
    Found,
    Problem,
    Root,
    SequenceStep,
    StepSequence,
    cosine_root,
    real_quartic,
    square_root,
    step,
    trigonometric_quartic,
)
from mbs.errors import NoClosedForm
from mbs.recursions.chain import ChainJoint, Gap, Ring
from mbs.spatial import Pose, axis_rotation, vector

# Forms: quantities that depend on one joint, as coefficients of its elementary functions.
#
# A linear form has three coefficients: of cos q, sin q and 1 for a revolute joint, of r^2, r and 1
# for a prismatic joint. A symmetric matrix A (3, 3) of such coefficients represents b^T A b with
# b = (cos q, sin q, 1) or (r^2, r, 1).


@dataclass(frozen=True, slots=True, eq=False)
class PieperLoop:
    """Loop started and directed so that Pieper's method applies.

    Attributes:
        problem: problem to be solved.
        ring: loop chain, with start and direction chosen so that the joints solved last come last.
        length: typical length of the arm and of the pose [m].
    """

    problem: Problem
    ring: Ring
    length: SX

    def x(self, k: int) -> SX:
        """Return the symbol of the position of joint k of the loop chain."""
        return SX(self.problem.x[self.index(k)])

    def index(self, k: int) -> int:
        """Return the index in x of joint k of the loop chain."""
        index = self.ring.joints[k].index
        assert index is not None
        return index

    def after(self, k: int) -> Gap:
        """Return the known transform from joint k to the next joint."""
        return self.ring.gaps[(k + 1) % len(self.ring.gaps)]

    def motion(self, k: int) -> Pose:
        """Return the displacement of joint k in the direction of the loop chain."""
        return self.ring.joints[k].displacement(self.x(k))

    def suffix(self, k: int) -> str:
        """Return suffix, a number, of the names of the coefficients in the equation of joint k."""
        joints = self.problem.ring.joints
        digits = ["".join(c for c in joint.name if c.isdigit()) for joint in joints]
        number = joints.index(self._named(k))
        distinct = all(digits) and len(set(digits)) == len(digits)
        return digits[number] if distinct else str(number + 1)

    def _named(self, k: int) -> ChainJoint:
        """Return the joint of the original loop that is joint k of this loop chain."""
        name = self.ring.joints[k].name
        return next(joint for joint in self.problem.ring.joints if joint.name == name)

    def zero(self, values: SX) -> bool:
        """Whether dimensionless expressions are zero in all closed configurations.

        Args:
            values: expressions of the joint positions and the target.
        """
        return self.problem.always_zero(values)


def basis(loop: PieperLoop, k: int) -> SX:
    """Return the functions (3, 1) of a joint position, whose linear combinations are called forms.

    They are cos q, sin q, 1 for a revolute joint and r^2, r, 1 for a prismatic joint.

    Args:
        loop: loop with the joint.
        k: index of the joint in the loop chain.
    """
    x = loop.x(k)
    if loop.ring.joints[k].is_rotational:
        return casadi.vertcat(casadi.cos(x), casadi.sin(x), 1)
    return casadi.vertcat(x * x, x, 1)


def moved_point(joint: ChainJoint, point: SX) -> SX:
    """Return the coordinates of a point after the motion of a joint, as functions of its position.

    Args:
        joint: revolute or prismatic joint.
        point: (3, 1) point in the frame after the joint [m].

    Returns:
        (3, 3) coefficients of the functions `basis`, one row per coordinate.
    """
    x, y, z, sign = point[0], point[1], point[2], joint.sign
    if joint.is_rotational:
        return casadi.vertcat(
            casadi.horzcat(x, -sign * y, 0), casadi.horzcat(y, sign * x, 0), casadi.horzcat(0, 0, z)
        )
    return casadi.vertcat(
        casadi.horzcat(0, 0, x), casadi.horzcat(0, 0, y), casadi.horzcat(0, sign, z)
    )


def constant(value: SX) -> SX:
    """Return (3, 1) coefficients [0, 0, value] of a quantity that does not depend on a joint.

    They multiply the functions `basis` of the joint.

    Args:
        value: scalar expression.
    """
    return casadi.vertcat(0, 0, value)


def product(a: SX, b: SX) -> SX:
    """Return the product of two forms as a symmetric matrix A (3, 3), with b^T A b for b = `basis`.

    Args:
        a: (3, 1) coefficients of the first form.
        b: (3, 1) coefficients of the second form.
    """
    outer = casadi.mtimes(a, b.T)
    return SX((outer + outer.T) / 2)


# Three revolute joints from the rotation that they produce, if their axes intersect or if only
# orientations matter.
#
# Z(q1) A Z(q2) B Z(q3) = G; the element G_zz depends on the middle joint only.
#
# Source: Pieper 1968; Khalil & Creusot 1997, section 3.3 for the types of equations.


def three_angle_steps(
    loop: PieperLoop, revolute: tuple[int, int, int], A: SX, B: SX, G: SX
) -> list[SequenceStep]:
    """Return the steps of three revolute joints, from Z(q1) A Z(q2) B Z(q3) = G.

    Args:
        loop: loop with the joints.
        revolute: indices of the joints in the loop chain.
        A: (3, 3) rotation between the first two joints, not about z.
        B: (3, 3) rotation between the last two joints, not about z.
        G: (3, 3) rotation that the three joints produce, in terms of known joints.
    """
    first, middle, last = revolute
    Z1, Z2 = (_axis_rotation(loop, k) for k in (first, middle))
    seen = casadi.mtimes([A, Z2, B])
    column = casadi.mtimes([Z1, seen]).T @ G[:, 0]
    return [
        _middle_step(loop, middle, A[2, :].T, B[:, 2], G),
        _outer_step(loop, first, seen[:2, 2], G[:2, 2]),
        _outer_step(loop, last, SX(casadi.vertcat(1, 0)), column[:2]),
    ]


def _axis_rotation(loop: PieperLoop, k: int) -> SX:
    """Return the rotation matrix (3, 3) of joint k about its z axis, at its symbolic position."""
    return SX(axis_rotation("z", loop.ring.joints[k].sign * loop.x(k)).matrix)


def _middle_step(loop: PieperLoop, k: int, row: SX, column: SX, G: SX) -> SequenceStep:
    """Return the step of joint k, the middle one of three, from row^T Z column = G_zz.

    Z is the rotation of the joint, G (3, 3) the rotation of the three joints.
    """
    joint = loop.ring.joints[k]
    sign = SX.sym(joint.name)
    X = row[0] * column[0] + row[1] * column[1]
    Y = joint.sign * (row[1] * column[0] - row[0] * column[1])
    Z = G[2, 2] - row[2] * column[2]
    square = loop.zero(casadi.vertcat(row[2], column[2]))
    root = _square_angle(X, Y, Z, sign, G) if square else cosine_root(X, Y, Z, sign)
    end = loop.suffix(k)
    found = Found(
        {loop.index(k): root.value},
        () if square else (root.real,),
        (root.regular,),
        {f"X{end}": X, f"Y{end}": Y, f"Z{end}": Z},
    )
    q = joint.name
    text = f"X{end} cos({q}) + Y{end} sin({q}) = Z{end}"
    return step(loop.problem, "type 2", text, {q: sign}, found)


def _square_angle(X: SX, Y: SX, Z: SX, sign: SX, G: SX) -> Root:
    """Return the root of X cos q + Y sin q = Z for X^2 + Y^2 = 1.

    The other component, W with Z^2 + W^2 = 1, follows from the rotation G (3, 3). Its sign is
    `sign`.
    """
    W = sign * casadi.sqrt(G[0, 2] * G[0, 2] + G[1, 2] * G[1, 2])
    angle = casadi.atan2(Y * Z + X * W, X * Z - Y * W)
    return Root(SX(angle), SX(1), SX(1))


def _outer_step(loop: PieperLoop, k: int, start: SX, end: SX) -> SequenceStep:
    """Return the step of joint k, which rotates the vector `start` (2, 1) onto `end` (2, 1)."""
    return angle_step(loop, k, (start, end), 1.0)


def angle_step(
    loop: PieperLoop, k: int, vectors: tuple[SX, SX], scale: SX | float, regular: Sequence[SX] = ()
) -> SequenceStep:
    """Return the step of an angle that rotates a vector of the plane into a given direction.

    Args:
        loop: loop with the joint.
        k: index of the joint in the loop chain.
        vectors: vector (2, 1) before the rotation, and vector (2, 1) after it, of equal length.
        scale: typical length of both vectors, in their unit.
        regular: further dimensionless quantities that must not vanish.
    """
    joint = loop.ring.joints[k]
    start, end = vectors
    s = joint.sign
    X, Y, U, V = start[0], s * start[1], end[0], s * end[1]
    value = SX(casadi.atan2(V * X - U * Y, U * X + V * Y))
    size = (U * U + V * V) / (scale * scale)
    q, n = joint.name, loop.suffix(k)
    text = f"X{n} cos({q}) - Y{n} sin({q}) = U{n}, Y{n} cos({q}) + X{n} sin({q}) = V{n}"
    coefficients = {f"X{n}": X, f"Y{n}": Y, f"U{n}": U, f"V{n}": V}
    found = Found({loop.index(k): value}, (), (size, *regular), coefficients)
    return step(loop.problem, "type 3", text, {}, found)


# Steps that solve one joint from one equation, of degree 1 or 2 in its form.


_SMALL = 1e-30
"""Value added to the square of the first coefficient of a quadratic equation, dimensionless:
coefficients below 1e-15 are rounding, and the root is finite with it."""


def root_of_form(loop: PieperLoop, k: int, form: SX, unit: SX) -> SequenceStep | None:
    """Return the step of joint k from form = 0; None if the form does not depend on the joint.

    Args:
        loop: loop with the joint.
        k: index of the joint in the loop chain.
        form: (3, 1) coefficients of the functions `basis`.
        unit: typical size of the terms of the form, in its unit.
    """
    if not loop.ring.joints[k].is_rotational:
        return _polynomial(loop, k, [form[0], form[1], form[2]], unit)
    if loop.zero(form[:2] / unit):
        return None
    joint = loop.ring.joints[k]
    q, n, sign = joint.name, loop.suffix(k), SX.sym(joint.name)
    root = cosine_root(form[0], form[1], -form[2], sign, unit)
    found = Found(
        {loop.index(k): root.value},
        (root.real,),
        (root.regular,),
        {f"X{n}": form[0], f"Y{n}": form[1], f"Z{n}": -form[2]},
    )
    return step(loop.problem, "type 2", f"X{n} cos({q}) + Y{n} sin({q}) = Z{n}", {q: sign}, found)


def root_of_square(loop: PieperLoop, k: int, A: SX, unit: SX) -> SequenceStep | None:
    """Return the step of joint k from b^T A b = 0; None if it does not depend on the joint.

    Args:
        loop: loop with the joint.
        k: index of the joint in the loop chain.
        A: (3, 3) symmetric coefficients of products of the functions `basis`.
        unit: typical size of the terms of the sum, in its unit.
    """
    if not loop.ring.joints[k].is_rotational:
        powers = [A[0, 0], 2 * A[0, 1], A[1, 1] + 2 * A[0, 2], 2 * A[1, 2], A[2, 2]]
        return _polynomial(loop, k, powers, unit)
    mean = (A[0, 0] + A[1, 1]) / 2
    a = casadi.vertcat((A[0, 0] - A[1, 1]) / 2, A[0, 1], 2 * A[0, 2], 2 * A[1, 2], A[2, 2] + mean)
    if loop.zero(a[:2] / unit):
        return root_of_form(loop, k, a[2:], unit)
    joint = loop.ring.joints[k]
    q, n = joint.name, loop.suffix(k)
    signs = {f"{q}a": SX.sym(f"{q}a"), q: SX.sym(q)}
    root = trigonometric_quartic(a, casadi.vertcat(*signs.values()), unit)
    named = dict(zip((f"A{n}", f"B{n}", f"X{n}", f"Y{n}"), casadi.vertsplit(a[:4]), strict=True))
    named[f"Z{n}"] = -a[4]
    text = f"A{n} cos(2 {q}) + B{n} sin(2 {q}) + X{n} cos({q}) + Y{n} sin({q}) = Z{n}"
    found = Found({loop.index(k): root.value}, (root.real,), (root.regular,), named)
    return step(loop.problem, "quartic", text, signs, found)


def linear(
    loop: PieperLoop, k: int, factor: SX, value: SX, scale: SX | float = 1.0
) -> SequenceStep:
    """Return the step of a prismatic joint from factor x = value.

    Args:
        loop: loop with the joint.
        k: index of the joint in the loop chain.
        factor: coefficient of the position.
        value: right side [m], times the unit of the factor.
        scale: typical size of the factor, in its unit.
    """
    joint = loop.ring.joints[k]
    r, n, size = joint.name, loop.suffix(k), factor / scale
    x = value / scale * size / (size * size + TINY_SQUARE)
    regular = () if factor.is_constant() else (size * size,)
    found = Found({loop.index(k): x}, (), regular, {f"X{n}": factor, f"Y{n}": value})
    return step(loop.problem, "type 1", f"X{n} {r} = Y{n}", {}, found)


def _polynomial(loop: PieperLoop, k: int, factors: list[SX], unit: SX) -> SequenceStep | None:
    """Return the step of a prismatic joint from a polynomial; None if it has degree zero.

    `factors` are the coefficients, highest power first; `unit` is the typical size of its terms.
    """
    degree = len(factors) - 1
    while degree and loop.zero(factors[0] * loop.length**degree / unit):
        factors, degree = factors[1:], degree - 1
    if not degree:
        return None
    joint = loop.ring.joints[k]
    r, n = joint.name, loop.suffix(k)
    named = {f"{letter}{n}": factor for letter, factor in zip("ABCDE", factors, strict=False)}
    if degree == 1:
        return linear(loop, k, factors[0], -factors[1], unit / loop.length)
    text = _polynomial_text(list(named), r)
    signs = {name: SX.sym(name) for name in ((r,) if degree == 2 else (f"{r}a", r))}
    if degree == 2:
        root = _quadratic_root(factors, signs[r], loop.length, unit)
    else:
        five = casadi.vertcat(*[SX(0)] * (4 - degree), *factors)
        both = casadi.vertcat(*signs.values())
        root = real_quartic(five, both, loop.length, unit)
    found = Found({loop.index(k): root.value}, (root.real,), (root.regular,), named)
    kind = "quadratic" if degree == 2 else "quartic"
    return step(loop.problem, kind, text, signs, found)


def _polynomial_text(names: list[str], r: str) -> str:
    """Return the text of a polynomial equation in r, such as "A3 r3^2 + B3 r3 + C3 = 0".

    `names` are those of the coefficients, highest power first.
    """
    powers = [f" {r}^{k}" if k > 1 else f" {r}" for k in range(len(names) - 1, 0, -1)]
    return (
        " + ".join(f"{name}{power}" for name, power in zip(names, [*powers, ""], strict=True))
        + " = 0"
    )


def _quadratic_root(factors: list[SX], sign: SX, length: SX, unit: SX) -> Root:
    """Return the root of a r^2 + b r + c = 0 on the side `sign` of the mean of both roots.

    `factors` are a, b, c. It is finite for any a.

    `length` is a typical length of the root, `unit` the typical size of the terms.
    """
    a, b, c = factors[0] * length**2 / unit, factors[1] * length / unit, factors[2] / unit
    inverse = a / (a * a + _SMALL)
    middle = -b * inverse / 2
    root = square_root(middle * middle - c * inverse, sign)
    size = middle * middle + casadi.fabs(c * inverse) + TINY_SQUARE
    return Root(SX((middle + root.value) * length), SX(root.real / size), SX(a * a))


# Three joints that move a point to a target position.
#
# J1 [R1 t1] J2 f = p, where f(q3) is the point in the frame after joint 2. Invariants of joint 1
# give two equations that are linear in the functions of joint 2. Joint 2 is eliminated, and the
# remaining equation depends on joint 3 only.
#
# Source: Pieper 1968; Khalil & Creusot 1997, section 3.3 for the types of equations.


@dataclass(frozen=True, slots=True, eq=False)
class PointTarget:
    """Target position of a point that the first three joints move.

    Attributes:
        loop: loop with the joints.
        way: transform (R1, t1) from joint 1 to joint 2.
        f: (3, 3) forms in joint 3 of the point in the frame after joint 2.
        square: (3, 1) form of |f|^2.
        p: (3, 1) target position in the frame before joint 1 [m].
    """

    loop: PieperLoop
    way: Pose
    f: SX
    square: SX
    p: SX


def three_joints(loop: PieperLoop, point: SX, p: SX) -> list[SequenceStep] | None:
    """Return the steps of joints 3, 2 and 1; None if these equations do not determine them.

    Args:
        loop: loop whose first three joints are solved.
        point: (3, 1) point in the frame after joint 3 [m].
        p: (3, 1) target position in the frame before joint 1 [m].
    """
    joint, way = loop.ring.joints[2], loop.after(1).pose
    f = casadi.mtimes(way.R, moved_point(joint, point))
    f[:, 2] += way.p
    square = _squared_form(f, way.p, point) if joint.is_rotational else _squared_prismatic_form(f)
    reach = PointTarget(loop, loop.after(0).pose, f, square, p)
    steps = (
        _second_revolute(reach) if loop.ring.joints[1].is_rotational else _second_prismatic(reach)
    )
    return None if steps is None else [*steps, _first_joint(reach)]


def _squared_form(f: SX, t: SX, point: SX) -> SX:
    """Return |f|^2 as a form (3, 1) in a revolute joint 3, with f = t plus the rotated point.

    A form has the coefficients of cos q, sin q and 1.
    """
    middle = 2 * casadi.mtimes(f.T, t)
    return SX(middle + constant(casadi.sumsqr(point) - casadi.sumsqr(t)))


def _squared_prismatic_form(f: SX) -> SX:
    """Return |f|^2 as a form (3, 1) in a prismatic joint 3, from the forms f (3, 3).

    A form has the coefficients of r^2, r and 1.
    """
    u, v = f[:, 1], f[:, 2]
    return casadi.vertcat(casadi.sumsqr(u), 2 * casadi.dot(u, v), casadi.sumsqr(v))


def _two_equations(reach: PointTarget) -> tuple[list[SX], list[SX], list[SX]]:
    """Return two equations a . (J2 f) = h that do not depend on joint 1.

    They are vectors a (3, 1), forms h (3, 1) in joint 3, and the typical sizes of h.

    `reach` contains the target point and f, the point moved by joint 3; J2 is the motion of joint
    2.
    """
    loop, R, t = reach.loop, reach.way.R, reach.way.p
    if not loop.ring.joints[0].is_rotational:
        rows = [R[k, :].T for k in (0, 1)]
        return rows, [constant(reach.p[k] - t[k]) for k in (0, 1)], [loop.length] * 2
    known = casadi.sumsqr(reach.p) - casadi.sumsqr(t)
    turned = casadi.mtimes(R.T, t)
    forms = [(constant(known) - reach.square) / 2, constant(reach.p[2] - t[2])]
    return [turned, R[2, :].T], forms, [loop.length**2, loop.length]


def _second_revolute(reach: PointTarget) -> list[SequenceStep] | None:
    """Return the steps of joints 3 and 2 for a revolute joint 2; None if they are undetermined.

    `reach` contains the target point and the point that joint 3 moves.
    """
    loop = reach.loop
    (a, b), (h, k), (unit_h, unit_k) = _two_equations(reach)
    Z1, Z2 = h - a[2] * reach.f[2, :].T, k - b[2] * reach.f[2, :].T
    K = a[1] * b[0] - a[0] * b[1]
    unit_K = unit_h * unit_k / loop.length**2
    if loop.zero(K / unit_K):
        return _parallel(reach, (a, Z1, unit_h), (b, Z2, unit_k))
    U, V = a[1] * Z2 - b[1] * Z1, b[0] * Z1 - a[0] * Z2
    fx, fy = reach.f[0, :].T, reach.f[1, :].T
    A = product(U, U) + product(V, V) - K * K * (product(fx, fx) + product(fy, fy))
    third = root_of_square(loop, 2, A, (unit_K * loop.length) ** 2)
    if third is None:
        return None
    b3 = basis(loop, 2)
    point = casadi.mtimes(reach.f[:2, :], b3)
    target = casadi.vertcat(casadi.dot(U, b3), casadi.dot(V, b3)) * K / (K * K + TINY_SQUARE)
    regular = () if K.is_constant() else (K / unit_K,)
    return [third, angle_step(loop, 1, (point, target), loop.length, regular)]


def _parallel(
    reach: PointTarget, first: tuple[SX, SX, SX], second: tuple[SX, SX, SX]
) -> list[SequenceStep] | None:
    """Return the steps of joints 3 and 2 if both equations have proportional terms in joint 2.

    `first` and `second` are vector, form and typical size of an equation. None if they are
    undetermined.
    """
    loop, (a, Z1, unit), (b, Z2, unit_b) = reach.loop, first, second
    if loop.zero(b[:2] * loop.length / unit_b):
        if loop.zero(a[:2] * loop.length / unit):
            return None
        remaining, row, Z, unit_row = Z2, a, Z1, unit
        unit = unit_b
    else:
        square, mixed = casadi.sumsqr(b[:2]), casadi.dot(a[:2], b[:2])
        remaining, row, Z, unit_row = Z1 - mixed / square * Z2, b, Z2, unit_b
    third = root_of_form(loop, 2, remaining, unit)
    if third is None:
        return None
    b3 = basis(loop, 2)
    fx, fy = (casadi.dot(reach.f[k, :].T, b3) for k in (0, 1))
    s = loop.ring.joints[1].sign
    X, Y = row[0] * fx + row[1] * fy, s * (row[1] * fx - row[0] * fy)
    form = casadi.vertcat(X, Y, -casadi.dot(Z, b3))
    joint = root_of_form(loop, 1, form, unit_row)
    return None if joint is None else [third, joint]


def _second_prismatic(reach: PointTarget) -> list[SequenceStep] | None:
    """Return the steps of joints 3 and 2 for a prismatic joint 2; None if they are undetermined.

    `reach` contains the target point and the point that joint 3 moves.
    """
    rows, forms, _ = _two_equations(reach)
    left = [h - casadi.mtimes(reach.f.T, a) for a, h in zip(rows, forms, strict=True)]
    if reach.loop.ring.joints[0].is_rotational:
        return _revolute_then_prismatic(reach, rows[0], rows[1][2], (left[0], left[1]))
    return _two_displacements(reach, (rows[0][2], rows[1][2]), (left[0], left[1]))


def _two_displacements(
    reach: PointTarget, along: tuple[SX, SX], left: tuple[SX, SX]
) -> list[SequenceStep] | None:
    """Return the steps of joints 3 and 2 from two equations along[k] x2 = left[k], k = 0, 1.

    `along` are scalar factors of the displacement x2, `left` are forms (3, 1) in joint 3. None if
    they do not determine the joints.
    """
    loop, sign = reach.loop, reach.loop.ring.joints[1].sign
    third = root_of_form(loop, 2, along[1] * left[0] - along[0] * left[1], loop.length)
    if third is None:
        return None
    value = casadi.dot(along[0] * left[0] + along[1] * left[1], basis(loop, 2))
    square = along[0] * along[0] + along[1] * along[1]
    return [third, linear(loop, 1, square, sign * value)]


def _revolute_then_prismatic(
    reach: PointTarget, a: SX, along: SX, left: tuple[SX, SX]
) -> list[SequenceStep] | None:
    """Return the steps of joints 3 and 2 for a revolute joint 1 and a prismatic joint 2.

    With the displacement r of joint 2: r^2 / 2 + (f_z + a_z) r = left[0] and along r = left[1].
    None if they are undetermined.
    """
    loop, sign = reach.loop, reach.loop.ring.joints[1].sign
    height, b3 = reach.f[2, :].T + constant(a[2]), basis(loop, 2)
    if loop.zero(along):
        third = root_of_form(loop, 2, left[1], loop.length)
        form = casadi.vertcat(1, 2 * sign * casadi.dot(height, b3), -2 * casadi.dot(left[0], b3))
        second = root_of_form(loop, 1, form, loop.length**2)
        return None if third is None or second is None else [third, second]
    A = product(left[1], left[1]) + 2 * along * product(height, left[1])
    A -= 2 * along**2 * product(left[0], constant(SX(1)))
    third = root_of_square(loop, 2, A, loop.length**2)
    if third is None:
        return None
    return [third, linear(loop, 1, along, sign * casadi.dot(left[1], b3))]


def _first_joint(reach: PointTarget) -> SequenceStep:
    """Return the step of joint 1 once joints 2 and 3 are known.

    `reach` contains the target point and the point that joint 3 moves.
    """
    loop = reach.loop
    f = Pose.translation(casadi.mtimes(reach.f, basis(loop, 2)))
    w = (reach.way @ loop.motion(1) @ f).p
    joint = loop.ring.joints[0]
    if joint.is_rotational:
        return angle_step(loop, 0, (w[:2], reach.p[:2]), loop.length)
    return linear(loop, 0, SX(1), joint.sign * (reach.p[2] - w[2]))


# Three prismatic joints at any position in the loop: the revolute joints first, then three linear
# equations.
#
# Source: Pieper 1968; Khalil & Creusot 1997, section 3.3 for the types of equations.


def three_displacements(loop: PieperLoop) -> list[SequenceStep]:
    """Return the steps of a loop of three revolute and three prismatic joints.

    Raises:
        NoClosedForm: two revolute axes are always parallel, or the prismatic axes are coplanar.

    Args:
        loop: loop with these joints.
    """
    revolute = loop.ring
    for k in reversed([k for k, joint in enumerate(revolute.joints) if not joint.is_rotational]):
        revolute = revolute.without(k)
    names = ", ".join(joint.name for joint in revolute.joints)
    if any(loop.zero(gap.pose.R[:2, 2]) for gap in revolute.gaps):
        raise NoClosedForm(
            f"joints {names} are revolute and the others prismatic, but two of the three axes stay"
            " parallel, so that the angles are not determined"
        )
    first = int(np.argmax([len(casadi.symvar(gap.pose.R)) for gap in revolute.gaps]))
    begun = PieperLoop(loop.problem, revolute.rotated(first), loop.length)
    A, B, G = begun.after(0).pose.R, begun.after(1).pose.R, begun.after(2).pose.R.T
    return [*three_angle_steps(begun, (0, 1, 2), A, B, G), _displacements(loop)]


def _displacements(loop: PieperLoop) -> SequenceStep:
    """Return the step of the prismatic joints from the sum of translations around the loop.

    Raises NoClosedForm if the prismatic joints move in one plane.
    """
    path, indices, columns = Pose.identity(), list[int](), list[SX]()
    for k, (joint, gap) in enumerate(zip(loop.ring.joints, loop.ring.gaps, strict=True)):
        path = path @ gap.pose
        if joint.is_rotational:
            path = path @ loop.motion(k)
        else:
            columns.append(joint.sign * path.R[:, 2])
            indices.append(k)
    M = casadi.horzcat(*columns)
    adjugate = casadi.horzcat(*(_cross(M, k) for k in range(3))).T
    determinant = casadi.dot(M[:, 0], _cross(M, 0))
    if loop.zero(determinant):
        names = ", ".join(loop.ring.joints[k].name for k in indices)
        raise NoClosedForm(f"joints {names} move in one plane, so that they are not determined")
    r = -casadi.mtimes(adjugate, path.p) * determinant / (determinant * determinant + TINY_SQUARE)
    ends = [loop.suffix(k) for k in indices]
    values = {loop.index(k): r[m] for m, k in enumerate(indices)}
    return step(
        loop.problem,
        "linear",
        _displacement_text(loop, indices, ends),
        {},
        Found(values, (), (determinant * determinant,), _named(M, path.p, ends)),
    )


def _cross(M: SX, k: int) -> SX:
    """Return the vector product (3, 1) of the two columns after column k, cyclically."""
    return SX(casadi.cross(M[:, (k + 1) % 3], M[:, (k + 2) % 3]))


def _named(M: SX, p: SX, ends: list[str]) -> dict[str, SX]:
    """Return the elements of M (3, 3) and p (3, 1) as coefficients by name: X, Y, Z plus a suffix.

    `ends` are the suffixes of the three prismatic joints.
    """
    named = {f"{axis}{end}": M[m, k] for k, end in enumerate(ends) for m, axis in enumerate("XYZ")}
    return named | {f"{axis}0": p[m] for m, axis in enumerate("XYZ")}


def _displacement_text(loop: PieperLoop, indices: list[int], ends: list[str]) -> str:
    """Return the three linear equations of the displacements as text.

    `indices` are those of the prismatic joints, `ends` the suffixes of their coefficients.
    """
    names = [loop.ring.joints[k].name for k in indices]
    rows = (
        " + ".join(f"{axis}{end} {name}" for end, name in zip(ends, names, strict=True))
        for axis in "XYZ"
    )
    return ", ".join(f"{row} + {axis}0 = 0" for row, axis in zip(rows, "XYZ", strict=True))


# Arrangement of the loop for Pieper's method, and its steps.
#
# Source: Pieper 1968; Khalil & Creusot 1997, section 3.3 for the types of equations.


_JOINTS = 6


def pieper(problem: Problem) -> StepSequence:
    """Return the steps of a loop of six joints by Pieper's method.

    For three neighbouring axes that intersect in a point, the start and direction of the loop are
    chosen so that these joints come last. The first three joints move the point to its target; the
    last three joints set the orientation.

    Args:
        problem: problem with six joints.

    Raises:
        NoClosedForm: no three neighbouring axes intersect and no three joints are prismatic, or
            the arm is singular in all configurations.
    """
    names = [joint.name for joint in problem.ring.joints]
    if problem.size != _JOINTS:
        raise NoClosedForm(
            f"the loop has {problem.size} unknown joints ({', '.join(names)}), and Pieper's method"
            " takes six"
        )
    if sum(not joint.is_rotational for joint in problem.ring.joints) == 3:
        return StepSequence(
            _JOINTS, three_displacements(PieperLoop(problem, problem.ring, _length(problem)))
        )
    loops = _arrangements(problem)
    if not loops:
        raise NoClosedForm(_refusal(names))
    found = [steps for loop in loops if (steps := _concurrent_steps(loop)) is not None]
    regular = [steps for steps in found if _regular(problem, steps)]
    if not regular:
        raise NoClosedForm(_degenerate(loops))
    return min(
        (StepSequence(_JOINTS, steps) for steps in regular),
        key=lambda sequence: (
            sequence.branches,
            sum(step.kind == "quartic" for step in sequence.steps),
        ),
    )


def _concurrent_steps(loop: PieperLoop) -> list[SequenceStep] | None:
    """Return the steps of a loop whose last three axes intersect.

    None if the position equations do not determine joints 1 to 3.
    """
    ring = loop.ring
    first, last = (
        _common_normal(loop.after(3).pose)[0],
        _common_normal(loop.after(4).pose.inverse())[0],
    )
    point = (loop.after(2).pose @ Pose.translation(vector([0, 0, first]))).p
    target = (loop.after(5).inverse().pose @ Pose.translation(vector([0, 0, last]))).p
    steps = three_joints(loop, point, target)
    if steps is None:
        return None
    before = Pose.identity()
    for k in range(3):
        before = before @ loop.motion(k) @ loop.after(k).pose
    G = casadi.mtimes(ring.gaps[0].pose.R, before.R).T
    A, B = loop.after(3).pose.R, loop.after(4).pose.R
    return [*steps, *three_angle_steps(loop, (3, 4, 5), A, B, G)]


def _length(problem: Problem) -> SX:
    """Return a typical length of the arm and of the pose [m]."""
    squares = [casadi.sumsqr(gap.pose.p) for gap in problem.ring.gaps]
    return SX(casadi.sqrt(sum(squares, SX(TINY_SQUARE))))


def _arrangements(problem: Problem) -> list[PieperLoop]:
    """Return the loop with every start and direction for which its last three axes intersect."""
    length = _length(problem)
    found = list[PieperLoop]()
    for k in _concurrent(problem, length):
        forward = problem.ring.rotated((k + 3) % _JOINTS)
        backward = forward.reversed().rotated(3)
        found += [PieperLoop(problem, ring, length) for ring in (forward, backward)]
    return sorted(found, key=_pose_comes_first)


def _pose_comes_first(loop: PieperLoop) -> bool:
    """Whether the transform that contains the pose (the most symbols) follows joint 1."""
    counts = [len(casadi.symvar(gap.pose.matrix)) for gap in loop.ring.gaps]
    return counts[1] == max(counts)


def _regular(problem: Problem, steps: list[SequenceStep]) -> bool:
    """Whether the steps determine all joints of a generic configuration."""
    x, given = problem.x, problem.given
    return not any(
        problem.always_zero(quantity)
        for one in steps
        for quantity in casadi.vertsplit(one.function(x, given, SX.ones(len(one.signs)))[2])
    )


def _concurrent(problem: Problem, length: SX) -> list[int]:
    """Return the indices k for which the axes of joints k, k + 1 and k + 2 meet in one point.

    `length` is the typical length of the loop [m].
    """
    gaps, joints = problem.ring.gaps, problem.ring.joints
    after = [gaps[(k + 1) % _JOINTS].pose for k in range(_JOINTS)]
    ahead, behind = (
        [_common_normal(way) for way in after],
        [_common_normal(way.inverse()) for way in after],
    )
    rows = []
    for k in range(_JOINTS):
        (_, along, miss, bend), (_, back, lost, turn) = ahead[k], behind[(k + 1) % _JOINTS]
        rows.append(
            casadi.horzcat(bend, turn, *(far / length for far in (miss, lost, along - back)))
        )
    values = np.array(problem.at_samples(casadi.vertcat(*rows)))
    meet = np.all(np.abs(values[:, :, 2:]) < ZERO, axis=(0, 2))
    bent = np.all(np.abs(values[:, :, :2]) > ZERO, axis=(0, 2))
    three = [all(joints[(k + m) % _JOINTS].is_rotational for m in range(3)) for k in range(_JOINTS)]
    return [k for k in (3, 0, 1, 2, 4, 5) if meet[k] and bent[k] and three[k]]


def _common_normal(way: Pose) -> tuple[SX, SX, SX, SX]:
    """Return the common normal of the z axis of a frame and the z axis of another, as coordinates.

    Args:
        way: pose of the other frame.

    Returns:
        Coordinate of the normal on the z axis, coordinate on the other axis, a measure of the
        distance (zero if the axes intersect), and the squared sine between the axes.
    """
    p, a = way.p, way.R[:, 2]
    bend = a[0] * a[0] + a[1] * a[1]
    along = -(a[0] * p[0] + a[1] * p[1]) / bend
    return p[2] + along * a[2], along, p[0] * a[1] - p[1] * a[0], bend


def _refusal(names: list[str]) -> str:
    """Return the error text on a loop of joints `names` to which Pieper's method does not apply."""
    return (
        f"no three neighbouring axes of {names[0]} .. {names[-1]} meet in a point and no three"
        " joints are prismatic, so that Pieper's method does not apply; use the general method"
    )


def _degenerate(loops: list[PieperLoop]) -> str:
    """Return the error text on joints that the target does not determine.

    The names of the joints are those of the first loop in `loops`.
    """
    joints = loops[0].ring.joints
    first, last = (", ".join(joint.name for joint in part) for part in (joints[:3], joints[3:]))
    return (
        f"the axes of {last} meet in a point, but the positions of {first} do not follow from"
        " the target: the arm is singular in every configuration"
    )
