"""Poses of which a part counts: a rotation about an axis of the tool is free, or all of them."""

from __future__ import annotations

from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mbs.assembly import System
from mbs.assembly.model_function import require_system
from mbs.closed_forms.arm import Arm, Array
from mbs.components import Body, Prismatic, Revolute
from mbs.errors import ModelError
from mbs.mechanism import Mechanism
from mbs.models.geometry import terminal_frame
from mbs.models.inverse_geometry.answer import NO_LOOP
from mbs.models.inverse_geometry.chain import (
    FrameChain,
    frame_chain,
    target_pose,
    target_poses,
)
from mbs.models.inverse_geometry.follow import Followed, Redundancy
from mbs.models.inverse_geometry.follow import follow as follow_poses
from mbs.models.inverse_geometry.many import ManySolutions, solve_many
from mbs.models.inverse_geometry.redundancy import Locked, Redundant
from mbs.models.inverse_geometry.solutions import (
    Given,
    RobotSolution,
    Solution,
    Solutions,
    Wishes,
    bounds,
    leaves_out,
)
from mbs.models.inverse_geometry.solve import solve
from mbs.models.inverse_geometry.whole_robot import close, why_searched
from mbs.text import did_you_mean, quoted

# Behind the frame stand joints that do not exist: one about the free axis, or three that meet in
# the origin. The whole pose of what they carry is the part of the pose that counts for the arm.
# So five joints and a free axis are an arm of six, three joints and a free orientation one with a
# spherical wrist, and what is known of whole poses serves.


FREE = ("x", "y", "z", "orientation")
"""What may be free: the rotation about an axis of the frame, or every rotation."""

_AXES = {"x": "x", "y": "y", "z": "z", "orientation": "zxy"}
_ANY = np.array([[2.0, -1.0, 2.0], [2.0, 2.0, -1.0], [-1.0, 2.0, 2.0]]) / 3.0
"""An orientation that no axis of usual robots is parallel to: which one is looked for is free."""
_SAME = 1e-6
"""Difference [rad or m] of the arm's joints in solutions that are one: those of a spherical wrist
that does not exist come in pairs."""


