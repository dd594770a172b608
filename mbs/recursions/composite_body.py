"""Inertia matrix of a tree from the inertias of its composite bodies.

Source: Walker & Orin 1982; Khalil, Bennis & Gautier 1990; Khalil & Creusot 1997, eq. 27-38.
"""

from __future__ import annotations

from casadi import SX

from mbs.assembly.tree import Tree
from mbs.components.motion import Motion
from mbs.recursions.motion import effort, unit_motions
from mbs.recursions.poses import LinkPose
from mbs.recursions.regrouping import regrouped
from mbs.recursions.rotors import momentum_on
from mbs.recursions.sliding import slid
from mbs.spatial import Wrench, body_through, wrench_through, zeros


def inertia_matrix(tree: Tree, poses: list[LinkPose]) -> SX:
    """(nv, nv) symmetric inertia matrix A(q), rotors included [kg m^2, kg m, kg].

    The composite body of link j is seen from the seat of its joint, where its momentum for a unit
    velocity can be read off, and from there as a part of link i.
    """
    poses, bodies = slid(tree, poses, [link.inertia for link in tree.links])
    composite = regrouped(tree, poses, bodies)
    A = zeros(tree.nv, tree.nv)
    for j in reversed(range(len(tree.links))):
        link, pose = tree.links[j], poses[j]
        steps, body = pose.seat, composite[j]
        if link.motion.nv == 1:
            body = pose.motion[0].body(body)
        else:
            steps = pose.steps
        for column, (linear, angular) in enumerate(unit_motions(link.motion)):
            f, m = body.momentum(linear, angular)
            spin = _at_seat(pose, link.motion, momentum_on(link, j))
            m = m + spin
            A[link.v, link.v.start + column] = effort(link.motion, f, m)
            f_i, m_i = wrench_through(steps, f, m)
            m_i = m_i + momentum_on(link, link.antecedent)
            _fill_ancestors(A, tree, poses, j, column, (f_i, m_i))
        for k in range(link.v.start, link.v.stop):
            A[k, k] += link.Ia
        if link.rotor is not None:
            A[link.v, link.v] += link.rotor.seen_at_joint + effort(link.motion, zeros(), spin)
        if link.antecedent >= 0:
            composite[link.antecedent] += body_through(steps, body)
    return A


def _at_seat(pose: LinkPose, motion: Motion, vector: SX) -> SX:
    """A vector of the link in the frame in which the momentum of its joint is written."""
    return pose.motion[0].turn.apply(vector) if motion.nv == 1 else vector


def _fill_ancestors(
    A: SX, tree: Tree, poses: list[LinkPose], j: int, column: int, wrench: Wrench
) -> None:
    """The efforts at the ancestors of link j of a wrench on its antecedent, in column and row."""
    k = tree.links[j].v.start + column
    i = tree.links[j].antecedent
    while i >= 0:
        link = tree.links[i]
        entries = effort(link.motion, *wrench)
        A[link.v, k] = entries
        A[k, link.v] = entries.T
        wrench = poses[i].wrench(*wrench)
        i = link.antecedent
