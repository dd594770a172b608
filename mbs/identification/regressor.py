"""The dynamic identification model: efforts as a matrix times the dynamic parameters."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import casadi
import numpy as np
from casadi import SX, Function
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.assembly.model_function import ModelFunction, Named, model_function
from mbs.identification.columns import INERTIAL, Column, Joints, columns_of
from mbs.identification.joint_columns import JointColumns
from mbs.models.symbols import ModelSymbols, check_coordinates, posture_check, symbols_of
from mbs.recursions.accelerations import link_accelerations, resting_base
from mbs.recursions.force_elements import element_efforts
from mbs.recursions.joint_efforts import spring_effort
from mbs.recursions.regressor import inertial_regressor
from mbs.recursions.velocities import link_velocities


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
    *,
    rotors: bool = True,
    friction: bool = True,
    offsets: bool = False,
    couplings: Sequence[Joints] = (),
    coordinates: str = "independent",
) -> Regressor:
    """``regressor(q, v, a) -> D``: joint efforts as D K, with K the dynamic parameters.

    Springs of the joints and force elements have no column; see `known_efforts`.

    Source: Khalil & Creusot 1997, eq. 39.

    Args:
        system: open or closed; q must close the loops.
        rotors: see `columns_of`.
        friction: see `columns_of`.
        offsets: see `columns_of`.
        couplings: see `columns_of`.
        coordinates: of a closed system, "independent" for D(q, v_a, a_a) with D = G' D_tree, or
            "tree".

    Returns:
        Function of q (nq, 1), v and a (m, 1); D (m, n) with `columns`.

    Raises:
        ModelError: as `columns_of`.
    """
    columns = columns_of(
        system, rotors=rotors, friction=friction, offsets=offsets, couplings=couplings
    )

    def build(s: ModelSymbols) -> tuple[Named, Named]:
        name, a = s.input("a")
        a_tree, tree = s.tree_acceleration(a), system.tree
        motions = link_accelerations(tree, s.poses, s.v_tree, a_tree, resting_base(tree.gravity))
        velocities = link_velocities(tree, s.poses, s.v_tree)
        joints = JointColumns(tree, s.poses, s.v_tree, velocities)
        D = side_by_side(
            columns,
            inertial_regressor(tree, s.poses, motions),
            lambda column: joints.effort(column, a_tree, motions),
        )
        return [(name, a)], [("D", s.reduced_effort(D))]

    return regressor_function(system, "regressor", columns, build, coordinates)


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
    name: str,
    columns: tuple[Column, ...],
    build: Callable[[ModelSymbols], tuple[Named, Named]],
    coordinates: str,
) -> Regressor:
    """The model of this name, made the first time it is asked for.

    Args:
        system: whose model it is.
        name: of the Function.
        columns: of its outputs.
        build: gives the inputs that follow q and v, and the outputs.
        coordinates: of a closed system, "independent" or "tree".
    """
    check_coordinates(system, coordinates)

    def both() -> tuple[Named, Named]:
        s = symbols_of(system, coordinates)
        inputs, outputs = build(s)
        return [("q", s.q), ("v" + s.suffix, s.v), *inputs], outputs

    check = posture_check(system, coordinates)
    model: Any = model_function(system, (name, columns, coordinates), both, check)
    return Regressor(model, columns)


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
