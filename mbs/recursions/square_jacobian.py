"""Square submatrix of a Jacobian in block triangular form.

The axes of linear and angular velocity and the reference point are selected among the links so that
the blocks are smallest. With the reference at the centre of a spherical wrist, for instance, the
wrist is decoupled from the arm.

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
    JacobianSamples,
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
"""Singular value relative to the largest that counts as zero: rounding errors are 1e-15, and at
random positions the values of a matrix that is not always singular are much larger."""


@dataclass(frozen=True, slots=True, eq=False)
class SquareJacobian:
    """Square matrix X B; B is block triangular and X is a product of rotations and a shear.

    Attributes:
        B: (m, m) block triangular matrix, up to permutations, with structural zeros.
        blocks: diagonal blocks in the order of solution; None for an always singular matrix.
        X_inverse: (m, m) inverse of X.
        sign: 1 or -1; the determinant is the sign times the product of the block determinants.
    """

    B: SX
    blocks: tuple[Block, ...] | None
    X_inverse: SX
    sign: int

    def inverse(self) -> SX:
        """Return the inverse (m, m) of the matrix, by block substitution.

        It must not be always singular.
        """
        assert self.blocks is not None
        return solve_blocks(self.B, self.blocks, self.X_inverse)

    def seen(self, twist: SX) -> SX:
        """Return X^-1 twist (m, 1), which is the right-hand side of equations with B.

        `twist` (m, 1) is the right-hand side of equations with X B.
        """
        return casadi.densify(casadi.mtimes(self.X_inverse, twist))

    def determinants(self) -> list[SX]:
        """Return the determinants of the blocks; a single zero for an always singular matrix."""
        if self.blocks is None:
            return [SX(0)]
        return [determinant(block.of(self.B)) for block in self.blocks]

    def determinant(self) -> SX:
        """Return the determinant of the matrix: sign times the product of block determinants."""
        product = SX(self.sign)
        for factor in self.determinants():
            product = product * factor
        return product


@dataclass(frozen=True, slots=True, eq=False)
class _View:
    """Candidate of axes and reference point, with the resulting matrix.

    Attributes:
        linear, angular: indices in the survey of the frames whose axes V and w are expressed in.
        reference: index in the survey of the reference point; None for the moving frame.
        V_rows, w_rows: components of V and w in these axes that span the selected rows.
        B: (samples, m, m) numeric matrix.
        blocks: diagonal blocks of its pattern; None if it is always singular.
    """

    linear: int
    angular: int
    reference: int | None
    V_rows: tuple[int, ...]
    w_rows: tuple[int, ...]
    B: Array
    blocks: tuple[Block, ...] | None

    def rank(self, size: int) -> tuple[float, ...]:
        """Return a sort key, lower is better: block work, then varying entries.

        `size` is the number of frames of the survey; axes in the middle of the path are preferred.
        """
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
    """Return a square submatrix of the Jacobian of a tree in block triangular form.

    Args:
        target: moving frame, and axes of the Jacobian J.
        rows: indices 0 to 5 into [V; w].
        columns: indices of columns, as many as rows.
        G: (nv, m) reduction matrix; if given, the columns belong to J G.
    """
    tree, q = target.tree, target.q
    found = survey(target)
    if G is None:
        places = _frame_indices(tree, found, columns)
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
    X_inverse = _inverse_map(
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
    """Return the values (samples, ...) of the matrix A at random configurations.

    `target` has the symbols of A. The configurations are those of `random_samples`.
    """
    f = Function("f", [target.q, target.p], [casadi.densify(A)])
    samples = random_samples(target.tree, target.p.numel())
    return np.array([np.array(f(*sample)) for sample in samples])


def _frame_indices(tree: Tree, found: JacobianSamples, columns: Sequence[int]) -> list[int]:
    """Return the indices in `found.frames` of the frames whose axes and origins are tried.

    These are the base, the links on the path that the velocities `columns` move, and the required
    axes.
    """
    kept = []
    for place in found.on_path:
        link, _ = found.frames[place]
        v = tree.links[link].v if link >= 0 else slice(0, 0)
        if link < 0 or any(v.start <= column < v.stop for column in columns):
            kept.append(place)
    return [*kept, len(found.frames) - 1]


def _inverse_map(rows: Sequence[int], R_V: SX, R_w: SX, arm: SX) -> SX:
    """Return X^-1, which maps the required rows of [V; w] to rows in other axes.

    The other axes and their reference point are those of a `_View`.

    Args:
        rows: required rows.
        R_V: rows of the orientation of the target axes in the axes of the linear velocity.
        R_w: rows of the orientation of the target axes in the axes of the angular velocity.
        arm: (3, 1) vector from the reference point to the origin of the moving frame, in the target
            axes.
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
    """Return the square Jacobian, with the sign of its determinant relative to that of its blocks.

    It is the sign of the determinant of the whole matrix, divided by the product of those of the
    `blocks` of `B`. `values` and `whole` (samples, m, m) are numeric values of `B` and of the whole
    matrix. `X_inverse` is stored in the result.
    """
    if blocks is None or _always_singular(values):
        return SquareJacobian(B, None, X_inverse, 1)
    parts = [np.linalg.det(values[0][np.ix_(block.rows, block.columns)]) for block in blocks]
    sign = np.sign(np.linalg.det(whole[0])) * np.prod(np.sign(parts))
    return SquareJacobian(B, blocks, X_inverse, int(sign))


