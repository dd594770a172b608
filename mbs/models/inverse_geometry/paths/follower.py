"""What follows a path: the joints of a chain, or those of a whole robot with its loops."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.errors import ModelError
from mbs.loops.closed_form.known import held_beside, regular_posture
from mbs.loops.closed_form.places import spin_places
from mbs.loops.goal import Goal
from mbs.messages import did_you_mean, quoted
from mbs.models.inverse_geometry.answers.limits import CoordinateLimits, Given, bounds
from mbs.models.inverse_geometry.arm import Arm, gap_to
from mbs.models.inverse_geometry.chain import chain
from mbs.models.inverse_geometry.paths.tracking import Rows, Tracker
from mbs.solvers.rank import null_space

Array = NDArray[np.float64]
_WHOLE = 6
_ON_LIMIT = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class Follower:
    """The joints that follow, and what they are held against.

    Attributes:
        wanted: the frame, and the loops.
        places: numbers in q of the joints that move.
        scale: (n,) what one stands for in each [m]; 1 for angles.
        rows: what is missing to a pose, and how the joints change it.
        slack: directions that no row sees.
        exact: whether any pose nearby can be taken.
        bounds: limits of the coordinates; None where none holds them.
    """

    wanted: Goal
    places: tuple[int, ...]
    scale: Array
    rows: Rows
    slack: int
    exact: bool
    bounds: CoordinateLimits | None

    @property
    def system(self) -> System:
        """Whose joints they are."""
        return self.wanted.closing.system

    @property
    def tracker(self) -> Tracker:
        """The numbers of it."""
        return Tracker(self.rows, self.slack, self.exact, self._may)

    def scaled(self, q: Array) -> Array:
        """(n,) the joints that move in a posture (nq,)."""
        x: Array = q[list(self.places)] / self.scale
        return x

    def whole(self, q: Array, x: Array) -> Array:
        """(nq,) the posture q with the joints that move elsewhere."""
        whole = q.copy()
        whole[list(self.places)] = x * self.scale
        return whole

    def pose(self, q: Array) -> Array:
        """(4, 4) of the frame in a posture (nq,)."""
        elements = self.wanted.pose(q)[0]
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = elements[3:].reshape(3, 3).T, elements[:3]
        return T

    def residual(self, q: Array, T: Array) -> float:
        """Largest element by which a posture misses a pose, or row by which a loop is open."""
        return float(np.max(np.abs(self.wanted.at(T).residual(q)[0])))

    def passed(self, x: Array, slack: float = 0.0) -> tuple[int, float] | None:
        """A joint, by its number in q, that comes within `slack` of its limit, and this limit."""
        if self.bounds is None:
            return None
        for place, value in zip(self.places, x * self.scale, strict=True):
            low, high = float(self.bounds.low[place]), float(self.bounds.high[place])
            if value > high - slack:
                return place, high
            if value < low + slack:
                return place, low
        return None

    def _may(self, x: Array) -> bool:
        return self.passed(x, -_ON_LIMIT) is None


def follower(
    wanted: Goal,
    start: Array,
    locked: Mapping[str, float] | None,
    limits: bool | Given | None,
) -> Follower:
    """What follows the poses of a frame.

    Args:
        wanted: the frame, and the loops.
        start: (nq,) posture, in which joints that do not follow stay.
        locked: by name, joints that stay where they are.
        limits: as in `follow`.

    Raises:
        ModelError: a name is unknown, or the chain has more than six free joints.
    """
    system, frame = wanted.closing.system, wanted.frame
    ends = None if limits is False else bounds(system, limits)
    path = system.tree.path(system.frame(frame)[0])
    simple = all(system.tree.links[k].motion.nq == 1 for k in path)
    if simple and not system.is_closed:
        found = chain(system, frame, locked)
        arm = found.arm(wanted.closing.p)
        scale = arm.units
        exact = arm.size == _WHOLE
        return Follower(wanted, found.places, scale, _arm_rows(arm, scale), 0, exact, ends)
    return _closed_follower(wanted, start, list(locked or {}), ends)


def _closed_follower(
    wanted: Goal, start: Array, locked: list[str], ends: CoordinateLimits | None
) -> Follower:
    """Every joint of the system, less those that stay where they are."""
    system = wanted.closing.system
    places = {link.name: link.q.start for link in system.tree.links if link.motion.nq == 1}
    for name in locked:
        if name not in places:
            raise ModelError(
                f"{system.name}: joint {quoted(name)} cannot be locked;"
                f" {did_you_mean(name, places)}"
            )
    q = regular_posture(system)
    stays = tuple(places[name] for name in locked)
    still = null_space(np.vstack([wanted.residual(q)[1], np.eye(system.nq)[list(stays)]]))
    held = {*stays, *held_beside(system, still, ())}
    moving = tuple(k for k in range(system.nq) if k not in held)
    slack = len(spin_places(system))
    free = null_space(wanted.closing.rows(q)[1][:, moving]).shape[1] - slack

    def rows(x: Array, T: Array) -> tuple[Array, Array]:
        at = start.copy()
        at[list(moving)] = x
        r, J = wanted.at(T).residual(at)
        return -r, J[:, moving]

    return Follower(wanted, moving, np.ones(len(moving)), rows, slack, free == _WHOLE, ends)


def _arm_rows(arm: Arm, scale: Array) -> Rows:
    lengths = np.array([arm.length] * 3 + [1.0] * 3)

    def rows(x: Array, T: Array) -> tuple[Array, Array]:
        pose, J = arm.pose_and_jacobian(x * scale)
        return gap_to(T, pose) / lengths, J * scale / lengths[:, None]

    return rows
