"""What acts on a mechanism from outside: gravity, a base that moves, wrenches on bodies."""

from __future__ import annotations

from dataclasses import dataclass

import casadi
from casadi import SX

from mbs.assembly import System
from mbs.assembly.model_function import Named
from mbs.recursions.accelerations import Acceleration, moving_base, resting_base
from mbs.recursions.force_elements import element_wrenches
from mbs.recursions.poses import LinkPose
from mbs.recursions.transmitted import summed
from mbs.spatial import Wrench, carried


@dataclass(frozen=True, slots=True, eq=False)
class Surroundings:
    """What acts on a mechanism.

    Attributes:
        base: its motion, gravity included.
        external: for some links the wrench that they exert on their environment, about and in
            their frames.
        inputs: of the model, that say all this.
    """

    base: Acceleration
    external: dict[int, Wrench]
    inputs: Named


def surroundings(system: System, f_ext: bool = False, moves: bool = False) -> Surroundings:
    """A resting base under gravity and no wrenches, or inputs for them.

    Args:
        system: whose tree has gravity, given in the base frame at R_0 = 1.
        f_ext: add the input f_ext (6, bodies): for each row of `system.bodies` the wrench [force;
            moment] that the body exerts on its environment, in the body's frame.
        moves: add the inputs v_0 and a_0, (6, 1), velocity [V; w] and acceleration [vd; wd] of
            the base's origin in its own axes, and R_0, (3, 3), orientation of the base frame in
            the fixed frame in which gravity is given.
    """
    gravity, inputs = system.tree.gravity, list[tuple[str, SX]]()
    base, external = resting_base(gravity), dict[int, Wrench]()
    if f_ext:
        wrenches = SX.sym("f_ext", 6, len(system.bodies))
        external = wrenches_on_links(system, wrenches)
        inputs.append(("f_ext", wrenches))
    if moves:
        v_0, a_0, R_0 = SX.sym("v_0", 6), SX.sym("a_0", 6), SX.sym("R_0", 3, 3)
        base = moving_base(v_0[3:6], a_0[3:6], a_0[0:3] - casadi.mtimes(R_0.T, gravity))
        inputs += [("v_0", v_0), ("a_0", a_0), ("R_0", R_0)]
    return Surroundings(base, external, inputs)


def exerted(
    system: System, around: Surroundings, poses: list[LinkPose], q: SX, v: SX
) -> dict[int, Wrench]:
    """For some links the wrench that they exert on their environment, force elements included.

    Args:
        system: whose force elements act.
        around: what else acts.
        poses: of every link with respect to its antecedent.
        q: (nq, 1) positions.
        v: (nv, 1) velocities of the tree.
    """
    return summed(around.external, element_wrenches(system.tree, system.forces, poses, q, v))


def wrenches_on_links(system: System, wrenches: SX) -> dict[int, Wrench]:
    """The wrenches of bodies, (6, bodies) in their frames, brought to the frames of their links."""
    exerted: list[dict[int, Wrench]] = []
    for column, row in enumerate(system.bodies):
        link, pose = system.frames[row.name]
        exerted.append({link: carried(pose, (wrenches[0:3, column], wrenches[3:6, column]))})
    return summed(*exerted)
