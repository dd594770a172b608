"""The dynamic model in Lagrange's form: tau = A a + B v + Q.

B is made of the Christoffel symbols, so that dA/dt - 2 B is skew-symmetric. For quaternion joints,
whose velocities are not rates of positions, Hamel's terms are added as a skew-symmetric block.

Source: Khalil & Creusot 1997, section 5.5; Hamel 1904 for quasi-velocities.
"""

from __future__ import annotations

import casadi
from casadi import SX, Function

from mbs.assembly import System, Tree
from mbs.assembly.model_function import Named, model_function
from mbs.assembly.rates import position_rate
from mbs.components.motion import Motion
from mbs.errors import ModelError
from mbs.models.inverse_dynamics import tree_gravity
from mbs.models.symbols import symbols_of
from mbs.recursions.composite_body import inertia_matrix as tree_inertia
from mbs.spatial import skew


def lagrange(
    system: System, method: str = "christoffel", coordinates: str = "independent"
) -> Function:
    """``lagrange(q, v) -> A, B, Q``: inertia matrix, Coriolis matrix and gravity efforts.

    Friction is not part of it. For closed systems B is G' (A dG/dt + B G).

    Args:
        system: open or closed; q must close the loops.
        method: "christoffel".
        coordinates: of a closed system, "independent" or "tree".

    Returns:
        Function of q (nq, 1) and v (m, 1); A (m, m), B (m, m), Q (m, 1).

    Raises:
        ModelError: another method was asked for.
    """
    if method != "christoffel":
        raise ModelError(f"{system.name}: method is {method!r}; use 'christoffel'")

    def build() -> tuple[Named, Named]:
        s = symbols_of(system, coordinates)
        A = tree_inertia(system.tree, s.poses)
        v = SX.sym("v", system.nv)
        B = casadi.substitute(christoffel(system.tree, s.q, v, A), v, s.v_tree)
        if s.reduction is not None:
            G = s.reduction.G
            G_rate = casadi.jtimes(G, s.q, position_rate(system.tree, s.q, s.v_tree))
            B = casadi.mtimes(G.T, casadi.mtimes(A, G_rate) + casadi.mtimes(B, G))
        Q = s.reduced_effort(tree_gravity(system, s))
        outputs = (("A", s.reduced_matrix(A)), ("B", B), ("Q", Q))
        return [("q", s.q), ("v" + s.suffix, s.v)], [(n + s.suffix, x) for n, x in outputs]

    return model_function(system, ("lagrange", coordinates), build)


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
