"""The loops of a system solved where the pose of one frame is known.

From the base through the tree to the frame, and back by its pose, leads one more loop.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import casadi
import numpy as np
from casadi import DM, SX, Function

from mbs.assembly import System
from mbs.assembly.graph import Edge
from mbs.assembly.khalil_frames import Cut
from mbs.components import Fixed
from mbs.loops.closed_form.ball import unit_quaternion
from mbs.loops.closed_form.known import held_beside, regular_posture
from mbs.loops.closed_form.places import extent, spin_places
from mbs.loops.closed_form.plan import ordered
from mbs.loops.closed_form.ring import free_pose
from mbs.loops.closed_form.stage import Stage
from mbs.loops.closed_form.verified import verified
from mbs.loops.closing import Closing, Vector, closure_parameters
from mbs.recursions.route import relative_pose
from mbs.solvers.rank import null_space
from mbs.spatial import Pose

_POSE = 7


@dataclass(frozen=True, slots=True, eq=False)
class Posed:
    """A plan that starts from the pose of a frame.

    Attributes:
        stages: in their order.
        size: how many positions there are, seven of the pose at their end.
        held: numbers in q of independent joints that the pose does not determine.
    """

    stages: tuple[Stage, ...]
    size: int
    held: tuple[int, ...]

    def started(self, T: Vector, q: Vector) -> Vector:
        """All positions, with those of the pose T (4, 4) and, as in q (nq,), those held."""
        start = np.zeros(self.size)
        start[list(self.held)] = q[list(self.held)]
        start[-_POSE:-4] = T[:3, 3]
        start[-4:] = _quaternion(T[:3, :3])
        return start


def plan_to(system: System, frame: str | int) -> Posed:
    """The plan for a frame whose pose is known.

    Args:
        system: the assembled mechanism, with loops.
        frame: a body, a named frame, or the number of a link.

    Raises:
        NoClosedForm: says which loop has none, and why.
        ModelError: there is no such frame.
    """
    made: Posed = system.cached(("closed form to", frame), lambda: _plan_to(system, frame))
    return made


def _plan_to(system: System, frame: str | int) -> Posed:
    number, pose = system.frame(frame)
    welded = replace(system, cuts=(*system.cuts, _weld(number, pose, Pose.identity())), _cache={})
    first = extent(welded)
    q = SX.sym("q", first + _POSE)
    goal = system.frame("base")[1] @ free_pose(q[first:])
    cuts = (*system.cuts, _weld(number, pose, goal))
    welded = replace(system, cuts=cuts, _cache={})
    at = _pose_and_slope(system, frame)
    p = closure_parameters(system)
    held = _held(system, at, p)
    known = {*held, *spin_places(welded).values(), *range(first, first + _POSE)}
    plan = Posed(tuple(ordered(welded, known, q)), first + _POSE, held)

    def started(posture: Vector) -> Vector:
        return plan.started(np.array(at(posture, p)[0]), posture)

    return replace(plan, stages=verified(system, plan.stages, started))


def _weld(link: int, pose: Pose, goal: Pose) -> Cut:
    joint = Edge(Fixed("pose"), 0, 0, Pose.identity(), Pose.identity(), None)
    return Cut(joint, -1, link, goal, pose, True)


def _held(system: System, at: Function, p: Vector) -> tuple[int, ...]:
    """Independent joints that move while the frame stays."""
    q = regular_posture(system)
    rows = np.vstack([Closing(system, p).rows(q)[1], np.array(at(q, p)[1])])
    return held_beside(system, null_space(rows), ())


def _pose_and_slope(system: System, frame: str | int) -> Function:
    q = SX.sym("q", system.nq)
    T = relative_pose(system.tree, q, system.frame("base"), system.frame(frame)).matrix
    slope = casadi.jacobian(casadi.vec(T), q)
    return Function("pose", [q, system.p], [casadi.densify(T), casadi.densify(slope)])


def _quaternion(R: Vector) -> Vector:
    matrix = SX.sym("R", 3, 3)
    return np.array(Function("quaternion", [matrix], [unit_quaternion(matrix)])(DM(R))).ravel()
