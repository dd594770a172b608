"""A square part of a Jacobian, brought to triangular blocks.

Linear and angular velocity are taken in the axes of whichever links, and of whichever reference
point, leave the smallest blocks: with the reference in the centre of a spherical wrist the wrist
separates from the arm.

Source: Renaud 1980; Khalil & Creusot 1997, section 4.6.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import casadi
import numpy as np
from casadi import SX, Function
from numpy.typing import NDArray

from mbs.assembly.tree import Tree
from mbs.recursions.jacobian import (
    Array,
    Survey,
    VelocityTarget,
    arm_from,
    cheapest_jacobian,
    nonzero,
    random_samples,
    spread,
    survey,
    varying,
)
from mbs.recursions.route import relative_pose
from mbs.solvers.block_triangular import Block, block_triangular, determinant, solve_blocks
from mbs.spatial import skew

_SINGULAR = 1e-9
"""Part of the largest singular value that counts as zero: rounding leaves 1e-15, and at random
positions a matrix that is not always singular is far from it."""


@dataclass(frozen=True, slots=True, eq=False)
class SquareJacobian:
    """A square matrix as X B, X orthogonal but for a shear.

    Attributes:
        B: (m, m), with exact zeros beside its blocks.
        blocks: in the order in which equations can be solved; None when it is always singular.
        X_inverse: (m, m).
        sign: 1 or -1, so that the determinant is the sign times those of the blocks.
    """

    B: SX
    blocks: tuple[Block, ...] | None
    X_inverse: SX
    sign: int

    def inverse(self) -> SX:
        """(m, m) inverse of the matrix, block after block."""
        assert self.blocks is not None
        return solve_blocks(self.B, self.blocks, self.X_inverse)

    def seen(self, twist: SX) -> SX:
        """(m, 1) a right-hand side as the blocks need it."""
        return casadi.densify(casadi.mtimes(self.X_inverse, twist))

    def determinants(self) -> list[SX]:
        """The determinants of the blocks; a zero when the matrix is always singular."""
        if self.blocks is None:
            return [SX(0)]
        return [determinant(block.of(self.B)) for block in self.blocks]

    def determinant(self) -> SX:
        """The determinant of the matrix."""
        product = SX(self.sign)
        for factor in self.determinants():
            product = product * factor
        return product


@dataclass(frozen=True, slots=True, eq=False)
class _View:
    """Axes and reference for a selection, as places in a survey; rows of [V; w] that take part."""

    linear: int
    angular: int
    reference: int | None
    V_rows: tuple[int, ...]
    w_rows: tuple[int, ...]
    B: Array
    blocks: tuple[Block, ...] | None

    def rank(self, size: int) -> tuple[float, ...]:
        """Smaller is better: work on blocks, entries that vary, distance from the middle."""
        if self.blocks is None:
            return (0.0,)
        changes = varying(self.B)
        inside = sum(int(changes[np.ix_(b.rows, b.columns)].sum()) for b in self.blocks)
        middle = abs(self.linear - size / 2) + abs(self.angular - size / 2)
        work = sum(block.size**3 for block in self.blocks)
        return work, inside, int(changes.sum()), int(nonzero(self.B).sum()), middle


def square_jacobian(
    target: VelocityTarget, rows: Sequence[int], columns: Sequence[int], G: SX | None = None
) -> SquareJacobian:
    """Rows and columns of the Jacobian of a tree, in blocks.

    Args:
        target: the frame that moves, and the axes.
        rows: of [V; w], 0 to 5.
        columns: of v, as many.
        G: (nv, m) when the columns are those of J G instead.
    """
    tree, q = target.tree, target.q
    found = survey(target)
    if G is None:
        places = _places(tree, found, columns)
    else:
        found = found.combine(_values(target, G))
        places = [*spread(found.on_path), len(found.frames) - 1]
    size = len(found.frames)
    views = _views(found, places, rows, columns)
    view = min(views, key=lambda v: v.rank(size))
    i, j = found.frames[view.linear], found.frames[view.angular]
    r = None if view.reference is None else found.frames[view.reference][0]
    V = cheapest_jacobian(target.along(i), r)[list(view.V_rows), :]
    w = cheapest_jacobian(target.along(j))[[3 + k for k in view.w_rows], :]
    J = casadi.vertcat(V, w)
    J = J if G is None else casadi.mtimes(J, G)
    X_inverse = _back(
        rows,
        relative_pose(tree, q, i, target.axes).R[list(view.V_rows), :],
        relative_pose(tree, q, j, target.axes).R[list(view.w_rows), :],
        arm_from(target, r),
    )
    asked = np.concatenate([found.linear(-1, None), found.angular(-1)], axis=1)
    whole = asked[:, rows][:, :, columns]
    B = _with_zeros(J[:, list(columns)], nonzero(view.B))
    return _sign(B, view.B, view.blocks, X_inverse, whole)


def _values(target: VelocityTarget, A: SX) -> Array:
    """(samples, ...) a matrix at the configurations of a survey."""
    f = Function("f", [target.q, target.p], [casadi.densify(A)])
    samples = random_samples(target.tree, target.p.numel())
    return np.array([np.array(f(*sample)) for sample in samples])


def _places(tree: Tree, found: Survey, columns: Sequence[int]) -> list[int]:
    """The base, the links of these columns, and the axes that were asked for."""
    kept = []
    for place in found.on_path:
        link, _ = found.frames[place]
        v = tree.links[link].v if link >= 0 else slice(0, 0)
        if link < 0 or any(v.start <= column < v.stop for column in columns):
            kept.append(place)
    return [*kept, len(found.frames) - 1]


def _back(rows: Sequence[int], R_V: SX, R_w: SX, arm: SX) -> SX:
    """From rows of [V; w] as they were asked for to those of a view: X^-1.

    Args:
        rows: that were asked for.
        R_V: rows of the orientation of the target axes in the linear axes.
        R_w: likewise in the angular axes.
        arm: (3, 1) from the reference to the frame's origin, in the target axes.
    """
    V_rows, w_rows = [k for k in rows if k < 3], [k - 3 for k in rows if k >= 3]
    Q_V, Q_w = R_V[:, V_rows], R_w[:, w_rows]
    shear = casadi.mtimes(Q_V, casadi.densify(skew(arm))[V_rows, w_rows])
    below = SX.zeros(Q_w.shape[0], Q_V.shape[1])
    back = casadi.vertcat(casadi.horzcat(Q_V, shear), casadi.horzcat(below, Q_w))
    grouped = [k for k in rows if k < 3] + [k for k in rows if k >= 3]
    return casadi.densify(back)[:, [grouped.index(k) for k in rows]]


def _sign(
    B: SX, values: Array, blocks: tuple[Block, ...] | None, X_inverse: SX, whole: Array
) -> SquareJacobian:
    if blocks is None or _always_singular(values):
        return SquareJacobian(B, None, X_inverse, 1)
    parts = [np.linalg.det(values[0][np.ix_(block.rows, block.columns)]) for block in blocks]
    sign = np.sign(np.linalg.det(whole[0])) * np.prod(np.sign(parts))
    return SquareJacobian(B, blocks, X_inverse, int(sign))


def _always_singular(values: Array) -> bool:
    singular = np.linalg.svd(values, compute_uv=False)
    return bool((singular[:, -1] < _SINGULAR * singular[:, 0]).all())


def _views(
    found: Survey, places: Sequence[int], rows: Sequence[int], columns: Sequence[int]
) -> Iterator[_View]:
    """Ways to look at the selection that mix none of its rows with others."""
    V_rows, w_rows = [k for k in rows if k < 3], [k - 3 for k in rows if k >= 3]
    memo: dict[bytes, tuple[Block, ...] | None] = {}
    references = [None, *(k for k in found.separate_origins() if k in places)]
    for j in places:
        R, w = found.orientation(j), found.angular(j)[:, :, columns]
        w_kept = _rows_reached(R, w_rows)
        if w_kept is None:
            continue
        for r in references:
            if _leaks(found.arm(r), R, w, V_rows, w_kept):
                continue
            for i in places:
                V_kept = _rows_reached(found.orientation(i), V_rows)
                if V_kept is None:
                    continue
                V = found.linear(i, r)[:, :, columns]
                B = np.concatenate([V[:, V_kept], w[:, w_kept]], axis=1)
                pattern = nonzero(B)
                key = pattern.tobytes()
                if key not in memo:
                    memo[key] = block_triangular(pattern)
                yield _View(i, j, r, V_kept, w_kept, B, memo[key])


def _rows_reached(R: Array, rows: Sequence[int]) -> tuple[int, ...] | None:
    """Components in turned axes of which these rows are made; None unless they are as many."""
    kept = np.flatnonzero(nonzero(R[:, list(rows)]).any(axis=0))
    return tuple(kept.tolist()) if len(kept) == len(rows) else None


def _leaks(arm: Array, R: Array, w: Array, V_rows: Sequence[int], w_kept: Sequence[int]) -> bool:
    """Whether the linear rows take in angular velocities that are no row of the selection."""
    rest = [k for k in range(3) if k not in w_kept]
    share = np.cross(np.swapaxes(R[:, :, rest] @ w[:, rest], 1, 2), arm[:, None])
    return bool(nonzero(share[:, :, list(V_rows)]).any())


def _with_zeros(A: SX, pattern: NDArray[np.bool_]) -> SX:
    exact = casadi.densify(SX(A))
    for row, column in np.argwhere(~pattern).tolist():
        exact[row, column] = SX(0)
    return exact
