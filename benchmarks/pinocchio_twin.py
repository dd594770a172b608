"""The pinocchio model of a System, joint for joint, so that numbers can be compared."""

from __future__ import annotations

from typing import Any

import casadi
import numpy as np
import pinocchio as pin

from mbs.assembly import System
from mbs.components.joints import Motion

_JOINTS = {
    Motion.REVOLUTE: pin.JointModelRZ,
    Motion.PRISMATIC: pin.JointModelPZ,
    Motion.FREE: pin.JointModelFreeFlyer,
}


def twin(system: System) -> pin.Model:
    """The model with the links of a system in the same order, its rotors as armature.

    Its q differs in the order of quaternions alone; see `to_twin`. Friction is left out.
    """
    model = pin.Model()
    model.gravity.linear = _numbers(system.tree.gravity).ravel()
    model.gravity.angular = np.zeros(3)
    armature = []
    for link in system.tree.links:
        at = link.placement
        turn = _about("z", at.gamma) @ _about("x", at.alpha) @ _about("z", at.theta)
        along = np.array([_number(at.d), 0, _number(at.r)])
        origin = _about("z", at.gamma) @ ([0, 0, _number(at.b)] + _about("x", at.alpha) @ along)
        joint = _JOINTS[link.motion]()
        number = model.addJoint(link.antecedent + 1, joint, pin.SE3(turn, origin), link.name)
        model.appendBodyToJoint(number, _inertia(link.inertia), pin.SE3.Identity())
        armature += [_number(link.Ia)] * link.motion.nv
    model.armature = np.array(armature)
    return model


def to_twin(system: System, q: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """Positions (states, nq) with quaternions in pinocchio's order x, y, z, w."""
    result = q.copy()
    for link in system.tree.links:
        if link.motion is Motion.FREE:
            start = link.q.start + 3
            result[:, start : start + 4] = np.roll(q[:, start : start + 4], -1, axis=1)
    return result


def _inertia(inertia: Any) -> pin.Inertia:
    m, ms, J = _number(inertia.m), _numbers(inertia.ms).ravel(), _numbers(inertia.J)
    c = ms / m if m else np.zeros(3)
    return pin.Inertia(m, c, J - m * (c @ c * np.eye(3) - np.outer(c, c)))


def _about(axis: str, angle: Any) -> np.ndarray[Any, Any]:
    c, s = np.cos(_number(angle)), np.sin(_number(angle))
    if axis == "x":
        return np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])


def _number(value: Any) -> float:
    return float(_numbers(value)[0, 0])


def _numbers(value: Any) -> np.ndarray[Any, Any]:
    return np.array(casadi.evalf(casadi.densify(casadi.SX(value))))
