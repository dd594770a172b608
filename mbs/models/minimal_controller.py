"""A state equation whose motors and devices follow laws instead of inputs."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import accumulate
from typing import Any

import casadi
from casadi import MX, SX, Function

from mbs.models.minimal_contacts import MinimalEvents
from mbs.models.minimal_drive import DriveInputs


@dataclass(frozen=True, slots=True, eq=False)
class StateEquations:
    """The functions of a state equation.

    Attributes:
        rhs: `rhs(t, x, z, u, p) -> (xdot, y)`.
        motion: `motion(t, x, z, u, p) -> (q, v)`, positions and velocities of the tree; p are the
            parameters alone.
        events: None where there are none.
        sizes: of the parts of u: efforts, inputs of devices, the rest.
    """

    rhs: Function
    motion: Function
    events: MinimalEvents | None
    sizes: tuple[int, int, int]


def controlled(equations: StateEquations, drive: DriveInputs, extra: int) -> StateEquations:
    """The same with inputs that the laws of a drive compute.

    The functions are of scalars where the laws are. Else they hold calls of the laws, which may be
    external functions.

    Args:
        equations: where u begins with what the laws give.
        drive: with a law.
        extra: number of the inputs w of the laws, which end u.
    """
    tau, u, rest = equations.sizes
    wiring = _Wiring(
        equations, drive, (0 if drive.effort else tau, 0 if drive.device else u, rest, extra)
    )
    return StateEquations(
        rhs=_driven(wiring, equations.rhs),
        motion=equations.motion,
        events=_events(wiring, equations.events),
        sizes=wiring.sizes[:3],
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Wiring:
    """What computes the inputs, and the sizes of the parts of u that are left."""

    equations: StateEquations
    drive: DriveInputs
    sizes: tuple[int, int, int, int]


def _events(wiring: _Wiring, events: MinimalEvents | None) -> MinimalEvents | None:
    if events is None:
        return None
    return replace(
        events,
        first=_idle(wiring, events.first),
        indicators=_driven(wiring, events.indicators),
        jump=_driven(wiring, events.jump),
    )


def _driven(wiring: _Wiring, function: Function) -> Function:
    """The function with what the laws give."""
    drive, motion = wiring.drive, wiring.equations.motion
    laws = [law for law in (drive.effort, drive.device) if law is not None]
    kind: Any = SX if all(law.is_a("SXFunction") for law in laws) else MX
    symbols = _symbols(wiring, function, kind)
    t, x, z, u, p = symbols[:5]
    pushes, inputs, others, w = _parts(u, wiring.sizes)
    p = _parts(p, (motion.numel_in(4), p.numel() - motion.numel_in(4)))[0]
    q, v = motion.call([t, x, z, _filled(wiring, kind, others), p])
    if drive.effort is not None:
        pushes = casadi.densify(casadi.vec(drive.effort.call([t, q, v, w, p])[0]))
    if drive.device is not None:
        inputs = casadi.densify(casadi.vec(drive.device.call([t, q, v, w, p])[0]))
    given = casadi.vertcat(pushes, inputs, others)
    return _written(function, symbols, given, kind)


def _idle(wiring: _Wiring, function: Function) -> Function:
    """The function, which depends on no effort, with other inputs."""
    symbols = _symbols(wiring, function, SX)
    others = _parts(symbols[3], wiring.sizes)[2]
    return _written(function, symbols, _filled(wiring, SX, others), SX)


def _symbols(wiring: _Wiring, function: Function, kind: Any) -> list[Any]:
    sizes = [function.numel_in(k) for k in range(function.n_in())]
    sizes[3] = sum(wiring.sizes)
    names = ("t", "x", "z", "u", "p", "fired")
    return [kind.sym(name, size) for name, size in zip(names, sizes, strict=False)]


def _filled(wiring: _Wiring, kind: Any, others: Any) -> Any:
    """The inputs that a function takes, zero where laws give them."""
    tau, u, _ = wiring.equations.sizes
    return casadi.vertcat(kind.zeros(tau), kind.zeros(u), others)


def _parts(u: Any, sizes: tuple[int, ...]) -> list[Any]:
    parts: list[Any] = casadi.vertsplit(u, [0, *accumulate(sizes)])
    return parts


def _written(function: Function, symbols: list[Any], u: Any, kind: Any) -> Function:
    options = {"cse": True} if kind is SX else {}
    values = function.call([*symbols[:3], u, *symbols[4:]])
    return Function(function.name(), symbols, values, options)
