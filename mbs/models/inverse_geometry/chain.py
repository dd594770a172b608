"""Chain of joints from the base to a frame, for which the inverse geometric model is solved."""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import casadi
import numpy as np
from casadi import DM, SX
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.assembly.model_function import require_system
from mbs.assembly.tree import Link
from mbs.closed_forms.arm import Arm, arm_of, motion
from mbs.closed_forms.ring import PARAMETERS
from mbs.closed_forms.sequence import Problem
from mbs.components.joints import Motion
from mbs.errors import ModelError
from mbs.loops.pose import defect, pose_numbers, rounded, target_pose
from mbs.models.geometry import terminal_frame
from mbs.recursions.chain import Chain, Gap, Ring, tree_chain
from mbs.spatial import Pose
from mbs.text import did_you_mean, quoted

_SAMPLES, _SEED = 4, 20260105
"""Random configurations at which a property of the structure is examined: one shows it with
probability one, the others exclude a coincidence within rounding. Seed of the random numbers."""
_LARGEST = 6
"""Number of joints that a pose determines: the freedoms of a rigid body."""
_KEPT = 1024
"""Maximum number of cached chains and arms: one per position of locked joints."""


@dataclass(frozen=True, slots=True, eq=False)
class FrameChain:
    """Chain from the base of a system to a frame.

    Attributes:
        system: system of the chain.
        frame: name or link index of the frame at the end.
        chain: free joints with their indices in q, and the transforms between them as expressions
            of the parameters. The transforms include locked joints.
        locked: positions of locked joints on the path, by name [rad or m].
        varied: names of locked joints whose positions are symbols.
        symbols: (k, 1) symbolic positions of the varied joints [rad or m].
    """

    system: System
    frame: str | int
    chain: Chain
    locked: Mapping[str, float]
    varied: tuple[str, ...] = ()
    symbols: SX = field(default_factory=lambda: SX(0, 1))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the free joints, from the base on."""
        return tuple(joint.name for joint in self.chain.joints)

    @property
    def indices(self) -> tuple[int, ...]:
        """Indices of the free joints in q."""
        return tuple(joint.index for joint in self.chain.joints if joint.index is not None)

    @property
    def prismatic(self) -> tuple[bool, ...]:
        """Whether each free joint is prismatic."""
        return tuple(not joint.is_rotational for joint in self.chain.joints)

    @property
    def key(self) -> tuple[object, ...]:
        """Cache key of the chain within its system."""
        return self.frame, tuple(self.locked.items()), self.varied

    @property
    def varied_indices(self) -> tuple[int, ...]:
        """Indices in q of the varied joints."""
        starts = {link.name: link.q.start for link in self.system.tree.links}
        return tuple(starts[name] for name in self.varied)

    def arm(self, p: NDArray[np.float64]) -> Arm:
        """Return the numeric geometry of the chain for parameters p (np,), cached on the system."""
        key = (*self.key, p.tobytes())
        arm: Arm = self.system.memoised(
            "arm", key, lambda: arm_of(self.chain, self.system.p, p), _KEPT
        )
        return arm

    def gaps(self, p: NDArray[np.float64], r: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the transforms (N, n + 1, 4, 4) between joints at varied positions r (N, k)."""
        free = frame_chain(self.system, self.frame, self.locked, most=len(self.system.tree.links))
        arm = free.arm(p)
        gaps = [np.broadcast_to(arm.gaps[0], (len(r), 4, 4))]
        for k, name in enumerate(free.names):
            if name not in self.varied:
                gaps.append(np.broadcast_to(arm.gaps[k + 1], (len(r), 4, 4)))
                continue
            way = motion(r[:, self.varied.index(name)], bool(arm.prismatic[k]))
            gaps[-1] = gaps[-1] @ way @ arm.gaps[k + 1]
        return np.stack(gaps, axis=1)

    def locked_at(self, r: NDArray[np.float64]) -> FrameChain:
        """Return the chain with the varied joints locked at positions r (k,) [rad or m]."""
        values = dict(zip(self.varied, r.tolist(), strict=True))
        return frame_chain(self.system, self.frame, {**self.locked, **values})

    def at(self, p: NDArray[np.float64] | None = None) -> Chain:
        """Return the symbolic chain, with parameter values p (np,) substituted if given."""
        if p is None:
            return self.chain
        symbols, numbers = self.system.p, SX(DM(p))

        def substituted(matrix: SX) -> SX:
            return SX(casadi.substitute(matrix, symbols, numbers))

        poses = (Pose(substituted(pose.R), substituted(pose.p)) for pose in self.chain.between)
        return Chain(self.chain.joints, tuple(Gap(pose) for pose in poses))

    def problem(self, p: NDArray[np.float64] | None = None) -> Problem:
        """Return the loop equations of the chain that is closed by a symbolic target pose T.

        Args:
            p: (np,) parameter values; symbolic parameters if None.

        Returns:
            Problem. Its `given` contains the parameters if they are symbolic, the positions of the
            varied joints, and rows 1 to 3 of T, column by column.
        """
        n, symbols = len(self.names), self.system.p if p is None else SX(0, 1)
        symbols = casadi.vertcat(symbols, self.symbols)
        t = casadi.vertcat(*(SX.sym(f"T{r}{c}") for c in range(1, 5) for r in range(1, 4)))
        T = Pose(casadi.reshape(t[0:9], 3, 3), t[9:12])
        gaps = self.at(p).gaps
        back = gaps[n].then(T.inverse())
        joints = tuple(replace(joint, index=k) for k, joint in enumerate(self.chain.joints))
        closing = replace(
            gaps[0].after(back), back=gaps[0].pose.inverse() @ T @ gaps[n].pose.inverse()
        )
        ring = Ring(joints, (closing, *gaps[1:n]))
        sums = [SX.sym(f"x{k + 1}") for k in range(n)]
        x = casadi.vertcat(*(SX.sym(name) for name in self.names), *sums)
        return Problem(ring, x, casadi.vertcat(symbols, t), self._samples(p))

    def _samples(
        self, p: NDArray[np.float64] | None
    ) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
        rng = np.random.default_rng(_SEED)
        samples = []
        for _ in range(_SAMPLES):
            own = rng.uniform(*PARAMETERS, self.system.p.numel()) if p is None else p
            # prismatic positions of about 1 m and never near zero, where axes could intersect
            q = np.where(self.prismatic, rng.uniform(0.2, 1.2, len(self.names)), 0.0)
            turns = rng.uniform(-np.pi, np.pi, len(self.names))
            q = np.where(self.prismatic, q, turns)
            # the range is suitable for varied revolute and prismatic joints
            r = rng.uniform(0.2, 1.2, len(self.varied))
            symbols = casadi.vertcat(self.system.p, self.symbols)
            plain = p is not None and not self.varied
            arm = self.arm(own) if plain else arm_of(self.chain, symbols, np.append(own, r))
            T = arm.pose(q)[:3].ravel(order="F")
            samples.append((q, np.concatenate([own if p is None else np.zeros(0), r, T])))
        return samples


