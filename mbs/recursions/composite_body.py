"""Inertia matrix (mass matrix) of a tree by the composite-rigid-body algorithm.

Source: Walker & Orin 1982; Khalil, Bennis & Gautier 1990; Khalil & Creusot 1997, eq. 27-38.
"""

from __future__ import annotations

from typing import NamedTuple

import casadi
from casadi import SX

from mbs.assembly.tree import Tree
from mbs.recursions.link_motions import LinkPose, effort, unit_motions
from mbs.recursions.newton_euler import momentum_on
from mbs.recursions.regrouping import regroup, shift_frames
from mbs.spatial import Wrench, transform_inertia_along, transform_wrench_along, zeros


def inertia_matrix(tree: Tree, poses: list[LinkPose]) -> SX:
    """Return the symmetric inertia matrix A(q) (nv, nv) of a tree, rotors included.

    Elements are in kg m^2, kg m or kg. For a joint j with one velocity, the composite body of link
    j (link j with its descendants) is expressed in the joint frame on the antecedent i, in which
    the momentum for a unit velocity needs no products.

    Args:
        tree: links, rotors included.
        poses: pose of each link relative to its antecedent.
    """
    poses, bodies = shift_frames(tree, poses, [link.inertia for link in tree.links])
    composite = regroup(tree, poses, bodies)
    A = zeros(tree.nv, tree.nv)
    for j in reversed(range(len(tree.links))):
        link, pose = tree.links[j], poses[j]
        steps, body = pose.seat, composite[j]
        if link.motion.nv == 1:
            body = pose.motion[0].body(body)
        else:
            steps = pose.steps
        for column, (linear, angular) in enumerate(unit_motions(link, pose)):
            f, m = body.momentum(linear, angular)
            spin = momentum_on(link, j)
            if link.motion.nv == 1:
                spin = pose.motion[0].rotation.apply(spin)
            m = m + spin
            A[link.v, link.v.start + column] = effort(link, pose, f, m)
            f_i, m_i = transform_wrench_along(steps, f, m)
            m_i = m_i + momentum_on(link, link.antecedent)
            _fill_ancestors(A, tree, poses, j, column, (f_i, m_i))
        for k in range(link.v.start, link.v.stop):
            A[k, k] += link.Ia
        if link.rotor is not None:
            A[link.v, link.v] += link.rotor.seen_at_joint + effort(link, pose, zeros(), spin)
        if link.antecedent >= 0:
            composite[link.antecedent] += transform_inertia_along(steps, body)
    return A


def _fill_ancestors(
    A: SX, tree: Tree, poses: list[LinkPose], j: int, column: int, wrench: Wrench
) -> None:
    """Write elements of the inertia matrix A, in place: efforts of the ancestors of link j.

    `wrench` is the momentum on the antecedent of link j for a unit value of its velocity `column`.
    """
    k = tree.links[j].v.start + column
    i = tree.links[j].antecedent
    while i >= 0:
        link = tree.links[i]
        entries = effort(link, poses[i], *wrench)
        A[link.v, k] = entries
        A[k, link.v] = entries.T
        wrench = poses[i].wrench(*wrench)
        i = link.antecedent


# Factors A = L' D L of the inertia matrix of a tree, without fill-in.
#
# L[k, i] is zero unless velocity i is an ancestor of velocity k, so that velocities of different
# branches cause no operations.
#
# Source: Featherstone 2008, section 6.5 (LTDL).


def velocity_antecedents(tree: Tree) -> list[int]:
    """Return for each joint velocity the index of the nearest velocity towards the base, or -1.

    Velocities of one joint follow each other in this order.

    Args:
        tree: the links.
    """
    before = []
    for link in tree.links:
        i = link.antecedent
        start = tree.links[i].v.stop - 1 if i >= 0 else -1
        before.extend([start, *range(link.v.start, link.v.stop - 1)])
    return before


class TreeFactor(NamedTuple):
    """Factors of the inertia matrix A = L' D L of a tree.

    Attributes:
        ratios: elements -L[k, i], from the last velocity k to the first, and for each k from its
            nearest ancestor i to the farthest.
        inverse: (n, 1) elements of 1 / D.
    """

    ratios: SX
    inverse: SX


def factor_symbols(before: list[int]) -> TreeFactor:
    """Return the factors of an inertia matrix as symbols.

    Args:
        before: index of the nearest ancestor of each row, or -1, see `factorize`.
    """
    size = sum(len(_path(before, k)) for k in range(len(before)))
    return TreeFactor(SX.sym("ratios", size), SX.sym("inverse", len(before)))


def factorize(A: SX, before: list[int]) -> TreeFactor:
    """Return the factors of A = L' D L.

    Args:
        A: (n, n) symmetric matrix; A[i, j] is zero unless i = j, i is an ancestor of j, or j of i.
        before: index of the nearest ancestor of each row, or -1. Ancestors have smaller indices.
    """
    H, n = SX(A), A.shape[0]
    ratios, inverse = list[SX](), [SX(0)] * n
    for k in reversed(range(n)):
        minus = -1 / H[k, k]  # the sign prevents CasADi from rewriting products as divisions
        inverse[k] = -minus
        path = _path(before, k)
        for place, i in enumerate(path):
            ratio = H[k, i] * minus
            for j in path[place:]:
                H[i, j] += ratio * H[k, j]
            ratios.append(ratio)
    return TreeFactor(casadi.vertcat(SX(0, 1), *ratios), casadi.vertcat(*inverse))


def substitute(factor: TreeFactor, right: SX, before: list[int]) -> SX:
    """Solve A x = right for x (n, m) by substitution.

    Args:
        factor: factors of A.
        right: (n, m) right-hand sides.
        before: index of the nearest ancestor of each row, as in `factorize`.
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
    """Return the solution x (n, m) of A x = right for the inertia matrix of a tree.

    Args:
        A: (n, n) symmetric matrix, see `factorize`.
        right: (n, m) right-hand sides.
        before: index of the nearest ancestor of each row, or -1.
    """
    return substitute(factorize(A, before), right, before)


def _path(before: list[int], k: int) -> list[int]:
    """Return the ancestors of the velocity k, the nearest first; `before` as in `factorize`."""
    path = []
    while before[k] >= 0:
        k = before[k]
        path.append(k)
    return path
