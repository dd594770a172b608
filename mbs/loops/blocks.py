"""All configurations of loops without a closed form of their own, computed numerically in blocks.

If the plan of `mbs.loops.plan` cannot continue, a block is searched among the unsolved loops: gear
trains, plane loops that share unknown joints, one loop of up to six revolute and prismatic joints,
or a platform on six legs. The block takes the position of a stage, and the plan continues after it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, product
from typing import NamedTuple

import casadi
import numpy as np
from casadi import SX, Function
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.assembly.khalil_frames import Cut
from mbs.assembly.tables import CoordinateCoupling
from mbs.closed_forms.arm import Arm, inverse
from mbs.closed_forms.arm_certificate import (
    CertifiedArm,
    certified_arm,
    certified_configurations,
)
from mbs.closed_forms.arm_search import general_of
from mbs.closed_forms.hexapod import LEGS, is_rigid, poses
from mbs.closed_forms.planar_loops import KNOWN, PlanarLoops, planar_roots
from mbs.closed_forms.ring import (
    PARAMETERS,
    always_zero,
    extent,
    independent_indices,
    loop_links,
)
from mbs.closed_forms.roots import Roots
from mbs.components import Fixed, PointOnLine, Rod, Spherical
from mbs.components.joints import Freedom, Motion
from mbs.errors import LoopError, NoClosedForm
from mbs.expressions import to_sx
from mbs.loops.closing import Vector, closure_parameters, difference
from mbs.loops.plan import (
    LoopBlock,
    PlanWork,
    Stage,
    is_bound,
    order_steps,
    plan,
    posed_stages,
    started_at,
)
from mbs.numbers import NONZERO
from mbs.recursions.chain import ChainJoint, Ring
from mbs.solvers.rank import rank
from mbs.spatial import Pose, vector

Step = Stage | LoopBlock
Matrix = NDArray[np.float64]
Complex = NDArray[np.complex128]

_NEAR = 1e-5
"""Largest difference of positions [rad or m] between a root and its configuration: at 1e-12 of
closure, a configuration where two roots meet is accurate to the square root, 1e-6."""


def steps_of(system: System) -> tuple[Step, ...]:
    """Return the closed-form plan of a system, or else stages and blocks that solve its loops.

    Args:
        system: assembled mechanism.

    Raises:
        NoClosedForm: a loop has no closed form and belongs to no supported block.
    """

    def build() -> tuple[Step, ...]:
        known = independent_indices(system)
        try:
            return plan(system)
        except NoClosedForm:
            q = SX.sym("q", extent(system))
            return tuple(order_steps(system, known, q, _block))

    steps: tuple[Step, ...] = system.cached("steps", build)
    return steps


def _block(work: PlanWork, waiting: Sequence[int]) -> LoopBlock | None:
    """Return the first block of unsolved loops that a numerical method solves, or None.

    A block counts only if its solutions contain the assembled configuration.

    Args:
        work: state of the plan: known positions and solved loops.
        waiting: indices of the unsolved loops and couplings.
    """
    for find in (gear_trains, planar_blocks, single_loops, platforms):
        for block in find(work, waiting):
            if _gives_assembled(work, block):
                return block
    _require_held(work, waiting)
    return None


def _assembled(system: System) -> tuple[Vector, Vector]:
    """Return all positions (cut joints: zero) and p (np,) of the assembled configuration."""
    q = np.array(system.configuration)
    return started_at(system, q, range(system.nq)), closure_parameters(system)


def _gives_assembled(work: PlanWork, block: LoopBlock) -> bool:
    """Whether the solutions of a block contain the positions of the assembled configuration."""
    system = work.system
    q = np.array(system.configuration)
    try:
        roots = block.solve(*_assembled(system))
    except NoClosedForm:
        return False
    except LoopError:  # the loops move by themselves; `solve` raises this again when it is called
        return True
    indices = [k for k, index in enumerate(block.indices) if index < system.nq]
    for values in roots.values:
        reached = q.copy()
        reached[[block.indices[k] for k in indices]] = values[indices]
        if np.max(np.abs(difference(system, reached, q)), initial=0.0) < _NEAR:
            return True
    return False


# Rigid groups: sets of links that known joints connect.


class _Joined(NamedTuple):
    """Joint with unknown position between two rigid groups of links.

    Attributes:
        link: index of the child link.
        parent: rigid group on the parent side.
        at: frame of the joint at position zero, in the frame of the parent group.
    """

    link: int
    parent: int
    at: Pose


@dataclass(frozen=True, slots=True, eq=False)
class _RigidGroups:
    """Rigid groups of a tree. The name of a group is the index of its first link, -1 for the base.

    Attributes:
        group: group of each link.
        pose: pose of each link in the frame of the first link of its group.
        joints: unknown joint at the proximal end of each group, by group.
    """

    group: dict[int, int]
    pose: dict[int, Pose]
    joints: dict[int, _Joined]


def _groups(work: PlanWork) -> _RigidGroups:
    """Return the rigid groups: sets of links between which all joint positions are known."""
    group, pose, joints = {-1: -1}, {-1: Pose.identity()}, dict[int, _Joined]()
    for k, link in enumerate(work.system.tree.links):
        before = pose[link.antecedent] @ link.pose()
        if all(index in work.known for index in range(link.q.start, link.q.stop)):
            moved = ChainJoint(link.name, link.motion, link.q.start, 1)
            group[k] = group[link.antecedent]
            pose[k] = before @ moved.displacement(work.q[link.q.start : link.q.stop])
        else:
            group[k], pose[k] = k, Pose.identity()
            joints[k] = _Joined(k, group[link.antecedent], before)
    return _RigidGroups(group, pose, joints)


def _unknown_links(work: PlanWork, number: int) -> set[int]:
    """Return indices of links with unknown joint positions in the loop of cut joint `number`."""
    tree = work.system.tree
    back, out = loop_links(work.system, work.system.cuts[number])
    return {k for k in (*back, *out) if tree.links[k].q.start not in work.known}


def _connected(links: dict[int, set[int]]) -> list[list[int]]:
    """Partition loops into sets that share unknown joints, directly or through other loops.

    Args:
        links: indices of the links with unknown joints, by loop.
    """
    left, found = list(links), list[list[int]]()
    while left:
        own, before = [left.pop(0)], 0
        shared = set(links[own[0]])
        while len(own) != before:
            before = len(own)
            more = [number for number in left if links[number] & shared]
            own += more
            left = [number for number in left if number not in more]
            for number in more:
                shared |= links[number]
        found.append(sorted(own))
    return found


def _free_groups(work: PlanWork, waiting: Sequence[int]) -> Iterator[tuple[list[int], list[int]]]:
    """Yield sets of unsolved loops that share unknown joints, and the child links of these joints.

    Loops that a constraint other than a rod or a point on a line closes are omitted.
    """
    system = work.system
    links = {
        number: _unknown_links(work, number)
        for number in waiting
        if number < len(system.cuts) and not is_bound(system, number)
    }
    for numbers in _connected(links):
        yield numbers, sorted(set().union(*(links[n] for n in numbers)))


# Gear trains: loops of coaxial revolute joints and couplings, which are linear in the angles.


_MOST_TURNS = 4
"""Maximum number of loops of a gear train: combinations of full rotations of all loops are tried,
about five per loop."""
_SAME_ANGLE = 1e-9
"""Largest difference of equal angles [rad]: rounding of sums of a few angles is 1e-15."""


def gear_trains(work: PlanWork, waiting: Sequence[int]) -> Iterator[LoopBlock]:
    """Yield blocks of loops of coaxial revolute joints and couplings, such as differentials.

    The loops of a block share unknown joints.

    Args:
        work: state of the plan: known positions and solved loops.
        waiting: indices of the unsolved loops and couplings.
    """
    system, first = work.system, len(work.system.cuts)
    rings = {
        number: work.ring(number)
        for number in waiting
        if number < first and not is_bound(system, number)
    }
    unknown = {
        number: {_index(joint) for joint in ring.joints}
        for number, ring in rings.items()
        if _is_coaxial(work, ring)
    }
    couplings = dict(enumerate(system.couplings, first))
    for number in waiting:
        if number in couplings and _is_linear(work, couplings[number]):
            unknown[number] = set(couplings[number].coordinates) - work.known
    for numbers in _connected(unknown):
        train = _GearTrain.of(
            work,
            [rings[number] for number in numbers if number < first],
            [couplings[number] for number in numbers if number >= first],
        )
        if train is not None:
            names = [system.cuts[number].edge.joint.name for number in numbers if number < first]
            names += [couplings[number].name for number in numbers if number >= first]
            yield LoopBlock(", ".join(names), train.indices, train.roots)


def _is_coaxial(work: PlanWork, ring: Ring) -> bool:
    """Whether all unknown joints of a loop are revolute about one common line."""
    if any(joint.motion is not Motion.REVOLUTE for joint in ring.joints):
        return False
    across = [casadi.vertcat(gap.pose.R[0:2, 2], gap.pose.p[0:2]) for gap in ring.gaps]
    return always_zero(casadi.vertcat(*across), work.q, work.system.p)


def _is_linear(work: PlanWork, coupling: CoordinateCoupling) -> bool:
    """Whether a coupling of coordinates is linear in its unknown positions."""
    return coupling.driver in work.known or len(coupling.coefficients) <= _LINEAR


_LINEAR = 2
"""Largest number of coefficients of a polynomial of degree one."""


@dataclass(frozen=True, slots=True, eq=False)
class _GearTrain:
    """Linear equations A x = b of joint positions x of a gear train.

    Rows of loops are equations of angles and hold up to multiples of a full rotation.

    Attributes:
        indices: indices in q of the unknown positions x.
        looped: indices in x of the joints that are in loops.
        count: number of loops. Their rows come first in A.
        equations: Function (all positions, p) -> (A, b).
    """

    indices: tuple[int, ...]
    looped: list[int]
    count: int
    equations: Function

    @staticmethod
    def of(
        work: PlanWork, rings: list[Ring], couplings: list[CoordinateCoupling]
    ) -> _GearTrain | None:
        """Return the equations of loops of coaxial joints and of couplings.

        None without loops, with fewer equations than unknowns, or with more than four loops.
        """
        looped = {_index(joint) for ring in rings for joint in ring.joints}
        coupled = {number for coupling in couplings for number in coupling.coordinates}
        indices = tuple(sorted(looped | (coupled - work.known)))
        if not rings or len(rings) > _MOST_TURNS or len(rings) + len(couplings) < len(indices):
            return None
        rows = [_coaxial_row(ring, work.q) for ring in rings]
        rows += [coupling.value(work.q) - work.q[coupling.driven] for coupling in couplings]
        value = casadi.vertcat(*rows)
        x = casadi.vertcat(*(work.q[index] for index in indices))
        rest = -casadi.substitute(value, x, SX.zeros(len(indices)))
        system = work.system
        outputs = [casadi.densify(casadi.jacobian(value, x)), casadi.densify(rest)]
        equations = Function("gears", [work.q, system.p], outputs)
        places = [k for k, index in enumerate(indices) if index in looped]
        return _GearTrain(indices, places, len(rings), equations)

    def roots(self, q: Vector, p: Vector) -> Roots:
        """Return all solutions x for known positions q (all positions) and parameters p (np,).

        Angles of joints in loops are within half a rotation of zero. Raises NoClosedForm if the
        equations do not determine all unknown positions.
        """
        A, b = (np.array(value) for value in self.equations(q, p))
        if rank(A, _LOCKED) < len(self.indices):
            raise NoClosedForm("gears leave joints a motion while all that is known stays")
        b[: self.count] = np.remainder(b[: self.count] + np.pi, 2 * np.pi) - np.pi
        reach = np.sum(np.abs(A[: self.count]), axis=1) * np.pi + np.abs(b[: self.count, 0])
        most = [int(np.ceil(x / (2 * np.pi))) for x in reach]
        found = list[Vector]()
        for turns in product(*(range(-k, k + 1) for k in most)):
            right = b[:, 0] + 2 * np.pi * np.array([*turns, *[0] * (len(b) - self.count)])
            x: Vector = np.asarray(np.linalg.lstsq(A, right, rcond=None)[0], float)
            within = np.max(np.abs(x[self.looped])) < np.pi + _SAME_ANGLE
            # angles +pi and -pi are the same solution
            new = all(np.max(np.abs(np.exp(1j * x) - np.exp(1j * y))) > _SAME_ANGLE for y in found)
            if within and new and np.max(np.abs(A @ x - right)) < _SAME_ANGLE:
                found.append(x)
        # a full rotation of a loop joint restores a gear's angle only if the ratio is an integer
        ratios = A[self.count :]
        whole = bool(np.all(np.abs(ratios - np.round(ratios)) < _SAME_ANGLE))
        proof = "linear equations of angles"
        if not whole:
            proof += ", those of loops within half a turn"
        return Roots(np.array(found).reshape(-1, len(self.indices)), proof, whole)


def _coaxial_row(ring: Ring, q: SX) -> SX:
    """Return the closure error of a loop of coaxial revolute joints: angle [rad] as expression.

    q is the vector of all positions.
    """
    angle, turned, sense = SX(0), SX.eye(3), SX(1)
    for joint, gap in zip(ring.joints, [*ring.gaps[1:], ring.gaps[0]], strict=True):
        angle += sense * joint.sign * q[_index(joint)]
        turned, sense = turned @ gap.pose.R, sense * gap.pose.R[2, 2]
    return SX(angle + casadi.atan2(turned[1, 0], turned[0, 0]))


# Plane loops that share unknown joints.


_PARALLEL = 1e-9
"""Largest cosine between perpendicular directions: products of a few transforms leave 1e-15."""
_SAMPLES, _SEED = 3, 20260301
"""Number of random positions and parameters at which a property of a block must hold to count as
structural, and seed of the random numbers."""


def planar_blocks(work: PlanWork, waiting: Sequence[int]) -> Iterator[LoopBlock]:
    """Yield blocks of plane loops: all loops that share unknown joints, then smaller subsets.

    Args:
        work: state of the plan: known positions and solved loops.
        waiting: indices of the unsolved loops and couplings.
    """
    links = {
        number: _unknown_links(work, number)
        for number in waiting
        if number < len(work.system.cuts) and _is_flat_kind(work, number)
    }
    for together in _connected(links):
        for numbers in _some(together, links):
            plane = _Plane.of(work, numbers, sorted(set().union(*(links[n] for n in numbers))))
            if plane is not None:
                cuts = [work.system.cuts[number].edge.joint.name for number in numbers]
                indices = [work.system.tree.links[k].q.start for k in plane.links]
                yield LoopBlock(", ".join(cuts), tuple(indices), plane.roots)


_MOST = 6
"""Largest number of loops whose subsets are tried, 63 at most. Larger sets are tried as a whole."""


def _some(numbers: list[int], links: dict[int, set[int]]) -> Iterator[list[int]]:
    """Yield the whole set of loops, then each smaller subset that is connected by unknown joints.

    Args:
        numbers: indices of the loops.
        links: indices of the links with unknown joints, by loop.
    """
    yield numbers
    for count in range(len(numbers) - 1, 0, -1) if len(numbers) <= _MOST else ():
        for chosen in combinations(numbers, count):
            if len(_connected({number: links[number] for number in chosen})) == 1:
                yield list(chosen)


def _is_flat_kind(work: PlanWork, number: int) -> bool:
    """Whether a loop can be plane: unknown joints revolute or prismatic, closed by no rod.

    `number` is the index of the cut joint of the loop.
    """
    if is_bound(work.system, number) or isinstance(work.system.cuts[number].edge.joint, Rod):
        return False
    links = work.system.tree.links
    return all(links[k].motion.nq == 1 for k in _unknown_links(work, number))


@dataclass(frozen=True, slots=True, eq=False)
class _Plane:
    """Plane loops of a system.

    Attributes:
        system: mechanism with the loops.
        cuts: cut joints that close the loops.
        links: child links of the unknown joints, in the order of the tree.
        parents: rigid group that is the parent of each of these joints.
        ends: the two rigid groups of each cut joint.
        frames: Function (all positions, p) -> (4, 4) frames of the joints, then of both ends of
            each cut joint, in one row of blocks. Each frame is given in the frame of its group.
    """

    system: System
    cuts: list[Cut]
    links: list[int]
    parents: list[int]
    ends: list[tuple[int, int]]
    frames: Function

    @staticmethod
    def of(work: PlanWork, numbers: list[int], links: list[int]) -> _Plane | None:
        """Return the loops of cut joints `numbers`; None unless they are plane, in one plane."""
        groups, system = _groups(work), work.system
        cuts = [system.cuts[number] for number in numbers]
        poses = [groups.joints[k].at for k in links]
        for cut in cuts:
            poses += [groups.pose[cut.link_a] @ cut.pose_a, groups.pose[cut.link_b] @ cut.pose_b]
        values = casadi.horzcat(*(casadi.densify(pose.matrix) for pose in poses))
        plane = _Plane(
            system,
            cuts,
            links,
            [groups.joints[k].parent for k in links],
            [(groups.group[cut.link_a], groups.group[cut.link_b]) for cut in cuts],
            Function("frames", [work.q, system.p], [values]),
        )
        rng = np.random.default_rng(_SEED)
        for _ in range(_SAMPLES):
            q = rng.uniform(-1.5, 1.5, work.q.numel())
            if plane.drawing(q, rng.uniform(*PARAMETERS, system.p.numel())) is None:
                return None
        return plane

    def drawing(self, q: Vector, p: Vector) -> _Drawing | None:
        """Return the equations of the loops in their plane at known positions q, or None."""
        return _draw(self, _side_by_side(self.frames, q, p))

    def roots(self, q: Vector, p: Vector) -> Roots:
        """Return all solutions of loops at known positions q (all positions), parameters p (np,).

        Raises NoClosedForm if the loops are not plane there.
        """
        drawing = self.drawing(q, p)
        if drawing is None:
            raise NoClosedForm(
                f"{self.system.name}: loops that are plane elsewhere are not so here"
            )
        found = planar_roots(drawing.loops)
        n = drawing.loops.counts[0]
        values = drawing.positions(found.values[:, :n], found.values[:, n:])
        return replace(found, values=values)


@dataclass(slots=True)
class _Turn:
    """Angle of a rigid group in the plane: unknown angle plus a constant.

    Attributes:
        number: index of the unknown angle.
        offset: constant angle [rad].
    """

    number: int
    offset: float


@dataclass(frozen=True, slots=True, eq=False)
class _Drawing:
    """Plane loops as equations, and the relation of their unknowns to joint positions.

    Attributes:
        loops: equations with lengths as fractions of `size`.
        size: longest length in the loops [m].
        joints: for each revolute joint of the tree, the sign of its axis and the rotations of its
            two groups; for each prismatic joint, the index of its displacement.
    """

    loops: PlanarLoops
    size: float
    joints: list[tuple[int, _Turn, _Turn] | int]

    def positions(self, theta: Vector, s: Vector) -> Vector:
        """Return joint positions (r, k) [rad or m] at r roots: angles theta, displacements s."""
        whole = np.concatenate([theta, np.zeros((len(theta), 1))], axis=1)
        values = np.empty((len(theta), len(self.joints)))
        for k, joint in enumerate(self.joints):
            if isinstance(joint, int):
                values[:, k] = s[:, joint] * self.size
                continue
            sign, before, after = joint
            turn = whole[:, after.number] - whole[:, before.number] + after.offset - before.offset
            values[:, k] = sign * (np.pi - np.mod(np.pi - turn, 2 * np.pi))
        return values


@dataclass(slots=True)
class _Point:
    """Point of a rigid group in the plane, as a linear form with complex coefficients.

    Attributes:
        turned: vectors that rotate with a group, by index of its unknown angle.
        slid: directions of prismatic displacements, by index of the displacement.
    """

    turned: dict[int, complex]
    slid: dict[int, complex]

    def plus(self, number: int, value: complex) -> _Point:
        """Return the point plus a vector (as a complex number) that rotates with angle `number`."""
        return _Point({**self.turned, number: self.turned.get(number, 0) + value}, self.slid)

    def slides(self, number: int, value: complex) -> _Point:
        """Return the point plus displacement `number` along a direction `value`."""
        return _Point(self.turned, {**self.slid, number: value})


class _Bent(Exception):
    """Raised if the loops are not in one plane."""


def _draw(plane: _Plane, frames: Matrix) -> _Drawing | None:
    """Return the equations of plane loops; None if they are not plane.

    Args:
        plane: loops of the system.
        frames: (k, 4, 4) frames of joints and cut joints in their groups.
    """
    try:
        return _Draughtsman(plane, frames).drawing()
    except _Bent:
        return None


class _Draughtsman:
    """Builder of the equations of plane loops from their frames with all unknown joints at zero."""

    def __init__(self, plane: _Plane, frames: Matrix) -> None:
        self.plane = plane
        n = len(plane.links)
        top = next(k for k in plane.parents if k not in plane.links)
        self.zero = {top: np.eye(4)}
        for k, parent, at in zip(plane.links, plane.parents, frames[:n], strict=True):
            self.zero[k] = self.zero[parent] @ at
        self.a = [self.zero[a] @ T for (a, _), T in zip(plane.ends, frames[n::2], strict=True)]
        self.b = [
            self.zero[b] @ T for (_, b), T in zip(plane.ends, frames[n + 1 :: 2], strict=True)
        ]
        self.normal = self._normal()
        across = np.cross(self.normal, np.eye(3)[np.argmin(np.abs(self.normal))])
        self.x = across / np.linalg.norm(across)
        self.y = np.cross(self.normal, self.x)
        self.turns = {top: _Turn(KNOWN, 0.0)}
        self.points = {top: _Point({KNOWN: self.vector(np.zeros(3))}, {})}
        self.carriers = list[int]()

    def _normal(self) -> Vector:
        """Return the normal (3,) of the plane: axis of the first revolute joint.

        Raise _Bent without one.
        """
        links = self.plane.system.tree.links
        for k in self.plane.links:
            if links[k].motion is Motion.REVOLUTE:
                normal: Vector = self.zero[k][:3, 2]
                return normal
        raise _Bent

    def vector(self, value: Vector) -> complex:
        """Return the components of a vector (3,) in the plane, as real and imaginary part."""
        return complex(self.x @ value, self.y @ value)

    def drawing(self) -> _Drawing:
        """Return the equations of all loops."""
        joints = [
            self._pass(k, parent)
            for k, parent in zip(self.plane.links, self.plane.parents, strict=True)
        ]
        welds = list[tuple[int, int, float]]()
        rows = [self._close(number, welds) for number in range(len(self.plane.cuts))]
        merged = self._merge(welds)
        return self._equations(rows, joints, merged)

    def _pass(self, k: int, parent: int) -> tuple[int, int] | int:
        """Compute angle and origin of the group after a joint; return data of the joint's position.

        Args:
            k: child link of the joint, which names the group after it.
            parent: group on the parent side.

        Returns:
            (sign of the axis along the normal, parent group) of a revolute joint; index of the
            displacement of a prismatic joint.

        Raises:
            _Bent: the axis is neither normal to the plane nor in it.
        """
        axis = self.zero[k][:3, 2]
        cosine = float(self.normal @ axis)
        before = self.turns[parent]
        step = self.vector(self.zero[k][:3, 3] - self.zero[parent][:3, 3])
        point = self.points[parent].plus(before.number, step * np.exp(1j * before.offset))
        if self.plane.system.tree.links[k].motion is Motion.REVOLUTE:
            if abs(cosine) < 1 - _PARALLEL:
                raise _Bent
            self.turns[k], self.points[k] = _Turn(k, 0.0), point
            return (1 if cosine > 0 else -1), parent
        if abs(cosine) > _PARALLEL:
            raise _Bent
        self.turns[k] = _Turn(before.number, before.offset)
        self.points[k] = self._slide(point, axis, before)
        return len(self.carriers) - 1

    def _slide(self, point: _Point, axis: Vector, turn: _Turn) -> _Point:
        """Return the point plus a new unknown displacement along an axis (3,)."""
        self.carriers.append(turn.number)
        return point.slides(len(self.carriers) - 1, self.vector(axis) * np.exp(1j * turn.offset))

    def _end(self, group: int, frame: Matrix) -> _Point:
        """Return the origin of a frame (4, 4) of a group as a point of that group.

        The frame is given with all unknown joints at zero.
        """
        turn = self.turns[group]
        step = self.vector(frame[:3, 3] - self.zero[group][:3, 3])
        return self.points[group].plus(turn.number, step * np.exp(1j * turn.offset))

    def _close(self, number: int, welds: list[tuple[int, int, float]]) -> _Point:
        """Return the closure vector of a cut joint, which is zero if the loop is closed.

        If the joint prevents relative rotation, (group a, group b, angle between them) is appended
        to `welds`.
        """
        cut, (group_a, group_b) = self.plane.cuts[number], self.plane.ends[number]
        frame_a, frame_b = self.a[number], self.b[number]
        a, b = self._end(group_a, frame_a), self._end(group_b, frame_b)
        turning, axes = self._freedoms(cut, frame_a)
        for axis in axes:
            a = self._slide(a, axis, self.turns[group_a])
        if not turning:
            side = int(np.argmin(np.abs(self.normal @ frame_a[:3, :3])))
            turn = np.angle(self.vector(frame_b[:3, side]) / self.vector(frame_a[:3, side]))
            welds.append((group_a, group_b, float(turn)))
        turned = dict(a.turned)
        for k, value in b.turned.items():
            turned[k] = turned.get(k, 0) - value
        slid = dict(a.slid)
        for k, value in b.slid.items():
            slid[k] = slid.get(k, 0) - value
        return _Point(turned, slid)

    def _freedoms(self, cut: Cut, frame: Matrix) -> tuple[bool, list[Vector]]:
        """Return whether a cut joint rotates in the plane, and its translation axes (3,).

        Raises:
            _Bent: a freedom leaves the plane.
        """
        joint = cut.edge.joint
        if cut.welded or isinstance(joint, Fixed):
            return False, []
        if isinstance(joint, Spherical):
            return True, []
        if isinstance(joint, PointOnLine):
            axis = frame[:3, :3] @ np.array(joint.axis)
            if abs(self.normal @ axis) > _PARALLEL:
                raise _Bent
            return True, [axis]
        turning, axes = False, list[Vector]()
        for freedom in joint.freedoms:
            axis = frame[:3, :3] @ np.array(freedom.axis)
            cosine = abs(float(self.normal @ axis))
            if freedom.motion is Motion.REVOLUTE and cosine > 1 - _PARALLEL:
                turning = True
            elif freedom.motion is Motion.PRISMATIC and cosine < _PARALLEL and not turning:
                axes.append(axis)
            elif freedom.motion not in (Motion.REVOLUTE, Motion.PRISMATIC) or turning:
                raise _Bent
        return turning, axes

    def _merge(self, welds: list[tuple[int, int, float]]) -> dict[int, _Turn]:
        """Return the angle of each group in terms of independent angles.

        Args:
            welds: pairs of groups with a constant angle between them: (group a, group b, angle
                [rad]).
        """
        merged = {k: _Turn(k, 0.0) for k in [KNOWN, *self.plane.links]}

        def resolved(turn: _Turn) -> _Turn:
            found = merged[turn.number]
            return _Turn(found.number, found.offset + turn.offset)

        for group_a, group_b, angle in welds:
            # frame_b is rotated with frame_a: theta_b + angle = theta_a
            a, b = resolved(self.turns[group_a]), resolved(self.turns[group_b])
            gap = a.offset - b.offset - angle
            if a.number == b.number:
                continue
            if b.number == KNOWN:
                a, b, gap = b, a, -gap
            for k, turn in merged.items():
                if turn.number == b.number:
                    merged[k] = _Turn(a.number, turn.offset + gap)
        return merged

    def _equations(
        self, rows: list[_Point], joints: list[tuple[int, int] | int], merged: dict[int, _Turn]
    ) -> _Drawing:
        """Return the closure equations with lengths as fractions of the largest length.

        Args:
            rows: closure vectors, one per cut joint.
            joints: joint data of `_pass`, in the order of the joints.
            merged: independent angle and constant offset of each group.
        """
        used = {merged[turn.number].number for turn in self.turns.values()}
        numbers = sorted(used - {KNOWN})
        place = {number: k for k, number in enumerate(numbers)} | {KNOWN: KNOWN}
        angles = np.zeros((len(rows), len(numbers) + 1), dtype=np.complex128)
        slides = np.zeros((len(rows), len(self.carriers)), dtype=np.complex128)
        for r, row in enumerate(rows):
            for number, value in row.turned.items():
                turn = merged[number]
                angles[r, place[turn.number]] += value * np.exp(1j * turn.offset)
            for j, value in row.slid.items():
                slides[r, j] = value * np.exp(1j * merged[self.carriers[j]].offset)
        size = float(np.max(np.abs(angles), initial=0.0)) or 1.0
        scaled = np.divide(angles, size)
        carriers = np.array([place[merged[k].number] for k in self.carriers], dtype=int)
        loops = PlanarLoops(scaled[:, :-1], slides, carriers, scaled[:, -1])

        def turn_of(group: int) -> _Turn:
            own = self.turns[group]
            found = merged[own.number]
            return _Turn(place[found.number], found.offset + own.offset)

        told = list[tuple[int, _Turn, _Turn] | int]()
        for k, joint in zip(self.plane.links, joints, strict=True):
            if isinstance(joint, int):
                told.append(joint)
            else:
                told.append((joint[0], turn_of(joint[1]), turn_of(k)))
        return _Drawing(loops, size, told)


# One loop of six unknown revolute and prismatic joints: a serial arm whose end pose is known. For a
# loop of fewer joints, such as Bricard's, revolute joints are added, whose angles must be zero.


_JOINTS, _LEAST_JOINTS = 6, 3
_AT_ZERO = 1e-6
"""Largest angle [rad] of an added joint in a valid root: a root at a fold is accurate to 1e-7, and
wrong roots have larger angles at the randomly placed added joints."""
_LOCKED = 1e-6
"""Relative singular value below which the matrix of a loop or gear train is rank-deficient, so that
joints move by themselves: the roots are accurate to 1e-12, and 1e-6 is its square root."""


def single_loops(work: PlanWork, waiting: Sequence[int]) -> Iterator[LoopBlock]:
    """Yield blocks of one loop of 3 to 6 joints, solved as the inverse kinematics of an arm.

    Args:
        work: state of the plan: known positions and solved loops.
        waiting: indices of the unsolved loops and couplings.
    """
    for number in waiting:
        if number >= len(work.system.cuts) or is_bound(work.system, number):
            continue
        ring = work.ring(number)
        plain = all(joint.motion in (Motion.REVOLUTE, Motion.PRISMATIC) for joint in ring.joints)
        if plain and _LEAST_JOINTS <= len(ring.joints) <= _JOINTS:
            loop = _SingleLoop.of(work, ring)
            indices = tuple(_index(joint) for joint in loop.joints)
            if len(indices) < _JOINTS and not loop.is_locked(*_assembled(work.system)):
                continue
            yield LoopBlock(work.system.cuts[number].edge.joint.name, indices, loop.roots)


def _index(joint: ChainJoint) -> int:
    """Return the index in q of the position of a revolute or prismatic joint."""
    assert joint.index is not None  # it is revolute or prismatic
    return joint.index


@dataclass(slots=True, eq=False)
class _SingleLoop:
    """Loop of at most six unknown joints, which starts after its first variable transform.

    Attributes:
        system: mechanism with the loop.
        joints: joints of the loop in their order.
        gaps: Function (all positions, p) -> transforms before the joints, in one row of blocks.
        arm: key and solver data of the arm (the loop without its first transform) of the last call.
            Other positions or parameters may change the arm.
    """

    system: System
    joints: tuple[ChainJoint, ...]
    gaps: Function
    arm: tuple[bytes, CertifiedArm] | None = None

    @staticmethod
    def of(work: PlanWork, ring: Ring) -> _SingleLoop:
        """Return the loop of a cyclic chain, rotated to start at a variable transform."""
        moving = [casadi.depends_on(gap.pose.matrix, work.q) for gap in ring.gaps]
        ring = ring.rotated(moving.index(True) if any(moving) else 0)
        values = casadi.horzcat(*(casadi.densify(gap.pose.matrix) for gap in ring.gaps))
        return _SingleLoop(
            work.system, ring.joints, Function("gaps", [work.q, work.system.p], [values])
        )

    def roots(self, q: Vector, p: Vector) -> Roots:
        """Return all positions (r, n) of joints of the loop at known positions q, parameters p."""
        gaps = _side_by_side(self.gaps, q, p)
        signs = np.array([joint.sign for joint in self.joints])
        n = len(self.joints)
        found = certified_configurations(self._arm(gaps), inverse(gaps[0]))
        q = found.values[np.all(np.abs(found.values[:, n:]) < _AT_ZERO, axis=1), :n]
        return replace(found, values=q * signs)

    def is_locked(self, q: Vector, p: Vector) -> bool:
        """Whether the joints of the loop cannot move at known positions q and parameters p.

        All solutions are then regular.
        """
        try:
            roots = self.roots(q, p)
        except NoClosedForm:
            return False
        n = len(self.joints)
        x = np.zeros((len(roots.values), _JOINTS))
        x[:, :n] = roots.values * [joint.sign for joint in self.joints]
        J = self._arm(_side_by_side(self.gaps, q, p)).general.arm.pose_and_jacobian(x)[1]
        return all(rank(own, _LOCKED) == n for own in J[:, :, :n])

    def _arm(self, gaps: Matrix) -> CertifiedArm:
        """Return the arm of six joints that is equivalent to the loop; cached.

        Args:
            gaps: (n, 4, 4) transforms before the joints. The first is the end pose of the arm.
        """
        key = gaps[1:].tobytes()
        if self.arm is None or self.arm[0] != key:
            added = _JOINTS - len(self.joints)
            prismatic = [not joint.is_rotational for joint in self.joints] + [False] * added
            names = [joint.name for joint in self.joints] + ["added"] * added
            more = _added_gaps(added, float(np.sum(np.linalg.norm(gaps[:, :3, 3], axis=1))))
            between = np.concatenate([np.eye(4)[None], gaps[1:], more])
            arm = Arm(tuple(names), np.array(prismatic), between)
            self.arm = (key, certified_arm(general_of(arm)))
        return self.arm[1]


def _added_gaps(count: int, size: float) -> Matrix:
    """Return (count + 1, 4, 4) random transforms before added joints; the last undoes the others.

    Args:
        count: number of joints that are added to reach six.
        size: length of the loop [m], which scales the transforms.
    """
    rng = np.random.default_rng(_SEED)
    gaps, back = list[Matrix](), np.eye(4)
    for _ in range(count):
        gap = np.eye(4)
        gap[:3, :3] = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        gap[:3, :3] *= np.linalg.det(gap[:3, :3])
        gap[:3, 3] = rng.uniform(-1, 1, 3) * (size or 1.0) / _JOINTS
        gaps.append(gap)
        back = inverse(gap) @ back
    return np.array([*gaps, back])


# Platform on six legs. Each leg keeps the distance of two points: one on the ground and one on the
# platform.


def platforms(work: PlanWork, waiting: Sequence[int]) -> Iterator[LoopBlock]:
    """Yield a block for each platform on six legs among the unsolved loops.

    Args:
        work: state of the plan: known positions and solved loops.
        waiting: indices of the unsolved loops and couplings.
    """
    system = work.system
    for numbers, links in _free_groups(work, waiting):
        hexapod = _Hexapod.of(work, numbers, links)
        if hexapod is not None:
            cuts = [system.cuts[number].edge.joint.name for number in numbers]
            yield LoopBlock(", ".join(cuts), hexapod.indices, hexapod.roots)


class _Edge(NamedTuple):
    """Tree joint or cut joint between two rigid groups.

    Attributes:
        ends: the two groups.
        freedoms: freedoms of the joint, in its frame.
        frames: indices of the joint frame in each group, among all computed frames. The two frames
            coincide at joint position zero.
    """

    ends: tuple[int, int]
    freedoms: tuple[Freedom, ...]
    frames: tuple[int, int]


_BALL = Freedom(Motion.SPHERICAL)


def _edges(work: PlanWork, numbers: list[int], links: list[int]) -> tuple[list[_Edge], Function]:
    """Return the joints of a block between rigid groups, and a Function of their frames.

    `numbers` are the cut joints and `links` the child links of the unknown joints. The Function
    maps (all positions, p) to frames (4, 4) in one row of blocks.
    """
    groups, system = _groups(work), work.system
    edges, placed = list[_Edge](), [Pose.identity()]

    def frame(pose: Pose) -> int:
        placed.append(pose)
        return len(placed) - 1

    for k in links:
        ends = (groups.joints[k].parent, k)
        moved = Freedom(system.tree.links[k].motion)
        edges.append(_Edge(ends, (moved,), (frame(groups.joints[k].at), 0)))
    for number in numbers:
        cut = system.cuts[number]
        joint = cut.edge.joint
        ends = (groups.group[cut.link_a], groups.group[cut.link_b])
        a = frame(groups.pose[cut.link_a] @ cut.pose_a)
        b = frame(groups.pose[cut.link_b] @ cut.pose_b)
        if isinstance(joint, Rod) and not cut.welded:
            # the rod is a rigid group of its own, between two spherical joints
            own = len(system.tree.links) + number
            along = Pose.translation(vector([to_sx(joint.length, system.symbol_table), 0, 0]))
            edges.append(_Edge((ends[0], own), (_BALL,), (a, 0)))
            edges.append(_Edge((own, ends[1]), (_BALL,), (frame(along), b)))
            continue
        ball = isinstance(joint, Spherical)
        freedoms = () if cut.welded else (_BALL,) if ball else tuple(joint.freedoms)
        edges.append(_Edge(ends, freedoms, (a, b)))
    values = casadi.horzcat(*(casadi.densify(pose.matrix) for pose in placed))
    return edges, Function("frames", [work.q, system.p], [values])


@dataclass(frozen=True, slots=True, eq=False)
class _Leg:
    """Joints of a leg of a platform, from ground to platform.

    Attributes:
        edges: each joint, and whether its first group is nearer to the ground than its second.
    """

    edges: list[tuple[_Edge, bool]]


def _legs(edges: Sequence[_Edge]) -> tuple[int, list[_Leg]] | None:
    """Return the rigid group of the platform and its six legs; None for any other structure.

    Args:
        edges: joints between rigid groups.
    """
    at = dict[int, list[_Edge]]()
    for edge in edges:
        for group in edge.ends:
            at.setdefault(group, []).append(edge)
    branching = [group for group, own in at.items() if len(own) > _PASSED]
    others = [group for group in branching if group != _GROUND]
    if len(others) != 1 or len(at.get(_GROUND, ())) != LEGS or len(at[others[0]]) != LEGS:
        return None
    legs = list[_Leg]()
    for first in at[_GROUND]:
        here, edge, passed = _GROUND, first, list[tuple[_Edge, bool]]()
        while True:
            forwards = edge.ends[0] == here
            passed.append((edge, forwards))
            here = edge.ends[1] if forwards else edge.ends[0]
            if here == others[0]:
                break
            following = [other for other in at[here] if other is not edge]
            if here == _GROUND or len(following) != 1:
                return None
            edge = following[0]
        legs.append(_Leg(passed))
    return others[0], legs


_GROUND = -1
_PASSED = 2
"""Number of joints of a group inside a leg: one on each side."""
_MEETING = 1e-9
"""Largest distance of a centre from an axis, relative to the size of a leg: rounding of products of
a few transforms is 1e-15."""
_FREEDOMS = {Motion.REVOLUTE: 1, Motion.SPHERICAL: 3}
_LEAST = 5
"""Smallest number of freedoms of a leg that constrains a distance only. A sixth is its spin."""


class _Axis(NamedTuple):
    """Passive joint of a leg at position zero.

    Attributes:
        motion: type of the joint.
        point: (3,) centre of a spherical joint, or point on the axis, in the base frame [m].
        along: (3,) direction of the axis in the base frame.
    """

    motion: Motion
    point: Vector
    along: Vector


class _Distance(NamedTuple):
    """Constant distance between two points, which a leg imposes.

    Attributes:
        a: (3,) point on the ground, in the base frame.
        b: (3,) point on the platform, in its frame.
        length: distance [m].
    """

    a: Vector
    b: Vector
    length: float


def _distance(leg: _Leg, frames: Matrix, *, slides: bool = False) -> _Distance | None:
    """Return the two centres of a leg and their distance; None if the joints have no two centres.

    Args:
        leg: passive joints of the leg.
        frames: frames of the joints, indexed by its edges.
        slides: whether the leg may have prismatic joints, which are taken at zero.
    """
    here, axes = np.eye(4), list[_Axis]()
    for edge, forwards in leg.edges:
        near, far = (frames[k] for k in (edge.frames if forwards else edge.frames[::-1]))
        at = here @ near
        turned = at[:3, :3]
        axes += [
            _Axis(f.motion, at[:3, 3], turned @ np.array(f.axis, dtype=float))
            for f in edge.freedoms
        ]
        here = at @ inverse(far)
    if slides:
        axes = [axis for axis in axes if axis.motion is not Motion.PRISMATIC]
    if any(axis.motion not in _FREEDOMS for axis in axes):
        return None
    if sum(_FREEDOMS[axis.motion] for axis in axes) < _LEAST:
        return None
    size = max(float(np.max(np.abs([axis.point for axis in axes]), initial=0.0)), NONZERO)
    for k in range(1, len(axes)):
        a, b = _centre(axes[:k], size), _centre(axes[k:], size)
        if a is not None and b is not None:
            back = inverse(here)
            return _Distance(a, back[:3, :3] @ b + back[:3, 3], float(np.linalg.norm(a - b)))
    return None


def _centre(axes: Sequence[_Axis], size: float) -> Vector | None:
    """Return the point (3,) that all joints at an end of a leg keep fixed; None if not unique.

    Args:
        axes: consecutive joints.
        size: size of the leg [m], unit of the tolerance.
    """
    balls = [axis.point for axis in axes if axis.motion is Motion.SPHERICAL]
    lines = [axis for axis in axes if axis.motion is Motion.REVOLUTE]
    if balls:
        point = balls[0]
    elif len(lines) > 1:
        across = [np.eye(3) - np.outer(axis.along, axis.along) for axis in lines]
        if np.linalg.cond(np.sum(across, axis=0)) > 1 / _PARALLEL:
            return None
        side = np.sum([P @ axis.point for P, axis in zip(across, lines, strict=True)], axis=0)
        point = np.linalg.solve(np.sum(across, axis=0), side)
    else:
        return None
    gaps = [np.linalg.norm(np.cross(axis.along, point - axis.point)) for axis in lines]
    gaps += [np.linalg.norm(ball - point) for ball in balls]
    return point if max(gaps) < _MEETING * size else None


@dataclass(frozen=True, slots=True, eq=False)
class _Hexapod:
    """Platform on six legs, and the stages that compute its joints from its pose.

    Attributes:
        system: mechanism with the loops.
        legs: legs of the platform.
        frames: Function (all positions, p) -> frames of the joints of the legs.
        stages: stages that compute the joints from all positions, the pose as the last seven.
        extent: number of these positions.
        chosen: branch of each stage in which the system was assembled.
    """

    system: System
    legs: list[_Leg]
    frames: Function
    stages: list[Stage]
    extent: int
    chosen: tuple[int, ...]

    @staticmethod
    def of(work: PlanWork, numbers: list[int], links: list[int]) -> _Hexapod | None:
        """Return the platform of loops `numbers` with unknown joints at `links`.

        None unless they form a platform on six legs.
        """
        system = work.system
        edges, frames = _edges(work, numbers, links)
        # a free joint between ground and platform only defines the pose and constrains nothing
        free = [edge for edge in edges if any(f.motion is Motion.FREE for f in edge.freedoms)]
        found = _legs([edge for edge in edges if edge not in free])
        if found is None or any(edge.ends != (_GROUND, found[0]) for edge in free):
            return None
        platform, legs = found
        rng = np.random.default_rng(_SEED)
        for _ in range(_SAMPLES):
            q = rng.uniform(-1.5, 1.5, work.q.numel())
            p = rng.uniform(*PARAMETERS, system.p.numel())
            if any(_distance(leg, _side_by_side(frames, q, p)) is None for leg in legs):
                return None
        posed = posed_stages(system, platform, [k for k in work.known if k < system.nq])
        if posed is None:
            return None
        return _Hexapod(system, legs, frames, posed.stages, posed.extent, posed.chosen)

    @property
    def indices(self) -> tuple[int, ...]:
        """Indices of the solved joints in q."""
        every = {index for stage in self.stages for index in stage.indices}
        return tuple(sorted(index for index in every if index < self.system.nq))

    def roots(self, q: Vector, p: Vector) -> Roots:
        """Return positions of the unknown joints at all poses of the platform.

        Each joint of a leg has the branch in which the system was assembled. q are all positions,
        of which the known ones count; p (np,) are the parameters.
        """
        frames = _side_by_side(self.frames, q, p)
        kept = [_distance(leg, frames) for leg in self.legs]
        legs = [leg for leg in kept if leg is not None]
        if len(legs) < LEGS:
            raise NoClosedForm(
                f"{self.system.name}: legs that meet in points elsewhere do not here"
            )
        found = poses(
            np.array([leg.a for leg in legs]),
            np.array([leg.b for leg in legs]),
            np.array([leg.length for leg in legs]),
        )
        indices, values = list(self.indices), list[Vector]()
        for pose in found.values:
            whole = np.zeros(self.extent)
            whole[: self.system.nq] = q[: self.system.nq]
            whole[-7:] = pose
            for stage, branch in zip(self.stages, self.chosen, strict=True):
                whole[list(stage.indices)] = np.array(stage.values(whole, p))[:, branch]
            values.append(whole[indices])
        every = np.array(values).reshape(len(values), len(indices))
        lost = int(np.sum(~np.all(np.isfinite(every), axis=1)))
        told = (
            f"{found.proof}, but {lost} poses at which joints do not follow"
            if lost
            else found.proof
        )
        return Roots(every, told, found.complete and not lost)


def _require_held(work: PlanWork, waiting: Sequence[int]) -> None:
    """Raise if the leg lengths of a platform hold it at no pose.

    Raises:
        NoClosedForm: the legs of a platform are singular at all poses.
    """
    system = work.system
    for numbers, links in _free_groups(work, waiting):
        edges, frames = _edges(work, numbers, links)
        found = _legs(edges)
        if found is None:
            continue
        at = _side_by_side(frames, *_assembled(system))
        legs = [leg for leg in (_distance(leg, at, slides=True) for leg in found[1]) if leg]
        if len(legs) == LEGS and not is_rigid(
            *(np.array([leg[k] for leg in legs]) for k in (0, 1))
        ):
            raise NoClosedForm(
                f"{system.name}: the ends of its six legs lie so that they hold the platform at no"
                " pose, as on similar hexagons, and the length of one leg follows from the others;"
                " move an end, or use mbs.loops.solve without branch"
            )


def _side_by_side(frames: Function, q: Vector, p: Vector) -> Matrix:
    """Return the frames (k, 4, 4) of a Function that returns them in one row of blocks.

    q are all positions, p (np,) the parameters.
    """
    values = np.array(frames(q, p))
    return values.T.reshape(-1, 4, 4).transpose(0, 2, 1)
