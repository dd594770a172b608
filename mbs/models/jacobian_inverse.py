"""Inverse and determinant of a square part of the Jacobian, block by block."""

from __future__ import annotations

from collections.abc import Sequence

from casadi import SX, Function

from mbs.assembly import System
from mbs.assembly.model_function import Named, model_function
from mbs.models.square_selection import selection
from mbs.solvers.block_triangular import solve_blocks


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
            singular in every posture.
    """
    chosen = selection(system, frame, rows, columns, expressed_in, coordinates)

    def build() -> tuple[Named, Named]:
        q, square = chosen.regular(system)
        return [("q", q)], [("J_inv", square.inverse())]

    return model_function(system, ("inverse_jacobian", chosen), build, chosen.check)


def inverse_kinematics(
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
    """``determinant(q) -> det``: zero in singular postures.

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