@dataclass(frozen=True, slots=True, eq=False)
class FreeOrientation:
    """A frame whose orientation is free in part; made by `free_orientation`.

    Attributes:
        system: the robot.
        free: what is free.
        robot: the joints on the way to the frame, and behind it one or three for what is free.
        chain: the first of them.
        arm: these in numbers.
        p: (np,) parameters.
    """

    system: System
    free: str
    robot: System
    chain: FrameChain
    arm: Arm
    p: Array

    @property
    def indices(self) -> tuple[int, ...]:
        """Indices in q of the joints on the way to the frame."""
        return self.chain.indices

    def solve(
        self,
        T: Any,
        method: str = "auto",
        limits: bool | Given | None = None,
        seed: Mapping[str, float] | Sequence[float] | None = None,
        *,
        locked: Mapping[str, float] | None = None,
        redundant: Redundant | None = None,
    ) -> Solutions:
        """Every configuration that takes the frame to the part of a pose that counts.

        Args:
            T: (4, 4) the pose of the frame seen from the base [m]; (3,) its position where the
                orientation is free.
            method: as in `mbs.models.inverse_geometry.solve`, as all that follow.
            limits: which leave out solutions.
            seed: a configuration by name or (nq,) [rad or m].
            locked: positions of joints that stay where they are.
            redundant: positions of joints that take many.

        Returns:
            Solutions; their residual is that of the part and of the loops, sigma_min of the rows
            of the part for the joints on the way. One of a self-motion has multiplicity 0 and no
            `family`. Of a robot with loops those of the joints on the way, in every way in which
            the loops close.
        """
        target = target_pose(self.system, self._pose(T))
        near = np.array(self.system.position(seed))
        still = {*(locked or {}), *(redundant or {})}
        start = None if seed is None else self._start(near)
        # of a robot with loops the limits of other joints count too
        own = None if self.system.is_closed else self._limits(limits)
        found = solve(
            self.robot, target, "tool", method, own, start, locked=locked, redundant=redundant
        )
        if self.system.is_closed:
            return self._closed(found, target, still, limits, seed)
        kept = list[Solution]()
        for solution in found:
            x = solution.q[: self.arm.size]
            others = [other.q[list(self.indices)] for other in kept]
            if not any(self._is_same(x, other) for other in others):
                kept.append(self._solution(solution, target, near, still))
        if seed is not None:
            kept.sort(key=lambda solution: float(np.linalg.norm(solution.q - near)))
        nearest = found.nearest
        if nearest is not None:
            q = self._whole(nearest.q, near)
            nearest = replace(nearest, q=q, T=self.arm.pose(nearest.q[: self.arm.size]))
        names = tuple(coordinate.name for coordinate in self.system.coordinates)
        ends = bounds(self.system, limits)
        name = self.system.name
        return Solutions(name, names, tuple(kept), found.method, found.reason, nearest, ends)

    def solve_many(
        self,
        T: Any,
        method: str = "auto",
        limits: bool | Given | None = None,
        locked: Locked | None = None,
        *,
        redundant: Redundant | None = None,
    ) -> ManySolutions:
        """All solutions of many poses; see `mbs.models.inverse_geometry.solve_many`.

        Args:
            T: (N, 4, 4) poses of the frame [m]; (N, 3) positions where the orientation is free.
            method: as there, as all that follow.
            limits: which leave out solutions.
            locked: positions of joints that stay where they are.
            redundant: positions of joints that take many.

        Returns:
            ManySolutions; their residual is that of the whole pose of what the joints that do not
            exist carry.

        Raises:
            ModelError: the robot has loops.
        """
        self._require_open("solve_many", "call solve for each pose")
        target = target_poses(self.system, self._poses(T))
        own = self._limits(limits)
        many = solve_many(self.robot, target, "tool", method, own, locked, redundant=redundant)
        valid = many.valid.copy()
        x = many.q[..., : self.arm.size]
        for b in range(1, valid.shape[1]):
            apart = np.max(np.abs(self.arm.wrapped(x[:, :b] - x[:, b : b + 1])), axis=-1)
            valid[:, b] &= ~np.any(valid[:, :b] & (apart < _SAME), axis=1)
        q = self._whole(many.q, np.array(self.system.configuration))
        return replace(many, q=q, valid=valid)

    def follow(
        self,
        path: Any,
        start: Any,
        *,
        samples: int = 101,
        locked: Mapping[str, float] | None = None,
        limits: bool | Given | None = None,
        redundancy: Redundancy | None = None,
    ) -> Followed:
        """The configurations along a path; see `mbs.models.inverse_geometry.follow`.

        What is free counts as a joint beyond those of the arm, with `redundancy` for those that a
        pose does not determine; its motion counts like theirs.

        Args:
            path: (N, 4, 4) poses or (N, 3) positions, or a function that gives one.
            start: as there, as all that follow: (nq,) positions near the first pose.
            samples: how many poses of a function.
            locked: positions of joints that stay where they are.
            limits: which are kept.
            redundancy: what joints do that are not determined.

        Raises:
            ModelError: the robot has loops.
        """
        self._require_open("follow", "call solve for each pose, with the one before as seed")
        given = getattr(start, "q", start)
        near = np.array(self.system.position(given))
        own = self._start(near)
        T0 = self.arm.pose(near[list(self.indices)])

        def posed(T: Any) -> Any:
            # the orientation of the start is kept by the joints that do not exist
            return self._pose(T, T0[:3, :3])

        led: Any = (lambda s: posed(path(s))) if callable(path) else np.array([*map(posed, path)])
        found = follow_poses(
            self.robot,
            led,
            own,
            "tool",
            samples=samples,
            locked=locked,
            limits=self._limits(limits),
            redundancy=self._gradient(redundancy, near),
        )
        q, last = self._whole(found.q, near), self._whole(found.stopped_at, near)
        return replace(found, q=q, stopped_at=last)

    def _closed(
        self,
        found: Solutions,
        target: Array,
        still: Container[str],
        limits: bool | Given | None,
        seed: Mapping[str, float] | Sequence[float] | None,
    ) -> Solutions:
        """Solutions of the joints on the way, with every loop closed in every way."""
        system, n = self.system, self.arm.size
        near = np.array(system.position(seed))
        held = {k for k, c in enumerate(system.coordinates) if c.name in still}
        held |= {k for coupling in system.couplings for k in coupling.coordinates}
        ends = bounds(system, limits, set(range(system.nq)) - held)
        wishes = Wishes(system, near, ends, leaves_out(limits), seed is not None)
        drafts, others = list[RobotSolution](), list[Array]()
        for solution in found:
            x = solution.q[:n]
            if any(self._is_same(x, other) for other in others):
                continue
            others.append(x)
            missed, sigma = self._missed(x, target), self._singular_value(x, still)
            for one in close(system, self.chain, x[None], self.p, near):
                label = "; ".join(part for part in (self._branch(solution), one.label) if part)
                missed_at, count = max(missed, one.residual), self._count(solution)
                drafts.append(RobotSolution(one.q, label, missed_at, sigma, count))
        method = found.method
        if why_searched(system, self.chain) is not None:
            method += ", loops by search"
        reason = found.reason or ("" if drafts else NO_LOOP)
        return wishes.solutions(drafts, method, reason)

    def _require_open(self, what: str, instead: str) -> None:
        if self.system.is_closed:
            raise ModelError(
                f"{self.system.name}: its loops must be closed too, and {what} of poses of which a"
                f" part counts is for open chains; {instead}"
            )

    def _gradient(self, given: Redundancy | None, near: Array) -> Redundancy | None:
        if not callable(given):
            return given
        gradient: Callable[[Array], Array] = given

        def slope(q: Array) -> Array:
            found = np.asarray(gradient(self._whole(q, near)), dtype=float)
            if found.shape != near.shape:
                raise ModelError(
                    f"{self.system.name}: the function given as redundancy returned"
                    f" {quoted(found)}; return the gradient of a cost, {near.size} finite numbers"
                )
            own: Array = np.zeros(q.size)
            own[: self.arm.size] = found[list(self.indices)]
            return own

        return slope

    def _pose(self, T: Any, R: Array = _ANY) -> Any:
        """A pose whose orientation is as it is looked for."""
        if self.free != "orientation":
            return T
        given = np.asarray(T, dtype=float)
        if given.shape not in ((3,), (4, 4)):
            raise ModelError(
                f"{self.system.name}: the position is {quoted(T)}; give (3,) numbers, or a pose"
                " (4, 4)"
            )
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = R, given if given.shape == (3,) else given[:3, 3]
        return pose

    def _poses(self, T: Any) -> Any:
        return T if self.free != "orientation" else np.array([self._pose(one) for one in T])

    def _start(self, q: Array) -> list[float]:
        """A configuration of the robot with further joints, these at zero."""
        own = q[list(self.indices)].tolist()
        return [*own, *[0.0] * (self.robot.nq - self.arm.size)]

    def _whole(self, q: Array, near: Array) -> Array:
        """(..., nq) configurations of the system, joints that are not on the way as in `near`."""
        whole = np.empty((*q.shape[:-1], near.size))
        whole[...] = near
        whole[..., list(self.indices)] = q[..., : self.arm.size]
        return whole

    def _limits(self, limits: bool | Given | None) -> bool | Given | None:
        bounds(self.system, limits)  # its names are those of the system
        if not isinstance(limits, Mapping):
            return limits
        return {name: pair for name, pair in limits.items() if name in self.arm.names}

    def _is_same(self, x: Array, other: Array) -> bool:
        return bool(np.max(np.abs(self.arm.wrapped(x - other))) < _SAME)

    def _solution(
        self, solution: Solution, target: Array, near: Array, still: Container[str]
    ) -> Solution:
        x = solution.q[: self.arm.size]
        windings = np.unique(solution.windings[:, : self.arm.size], axis=0)
        order = np.argsort(np.linalg.norm(windings - near[list(self.indices)], axis=1))
        return Solution(
            self._whole(solution.q, near),
            self._branch(solution),
            self._missed(x, target),
            self._singular_value(x, still),
            self._count(solution),
            solution.within_limits,
            self._whole(windings[order], near).copy,
        )

    def _branch(self, solution: Solution) -> str:
        """The name of a branch, less that of a wrist that does not exist."""
        if self.free != "orientation":
            return solution.branch
        parts = solution.branch.split(", ")
        return ", ".join(part for part in parts if part not in ("flip", "no flip"))

    def _count(self, solution: Solution) -> int:
        """How many solutions meet in one; a self-motion of joints that do not exist is none."""
        family = solution.family
        if family is None:
            return solution.multiplicity
        return 0 if set(family.moving) & set(self.arm.names) else 1

    def _missed(self, x: Array, target: Array) -> float:
        """Largest difference of what counts: the position, and the axis that is not free."""
        difference = np.abs(self.arm.pose(x) - target)
        missed = float(np.max(difference[:3, 3]))
        if self.free == "orientation":
            return missed
        return max(missed, float(np.max(difference[:3, "xyz".index(self.free)])))

    def _singular_value(self, x: Array, still: Container[str]) -> float:
        """The smallest one of the rows that count, lengths divided by the arm's."""
        T, J = self.arm.pose_and_jacobian(x)
        moving = [k for k, name in enumerate(self.arm.names) if name not in still]
        J = (J * self.arm.units)[:, moving]
        rows = J[:3] / self.arm.length
        if self.free != "orientation":
            k = "xyz".index(self.free)
            across = np.delete(T[:3, :3], k, axis=1).T  # turns about the free axis do not count
            rows = np.vstack([rows, across @ J[3:]])
        return float(np.linalg.svd(rows, compute_uv=False)[-1])


