"""How positions change with velocities: dq/dt = N(q) v."""

import casadi
from casadi import SX

from mbs.assembly.tree import Link, Tree
from mbs.components.motion import Motion
from mbs.spatial import quaternion_rate, quaternion_rotation


def position_rate(tree: Tree, q: SX, v: SX) -> SX:
    """(nq, 1) time derivative of the positions; equal to v where no quaternion is involved."""
    return casadi.vertcat(*(_rate(link, q[link.q], v[link.v]) for link in tree.links))


def _rate(link: Link, q: SX, v: SX) -> SX:
    match link.motion:
        case Motion.SPHERICAL:
            return quaternion_rate(q, v)
        case Motion.FREE:
            linear = casadi.mtimes(quaternion_rotation(q[3:7]), v[0:3])
            return casadi.vertcat(linear, quaternion_rate(q[3:7], v[3:6]))
    return v


def quaternion_slices(tree: Tree) -> list[slice]:
    """Where the unit quaternions stand in q."""
    found = {Motion.SPHERICAL: 0, Motion.FREE: 3}
    return [
        slice(link.q.start + found[link.motion], link.q.stop)
        for link in tree.links
        if link.motion in found
    ]


def norm_rows(tree: Tree, q: SX) -> SX:
    """(k, 1) squared length less one of every quaternion in the positions q, (nq, 1)."""
    rows = [norm for _, norm in norms_of(tree, q)]
    return casadi.vertcat(*rows) if rows else SX(0, 1)


def norms_of(tree: Tree, q: SX) -> list[tuple[slice, SX]]:
    """Where each quaternion stands in q, and its squared length less one."""
    return [(part, casadi.sumsqr(q[part]) - 1) for part in quaternion_slices(tree)]


def normalised(tree: Tree, q: SX) -> SX:
    """The positions with their quaternions brought back to unit length."""
    result = SX(q)
    for part in quaternion_slices(tree):
        result[part] = q[part] / casadi.sqrt(casadi.sumsqr(q[part]))
    return result


def zero_position(tree: Tree) -> list[float]:
    """Positions of the posture in which every joint is at zero, quaternions at the identity."""
    q = [0.0] * tree.nq
    for part in quaternion_slices(tree):
        q[part.start] = 1.0
    return q
