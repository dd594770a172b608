"""Three joints that carry a point to where it is wanted.

J1 [R1 t1] J2 f = p, where f(q3) is the point seen after joint 2. What joint 1 leaves unchanged
gives two equations in which joint 2 stands linearly, and joint 2 is eliminated from them; what
remains holds joint 3 alone.

Source: Pieper 1968; Khalil & Creusot 1997, section 3.3 for the types of equations.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi
from casadi import SX

from mbs.loops.sequence import Step
from mbs.models.inverse_geometry.pieper.forms import (
    PieperLoop,
    basis,
    constant,
    moved_point,
    product,
)
from mbs.models.inverse_geometry.pieper.orientation import turn_onto
from mbs.models.inverse_geometry.pieper.roots import linear, root_of_form, root_of_square
from mbs.spatial import Pose

_TINY = 1e-280


@dataclass(frozen=True, slots=True, eq=False)
class Reach:
    """The wanted position of a point.

    Attributes:
        scene: whose first three joints carry it.
        way: (R1, t1) from joint 1 to joint 2.
        f: (3, 3) forms in joint 3 of the point seen after joint 2.
        square: (3, 1) form of |f|^2.
        p: (3, 1) the wanted position [m].
    """

    scene: PieperLoop
    way: Pose
    f: SX
    square: SX
    p: SX


def three_joints(scene: PieperLoop, point: SX, p: SX) -> list[Step] | None:
    """The steps of joints 3, 2 and 1; None where these three cannot be found so.

    Args:
        scene: whose first three joints they are.
        point: (3, 1) seen after joint 3 [m].
        p: (3, 1) where it is wanted, seen before joint 1 [m].
    """
    joint, way = scene.ring.joints[2], scene.after(1).pose
    f = casadi.mtimes(way.R, moved_point(joint, point))
    f[:, 2] += way.p
    square = _square(f, way.p, point) if joint.turns else _slid_square(f)
    reach = Reach(scene, scene.after(0).pose, f, square, p)
    steps = _by_turning(reach) if scene.ring.joints[1].turns else _by_sliding(reach)
    return None if steps is None else [*steps, _first(reach)]


def _square(f: SX, t: SX, point: SX) -> SX:
    """The form of |f|^2, of a point that turns."""
    middle = 2 * casadi.mtimes(f.T, t)
    return SX(middle + constant(casadi.sumsqr(point) - casadi.sumsqr(t)))


def _slid_square(f: SX) -> SX:
    """The form of |f|^2, of a point that slides."""
    u, v = f[:, 1], f[:, 2]
    return casadi.vertcat(casadi.sumsqr(u), 2 * casadi.dot(u, v), casadi.sumsqr(v))


def _rows(reach: Reach) -> tuple[list[SX], list[SX], list[SX]]:
    """Two equations a . (J2 f) = h: vectors a, forms h, and the units of h."""
    scene, R, t = reach.scene, reach.way.R, reach.way.p
    if not scene.ring.joints[0].turns:
        rows = [R[k, :].T for k in (0, 1)]
        return rows, [constant(reach.p[k] - t[k]) for k in (0, 1)], [scene.length] * 2
    known = casadi.sumsqr(reach.p) - casadi.sumsqr(t)
    turned = casadi.mtimes(R.T, t)
    forms = [(constant(known) - reach.square) / 2, constant(reach.p[2] - t[2])]
    return [turned, R[2, :].T], forms, [scene.length**2, scene.length]


def _by_turning(reach: Reach) -> list[Step] | None:
    """Joints 3 and 2 where joint 2 turns."""
    scene = reach.scene
    (a, b), (h, k), (unit_h, unit_k) = _rows(reach)
    Z1, Z2 = h - a[2] * reach.f[2, :].T, k - b[2] * reach.f[2, :].T
    K = a[1] * b[0] - a[0] * b[1]
    unit_K = unit_h * unit_k / scene.length**2
    if scene.zero(K / unit_K):
        return _parallel(reach, (a, Z1, unit_h), (b, Z2, unit_k))
    U, V = a[1] * Z2 - b[1] * Z1, b[0] * Z1 - a[0] * Z2
    fx, fy = reach.f[0, :].T, reach.f[1, :].T
    A = product(U, U) + product(V, V) - K * K * (product(fx, fx) + product(fy, fy))
    third = root_of_square(scene, 2, A, (unit_K * scene.length) ** 2)
    if third is None:
        return None
    b3 = basis(scene, 2)
    point = casadi.mtimes(reach.f[:2, :], b3)
    wanted = casadi.vertcat(casadi.dot(U, b3), casadi.dot(V, b3)) * K / (K * K + _TINY)
    regular = () if K.is_constant() else (K / unit_K,)
    return [third, turn_onto(scene, 1, (point, wanted), scene.length, regular)]


def _parallel(
    reach: Reach, first: tuple[SX, SX, SX], second: tuple[SX, SX, SX]
) -> list[Step] | None:
    """Joints 3 and 2 where joint 2 stands in both equations in the same way, or in one alone."""
    scene, (a, Z1, unit), (b, Z2, unit_b) = reach.scene, first, second
    if scene.zero(b[:2] * scene.length / unit_b):
        if scene.zero(a[:2] * scene.length / unit):
            return None
        remaining, row, Z, unit_row = Z2, a, Z1, unit
        unit = unit_b
    else:
        square, mixed = casadi.sumsqr(b[:2]), casadi.dot(a[:2], b[:2])
        remaining, row, Z, unit_row = Z1 - mixed / square * Z2, b, Z2, unit_b
    third = root_of_form(scene, 2, remaining, unit)
    if third is None:
        return None
    b3 = basis(scene, 2)
    fx, fy = (casadi.dot(reach.f[k, :].T, b3) for k in (0, 1))
    s = scene.ring.joints[1].sign
    X, Y = row[0] * fx + row[1] * fy, s * (row[1] * fx - row[0] * fy)
    form = casadi.vertcat(X, Y, -casadi.dot(Z, b3))
    joint = root_of_form(scene, 1, form, unit_row)
    return None if joint is None else [third, joint]


def _by_sliding(reach: Reach) -> list[Step] | None:
    """Joints 3 and 2 where joint 2 slides."""
    rows, forms, _ = _rows(reach)
    left = [h - casadi.mtimes(reach.f.T, a) for a, h in zip(rows, forms, strict=True)]
    if reach.scene.ring.joints[0].turns:
        return _slide_in_turn(reach, rows[0], rows[1][2], (left[0], left[1]))
    return _two_slides(reach, (rows[0][2], rows[1][2]), (left[0], left[1]))


def _two_slides(reach: Reach, along: tuple[SX, SX], left: tuple[SX, SX]) -> list[Step] | None:
    """Joints 3 and 2 from along[k] x2 = left[k], two equations in the plane across joint 1."""
    scene, sign = reach.scene, reach.scene.ring.joints[1].sign
    third = root_of_form(scene, 2, along[1] * left[0] - along[0] * left[1], scene.length)
    if third is None:
        return None
    value = casadi.dot(along[0] * left[0] + along[1] * left[1], basis(scene, 2))
    square = along[0] * along[0] + along[1] * along[1]
    return [third, linear(scene, 1, square, sign * value)]


def _slide_in_turn(reach: Reach, a: SX, along: SX, left: tuple[SX, SX]) -> list[Step] | None:
    """Joints 3 and 2 where joint 1 turns and joint 2 slides.

    With r the way of joint 2: r^2 / 2 + (f_z + a_z) r = left[0] and along r = left[1].
    """
    scene, sign = reach.scene, reach.scene.ring.joints[1].sign
    height, b3 = reach.f[2, :].T + constant(a[2]), basis(scene, 2)
    if scene.zero(along):
        third = root_of_form(scene, 2, left[1], scene.length)
        form = casadi.vertcat(1, 2 * sign * casadi.dot(height, b3), -2 * casadi.dot(left[0], b3))
        second = root_of_form(scene, 1, form, scene.length**2)
        return None if third is None or second is None else [third, second]
    A = product(left[1], left[1]) + 2 * along * product(height, left[1])
    A -= 2 * along**2 * product(left[0], constant(SX(1)))
    third = root_of_square(scene, 2, A, scene.length**2)
    if third is None:
        return None
    return [third, linear(scene, 1, along, sign * casadi.dot(left[1], b3))]


def _first(reach: Reach) -> Step:
    """Joint 1, once the other two are known."""
    scene = reach.scene
    f = Pose.moved(casadi.mtimes(reach.f, basis(scene, 2)))
    w = (reach.way @ scene.motion(1) @ f).p
    joint = scene.ring.joints[0]
    if joint.turns:
        return turn_onto(scene, 0, (w[:2], reach.p[:2]), scene.length)
    return linear(scene, 0, SX(1), joint.sign * (reach.p[2] - w[2]))
