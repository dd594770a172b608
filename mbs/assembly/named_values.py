"""Values of a system by name: frames, positions, velocities, efforts and parameters."""

from __future__ import annotations

import math
from collections.abc import Collection, Container, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from casadi import DM

from mbs.assembly.parameter_bounds import inertia_notes
from mbs.assembly.system_data import SystemData
from mbs.assembly.tables import Coordinate
from mbs.assembly.variable_names import EFFORTS, GUESSES, VELOCITIES, by_coordinate
from mbs.components.bodies import RigidBody
from mbs.errors import MbsError, ModelError
from mbs.expressions import out_of_bounds
from mbs.numbers import is_vector, numbers_given
from mbs.spatial import Pose
from mbs.text import did_you_mean, quoted, without_values


def frame_of(system: SystemData, name: str | int) -> tuple[int, Pose]:
    """Return the link (-1 for the base) and the pose of a frame on this link.

    Args:
        system: assembled system.
        name: name of the frame, or number of a link or table frame; see `System.frame`.

    Raises:
        ModelError: there is no such frame.
    """
    if isinstance(name, (int, np.integer)) and not isinstance(name, bool):
        if system.numbered:
            return _numbered_frame(system, int(name))
        if 0 <= name <= len(system.tree.links):
            return int(name) - 1, Pose.identity()
        raise ModelError(
            f"{system.name}: there is no link {name}; the links are 1 to {len(system.tree.links)},"
            " and 0 is the base"
        )
    if not isinstance(name, str):
        raise ModelError(
            f"{system.name}: {quoted(name)} names no frame; give a text or the number of a link"
        )
    if name in system.frames:
        return system.frames[name]
    raise ModelError(
        f"{system.name}: there is no frame {name!r}; " + did_you_mean(name, system.frames)
    )


def _numbered_frame(system: SystemData, number: int) -> tuple[int, Pose]:
    """Return link and pose of the frame with this number in the table of frames; 0 is the base.

    Raises ModelError if no body has it.
    """
    if number == 0:
        return system.frames["base"]
    if number not in system.numbered:
        known = ", ".join(map(str, system.numbered))
        raise ModelError(
            f"{system.name}: no body has the frame {number} of the table; the frames are {known},"
            " and 0 is the base"
        )
    return system.frames[system.numbered[number]]


def position_of(
    system: SystemData, values: Mapping[str, float] | Sequence[float] | None
) -> list[float]:
    """Return positions q (nq,) from values by name or in order; see `System.position`.

    Args:
        system: assembled system.
        values: positions [rad or m]; others are those of the assembled configuration.

    Raises:
        ModelError: a name is unknown, or a value is not a finite number.
    """
    start, given = list(system.configuration), plain_names(system, values, GUESSES)
    return _filled(system, given, system.coordinates, start, "position")


def positions_at_cuts(system: SystemData, values: Mapping[str, float]) -> dict[str, float]:
    """Return the values that belong to coordinates of cut joints, by the same names.

    Args:
        system: assembled system.
        values: positions by coordinate name [rad or m]. Other joints are left out.

    Raises:
        ModelError: a position of a cut joint is not a finite number.
    """
    names = [coordinate.name for coordinate in system.cut_coordinates]
    found = {name: value for name, value in values.items() if name in names}
    return {name: _number(system, value, f"position of {name}") for name, value in found.items()}


def velocity_of(
    system: SystemData, values: Mapping[str, float] | Sequence[float] | None
) -> list[float]:
    """Return velocities v (nv,) from values by name or in order; see `System.velocity`.

    Args:
        system: assembled system.
        values: velocities [rad/s or m/s]; others are zero.

    Raises:
        ModelError: a name is unknown, or a value is not a finite number.
    """
    given = plain_names(system, values, VELOCITIES)
    return _filled(system, given, system.velocity_coordinates, [0.0] * system.nv, "velocity")


def effort_of(
    system: SystemData, values: Mapping[str, float] | Sequence[float] | None
) -> list[float]:
    """Return joint efforts tau (nv,) from values by name or in order; see `System.effort`.

    Args:
        system: assembled system.
        values: efforts [N m or N]; others are zero.

    Raises:
        ModelError: a name is unknown, or a value is not a finite number.
    """
    given = plain_names(system, values, EFFORTS)
    return _filled(system, given, system.velocity_coordinates, [0.0] * system.nv, "effort")


def plain_names(system: SystemData, values: Any, kinds: Collection[str]) -> Any:
    """Return values by coordinate name, such as j1, from names of variables, such as j1.q.

    Args:
        system: assembled system.
        values: values by name. An argument of another type is returned unchanged.
        kinds: accepted ends of names of variables, such as ("q",).

    Raises:
        ModelError: a value is given by both names, or the name is of another quantity.
    """
    if not isinstance(values, Mapping):
        return values
    rows = (*system.coordinates, *system.cut_coordinates, *system.velocity_coordinates)
    return by_coordinate(system.name, values, {row.name for row in rows}, kinds)


