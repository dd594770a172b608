"""Inverse and determinant of a square submatrix of the Jacobian, in block triangular form."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from casadi import SX, Function

from mbs.assembly import System
from mbs.assembly.model_function import ConfigurationCheck, Named, model_function, require_system
from mbs.errors import ModelError
from mbs.loops.balance import require_no_drift
from mbs.loops.examination import DETERMINED
from mbs.loops.reduction import reduction
from mbs.models.symbols import check_coordinates, is_reduced
from mbs.recursions.jacobian import VelocityTarget
from mbs.recursions.square_jacobian import SquareJacobian, square_jacobian
from mbs.solvers.block_triangular import solve_blocks
from mbs.text import did_you_mean, quoted

# Square submatrix of a Jacobian that a user selects by rows and columns.


_ROWS = ("Vx", "Vy", "Vz", "wx", "wy", "wz")


@dataclass(frozen=True, slots=True)
class Selection:
    """Square submatrix of the Jacobian of a frame: rows of [V; w] and as many columns.

    Attributes:
        frame: frame that moves.
        expressed_in: frame whose axes V and w are expressed in.
        rows: indices 0 to 5 into [V; w].
        columns: indices of the selected velocities among the input velocities.
        reduced: whether the input velocities are the independent ones of a closed system.
        names: names of the selected velocities.
    """

    frame: str | int
    expressed_in: str | int
    rows: tuple[int, ...]
    columns: tuple[int, ...]
    reduced: bool
    names: tuple[str, ...]

    @property
    def check(self) -> ConfigurationCheck | None:
        """Check that rejects configurations at which the reduced Jacobian is undefined."""
        return DETERMINED if self.reduced else None

    def of(self, system: System) -> tuple[SX, SquareJacobian]:
        """Return symbols q (nq, 1) and the matrix at q in block triangular form (cached).

        Args:
            system: open or closed mechanism.
        """
        found: tuple[SX, SquareJacobian] = system.cached(
            ("square_jacobian", self), lambda: self._form(system)
        )
        return found

    def _form(self, system: System) -> tuple[SX, SquareJacobian]:
        """Return the symbols q and the selected square Jacobian in block triangular form."""
        q = SX.sym("q", system.nq)
        frame, axes = system.frame(self.frame), system.frame(self.expressed_in)
        target = VelocityTarget(system.tree, q, system.p, frame, axes)
        if self.reduced:
            path = system.tree.path(frame[0])
            require_no_drift(system, "a Jacobian", [system.tree.links[k].v.start for k in path])
        G = reduction(system, q).G if self.reduced else None
        return q, square_jacobian(target, self.rows, self.columns, G)

    def regular(self, system: System) -> tuple[SX, SquareJacobian]:
        """Return symbols q (nq, 1) and the matrix at q, which must be invertible.

        It is in block triangular form.

        Args:
            system: open or closed mechanism.

        Raises:
            ModelError: the matrix is singular in every configuration.
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
        """Return the Function ``determinant(q) -> det`` of the selected submatrix.

        Args:
            system: open or closed mechanism.
        """

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
    """Return the square submatrix that a user selects, after checking the arguments.

    Args:
        system: open or closed mechanism.
        frame: name of a body or frame, or index of a link.
        rows: rows of [V; w], indices 0 to 5 or names "Vx" to "wz"; None for all.
        columns: velocities by 0-based index or name; None for those that move the frame.
        expressed_in: frame whose axes V and w are expressed in.
        coordinates: velocities of a closed system, "independent" or "tree".

    Raises:
        ModelError: a row or column does not exist or is repeated, or the numbers of rows and
            columns differ.
    """
    require_system(system)
    check_coordinates(system, coordinates)
    link, _ = system.frame(frame)
    system.frame(expressed_in)
    reduced = is_reduced(system, coordinates)
    speeds = system.independent if reduced else range(system.nv)
    names = [system.velocity_coordinates[k].name for k in speeds]
    if columns is None:
        moving = [system.tree.links[k].v for k in system.tree.path(link)]
        columns = [k for part in moving for k in range(part.start, part.stop)]
        columns = list(range(len(names))) if reduced else columns
    kept = _given_indices(system, "row", range(6) if rows is None else rows, _ROWS)
    chosen = _given_indices(system, "column", columns, names)
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


def _given_indices(
    system: System, what: str, given: Iterable[Any], names: Sequence[str]
) -> tuple[int, ...]:
    """Return the indices of rows or columns given by name or index.

    `what` is "row" or "column", and `names` are the valid names. Raise ModelError if an element
    does not exist or is repeated.
    """
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
    """Return whether a value is an integer index from 0 to size - 1."""
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
    """Return the inverse of a square submatrix of the Jacobian: ``inverse_jacobian(q) -> J_inv``.

    J_inv maps the selected rows of a frame velocity to the selected joint velocities. The axes and
    the reference point, such as the centre of a wrist, are chosen so that small blocks remain.

    Source: Khalil & Creusot 1997, section 4.6.

    Args:
        system: open or closed mechanism; q must close the loops.
        frame: name of a body or frame, or index of a link.
        rows: rows of [V; w], indices 0 to 5 or names "Vx" to "wz"; all six by default.
        columns: velocities, as many as rows, by 0-based index or name; by default the velocities
            that move the frame.
        expressed_in: frame whose axes V and w are expressed in.
        coordinates: velocities of a closed system, "independent" or "tree".

    Returns:
        Function of q (nq, 1); J_inv (m, m) with one row per selected velocity.

    Raises:
        ModelError: the frame, a row or a column is unknown, the numbers of rows and columns differ,
            or the matrix is singular in every configuration.
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
    """Return the joint velocities of a frame velocity: ``ikm(q, twist) -> v_of_columns``.

    Solves with the matrix that `inverse_jacobian` inverts, without forming the inverse.

    Source: Khalil & Creusot 1997, section 4.6.

    Args:
        system: open or closed mechanism; q must close the loops.
        frame: name of a body or frame, or index of a link.
        rows: rows of [V; w], as for `inverse_jacobian`.
        columns: velocities, as for `inverse_jacobian`.
        expressed_in: frame whose axes V and w are expressed in.
        coordinates: velocities of a closed system, "independent" or "tree".

    Returns:
        Function of q (nq, 1) and twist (m, 1), the selected rows of [V; w] [m/s, rad/s];
        v_of_columns (m, 1), the selected joint velocities.

    Raises:
        ModelError: same conditions as for `inverse_jacobian`.
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
    """Return the determinant of a square submatrix of the Jacobian: ``determinant(q) -> det``.

    It is zero in singular configurations. It is the product of the determinants of the blocks of
    `inverse_jacobian`; `singularities` returns the single factors.

    Source: Khalil & Creusot 1997, section 4.6.

    Args:
        system: open or closed mechanism; q must close the loops.
        frame: name of a body or frame, or index of a link.
        rows: rows of [V; w], as for `inverse_jacobian`.
        columns: velocities, as for `inverse_jacobian`.
        expressed_in: frame whose axes V and w are expressed in.
        coordinates: velocities of a closed system, "independent" or "tree".

    Returns:
        Function of q (nq, 1); det (1, 1).

    Raises:
        ModelError: the frame, a row or a column is unknown, or the numbers of rows and columns
            differ.
    """
    chosen = selection(system, frame, rows, columns, expressed_in, coordinates)
    return chosen.determinant(system)
