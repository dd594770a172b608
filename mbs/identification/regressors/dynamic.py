"""The dynamic identification model: efforts as a matrix times the dynamic parameters."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Unpack

import casadi
import numpy as np
from casadi import SX, Function
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.assembly.model_function import ModelFunction, Named, model_function
from mbs.identification.regressors.columns import INERTIAL, Column, ColumnChoice, chosen_columns
from mbs.identification.regressors.joint_columns import JointColumns
from mbs.models.surroundings import surroundings
from mbs.models.symbols import ModelSymbols, check_coordinates, posture_check, symbols_of
from mbs.recursions.accelerations import link_accelerations
from mbs.recursions.force_elements import element_efforts
from mbs.recursions.joint_efforts import spring_effort
from mbs.recursions.regressor import inertial_regressor


class Regressor(ModelFunction):
    """A model whose outputs have a column for each parameter in which the equations are linear.

    Attributes:
        columns: the parameters, in the order of the columns of every output.
    """

    def __init__(self, model: ModelFunction, columns: tuple[Column, ...]) -> None:
        ModelFunction.__init__(self, model, model.system, model._annotate, model._check_posture)
        self.columns = columns

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return tuple(column.name for column in self.columns)

    @property
    def effective(self) -> NDArray[np.bool_]:
        """(n,) whether a column has an element that is not zero by structure."""
        found = np.zeros(len(self.columns), dtype=bool)
        for output in self._outputs():
            pattern = casadi.sparsify(output).sparsity()
            found[np.unique(pattern.get_triplet()[1])] = True
        return found

    def elements(self, name: str) -> list[tuple[str, str]]:
        """Name and unit of every element of an input, or of every column of an output."""
        if name in self.name_out():
            return [(column.name, column.unit) for column in self.columns]
        return ModelFunction.elements(self, name)

    def like(self, function: Function) -> ModelFunction:
        """Another Function with the inputs of this one and, where they are as many, its columns."""
        same = function.size_out(0) == self.size_out(0)
        plain = ModelFunction(function, self.system, None, self._check_posture)
        return Regressor(plain, self.columns) if same else ModelFunction.like(self, function)

    def _outputs(self) -> list[SX]:
        inputs = [SX.sym(name, self.sparsity_in(name)) for name in self.name_in()]
        return list(Function.call(self, inputs, True, False))


def regressor(
    system: System,
    columns: Sequence[Column] | None = None,
    *,
    coordinates: str = "independent",
    moving_base: bool = False,
    **choice: Unpack[ColumnChoice],
) -> Regressor:
    """``regressor(q, v, a) -> D``: joint efforts as D K, with K the dynamic parameters.

    Springs of the joints and force elements have no column; see `known_efforts`. A base that
    floats is a free joint, with six rows of its own.

    Source: Khalil & Creusot 1997, eq. 39.

    Args:
        system: open or closed; q must close the loops.
        columns: the parameters, such as `BaseParameters.columns_in_base`; left out, those of
            `columns_of`.
        coordinates: of a closed system, "independent" for D(q, v_a, a_a) with D = G' D_tree, or
            "tree".
        moving_base: add the inputs v_0, a_0 and R_0 of `mbs.models.inverse_dynamics`.
        choice: rotors, friction, offsets, couplings; see `columns_of`.

    Returns:
        Function of q (nq, 1), v and a (m, 1), v_0, a_0, R_0; D (m, n) with `columns`.

    Raises:
        ModelError: as `columns_of`, or a column is no parameter of the system.
    """
    taken = chosen_columns(system, columns, choice)

    def build(s: ModelSymbols) -> tuple[Named, Named]:
        name, a = s.input("a")
        a_tree, tree = s.tree_acceleration(a), system.tree
        around = surroundings(system, moves=moving_base)
        motions = link_accelerations(tree, s.poses, s.v_tree, a_tree, around.base)
        joints = JointColumns.of(tree, s.poses, s.v_tree)
        D = side_by_side(
            taken,
            inertial_regressor(tree, s.poses, motions),
            lambda column: joints.effort(column, a_tree, motions, around.base),
        )
        return [(name, a), *around.inputs], [("D", s.reduced_effort(D))]

    key = ("regressor", moving_base, coordinates)
    return regressor_function(system, key, taken, build)


def known_efforts(system: System, coordinates: str = "independent") -> Function:
    """``known_efforts(q, v) -> tau``: what springs, stops and force elements ask of the joints.

    It is what the efforts of `mbs.models.inverse_dynamics` have beside D K.

    Args:
        system: open or closed; q must close the loops.
        coordinates: as for `regressor`.

    Returns:
        Function of q (nq, 1) and v (m, 1); tau (m, 1) [N m or N].
    """

    def build() -> tuple[Named, Named]:
        s = symbols_of(system, coordinates)
        acting = element_efforts(system.tree, system.forces, s.poses, s.q, s.v_tree)
        tau = s.reduced_effort(acting + spring_effort(system.tree, s.q))
        return [("q", s.q), ("v" + s.suffix, s.v)], [("tau" + s.suffix, tau)]

    check = posture_check(system, coordinates)
    return model_function(system, ("known_efforts", coordinates), build, check)


def regressor_function(
    system: System,
    key: tuple[str, bool, str],
    columns: tuple[Column, ...],
    build: Callable[[ModelSymbols], tuple[Named, Named]],
) -> Regressor:
    """The model with these columns, made the first time it is asked for.

    Args:
        system: whose model it is.
        key: name of the Function, whether the base moves, and the coordinates, of a closed
            system "independent" or "tree".
        columns: of its outputs.
        build: gives the inputs that follow q and v, and the outputs.
    """
    coordinates = key[-1]
    check_coordinates(system, coordinates)

    def both() -> tuple[Named, Named]:
        s = symbols_of(system, coordinates)
        inputs, outputs = build(s)
        return [("q", s.q), ("v" + s.suffix, s.v), *inputs], outputs

    def make() -> Regressor:
        check = posture_check(system, coordinates)
        model: Any = model_function(system, (*key, columns), both, check)
        return Regressor(model, columns)

    made: Regressor = system.cached(("with columns", *key, columns), make)
    return made


def side_by_side(
    columns: tuple[Column, ...], blocks: list[SX], other: Callable[[Column], SX]
) -> SX:
    """The columns of a matrix: of inertial parameters from the blocks of the links."""
    picked = (
        blocks[column.link - 1][:, INERTIAL.index(column.kind)]
        if column.kind in INERTIAL
        else other(column)
        for column in columns
    )
    return casadi.horzcat(*picked)
