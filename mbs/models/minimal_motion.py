"""The motion of the tree from the states and inputs of the independent joints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi
from casadi import SX

from mbs.assembly import System
from mbs.assembly.rates import normalised
from mbs.assembly.tree import Frame
from mbs.loops.reduction import reduction
from mbs.models.minimal_drive import InputMotion
from mbs.recursions.force_elements import wrench_efforts
from mbs.recursions.frame_motion import BASE
from mbs.recursions.poses import link_poses
from mbs.recursions.route import relative_pose
from mbs.recursions.transmitted import summed
from mbs.spatial import Wrench, carried


@dataclass(frozen=True, slots=True, eq=False)
class TreeMotion:
    """Positions and velocities of the tree.

    Attributes:
        raw: (nq, 1) positions, quaternions as they are in the state.
        q: (nq, 1) the same on the loops, quaternions of unit length.
        v_a: (m, 1) independent velocities.
        v: (nv, 1) velocities of the tree.
        G: (nv, m), v = G v_a; None in an open chain, where v is v_a.
        gamma: (nv, 1), a = G a_a + gamma.
    """

    raw: SX
    q: SX
    v_a: SX
    v: SX
    G: SX | None
    gamma: SX

    def tree_acceleration(self, a: SX) -> SX:
        """(nv, 1) accelerations of the tree for the independent ones, (m, 1)."""
        return a if self.G is None else casadi.mtimes(self.G, a) + self.gamma

    def reduced_effort(self, tau: SX) -> SX:
        """(m, 1) efforts of the tree, (nv, 1), brought to the independent joints."""
        return tau if self.G is None else casadi.mtimes(self.G.T, tau)


def tree_motion(system: System, raw: SX, q: SX, v_a: SX) -> TreeMotion:
    """The motion of a tree whose loops the positions close.

    Args:
        system: open or closed.
        raw: (nq, 1) positions, quaternions as they are in the state.
        q: (nq, 1) positions on the loops; not used in an open chain.
        v_a: (m, 1) independent velocities.
    """
    if not system.is_closed:
        return TreeMotion(raw, normalised(system.tree, raw), v_a, v_a, None, SX.zeros(system.nv))
    symbols, speeds = SX.sym("q", system.nq), SX.sym("v", v_a.numel())
    reduced = reduction(system, symbols, speeds)
    assert reduced.gamma is not None
    G, gamma = casadi.substitute([reduced.G, reduced.gamma], [symbols, speeds], [q, v_a])
    v = casadi.densify(casadi.mtimes(G, v_a))
    return TreeMotion(raw, q, v_a, v, SX(G), SX(gamma))


def input_motions(motions: Sequence[InputMotion], u: SX) -> list[tuple[SX, SX, SX]]:
    """Position, velocity and acceleration of each, zero where they are no input."""
    found, first = [], 0
    for motion in motions:
        *place, a = casadi.vertsplit(u[first : first + motion.size])
        found.append((place[0], place[1], a) if place else (SX(0), SX(0), a))
        first += motion.size
    return found


def wrenches_of(system: System, q: SX, frames: Sequence[Frame], u: SX) -> dict[int, Wrench]:
    """For some links the wrench that they exert on what pushes them, about and in their frames.

    Args:
        system: open or closed.
        q: (nq, 1) positions.
        frames: on which the wrenches act.
        u: (6 k, 1) force and moment on each frame, about its origin, in axes of the base.
    """
    exerted: list[dict[int, Wrench]] = []
    for number, frame in enumerate(frames):
        link, pose = frame
        R = relative_pose(system.tree, q, BASE, frame).R
        first = 6 * number
        force, moment = u[first : first + 3], u[first + 3 : first + 6]
        f, m = carried(pose, (casadi.mtimes(R.T, force), casadi.mtimes(R.T, moment)))
        exerted.append({link: (-f, -m)})
    return summed(*exerted)


def load_of(system: System, q: SX, external: dict[int, Wrench]) -> SX:
    """(nv, 1) joint efforts that do what wrenches on links do.

    Args:
        system: open or closed.
        q: (nq, 1) positions.
        external: the wrenches that links exert, about and in their frames.
    """
    if not external:
        return SX.zeros(system.nv)
    return -wrench_efforts(system.tree, link_poses(system.tree, q), external)
