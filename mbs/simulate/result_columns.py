"""Columns of a result, and the result of a motion with these columns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.assembly.tables import ACCELERATION_UNIT, EFFORT_UNIT
from mbs.errors import ModelError
from mbs.models.contacts import (
    contacts_of,
)
from mbs.result import (
    RecordedStates,
    Result,
    State,
)
from mbs.simulate.contact_motion import contact_columns, efforts_with_contacts, list_events
from mbs.simulate.segments import Segment, StopReason
from mbs.simulate.sensor_readings import sensor_values
from mbs.simulate.tolerances import Tolerances, small_motions
from mbs.text import did_you_mean, quoted

Array = NDArray[np.float64]


_SCALARS = (("kinetic_energy", "J"), ("potential_energy", "J"), ("closure_residual", "1"))


_BLOCKS = ("x", "a", "tau", "u", "y", "scalars", "sensors", "contacts")
"""Blocks of values in order: state, outputs of `observe` (a, tau, u, y, scalars), the others."""


_Column = tuple[str, str, str, int]
"""Name and unit of a column, name of the block of its values, index in the block."""


_StateNames = tuple[tuple[str, ...], tuple[str, ...], tuple[str, ...]]


@dataclass(frozen=True, slots=True, eq=False)
class ResultColumns:
    """Columns of a result: name, unit and source of the values.

    Attributes:
        units: unit of each column by name, in order.
        states: names of the positions, velocities and states of components.
        places: index of each column in the concatenated blocks.
        blocks: names of the blocks that the columns use.
    """

    units: Mapping[str, str]
    states: _StateNames
    places: NDArray[np.int64]
    blocks: frozenset[str]


def columns_of(system: System, outputs: tuple[str, ...] | None) -> ResultColumns:
    """Return all columns of a result, or the columns named in `outputs`.

    Raises:
        ModelError: a name is unknown, or occurs twice.
    """
    nq, nv, nu = system.nq, system.nv, len(system.inputs)
    contacts = contacts_of(system)
    sensors = [column for attached in system.sensors for column in attached.columns]
    sizes = {
        "x": nq + nv + len(system.states),
        "a": nv,
        "tau": nv,
        "u": nu,
        "y": len(system.outputs),
        "scalars": len(_SCALARS),
        "sensors": len(sensors),
        "contacts": 4 * len(contacts),
    }
    first = dict(zip(_BLOCKS, np.cumsum([0, *(sizes[name] for name in _BLOCKS)]), strict=False))
    every: list[_Column] = []
    for k, coordinate in enumerate(system.coordinates):
        every.append((f"{coordinate.name}.q", coordinate.unit, "x", k))
    for k, speed in enumerate(system.velocity_coordinates):
        every.append((f"{speed.name}.v", speed.unit, "x", nq + k))
        every.append((f"{speed.name}.a", ACCELERATION_UNIT[speed.unit], "a", k))
        every.append((f"{speed.name}.tau", EFFORT_UNIT[speed.unit], "tau", k))
    every += [(*scalar, "scalars", k) for k, scalar in enumerate(_SCALARS)]
    for k, quantity in enumerate(system.inputs):
        every.append((*quantity, "u", k))
    for k, quantity in enumerate(system.states):
        every.append((*quantity, "x", nq + nv + k))
    for k, quantity in enumerate(system.outputs):
        every.append((*quantity, "y", k))
    every += [(name, unit, "sensors", k) for k, (name, unit) in enumerate(sensors)]
    every += [(name, unit, "contacts", k) for k, name, unit in contact_columns(system)]
    if outputs is not None:
        every = _named_columns(system, every, outputs)
    return ResultColumns(
        {name: unit for name, unit, *_ in every},
        _state_names(system),
        np.array([first[block] + index for *_, block, index in every], dtype=np.int64),
        frozenset(block for *_, block, _ in every),
    )


def _named_columns(
    system: System, every: Sequence[_Column], outputs: Sequence[str]
) -> list[_Column]:
    known = {column[0]: column for column in every}
    for name in outputs:
        if name not in known:
            raise ModelError(
                f"{system.name}: outputs names {quoted(name)}; {did_you_mean(str(name), known)}"
            )
        if list(outputs).count(name) > 1:
            raise ModelError(f"{system.name}: outputs names {name} twice; name it once")
    return [known[name] for name in outputs]


def _state_names(system: System) -> _StateNames:
    """Return the names of positions, velocities and states of components."""
    return (
        tuple(row.name for row in system.coordinates),
        tuple(row.name for row in system.velocity_coordinates),
        tuple(name for name, _ in system.states),
    )


def modes_of(segments: Sequence[Segment]) -> Array:
    """Return the modes of rigid stops and Coulomb friction at n rows, (n, 2 k) or (n, 0)."""
    contact = segments[0].contact  # a motion with contacts has one segment
    if contact is None:
        return np.empty((sum(len(segment.times) for segment in segments), 0))
    return contact.modes


def require_state_of(system: System, state: State) -> None:
    """Raise if a state belongs to another mechanism.

    Raises:
        ModelError: the names of the state differ from the names of the system.
    """
    wanted, given = _state_names(system), (tuple(state.q), tuple(state.v), tuple(state.z))
    for what, own, other in zip(("positions", "velocities", "states"), wanted, given, strict=True):
        if set(own) != set(other):
            raise ModelError(
                f"{system.name}: the state is of {state.name or 'another mechanism'} and has the"
                f" {what} {', '.join(other) or '(none)'}; give one that has"
                f" {', '.join(own) or '(none)'}"
            )


def _joined(parts: Sequence[Array]) -> Array:
    """Return the rows of all parts in one array, which is the part itself if there is one."""
    return parts[0] if len(parts) == 1 else np.concatenate(parts)


def result_of(
    system: System,
    segments: Sequence[Segment],
    p: Array,
    stop: StopReason,
    columns: ResultColumns,
    allowed: Tolerances,
    note: str,
) -> Result:
    """Return the result of a motion.

    Args:
        system: open or closed system.
        segments: segments of the motion, at least one.
        p: parameters (np,), followed by the inputs of this motion.
        stop: error that ends the motion early, or None.
        columns: requested columns.
        allowed: tolerances of the motion.
        note: beginning of `Result.info["note"]`, or empty text.
    """
    times = _joined([segment.times for segment in segments])
    x = _joined([segment.x for segment in segments])
    nq, n, np_own = system.nq, system.nq + system.nv, len(system.parameters)
    blocks, modes = [x], modes_of(segments)
    if columns.blocks != {"x"}:
        parts = [segment.observe(p) for segment in segments]
        a, tau, u, y, efforts, *scalars = map(_joined, zip(*parts, strict=True))
        sensors = np.empty((len(times), 0))
        if "sensors" in columns.blocks:
            every = np.repeat(p[:np_own, None], len(times), axis=1)
            motion = {"q": x[:, :nq].T, "v": x[:, nq:n].T, "z": x[:, n:].T, "u": u.T, "p": every}
            whole = efforts_with_contacts(system, x[:, :nq], p[:np_own], tau, efforts)
            sensors = sensor_values(system, {**motion, "a": a.T, "tau": whole.T})
        elif system.sensors:
            sensors = np.empty((len(times), sum(len(one.columns) for one in system.sensors)))
        blocks += [a, tau, u, y, *scalars, sensors, modes, efforts]
    values = np.concatenate(blocks, axis=1)[:, columns.places]
    part_events = [event for segment in segments for event in segment.part_events]
    events = list_events(system, segments[0].contact, part_events)
    stopped = None if stop is None or stop.time is None else (stop.time, str(stop))
    info: dict[str, object] = {"tolerance": allowed.common}
    notes = [note] if note else []
    if small := small_motions(system, x[:, :nq], allowed):
        notes.append(f"less than 100 tolerances: {', '.join(small)}; ask for a smaller tolerance")
    if notes:
        info["note"] = ". ".join(notes)
    return Result(
        times,
        values,
        columns.units,
        name=system.name,
        info=info,
        events=events,
        system=system,
        stopped=stopped,
        states=RecordedStates(columns.states, x, modes),
    )
