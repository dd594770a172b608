"""A System at its start as plain numbers in the axes of the base, to build twins from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import casadi
import numpy as np

from mbs.assembly import System
from mbs.components.joints import Motion
from mbs.recursions.link_motions import base_poses, link_poses
from mbs.spatial import Pose

Array = np.ndarray[Any, Any]
KINDS = {Motion.REVOLUTE: "revolute", Motion.PRISMATIC: "prismatic"}


@dataclass(frozen=True, slots=True, eq=False)
class PlainBody:
    """A link at the start.

    Attributes:
        antecedent: number of the body before it in the tree, -1 for the base.
        mass: [kg].
        com: (3,) [m].
        inertia: (3, 3) about the centre of mass, in the axes of the base [kg m^2].
        velocity: (3,) of the centre of mass [m/s].
        spin: (3,) angular velocity [rad/s].
    """

    antecedent: int
    mass: float
    com: Array
    inertia: Array
    velocity: Array
    spin: Array


@dataclass(frozen=True, slots=True, eq=False)
class PlainJoint:
    """A joint through a point along an axis, both in the base; a and b are numbers of bodies."""

    kind: str
    a: int
    b: int
    at: Array
    axis: Array
    speed: float = 0.0
    effort: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class PlainSpring:
    """A spring with a damper from a point of body a to a point of body b."""

    a: int
    b: int
    at_a: Array
    at_b: Array
    stiffness: float
    length: float
    damping: float


@dataclass(frozen=True, slots=True, eq=False)
class PlainMechanism:
    """Everything that moves, in the axes of the base at the start.

    Attributes:
        joints: those of the tree, joint k moves body k.
        cuts: revolute joints that close loops.
        tracked: body whose point is the output, and the point (3,).
    """

    gravity: Array
    bodies: tuple[PlainBody, ...]
    joints: tuple[PlainJoint, ...]
    cuts: tuple[PlainJoint, ...]
    springs: tuple[PlainSpring, ...]
    tracked: tuple[int, Array]

    @property
    def planar(self) -> bool:
        """Whether every joint turns about z."""
        every = (*self.joints, *self.cuts)
        return all(j.kind == "revolute" and abs(j.axis[2]) > 1 - 1e-12 for j in every)


def plain(
    system: System, q: Array, v: Array, efforts: Mapping[str, float], output: str
) -> PlainMechanism:
    """The numbers of a system of revolute and prismatic joints.

    Args:
        system: without parameters.
        q: (nq,) positions at the start.
        v: (nv,) velocities there.
        efforts: constant efforts by joint.
        output: frame, or link, whose origin is followed.
    """
    tree = system.tree
    poses = base_poses(tree, link_poses(tree, casadi.SX(casadi.DM(q))))

    def placed(link: int, pose: Pose) -> tuple[Array, Array]:
        whole = poses[link] @ pose if link >= 0 else pose
        return numbers(whole.R), numbers(whole.p).ravel()

    spins, origins, speeds, bodies, joints = [], [], [], [], []
    for k, (link, pose) in enumerate(zip(tree.links, poses, strict=True)):
        R, p = numbers(pose.R), numbers(pose.p).ravel()
        kind, axis, rate, i = KINDS[link.motion], R[:, 2], float(v[k]), link.antecedent
        w, before = (spins[i], speeds[i]) if i >= 0 else (np.zeros(3), np.zeros(3))
        moved = before + np.cross(w, p - (origins[i] if i >= 0 else 0))
        moved = moved + rate * axis * (kind == "prismatic")
        w = w + rate * axis * (kind == "revolute")
        m = float(numbers(link.inertia.m)[0, 0])
        c = numbers(link.inertia.ms).ravel() / m
        about_com = numbers(link.inertia.J) - m * (c @ c * np.eye(3) - np.outer(c, c))
        com = p + R @ c
        inertia = R @ about_com @ R.T
        bodies.append(PlainBody(i, m, com, inertia, moved + np.cross(w, R @ c), w))
        joints.append(PlainJoint(kind, i, k, p, axis, rate, efforts.get(link.name, 0.0)))
        spins, origins, speeds = [*spins, w], [*origins, p], [*speeds, moved]
    cuts = []
    for cut in system.cuts:
        R, p = placed(cut.link_a, cut.pose_a)
        axis = R @ np.array(cut.edge.joint.axis, dtype=float)
        cuts.append(PlainJoint("revolute", cut.link_a, cut.link_b, p, axis))
    springs = tuple(_spring(force, placed) for force in system.parts)
    names = [link.name for link in tree.links]
    body, local = system.frame(names.index(output) + 1 if output in names else output)
    tracked = body, placed(body, local)[1]
    gravity = numbers(tree.gravity).ravel()
    return PlainMechanism(gravity, tuple(bodies), tuple(joints), tuple(cuts), springs, tracked)


def _spring(force: Any, placed: Any) -> PlainSpring:
    (a, pose_a), (b, pose_b) = force.frames
    values = [float(getattr(force.element, k).value) for k in ("stiffness", "length", "damping")]
    return PlainSpring(a, b, placed(a, pose_a)[1], placed(b, pose_b)[1], *values)


def numbers(value: Any) -> Array:
    """The values of constant expressions."""
    return np.array(casadi.evalf(casadi.densify(casadi.SX(value))))
