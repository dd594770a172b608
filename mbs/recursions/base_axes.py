"""The axes of the joints seen from the base, where every joint meets every other at once.

Source: Singh, Russell & Wensing 2022 (all vectors in the ground frame).
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi
from casadi import SX

from mbs.assembly.tree import Tree
from mbs.recursions.joint_axes import Drift, JointAxes, Step
from mbs.recursions.joint_lines import Line
from mbs.spatial import FreeDisplacement, MatrixTurn, Rotation, zeros


@dataclass(frozen=True, slots=True, eq=False)
class BaseAxes:
    """The axes of a joint in the base.

    Attributes:
        place: where they stand.
        twice: (3, 1) twice the velocity of their origin, in the base [m/s].
        lines: the motions of the joint, about the origin of the base, for an observer at rest.
    """

    place: FreeDisplacement
    twice: SX
    lines: tuple[Line, ...]


def base_axes(tree: Tree, axes: list[JointAxes]) -> list[BaseAxes]:
    """The axes of every joint in the base."""
    result: list[BaseAxes] = []
    for link, own in zip(tree.links, axes, strict=True):
        i = link.antecedent
        R, p, twice = SX.eye(3), zeros(), zeros()
        if i >= 0:
            R, p, twice = result[i].place.turn.matrix, result[i].place.p, result[i].twice
            turn = axes[i].turn
            if turn is not None and not own.joined:
                R = _turned(R, turn)
        for step in reversed(own.way):
            R, p, twice = _after(step, R, p, twice)
        place = FreeDisplacement(MatrixTurn(R), p)
        lines = (line.displaced(R, p).drifting(twice) for line in own.lines)
        result.append(BaseAxes(place, twice, tuple(lines)))
    return result


def _after(step: Step, R: SX, p: SX, twice: SX) -> tuple[SX, SX, SX]:
    if isinstance(step, Drift):
        return R, p, twice + casadi.mtimes(R, step.twice)
    p = p + casadi.mtimes(R, step.point(zeros()))
    return _turned(R, step.turn), p, twice


def _turned(R: SX, turn: Rotation) -> SX:
    """R times the matrix of a turn."""
    return casadi.horzcat(*(turn.apply_inverse(R[k, :].T) for k in range(3))).T
