"""Prescribed motions: laws of time or signals, by the names of positions and their rates."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any

import casadi
from casadi import DM, SX, Function

from mbs.assembly import System
from mbs.assembly.component_instances import WireSource
from mbs.assembly.variable_names import POSITIONS, VELOCITIES
from mbs.components.custom import Signal
from mbs.errors import ModelError
from mbs.loops.configuration import Start, Values
from mbs.models._direct_dynamics import hybrid_dynamics
from mbs.models.state.signals import (
    Prescribed,
    untraceable,
)
from mbs.models.symbols import part_equations
from mbs.numbers import has_boolean
from mbs.result import (
    State,
    positions_of,
)
from mbs.text import did_you_mean, quoted

Motion = Mapping[str, float | str | Signal | Function | Callable[[Any], Any]] | None


_KINDS = ("q", "v", "a")


def prescribed_motions(system: System, motion: Motion) -> list[Prescribed]:
    """Return the prescribed motions of a dict with names such as "j1.q", "j1.v" and "j1.a".

    Args:
        system: open or closed system.
        motion: law of each name: a number, a function of time made of CasADi operations, or a
            signal of a component (the Signal or its name).

    Raises:
        ModelError: a name is unknown, a law is not a function of time, a signal depends on the
            motion, or the loops make the prescribed velocities dependent.
    """
    if not isinstance(motion, Mapping | None):
        raise ModelError(
            f"{system.name}: motion is {quoted(motion)}; give a dict such as"
            ' {"j1.q": lambda t: 0.3 * casadi.sin(t)}'
        )
    found = [_prescribe(system, name, law) for name, law in (motion or {}).items()]
    names = [one.name for one in found]
    for name in names:
        if names.count(name) > 1:
            raise ModelError(
                f"{system.name}: motion prescribes {name} more than once; give its position, its"
                " velocity or its acceleration"
            )
    if found:
        hybrid_dynamics(system, names)  # raises if the loops make them dependent
    return found


def start_positions(
    system: System,
    motions: list[Prescribed],
    q0: Start,
    v0: Values,
    z0: Sequence[float],
    p: Sequence[float],
    begin: float,
) -> tuple[Start, Values]:
    """Return the initial positions and velocities, including the prescribed values.

    Args:
        system: open or closed system.
        motions: prescribed motions.
        q0: positions by name.
        v0: velocities by name.
        z0: states of components at the start, (nz,).
        p: parameters (np,).
        begin: first time [s].

    Raises:
        ModelError: `q0` or `v0` contradicts a prescribed value, or is not given by name.
    """
    if not motions:
        return q0, v0
    if isinstance(q0, State) and v0 is None:
        v0 = q0.v
    positions = _named_values(system, "q0", positions_of(q0), POSITIONS)
    velocities = _named_values(system, "v0", v0, VELOCITIES)
    for one in motions:
        position, speed, _ = (float(value) for value in one.laws.call([DM(begin), DM(z0), DM(p)]))
        if one.position is not None:
            _set_start(system, positions, one.name, position, "q0")
        if one.holds_speed:
            _set_start(system, velocities, one.name, speed, "v0")
    return positions, velocities


def _named_values(
    system: System, what: str, given: Values, kinds: Collection[str]
) -> dict[str, float]:
    if not isinstance(given, Mapping | None):
        raise ModelError(
            f"{system.name}: {what} is given as a sequence, beside motion; give a dict of names"
        )
    found: dict[str, float] = system.plain_names(given or {}, kinds)
    return found


def _set_start(
    system: System, values: dict[str, float], name: str, value: float, what: str
) -> None:
    # relative tolerance 1e-9: both values are typed or read from files, not computed
    if name in values and abs(values[name] - value) > 1e-9 * max(1.0, abs(value)):
        raise ModelError(
            f"{system.name}: {what} gives {name} = {values[name]:g}, but its motion starts at"
            f" {value:g}; leave it out of {what}"
        )
    values[name] = value


def _prescribe(system: System, name: str, law: Any) -> Prescribed:
    base, _, kind = str(name).rpartition(".")
    speeds = [speed.name for speed in system.velocity_coordinates]
    positions = [coordinate.name for coordinate in system.coordinates]
    known = [f"{n}.{k}" for n in speeds for k in _KINDS if k != "q" or n in positions]
    if name not in known:
        raise ModelError(
            f"{system.name}: motion names {quoted(name)}, which is no position, velocity or"
            f" acceleration; {did_you_mean(str(name), known)}"
        )
    t = SX.sym("t")
    if isinstance(law, str | Signal):
        value, z_rate = _law_of_signal(system, name, str(law))
    else:
        value, z_rate = (
            _law_of_time(system, name, law, t),
            SX.zeros(system.component_states.numel()),
        )

    def rate_of(expression: SX) -> SX:
        by_states = (
            casadi.jtimes(expression, system.component_states, z_rate)
            if system.component_states.numel()
            else SX(0)
        )
        return casadi.jacobian(expression, t) + by_states

    rate = rate_of(value)
    laws = {
        "q": (value, rate, rate_of(rate)),
        "v": (SX(0), value, rate),
        "a": (SX(0), SX(0), value),
    }[kind]
    position = positions.index(base) if kind == "q" else None
    inputs = [t, system.component_states, system.p]
    function = Function("motion", inputs, list(laws), {"allow_free": True})
    if function.has_free():
        raise ModelError(
            f"{system.name}: the motion of {name} is {law}, which follows from"
            f" {', '.join(function.get_free())}; give a signal that follows from states of"
            " components and parameters alone"
        )
    return Prescribed(base, speeds.index(base), position, kind != "a", function)


def _law_of_signal(system: System, name: str, given: str) -> tuple[SX, SX]:
    """Return a signal of a component and the rates (nz, 1) of all states of components."""
    q, v = (
        casadi.vertcat(SX(0, 1), *(SX.sym(f"{row.name}.{letter}") for row in rows))
        for letter, rows in (("q", system.coordinates), ("v", system.velocity_coordinates))
    )
    sources = {
        f"{part.name}.{signal}": WireSource(part.name, signal)
        for part in system.parts
        for signal in [*part.states, *part.element.output_names]
    }
    if given not in sources:
        raise ModelError(
            f"{system.name}: the motion of {name} is {quoted(given)}; give a finite number, or a"
            " function of the time made of CasADi operations, or an output or a state of a"
            f" component; {did_you_mean(given, list(sources))}"
        )
    _, z_rate, parts = part_equations(system, q, v)
    return parts.signal(sources[given]), z_rate


def _law_of_time(system: System, name: str, law: Any, t: SX) -> SX:
    """Return the law as a scalar expression of the time t."""
    given = law
    if callable(law):
        try:
            given = law(t)
        except Exception as error:
            raise untraceable(system, f"the motion of {name}", error) from error
    try:
        value = SX(0, 0) if has_boolean(given) else SX(given)
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
