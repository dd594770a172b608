"""How far postures are from the wanted pose: the forward model of a chain on symbols."""

from __future__ import annotations

import casadi
import numpy as np
from casadi import SX
from numpy.typing import NDArray

from mbs.models.inverse_geometry.chain import Chain
from mbs.spatial import Pose, axis_turn, vector


def forward(chain: Chain, x: SX, p: NDArray[np.float64] | None = None) -> Pose:
    """The pose of the frame for positions x, (n, 1), of the free joints.

    Args:
        chain: from the base to the frame.
        x: positions [rad or m].
        p: (np,) numbers in the place of the parameters; symbols stay symbols when left out.
    """
    gaps = chain.ways(p)
    pose = gaps[0]
    for k, slides in enumerate(chain.prismatic):
        turn = Pose.turned(axis_turn("z", SX(x[k])).matrix)
        pose = pose @ (Pose.moved(vector([0, 0, x[k]])) if slides else turn) @ gaps[k + 1]
    return pose


def residual(pose: Pose, T: SX) -> SX:
    """The largest difference of an element between a pose and T (4, 4), in m and 1."""
    return relative_residual(pose, T, SX(1))


def relative_residual(pose: Pose, T: SX, length: SX) -> SX:
    """The same with positions in multiples of a length [m]."""
    turned = casadi.vec(pose.R - T[:3, :3])
    return SX(casadi.mmax(casadi.fabs(casadi.vertcat(turned, (pose.p - T[:3, 3]) / length))))


def size(chain: Chain, p: NDArray[np.float64] | None = None) -> SX:
    """A length of the chain's size [m], 1 where all its ways are turns alone."""
    lengths = [casadi.norm_2(gap.p) for gap in chain.ways(p) if not gap.p.is_zero()]
    return SX(sum(lengths, SX(0))) if lengths else SX(1)
