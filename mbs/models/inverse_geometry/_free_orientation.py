"""Inverse geometric model of partly specified poses: free rotation about a tool axis, or all."""

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
from mbs.models.inverse_geometry._follow import Followed
from mbs.models.inverse_geometry._follow import follow as follow_poses
from mbs.models.inverse_geometry._solve import solve
from mbs.models.inverse_geometry._solve_many import solve_many
from mbs.models.inverse_geometry.answer import NO_LOOP
from mbs.models.inverse_geometry.chain import (
    FrameChain,
    frame_chain,
    target_pose,
    target_poses,
)
from mbs.models.inverse_geometry.path_equations import Redundancy
from mbs.models.inverse_geometry.redundancy import Locked, Redundant
from mbs.models.inverse_geometry.solutions import (
    Given,
    ManySolutions,
    Solution,
    Solutions,
    SolveOptions,
    bounds,
    leaves_out,
)
from mbs.models.inverse_geometry.whole_robot import close, why_searched
from mbs.text import did_you_mean, quoted

# Virtual joints are appended to the frame: one revolute joint about the free axis, or three with
# axes through the origin. A pose of the last virtual link specifies only the required part of the
# pose of the frame. Five joints and a free axis become a six-joint arm, three joints and a free
# orientation become an arm with a spherical wrist. Both are solved for complete poses.


FREE = ("x", "y", "z", "orientation")
"""Names of the free motions: rotation about an axis of the frame, or all rotations."""

_AXES = {"x": "x", "y": "y", "z": "z", "orientation": "zxy"}
_ANY = np.array([[2.0, -1.0, 2.0], [2.0, 2.0, -1.0], [-1.0, 2.0, 2.0]]) / 3.0
"""Target orientation of the last virtual link, not parallel to the axes of usual robots. Its choice
does not affect the result."""
_SAME = 1e-6
"""Difference [rad or m] of the arm's joints below which solutions are equal: a virtual spherical
wrist has two solutions for each solution of the arm."""


