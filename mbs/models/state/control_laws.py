"""Control laws that replace inputs of a state equation, and the crossings of all its laws."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import accumulate
from typing import Any

import casadi
from casadi import MX, SX, Function

from mbs.models.state.arguments import StateArguments
from mbs.models.state.crossing_modes import add_crossings
from mbs.models.state.crossings import drive_crossings, part_crossings
from mbs.models.state.drive import DriveInputs, TreeMotion
from mbs.models.state.events import StateEvents
from mbs.models.state.layout import StateInputs
from mbs.models.symbols import dense_function


def with_laws_and_crossings(
    inputs: StateInputs,
    arguments: StateArguments,
    motion: TreeMotion,
    functions: Sequence[Function],
    events: StateEvents | None,
    *,
    crossings: bool,
) -> tuple[list[Function], StateEvents | None]:
    """Add the control laws of a state equation, and the events at which laws jump.

    Control laws replace efforts and inputs of components in u, and add their inputs w to it. The
    functions are SX if the laws are. Otherwise they contain calls of the laws, which may be
    external functions.

    Args:
        inputs: inputs of the state equation.
        arguments: arguments t, x, z, u and p of the functions; u starts with the values of the
            laws.
        motion: positions and velocities of the tree as expressions of the arguments.
        functions: functions of the arguments.
        events: events of contacts and components, or None.
        crossings: whether events end steps at discontinuities of the laws of components and of the
            control laws.

    Returns:
        Functions and events with the remaining inputs; modes of crossings are the last elements of
        p.
    """
    system, drive, point = inputs.system, inputs.drive, arguments.point
    p = point[-1]
    of_parts = part_crossings(system) if crossings else None
    if of_parts is not None:
        of_parts = Function(
            "crossings",
            list(point),
            of_parts.call([motion.q, motion.v, system.component_states, system.u, p]),
        )
    found, events = add_crossings(of_parts, point, functions, events, "laws")
    if drive.effort is None and drive.device is None:
        return found, events
    extra, sizes = inputs.layout.extra, inputs.symbols.sizes
    tau, devices, rest = sizes
    left = (0 if drive.effort else tau, 0 if drive.device else devices, rest, extra)
    at = dense_function("motion", list(point), [motion.q, motion.v])
    wiring = _Wiring(drive, at, sizes, left)
    found, events = [_driven(wiring, function) for function in found], _events(wiring, events)
    of_laws = drive_crossings(system, drive, extra) if crossings else None
    if of_laws is None:
        return found, events
    left_point = tuple(_symbols(wiring, wiring.motion, SX))
    t, x, z, u, p = left_point
    _, _, others, w = _parts(u, wiring.left)
    q, v = wiring.motion.call([t, x, z, _fill(wiring, SX, others), p])
    of_laws = Function("crossings", list(left_point), of_laws.call([t, q, v, w, p]))
    return add_crossings(of_laws, left_point, found, events, "controller")


@dataclass(frozen=True, slots=True, eq=False)
class _Wiring:
    """Control laws, and the inputs that they replace.

    Attributes:
        drive: drive with at least one law.
        motion: `motion(t, x, z, u, p) -> (q, v)`, positions and velocities of the tree; p contains
            the parameters without modes.
        sizes: sizes of the parts of u with the values of laws: efforts, inputs of components,
            remaining inputs.
        left: sizes of these parts without the values of laws, and the size of w.
    """

    drive: DriveInputs
    motion: Function
    sizes: tuple[int, int, int]
    left: tuple[int, int, int, int]


def _events(wiring: _Wiring, events: StateEvents | None) -> StateEvents | None:
    if events is None:
        return None
    return replace(
        events,
        first=_idle(wiring, events.first),
        indicators=_driven(wiring, events.indicators),
        jump=_driven(wiring, events.jump),
        approaches=None if events.approaches is None else _driven(wiring, events.approaches),
    )


def _driven(wiring: _Wiring, function: Function) -> Function:
    """Return the function with efforts and component inputs from the laws."""
    drive, motion = wiring.drive, wiring.motion
    laws = [law for law in (drive.effort, drive.device) if law is not None]
    kind: Any = SX if all(law.is_a("SXFunction") for law in laws) else MX
    symbols = _symbols(wiring, function, kind)
    t, x, z, u, p = symbols[:5]
    pushes, inputs, others, w = _parts(u, wiring.left)
    p = _parts(p, (motion.numel_in(4), p.numel() - motion.numel_in(4)))[0]
    q, v = motion.call([t, x, z, _fill(wiring, kind, others), p])
    if drive.effort is not None:
        pushes = casadi.densify(casadi.vec(drive.effort.call([t, q, v, w, p])[0]))
    if drive.device is not None:
        inputs = casadi.densify(casadi.vec(drive.device.call([t, q, v, w, p])[0]))
    given = casadi.vertcat(pushes, inputs, others)
    return _write(function, symbols, given, kind)


def _idle(wiring: _Wiring, function: Function) -> Function:
    """Return a function that does not depend on efforts, with the remaining inputs only."""
    symbols = _symbols(wiring, function, SX)
    others = _parts(symbols[3], wiring.left)[2]
    return _write(function, symbols, _fill(wiring, SX, others), SX)


def _symbols(wiring: _Wiring, function: Function, kind: Any) -> list[Any]:
    sizes = [function.numel_in(k) for k in range(function.n_in())]
    sizes[3] = sum(wiring.left)
    names = ("t", "x", "z", "u", "p", "fired")
    return [kind.sym(name, size) for name, size in zip(names, sizes, strict=False)]


def _fill(wiring: _Wiring, kind: Any, others: Any) -> Any:
    """Return the inputs u of a function, with zeros for the values of laws."""
    tau, u, _ = wiring.sizes
    return casadi.vertcat(kind.zeros(tau), kind.zeros(u), others)


def _parts(u: Any, sizes: tuple[int, ...]) -> list[Any]:
    parts: list[Any] = casadi.vertsplit(u, [0, *accumulate(sizes)])
    return parts


def _write(function: Function, symbols: list[Any], u: Any, kind: Any) -> Function:
    options = {"cse": True} if kind is SX else {}
    values = function.call([*symbols[:3], u, *symbols[4:]])
    return Function(function.name(), symbols, values, options)
