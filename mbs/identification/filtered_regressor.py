"""The filtered identification model, which needs no accelerations."""

from __future__ import annotations

from collections.abc import Sequence

import casadi
from casadi import SX

from mbs.assembly import System
from mbs.assembly.model_function import Named
from mbs.assembly.rates import position_rate
from mbs.identification.columns import Joints, columns_of
from mbs.identification.joint_columns import JointColumns
from mbs.identification.regressor import Regressor, regressor_function, side_by_side
from mbs.models.symbols import ModelSymbols
from mbs.recursions.regressor_filtered import momentum_regressor, position_regressor
from mbs.recursions.velocities import link_velocities


def filtered_regressor(
    system: System,
    *,
    rotors: bool = True,
    friction: bool = True,
    offsets: bool = False,
    couplings: Sequence[Joints] = (),
    coordinates: str = "independent",
) -> Regressor:
    """``filtered_regressor(q, v) -> D1, D2``: joint efforts as d(D1 K)/dt + D2 K.

    D1 K is the derivative of the kinetic energy in v, D2 K that of U - E in the positions, with
    friction and offsets; in independent coordinates D1 = G' D1_tree and
    D2 = G' D2_tree - dG'/dt D1_tree. One filter over both sides makes the derivative its own.

    Source: Khalil & Restrepo 1996; Khalil & Creusot 1997, eq. 41-44.

    Args:
        system: open or closed; q must close the loops.
        rotors: see `columns_of`.
        friction: see `columns_of`.
        offsets: see `columns_of`.
        couplings: see `columns_of`.
        coordinates: of a closed system, "independent" or "tree".

    Returns:
        Function of q (nq, 1) and v (m, 1); D1 and D2 (m, n) with `columns`.

    Raises:
        ModelError: as `columns_of`.
    """
    columns = columns_of(
        system, rotors=rotors, friction=friction, offsets=offsets, couplings=couplings
    )

    def build(s: ModelSymbols) -> tuple[Named, Named]:
        tree = system.tree
        velocities = link_velocities(tree, s.poses, s.v_tree)
        joints = JointColumns(system.tree, s.poses, s.v_tree, velocities)
        D1 = side_by_side(columns, momentum_regressor(tree, s.poses, velocities), joints.momentum)
        D2 = side_by_side(columns, position_regressor(tree, s.poses, velocities), joints.rest)
        reduced = s.reduced_effort(D2)
        if s.reduction is not None:
            reduced = reduced - casadi.mtimes(_rate(system, s, s.reduction.G).T, D1)
        return [], [("D1", s.reduced_effort(D1)), ("D2", reduced)]

    return regressor_function(system, "filtered_regressor", columns, build, coordinates)


def _rate(system: System, s: ModelSymbols, G: SX) -> SX:
    """The rate of a matrix of the positions."""
    qdot = position_rate(system.tree, s.q, s.v_tree)
    return casadi.reshape(casadi.jtimes(casadi.vec(G), s.q, qdot), *G.shape)