@dataclass(frozen=True, slots=True, eq=False)
class FreeOrientation:
    """Frame with a partly free orientation; created by `free_orientation`.

    Attributes:
        system: robot.
        free: free rotation: "x", "y", "z" or "orientation".
        robot: system of the joints to the frame, followed by one or three virtual joints.
        chain: chain of the real joints from the base to the frame.
        arm: numeric geometry of `chain`.
        p: (np,) parameter values.
    """

    system: System
    free: str
    robot: System
    chain: FrameChain
    arm: Arm
    p: Array

    @property
    def indices(self) -> tuple[int, ...]:
        """Indices in q of the joints from the base to the frame."""
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
        """Compute all configurations at which the frame has the specified part of a pose.

        The arguments from `method` on are as in `mbs.models.inverse_geometry.solve`.

        Args:
            T: (4, 4) pose of the frame relative to the base [m], or (3,) its position if the
                orientation is free.
            method: name of the method.
            limits: joint limits.
            seed: configuration as a dict by name or (nq,) [rad or m].
            locked: positions of fixed joints by name [rad or m].
            redundant: samples of redundant joints by name.

        Returns:
            Solutions. The residual is the error of the specified part and of the loop closure.
            sigma_min is the smallest singular value of the specified rows for the joints to the
            frame. A solution on a self-motion has multiplicity 0 and no `family`. For a robot with
            loops, all branches of the loop closure are listed.
        """
        target = target_pose(self.system, self._pose(T))
        near = np.array(self.system.position(seed))
        still = {*(locked or {}), *(redundant or {})}
        start = None if seed is None else self._start(near)
        # for a robot with loops, limits are applied later, to all joints
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
        """Compute all configurations for many partly specified poses.

        The arguments from `method` on are as in `mbs.models.inverse_geometry.solve_many`.

        Args:
            T: (N, 4, 4) poses of the frame [m], or (N, 3) positions if the orientation is free.
            method: name of the method.
            limits: joint limits.
            locked: positions of fixed joints by name [rad or m].
            redundant: samples of redundant joints by name.

        Returns:
            ManySolutions. The residual is the error of the complete pose of the last virtual link.

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
        """Compute joint positions along a path; see `mbs.models.inverse_geometry.follow`.

        The virtual joints of the free rotation are treated like joints of the arm, also in the
        criterion `redundancy`.

        Args:
            path: (N, 4, 4) poses or (N, 3) positions, or a function of [0, 1] that returns one.
            start: (nq,) positions near the first pose, a dict by name, or a solution.
            samples: number of poses at which a path function is evaluated.
            locked: positions of joints that do not move, by name [rad or m].
            limits: joint limits that are not exceeded.
            redundancy: criterion for redundant joints.

        Raises:
            ModelError: the robot has loops.
        """
        self._require_open("follow", "call solve for each pose, with the one before as seed")
        given = getattr(start, "q", start)
        near = np.array(self.system.position(given))
        own = self._start(near)
        T0 = self.arm.pose(near[list(self.indices)])

        def posed(T: Any) -> Any:
            # the virtual joints keep the last virtual link at the start orientation
            return self._pose(T, T0[:3, :3])

        poses: Any = (lambda s: posed(path(s))) if callable(path) else np.array([*map(posed, path)])
        found = follow_poses(
            self.robot,
            poses,
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
        """Complete the chain solutions by all branches of the loop closure."""
        system, n = self.system, self.arm.size
        near = np.array(system.position(seed))
        held = {k for k, c in enumerate(system.coordinates) if c.name in still}
        held |= {k for coupling in system.couplings for k in coupling.coordinates}
        ends = bounds(system, limits, set(range(system.nq)) - held)
        options = SolveOptions(system, near, ends, leaves_out(limits), seed is not None)
        whole, others = list[Solution](), list[Array]()
        for solution in found:
            x = solution.q[:n]
            if any(self._is_same(x, other) for other in others):
                continue
            others.append(x)
            missed, sigma = self._missed(x, target), self._singular_value(x, still)
            for one in close(system, self.chain, x[None], self.p, near):
                label = "; ".join(part for part in (self._branch(solution), one.branch) if part)
                missed_at, count = max(missed, one.residual), self._count(solution)
                whole.append(Solution(one.q, label, missed_at, sigma, count))
        method = found.method
        if why_searched(system, self.chain) is not None:
            method += ", loops by search"
        reason = found.reason or ("" if whole else NO_LOOP)
        return options.solutions(whole, method, reason)

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
        """Return the pose of the last virtual link; R (3, 3) replaces a free orientation."""
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
        """Return the start of `robot` from q (nq,), with the virtual joints at zero."""
        own = q[list(self.indices)].tolist()
        return [*own, *[0.0] * (self.robot.nq - self.arm.size)]

    def _whole(self, q: Array, near: Array) -> Array:
        """Return system configurations (..., nq); joints outside the chain as in `near` (nq,)."""
        whole = np.empty((*q.shape[:-1], near.size))
        whole[...] = near
        whole[..., list(self.indices)] = q[..., : self.arm.size]
        return whole

    def _limits(self, limits: bool | Given | None) -> bool | Given | None:
        bounds(self.system, limits)  # raises if a name is unknown in the system
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
        """Return the branch name without the label of a virtual wrist."""
        if self.free != "orientation":
            return solution.branch
        parts = solution.branch.split(", ")
        return ", ".join(part for part in parts if part not in ("flip", "no flip"))

    def _count(self, solution: Solution) -> int:
        """Return the multiplicity; a self-motion of virtual joints only counts as one solution."""
        family = solution.family
        if family is None:
            return solution.multiplicity
        return 0 if set(family.moving) & set(self.arm.names) else 1

    def _missed(self, x: Array, target: Array) -> float:
        """Return the largest error of the position and of the direction of the specified axis."""
        difference = np.abs(self.arm.pose(x) - target)
        missed = float(np.max(difference[:3, 3]))
        if self.free == "orientation":
            return missed
        return max(missed, float(np.max(difference[:3, "xyz".index(self.free)])))

    def _singular_value(self, x: Array, still: Container[str]) -> float:
        """Return the smallest singular value of the specified rows, lengths by the arm length."""
        T, J = self.arm.pose_and_jacobian(x)
        moving = [k for k, name in enumerate(self.arm.names) if name not in still]
        J = (J * self.arm.units)[:, moving]
        rows = J[:3] / self.arm.length
        if self.free != "orientation":
            k = "xyz".index(self.free)
            across = np.delete(T[:3, :3], k, axis=1).T  # drops rotation about the free axis
            rows = np.vstack([rows, across @ J[3:]])
        return float(np.linalg.svd(rows, compute_uv=False)[-1])


def free_orientation(
    system: System,
    free: str = "z",
    frame: str | int | None = None,
    *,
    parameters: Mapping[str, float] | None = None,
) -> FreeOrientation:
    """Set up inverse kinematics of a frame with a free rotation about an axis, or all rotations.

    Args:
        system: serial robot, tree, or robot with closed loops.
        free: "x", "y" or "z" for a free rotation about this axis of the frame, as of a spinning
            tool. "orientation" if only the position is specified.
        frame: name of a body or frame, index of a link, or None for the terminal frame.
        parameters: parameter values by name; default values for all others.

    Returns:
        FreeOrientation with the method `solve` and, for open chains, `solve_many` and `follow`. An
        arm of five joints is fully determined with a free axis, and an arm of three joints with a
        free orientation. Further joints must be locked or redundant.

    Raises:
        ModelError: the axis or frame is unknown, or a joint between base and frame is neither
            revolute nor prismatic.
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
    """Return a system with the joints of a numeric arm, followed by the virtual joints."""
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
    """Return the point of a body at a constant transform `gap` (4, 4)."""
    return body.at(*gap[:3, 3].tolist(), rotation=gap[:3, :3].tolist())
