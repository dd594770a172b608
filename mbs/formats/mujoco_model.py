"""A model that MuJoCo compiled, with names that components can bear."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mbs.components import Point
from mbs.formats.files import component_name
from mbs.formats.mujoco_flags import Flags


@dataclass(frozen=True, slots=True)
class MjcfModel:
    """A compiled model.

    Attributes:
        mujoco: the module.
        data: the mujoco.MjModel.
        path: of the file, for messages.
        bodies, joints, sites, equalities: names, by MuJoCo's numbers.
        acting: numbers of the actuators that are not switched off and act on a joint.
        flags: what acts in the model.
    """

    mujoco: Any
    data: Any
    path: str
    bodies: tuple[str, ...]
    joints: tuple[str, ...]
    sites: tuple[str, ...]
    equalities: tuple[str, ...]
    acting: tuple[int, ...]
    flags: Flags

    @staticmethod
    def of(mujoco: Any, model: Any, path: str) -> MjcfModel:
        """The model with its names made fit for components, each of them used once."""
        bodies = _names((model.body(k).name for k in range(model.nbody)), "body")
        joints = tuple(
            component_name(model.joint(j).name) or _joint_name(model, j, bodies)
            for j in range(model.njnt)
        )
        bodies = tuple(_apart(name, {*joints, "base"}, "body") for name in bodies)
        sites = _names((model.site(k).name for k in range(model.nsite)), "site")
        taken = {*bodies, *joints, "base"}
        flags = Flags.of(mujoco, model)
        return MjcfModel(
            mujoco,
            model,
            path,
            bodies,
            joints,
            tuple(_apart(name, taken, "site") for name in sites),
            _names((model.eq(k).name for k in range(model.neq)), "equality"),
            tuple(
                k
                for k in range(model.nu)
                if int(model.actuator_trntype[k]) in joint_transmissions(mujoco)
                and flags.drives(int(model.actuator_group[k]))
            ),
            flags,
        )

    def actuators_of(self, j: int) -> list[int]:
        """Numbers of the actuators that act on joint j."""
        return [k for k in self.acting if int(self.data.actuator_trnid[k, 0]) == j]


def joint_transmissions(mujoco: Any) -> tuple[int, ...]:
    """The ways in which an actuator acts on a joint."""
    kinds = mujoco.mjtTrn
    return int(kinds.mjTRN_JOINT), int(kinds.mjTRN_JOINTINPARENT)


def placed(point: Point, pos: Sequence[float], quat: Sequence[float]) -> Point:
    """The frame at a position [m] and a quaternion (w, x, y, z) of a frame."""
    R = matrix_of(quat)
    turned = None if np.allclose(R, np.eye(3), rtol=0, atol=1e-15) else R.tolist()
    x, y, z = (float(value) for value in pos)
    return point.at(x, y, z, rotation=turned)


def matrix_of(quat: Sequence[float]) -> Any:
    """(3, 3) rotation of a quaternion (w, x, y, z) of any length but zero."""
    w, x, y, z = np.asarray(quat, dtype=float) / math.hypot(*quat)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def _names(names: Iterable[str], kind: str) -> tuple[str, ...]:
    return tuple(component_name(name) or f"{kind}{k}" for k, name in enumerate(names))


def _joint_name(model: Any, j: int, bodies: tuple[str, ...]) -> str:
    k = int(model.jnt_bodyid[j])
    alone = model.body_jntnum[k] == 1
    return f"{bodies[k]}_joint" if alone else f"{bodies[k]}_joint{j - model.body_jntadr[k] + 1}"


def _apart(name: str, taken: Iterable[str], kind: str) -> str:
    return f"{name}_{kind}" if name in taken else name
