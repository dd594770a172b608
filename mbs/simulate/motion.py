"""Prescribed motions of a simulation: laws of time by the names of positions and rates."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import casadi
from casadi import SX, Function

from mbs.assembly import System
from mbs.errors import ModelError
from mbs.loops.start import Values
from mbs.messages import did_you_mean, quoted
from mbs.models.hybrid_dynamics import hybrid_dynamics
from mbs.models.prescribed import Prescribed
from mbs.models.signal_function import untraceable

Motion = Mapping[str, float | Function | Callable[[Any], Any]] | None
_KINDS = ("q", "v", "a")


def prescribed_motions(system: System, motion: Motion) -> list[Prescribed]:
    """What a user prescribes, by names such as "j1.q", "j1.v" and "j1.a".

    Args:
        system: open or closed.
        motion: for each name a number, or a function of the time made of CasADi operations.

    Raises:
        ModelError: a name is unknown, a law is no function of time, or the loops tie what is
            prescribed.
    """
    if not isinstance(motion, Mapping | None):
        raise ModelError(
            f"{system.name}: motion is {quoted(motion)}; give a dict such as"
            ' {"j1.q": lambda t: 0.3 * casadi.sin(t)}'
        )
    found = [_prescribed(system, name, law) for name, law in (motion or {}).items()]
    names = [one.name for one in found]
    for name in names:
        if names.count(name) > 1:
            raise ModelError(
                f"{system.name}: motion prescribes {name} more than once; give its position, its"
                " velocity or its acceleration"
            )
    if found:
        hybrid_dynamics(system, names)  # refuses what the loops tie
    return found


def started(
    system: System, motions: list[Prescribed], q0: Values, v0: Values
) -> tuple[Values, Values]:
    """The start of a motion, with what is prescribed of it at the time zero.

    Raises:
        ModelError: a start is given for what is prescribed, or not by name.
    """
    if not motions:
        return q0, v0
    for what, given in (("q0", q0), ("v0", v0)):
        if not isinstance(given, Mapping | None):
            raise ModelError(
                f"{system.name}: {what} is given as a sequence, beside motion; give a dict of names"
            )
    positions, velocities = dict(q0 or {}), dict(v0 or {})  # type: ignore[arg-type]
    for one in motions:
        place, speed, _ = (float(value) for value in one.law(SX(0)))
        if one.position is not None:
            _put(system, positions, one.name, place, "q0")
        if one.holds_speed:
            _put(system, velocities, one.name, speed, "v0")
    return positions, velocities


def _put(system: System, values: dict[str, float], name: str, value: float, what: str) -> None:
    if name in values and abs(values[name] - value) > 1e-9 * max(1.0, abs(value)):
        raise ModelError(
            f"{system.name}: {what} gives {name} = {values[name]:g}, but its motion starts at"
            f" {value:g}; leave it out of {what}"
        )
    values[name] = value


def _prescribed(system: System, name: str, law: Any) -> Prescribed:
    base, _, kind = str(name).rpartition(".")
    speeds = [speed.name for speed in system.speeds]
    positions = [coordinate.name for coordinate in system.coordinates]
    known = [f"{n}.{k}" for n in speeds for k in _KINDS if k != "q" or n in positions]
    if name not in known:
        raise ModelError(
            f"{system.name}: motion names {quoted(name)}, which is no position, velocity or"
            f" acceleration; {did_you_mean(str(name), known)}"
        )
    t = SX.sym("t")
    value = _value(system, name, law, t)
    rate = casadi.jacobian(value, t)
    laws = {
        "q": (value, rate, casadi.jacobian(rate, t)),
        "v": (SX(0), value, rate),
        "a": (SX(0), SX(0), value),
    }[kind]
    position = positions.index(base) if kind == "q" else None
    return Prescribed(base, speeds.index(base), position, kind != "a", t, laws)


def _value(system: System, name: str, law: Any, t: SX) -> SX:
    """The law as one scalar expression of the time."""
    given = law
    if callable(law):
        try:
            given = law(t)
        except Exception as error:
            raise untraceable(system, f"the motion of {name}", error) from error
    try:
        value = SX(given)
    except Exception:
        value = SX(0, 0)
    constant = not casadi.symvar(value)
    if value.numel() != 1 or (constant and not casadi.evalf(value).is_regular()):
        raise ModelError(
            f"{system.name}: the motion of {name} is {quoted(given)}; give a finite number, or a"
            " function of the time made of CasADi operations, such as"
            " lambda t: 0.3 * casadi.sin(2 * t)"
        )
    alone = Function("law", [t], [value], {"allow_free": True})
    if alone.has_free():
        raise ModelError(
            f"{system.name}: the motion of {name} holds the symbols {', '.join(alone.get_free())};"
            " make it of the time and numbers"
        )
    return value
