"""What drives the state equation of the independent joints, as a caller wires it."""

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
from mbs.models.contacts import contacts_of, require_undriven
from mbs.models.direct_dynamics import hybrid_dynamics
from mbs.recursions.force_elements import sum_wrenches, wrench_efforts
from mbs.recursions.poses import link_poses
from mbs.recursions.route import BASE, relative_pose
from mbs.spatial import Wrench, transform_wrench
from mbs.text import did_you_mean, quoted

Kind = Literal["q", "a"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DriveInputs:
    """Inputs of a state equation beside the efforts of motors, and laws in place of them.

    Attributes:
        wrenches: frames, as for `System.frame`, on each of which a wrench acts that is an input.
        motions: velocities by name and what of them is an input: "a", the acceleration, or "q",
            position, velocity and acceleration, so that the joint has no states.
        effort: `effort(t, q, v, w, p) -> tau` of all joints, (nv, 1), in place of the inputs of
            motors and beside what devices deliver; q and v are those of the tree, w (nw, 1) are
            further inputs, p the parameters of the system.
        device: `device(t, q, v, w, p) -> u`, the inputs of the devices in place of theirs.
    """

    wrenches: tuple[str | int, ...] = ()
    motions: tuple[tuple[str, Kind], ...] = ()
    effort: Function | None = None
    device: Function | None = None


@dataclass(frozen=True, slots=True)
class InputMotion:
    """A joint whose motion is an input.

    Attributes:
        velocity: its index in v.
        position: index in q where the position is an input too, None where it is a state.
    """

    velocity: int
    position: int | None

    @property
    def kind(self) -> Kind:
        """What of it is an input."""
        return "a" if self.position is None else "q"

    @property
    def size(self) -> int:
        """How many inputs it takes."""
        return 1 if self.position is None else 3


def frames_of(system: System, drive: DriveInputs) -> tuple[Frame, ...]:
    """Link and pose of every frame on which a wrench acts.

    Raises:
        ModelError: there is no such frame, it comes twice, or it is fixed to the base.
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
    """The joints whose motions are inputs.

    Raises:
        ModelError: a name is unknown, comes twice or belongs to no independent joint, a position
            is asked for in a closed system or of a quaternion joint, or a contact acts there.
    """
    names = [name for name, _ in drive.motions]
    _require_once(system, "motions", names)
    found = tuple(_motion(system, name, kind) for name, kind in drive.motions)
    if found:
        hybrid_dynamics(system, names)  # refuses what the loops tie
    require_undriven(system, contacts_of(system), [motion.velocity for motion in found])
    return found


def _motion(system: System, name: str, kind: str) -> InputMotion:
    speeds = [speed.name for speed in system.speeds]
    independent = [speeds[k] for k in system.active]
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
    """How many inputs w the laws of a drive take.

    Raises:
        ModelError: a law has other inputs or outputs than it needs, or the two differ in w.
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


# The motion of the tree from the states and inputs of the independent joints.


@dataclass(frozen=True, slots=True, eq=False)
class TreeMotion:
    """Positions and velocities of the tree.

    Attributes:
        raw: (nq, 1) positions, quaternions as they are in the state.
        q: (nq, 1) the same on the loops, quaternions of unit length.
        v_a: (m, 1) independent velocities.
        v: (nv, 1) velocities of the tree.
        G: (nv, m), the slopes of v; None in an open chain, where v is v_a.
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
    parts = [reduced.G, reduced.gamma, reduced.velocities(speeds)]
    G, gamma, v = casadi.substitute(parts, [symbols, speeds], [q, v_a])
    return TreeMotion(raw, q, v_a, SX(v), SX(G), SX(gamma))


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
        f, m = transform_wrench(pose, (casadi.mtimes(R.T, force), casadi.mtimes(R.T, moment)))
        exerted.append({link: (-f, -m)})
    return sum_wrenches(*exerted)


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
