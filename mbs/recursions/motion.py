"""What an elementary motion adds to a link: its velocity, and the effort that it feels."""

import casadi
from casadi import SX

from mbs.components.motion import Motion
from mbs.spatial import zeros


def relative_motion(motion: Motion, v: SX) -> tuple[SX, SX]:
    """Linear and angular velocity of frame j with respect to its placement, both in frame j."""
    match motion:
        case Motion.REVOLUTE:
            return zeros(), casadi.vertcat(SX(0), SX(0), v)
        case Motion.PRISMATIC:
            return casadi.vertcat(SX(0), SX(0), v), zeros()
        case Motion.SPHERICAL:
            return zeros(), v
    return v[0:3], v[3:6]


def effort(motion: Motion, f: SX, m: SX) -> SX:
    """The part of a wrench, force f and moment m about the origin of frame j, along the motion."""
    match motion:
        case Motion.REVOLUTE:
            return m[2]
        case Motion.PRISMATIC:
            return f[2]
        case Motion.SPHERICAL:
            return m
    return casadi.vertcat(f, m)


def unit_motions(motion: Motion) -> list[tuple[SX, SX]]:
    """Linear and angular velocity in frame j for a unit of each of its velocities."""
    identity = SX.eye(motion.nv)
    return [relative_motion(motion, casadi.densify(identity[:, k])) for k in range(motion.nv)]
