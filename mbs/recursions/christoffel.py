"""B of Lagrange's form by differentiating the inertia matrix: Christoffel's symbols.

For quaternion joints, whose velocities are not rates of positions, Hamel's terms are added as a
skew-symmetric block.

Source: Khalil & Creusot 1997, section 5.5; Hamel 1904 for quasi-velocities.
"""

from __future__ import annotations

import casadi
from casadi import SX

from mbs.assembly.rates import position_rate
from mbs.assembly.tree import Tree
from mbs.components.motion import Motion
from mbs.spatial import skew


def christoffel(tree: Tree, q: SX, v: SX, A: SX) -> SX:
    """B (nv, nv) = (dA/dt + D - D') / 2 with D = d(A v)/dq N(q), plus Hamel's block.

    Args:
        tree: the links.
        q: (nq, 1) symbols.
        v: (nv, 1) symbols.
        A: (nv, nv) inertia matrix at q.
    """
    momentum = casadi.mtimes(A, v)
    direction = SX.sym("u", tree.nv)
    rate = position_rate(tree, q, direction)
    D = casadi.jacobian(casadi.jtimes(momentum, q, rate), direction)
    A_rate = casadi.jtimes(A, q, position_rate(tree, q, v))
    B = 0.5 * (A_rate + D - D.T)
    for link in tree.links:
        if link.motion in (Motion.SPHERICAL, Motion.FREE):
            B[link.v, link.v] += _hamel(link.motion, momentum[link.v])
    return B


def _hamel(motion: Motion, momentum: SX) -> SX:
    """The matrix that times the joint's own velocity is w x p (and V x p) of its momentum p."""
    if motion is Motion.SPHERICAL:
        return -skew(momentum)
    linear, angular = skew(momentum[0:3]), skew(momentum[3:6])
    return -casadi.vertcat(casadi.horzcat(SX.zeros(3, 3), linear), casadi.horzcat(linear, angular))
