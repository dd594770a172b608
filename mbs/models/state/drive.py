"""Additional inputs and control laws of the state equation of the independent joints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import casadi
from casadi import SX, Function

from mbs.assembly import System
from mbs.assembly.tree import Frame, normalised
from mbs.errors import ModelError
from mbs.loops.balance import require_no_balance
from mbs.loops.reduction import reduction
from mbs.models._direct_dynamics import hybrid_dynamics
from mbs.models.contacts import contacts_of, require_undriven
from mbs.recursions.force_elements import sum_wrenches, wrench_efforts
from mbs.recursions.link_motions import link_poses
from mbs.recursions.route import BASE, relative_pose
from mbs.spatial import Wrench, transform_wrench
from mbs.text import did_you_mean, quoted

Kind = Literal["q", "a"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DriveInputs:
    """Additional inputs of a state equation, and control laws that replace inputs.

    Attributes:
        wrenches: frames (arguments of `System.frame`) on which an input wrench acts.
        motions: pairs of a velocity name and its input: "a" for the acceleration, or "q" for
            position, velocity and acceleration, so that the joint has no states.
        effort: `effort(t, q, v, w, p) -> tau`, (nv, 1) joint efforts that replace the motor inputs
            and are added to the efforts of components. q and v are positions and velocities of the
            tree, w (nw, 1) further inputs, p parameters of the system.
        device: `device(t, q, v, w, p) -> u`, values that replace the inputs of components.
    """

    wrenches: tuple[str | int, ...] = ()
    motions: tuple[tuple[str, Kind], ...] = ()
    effort: Function | None = None
    device: Function | None = None


@dataclass(frozen=True, slots=True)
class InputMotion:
    """Joint whose motion is an input.

    Attributes:
        velocity: index in v of its velocity.
        position: index in q of its position if the position is an input too, None if it is a state.
    """

    velocity: int
    position: int | None

    @property
    def kind(self) -> Kind:
        """Kind of input: "a" for the acceleration, "q" for position, velocity and acceleration."""
        return "a" if self.position is None else "q"

    @property
    def size(self) -> int:
        """Number of inputs: 1 or 3."""
        return 1 if self.position is None else 3


def frames_of(system: System, drive: DriveInputs) -> tuple[Frame, ...]:
    """Return the link index and pose of each frame with an input wrench.

    Raises:
        ModelError: a frame is unknown, is named twice, or is fixed to the base.
    """
    _require_once(system, "wrenches", drive.wrenches)
    frames = tuple(system.frame(name) for name in drive.wrenches)
    for name, (link, _) in zip(drive.wrenches, frames, strict=True):
        require_no_balance(system, f"the wrench on {name}", links=[link])
        if link < 0:
            raise ModelError(
                f"{system.name}: frame {quoted(name)} is fixed to the base, where a wrench moves"
                " nothing; name a frame of a moving body"
            )
    return frames


def motions_of(system: System, drive: DriveInputs) -> tuple[InputMotion, ...]:
    """Return the joints whose motions are inputs.

    Raises:
        ModelError: a name is unknown, is repeated or belongs to no independent joint, a position is
            requested in a closed system or of a quaternion joint, or a contact acts on the joint.
    """
    names = [name for name, _ in drive.motions]
    _require_once(system, "motions", names)
    found = tuple(_motion(system, name, kind) for name, kind in drive.motions)
    if found:
        hybrid_dynamics(system, names)  # raises if the loops couple the prescribed motions
    require_undriven(system, contacts_of(system), [motion.velocity for motion in found])
    return found


def _motion(system: System, name: str, kind: str) -> InputMotion:
    speeds = [speed.name for speed in system.velocity_coordinates]
    independent = [speeds[k] for k in system.independent]
    positions = [coordinate.name for coordinate in system.coordinates]
    if kind not in get_args(Kind):
        raise ModelError(
            f"{system.name}: the motion of {quoted(name)} is given by {quoted(kind)}; use 'q' for"
            " its position or 'a' for its acceleration"
        )
    if name not in independent:
        raise ModelError(
            f"{system.name}: {quoted(name)} is no independent joint, so its motion is no input;"
            f" {did_you_mean(str(name), independent)}"
        )
    if kind == "a":
        return InputMotion(speeds.index(name), None)
    if system.is_closed:
        raise ModelError(
            f"{system.name}: the position of {name} would be an input, on which the loops depend;"
            f" prescribe its acceleration {name}.a"
        )
    if name not in positions:
        raise ModelError(
            f"{system.name}: {name} is a velocity of a quaternion joint and no position stands for"
            f" it; prescribe its acceleration {name}.a"
        )
    return InputMotion(speeds.index(name), positions.index(name))


def further_inputs(system: System, drive: DriveInputs) -> int:
    """Return the number of inputs w of the laws of a drive.

    Raises:
        ModelError: a law has wrong inputs or outputs, or the laws have different sizes of w.
    """
    counts = [
        _further(system, name, law, size)
        for name, law, size in (
            ("effort", drive.effort, system.nv),
            ("device", drive.device, system.u.numel()),
        )
        if law is not None
    ]
    if len(set(counts)) > 1:
        raise ModelError(
            f"{system.name}: effort takes {counts[0]} further inputs w and device {counts[1]}; give"
            " both the same w"
        )
    return counts[0] if counts else 0


def _further(system: System, name: str, law: object, size: int) -> int:
    if not isinstance(law, Function):
        raise ModelError(
            f"{system.name}: {name} is {quoted(law)}; give a casadi.Function of (t, q, v, w, p)"
        )
    expected = [1, system.nq, system.nv, len(system.parameters)]
    found = [law.numel_in(k) for k in range(law.n_in())]
    if law.n_in() != 5 or [*found[:3], found[4]] != expected or law.n_out() != 1:
        raise ModelError(
            f"{system.name}: {name} has inputs of sizes {found} and {law.n_out()} outputs; give a"
            f" Function of (t, q, v, w, p) with {expected[1]} positions, {expected[2]} velocities"
            f" and {expected[3]} parameters, and one output"
        )
    if law.numel_out(0) != size:
        raise ModelError(
            f"{system.name}: {name} returns {law.numel_out(0)} values; return {size}, one for each"
            f" {'velocity' if name == 'effort' else 'device'}"
        )
    return int(found[3])


def _require_once(system: System, what: str, names: Sequence[object]) -> None:
    for name in names:
        if list(names).count(name) > 1:
            raise ModelError(
                f"{system.name}: {what} name {quoted(name)} twice; give each frame or joint once"
            )


# Motion of the tree from states and inputs of the independent joints.


@dataclass(frozen=True, slots=True, eq=False)
class TreeMotion:
    """Positions and velocities of the tree.

    Attributes:
        raw: (nq, 1) positions with the quaternions of the state.
        q: (nq, 1) positions that close the loops, with unit quaternions.
        v_a: (m, 1) independent velocities.
        v: (nv, 1) velocities of the tree.
        G: (nv, m) reduction matrix dv/dv_a; None for an open chain, where v is v_a.
        gamma: (nv, 1) bias acceleration in a = G a_a + gamma.
    """

    raw: SX
    q: SX
    v_a: SX
    v: SX
    G: SX | None
    gamma: SX

    def tree_acceleration(self, a: SX) -> SX:
        """Return the accelerations (nv, 1) of the tree for independent accelerations a (m, 1)."""
        return a if self.G is None else casadi.mtimes(self.G, a) + self.gamma

    def reduced_effort(self, tau: SX) -> SX:
        """Return the efforts (m, 1) of the independent joints equivalent to tau (nv, 1)."""
        return tau if self.G is None else casadi.mtimes(self.G.T, tau)


def tree_motion(system: System, raw: SX, q: SX, v_a: SX) -> TreeMotion:
    """Return the motion of a tree for positions that close the loops.

    Args:
        system: open or closed system.
        raw: (nq, 1) positions with the quaternions of the state.
        q: (nq, 1) positions that close the loops; not used for an open chain.
        v_a: (m, 1) independent velocities.
    """
    if not system.is_closed:
        return TreeMotion(raw, normalised(system.tree, raw), v_a, v_a, None, SX.zeros(system.nv))
    symbols, speeds = SX.sym("q", system.nq), SX.sym("v", v_a.numel())
    reduced = reduction(system, symbols, speeds)
    assert reduced.gamma is not None
    parts = [reduced.G, reduced.gamma, reduced.velocities(speeds)]
    G, gamma, v = casadi.substitute(parts, [symbols, speeds], [q, v_a])
    return TreeMotion(raw, q, v_a, SX(v), SX(G), SX(gamma))


def input_motions(motions: Sequence[InputMotion], u: SX) -> list[tuple[SX, SX, SX]]:
    """Return position, velocity and acceleration of each input motion; zero if not an input."""
    found, first = [], 0
    for motion in motions:
        *place, a = casadi.vertsplit(u[first : first + motion.size])
        found.append((place[0], place[1], a) if place else (SX(0), SX(0), a))
        first += motion.size
    return found


def wrenches_of(system: System, q: SX, frames: Sequence[Frame], u: SX) -> dict[int, Wrench]:
    """Return the wrenches that links exert against input wrenches, by link index.

    Each wrench is the reaction to the inputs, about the origin and in axes of the link frame.

    Args:
        system: open or closed system.
        q: (nq, 1) positions.
        frames: k frames on which the input wrenches act.
        u: (6 k, 1) force and moment on each frame, about its origin, in axes of the base.
    """
    exerted: list[dict[int, Wrench]] = []
    for number, frame in enumerate(frames):
        link, pose = frame
        R = relative_pose(system.tree, q, BASE, frame).R
        first = 6 * number
        force, moment = u[first : first + 3], u[first + 3 : first + 6]
        f, m = transform_wrench(pose, (casadi.mtimes(R.T, force), casadi.mtimes(R.T, moment)))
        exerted.append({link: (-f, -m)})
    return sum_wrenches(*exerted)


def load_of(system: System, q: SX, external: dict[int, Wrench]) -> SX:
    """Return the joint efforts (nv, 1) equivalent to external wrenches on links.

    Args:
        system: open or closed system.
        q: (nq, 1) positions.
        external: wrenches that links exert (reactions), from `wrenches_of`.
    """
    if not external:
        return SX.zeros(system.nv)
    return -wrench_efforts(system.tree, link_poses(system.tree, q), external)
