"""Reduction of a closed system to its independent velocities: v = G v_a + g, a = G a_a + gamma.

Source: Kleinfinger & Khalil 1986; Khalil & Creusot 1997, eq. 13, 14 and 22.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi
from casadi import DM, SX, Function

from mbs.assembly import System
from mbs.assembly.model_function import Named, model_function
from mbs.loops.examination import DETERMINED
from mbs.loops.velocity import acceleration_bias, determining_rows
from mbs.solvers.block_triangular import solve_large
from mbs.spatial import zeros


@dataclass(frozen=True, slots=True, eq=False)
class Reduction:
    """Velocities and accelerations of the tree from the independent ones.

    Attributes:
        G: (nv, m), v = G v_a + g.
        gamma: (nv, 1), a = G a_a + gamma; None unless velocities were given.
        drift: (nv, 1) g, velocities of massless nodes that dampers hold; None without such nodes.
    """

    G: SX
    gamma: SX | None
    drift: SX | None = None

    def velocities(self, v_a: SX) -> SX:
        """Return the velocities (nv, 1) of the tree.

        Args:
            v_a: (m, 1) independent velocities.
        """
        v = casadi.mtimes(self.G, v_a)
        return casadi.densify(v if self.drift is None else v + self.drift)


def reduction_matrix(system: System) -> Function:
    """Return ``reduction_matrix(q) -> G``: map from independent to tree velocities, v = G v_a.

    With massless nodes that dampers hold, v = G v_a + g; the function returns G.

    Args:
        system: mechanism with closed loops.

    Returns:
        Function of q (nq, 1) that closes the loops; G (nv, m).

    Raises:
        ModelError: the system is an open chain.
    """

    def build() -> tuple[Named, Named]:
        q = SX.sym("q", system.nq)
        return [("q", q)], [("G", reduction(system, q).G)]

    return model_function(system, ("reduction_matrix",), build, DETERMINED)


def reduction(system: System, q: SX, v_a: SX | None = None) -> Reduction:
    """Return G, and gamma for the independent velocities v_a, at the symbols q.

    Args:
        system: mechanism with closed loops.
        q: (nq, 1) symbols of positions that close the loops.
        v_a: (m, 1) independent velocities; None if gamma is not needed.
    """
    closure = system.closure
    assert closure is not None
    active, rows = list(closure.independent), determining_rows(system, q)
    W = -solve_large(rows.square, casadi.mtimes(rows.mixed, rows.J[:, active]))
    G = tree_rows(system, W, SX(DM.eye(len(active))))
    drift = None
    if rows.drift is not None:
        own = -solve_large(rows.square, casadi.mtimes(rows.mixed, rows.drift))
        drift = tree_rows(system, own, zeros(len(active)))
    if v_a is None:
        return Reduction(G, None, drift)
    v = Reduction(G, None, drift).velocities(v_a)
    speed = SX.sym("v", system.nv)
    bias = acceleration_bias(system, q, speed, rows.J, rows.drift)
    psi = casadi.substitute(bias, speed, v)
    a_p = -solve_large(rows.square, casadi.mtimes(rows.mixed, psi))
    return Reduction(G, tree_rows(system, a_p, zeros(len(active))), drift)


def tree_rows(system: System, passive: SX, active: SX) -> SX:
    """Return the rows of passive and of independent velocities merged in the order of v, (nv, m).

    Args:
        system: mechanism with closed loops.
        passive: (r, m) rows of the passive velocities.
        active: (nv - r, m) rows of the independent velocities.
    """
    closure = system.closure
    assert closure is not None
    rows = zeros(system.nv, active.shape[1])
    rows[list(closure.independent), :] = active
    rows[list(closure.passive), :] = passive
    return rows