def _always_singular(values: Array) -> bool:
    """Return whether the matrices (samples, n, n) are singular at all samples."""
    singular = np.linalg.svd(values, compute_uv=False)
    return bool((singular[:, -1] < _SINGULAR * singular[:, 0]).all())


def _views(
    found: JacobianSamples, places: Sequence[int], rows: Sequence[int], columns: Sequence[int]
) -> Iterator[_View]:
    """Yield candidates of axes and reference point for selected rows and columns of the Jacobian.

    In these axes the selected `rows` do not mix with other rows of [V; w]. `places` are the frames
    to try, as indices in `found.frames`.
    """
    V_rows, w_rows = [k for k in rows if k < 3], [k - 3 for k in rows if k >= 3]
    memo: dict[bytes, tuple[Block, ...] | None] = {}
    references = [None, *(k for k in found.separate_origins() if k in places)]
    for j in places:
        R, w = found.orientation(j), found.angular(j)[:, :, columns]
        w_kept = _rows_reached(R, w_rows)
        if w_kept is None:
            continue
        for r in references:
            if _mixes_rows(found.arm(r), R, w, V_rows, w_kept):
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
    """Return the components, in rotated axes, on which `rows` depend; None if their number differs.

    `R` is (samples, 3, 3).
    """
    kept = np.flatnonzero(nonzero(R[:, list(rows)]).any(axis=0))
    return tuple(kept.tolist()) if len(kept) == len(rows) else None


def _mixes_rows(
    arm: Array, R: Array, w: Array, V_rows: Sequence[int], w_kept: Sequence[int]
) -> bool:
    """Return whether a change of reference adds angular velocities outside the selection to V rows.

    `arm` (samples, 3) is the vector from the new reference, `R` (samples, 3, 3) the orientation of
    the axes of w, and `w_kept` are the selected components.
    """
    rest = [k for k in range(3) if k not in w_kept]
    share = np.cross(np.swapaxes(R[:, :, rest] @ w[:, rest], 1, 2), arm[:, None])
    return bool(nonzero(share[:, :, list(V_rows)]).any())


def _with_zeros(A: SX, pattern: NDArray[np.bool_]) -> SX:
    """Return the matrix A with exact zeros where `pattern` is False."""
    exact = casadi.densify(SX(A))
    for row, column in np.argwhere(~pattern).tolist():
        exact[row, column] = SX(0)
    return exact
