"""Random states of a mechanism, those of a closed one on the branch of its assembled posture."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from casadi import Function
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.assembly.rates import quaternion_slices
from mbs.errors import ModelError
from mbs.loops.closing import Closing
from mbs.loops.examine import examine
from mbs.loops.reduction import reduction_matrix

Array = NDArray[np.float64]

_STEP, _STEPS = 0.1, 8
"""Of the fastest joint [rad or m], and how many steps lie between two states."""
_POSTURES = 40
"""Closed postures; more states repeat them with other velocities."""
_LEAST_LEAD = 0.02
"""Below this a posture is so near to a singular one that the walk could change its branch."""


@dataclass(frozen=True, slots=True, eq=False)
class States:
    """Positions, independent velocities and accelerations, one state a column.

    Attributes:
        q: (nq, states).
        v, a: (m, states).
        base: v_0 and a_0, (6, states) each, and R_0, (3, 3 states), of a base that moves.
    """

    q: Array
    v: Array
    a: Array
    base: tuple[Array, Array, Array] | None = None

    @property
    def count(self) -> int:
        """Number of states."""
        return int(self.q.shape[1])

    def on_moving_base(self, seed: int) -> States:
        """The same while the base moves anyhow."""
        rng = np.random.default_rng(seed)
        v_0, a_0 = rng.uniform(-3, 3, (6, self.count)), rng.uniform(-5, 5, (6, self.count))
        turns = np.linalg.qr(rng.standard_normal((self.count, 3, 3)))[0]
        turns *= np.sign(np.linalg.det(turns))[:, None, None]
        return replace(self, base=(v_0, a_0, np.hstack(list(turns))))


def random_states(system: System, p: Array, count: int, seed: int) -> States:
    """States that show every parameter that has an effect.

    Args:
        system: open or closed.
        p: (np,) its parameters.
        count: number of states.
        seed: of the random numbers.

    Raises:
        ModelError: a closed mechanism cannot leave its assembled posture.
    """
    m, rng = len(system.active), np.random.default_rng(seed)
    if system.is_closed:
        postures = closed_positions(system, p, _POSTURES, seed)
        q = postures[:, np.arange(count) % postures.shape[1]]
    else:
        q = _any(system, count, rng)
    return States(q, rng.uniform(-2, 2, (m, count)), rng.uniform(-3, 3, (m, count)))


def _any(system: System, count: int, rng: np.random.Generator) -> Array:
    scale = np.array([np.pi if c.unit == "rad" else 1.0 for c in system.coordinates])
    q = scale[:, None] * rng.uniform(-1, 1, (system.nq, count))
    return _normalised(system, q)


def closed_positions(system: System, p: Array, count: int, seed: int) -> Array:
    """(nq, count) closed postures, met on a random walk from the assembled one.

    Steps are small and each is closed again, so that the walk stays on its branch; where the
    independent joints hardly lead the others it turns back. The system keeps them.

    Args:
        system: closed.
        p: (np,) its parameters.
        count: number of postures.
        seed: of the random numbers.

    Raises:
        ModelError: the loops cannot be closed at these parameters.
    """

    def walked() -> Array:
        walk, rng = _PostureWalk.of(system, p), np.random.default_rng(seed)
        q, postures = walk.start, list[Array]()
        for _ in range(count):
            q = walk.moved(q, rng)
            postures.append(q)
        return np.array(postures).T

    positions: Array = system.cached(("closed_positions", p.tobytes(), count, seed), walked)
    return positions


@dataclass(frozen=True, slots=True, eq=False)
class _PostureWalk:
    """What a walk on closed postures needs."""

    system: System
    closing: Closing
    G: Function
    values: dict[str, float]
    start: Array
    least: float

    @staticmethod
    def of(system: System, p: Array) -> _PostureWalk:
        """From the assembled posture, closed again for these parameters."""
        closing = Closing(system, p)
        found = closing.nearest(np.array(system.posture))
        if not found.is_closed:
            raise ModelError(
                f"{system.name}: the loops cannot be closed near the assembled posture; give the"
                " symbols of the lengths values that the assembly can use"
            )
        names = [parameter.name for parameter in system.parameters]
        values = dict(zip(names, p.tolist(), strict=True))
        leads = examine(system, found.q.tolist(), parameters=values).leads
        G = Function(reduction_matrix(system))
        return _PostureWalk(system, closing, G, values, found.q, min(_LEAST_LEAD, leads / 4))

    def moved(self, q: Array, rng: np.random.Generator) -> Array:
        """The posture after some steps in one direction, or back in the other."""
        direction = rng.uniform(-1, 1, len(self.system.active))
        for _ in range(_STEPS):
            following = self._step(q, direction)
            if following is None:
                direction = -rng.uniform(0, 1, direction.shape) * direction
            else:
                q = following
        return q

    def _step(self, q: Array, direction: Array) -> Array | None:
        p = self.closing.p
        arguments = (q, p) if p.size else (q,)
        G = np.array(self.G(*arguments))
        rate = np.array(self.system.qdot(q, G @ direction)).ravel()
        ahead = q + rate * (_STEP / max(float(np.max(np.abs(rate))), 1e-9))
        found = self.closing.nearest(ahead)
        if not found.is_closed or np.max(np.abs(found.q - ahead)) > _STEP:
            return None
        state = examine(self.system, found.q.tolist(), parameters=self.values)
        return found.q if state.leads > self.least else None


def _normalised(system: System, q: Array) -> Array:
    for part in quaternion_slices(system.tree):
        q[part] /= np.linalg.norm(q[part], axis=0)
    return q
