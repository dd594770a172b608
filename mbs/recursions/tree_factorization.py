"""A = L' D L of a tree's inertia matrix, without filling in its zeros.

The factor L has a non-zero only where a velocity is an ancestor of another one, so that branches
cost nothing to each other.

Source: Featherstone 2008, section 6.5 (LTDL).
"""

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


def solve_tree(A: SX, right: SX, before: list[int]) -> SX:
    """The solution x of A x = right, one or several columns.

    Args:
        A: (n, n) symmetric, with A[i, j] zero unless one of i, j is an ancestor of the other.
        right: (n, m).
        before: for each row its ancestor, or -1; ancestors have smaller numbers.
    """
    H, n = SX(A), A.shape[0]
    inverse = [SX(0)] * n  # -1 / D: its sign keeps products by it from being made divisions
    for k in reversed(range(n)):
        i = before[k]
        inverse[k] = -1 / H[k, k]
        while i >= 0:
            ratio = H[k, i] * inverse[k]
            j = i
            while j >= 0:
                H[i, j] += ratio * H[k, j]
                j = before[j]
            H[k, i] = ratio
            i = before[i]
    x = SX(right)
    for k in reversed(range(n)):
        i = before[k]
        while i >= 0:
            x[i, :] += H[k, i] * x[k, :]
            i = before[i]
    for k in range(n):
        x[k, :] = -inverse[k] * x[k, :]
        i = before[k]
        while i >= 0:
            x[k, :] += H[k, i] * x[i, :]
            i = before[i]
    return x
