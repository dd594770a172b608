"""Random trees described twice: as components for mbs, and as MJCF for MuJoCo."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mbs import Mechanism
from mbs.components import (
    Body,
    Cylindrical,
    Free,
    Planar,
    Prismatic,
    Revolute,
    Spherical,
    Universal,
)
from mbs.components.component import in_plane
from mbs.components.joints import Motion

KINDS = ("revolute", "prismatic", "universal", "cylindrical", "planar", "spherical")
ALL_KINDS = (*KINDS, "free")


@dataclass(frozen=True)
class TwinTree:
    """The same tree for two codes."""

    mechanism: Mechanism
    mjcf: str


def random_rotation(rng):
    q, r = np.linalg.qr(rng.standard_normal((3, 3)))
    q = q * np.sign(np.diag(r))
    return q if np.linalg.det(q) > 0 else -q


def random_body(rng, name):
    moments = rng.uniform(0.05, 0.3, 3)
    moments[2] = rng.uniform(abs(moments[0] - moments[1]), moments[0] + moments[1])
    R = random_rotation(rng)
    inertia = R @ np.diag(moments) @ R.T
    inertia = (inertia + inertia.T) / 2
    return Body(
        name, mass=rng.uniform(0.5, 3.0), com=tuple(rng.uniform(-0.3, 0.3, 3)), inertia=inertia
    )


def _axis(rng, aligned):
    if aligned:
        return "xyz"[rng.integers(3)]
    direction = rng.standard_normal(3)
    return tuple(direction / np.linalg.norm(direction))


def _joint(rng, kind, name, aligned):
    efforts = dict(Fv=rng.uniform(0, 0.5), Ia=rng.uniform(0.01, 0.2))
    axis = _axis(rng, aligned)
    match kind:
        case "revolute":
            return Revolute(name, axis=axis, **efforts)
        case "prismatic":
            return Prismatic(name, axis=axis, **efforts)
        case "cylindrical":
            return Cylindrical(name, axis=axis, **efforts)
        case "planar":
            return Planar(name, axis=axis, **efforts)
        case "universal":
            R = np.eye(3)[:, rng.permutation(3)] if aligned else random_rotation(rng)
            return Universal(name, axes=(tuple(R[:, 0]), tuple(R[:, 1])), **efforts)
        case "spherical":
            return Spherical(name, **efforts)
    return Free(name)


def _text(values):
    return " ".join(repr(float(v)) for v in np.ravel(values))


def _mjcf_joint(joint):
    """The MJCF elements of a joint; several for a joint of several freedoms."""
    Fv, Ia = (float(str(joint.Fv)), float(str(joint.Ia)))
    lines = []
    kinds = {
        Motion.REVOLUTE: "hinge",
        Motion.PRISMATIC: "slide",
        Motion.SPHERICAL: "ball",
        Motion.FREE: "free",
    }
    for number, freedom in enumerate(joint.freedoms):
        axis = (
            ""
            if freedom.motion in (Motion.SPHERICAL, Motion.FREE)
            else (f'axis="{_text(freedom.axis)}"')
        )
        dynamics = "" if freedom.motion is Motion.FREE else f'damping="{Fv!r}" armature="{Ia!r}"'
        lines.append(
            f'<joint name="{joint.name}_{number}" type="{kinds[freedom.motion]}"'
            f" {axis} {dynamics}/>"
        )
    return "\n".join(lines)


def _quaternion(R):
    """w, x, y, z of a rotation matrix."""
    K = np.array(
        [
            [R[0, 0] + R[1, 1] + R[2, 2], 0, 0, 0],
            [R[2, 1] - R[1, 2], R[0, 0] - R[1, 1] - R[2, 2], 0, 0],
            [R[0, 2] - R[2, 0], R[0, 1] + R[1, 0], R[1, 1] - R[0, 0] - R[2, 2], 0],
            [
                R[1, 0] - R[0, 1],
                R[0, 2] + R[2, 0],
                R[1, 2] + R[2, 1],
                R[2, 2] - R[0, 0] - R[1, 1],
            ],
        ]
    )
    vector = np.linalg.eigh(K / 3)[1][:, -1]
    return vector


def random_tree(seed, n=4, kinds=KINDS, aligned=False, serial=False):
    """A random tree of n joints; with `aligned` its axes and offsets are along coordinate axes."""
    rng = np.random.default_rng(seed)
    gravity = tuple(rng.uniform(-10, 10, 3))
    mechanism = Mechanism(f"tree{seed}", gravity=gravity)
    bodies, xml, children = [], [], [[] for _ in range(n + 1)]
    for k in range(n):
        parent = k if serial else int(rng.integers(0, k + 1))
        body = mechanism.add(random_body(rng, f"body{k}"))
        kind = kinds[int(rng.integers(len(kinds)))]
        if kind == "free":
            parent = 0
        joint = _joint(rng, kind, f"j{k}", aligned)
        p = rng.uniform(-0.5, 0.5, 3) * (rng.integers(0, 2, 3) if aligned else 1)
        R = np.eye(3) if aligned else random_rotation(rng)
        if kind == "free":
            p, R = np.zeros(3), np.eye(3)
        before = mechanism.world if parent == 0 else bodies[parent - 1]
        mechanism.connect(before.at(*p, rotation=R), joint, body)
        bodies.append(body)
        J = [float(str(x)) for x in body.inertia]
        xml.append(
            f'<body name="{body.name}" pos="{_text(p)}" quat="{_text(_quaternion(R))}">'
            f"{_mjcf_joint(joint)}"
            f'<inertial mass="{float(str(body.mass))!r}"'
            f' pos="{_text([float(str(c)) for c in body.com])}"'
            f' fullinertia="{_text([J[0], J[3], J[5], J[1], J[2], J[4]])}"/>'
        )
        children[parent].append(k + 1)

    def write(number):
        inner = "".join(write(child) for child in children[number])
        return inner if number == 0 else f"{xml[number - 1]}{inner}</body>"

    mjcf = (
        '<mujoco><compiler angle="radian" autolimits="true" boundmass="0" boundinertia="0"/>'
        f'<option gravity="{_text(gravity)}" timestep="0.001"/>'
        f"<worldbody>{write(0)}</worldbody></mujoco>"
    )
    return TwinTree(mechanism, mjcf)


def random_state(system, rng, scale=1.0):
    """Random q (unit quaternions), v and a."""
    q = rng.uniform(-2, 2, system.nq) * scale
    for link in system.tree.links:
        if link.motion in (Motion.SPHERICAL, Motion.FREE):
            part = slice(link.q.stop - 4, link.q.stop)
            q[part] = rng.standard_normal(4)
            q[part] /= np.linalg.norm(q[part])
    return q, rng.uniform(-2, 2, system.nv), rng.uniform(-3, 3, system.nv)


__all__ = ["ALL_KINDS", "KINDS", "TwinTree", "in_plane", "random_state", "random_tree"]
