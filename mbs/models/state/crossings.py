"""Crossings: expressions of the state at which laws of forces and control jump or bend.

A side is an expression at whose sign change a law jumps or bends, such as the condition of an
if_else. A count is an expression at whose integer values a law jumps, such as the argument of
floor. A crossing is a side or a count.

In an FMU, events end steps at the jumps of laws, and bends are left to error control of the
importer. In a simulation, events end steps at jumps and bends.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import casadi
from casadi import SX, Function

from mbs.assembly import System
from mbs.components.custom import Approach
from mbs.models.state.arguments import StateArguments
from mbs.models.state.drive import DriveInputs
from mbs.models.state.laws import Conditions, TimeLaws, conditions_of, distinct, time_laws
from mbs.models.state.signals import with_inputs
from mbs.recursions.parts import PartsAt


@dataclass(frozen=True, slots=True, eq=False)
class WatchedCrossings:
    """Crossings of a state equation.

    Attributes:
        contacts: (c, 1) sides of contacts between bodies, whose laws are continuous there.
        sides: (n, 1) values at whose zeros laws jump or bend.
        counts: (m, 1) values at whose integer values laws jump.
        approaches: (c, 2) speeds and paces of the contacts, as in `Approach`.
    """

    contacts: SX = field(default_factory=lambda: SX(0, 1))
    sides: SX = field(default_factory=lambda: SX(0, 1))
    counts: SX = field(default_factory=lambda: SX(0, 1))
    approaches: SX = field(default_factory=lambda: SX(0, 2))

    @property
    def every(self) -> SX:
        """(c + n + m, 1) values of all crossings."""
        return casadi.vertcat(self.contacts, self.sides, self.counts)


def part_crossings(system: System) -> Function | None:
    """Return `f(q, v, z, u, p)` with the crossings at which laws of components jump.

    Bends of laws are left to error control.

    Args:
        system: open or closed system.

    Returns:
        Function with the outputs of `WatchedCrossings`, or None if no law jumps.
    """
    q, v = SX.sym("q", system.nq), SX.sym("v", system.nv)
    parts = PartsAt(system, q, v)
    constants = casadi.vertcat(system.p, parts.modes())
    laws = _jumps(parts.laws(), SX(0, 1), q, constants)
    states, point = (
        casadi.vertcat(q, v, system.component_states),
        [q, v, system.component_states, system.u, system.p],
    )
    given = [one for one in parts.crossings(of_bends=False) if casadi.depends_on(one.value, states)]
    contacts, others = _contacts_and_others(given)
    crossings = WatchedCrossings(
        contacts=casadi.vertcat(SX(0, 1), *(one.value for one in contacts)),
        sides=_distinct_of([*others, *laws.crossings], states),
        counts=_distinct_of(laws.counts, states),
        approaches=parts.approaches(contacts),
    )
    return crossings_function(StateArguments(tuple(point)), crossings)


def drive_crossings(system: System, drive: DriveInputs, extra: int) -> Function | None:
    """Return `f(t, q, v, w, p)` with the crossings at which the control laws of a drive jump.

    Args:
        system: open or closed system.
        drive: drive, with or without laws.
        extra: number of the inputs w of the laws.

    Returns:
        Function with the outputs of `WatchedCrossings`, or None if no law jumps or if laws are
        external functions.
    """
    laws = [law for law in (drive.effort, drive.device) if law is not None]
    if not laws or not all(law.is_a("SXFunction") for law in laws):
        return None
    t, q, v = SX.sym("t"), SX.sym("q", system.nq), SX.sym("v", system.nv)
    point = [t, q, v, SX.sym("w", extra), system.p]
    values = [casadi.vec(law.call(point)[0]) for law in laws]
    found = _jumps(casadi.vertcat(*values), t, q, system.p)
    states = casadi.vertcat(t, q, v)
    crossings = WatchedCrossings(
        sides=_distinct_of([*found.crossings, *found.zeros], states),
        counts=_distinct_of([*found.counts, *found.wholes], states),
    )
    return crossings_function(StateArguments(tuple(point)), crossings)


def _jumps(laws: SX, t: SX, q: SX, constants: SX) -> Conditions:
    """Return the conditions at which laws jump, and the bends of these conditions.

    Importers detect sign changes only. They find both zeros of |x| - a if they also stop at x = 0.
    """
    found = conditions_of(laws, t, q, constants, jumps_alone=True)
    decisive = casadi.vertcat(*found.crossings, *found.counts, *found.zeros, *found.wholes)
    inner = conditions_of(SX(decisive), t, q, constants)
    return Conditions(
        zeros=[*found.zeros, *inner.zeros],
        wholes=[*found.wholes, *inner.wholes],
        crossings=[*found.crossings, *inner.crossings],
        counts=[*found.counts, *inner.counts],
    )


def _distinct_of(values: Sequence[SX], symbols: SX) -> SX:
    """Return the distinct expressions that depend on symbols, in one column."""
    kept = (value for value in distinct(values, []) if casadi.depends_on(value, symbols))
    return casadi.vertcat(SX(0, 1), *kept)


def crossings_function(arguments: StateArguments, values: WatchedCrossings) -> Function | None:
    """Return a Function with the outputs of `WatchedCrossings`, None without crossings.

    Args:
        arguments: arguments of the Function.
        values: crossings as expressions of the arguments.
    """
    if not values.every.numel():
        return None
    outputs = [values.contacts, values.sides, values.counts, values.approaches]
    return arguments.function("crossings", outputs)


# Crossings of a simulation, in which laws of efforts, inputs and motions are known.


@dataclass(frozen=True, slots=True, eq=False)
class SimulationCrossings:
    """Crossings of a simulation.

    Attributes:
        crossings: crossings that depend on the state: jumps and bends.
        timing: laws that depend on time only, or None.
        short: whether a smooth law may act only briefly after a crossing.
    """

    crossings: WatchedCrossings
    timing: TimeLaws | None
    short: bool


def simulation_crossings(
    system: System, point: tuple[SX, SX, SX], u: SX, laws: Sequence[SX], parts: PartsAt
) -> SimulationCrossings:
    """Return the crossings of a simulation.

    Args:
        system: open or closed system.
        point: symbols t, q and v.
        u: (nu, 1) values of the inputs of components.
        laws: expressions of efforts, inputs and prescribed motions.
        parts: equations of all components.
    """
    t, q, v = point
    constants = casadi.vertcat(system.p, parts.modes())
    found = conditions_of(casadi.vertcat(SX(0, 1), *laws), t, q, constants)
    own = conditions_of(parts.laws(), SX(0, 1), q, constants)
    of_parts, counts = with_inputs(system, own.crossings, u), with_inputs(system, own.counts, u)
    given = parts.crossings()
    states = casadi.vertcat(q, v, system.component_states)
    results = []
    for every, known, of_time in (
        ([*found.crossings, *of_parts], [one.value for one in given], found.zeros),
        ([*found.counts, *counts], [], found.wholes),
    ):
        kept = list[SX]()
        for value in distinct(every, known):
            if casadi.depends_on(value, states):
                kept.append(value)
            elif casadi.depends_on(value, t):
                of_time.append(value)
        results.append(casadi.vertcat(SX(0, 1), *kept))
    contacts, bends = _contacts_and_others(given)
    crossings = WatchedCrossings(
        contacts=casadi.vertcat(SX(0, 1), *(one.value for one in contacts)),
        sides=casadi.vertcat(SX(0, 1), *bends, results[0]),
        counts=results[1],
        approaches=parts.approaches(contacts),
    )
    short = bool(found.short or own.short or given)
    return SimulationCrossings(crossings, time_laws(found, t, system.p), short)


def _contacts_and_others(given: Sequence[Approach]) -> tuple[list[Approach], list[SX]]:
    """Return the contacts between bodies, and the values of the other crossings of components."""
    contacts = [one for one in given if not one.pace.is_zero()]
    return contacts, [one.value for one in given if one.pace.is_zero()]
