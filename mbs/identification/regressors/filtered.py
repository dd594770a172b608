"""The filtered identification model, which needs no accelerations."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Unpack

import casadi
from casadi import SX

from mbs.assembly import System
from mbs.assembly.model_function import Named
from mbs.assembly.rates import position_rate
from mbs.assembly.tree import Tree
from mbs.identification.regressors.columns import Column, ColumnChoice, chosen_columns
from mbs.identification.regressors.dynamic import Regressor, regressor_function, side_by_side
from mbs.identification.regressors.joint_columns import JointColumns
from mbs.models.symbols import ModelSymbols
from mbs.recursions.regressor_filtered import momentum_regressor, position_regressor
from mbs.recursions.velocities import Velocity


def filtered_regressor(
    system: System,
    columns: Sequence[Column] | None = None,
    *,
    coordinates: str = "independent",
    moving_base: bool = False,
    **choice: Unpack[ColumnChoice],
) -> Regressor:
    """``filtered_regressor(q, v) -> D1, D2``: joint efforts as d(D1 K)/dt + D2 K.

    D1 K is the derivative of the kinetic energy in v, D2 K that of U - E in the positions, with
    friction and offsets; in independent coordinates D1 = G' D1_tree and
    D2 = G' D2_tree - dG'/dt D1_tree. One filter over both sides makes the derivative its own. Of
    a base that moves no acceleration is needed.

    Source: Khalil & Restrepo 1996; Khalil & Creusot 1997, eq. 41-44.

    Args:
        system: open or closed; q must close the loops.
        columns: as for `regressor`.
        coordinates: of a closed system, "independent" or "tree".
        moving_base: add the inputs v_0 and R_0 of `mbs.models.inverse_dynamics`.
        choice: rotors, friction, offsets, couplings; see `columns_of`.

    Returns:
        Function of q (nq, 1), v (m, 1), v_0 and R_0; D1 and D2 (m, n) with `columns`.

    Raises:
        ModelError: as `regressor`.
    """
    taken = chosen_columns(system, columns, choice)

    def build(s: ModelSymbols) -> tuple[Named, Named]:
        tree, base, inputs = _surroundings(system, moving_base)
        joints = JointColumns.of(tree, s.poses, s.v_tree, base)
        momenta = momentum_regressor(tree, s.poses, joints.velocities)
        rests = position_regressor(tree, s.poses, joints.velocities)
        D1 = side_by_side(taken, momenta, joints.momentum)
        D2 = s.reduced_effort(side_by_side(taken, rests, joints.rest))
        if s.reduction is not None:
            D2 = D2 - casadi.mtimes(_rate(system, s, s.reduction.G).T, D1)
        return inputs, [("D1", s.reduced_effort(D1)), ("D2", D2)]

    key = ("filtered_regressor", moving_base, coordinates)
    return regressor_function(system, key, taken, build)


def _surroundings(system: System, moves: bool) -> tuple[Tree, Velocity | None, Named]:
    """The tree with gravity in the axes of its base, velocity of the base, and their inputs."""
    if not moves:
        return system.tree, None, []
    v_0, R_0 = SX.sym("v_0", 6), SX.sym("R_0", 3, 3)
    tree = Tree(system.tree.links, casadi.mtimes(R_0.T, system.tree.gravity))
    return tree, Velocity(v_0[0:3], v_0[3:6]), [("v_0", v_0), ("R_0", R_0)]


def _rate(system: System, s: ModelSymbols, G: SX) -> SX:
    """The rate of a matrix of the positions."""
    qdot = position_rate(system.tree, s.q, s.v_tree)
    return casadi.reshape(casadi.jtimes(casadi.vec(G), s.q, qdot), *G.shape)
