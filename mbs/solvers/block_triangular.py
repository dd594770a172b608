"""Block triangular form of a square matrix, and solutions and determinants that use it.

Rows are matched with columns so that the diagonal has no structural zero. The strongly connected
components of the graph of the matched matrix are its diagonal blocks.

Source: Duff and Reid 1978 for the blocks; Tarjan 1972 for the strongly connected components.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi
import numpy as np
from casadi import DM, SX
from numpy.typing import NDArray

from mbs.solvers.linear import solve_square

_EXPANDED = 7
"""Largest size of a determinant that is expanded; larger ones are computed by factorisation."""


@dataclass(frozen=True, slots=True)
class Block:
    """Row and column indices of a diagonal block; both have the same number."""

    rows: tuple[int, ...]
    columns: tuple[int, ...]

    @property
    def size(self) -> int:
        """Number of rows of the block."""
        return len(self.rows)

    def of(self, A: SX) -> SX:
        """Return the block of the matrix A (n, n), dense (size, size)."""
        return casadi.densify(A[list(self.rows), list(self.columns)])


def block_triangular(pattern: NDArray[np.bool_]) -> tuple[Block, ...] | None:
    """Return the diagonal blocks of a square matrix, in an order in which they can be solved.

    Args:
        pattern: (n, n) whether an element may be non-zero.

    Returns:
        blocks; the rows of each block have entries only in its own columns and in the columns of
        previous blocks. None if every matrix with this pattern is singular.
    """
    matched = _matching(pattern)
    if matched is None:
        return None
    needs = [
        [c for c in np.flatnonzero(pattern[matched[column]]).tolist() if c != column]
        for column in range(len(pattern))
    ]
    return tuple(
        Block(tuple(sorted(matched[column] for column in part)), tuple(sorted(part)))
        for part in _strong_parts(needs)
    )


def _matching(pattern: NDArray[np.bool_]) -> list[int] | None:
    """Return for each column a row of its own in which it is non-zero, by augmenting paths.

    None if no such matching exists.
    """
    n = len(pattern)
    row_of = [-1] * n
    column_of = [-1] * n
    for start in range(n):
        if not _augment(pattern, start, row_of, column_of):
            return None
    return row_of


def _augment(
    pattern: NDArray[np.bool_], start: int, row_of: list[int], column_of: list[int]
) -> bool:
    """Match the column `start`, and rematch others if necessary; return whether that succeeds.

    `row_of` and `column_of` are the matching by column and by row (-1 if unmatched), changed in
    place. The search is breadth first, without recursion.
    """
    reached: dict[int, int] = {}
    queue = [start]
    for column in queue:
        for row in np.flatnonzero(pattern[:, column]).tolist():
            if row in reached:
                continue
            reached[row] = column
            if column_of[row] >= 0:
                queue.append(column_of[row])
                continue
            while row >= 0:
                column = reached[row]
                column_of[row] = column
                row, row_of[column] = row_of[column], row
            return True
    return False


def _strong_parts(needs: Sequence[Sequence[int]]) -> list[list[int]]:
    """Return the strongly connected components of a graph, each as a list of its nodes.

    needs[k] are the nodes that node k needs. Components come after the components that they need.
    """
    n = len(needs)
    number, low, on_stack = [-1] * n, [0] * n, [False] * n
    stack: list[int] = []
    parts: list[list[int]] = []
    counter = 0
    for root in range(n):
        work = [(root, iter(needs[root]))] if number[root] < 0 else []
        while work:
            node, edges = work[-1]
            if number[node] < 0:
                number[node] = low[node] = counter
                counter += 1
                stack.append(node)
                on_stack[node] = True
            step = next(edges, None)
            if step is None:
                work.pop()
                if work:
                    above = work[-1][0]
                    low[above] = min(low[above], low[node])
                if low[node] == number[node]:
                    cut = stack.index(node)
                    parts.append(stack[cut:])
                    for member in stack[cut:]:
                        on_stack[member] = False
                    del stack[cut:]
            elif number[step] < 0:
                work.append((step, iter(needs[step])))
            elif on_stack[step]:
                low[node] = min(low[node], number[step])
    return parts


_SMALL = 40
"""Largest number of equations for which the whole matrix is solved by CasADi's QR. QR fills the
part between blocks: twice the equations need four times the operations."""


def solve_large(A: SX, B: SX) -> SX:
    """Return the solution X (n, m) of A X = B, block by block if n is above 40.

    Args:
        A: (n, n) regular matrix.
        B: (n, m) right-hand sides.
    """
    if A.shape[0] > _SMALL:
        A = casadi.sparsify(A)
        pattern = np.zeros(A.shape, dtype=bool)
        pattern[A.sparsity().get_triplet()] = True
        blocks = block_triangular(pattern)
        if blocks is not None and len(blocks) > 1:
            return solve_blocks(A, blocks, B)
    return solve_square(A, B)


def solve_blocks(A: SX, blocks: Sequence[Block], B: SX) -> SX:
    """Return the solution X (n, m) of A X = B, block by block.

    Args:
        A: (n, n) regular matrix in block triangular form.
        blocks: blocks of A from `block_triangular`.
        B: (n, m) right-hand sides.
    """
    X = SX.zeros(*B.shape)
    for k, block in enumerate(blocks):
        rows, columns = list(block.rows), list(block.columns)
        right = B[rows, :]
        before = set(A[rows, :].sparsity().get_triplet()[1]).difference(columns)
        for known in (list(b.columns) for b in blocks[:k] if before.intersection(b.columns)):
            right = right - casadi.mtimes(casadi.densify(A[rows, known]), X[known, :])
        inverse = solve_square(block.of(A), casadi.densify(SX(DM.eye(block.size))))
        X[columns, :] = casadi.mtimes(inverse, casadi.densify(right))
    return X


def determinant(A: SX) -> SX:
    """Return the determinant of a square matrix A, without divisions up to seven rows.

    Each minor of the first k rows is formed once, from the minors of the first k - 1 rows.
    """
    n = A.shape[0]
    if n > _EXPANDED:
        return SX(casadi.det(casadi.sparsify(A)))
    minors: dict[tuple[int, ...], SX] = {(): SX(1)}
    for row in range(n):
        larger: dict[tuple[int, ...], SX] = {}
        for columns, minor in minors.items():
            for column in range(n):
                entry = A[row, column]
                if column in columns or entry.is_zero() or minor.is_zero():
                    continue
                key = tuple(sorted((*columns, column)))
                after = len(key) - 1 - key.index(column)
                term = -minor * entry if after % 2 else minor * entry
                larger[key] = larger[key] + term if key in larger else term
        minors = larger
    return minors.get(tuple(range(n)), SX(0))