def free_orientation(
    system: System,
    free: str = "z",
    frame: str | int | None = None,
    *,
    parameters: Mapping[str, float] | None = None,
) -> FreeOrientation:
    """A frame whose rotation about an axis of its own is free, or whose orientation is.

    Args:
        system: a serial robot, a tree, or a robot with loops.
        free: "x", "y", "z" for the rotation about this axis of the frame, as of a tool that
            spins; "orientation" where the position alone counts.
        frame: a body, a named frame, the number of a link, or None for the terminal frame.
        parameters: values of symbols, the others at their defaults.

    Returns:
        FreeOrientation with the methods `solve` and, of open chains, `solve_many` and `follow`. Six
        joints determine
        what counts where the arm has five of them, or three with a free orientation; further ones
        are locked or redundant.

    Raises:
        ModelError: there is no such axis or frame, or a joint of the way is neither revolute nor
            prismatic.
    """
    require_system(system)
    if free not in FREE:
        raise ModelError(f"{system.name}: free is {quoted(free)}; {did_you_mean(free, FREE)}")
    name = terminal_frame(system) if frame is None else frame
    p = np.array(system.parameter_values(parameters))
    chain = frame_chain(system, name, most=len(system.tree.links))
    arm = chain.arm(p)

    def build() -> FreeOrientation:
        robot = _with_free_joints(system, arm, free)
        return FreeOrientation(system, free, robot, chain, arm, p)

    key = ("free orientation", free, *chain.key, p.tobytes())
    found: FreeOrientation = system.cached(key, build)
    return found


def _with_free_joints(system: System, arm: Arm, free: str) -> System:
    """The joints of an arm in numbers, and behind them those that stand for what is free."""
    limits = {coordinate.name: coordinate.limits for coordinate in system.coordinates}
    mechanism = Mechanism(system.name, gravity=(0, 0, 0))
    last: Any = mechanism.world
    for k, name in enumerate(arm.names):
        joint = Prismatic if arm.prismatic[k] else Revolute
        body = mechanism.add(Body(f"link{k + 1}", mass=0))
        mechanism.connect(_behind(last, arm.gaps[k]), joint(name, limits=limits[name]), body)
        last = body
    place = _behind(last, arm.gaps[arm.size])
    for axis in _AXES[free]:
        body = mechanism.add(Body(f"free_{axis}_body", mass=0))
        mechanism.connect(place, Revolute(f"free_{axis}", axis=axis), body)
        last = place = body
    mechanism.add_frame("tool", last.at())
    return mechanism.assemble()


def _behind(body: Any, gap: Array) -> Any:
    """The point of a body behind a constant transform."""
    return body.at(*gap[:3, 3].tolist(), rotation=gap[:3, :3].tolist())
