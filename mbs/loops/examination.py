"""Check of a configuration: closure of the loops, and distance from a singular configuration."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import casadi
import numpy as np
from casadi import DM, SX, Function
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.assembly.model_function import ConfigurationCheck, require_system
from mbs.assembly.validity import ValidityRow
from mbs.errors import ModelError, SingularPosture, Unclosable
from mbs.loops.closing import OPEN, closure_parameters, row_sizes
from mbs.loops.closure_equations import closure_rows
from mbs.loops.velocity import (
    constraint_jacobian,
    determining_rows,
    independent_constraint_rows,
    kept_rows,
    scales,
)
from mbs.solvers.rank import rank

Vector = NDArray[np.float64]

_DETERMINED = 1e-14
"""Squared sine between rows of the passive joints below which the independent joints no longer
determine the passive ones."""
LEAST_SINE = 2.5e-5
"""Squared sine that second derivatives need. They multiply the rounding of a closed configuration
by the third power of the inverse sine and by squared speeds: 1e-16 becomes 1e-8 at a sine of 5e-3
and speeds of one. `mbs.loops.accuracy` checks the accuracy at large speeds."""


@dataclass(frozen=True, slots=True)
class ConfigurationReport:
    """Closure and singularity of a configuration of a system with loops.

    Attributes:
        residual: largest absolute closure row [m or 1].
        opening: largest absolute closure row, with lengths divided by the size of the mechanism.
        mobility: number of independent velocities at this configuration.
        generic: number of independent velocities at configurations that are not singular.
        leads: measure from 0 to 1 of how well the independent joints determine the passive ones:
            smallest squared sine between a row of the passive joints and the rows before it.
    """

    residual: float
    opening: float
    mobility: int
    generic: int
    leads: float

    @property
    def is_closed(self) -> bool:
        """Whether the loops are closed."""
        return self.opening <= OPEN

    @property
    def is_singular(self) -> bool:
        """Whether the mobility is larger here than in general, as where two branches meet."""
        return self.mobility > self.generic

    @property
    def is_led(self) -> bool:
        """Whether the independent joints determine the motion of the passive joints."""
        return self.leads > _DETERMINED


def configuration_report(
    system: System, q: Sequence[float], *, parameters: Mapping[str, float] | None = None
) -> ConfigurationReport:
    """Return the closure error of a configuration, its mobility and its distance from singularity.

    Args:
        system: mechanism with closed loops.
        q: (nq,) positions [rad or m].
        parameters: values of symbols by name. Missing symbols have their default values.

    Raises:
        ModelError: the system is an open chain, or q has a wrong size.
    """
    require_system(system)
    if system.closure is None:
        raise ModelError(f"{system.name}: an open chain has no loops that could be examined")
    position = np.array(system.position(q))
    p = closure_parameters(system, parameters)
    residual, leads, opening = (float(x) for x in configuration_health(system)(position, p))
    found = scales(system)
    J = np.array(constraint_jacobian(system)(position, p)) * found.rows.reshape(-1, 1)
    J *= found.columns([speed.unit for speed in system.velocity_coordinates])
    return ConfigurationReport(
        residual, opening, system.nv - rank(J), system.closure.mobility, leads
    )


def require_determined(system: System, q: Vector, p: Vector, least: float = _DETERMINED) -> None:
    """Raise if a model in independent joints is undefined or inaccurate at a configuration.

    Args:
        system: mechanism with closed loops.
        q: (nq,) positions.
        p: (np,) parameters.
        least: smallest squared sine between rows of the passive joints that the model accepts.

    Raises:
        Unclosable: the configuration leaves the loops open.
        SingularPosture: the independent joints do not determine the motion of the other joints, or
            not accurately enough for the model.
    """
    residual, leads, opening = (float(x) for x in configuration_health(system)(q, p))
    if opening > OPEN:
        raise Unclosable(
            f"{system.name}: q leaves the loops open by {residual:.3g}; take a configuration of"
            " mbs.loops.solve"
        )
    if leads > least:
        return
    names = ", ".join(system.velocity_coordinates[k].name for k in system.independent)
    if leads > _DETERMINED:
        raise SingularPosture(
            f"{system.name}: the configuration is so near a singular one that second derivatives"
            f" of the loops have no accuracy with {names} as independent joints (sine"
            f" {leads**0.5:.2g}, {least**0.5:.2g} is needed); take another configuration, or other"
            " independent joints (assemble(active=...))"
        )
    raise SingularPosture(
        f"{system.name}: the configuration is singular, {names} cannot lead the other joints"
        " there;"
        " take another configuration, other independent joints (assemble(active=...)), or"
        ' coordinates="tree"'
    )


def loop_rows(system: System, q: SX, least: float = _DETERMINED) -> list[ValidityRow]:
    """Return validity conditions of models in independent joints: loops closed, joints determined.

    Args:
        system: mechanism with closed loops.
        q: (nq, 1) positions.
        least: smallest squared sine between rows of the passive joints that the model accepts.
    """
    _, leads, opening = configuration_health(system)(q, system.p)
    return [
        ValidityRow("open", "opening of the loops", opening, OPEN, "the loops are open"),
        ValidityRow(
            "undetermined",
            "hold of the independent joints, negative",
            -leads,
            -least,
            "the independent joints do not determine the others",
        ),
    ]


DETERMINED = ConfigurationCheck(loop_rows, require_determined)
"""Check that the loops are closed and that the independent joints determine the other joints."""


def configuration_health(system: System) -> Function:
    """Return ``health(q, p) -> residual, leads, opening`` of `ConfigurationReport`.

    Args:
        system: mechanism with closed loops.
    """

    def build() -> Function:
        q = SX.sym("q", system.nq)
        assert system.closure is not None
        rows = closure_rows(system, q)
        residual, opening = (
            casadi.mmax(casadi.fabs(casadi.vertcat(0, own)))
            for own in (rows, rows / row_sizes(system))
        )
        varies, passive = system.closure.varies, list(system.closure.passive)
        J_p = _scale(system, determining_rows(system, q).J)[:, passive]
        leads = _independence(J_p.T if varies else J_p)
        return Function("health", [q, system.p], [residual, leads, opening], {"cse": True})

    function: Function = system.cached("configuration health", build)
    return function


def row_independence(system: System) -> Function:
    """Return ``independence(q, p)``: independence of the kept rows, from 0 (dependent) to 1.

    Args:
        system: mechanism with closed loops.

    Returns:
        Function of q (nq, 1) and p (np, 1). Its value is the smallest squared sine between a row
        and the rows before it, with the columns of
    passive and active joints.
    """

    def build() -> Function:
        q = SX.sym("q", system.nq)
        value = _independence(_scale(system, independent_constraint_rows(system, q)))
        return Function("independence", [q, system.p], [value], {"cse": True})

    function: Function = system.cached("row independence", build)
    return function


def _scale(system: System, J: SX) -> SX:
    """Return a constraint Jacobian J with row and column factors that remove the units.

    J has either all rows of the system, or only its independent rows.
    """
    found, kept = scales(system), kept_rows(system)
    rows = found.rows[kept] if J.shape[0] == len(kept) else found.rows
    columns = DM(found.columns([speed.unit for speed in system.velocity_coordinates]))
    return J * DM(rows) * casadi.repmat(columns.T, J.shape[0], 1)


def _independence(J: SX) -> SX:
    """Return the smallest squared sine of the angle between a row of J and the rows before it.

    A row with a norm below 1 counts with norm 1, so that a vanishing row also gives zero.
    """
    if J.shape[0] == 0:
        return SX(1)
    squares = casadi.fmax(casadi.sum2(J * J), 1)
    D, _, order = casadi.ldl(casadi.sparsify(casadi.mtimes(J, J.T)))
    return casadi.mmin(D / squares[order])
