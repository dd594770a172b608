"""Symbolic rules for the inertial parameters of a tree that have no separate effect.

A parameter of link j either has no effect, or its effect is a combination of the effects of other
parameters: parameters of link j itself and, transformed by the lambda matrix, of its antecedent i.

Source: Gautier & Khalil 1990; Khalil & Bennis 1995; Khalil & Dombre 2002, section 9.4. The rules
for prismatic joints between revolute joints and for rotors of prismatic joints differ from the
sources, whose rules eliminate a parameter that has an effect, or keep a parameter that has no
separate effect.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

import casadi
import numpy as np
from casadi import DM, SX, Function
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.assembly.tree import Link, Tree
from mbs.components.joints import Motion
from mbs.identification.grouping.grouping import parameter_samples
from mbs.spatial import Inertia, MatrixRotation, Pose, cross, elements
from mbs.spatial.inertia import TEN_PARAMETERS

# Geometric relations of the axes of a tree (parallel, perpendicular, coaxial) and of gravity.

# They are decided numerically, with poses at the zero position for samples of the symbols. A
# relation that holds within 1e-9 for all samples is structural.


Array = NDArray[np.float64]

_SAME = 1e-9
"""Cosine, sine or length [m] below which a value counts as zero. Rounding errors of poses are
1e-15; axes of a file that are parallel to six digits only do not count as parallel."""
_TURNING = (Motion.REVOLUTE, Motion.SPHERICAL, Motion.FREE)


@dataclass(frozen=True, slots=True, eq=False)
class Structure:
    """Axes of a tree at its zero position, for samples of the symbols.

    Attributes:
        tree: the links.
        orientations: (samples, links, 3, 3) orientation of each frame relative to the base.
        origins: (samples, links, 3) origin of each frame in the base frame [m].
        gravity: (samples, 3) gravity in the base frame [m/s^2].
        base_moves: whether the base has an arbitrary prescribed motion.
    """

    tree: Tree
    orientations: Array
    origins: Array
    gravity: Array
    base_moves: bool

    @property
    def axes(self) -> Array:
        """Unit vectors (samples, links, 3) of the z axis of each frame, in the base frame."""
        return self.orientations[..., 2]

    def turning(self, links: list[int]) -> list[int]:
        """Return the link indices among `links` whose joint is revolute, spherical or free."""
        return [k for k in links if self.tree.links[k].motion in _TURNING]

    def sliding(self, links: list[int]) -> list[int]:
        """Return the link indices among `links` whose joint is prismatic."""
        return [k for k in links if self.tree.links[k].motion is Motion.PRISMATIC]

    def before(self, j: int) -> list[int]:
        """Return the indices of the links between the base and link j, without link j."""
        return self.tree.path(j)[:-1]

    def rests(self, links: list[int]) -> bool:
        """Whether a chain of the joints of `links` (indices) has a constant orientation."""
        return not self.base_moves and not self.turning(links)

    def one_direction(self, links: list[int]) -> bool:
        """Whether all rotations of the joints of `links` (indices) are about parallel axes."""
        turning = self.turning(links)
        if self.base_moves:
            return False
        if any(self.tree.links[k].motion is not Motion.REVOLUTE for k in turning):
            return False
        return all(self.parallel(turning[0], k) for k in turning)

    def parallel(self, j: int, k: int) -> bool:
        """Whether the joint axes of links j and k are parallel at the zero position."""
        return _vanishes(np.cross(self.axes[:, j], self.axes[:, k]))

    def never_parallel(self, j: int, k: int) -> bool:
        """Whether the axes of joints j and k are not parallel at zero position in any sample."""
        normal = np.cross(self.axes[:, j], self.axes[:, k])
        return bool(np.min(np.linalg.norm(normal, axis=1)) > _SAME)

    def perpendicular(self, j: int, k: int) -> bool:
        """Whether the joint axes of links j and k are perpendicular at the zero position."""
        return _vanishes(np.sum(self.axes[:, j] * self.axes[:, k], axis=1))

    def coaxial(self, j: int, k: int) -> bool:
        """Whether the joint axes of links j and k are on the same line at the zero position."""
        between = np.cross(self.origins[:, k] - self.origins[:, j], self.axes[:, j])
        return self.parallel(j, k) and _vanishes(between)

    def axes_in(self, k: int, j: int) -> Array:
        """Return the axis (samples, 3) of joint k in the axes of frame j at the zero position."""
        seen: Array = np.einsum("sab,sa->sb", self.orientations[:, j], self.axes[:, k])
        return seen

    def point_rests(self, j: int, points: Array) -> bool:
        """Whether points (samples, 3) on axis j are fixed under all joints that precede link j."""
        before = self.before(j)
        return not self.base_moves and all(self._keeps_points(k, points) for k in before)

    def _keeps_points(self, k: int, points: Array) -> bool:
        """Whether points (samples, 3) do not move under joint k: on its axis, or at its centre."""
        match self.tree.links[k].motion:
            case Motion.REVOLUTE:
                return self.on_axis(points, k)
            case Motion.SPHERICAL:
                return _vanishes(points - self.origins[:, k])
        return False

    def on_axis(self, points: Array, k: int) -> bool:
        """Whether points (samples, 3) in the base frame lie on the axis of link k."""
        return _vanishes(np.cross(points - self.origins[:, k], self.axes[:, k]))

    @property
    def weightless(self) -> bool:
        """Whether gravity is zero and the base at rest."""
        return not self.base_moves and _vanishes(self.gravity)

    def gravity_along(self, j: int) -> bool:
        """Whether gravity is zero or parallel to axis j at the zero position (fixed base)."""
        return not self.base_moves and _vanishes(np.cross(self.gravity, self.axes[:, j]))

    def gravity_across(self, j: int) -> bool:
        """Whether gravity is zero or perpendicular to axis j at the zero position (fixed base)."""
        return not self.base_moves and _vanishes(np.sum(self.gravity * self.axes[:, j], axis=1))

    def seen_from_link(self, k: int, j: int) -> Pose:
        """Return the pose of frame k in frame j at the zero position; k is an ancestor of j."""
        pose = Pose.identity()
        path = self.tree.path(j)
        for link in path[path.index(k) + 1 :]:
            pose = pose @ self.tree.links[link].pose()
        return pose.inverse()


def structure_of(system: System, *, base_moves: bool = False) -> Structure:
    """Return the axes of the tree of a system at its zero position.

    Args:
        system: open or closed.
        base_moves: whether the base has an arbitrary prescribed motion.
    """
    tree = system.tree
    poses: list[Pose] = []
    for link in tree.links:
        own = link.pose()
        poses.append(own if link.antecedent < 0 else poses[link.antecedent] @ own)
    turns = casadi.horzcat(SX(3, 0), *(pose.R for pose in poses))
    origins = casadi.horzcat(SX(3, 0), *(pose.p for pose in poses))
    sampled = parameter_samples(
        system, casadi.vertcat(casadi.vec(turns), casadi.vec(origins), tree.gravity)
    )
    outputs = [casadi.densify(x) for x in (turns, origins, tree.gravity)]
    at = Function("structure", [system.p], outputs)
    numbers = [[np.array(x) for x in at(p)] for p in sampled]
    return Structure(
        tree,
        np.array([x[0].T.reshape(-1, 3, 3).transpose(0, 2, 1) for x in numbers]),
        np.array([x[1].T for x in numbers]),
        np.array([x[2].ravel() for x in numbers]),
        base_moves,
    )


def _vanishes(values: Array) -> bool:
    """Whether all values are zero up to rounding; True for an empty array."""
    return bool(np.max(np.abs(values), initial=0.0) < _SAME)


# Common point of axis j and all preceding axes: a point of the link that never moves.


def resting_height(structure: Structure, j: int) -> SX | None:
    """Return the distance of a fixed point on axis j from the origin of frame j [m].

    None if no point of the axis is fixed.

    Args:
        structure: structure of the tree.
        j: index of a revolute link, from 0.
    """
    if structure.point_rests(j, structure.origins[:, j]):
        return SX(0)
    for k in structure.before(j):
        turns = structure.tree.links[k].motion is Motion.REVOLUTE
        if turns and structure.never_parallel(j, k):
            return _height_where_all_meet(structure, j, k)
    return None


def _height_where_all_meet(structure: Structure, j: int, k: int) -> SX | None:
    """Return the coordinate along axis j of its intersection with axis k [m]; None if it moves.

    `structure` contains the axes. j and k are link indices.
    """
    axes = structure.axes
    between = structure.origins[:, k] - structure.origins[:, j]
    normal = np.cross(axes[:, j], axes[:, k])
    square: Array = np.sum(normal**2, axis=1)
    height = np.sum(np.cross(between, axes[:, k]) * normal, axis=1) / square
    points = structure.origins[:, j] + height[:, None] * axes[:, j]
    if not structure.point_rests(j, points):
        return None
    pose = structure.seen_from_link(k, j)
    u = pose.R[:, 2]
    across = casadi.vertcat(-u[1], u[0], 0)
    return casadi.dot(cross(pose.p, u), across) / casadi.dot(across, across)


# Change of the reference frame of the ten inertial parameters of a body.


def lambda_transform(pose: Pose) -> SX:
    """Return the matrix (10, 10) that transforms inertial parameters from frame j to frame i.

    Column k contains the parameters in frame i of a body whose k-th parameter in frame j is one and
    whose other parameters are zero.

    Source: Gautier & Khalil 1990; Khalil & Dombre 2002, section 9.4.

    Args:
        pose: pose of frame j relative to frame i; lengths and angles may be symbols.
    """
    turn = MatrixRotation(pose.R)
    units = (Inertia.from_parameters(SX(DM.eye(10)[:, k])) for k in range(10))
    return casadi.horzcat(*(unit.seen_from(turn, pose.p).parameters for unit in units))


Key = tuple[int, str]
"""Key of a parameter: link index from 0, and kind."""

Effects = Mapping[Key, SX]
"""Coefficients by parameter."""

_TENSOR = TEN_PARAMETERS[:6]
_MOMENTS = TEN_PARAMETERS[6:9]
_Z = SX(DM([0, 0, 1]))
_LEAST = 1e-9
"""Magnitude below which an element of a unit vector counts as zero: far above rounding errors
of 1e-15."""


@dataclass(frozen=True, slots=True, eq=False)
class Removal:
    """Elimination of a parameter, and the combination of parameters with the same effect.

    Attributes:
        parameter: parameter that is eliminated.
        effects: combination of parameters with the same effect; empty if the parameter has no
            effect.
    """

    parameter: Key
    effects: Effects


def tree_rules(structure: Structure) -> Iterator[Removal]:
    """Yield the eliminations of parameters of a tree in order of application.

    They run from its last link to its first.

    Args:
        structure: structure of the tree.
    """
    for j in reversed(range(len(structure.tree.links))):
        yield from _moved_to_antecedent(structure, j)
        yield from _without_effect(structure, j)
        yield from _rotor_rules(structure, j)


def _moved_to_antecedent(structure: Structure, j: int) -> Iterator[Removal]:
    """Yield eliminations of parameters of link j that are regrouped with its antecedent.

    They have no effect if the antecedent is the base.
    """
    link = structure.tree.links[j]
    combinations: list[tuple[str, dict[str, float], dict[str, float]]] = []
    match link.motion:
        case Motion.REVOLUTE:
            combinations = [
                ("YY", {"XX": -1}, {"XX": 1, "YY": 1}),
                ("MZ", {}, {"MZ": 1}),
                ("M", {}, {"M": 1}),
            ]
        case Motion.PRISMATIC:
            combinations = [(name, {}, {name: 1}) for name in _TENSOR]
        case Motion.SPHERICAL:
            combinations = [("M", {}, {"M": 1})]
    if not combinations:
        return
    pose = link.pose()
    if link.motion is Motion.PRISMATIC:
        pose = Pose.rotation(pose.R)
    through = lambda_transform(pose) if link.antecedent >= 0 else None
    for name, own, moved in combinations:
        effects: dict[Key, SX] = {(j, kind): SX(x) for kind, x in own.items()}
        if through is not None:
            column = sum((x * _column(through, kind) for kind, x in moved.items()), SX(0))
            effects |= on_link(link.antecedent, column)
        yield Removal((j, name), effects)


def _without_effect(structure: Structure, j: int) -> Iterator[Removal]:
    """Yield the eliminations of parameters of link j that depend on the motions it can have."""
    match structure.tree.links[j].motion:
        case Motion.REVOLUTE:
            yield from _revolute_rules(structure, j)
        case Motion.PRISMATIC:
            yield from _prismatic_rules(structure, j)
        case Motion.SPHERICAL:
            yield from _spherical_rules(structure, j)


def _revolute_rules(structure: Structure, j: int) -> Iterator[Removal]:
    """Yield the eliminations for a revolute link j.

    A link that rotates about one direction has ZZ only. A link on a fixed axis along gravity has no
    MX and MY.
    """
    if structure.one_direction([*structure.before(j), j]):
        yield from _all_removed(j, ("XX", "XY", "XZ", "YZ"))
    if _is_on_fixed_line(structure, j):
        yield from _all_removed(j, ("MX", "MY"))
    elif structure.weightless:
        yield from _about_resting_point(structure, j)


def _is_on_fixed_line(structure: Structure, j: int) -> bool:
    """Whether axis j is a fixed line, with zero gravity or gravity along it.

    j is the index of the link; `structure` contains axes and gravity.
    """
    before = structure.before(j)
    return (
        structure.gravity_along(j)
        and structure.one_direction(before)
        and all(structure.coaxial(j, k) for k in structure.turning(before))
        and all(structure.parallel(j, k) for k in structure.sliding(before))
    )


def _about_resting_point(structure: Structure, j: int) -> Iterator[Removal]:
    """Yield the elimination of MX and MY about a fixed point on axis j, without gravity."""
    height = resting_height(structure, j)
    if height is None:
        return
    at_point = lambda_transform(Pose.translation(height * _Z))
    for name in ("MX", "MY"):
        effects = on_link(j, -_column(at_point, name))
        yield Removal((j, name), {key: x for key, x in effects.items() if key != (j, name)})


def _prismatic_rules(structure: Structure, j: int) -> Iterator[Removal]:
    """Yield eliminations of first moments of a prismatic link j, which need an earlier rotation."""
    before = structure.before(j)
    turning = structure.turning(before)
    if structure.rests(before):
        yield from _all_removed(j, _MOMENTS)
    elif structure.one_direction(before) and structure.parallel(turning[0], j):
        through = lambda_transform(structure.tree.links[j].pose())
        for name in ("MX", "MY"):
            antecedent = structure.tree.links[j].antecedent
            yield Removal((j, name), on_link(antecedent, _column(through, name)))
        yield from _all_removed(j, ("MZ",))
    elif structure.one_direction(before):
        yield _moment_along_rotation(structure, turning[0], j)


def _moment_along_rotation(structure: Structure, first: int, j: int) -> Removal:
    """Return the elimination of the first moment of link j along its only direction of rotation.

    It has no effect. With the axis (ax, ay, az) of link `first` in frame j, it is ax MX + ay MY +
    az MZ. The eliminated parameter is the last one whose factor is nonzero for all samples.
    """
    axis = structure.seen_from_link(first, j).R[:, 2]
    sizes = np.abs(structure.axes_in(first, j))
    least, most = np.min(sizes, axis=0), np.max(sizes, axis=0)
    leaving = max(k for k in range(3) if least[k] > _LEAST)
    others = (k for k in range(3) if k != leaving and most[k] > _LEAST)
    effects = {(j, _MOMENTS[k]): -axis[k] / axis[leaving] for k in others}
    return Removal((j, _MOMENTS[leaving]), effects)


def _spherical_rules(structure: Structure, j: int) -> Iterator[Removal]:
    """Yield the elimination of first moments of link j about a fixed centre, without gravity."""
    if structure.weightless and structure.point_rests(j, structure.origins[:, j]):
        yield from _all_removed(j, _MOMENTS)


def _rotor_rules(structure: Structure, j: int) -> Iterator[Removal]:
    """Yield the elimination of Ia or Jm of joint j if other parameters have the same effect."""
    effects, rotor = _rotor_effects(structure, j), structure.tree.links[j].rotor
    if effects is not None:
        yield Removal((j, "Ia"), effects)
    if rotor is not None and rotor.carrier < 0 and not structure.base_moves:
        same = {(j, "Ia"): SX(1)} if effects is None else effects
        scale = rotor.ratio**2
        yield Removal((j, "Jm"), {key: scale * x for key, x in same.items()})


def _rotor_effects(structure: Structure, j: int) -> Effects | None:
    """Return the parameters with the same effect as Ia of joint j; None if there are none."""
    link = structure.tree.links[j]
    match link.motion:
        case Motion.REVOLUTE if _turns_alone(structure, j):
            return {(j, "ZZ"): SX(1)}
        case Motion.SPHERICAL if structure.rests(structure.before(j)):
            return {(j, name): SX(1) for name in ("XX", "YY", "ZZ")}
        case Motion.PRISMATIC if _slides_alone(structure, j):
            return {(j, "M"): SX(1), **_mass_on_antecedent(link)}
    return None


def _turns_alone(structure: Structure, j: int) -> bool:
    """Whether the angular velocity of link j along its axis is that of its joint."""
    before = structure.before(j)
    turning = structure.turning(before)
    across = all(structure.perpendicular(k, j) for k in turning)
    return structure.rests(before) or (structure.one_direction(before) and across)


def _slides_alone(structure: Structure, j: int) -> bool:
    """Whether the velocity of link j along its axis is that of its joint, and gravity is across."""
    before = structure.before(j)
    return (
        structure.gravity_across(j)
        and structure.one_direction(before)
        and all(structure.parallel(k, j) for k in structure.turning(before))
        and all(structure.perpendicular(k, j) for k in structure.sliding(before))
    )


def _mass_on_antecedent(link: Link) -> dict[Key, SX]:
    """Return minus the parameters on the antecedent of a unit mass at the origin of the link.

    Empty if the antecedent is the base.
    """
    if link.antecedent < 0:
        return {}
    through = lambda_transform(link.pose())
    return on_link(link.antecedent, -_column(through, "M"))


def _column(through: SX, name: str) -> SX:
    """Return the column of a matrix (rows, 10) of the inertial parameter `name`, such as "XX".

    `through` is the matrix, such as a transform of inertial parameters.
    """
    return through[:, TEN_PARAMETERS.index(name)]


def on_link(link: int, column: SX) -> dict[Key, SX]:
    """Return a dict from (link, kind) to the nonzero inertial parameters in a column.

    Args:
        link: index of the link.
        column: (10, 1) inertial parameters.
    """
    pairs = zip(TEN_PARAMETERS, elements(column), strict=True)
    return {(link, name): x for name, x in pairs if not x.is_zero()}


def _all_removed(j: int, names: Iterable[str]) -> Iterator[Removal]:
    """Yield eliminations of the parameters `names` of link j, which have no effect at all."""
    yield from (Removal((j, name), {}) for name in names)
