"""Joints of a compiled MuJoCo model."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from mbs.components import (
    Body,
    Free,
    Joint,
    Mechanism,
    Point,
    Prismatic,
    Revolute,
    RigidBody,
    Spherical,
)
from mbs.formats.mujoco_efforts import effort_range
from mbs.formats.mujoco_model import MjcfModel, matrix_of, placed


def add_joints(mechanism: Mechanism, mjcf: MjcfModel, k: int, parent: Point) -> None:
    """Connect body k, which the mechanism has already, to its parent by its joints.

    A body without joints is welded. Several joints follow one another from the parent to the
    body, with a body without mass between any two of them.
    """
    model = mjcf.data
    body = mechanism.components[mjcf.bodies[k]]
    assert isinstance(body, RigidBody)
    point = placed(parent, model.body_pos[k], model.body_quat[k])
    first = int(model.body_jntadr[k])
    joints = range(first, first + int(model.body_jntnum[k]))
    if not joints:
        mechanism.connect(point, body)
    for j in joints:
        moved = body if j == joints[-1] else mechanism.add(_between(mjcf, k, j))
        joint = _joint(mjcf, j)
        if isinstance(joint, Free):
            mechanism.connect(parent, joint, moved)
        else:
            x, y, z = (float(value) for value in model.jnt_pos[j])
            mechanism.connect(_referred(mjcf, j, point.at(x, y, z)), joint, moved.at(x, y, z))
        point = moved.frame


def _between(mjcf: MjcfModel, k: int, j: int) -> Body:
    return Body(f"{mjcf.bodies[k]}_{mjcf.joints[j]}")


def _joint(mjcf: MjcfModel, j: int) -> Joint:
    model, kinds, flags = mjcf.data, mjcf.mujoco.mjtJoint, mjcf.flags
    kind, dof = kinds(int(model.jnt_type[j])), int(model.jnt_dofadr[j])
    driven = bool(mjcf.actuators_of(j))
    common: dict[str, Any] = {
        "name": mjcf.joints[j],
        "actuated": driven if model.nu else None,
        "Ia": float(model.dof_armature[dof]),
        "Fv": float(model.dof_damping[dof]) if flags.dampers else 0.0,
        "Fs": float(model.dof_frictionloss[dof]) if flags.friction else 0.0,
    }
    if kind == kinds.mjJNT_FREE:
        return Free(**{**common, "actuated": driven})
    if kind == kinds.mjJNT_BALL:
        return Spherical(**common)
    if model.jnt_limited[j] and flags.limits:
        common["limits"] = tuple(float(value) for value in model.jnt_range[j])
    common["effort"] = effort_range(mjcf, j)
    if model.jnt_stiffness[j] and flags.springs:
        common["stiffness"] = float(model.jnt_stiffness[j])
        common["rest"] = float(model.qpos_spring[model.jnt_qposadr[j]])
    axis = tuple(float(value) for value in model.jnt_axis[j])
    one_axis = Revolute if kind == kinds.mjJNT_HINGE else Prismatic
    return one_axis(axis=axis, **common)


def _referred(mjcf: MjcfModel, j: int, point: Point) -> Point:
    """The frame moved back by `ref`, the position that the joint has as it is drawn."""
    model, kinds = mjcf.data, mjcf.mujoco.mjtJoint
    kind = kinds(int(model.jnt_type[j]))
    if kind == kinds.mjJNT_BALL:
        return point
    ref = float(model.qpos0[model.jnt_qposadr[j]])
    axis = np.array(model.jnt_axis[j], dtype=float)
    if ref == 0:
        return point
    if kind == kinds.mjJNT_SLIDE:
        x, y, z = (float(value) for value in -ref * axis)
        return point.at(x, y, z)
    half = -ref / 2
    turn = matrix_of([math.cos(half), *(math.sin(half) * axis)])
    return point.at(rotation=turn.tolist())
