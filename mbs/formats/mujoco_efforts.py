"""What the actuators of a compiled MuJoCo model can give a joint."""

from __future__ import annotations

import math

from mbs.formats.mujoco_model import MjcfModel

_Range = tuple[float, float]


def effort_range(mjcf: MjcfModel, j: int) -> _Range | None:
    """(lower, upper) of the effort of joint j [N m or N], None where it is not limited.

    The sum of the forcerange of its actuators times their gear, within the actuatorfrcrange of the
    joint; a motor, which has no dynamics and no feedback, is limited by its ctrlrange too, unless
    the flag clampctrl is disabled.

    Args:
        mjcf: the model.
        j: number of a hinge or slide.
    """
    model = mjcf.data
    lower, upper = 0.0, 0.0
    acting = mjcf.actuators_of(j)
    for k in acting:
        gear = float(model.actuator_gear[k, 0])
        ends = sorted(gear * end for end in _force(mjcf, k)) if gear else (0.0, 0.0)
        lower, upper = lower + ends[0], upper + ends[1]
    if not acting:
        lower, upper = -math.inf, math.inf
    if model.jnt_actfrclimited[j]:
        least, largest = (float(end) for end in model.jnt_actfrcrange[j])
        lower, upper = max(lower, least), min(upper, largest)
    limited = math.isfinite(lower) or math.isfinite(upper)
    return (lower, upper) if limited and lower <= 0 <= upper and lower < upper else None


def _force(mjcf: MjcfModel, k: int) -> _Range:
    """What actuator k gives before its gear."""
    model, kinds = mjcf.data, mjcf.mujoco
    low, high = -math.inf, math.inf
    if model.actuator_forcelimited[k]:
        low, high = (float(end) for end in model.actuator_forcerange[k])
    plain = (
        int(model.actuator_gaintype[k]) == int(kinds.mjtGain.mjGAIN_FIXED)
        and int(model.actuator_biastype[k]) == int(kinds.mjtBias.mjBIAS_NONE)
        and int(model.actuator_dyntype[k]) == int(kinds.mjtDyn.mjDYN_NONE)
    )
    if plain and model.actuator_ctrllimited[k] and mjcf.flags.control_ranges:
        gain = float(model.actuator_gainprm[k, 0])
        ends = sorted(gain * float(end) for end in model.actuator_ctrlrange[k])
        low, high = max(low, ends[0]), min(high, ends[1])
    return low, high
