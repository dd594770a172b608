"""Regressor: equations of motion as a matrix times the inertial parameters of the links.

An element is the power of the unit wrench of a parameter of link j along a unit velocity of joint j
or an ancestor joint. A column of link j that is a linear combination of columns of its antecedent
is formed as that sum.

Source: Khalil & Creusot 1997, section 6.1; Gautier & Khalil 1990 for the sums.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial

import casadi
from casadi import SX

from mbs.assembly.tree import Tree
from mbs.components.joints import Motion
from mbs.recursions.link_motions import Acceleration, LinkPose, Velocity, unit_motions
from mbs.spatial import (
    Inertia,
    ScrewDisplacement,
    cross,
    elements,
    is_zero,
    origin,
    transform_inertia_along,
    vector,
    zeros,
)

# Columns of a link that are sums of columns of its antecedent.
#
# Some parts of a link move as if fixed on the antecedent: mass on the axis of a revolute joint, the
# rotational inertia of a link on a prismatic joint, the mass at the centre of a spherical joint.
#
# Source: Gautier & Khalil 1990.


_XX, _YY, _MZ, _M = 0, 3, 8, 9
_DEPTH = 9
_OWN_PRODUCTS = {**dict.fromkeys(range(6), 2), _MZ: 5, _M: 3}
"""Number of products to compute an element as the power of its unit wrench, by parameter index."""

Elements = Mapping[int, Callable[[int], SX]]
"""Map from row index to a callable that computes the element of a parameter, given its index."""


@dataclass(frozen=True, slots=True, eq=False)
class ColumnSum:
    """Column of link j as a linear combination of columns of its antecedent i.

    Attributes:
        terms: pairs of a constant and the columns of link i that it multiplies, as (index, sign).
        less: index of a column of link j to subtract, or None.
    """

    terms: tuple[tuple[SX, tuple[tuple[int, int], ...]], ...]
    less: int | None

    @property
    def products(self) -> int:
        """Number of products to compute an element: terms whose constant is not 1 or -1."""
        return sum(not (c.is_one() or c.is_minus_one()) for c, _ in self.terms)

    def of(self, before: SX, own: SX) -> SX:
        """Return the element in one row of the regressor.

        Args:
            before: (1, 10) row of the antecedent i.
            own: (1, 10) row of link j.
        """
        total = SX(0)
        for constant, columns in self.terms:
            part = SX(0)
            for column, sign in columns:
                part = part + before[column] if sign > 0 else part - before[column]
            total = total + constant * part
        return total if self.less is None else total - own[self.less]


def fill_rows(tree: Tree, poses: list[LinkPose], height: int, links: list[Elements]) -> list[SX]:
    """Return the regressor columns (height, 10) of the inertial parameters of each link.

    Args:
        tree: links of the tree.
        poses: pose of each link relative to its antecedent.
        height: number of rows.
        links: for each link, callables that compute the elements of columns that are not sums.
    """
    result: list[SX] = []
    for j, rows in enumerate(links):
        sums = column_sums(tree, poses, j)
        block, i = zeros(height, 10), tree.links[j].antecedent
        before = result[i] if i >= 0 else block
        for row, element in rows.items():
            for k in range(10):
                if k not in sums:
                    block[row, k] = element(k)
            for k, total in sums.items():
                block[row, k] = total.of(before[row, :], block[row, :])
        result.append(block)
    return result


def column_sums(tree: Tree, poses: list[LinkPose], j: int) -> dict[int, ColumnSum]:
    """Return the columns of link j that are cheaper as sums of other columns, by parameter index.

    Empty for a link on the base.

    Args:
        tree: links of the tree.
        poses: pose of each link relative to its antecedent.
        j: index of the link.
    """
    link = tree.links[j]
    if link.antecedent < 0:
        return {}
    parts: dict[int, tuple[int, ...]]
    match link.motion:
        case Motion.REVOLUTE:
            parts = {_YY: (_XX, _YY), _MZ: (_MZ,), _M: (_M,)}
        case Motion.PRISMATIC:
            parts = {k: (k,) for k in range(6)}
        case Motion.SPHERICAL:
            parts = {_M: (_M,)}
        case Motion.FREE:
            return {}
    sums = {k: _sum(link.motion, poses[j], part) for k, part in parts.items()}
    return {k: total for k, total in sums.items() if total.products <= _OWN_PRODUCTS[k]}


def _sum(motion: Motion, pose: LinkPose, part: tuple[int, ...]) -> ColumnSum:
    """Return the last column of `part` as a sum of columns of the antecedent.

    `part` are the indices of one or two parameters. The other column, if any, is subtracted.
    `motion` and `pose` are those of the joint and its link.
    """
    ten = zeros(10)
    for k in part:
        ten[k] = 1
    body, screw = Inertia.from_parameters(ten), pose.motion[0]
    if motion is Motion.PRISMATIC:
        body = body.rotate(screw.rotation)
    elif isinstance(screw, ScrewDisplacement):
        body = body.shift(2, screw.t)
    constants = elements(transform_inertia_along(pose.seat, body).parameters)
    return ColumnSum(_group(constants), _XX if len(part) > 1 else None)


def _group(constants: list[SX]) -> tuple[tuple[SX, tuple[tuple[int, int], ...]], ...]:
    """Return the constants grouped by equal value up to sign: (constant, ((column, sign), ...)).

    Zero constants are dropped.
    """
    groups: list[tuple[SX, list[tuple[int, int]]]] = []
    for column, constant in enumerate(constants):
        if constant.is_zero():
            continue
        for known, columns in groups:
            if casadi.is_equal(known, constant, _DEPTH):
                columns.append((column, 1))
                break
            if casadi.is_equal(known, -constant, _DEPTH):
                columns.append((column, -1))
                break
        else:
            groups.append((constant, [(column, 1)]))
    return tuple((constant, tuple(columns)) for constant, columns in groups)


# Unit velocities of the joints on the path to a link, in the frame of the link.
#
# Across a run of parallel axes a vector is rotated once, by the sum of the angles.


@dataclass(frozen=True, slots=True, eq=False)
class PathTwist:
    """Velocity of a link for a unit joint velocity, or the rate of this velocity.

    Attributes:
        row: index of the joint velocity.
        t: (3, 1) velocity of the origin of the frame.
        n: (3, 1) angular velocity.
    """

    row: int
    t: SX
    n: SX

    def at(self, p: SX) -> PathTwist:
        """Transform to another point, in the same axes.

        Args:
            p: (3, 1) vector from the present point to the new point [m].
        """
        return PathTwist(self.row, self.t + cross(self.n, p), self.n)

    def seen(self, turn: Callable[[SX], SX]) -> PathTwist:
        """Return the twist in other axes; `turn` expresses a vector (3, 1) in these axes."""
        return PathTwist(self.row, turn(self.t), turn(self.n))

    def rate(self, of: Velocity) -> PathTwist:
        """Return the rate of this twist if it is fixed on a link with the velocity `of`."""
        t = cross(of.V, self.n) + cross(of.w, self.t)
        return PathTwist(self.row, t, cross(of.w, self.n))


def path_twists(tree: Tree, poses: list[LinkPose]) -> list[list[PathTwist]]:
    """Return for each link the unit velocities of all joints on its path, in the frame of the link.

    Args:
        tree: links of the tree.
        poses: pose of each link relative to its antecedent.
    """
    return _path_twists(tree, poses, _unit_twists(tree, poses))


def path_twist_rates(
    tree: Tree, poses: list[LinkPose], velocities: list[Velocity]
) -> list[list[PathTwist]]:
    """Return the rates of `path_twists`, for an observer at rest.

    A unit velocity is fixed on the link of its joint or, for a backward joint, on the antecedent.

    Args:
        tree: links of the tree.
        poses: pose of each link relative to its antecedent.
        velocities: velocity of each link in its frame.
    """
    own = [
        [twist.rate(_direction_velocity(tree, poses[j], velocities, j)) for twist in twists]
        for j, twists in enumerate(_unit_twists(tree, poses))
    ]
    return _path_twists(tree, poses, own)


def _direction_velocity(tree: Tree, pose: LinkPose, velocities: list[Velocity], j: int) -> Velocity:
    """Return the velocity, in frame j, of the link to which the directions of joint j are fixed.

    `pose` is the pose of link j, and `velocities` are those of the links in their frames.
    """
    if not tree.links[j].backward:
        return velocities[j]
    i = tree.links[j].antecedent
    before = velocities[i] if i >= 0 else Velocity(zeros(), zeros())
    V = before.V + cross(before.w, pose.p)
    return Velocity(pose.apply_inverse(V), pose.apply_inverse(before.w))


def seen_by_links(tree: Tree, poses: list[LinkPose], vector: SX) -> list[SX]:
    """Return a vector (3, 1) given in the base frame in the axes of each link, by link.

    Args:
        tree: the links.
        poses: pose of each link relative to its antecedent.
        vector: (3, 1) vector in axes of the base.
    """
    result: list[SX] = []
    for link, pose in zip(tree.links, poses, strict=True):
        first = poses[pose.run[0]] if len(pose.run) > 1 else pose
        i = tree.links[pose.run[0]].antecedent if len(pose.run) > 1 else link.antecedent
        seat = first.at_seat(result[i] if i >= 0 else vector)
        result.append(pose.spin.apply_inverse(seat))
    return result


def _unit_twists(tree: Tree, poses: list[LinkPose]) -> list[list[PathTwist]]:
    """Return the unit velocities of the joint of each link, in the frame of the link."""
    return [
        [PathTwist(link.v.start + k, t, n) for k, (t, n) in enumerate(unit_motions(link, pose))]
        for link, pose in zip(tree.links, poses, strict=True)
    ]


def _path_twists(
    tree: Tree, poses: list[LinkPose], own: list[list[PathTwist]]
) -> list[list[PathTwist]]:
    """Return for each link the twists of all joints on its path, in the frame of the link.

    `own` are the twists of the joint of each link.
    """
    outer: list[list[PathTwist]] = []
    inner: list[list[PathTwist]] = []
    result: list[list[PathTwist]] = []
    for j, pose in enumerate(poses):
        i = tree.links[j].antecedent
        passed: list[PathTwist] = []
        if len(pose.run) > 1:
            p = poses[i].spin.apply(pose.p)
            seated = [twist.at(p) for twist in outer[i]]
            passed = [twist.at(pose.p).seen(pose.apply_inverse) for twist in inner[i]]
        else:
            before, p = result[i] if i >= 0 else [], origin(pose.motion)
            seated = [twist.at(pose.foot).seen(pose.at_seat).at(p) for twist in before]
        outer.append(seated)
        inner.append([*passed, *own[j]])
        result.append([twist.seen(pose.spin.apply_inverse) for twist in seated] + inner[j])
    return result


Unit = tuple[SX | None, SX | None]
"""Force and moment, or linear and angular momentum, for a unit parameter; None for zero."""


def inertial_regressor(tree: Tree, poses: list[LinkPose], motions: list[Acceleration]) -> list[SX]:
    """Return the regressor (nv, 10) of each link: joint efforts per unit inertial parameter.

    Args:
        tree: links of the tree.
        poses: pose of each link relative to its antecedent.
        motions: acceleration of each link; see `link_accelerations`.
    """
    return _work_of_units(tree, poses, [unit_wrenches(motion) for motion in motions])


def _work_of_units(tree: Tree, poses: list[LinkPose], units: list[list[Unit]]) -> list[SX]:
    """Return the power (nv, 10) of ten unit wrenches of each link along unit joint velocities.

    `units` are the wrenches of each link, one per inertial parameter.
    """
    links: list[Elements] = [
        {twist.row: partial(element, twist, own) for twist in twists}
        for own, twists in zip(units, path_twists(tree, poses), strict=True)
    ]
    return fill_rows(tree, poses, tree.nv, links)


def unit_wrenches(motion: Acceleration) -> list[Unit]:
    """Return the inertial wrenches of a link for a unit value of each of its ten parameters.

    They are about the origin and in axes of the link frame.

    Args:
        motion: motion of the link.
    """
    w, wd, vd, U = motion.w, motion.wd, motion.vd, motion.rate.U
    xy, xz, yz = w[0] * w[1], w[0] * w[2], w[1] * w[2]
    x_spread, y_spread, z_spread = motion.rate.spread
    moments = (
        (wd[0], xz, -xy),
        (-U[2, 0], U[2, 1], -z_spread),
        (U[1, 0], -y_spread, -U[1, 2]),
        (-yz, wd[1], xy),
        (-x_spread, -U[0, 1], U[0, 2]),
        (yz, -xz, wd[2]),
    )
    turning: list[Unit] = [(None, vector(moment)) for moment in moments]
    return [*turning, *((U[:, k], cross(axis(k), vd)) for k in range(3)), (vd, None)]


def axis(k: int) -> SX:
    """Return the unit vector (3, 1) of the coordinate axis 0, 1 or 2.

    Args:
        k: index of the axis.
    """
    result = zeros()
    result[k] = 1
    return result


def work(twist: PathTwist, unit: Unit) -> SX:
    """Return the power of a wrench along a velocity, both about the same point in the same axes.

    Args:
        twist: velocity.
        unit: force and moment; None for zero.
    """
    f, m = unit
    turning = SX(0) if m is None else SX(casadi.dot(twist.n, m))
    return turning if f is None else turning + casadi.dot(twist.t, f)


def element(twist: PathTwist, units: list[Unit], k: int) -> SX:
    """Return the power of the unit wrench of parameter k along a velocity.

    Args:
        twist: velocity.
        units: wrench for a unit value of each parameter, about the same point in the same axes.
        k: index of the parameter, 0 to 9.
    """
    return work(twist, units[k])


# Energy regressor: energy as a row times the inertial parameters of the links.
#
# Source: Gautier & Khalil 1988; Khalil & Creusot 1997, eq. 52.


def inertial_energy(tree: Tree, poses: list[LinkPose], velocities: list[Velocity]) -> list[SX]:
    """Return the row (1, 10) of each link whose product with its parameters is its energy [J].

    It is the kinetic and potential energy.

    Args:
        tree: links of the tree.
        poses: pose of each link relative to its antecedent.
        velocities: velocity of each link; see `link_velocities`.
    """
    ups = seen_by_links(tree, poses, -tree.gravity)
    heights: list[SX] = []
    links: list[Elements] = []
    for j, pose in enumerate(poses):
        i = tree.links[j].antecedent
        below, up = (heights[i], ups[i]) if i >= 0 else (SX(0), -tree.gravity)
        heights.append(below + casadi.dot(up, pose.p))
        row = unit_energies(velocities[j], ups[j], heights[j])
        links.append({0: row.__getitem__})
    return fill_rows(tree, poses, 1, links)


def unit_energies(velocity: Velocity, up: SX, height: SX) -> list[SX]:
    """Return the energies of a link for a unit value of each of its ten parameters.

    Args:
        velocity: velocity of the link, in its frame.
        up: (3, 1) minus gravity, in the frame of the link [m/s^2].
        height: potential energy of a unit mass at the origin of the frame [J/kg].
    """
    V, w = velocity.V, velocity.w
    x, y, z = w[0], w[1], w[2]
    turning = [0.5 * x * x, x * y, x * z, 0.5 * y * y, y * z, 0.5 * z * z]
    firsts = [casadi.dot(axis(k), cross(V, w) + up) for k in range(3)]
    return [*turning, *firsts, 0.5 * casadi.dot(V, V) + height]


# Momentum regressors, which do not need joint accelerations.
#
# The joint efforts are Gamma = d(D1 K)/dt + D2 K with the inertial parameters K: rate of the
# momentum along the joint axis, minus the term of the moving axis, plus gravity.
#
# Source: Khalil & Restrepo 1996; Khalil & Creusot 1997, eq. 41-43.


def momentum_regressor(tree: Tree, poses: list[LinkPose], velocities: list[Velocity]) -> list[SX]:
    """Return D1 (nv, 10) of each link: joint momenta per unit inertial parameter.

    Joint momenta are the derivatives of the kinetic energy by v.

    Args:
        tree: links of the tree.
        poses: pose of each link relative to its antecedent.
        velocities: velocity of each link; see `link_velocities`.
    """
    return _work_of_units(tree, poses, [unit_momenta(velocity) for velocity in velocities])


def position_regressor(tree: Tree, poses: list[LinkPose], velocities: list[Velocity]) -> list[SX]:
    """Return D2 (nv, 10) of each link, per unit inertial parameter.

    It is minus the derivative of kinetic minus potential energy by positions.

    Args:
        tree: links of the tree.
        poses: pose of each link relative to its antecedent.
        velocities: velocity of each link; see `link_velocities`.
    """
    links: list[Elements] = []
    paths = path_twists(tree, poses)
    rates = path_twist_rates(tree, poses, velocities)
    ups = seen_by_links(tree, poses, -tree.gravity)
    level = _level_rows(tree, paths, ups)
    for j, velocity in enumerate(velocities):
        units, lifts = unit_momenta(velocity), unit_lifts(ups[j])
        rows: dict[int, Callable[[int], SX]] = {}
        for twist, rate in zip(paths[j], rates[j], strict=True):
            raising = None if twist.row in level else twist
            rows[twist.row] = partial(_element, raising, rate, lifts, units)
        links.append(rows)
    return fill_rows(tree, poses, tree.nv, links)


def _level_rows(tree: Tree, paths: list[list[PathTwist]], ups: list[SX]) -> set[int]:
    """Return the indices in v of velocities without gravity effort.

    They belong to vertical rotation axes and horizontal translations. `paths` are the unit
    velocities on the path of each link, `ups` minus gravity in its frame.
    """
    own = [
        (twist, ups[j])
        for j, link in enumerate(tree.links)
        for twist in paths[j]
        if link.v.start <= twist.row < link.v.stop
    ]
    return {t.row for t, up in own if is_zero(cross(t.n, up)) and casadi.dot(t.t, up).is_zero()}


def unit_momenta(velocity: Velocity) -> list[Unit]:
    """Return the (linear, angular) momenta of a link for a unit value of each parameter.

    Args:
        velocity: velocity of the link, in its frame.
    """
    V, w = velocity.V, velocity.w
    turning = (
        (w[0], 0, 0),
        (w[1], w[0], 0),
        (w[2], 0, w[0]),
        (0, w[1], 0),
        (0, w[2], w[1]),
        (0, 0, w[2]),
    )
    inertias: list[Unit] = [(None, vector(angular)) for angular in turning]
    firsts: list[Unit] = [(cross(w, axis(k)), cross(axis(k), V)) for k in range(3)]
    return [*inertias, *firsts, (V, None)]


def unit_lifts(up: SX) -> list[Unit]:
    """Return the wrenches that hold a link against gravity, for a unit value of each parameter.

    Args:
        up: (3, 1) minus gravity, in the frame of the link [m/s^2].
    """
    nothing: Unit = (None, None)
    return [nothing] * 6 + [(None, cross(axis(k), up)) for k in range(3)] + [(up, None)]


def _element(
    twist: PathTwist | None, rate: PathTwist, lifts: list[Unit], units: list[Unit], k: int
) -> SX:
    """Return an element of the position regressor D2 for the inertial parameter of index k.

    Args:
        twist: motion along which `lifts` does work; None without gravity effort.
        rate: rate of the unit motion of the joint, whose product with `units` is subtracted.
        lifts: wrenches that hold the link against gravity, per unit parameter.
        units: momenta of the link per unit parameter.
        k: index of the parameter.
    """
    lifted = SX(0) if twist is None else work(twist, lifts[k])
    return lifted - work(rate, units[k])
