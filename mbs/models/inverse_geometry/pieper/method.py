"""The arrangement of the loop that Pieper's method takes, and its steps.

Source: Pieper 1968; Khalil & Creusot 1997, section 3.3 for the types of equations.
"""

from __future__ import annotations

import casadi
import numpy as np
from casadi import SX

from mbs.errors import NoClosedForm
from mbs.loops.sequence import Problem, Sequence, Step
from mbs.models.inverse_geometry.pieper.forms import PieperLoop
from mbs.models.inverse_geometry.pieper.orientation import three_turns
from mbs.models.inverse_geometry.pieper.position import three_joints
from mbs.models.inverse_geometry.pieper.slides import three_slides
from mbs.spatial import Pose, vector

_JOINTS = 6
_TINY, _ZERO = 1e-280, 1e-9


def pieper(problem: Problem) -> Sequence:
    """The steps of a loop of six joints by Pieper's method.

    Wherever in the loop three neighbouring axes meet in a point, the loop is begun and walked so
    that they come last; the first three joints carry the point, then the last three turn.

    Args:
        problem: of six joints.

    Raises:
        NoClosedForm: no three neighbouring axes meet and no three joints slide, or the arm is
            singular in every posture.
    """
    names = [joint.name for joint in problem.ring.joints]
    if problem.size != _JOINTS:
        raise NoClosedForm(
            f"the loop has {problem.size} unknown joints ({', '.join(names)}), and Pieper's method"
            " takes six"
        )
    if sum(not joint.turns for joint in problem.ring.joints) == 3:
        return Sequence(_JOINTS, three_slides(PieperLoop(problem, problem.ring, _length(problem))))
    scenes = _arrangements(problem)
    if not scenes:
        raise NoClosedForm(_refusal(names))
    found = [steps for scene in scenes if (steps := _steps(scene)) is not None]
    regular = [steps for steps in found if _regular(problem, steps)]
    if not regular:
        raise NoClosedForm(_degenerate(scenes))
    return min((Sequence(_JOINTS, steps) for steps in regular), key=_cost)


def _cost(sequence: Sequence) -> tuple[int, int]:
    """The number of branches, then of quartics."""
    return sequence.branches, sum(step.kind == "quartic" for step in sequence.steps)


def _steps(scene: PieperLoop) -> list[Step] | None:
    """The steps where the axes of the last three joints meet; None where the first three differ."""
    ring = scene.ring
    first, last = _height(scene.after(3).pose)[0], _height(scene.after(4).pose.inverse())[0]
    point = (scene.after(2).pose @ Pose.moved(vector([0, 0, first]))).p
    wanted = (scene.after(5).inverse().pose @ Pose.moved(vector([0, 0, last]))).p
    steps = three_joints(scene, point, wanted)
    if steps is None:
        return None
    before = Pose.identity()
    for k in range(3):
        before = before @ scene.motion(k) @ scene.after(k).pose
    G = casadi.mtimes(ring.gaps[0].pose.R, before.R).T
    A, B = scene.after(3).pose.R, scene.after(4).pose.R
    return [*steps, *three_turns(scene, (3, 4, 5), A, B, G)]


def _length(problem: Problem) -> SX:
    """Of the size of the arm and of the pose [m]."""
    squares = [casadi.sumsqr(gap.pose.p) for gap in problem.ring.gaps]
    return SX(casadi.sqrt(sum(squares, SX(_TINY))))


def _arrangements(problem: Problem) -> list[PieperLoop]:
    """The loop begun and walked so that three axes that meet come last."""
    length = _length(problem)
    found = list[PieperLoop]()
    for k in _concurrent(problem, length):
        forward = problem.ring.rotated((k + 3) % _JOINTS)
        backward = forward.reversed().rotated(3)
        found += [PieperLoop(problem, ring, length) for ring in (forward, backward)]
    return sorted(found, key=_pose_comes_first)


def _pose_comes_first(scene: PieperLoop) -> bool:
    """Whether the way with the most symbols, that of the pose, lies after the first joint."""
    counts = [len(casadi.symvar(gap.pose.matrix)) for gap in scene.ring.gaps]
    return counts[1] == max(counts)


def _regular(problem: Problem, steps: list[Step]) -> bool:
    """Whether the steps determine every joint of a generic posture."""
    x, given = problem.x, problem.given
    return not any(
        problem.always_zero(quantity)
        for one in steps
        for quantity in casadi.vertsplit(one.function(x, given, SX.ones(len(one.signs)))[2])
    )


def _concurrent(problem: Problem, length: SX) -> list[int]:
    """The numbers k such that joints k, k + 1 and k + 2 turn about axes through one point."""
    gaps, joints = problem.ring.gaps, problem.ring.joints
    after = [gaps[(k + 1) % _JOINTS].pose for k in range(_JOINTS)]
    ahead, behind = [_height(way) for way in after], [_height(way.inverse()) for way in after]
    rows = []
    for k in range(_JOINTS):
        (_, along, miss, bend), (_, back, lost, turn) = ahead[k], behind[(k + 1) % _JOINTS]
        rows.append(
            casadi.horzcat(bend, turn, *(far / length for far in (miss, lost, along - back)))
        )
    values = np.array(problem.at_samples(casadi.vertcat(*rows)))
    meet = np.all(np.abs(values[:, :, 2:]) < _ZERO, axis=(0, 2))
    bent = np.all(np.abs(values[:, :, :2]) > _ZERO, axis=(0, 2))
    three = [all(joints[(k + m) % _JOINTS].turns for m in range(3)) for k in range(_JOINTS)]
    return [k for k in (3, 0, 1, 2, 4, 5) if meet[k] and bent[k] and three[k]]


def _height(way: Pose) -> tuple[SX, SX, SX, SX]:
    """Where an axis comes next to the z axis, and how.

    Args:
        way: pose of a frame whose z axis is that axis.

    Returns:
        The height on the z axis, that on the axis itself, the miss, and the bend between them,
        which vanishes where they are parallel.
    """
    p, a = way.p, way.R[:, 2]
    bend = a[0] * a[0] + a[1] * a[1]
    along = -(a[0] * p[0] + a[1] * p[1]) / bend
    return p[2] + along * a[2], along, p[0] * a[1] - p[1] * a[0], bend


def _refusal(names: list[str]) -> str:
    return (
        f"no three neighbouring axes of {names[0]} .. {names[-1]} meet in a point and no three"
        " joints slide, so that Pieper's method does not apply; use the general method"
    )


def _degenerate(scenes: list[PieperLoop]) -> str:
    """Which joints do not determine where the axes meet."""
    joints = scenes[0].ring.joints
    first, last = (", ".join(joint.name for joint in part) for part in (joints[:3], joints[3:]))
    return (
        f"the axes of {last} meet in a point, but the positions of {first} do not follow from"
        " where it is wanted: the arm is singular in every posture"
    )
