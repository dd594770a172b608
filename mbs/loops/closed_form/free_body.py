"""A free body as the only unknown joint: its place and quaternion follow from its pose."""

from __future__ import annotations

import casadi
from casadi import SX

from mbs.components.motion import Motion
from mbs.loops.closed_form.ball import unit_quaternion
from mbs.loops.closed_form.ring import Ring
from mbs.loops.closed_form.root import Root


def free_body(ring: Ring, q: SX, p: SX) -> Root | None:
    """The pose of a free body; None unless it alone is unknown."""
    joint = ring.joints[0]
    if len(ring.joints) != 1 or joint.motion is not Motion.FREE or joint.place is None:
        return None
    pose = ring.gaps[0].pose
    pose = pose.inverse() if joint.sign > 0 else pose
    values = casadi.vertcat(pose.p, unit_quaternion(pose.R))
    return Root({"": {joint.place + k: values[k] for k in range(7)}})