def _filled(
    system: SystemData,
    values: Mapping[str, float] | Sequence[float] | None,
    coordinates: Sequence[Coordinate],
    start: list[float],
    what: str,
) -> list[float]:
    """Return the list `start` with the given values inserted, by name or all in order.

    `what` is the quantity in error messages. Raises ModelError for an unknown name or a wrong
    number of values.

    `coordinates` name the elements of the list.
    """
    names = [coordinate.name for coordinate in coordinates]
    if values is None:
        return start
    if not isinstance(values, Mapping):
        given = _numbers(system, values, what)
        if len(given) != len(names):
            raise ModelError(
                f"{system.name}: the {what} has {len(given)} values, the system has"
                f" {len(names)}: {', '.join(names)}"
            )
        return given
    for name, value in values.items():
        if name in [coordinate.name for coordinate in system.cut_coordinates]:
            remedy = ", or give it as a guess" if what == "position" else ""
            raise ModelError(
                f"{system.name}: {name} has no {what} of its own, since its joint was cut to open"
                f" a loop; name another joint, or cut another one with m.cut(joint){remedy}"
            )
        if name not in names:
            raise ModelError(
                f"{system.name}: there is no coordinate {name!r}; " + did_you_mean(name, names)
            )
        start[names.index(name)] = _number(system, value, f"{what} of {name}")
    return start


def _numbers(system: SystemData, values: Any, what: str) -> list[float]:
    """Return `values` as a list of finite floats.

    Raises ModelError for any other value; `what` names the values in its message.
    """
    if isinstance(values, (list, tuple)):  # numpy makes no array of several (1, 1) of CasADi
        values = [float(x) if isinstance(x, DM) and x.numel() == 1 else x for x in values]
    array = numbers_given(values)
    if isinstance(array, str):
        raise ModelError(f"{system.name}: the {what} {array}")
    if not is_vector(array.shape):
        raise ModelError(
            f"{system.name}: the {what} has the shape {array.shape}; give a list, or an array of"
            " one dimension"
        )
    if not np.isfinite(array).all():
        raise ModelError(
            f"{system.name}: the {what} is {quoted(values)}; give a finite number for each"
            " coordinate"
        )
    return [float(x) for x in array.ravel()]


def _number(system: SystemData, value: Any, what: str) -> float:
    """Return `value` as a float.

    Raises ModelError unless it is a single finite number; `what` names it in the message.
    """
    numbers = _numbers(system, value, what)
    if len(numbers) != 1:
        raise ModelError(f"{system.name}: the {what} has {len(numbers)} values; give one number")
    return numbers[0]


def parameter_values(
    system: SystemData,
    values: Mapping[str, float] | None = None,
    needed: Container[str] | None = None,
) -> list[float]:
    """Return parameters p (np,) from values by name; see `System.parameter_values`.

    Args:
        system: assembled system.
        values: values by name; others are default values.
        needed: names of the parameters that must have a value; None for all.

    Raises:
        ModelError: a name is unknown, a parameter has no value, or a value is invalid.
    """
    names = [parameter.name for parameter in system.parameters]
    if values is not None and not isinstance(values, Mapping):
        raise ModelError(
            f"{system.name}: the parameters are {quoted(values)}; give a dict of names to values"
        )
    given = dict(values or {})
    for name in given:
        if name not in names:
            raise ModelError(
                f"{system.name}: there is no parameter {name!r}; " + did_you_mean(name, names)
            )
    defaults = {parameter.name: parameter.default for parameter in system.parameters}
    missing = [
        name
        for name, default in defaults.items()
        if given.get(name, default) is None and (needed is None or name in needed)
    ]
    if missing:
        raise ModelError(f"{system.name}: {without_values(missing)}")
    result = []
    for parameter in system.parameters:
        name = parameter.name
        value = given.get(name, parameter.default)
        if value is not None and name in given:
            value = _number(system, value, f"parameter {name}")
        result.append(math.nan if value is None else value)
    if given and (fault := parameter_fault(system, result)):
        raise ModelError(f"{system.name}: {fault}")
    return result


def parameter_fault(system: SystemData, p: Iterable[float]) -> str:
    """Return the error message on values of the parameters; empty if they are valid.

    Args:
        system: assembled system.
        p: (np,) values. NaN means that no value is given.
    """
    values = {
        parameter.name: float(value)
        for parameter, value in zip(system.parameters, p, strict=True)
        if not math.isnan(value)
    }
    links = {row.name: row.link - 1 for row in system.bodies}
    for component in system.parameterised_components:
        try:
            checked = component.check_values(values)
            if isinstance(checked, RigidBody):
                inertia_notes(system.tree, [(checked, links.get(checked.name, -1))])
        except MbsError as error:
            return str(error)
    for name, value in values.items():
        if fault := out_of_bounds(value, *system.bounds.get(name, (None, None))):
            return f"parameter {name} is {value:.6g}; {fault}"
    return ""
