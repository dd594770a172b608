"""Postures that close the loops: from guesses, by Gauss-Newton on all rows, with restarts."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import casadi
import numpy as np
from casadi import SX, Function
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.assembly.rates import quaternion_slices
from mbs.errors import LoopError, ModelError, Unclosable
from mbs.loops.closure import closure_rows, facing, labelled_rows
from mbs.solvers.gauss_newton import Root, gauss_newton

Vector = NDArray[np.float64]

TOLERANCE = 1e-12
_RESTARTS = 60
_SEED = 20260101
_LARGEST_ANGLE = np.pi


def solve(
    system: System,
    q_active: Mapping[str, float] | Sequence[float] | None = None,
    *,
    guess: Mapping[str, float] | None = None,
    parameters: Mapping[str, float] | None = None,
) -> Vector:
    """A posture with the given independent positions that closes the loops.

    Args:
        system: the assembled mechanism.
        q_active: positions of the independent joints by name, or in the order of
            `system.active`; those left out stay as in the assembled posture.
        guess: approximate positions of other joints, which choose the branch.
        parameters: values of symbols, the others at their defaults.

    Returns:
        q (nq,) [rad or m].

    Raises:
        Unclosable: no posture was found; the message says by how much the loops stay open.
        ModelError: a name is unknown.
    """
    names = [system.speeds[k].name for k in system.active]
    fixed = _fixed(system, names, q_active)
    p = system.parameter_values(parameters)
    held = np.array(system.position(fixed))
    start = np.array(system.position({**(guess or {}), **fixed}))
    order = [coordinate.name for coordinate in system.coordinates]
    keep = [order.index(name) for name in {**dict.fromkeys(names), **fixed} if name in order]
    start[keep] = held[keep]
    return closed_posture(system, start, keep, p, restarts=_RESTARTS)


def _fixed(
    system: System, names: Sequence[str], values: Mapping[str, float] | Sequence[float] | None
) -> dict[str, float]:
    """The given positions by name."""
    if values is None or isinstance(values, Mapping):
        return dict(values or {})
    given = [float(x) for x in np.ravel(values)]
    if len(given) != len(names):
        raise ModelError(
            f"{system.name}: q_active has {len(given)} values, the independent joints are"
            f" {len(names)}: {', '.join(names)}"
        )
    return dict(zip(names, given, strict=True))


def closed_posture(
    system: System,
    start: Vector,
    held: Sequence[int],
    p: Sequence[float],
    *,
    restarts: int = _RESTARTS,
) -> Vector:
    """The nearest posture found to `start` that closes the loops.

    Args:
        system: the mechanism, its loops not necessarily analysed.
        start: (nq,) first guess.
        held: positions that must not change.
        p: parameter values.
        restarts: how many other starts to try.

    Raises:
        Unclosable: none was found.
    """
    equations = _Equations(system, p, held)
    best: Root | None = None
    for x in _starts(equations.free_part(start), restarts):
        root = gauss_newton(lambda x: equations(x, start), x, tolerance=TOLERANCE)
        if root.converged and equations.faces(root.x, start):
            return equations.full(root.x, start)
        if best is None or root.residual < best.residual:
            best = root
    assert best is not None
    raise Unclosable(_why_open(system, equations, best, start))


def _starts(first: Vector, restarts: int) -> Iterator[Vector]:
    """The guess, then guesses ever further away from it."""
    rng = np.random.default_rng(_SEED)
    yield first
    for k in range(restarts):
        reach = _LARGEST_ANGLE * min(1.0, (k + 2) / 8)
        yield first + rng.uniform(-reach, reach, first.shape)


class _Equations:
    """Closure and quaternion norms as a function of the positions that may change."""

    def __init__(self, system: System, p: Sequence[float], held: Sequence[int]) -> None:
        self.p = list(p)
        self.functions: tuple[Function, Function] = system.cached(
            "posture equations", lambda: _functions(system)
        )
        self.free = [k for k in range(system.nq) if k not in set(held)]

    def free_part(self, q: Vector) -> Vector:
        return np.array(q[self.free])

    def full(self, x: Vector, q: Vector) -> Vector:
        result = np.array(q, dtype=float)
        result[self.free] = x
        return result

    def __call__(self, x: Vector, q: Vector) -> tuple[Vector, Vector]:
        r, J = (np.array(m) for m in self.functions[0](self.full(x, q), self.p))
        return r.ravel(), J[:, self.free]

    def faces(self, x: Vector, q: Vector) -> bool:
        cosines = np.array(self.functions[1](self.full(x, q), self.p))
        return bool(np.all(cosines > 0))


def _functions(system: System) -> tuple[Function, Function]:
    q = SX.sym("q", system.nq)
    norms = [casadi.sumsqr(q[part]) - 1 for part in quaternion_slices(system.tree)]
    r = casadi.densify(casadi.vertcat(closure_rows(system, q), *norms))
    J = casadi.densify(casadi.jacobian(r, q))
    equations = Function("equations", [q, system.p], [r, J])
    return equations, Function("facing", [q, system.p], [facing(system, q)])


def _why_open(system: System, equations: _Equations, best: Root, start: Vector) -> str:
    fixed = [k for k in range(system.nq) if k not in equations.free]
    at = ", ".join(f"{system.coordinates[k].name} = {start[k]:.4g}" for k in fixed)
    return (
        f"{system.name}: the loop cannot be closed{' with ' + at if at else ''}; the best posture"
        f" found leaves {_gap(system, equations, best, start)}; change lengths or guesses"
    )


def _gap(system: System, equations: _Equations, best: Root, start: Vector) -> str:
    """Which joint stays open most, in words and figures."""
    q = SX.sym("q", system.nq)
    rows = labelled_rows(system, q)
    labels = [(name, label) for name, own in rows for label, _ in own]
    residual = np.abs(equations(best.x, start)[0])
    gaps: dict[str, list[float]] = {}
    for (name, label), value in zip(labels, residual, strict=False):
        distance, other = gaps.setdefault(name, [0.0, 0.0])
        is_distance = label.startswith("force")
        gaps[name] = [
            float(np.hypot(distance, value if is_distance else 0.0)),
            float(np.hypot(other, 0.0 if is_distance else value)),
        ]
    name = max(gaps, key=lambda loop: max(gaps[loop]))
    distance, other = gaps[name]
    return f"{name} open by {distance:.3g} m and {other:.3g} in direction cosines"


def require_closed(system: System, q: Any, parameters: Mapping[str, float] | None = None) -> None:
    """Refuse a posture that does not close the loops.

    Raises:
        LoopError: says how far it is open.
    """
    if not system.is_closed:
        return
    equations = _Equations(system, system.parameter_values(parameters), ())
    r, _ = equations(np.array(q, dtype=float).ravel(), np.zeros(system.nq))
    worst = float(np.max(np.abs(r)))
    if worst > 1e-6:
        raise LoopError(
            f"{system.name}: the posture leaves the loops open by {worst:.3g};"
            " use mbs.loops.solve to get one that closes them"
        )
