"""The energy identification model: one row, without accelerations."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Unpack

from mbs.assembly import System
from mbs.assembly.model_function import Named
from mbs.identification.regressors.columns import Column, ColumnChoice, chosen_columns
from mbs.identification.regressors.dynamic import Regressor, regressor_function, side_by_side
from mbs.identification.regressors.joint_columns import JointColumns
from mbs.models.symbols import ModelSymbols
from mbs.recursions.regressor_energy import inertial_energy
from mbs.spatial import zeros


def energy_regressor(
    system: System,
    columns: Sequence[Column] | None = None,
    *,
    coordinates: str = "independent",
    **choice: Unpack[ColumnChoice],
) -> Regressor:
    """``energy_regressor(q, v) -> h``: kinetic and potential energy as h K, the base at rest.

    The work of the joint efforts over an interval is the change of h K and the integral of P K,
    with P from `power_regressor`. Columns of friction and offsets are zero.

    Source: Gautier & Khalil 1988; Khalil & Creusot 1997, eq. 47-52.

    Args:
        system: open or closed; q must close the loops.
        columns: as for `regressor`.
        coordinates: of a closed system, "independent" or "tree".
        choice: rotors, friction, offsets, couplings; see `columns_of`.

    Returns:
        Function of q (nq, 1) and v (m, 1); h (1, n) with `columns`.

    Raises:
        ModelError: as `regressor`.
    """
    taken = chosen_columns(system, columns, choice)

    def build(s: ModelSymbols) -> tuple[Named, Named]:
        joints = JointColumns.of(system.tree, s.poses, s.v_tree)
        blocks = inertial_energy(system.tree, s.poses, joints.velocities)
        return [], [("h", side_by_side(taken, blocks, joints.energy))]

    return regressor_function(system, ("energy_regressor", False, coordinates), taken, build)


def power_regressor(
    system: System,
    columns: Sequence[Column] | None = None,
    *,
    coordinates: str = "independent",
    **choice: Unpack[ColumnChoice],
) -> Regressor:
    """``power_regressor(q, v) -> P``: what friction and offsets take of the power of the efforts.

    It has the columns of `energy_regressor`; those that store energy are zero. Integrate P over
    an interval for the columns of friction of the energy model.

    Args:
        system: open or closed; q must close the loops.
        columns: as for `regressor`.
        coordinates: of a closed system, "independent" or "tree".
        choice: rotors, friction, offsets, couplings; see `columns_of`.

    Returns:
        Function of q (nq, 1) and v (m, 1); P (1, n) with `columns`.

    Raises:
        ModelError: as `regressor`.
    """
    taken = chosen_columns(system, columns, choice)

    def build(s: ModelSymbols) -> tuple[Named, Named]:
        joints = JointColumns.of(system.tree, s.poses, s.v_tree)
        blocks = [zeros(1, 10) for _ in system.tree.links]
        return [], [("P", side_by_side(taken, blocks, joints.power))]

    return regressor_function(system, ("power_regressor", False, coordinates), taken, build)
