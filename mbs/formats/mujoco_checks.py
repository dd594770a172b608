"""What a compiled MuJoCo model may have that changes the motion and that mbs does not model."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from mbs.errors import DescriptionError
from mbs.formats.mujoco_model import MjcfModel, joint_transmissions


def check_supported(mjcf: MjcfModel) -> None:
    """Refuse fluids, tendons that pull, springs that are not linear, and the like.

    What the flags of the file switch off may be there.

    Raises:
        DescriptionError: the first such thing, by its name.
    """
    for checks in (_model, _bodies, _joints, _tendons, _actuators):
        for complaint in checks(mjcf):
            raise DescriptionError(f"{mjcf.path}: {complaint}; take it out of the file")


def _model(mjcf: MjcfModel) -> Iterator[str]:
    model = mjcf.data
    for name in mjcf.flags.unknown:
        yield f"its flag {name!r} is set, which this reader does not know"
    if mjcf.flags.passive and (model.opt.density or model.opt.viscosity):
        yield "the medium has a density or viscosity, which mbs does not model"
    if model.nflex:
        yield "it has flexible objects (flex), which mbs does not model"
    if model.nplugin:
        yield "it has plugins, which mbs does not model"


def _bodies(mjcf: MjcfModel) -> Iterator[str]:
    model = mjcf.data
    compensated = mjcf.flags.passive and mjcf.flags.gravity
    for k, name in enumerate(mjcf.bodies):
        if model.body_gravcomp[k] and compensated:
            yield f"body {name!r} has gravity compensation, which mbs does not model"
        if model.body_mocapid[k] >= 0:
            yield f"body {name!r} is moved from outside (mocap), which mbs does not model"


def _joints(mjcf: MjcfModel) -> Iterator[str]:
    model, kinds = mjcf.data, mjcf.mujoco.mjtJoint
    on_axes = (int(kinds.mjJNT_HINGE), int(kinds.mjJNT_SLIDE))
    springs, dampers = mjcf.flags.springs, mjcf.flags.dampers
    for j, name in enumerate(mjcf.joints):
        if springs and model.jnt_stiffness[j] and int(model.jnt_type[j]) not in on_axes:
            yield f"ball or free joint {name!r} has a spring (stiffness), which mbs does not model"
        if springs and _any(model, "jnt_stiffnesspoly", j):
            yield f"joint {name!r} has a spring that is not linear, which mbs does not model"
        if dampers and _any(model, "dof_dampingpoly", int(model.jnt_dofadr[j])):
            yield f"joint {name!r} has damping that is not linear, which mbs does not model"


def _tendons(mjcf: MjcfModel) -> Iterator[str]:
    model, flags = mjcf.data, mjcf.flags
    acting = {"stiffness": flags.springs, "stiffnesspoly": flags.springs}
    acting |= {"damping": flags.dampers, "dampingpoly": flags.dampers}
    acting |= {"frictionloss": flags.friction}
    for k in range(model.ntendon):
        for what, acts in acting.items():
            if acts and _any(model, f"tendon_{what}", k):
                yield f"tendon {model.tendon(k).name!r} has {what}, which mbs does not model"
        if _any(model, "tendon_armature", k):
            yield f"tendon {model.tendon(k).name!r} has armature, which mbs does not model"


def _actuators(mjcf: MjcfModel) -> Iterator[str]:
    model = mjcf.data
    for k in range(model.nu):
        name = model.actuator(k).name
        if int(model.actuator_trntype[k]) not in joint_transmissions(mjcf.mujoco):
            yield f"actuator {name!r} does not act on a joint, which mbs does not model"
        for what in ("armature", "damping", "dampingpoly"):
            if _any(model, f"actuator_{what}", k):
                yield f"actuator {name!r} has {what}; give it to the joint"


def _any(model: Any, field: str, k: int) -> bool:
    """Whether a field, which older versions of MuJoCo may lack, is not zero at k."""
    values = getattr(model, field, None)
    return values is not None and bool(np.any(values[k]))
