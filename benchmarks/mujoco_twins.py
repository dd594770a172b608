"""The MuJoCo model of a mechanism: joint coordinates, loops closed by stiff connect constraints.

RK4 with the stiffest constraints that the step allows; MuJoCo's constraints are soft by design, and
with its default stiffness the error is of the size of the motion.
"""

from __future__ import annotations

from xml.etree.ElementTree import Element, SubElement, tostring

import mujoco
import numpy as np
from plain_mechanism import Array, PlainJoint, PlainMechanism

_TINY = 1e-12
"""Moments of inertia [kg m^2] that MuJoCo asks for where there is none."""
_SOFTNESS = 2.0
"""Time constant of the constraints in steps; MuJoCo takes no smaller one."""
_ROWS, _COLUMNS = [0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]
_KINDS = {"revolute": "hinge", "prismatic": "slide"}


class MujocoTwin:
    """A model that can be run again and again.

    The frames of all bodies lie in the base at the start, so that every number is one of the base.
    """

    def __init__(self, mechanism: PlainMechanism) -> None:
        root = Element("mujoco")
        SubElement(root, "option", gravity=_text(mechanism.gravity), integrator="RK4")
        world = SubElement(root, "worldbody")
        bodies: list[Element] = []
        for k, (part, joint) in enumerate(zip(mechanism.bodies, mechanism.joints, strict=True)):
            parent = bodies[part.antecedent] if part.antecedent >= 0 else world
            body = SubElement(parent, "body", name=f"b{k}")
            bodies.append(body)
            six = (part.inertia + _TINY * np.eye(3))[_ROWS, _COLUMNS]
            mass = repr(float(part.mass))
            SubElement(body, "inertial", pos=_text(part.com), mass=mass, fullinertia=_text(six))
            at, axis = _text(joint.at), _text(joint.axis)
            SubElement(body, "joint", name=f"j{k}", type=_KINDS[joint.kind], pos=at, axis=axis)
        _connects(root, mechanism.cuts)
        _springs(root, [world, *bodies], mechanism)
        self.model = mujoco.MjModel.from_xml_string(tostring(root, encoding="unicode"))
        self._data = mujoco.MjData(self.model)
        self._speeds = np.array([joint.speed for joint in mechanism.joints])
        self._efforts = np.array([joint.effort for joint in mechanism.joints])
        self._body, self._at = mechanism.tracked

    def run(self, step: float, duration: float, rows: int) -> Array:
        """Joint positions, (rows + 1, nq), every duration / rows."""
        steps = round(duration / step)
        if steps % rows:
            raise ValueError(f"{steps} steps do not fall on {rows} rows")
        model, data = self.model, self._data
        model.opt.timestep = step
        model.eq_solref[:] = _SOFTNESS * step, 1.0
        model.eq_solimp[:] = 0.9999, 0.9999, 1e-3, 0.5, 2.0
        mujoco.mj_resetData(model, data)
        data.qvel[:], data.qfrc_applied[:] = self._speeds, self._efforts
        table = np.empty((rows + 1, model.nq))
        table[0] = data.qpos
        for row in range(1, rows + 1):
            mujoco.mj_step(model, data, steps // rows)
            table[row] = data.qpos
        return table

    def places(self, table: Array) -> Array:
        """(rows, 3) positions of the tracked point at joint positions."""
        found = np.empty((len(table), 3))
        for row, q in enumerate(table):
            self._data.qpos[:] = q
            mujoco.mj_kinematics(self.model, self._data)
            R = self._data.xmat[self._body + 1].reshape(3, 3)
            found[row] = self._data.xpos[self._body + 1] + R @ self._at
        return found


def _connects(root: Element, cuts: tuple[PlainJoint, ...]) -> None:
    """A revolute joint in space holds two points of its axis, one about z a point."""
    equality = SubElement(root, "equality")
    for cut in cuts:
        planar = abs(cut.axis[2]) > 1 - 1e-12
        for along in (0.0,) if planar else (-0.5, 0.5):
            names = {"body2": f"b{cut.b}"} if cut.b >= 0 else {}
            anchor = _text(cut.at + along * cut.axis)
            SubElement(equality, "connect", body1=f"b{cut.a}", anchor=anchor, **names)


def _springs(root: Element, bodies: list[Element], mechanism: PlainMechanism) -> None:
    tendons = SubElement(root, "tendon")
    for k, spring in enumerate(mechanism.springs):
        values = {"springlength": spring.length, "stiffness": spring.stiffness}
        values["damping"] = spring.damping
        numbers = {name: repr(float(value)) for name, value in values.items()}
        tendon = SubElement(tendons, "spatial", **numbers)
        for side, body, at in (("a", spring.a, spring.at_a), ("b", spring.b, spring.at_b)):
            SubElement(bodies[body + 1], "site", name=f"s{k}{side}", pos=_text(at))
            SubElement(tendon, "site", site=f"s{k}{side}")


def _text(values: Array) -> str:
    return " ".join(repr(float(value)) for value in values)