def frame_chain(
    system: System,
    frame: str | int | None = None,
    locked: Mapping[str, float] | None = None,
    varied: tuple[str, ...] = (),
    most: int = _LARGEST,
) -> FrameChain:
    """Return the chain of joints from the base to a frame, cached on the system.

    Args:
        system: open or closed system; of a closed system the joints of the tree are used.
        frame: name of a body or frame, index of a link, or None for the terminal frame.
        locked: positions of fixed joints, by name [rad or m].
        varied: names of joints that are locked at symbolic positions.
        most: maximum number of free joints.

    Raises:
        ModelError: the frame or a joint is unknown, a joint of the chain is spherical or free, or
            no joint or more than `most` joints are free.
    """
    require_system(system)
    name = _terminal_frame(system) if frame is None else frame
    number = system.frame(name)[0]
    links = [system.tree.links[k] for k in system.tree.path(number)]
    locked_positions = _locked(system, links, locked)
    _require_on_path(system, links, varied, "redundant")
    _require_few(system, name, links, (*locked_positions, *varied), most)
    key = (name, tuple(locked_positions.items()), varied)
    found: FrameChain = system.memoised(
        "chain", key, lambda: _frame_chain(system, name, links, locked_positions, varied), _KEPT
    )
    return found


def _terminal_frame(system: System) -> str | int:
    name: str | int = system.cached("terminal frame", lambda: terminal_frame(system))
    return name


def _frame_chain(
    system: System,
    name: str | int,
    links: list[Link],
    locked_positions: Mapping[str, float],
    varied: tuple[str, ...],
) -> FrameChain:
    starts = {link.name: link.q.start for link in links}
    known = [starts[link] for link in starts if link in locked_positions or link in varied]
    q = SX(DM(system.position(locked_positions)))
    symbols = SX(casadi.vertcat(*(SX.sym(other) for other in varied)))
    q[[starts[other] for other in varied]] = symbols
    chain = tree_chain(system.tree, system.frame("base"), system.frame(name), known, q)
    poses = (Gap(gap.pose) for gap in chain.gaps)  # drop the pivots of locked joints
    chain = replace(chain, gaps=tuple(poses))
    return FrameChain(system, name, chain, locked_positions, varied, symbols)


