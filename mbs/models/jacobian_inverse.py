"""Inverse and determinant of a square part of the Jacobian, block by block."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from casadi import SX, Function

from mbs.assembly import System
from mbs.assembly.model_function import ConfigurationCheck, Named, model_function, require_system
from mbs.errors import ModelError
from mbs.loops.balance import require_no_drift
from mbs.loops.examine import DETERMINED
from mbs.loops.reduction import reduction
from mbs.models.symbols import check_coordinates, is_reduced
from mbs.recursions.jacobian import VelocityTarget
from mbs.recursions.square_jacobian import SquareJacobian, square_jacobian
from mbs.solvers.block_triangular import solve_blocks
from mbs.text import did_you_mean, quoted

# The square part of a Jacobian that a user names by rows and columns.


_ROWS = ("Vx", "Vy", "Vz", "wx", "wy", "wz")


@dataclass(frozen=True, slots=True)
class Selection:
    """Rows of [V; w] and as many columns of a frame's Jacobian.

    Attributes:
        frame: that moves.
        expressed_in: in whose axes V and w are.
        rows: numbers 0 to 5.
        columns: numbers of velocities, in the input coordinates.
        reduced: whether they are the independent velocities of a closed system.
        names: of these velocities.
    """

    frame: str | int
    expressed_in: str | int
    rows: tuple[int, ...]
    columns: tuple[int, ...]
    reduced: bool
    names: tuple[str, ...]

    @property
    def check(self) -> ConfigurationCheck | None:
        """What refuses the configurations that functions of the matrix cannot take."""
        return DETERMINED if self.reduced else None

    def of(self, system: System) -> tuple[SX, SquareJacobian]:
        """Symbols q, (nq, 1), and the matrix at them in blocks; formed once."""
        found: tuple[SX, SquareJacobian] = system.cached(
            ("square_jacobian", self), lambda: self._form(system)
        )
        return found

    def _form(self, system: System) -> tuple[SX, SquareJacobian]:
        q = SX.sym("q", system.nq)
        frame, axes = system.frame(self.frame), system.frame(self.expressed_in)
        target = VelocityTarget(system.tree, q, system.p, frame, axes)
        if self.reduced:
            path = system.tree.path(frame[0])
            require_no_drift(system, "a Jacobian", [system.tree.links[k].v.start for k in path])
        G = reduction(system, q).G if self.reduced else None
        return q, square_jacobian(target, self.rows, self.columns, G)

    def regular(self, system: System) -> tuple[SX, SquareJacobian]:
        """The same of a matrix that has an inverse.

        Raises:
            ModelError: it is singular in every configuration.
        """
        q, square = self.of(system)
        if square.blocks is None:
            raise ModelError(
                f"{system.name}: rows {', '.join(map(str, self.rows))} and columns"
                f" {', '.join(self.names)} of the Jacobian of {quoted(self.frame)} are singular in"
                " every configuration; name other rows or columns"
            )
        return q, square

    def determinant(self, system: System) -> Function:
        """``determinant(q) -> det``."""

        def build() -> tuple[Named, Named]:
            q, square = self.of(system)
            return [("q", q)], [("det", square.determinant())]

        return model_function(system, ("determinant", self), build, self.check)


def selection(
    system: System,
    frame: str | int,
    rows: Sequence[int | str] | None,
    columns: Sequence[int | str] | None,
    expressed_in: str | int,
    coordinates: str,
) -> Selection:
    """What was named, checked; all rows, and the velocities that move the frame, when left out.

    Raises:
        ModelError: a row or column does not exist or comes twice, or there are not as many rows
            as columns.
    """
    require_system(system)
    check_coordinates(system, coordinates)
    link, _ = system.frame(frame)
    system.frame(expressed_in)
    reduced = is_reduced(system, coordinates)
    speeds = system.active if reduced else range(system.nv)
    names = [system.speeds[k].name for k in speeds]
    if columns is None:
        moving = [system.tree.links[k].v for k in system.tree.path(link)]
        columns = [k for part in moving for k in range(part.start, part.stop)]
        columns = list(range(len(names))) if reduced else columns
    kept = _numbers(system, "row", range(6) if rows is None else rows, _ROWS)
    chosen = _numbers(system, "column", columns, names)
    if len(kept) != len(chosen):
        raise ModelError(
            f"{system.name}: the selection of the Jacobian of {quoted(frame)} has {len(kept)} rows"
            f" and {len(chosen)} columns; name as many rows=[...] of 0 to 5 (Vx, Vy, Vz, wx, wy,"
            f" wz) as columns=[...] of {', '.join(names) or '(none)'}"
        )
    if not kept:
        raise ModelError(f"{system.name}: no rows were named; give at least one of 0 to 5")
    return Selection(
        frame, expressed_in, kept, chosen, reduced, tuple(names[column] for column in chosen)
    )


def _numbers(
    system: System, what: str, given: Iterable[Any], names: Sequence[str]
) -> tuple[int, ...]:
    numbers: list[int] = []
    if isinstance(given, str) or not isinstance(given, Iterable):
        given = [given]
    for value in given:
        if isinstance(value, str):
            if value not in names:
                raise ModelError(
                    f"{system.name}: there is no {what} {value!r}; " + did_you_mean(value, names)
                )
            value = names.index(value)
        if not _is_number(value, len(names)):
            raise ModelError(
                f"{system.name}: there is no {what} {quoted(value)}; {what}s are numbers 0 to"
                f" {len(names) - 1} or names: {', '.join(names)}"
            )
        if value in numbers:
            raise ModelError(f"{system.name}: {what} {names[value]} was named twice; name it once")
        numbers.append(int(value))
    return tuple(numbers)


def _is_number(value: object, size: int) -> bool:
    return hasattr(value, "__index__") and not isinstance(value, bool) and value in range(size)


def inverse_jacobian(
    system: System,
    frame: str | int,
    rows: Sequence[int | str] | None = None,
    columns: Sequence[int | str] | None = None,
    *,
    expressed_in: str | int = "base",
    coordinates: str = "independent",
) -> Function:
    """``inverse_jacobian(q) -> J_inv``: joint velocities that give a frame a velocity.

    The inverse of the rows and columns that are named. It is formed from the blocks that
    remain in the best axes and about the best reference point, such as the centre of a wrist.

    Source: Khalil & Creusot 1997, section 4.6.

    Args:
        system: open or closed; q must close the loops.
        frame: a body, a named frame, or the number of a link.
        rows: of [V; w], numbers 0 to 5 or "Vx" to "wz"; all six when left out.
        columns: numbers (from 0) or names of velocities, as many; those that move the frame when
            left out.
        expressed_in: the frame in whose axes V and w are.
        coordinates: of a closed system, "independent" or "tree".

    Returns:
        Function of q (nq, 1); J_inv (m, m): velocities of the columns for those of the rows.

    Raises:
        ModelError: no such frame, row or column, not as many rows as columns, or the matrix is
            singular in every configuration.
    """
    chosen = selection(system, frame, rows, columns, expressed_in, coordinates)

    def build() -> tuple[Named, Named]:
        q, square = chosen.regular(system)
        return [("q", q)], [("J_inv", square.inverse())]

    return model_function(system, ("inverse_jacobian", chosen), build, chosen.check)


def inverse_differential_kinematics(
    system: System,
    frame: str | int,
    rows: Sequence[int | str] | None = None,
    columns: Sequence[int | str] | None = None,
    *,
    expressed_in: str | int = "base",
    coordinates: str = "independent",
) -> Function:
    """``ikm(q, twist) -> v_of_columns``: the same velocities, without forming the inverse.

    Source: Khalil & Creusot 1997, section 4.6.

    Args:
        system: as for `inverse_jacobian`, and so are the others.
        frame: likewise.
        rows: likewise.
        columns: likewise.
        expressed_in: likewise.
        coordinates: likewise.

    Returns:
        Function of q (nq, 1) and twist (m, 1), the named rows of [V; w] [m/s, rad/s];
        v_of_columns (m, 1), the named joint velocities.

    Raises:
        ModelError: as for `inverse_jacobian`.
    """
    chosen = selection(system, frame, rows, columns, expressed_in, coordinates)

    def build() -> tuple[Named, Named]:
        q, square = chosen.regular(system)
        twist = SX.sym("twist", len(chosen.rows))
        assert square.blocks is not None
        v = solve_blocks(square.B, square.blocks, square.seen(twist))
        return [("q", q), ("twist", twist)], [("v_of_columns", v)]

    return model_function(system, ("ikm", chosen), build, chosen.check)


def jacobian_determinant(
    system: System,
    frame: str | int,
    rows: Sequence[int | str] | None = None,
    columns: Sequence[int | str] | None = None,
    *,
    expressed_in: str | int = "base",
    coordinates: str = "independent",
) -> Function:
    """``determinant(q) -> det``: zero in singular configurations.

    The product of the determinants of the blocks of `inverse_jacobian`; `singularities` gives
    its factors one by one.

    Source: Khalil & Creusot 1997, section 4.6.

    Args:
        system: as for `inverse_jacobian`, and so are the others.
        frame: likewise.
        rows: likewise.
        columns: likewise.
        expressed_in: likewise.
        coordinates: likewise.

    Returns:
        Function of q (nq, 1); det (1, 1).

    Raises:
        ModelError: no such frame, row or column, or not as many rows as columns.
    """
    chosen = selection(system, frame, rows, columns, expressed_in, coordinates)
    return chosen.determinant(system)
