"""Poses of link frames: the direct geometric model, link by link.

Source: Khalil & Kleinfinger 1986; Khalil & Creusot 1997, eq. 1.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi
from casadi import SX

from mbs.assembly.tree import Link, Tree
from mbs.components.joints import Motion
from mbs.spatial import (
    Displacement,
    FreeDisplacement,
    MatrixRotation,
    Pose,
    Rotation,
    ScrewDisplacement,
    Wrench,
    axis_rotation,
    origin,
    quaternion_rotation,
    transform_wrench_along,
    zeros,
)


@dataclass(frozen=True, slots=True, eq=False)
class LinkPose:
    """Pose of frame j relative to its antecedent i, as displacements that are cheap to apply.

    Attributes:
        seat: displacements from frame i to the joint frame on link i (the seat), whose z axis is
            the axis of joint j.
        motion: displacements from the seat to frame j: rotation and translation of the joint.
        run: indices of the consecutive revolute joints with parallel axes that end with this
            joint. It holds j alone if the axis of the antecedent is not parallel.
        spin: rotation by the summed angles of the run.
    """

    seat: tuple[Displacement, ...]
    motion: tuple[Displacement, ...]
    run: tuple[int, ...]
    spin: Rotation

    @property
    def steps(self) -> tuple[Displacement, ...]:
        """Displacements from frame i to frame j: `seat`, then `motion`."""
        return self.seat + self.motion

    @property
    def foot(self) -> SX:
        """(3, 1) origin of the joint frame on link i, in frame i [m]."""
        return origin(self.seat)

    @property
    def p(self) -> SX:
        """(3, 1) origin of frame j in frame i [m]."""
        return origin(self.steps)

    @property
    def height(self) -> SX:
        """Distance from the joint frame on link i to frame j, along the axis of the joint [m]."""
        return origin(self.motion)[2]

    @property
    def matrix(self) -> SX:
        """(3, 3) orientation of frame j relative to frame i."""
        R = Pose.identity().R
        for step in self.steps:
            R = casadi.mtimes(R, step.rotation.matrix)
        return R

    def at_seat(self, vector: SX) -> SX:
        """Express a vector (3, 1) of frame i in the axes of the joint frame on link i."""
        for step in self.seat:
            vector = step.rotation.apply_inverse(vector)
        return vector

    def apply(self, vector: SX) -> SX:
        """Express a vector (3, 1) of frame j in the axes of frame i."""
        for step in reversed(self.steps):
            vector = step.rotation.apply(vector)
        return vector

    def apply_inverse(self, vector: SX) -> SX:
        """Express a vector (3, 1) of frame i in the axes of frame j."""
        for step in self.steps:
            vector = step.rotation.apply_inverse(vector)
        return vector

    def wrench(self, f: SX, m: SX) -> Wrench:
        """Transform a wrench about the origin and in axes of frame j to frame i.

        Args:
            f: (3, 1) force [N].
            m: (3, 1) moment [N m].

        Returns:
            force and moment about the origin and in axes of frame i.
        """
        return transform_wrench_along(self.steps, f, m)

    def after(self, pose: Pose) -> Pose:
        """Return the pose of frame j relative to a third frame.

        Args:
            pose: pose of frame i relative to the third frame.
        """
        rows = pose.R.T
        for step in self.steps:
            rows = casadi.horzcat(*(step.rotation.apply_inverse(rows[:, k]) for k in range(3)))
        return Pose(rows.T, pose.p + casadi.mtimes(pose.R, self.p))


def link_poses(tree: Tree, q: SX) -> list[LinkPose]:
    """Return the pose of each link relative to its antecedent, by link.

    Args:
        tree: the links.
        q: (nq, 1) joint positions [rad or m], and quaternions.
    """
    poses: list[LinkPose] = []
    angles: list[SX] = []
    for j, link in enumerate(tree.links):
        i, at = link.antecedent, link.placement
        seat = _without_identities(
            *(screw for frame in link.via for screw in frame.fixed), *at.seat
        )
        angle = at.theta + q[link.q] if link.motion is Motion.REVOLUTE else at.theta
        run: tuple[int, ...] = (j,)
        if link.motion is Motion.REVOLUTE and i >= 0 and _is_parallel(tree.links[i], seat):
            run, angle = (*poses[i].run, j), angles[i] + angle
        angles.append(angle)
        seat, motion = _joint_displacements(link, seat, q[link.q])
        spin = axis_rotation("z", angle) if len(run) > 1 else motion[0].rotation
        poses.append(LinkPose(seat, motion, run, spin))
    return poses


def _is_parallel(before: Link, seat: tuple[ScrewDisplacement, ...]) -> bool:
    """Return whether joint `before` is revolute and parallel to the axis at the end of `seat`."""
    return before.motion is Motion.REVOLUTE and not any(_rotates(step) for step in seat)


def base_poses(tree: Tree, poses: list[LinkPose]) -> list[Pose]:
    """Return the pose of each link frame in the base frame, by link.

    Args:
        tree: the links.
        poses: pose of each link relative to its antecedent.
    """
    result: list[Pose] = []
    for link, pose in zip(tree.links, poses, strict=True):
        i = link.antecedent
        result.append(pose.after(result[i] if i >= 0 else Pose.identity()))
    return result


def _joint_displacements(
    link: Link, seat: tuple[ScrewDisplacement, ...], q: SX
) -> tuple[tuple[ScrewDisplacement, ...], tuple[Displacement, ...]]:
    """Return the displacements to the joint frame on the antecedent, and from there to the link.

    `seat` are the displacements to the joint axis, and `q` is the position of the joint.
    """
    at = link.placement
    match link.motion:
        case Motion.REVOLUTE:
            return seat, (ScrewDisplacement.about("z", at.theta + q, at.r),)
        case Motion.PRISMATIC:
            return seat, (ScrewDisplacement.about("z", at.theta, at.r + q),)
    return seat + _without_identities(ScrewDisplacement.about("z", at.theta, at.r)), (
        _free_displacement(link, q),
    )


def _free_displacement(link: Link, q: SX) -> FreeDisplacement:
    """Return the displacement of a spherical or free joint at q.

    Its inverse for a backward joint.
    """
    R = quaternion_rotation(q[link.motion.nq - 4 :])
    R = R.T if link.backward else R
    if link.motion is not Motion.FREE:
        return FreeDisplacement(MatrixRotation(R), zeros())
    return FreeDisplacement(
        MatrixRotation(R), -casadi.mtimes(R, q[0:3]) if link.backward else q[0:3]
    )


def _without_identities(*steps: ScrewDisplacement) -> tuple[ScrewDisplacement, ...]:
    """Return the steps that are not the constant identity."""
    return tuple(step for step in steps if _rotates(step) or not step.t.is_zero())


def _rotates(step: ScrewDisplacement) -> bool:
    """Return whether a step rotates. A tiny angle has a cosine of one and a nonzero sine."""
    return not (step.rotation.s.is_zero() and step.rotation.c.is_one())
