"""Inertia matrix of a tree from the inertias of its composite bodies.

Source: Walker & Orin 1982; Khalil, Bennis & Gautier 1990; Khalil & Creusot 1997, eq. 27-38.
"""

from __future__ import annotations

import casadi
from casadi import SX

from mbs.assembly.tree import Tree
from mbs.recursions.motion import effort, unit_motions
from mbs.recursions.newton_euler import moved_wrench
from mbs.recursions.poses import LinkPose
from mbs.spatial import Inertia, cross, zeros


def composite_inertias(tree: Tree, poses: list[LinkPose]) -> list[Inertia]:
    """For each link, the inertia of it and of everything it carries, about and in its frame."""
    composite = [link.inertia for link in tree.links]
    for j in reversed(range(len(tree.links))):
        i = tree.links[j].antecedent
        if i >= 0:
            composite[i] = composite[i] + composite[j].seen_from(poses[j], poses[j].p)
    return composite


def inertia_matrix(tree: Tree, poses: list[LinkPose]) -> SX:
    """(nv, nv) symmetric inertia matrix A(q), rotors included [kg m^2, kg m, kg]."""
    composite = composite_inertias(tree, poses)
    A = zeros(tree.nv, tree.nv)
    for j, link in enumerate(tree.links):
        for column, (linear, angular) in enumerate(unit_motions(link.motion)):
            f, m = _momentum(composite[j], linear, angular)
            _fill_column(A, tree, poses, j, link.v.start + column, f, m)
        for k in range(link.v.start, link.v.stop):
            A[k, k] += link.Ia
    return A


def _fill_column(
    A: SX, tree: Tree, poses: list[LinkPose], j: int, column: int, f: SX, m: SX
) -> None:
    """The efforts at link j and its ancestors of a wrench on link j, in a column and its row."""
    own = tree.links[j]
    A[own.v, column] = effort(own.motion, f, m)
    while tree.links[j].antecedent >= 0:
        f, m = moved_wrench(poses[j], f, m)
        j = tree.links[j].antecedent
        link = tree.links[j]
        entries = effort(link.motion, f, m)
        A[link.v, column] = entries
        A[column, link.v] = entries.T


def _momentum(inertia: Inertia, linear: SX, angular: SX) -> tuple[SX, SX]:
    """Linear and angular momentum about the origin, of a velocity in the same frame."""
    return (
        inertia.m * linear + cross(angular, inertia.ms),
        casadi.mtimes(inertia.J, angular) + cross(inertia.ms, linear),
    )
