"""Reader and writer of tables of frames as TOML files, and as dicts of the same schema."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

from mbs.components import Rotor
from mbs.errors import DescriptionError
from mbs.expressions import Number, Scalar
from mbs.files import write_text
from mbs.formats.files import read_text
from mbs.formats.table import (
    BODY_SCALARS,
    GEOMETRY,
    JOINTS,
    CutRow,
    FrameRow,
    InertiaRow,
    RobotTable,
    require_table,
)
from mbs.text import did_you_mean

_TOP = ("name", "gravity", "parameters", "frame", "body", "loop", "source", "guess", "extras")
_MOTOR = ("velocity", "effort")
_FRAME = ("antecedent", "joint", "sigma", "actuated", "mu", *GEOMETRY, "limits", "name", *_MOTOR)
_BODY = ("frame", *BODY_SCALARS, "rotor", "name", "grouped")
_ROTOR = ("inertia", "ratio", "axis")
_LOOP = ("cut", "joint")
_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")


def read_toml(path: str | Path) -> RobotTable:
    """Read a TOML file as a table of frames.

    Args:
        path: path of the .toml file.

    Raises:
        DescriptionError: the file is missing or not TOML, or the table is inconsistent.
    """
    text = read_text(path)
    try:
        data = tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # also for unterminated brackets and digits
        raise DescriptionError(f"{path}: the file is not TOML: {error}; correct it") from None
    return from_dict(data)


def from_dict(data: Mapping[str, Any]) -> RobotTable:
    """Return the table of frames of a dict in the TOML schema.

    Args:
        data: content of a TOML file: name, frame, body, loop, gravity, parameters, source, guess
            and extras. Only the name and one frame are required.

    Raises:
        DescriptionError: a key is unknown or missing, a value has the wrong type, or the table is
            inconsistent.
    """
    if not isinstance(data, Mapping):
        raise DescriptionError(f"robot: {data!r} is not a table; give a dict with name and frame")
    name = _text(data, "name", "robot")
    if not name:
        raise DescriptionError("robot: the name is missing; give it as name = '...'")
    _check_keys(data, _TOP, name)
    return RobotTable(
        name=name,
        frames=tuple(_frame(row, where) for row, where in _rows(data, "frame", name)),
        bodies=tuple(_body(row, where) for row, where in _rows(data, "body", name)),
        loops=tuple(_loop(row, where) for row, where in _rows(data, "loop", name)),
        # default of a file without gravity: along -z, as in `Mechanism` [m/s^2]
        gravity=data.get("gravity", (0.0, 0.0, -9.81)),
        parameters=_table(data, "parameters", name),
        source=_text(data, "source", name),
        guess=_table(data, "guess", name),
        extras={key: _texts(v, f"{name}/{key}") for key, v in _table(data, "extras", name).items()},
    )


def write_toml(table: RobotTable, path: str | Path) -> None:
    """Write a table of frames as a TOML file, which `read_toml` reads as an equal table.

    Args:
        table: table of frames.
        path: path of the .toml file.

    Raises:
        DescriptionError: the argument is not a table.
        ExportError: the file cannot be written.
    """
    write_text("\n".join(_lines(to_dict(table))) + "\n", path)


def to_dict(table: RobotTable) -> dict[str, Any]:
    """Return a table of frames as a dict in the TOML schema, without default values.

    Args:
        table: table of frames.

    Raises:
        DescriptionError: the argument is not a table.
    """
    require_table(table)
    data: dict[str, Any] = {"name": table.name}
    if table.source:
        data["source"] = table.source
    data["gravity"] = [_plain(value) for value in table.gravity]
    if table.parameters:
        data["parameters"] = dict(table.parameters)
    data["frame"] = [_frame_dict(row) for row in table.frames]
    data["body"] = [_body_dict(row) for row in table.bodies]
    data["loop"] = [{"cut": list(loop.cut), "joint": loop.joint} for loop in table.loops]
    if table.guess:
        data["guess"] = dict(table.guess)
    if table.extras:
        data["extras"] = {key: list(texts) for key, texts in table.extras.items()}
    return data


def _frame(row: Mapping[str, Any], where: str) -> FrameRow:
    """Return the frame row of a dict; raise a DescriptionError that begins with `where`."""
    _check_keys(row, _FRAME, where)
    if "antecedent" not in row:
        raise DescriptionError(f"{where}: the antecedent is missing; give 0 or an earlier frame")
    return FrameRow(
        antecedent=row["antecedent"],
        sigma=_sigma(row, where),
        actuated=_actuated(row, where),
        limits=row.get("limits"),
        name=_text(row, "name", where),
        **{key: row[key] for key in (*GEOMETRY, *_MOTOR) if key in row},
    )


def _sigma(row: Mapping[str, Any], where: str) -> Any:
    """Return sigma of a frame from its key `joint` or `sigma`.

    Raise a DescriptionError if the joint is unknown or the two keys contradict.
    """
    if "joint" not in row:
        return row.get("sigma", 0)
    joint = row["joint"]
    if joint not in JOINTS:
        raise DescriptionError(
            f"{where}: joint {joint!r} is unknown; {did_you_mean(str(joint), JOINTS)}"
        )
    sigma = JOINTS.index(joint)
    if row.get("sigma", sigma) != sigma:
        raise DescriptionError(
            f"{where}: sigma {row['sigma']!r} contradicts joint {joint!r}; leave one of them out"
        )
    return sigma


def _actuated(row: Mapping[str, Any], where: str) -> bool | None:
    """Return the key `actuated` or `mu` of a frame as bool, None if both are missing.

    Raise a DescriptionError if it is not a truth value or the two keys contradict.
    """
    given = [row[key] for key in ("actuated", "mu") if key in row]
    if any(value not in (True, False) for value in given) or len(set(given)) > 1:
        raise DescriptionError(
            f"{where}: actuated (mu) is {given}; give true or false, or mu = 1 or 0"
        )
    return bool(given[0]) if given else None


def _body(row: Mapping[str, Any], where: str) -> InertiaRow:
    """Return the body row of a dict; raise a DescriptionError that begins with `where`."""
    _check_keys(row, _BODY, where)
    if "frame" not in row:
        raise DescriptionError(f"{where}: the frame is missing; give the number of its frame")
    grouped = row.get("grouped", False)
    if not isinstance(grouped, bool):
        raise DescriptionError(f"{where}: grouped is {grouped!r}; give true or false")
    return InertiaRow(
        frame=row["frame"],
        name=_text(row, "name", where),
        grouped=grouped,
        rotor=_rotor(row["rotor"], f"{where}, rotor") if "rotor" in row else None,
        **{key: row[key] for key in BODY_SCALARS if key in row},
    )


def _rotor(data: Any, where: str) -> Rotor:
    """Return the rotor of a dict; raise a DescriptionError that begins with `where`."""
    if not isinstance(data, Mapping) or "inertia" not in data:
        raise DescriptionError(
            f"{where} is {data!r}; give a table {{inertia = ..., ratio = ..., axis = ...}}"
        )
    _check_keys(data, _ROTOR, where)
    try:
        return Rotor(**data)
    except DescriptionError as error:
        raise DescriptionError(f"{where.removesuffix('rotor')}{error}") from None


def _loop(row: Mapping[str, Any], where: str) -> CutRow:
    """Return the cut of a loop from a dict; raise a DescriptionError that begins with `where`."""
    _check_keys(row, _LOOP, where)
    cut = row.get("cut")
    if not isinstance(cut, (list, tuple)) or len(cut) != 2:
        raise DescriptionError(f"{where}: cut is {cut!r}; give the two frames [k, k+B]")
    return CutRow((cut[0], cut[1]), row.get("joint", "revolute"))


def _rows(data: Mapping[str, Any], key: str, name: str) -> Iterable[tuple[Mapping[str, Any], str]]:
    """Return the dicts under `key` with their location for error messages.

    Raise a DescriptionError if the value is not a list of dicts. `name` is that of the robot.
    """
    rows = data.get(key, ())
    if not isinstance(rows, (list, tuple)) or not all(isinstance(row, Mapping) for row in rows):
        raise DescriptionError(f"{name}: {key} is {rows!r}; give a list of tables [[{key}]]")
    return ((row, f"{name}/{key} {number}") for number, row in enumerate(rows, 1))


def _table(data: Mapping[str, Any], key: str, name: str) -> Mapping[str, Any]:
    """Return the dict under `key`, empty if it is missing.

    Raise a DescriptionError for other types.
    """
    table = data.get(key, {})
    if not isinstance(table, Mapping):
        raise DescriptionError(f"{name}: {key} is {table!r}; give a table of names and values")
    return table


def _text(data: Mapping[str, Any], key: str, where: str) -> str:
    """Return the text under `key`, empty if it is missing.

    Raise a DescriptionError for other types.
    """
    text = data.get(key, "")
    if not isinstance(text, str):
        raise DescriptionError(f"{where}: {key} is {text!r}; give a text in quotes")
    return text


def _texts(values: Any, where: str) -> tuple[str, ...]:
    """Return a list of texts as a tuple; raise a DescriptionError for other types."""
    if not isinstance(values, (list, tuple)) or not all(isinstance(v, str) for v in values):
        raise DescriptionError(f"{where}: {values!r} is not a list of texts; quote each value")
    return tuple(values)


def _check_keys(data: Mapping[str, Any], known: tuple[str, ...], where: str) -> None:
    """Raise a DescriptionError if a dict has a key that is not known."""
    for key in data:
        if key not in known:
            raise DescriptionError(f"{where}: key {key!r} is unknown; {did_you_mean(key, known)}")


def _frame_dict(row: FrameRow) -> dict[str, Any]:
    """Return a frame row as a dict in the TOML schema, without default values."""
    data: dict[str, Any] = {"antecedent": row.antecedent, "joint": JOINTS[row.sigma]}
    if row.actuated is not None:
        data["actuated"] = row.actuated
    data.update(_without_defaults(row, GEOMETRY))
    if row.limits is not None:
        data["limits"] = list(row.limits)
    if row.name:
        data["name"] = row.name
    data.update({key: _range(getattr(row, key)) for key in _MOTOR if getattr(row, key) is not None})
    return data


def _range(pair: tuple[float, float]) -> float | list[float]:
    """Return limits as the upper limit if they are symmetric, otherwise as [lower, upper]."""
    lower, upper = pair
    return upper if lower == -upper else [lower, upper]


def _body_dict(row: InertiaRow) -> dict[str, Any]:
    """Return a body row as a dict in the TOML schema, without default values."""
    data: dict[str, Any] = {"frame": row.frame, **_without_defaults(row, BODY_SCALARS)}
    if row.rotor is not None:
        data["rotor"] = _without_defaults(row.rotor, ("inertia", "ratio"))
        if row.rotor.axis is not None:
            data["rotor"]["axis"] = list(row.rotor.axis)
    if row.name:
        data["name"] = row.name
    if row.grouped:
        data["grouped"] = True
    return data


def _without_defaults(row: FrameRow | InertiaRow | Rotor, scalars: Iterable[str]) -> dict[str, Any]:
    """Return the fields `scalars` of a row that differ from their defaults, by name."""
    defaults = {field.name: field.default for field in fields(row)}
    values = {key: _plain(getattr(row, key)) for key in scalars}
    return {key: value for key, value in values.items() if value != defaults[key]}


def _plain(value: Scalar) -> float | str:
    """Return a number as float, and another expression as text."""
    return value.value if isinstance(value, Number) else str(value)


def _lines(data: Mapping[str, Any]) -> Iterable[str]:
    """Return the lines of the TOML file of a dict: values, then tables, then lists of tables."""
    rows = {key: v for key, v in data.items() if key in ("frame", "body", "loop")}
    tables = {key: v for key, v in data.items() if isinstance(v, Mapping)}
    for key, value in data.items():
        if key not in rows and key not in tables:
            yield f"{key} = {_toml(value)}"
    for key, table in tables.items():
        yield f"\n[{key}]"
        yield from (f"{_key(name)} = {_toml(value)}" for name, value in table.items())
    for key, group in rows.items():
        for row in group:
            yield f"\n[[{key}]]"
            yield from (f"{name} = {_toml(value)}" for name, value in row.items())


def _key(name: str) -> str:
    """Return a TOML key, in quotes if its characters require it."""
    return name if _BARE_KEY.fullmatch(name) else _toml(name)


def _toml(value: Any) -> str:
    """Return a value in TOML syntax: bool, text, number, list or table."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, list):
        return f"[{', '.join(_toml(element) for element in value)}]"
    if isinstance(value, Mapping):
        return f"{{ {', '.join(f'{_key(k)} = {_toml(v)}' for k, v in value.items())} }}"
    return repr(value)
