"""A = L' D L of a tree's inertia matrix, without filling in its zeros.

The factor L has a non-zero only where a velocity is an ancestor of another one, so that branches
cost nothing to each other.

Source: Featherstone 2008, section 6.5 (LTDL).
"""

from typing import NamedTuple

import casadi
from casadi import SX

from mbs.assembly.tree import Tree


def velocity_antecedents(tree: Tree) -> list[int]:
    """For each velocity the one before it on the way to the base, or -1."""
    before = []
    for link in tree.links:
        i = link.antecedent
        start = tree.links[i].v.stop - 1 if i >= 0 else -1
        before.extend([start, *range(link.v.start, link.v.stop - 1)])
    return before


class TreeFactor(NamedTuple):
    """A = L' D L of a tree's inertia matrix.

    Attributes:
        ratios: for each velocity, the last first, and each of its ancestors, the nearest first,
            minus the element of L.
        inverse: 1 / D.
    """

    ratios: SX
    inverse: SX


def factor_symbols(before: list[int]) -> TreeFactor:
    """Symbols in the place of the factors of a matrix."""
    size = sum(len(_path(before, k)) for k in range(len(before)))
    return TreeFactor(SX.sym("ratios", size), SX.sym("inverse", len(before)))


def factorized(A: SX, before: list[int]) -> TreeFactor:
    """The factors of A.

    Args:
        A: (n, n) symmetric, with A[i, j] zero unless one of i, j is an ancestor of the other.
        before: for each row its ancestor, or -1; ancestors have smaller numbers.
    """
    H, n = SX(A), A.shape[0]
    ratios, inverse = list[SX](), [SX(0)] * n
    for k in reversed(range(n)):
        minus = -1 / H[k, k]  # its sign keeps products by it from being made divisions
        inverse[k] = -minus
        path = _path(before, k)
        for place, i in enumerate(path):
            ratio = H[k, i] * minus
            for j in path[place:]:
                H[i, j] += ratio * H[k, j]
            ratios.append(ratio)
    return TreeFactor(casadi.vertcat(SX(0, 1), *ratios), casadi.vertcat(*inverse))


def substituted(factor: TreeFactor, right: SX, before: list[int]) -> SX:
    """The solution x of A x = right, one or several columns.

    Args:
        factor: of A.
        right: (n, m).
        before: as of `factorized`.
    """
    paths = [_path(before, k) for k in range(len(before))]
    x, place, ratio = SX(right), 0, dict[tuple[int, int], SX]()
    for k in reversed(range(len(before))):
        for i in paths[k]:
            ratio[k, i] = factor.ratios[place]
            x[i, :] += ratio[k, i] * x[k, :]
            place += 1
    for k in range(len(before)):
        x[k, :] = factor.inverse[k] * x[k, :]
        for i in paths[k]:
            x[k, :] += ratio[k, i] * x[i, :]
    return x


def solve_tree(A: SX, right: SX, before: list[int]) -> SX:
    """The solution x of A x = right; arguments as of `factorized` and `substituted`."""
    return substituted(factorized(A, before), right, before)


def _path(before: list[int], k: int) -> list[int]:
    """The ancestors of a velocity, the nearest first."""
    path = []
    while before[k] >= 0:
        k = before[k]
        path.append(k)
    return path