def _locked(system: System, links: list[Link], given: object) -> dict[str, float]:
    """Return the positions of the locked joints by name, in order from the base on."""
    if given is None:
        return {}
    if not isinstance(given, Mapping):
        raise ModelError(
            f"{system.name}: locked is {quoted(given)}; give a dict of joint names to positions"
        )
    _require_on_path(system, links, given, "locked")
    positions = system.position(given)
    return {link.name: positions[link.q.start] for link in links if link.name in given}


def _require_on_path(system: System, links: list[Link], given: Iterable[str], what: str) -> None:
    names = [link.name for link in links]
    for name in given:
        if name not in names:
            raise ModelError(
                f"{system.name}: joint {quoted(name)} is not between the base and the frame, so"
                f" that it cannot be {what}; {did_you_mean(name, names)}"
            )


def _require_simple(system: System, link: Link) -> None:
    if link.motion not in (Motion.REVOLUTE, Motion.PRISMATIC):
        raise ModelError(
            f"{system.name}: joint {link.name} of the chain is {link.motion.name.lower()}; the"
            " inverse geometric model knows revolute and prismatic joints, use"
            " mbs.loops.solve_pose"
        )


def _require_few(
    system: System, frame: str | int, links: list[Link], locked: Container[str], most: int
) -> None:
    for link in links:
        _require_simple(system, link)
    free = [link for link in links if link.name not in locked]
    if not links:
        raise ModelError(f"{system.name}: no joint moves frame {frame!r}; name another frame")
    if not free:
        raise ModelError(
            f"{system.name}: every joint between the base and frame {frame!r} is locked; leave one"
            " of them free"
        )
    if len(free) > most:
        surplus = len(free) - _LARGEST
        chosen = _proposal(free, surplus)
        at = ", ".join(
            f"{link.name!r}: {system.configuration[link.q.start]:.6g}" for link in chosen
        )
        among = ", ".join(f"{link.name!r}: {_PROPOSED}" for link in chosen)
        raise ModelError(
            f"{system.name}: {len(free)} joints are free between the base and frame {frame!r},"
            f" and a pose determines {_LARGEST}; lock {surplus} of them with locked={{{at}}}, or"
            f" ask for many positions of them with redundant={{{among}}}"
        )


_PROPOSED = 64
"""Number of positions of a redundant joint that an error message proposes: one per 5.6 degrees."""


def _proposal(free: list[Link], surplus: int) -> list[Link]:
    """Return `surplus` joints before the middle of the chain.

    An arm of seven joints keeps its elbow as a free joint; otherwise its reach would be constant.
    """
    first = (len(free) - surplus - 1) // 2
    return free[first : first + surplus]


# Validation of poses from the user.


__all__ = ["target_pose", "target_poses"]


def target_poses(system: System, T: Any) -> NDArray[np.float64]:
    """Convert target poses to an array with exactly orthonormal orientations.

    Args:
        system: system that is named in error messages.
        T: (N, 4, 4) homogeneous transforms [m], as one array or a sequence of poses. Each is
            projected to the nearest rigid transform as in `target_pose`.

    Returns:
        Poses (N, 4, 4).

    Raises:
        ModelError: a matrix is no rigid transform; the message gives its index, counted from 0.
    """
    matrices = _stack(system, T)
    if matrices is None or matrices.ndim != 3 or matrices.shape[1:] != (4, 4):
        shape = "" if matrices is None else f" of shape {matrices.shape}"
        raise ModelError(f"{system.name}: the poses are {quoted(T)}{shape}; give them as (N, 4, 4)")
    poses, good = rounded(matrices)
    if not np.all(good):
        number = int(np.argmin(good))
        raise ModelError(
            f"{_title(system, number, len(good))} {defect(matrices[number])}; give rigid"
            " transforms, orthonormal and right-handed"
        )
    return poses


def _stack(system: System, T: Any) -> NDArray[np.float64] | None:
    """Convert to an array of any shape; None if an element is not a number."""
    if not isinstance(T, list | tuple):
        return pose_numbers(T)
    parts = list[NDArray[np.float64]]()
    for number, part in enumerate(T):
        matrix = pose_numbers(part)
        if matrix is None or matrix.shape != (4, 4):
            raise ModelError(
                f"{_title(system, number, len(T))} it is {quoted(part)}; give (4, 4) numbers"
            )
        parts.append(matrix)
    return np.array(parts).reshape(-1, 4, 4)


def _title(system: System, number: int, count: int) -> str:
    return f"{system.name}: pose {number} of {count}, counted from 0:"
