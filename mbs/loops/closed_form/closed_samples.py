"""Numbers at which a loop closes, from random starts: known positions move with the unknown ones.

What holds at all of them holds by structure, as in `survey`; here of loops that do not close for
every value of what is known.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi
import numpy as np
from casadi import SX, Function
from numpy.typing import NDArray

from mbs.loops.closed_form.ring import Ring
from mbs.solvers.gauss_newton import gauss_newton
from mbs.solvers.rank import rank
from mbs.spatial import Pose, axis_turn, vector

Vector = NDArray[np.float64]

_SAMPLES, _TRIES, _SEED = 4, 24, 20260107
_ITERATIONS = 40
_MOVABLE = 2
_LOOSE = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class Sample:
    """A posture that closes a loop.

    Attributes:
        x: (n,) positions of its joints, in their order.
        given: (m,) values of the symbols in its gaps.
        rank: of the derivative of the closure by x; below n, joints move while the given stay.
    """

    x: Vector
    given: Vector
    rank: int


def closure_of(ring: Ring, x: SX) -> SX:
    """(12, 1) what is missing in X_1 J_1 .. X_n J_n = 1 at positions x (n, 1) [m or 1]."""
    T = Pose.identity()
    for k, (joint, gap) in enumerate(zip(ring.joints, ring.gaps, strict=True)):
        moved = joint.sign * x[k]
        turn = Pose.turned(axis_turn("z", moved).matrix)
        T = T @ gap.pose @ (turn if joint.turns else Pose.moved(vector([0, 0, moved])))
    return SX(casadi.densify(casadi.vertcat(casadi.vec(T.R - SX.eye(3)), T.p)))


def closed_samples(ring: Ring, given: SX, p: SX) -> list[Sample]:
    """Some closed postures: four, or fewer where random starts lead to no more.

    It ends early where joints move at two of them while the given stay.

    Args:
        ring: a loop of turns and slides.
        given: (m, 1) the symbols of its gaps.
        p: those of them that are parameters keep their random values, the others may move.
    """
    n, rng = len(ring.joints), np.random.default_rng(_SEED)
    parameters = {symbol.name() for symbol in casadi.symvar(p)}
    names = [symbol.name() for symbol in casadi.vertsplit(given)] if given.numel() else []
    held = np.array([False] * n + [name in parameters for name in names])
    x = SX.sym("x", n)
    every = casadi.vertcat(x, given)
    r = closure_of(ring, x)
    function = Function("closure", [every], [r, casadi.densify(casadi.jacobian(r, every))])
    samples = list[Sample]()
    for _ in range(_TRIES):
        start = np.where(held, rng.uniform(0.4, 1.6, held.size), rng.uniform(-1.5, 1.5, held.size))
        closed = _closed(function, start, held)
        if closed is not None:
            J = np.array(function(closed)[1])[:, :n]
            samples.append(Sample(closed[:n], closed[n:], rank(J, _LOOSE)))
        movable = sum(sample.rank < n for sample in samples)
        if len(samples) == _SAMPLES or movable == _MOVABLE:
            break
    return samples


def _closed(function: Function, start: Vector, held: NDArray[np.bool_]) -> Vector | None:
    def residual(free: Vector) -> tuple[Vector, Vector]:
        whole = start.copy()
        whole[~held] = free
        r, J = (np.array(value) for value in function(whole))
        return r.ravel(), J[:, ~held]

    root = gauss_newton(residual, start[~held], iterations=_ITERATIONS)
    if not root.converged:
        return None
    whole = start.copy()
    whole[~held] = root.x
    return whole
