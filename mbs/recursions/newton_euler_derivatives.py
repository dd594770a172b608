"""Derivatives of the inverse dynamics by recursions over the tree.

Source: Singh, Russell & Wensing 2022; Carpentier & Mansard 2018.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import casadi
from casadi import SX

from mbs.assembly.tree import Tree
from mbs.recursions.accelerations import Acceleration, link_accelerations
from mbs.recursions.base_axes import BaseAxes, base_axes
from mbs.recursions.column_route import links_by_base
from mbs.recursions.effort_column import Couple, EffortColumn, effort_column, rotor_couple
from mbs.recursions.joint_axes import JointAxes, joint_axes
from mbs.recursions.joint_lines import Line
from mbs.recursions.poses import LinkPose
from mbs.recursions.regrouping import regrouped
from mbs.recursions.rotors import rotor_efforts, rotor_moments, spin_momenta
from mbs.recursions.sliding import heights_first, slid
from mbs.recursions.subtree_motion import SubtreeMotion, subtree_motions
from mbs.spatial import PseudoInertia, is_zero, zeros

Passage = tuple[int, tuple[Line, ...], EffortColumn]
"""A joint that a column passes, the motions of this joint, and the column in the same axes."""


@dataclass(frozen=True, slots=True, eq=False)
class EffortDerivatives:
    """Joint efforts, without drives, friction and springs, and their derivatives.

    Attributes:
        dq: (nv, nv) along the velocities of the joints: column k is the rate of the efforts when
            the positions move with unit velocity k while v and a stay as they are.
        dv: (nv, nv) with respect to velocities.
        A: (nv, nv) with respect to accelerations: the inertia matrix.
        efforts: (nv, 1).
    """

    dq: SX
    dv: SX
    A: SX
    efforts: SX


def newton_euler_derivatives(
    tree: Tree, poses: list[LinkPose], v: SX, a: SX, base: Acceleration
) -> EffortDerivatives:
    """Derivatives of the efforts of `newton_euler`.

    Inertia, its rate and the wrench of everything behind a joint run from the leaves to the
    base. From them come, for each joint, the change of that wrench with its position, velocity
    and acceleration; each runs on to the base and gives an effort at every joint it passes.

    Args:
        tree: the links.
        poses: each with respect to its antecedent.
        v: (nv, 1) joint velocities.
        a: (nv, 1) joint accelerations.
        base: motion of the base; see `resting_base`.

    Returns:
        derivatives along the velocities of the joints, in the order of v [N m or N, by the unit
        of the velocity].
    """
    bodies = [PseudoInertia.of(link.inertia) for link in tree.links]
    poses, bodies = slid(tree, poses, bodies, base_rests=is_zero(base.w))
    poses = heights_first(poses)
    bodies = regrouped(tree, poses, bodies)
    motions = link_accelerations(tree, poses, v, a, base)
    axes = joint_axes(tree, poses, v, motions, base)
    spins, moments = spin_momenta(tree, v), rotor_moments(tree, v, a, motions)
    own = [
        SubtreeMotion.of_link(body, motion, spins.get(j, zeros()), moments.get(j, zeros()))
        for j, (body, motion) in enumerate(zip(bodies, motions, strict=True))
    ]
    subtrees = subtree_motions(tree, axes, own)
    dq, dv, A = (zeros(tree.nv, tree.nv) for _ in range(3))
    efforts = rotor_efforts(tree, a, motions, base)
    for j, link in enumerate(tree.links):
        for k, line in enumerate(axes[j].lines, link.v.start):
            efforts[k] += line.unit.power(subtrees[j].f, subtrees[j].m)
    result = EffortDerivatives(dq, dv, A, efforts)
    _fill(result, tree, axes, subtrees)
    return result


def _fill(
    result: EffortDerivatives, tree: Tree, axes: list[JointAxes], subtrees: list[SubtreeMotion]
) -> None:
    by_base = links_by_base(tree, axes)
    placed = base_axes(tree, axes) if by_base else []
    for j, link in enumerate(tree.links):
        own, couple = _rotor_couples(tree, axes, j)
        for k, line in enumerate(axes[j].lines, link.v.start):
            column = effort_column(subtrees[j], line)
            if own is not None:
                column = column.with_couple(own)
            _set_own(result, k, link.v.start, axes[j].lines, column)
            if own is not None:
                result.dv[k, k] += casadi.dot(line.unit.angular, own.dv)
                result.A[k, k] += casadi.dot(line.unit.angular, own.da)
            if link.rotor is not None:
                result.A[k, k] += link.rotor.seen_at_joint
            passages = (
                _through_base(tree, placed, j, column, couple)
                if j in by_base
                else _through_axes(tree, axes, j, column, couple)
            )
            for i, lines, passing in passages:
                _set_pairs(result, k, tree.links[i].v.start, lines, passing)


def _rotor_couples(
    tree: Tree, axes: list[JointAxes], j: int
) -> tuple[Couple | None, Couple | None]:
    """Of the rotor of joint j on its own link, and on the link before."""
    rotor = tree.links[j].rotor
    if rotor is None or rotor.carrier < 0:
        return None, None
    couple = rotor_couple(rotor, axes[rotor.carrier])
    return (couple, None) if rotor.carrier == j else (None, couple)


def _through_axes(
    tree: Tree, axes: list[JointAxes], j: int, column: EffortColumn, couple: Couple | None
) -> Iterator[Passage]:
    """A column of joint j in the axes of every joint before, one after the other.

    Args:
        tree: the links.
        axes: of the joints.
        j: the joint.
        column: in its axes.
        couple: of its rotor on the link before, in the axes of that link.
    """
    while tree.links[j].antecedent >= 0:
        for step in axes[j].way:
            column = column.through(step)
        joined, j = axes[j].joined, tree.links[j].antecedent
        turn = axes[j].turn
        if turn is not None and not joined:
            column = column.turned(turn)
        if couple is not None:
            column, couple = column.with_couple(couple), None
        yield j, axes[j].lines, column


def _through_base(
    tree: Tree, placed: list[BaseAxes], j: int, column: EffortColumn, couple: Couple | None
) -> Iterator[Passage]:
    """The same, with every joint before it in the base."""
    i = tree.links[j].antecedent
    column = column.through(placed[j].place).drifting(placed[j].twice)
    if couple is not None:
        column = column.with_couple(couple.turned(placed[i].place.turn))
    for before in tree.path(i):
        yield before, placed[before].lines, column


def _set_own(
    result: EffortDerivatives, k: int, start: int, lines: tuple[Line, ...], column: EffortColumn
) -> None:
    """The entries of velocity k with those of its own joint, from number `start` on."""
    for h, line in enumerate(lines, start):
        result.dq[k, h], result.dv[k, h], result.A[k, h] = column.row(line)


def _set_pairs(
    result: EffortDerivatives, k: int, start: int, lines: tuple[Line, ...], column: EffortColumn
) -> None:
    """The entries of velocity k with those of a joint before, from number `start` on."""
    _set_own(result, k, start, lines, column)
    for h, line in enumerate(lines, start):
        result.dq[h, k], result.dv[h, k], result.A[h, k] = column.efforts(line)
