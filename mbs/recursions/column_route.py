"""Which columns of the derivatives cost less in the base than through the axes of all joints."""

from __future__ import annotations

from itertools import pairwise

from mbs.assembly.tree import Tree
from mbs.recursions.joint_axes import Drift, JointAxes, Step
from mbs.spatial import Screw

_TURN, _SLIDE, _DRIFT, _PAIR = 42, 12, 12, 17
"""Operations of a column on its way through the axes of the joints before."""

_BASE_PAIR, _BASE_COLUMN, _BASE_LINE = 67, 130, 150
"""Operations in the base: of a pair, and of the way there of a column and of a line."""


def links_by_base(tree: Tree, axes: list[JointAxes]) -> set[int]:
    """Links whose columns cost less by way of the base; empty when too few do.

    In the base a pair of joints costs the same however far they are apart and however their axes
    lie; on the way through the joints right angles and vanishing distances are cheaper still.
    """
    saved: dict[int, int] = {}
    for j, link in enumerate(tree.links):
        path = tree.path(j)
        pairs = sum(tree.links[i].motion.nv for i in path[:-1])
        walk = sum(_cost(step) for i in path[1:] for step in axes[i].way)
        turns = sum(axes[i].turn is not None and not axes[k].joined for i, k in pairwise(path))
        saving = walk + _TURN * turns - (_BASE_PAIR - _PAIR) * pairs - _BASE_COLUMN
        if saving > 0:
            saved[j] = saving * link.motion.nv
    return set(saved) if sum(saved.values()) > _BASE_LINE * tree.nv else set()


def _cost(step: Step) -> int:
    """Operations that a step takes of a column."""
    match step:
        case Drift():
            return _DRIFT
        case Screw():
            quarter = step.turn.c.is_zero() or step.turn.s.is_zero()
            return _TURN * (not quarter) + _SLIDE * (not step.t.is_zero())
    return 3 * (_TURN + _SLIDE)
