"""SYMORO+ and OpenSYMORO robot files (.par), read as tables of frames.

A file holds `KEY = number` and `KEY = {value, ...}`, where a vector may run over several lines;
`(* ... *)` is a comment. With NL links, NJ joints and B = NJ - NL loops there are NF = NJ + B
frames: loop k is cut between the frames NL + k, which moves, and NJ + k, which is fixed. The joint
variable is the symbol that stands in theta of a revolute and in r of a prismatic joint.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mbs.errors import DescriptionError
from mbs.expressions import Expression, expression, parameters_of, to_float
from mbs.formats.files import read_text
from mbs.formats.par_variable import split_variable
from mbs.formats.rows import BodyRow, FrameRow, LoopRow
from mbs.formats.table import RobotTable

FRAME_KEYS = ("ant", "sigma", "b", "d", "r", "gamma", "alpha", "mu", "theta")
"""Vectors with one value for each frame."""

BODY_KEYS = {
    **{key: key for key in ("XX", "XY", "XZ", "YY", "YZ", "ZZ", "MX", "MY", "MZ", "M")},
    **{"IA": "Ia", "FV": "Fv", "FS": "Fs"},
}
"""Vectors with one value for each link, and the field of a body row that takes them."""

LINK_EXTRAS = ("FX", "FY", "FZ", "CX", "CY", "CZ")
"""Wrenches that links exert on their environment, kept as texts."""

JOINT_EXTRAS = ("eta", "k", "QP", "QDP", "GAM")
"""Vectors with one value for each joint, kept as texts."""

BASE_EXTRAS = {"W0": 3, "WP0": 3, "V0": 3, "VP0": 3, "Z": 16}
"""Vectors about the base, kept as texts, and their lengths."""

_OLD_SPELLING = {
    "Ant": "ant",
    "Sigma": "sigma",
    "B": "b",
    "D": "d",
    "R": "r",
    "Gamma": "gamma",
    "Alpha": "alpha",
    "Mu": "mu",
    "Theta": "theta",
}
_ASSIGNMENT = re.compile(r"\s*([A-Za-z_]\w*)\s*=\s*(.*)", re.DOTALL)
_COMMENT = re.compile(r"\(\*.*?\*\)", re.DOTALL)
_NAME = re.compile(r"\(\*\s*Robotname\s*=\s*'([^'\n]*)'")
_VALUE = re.compile(r"\(\*\s*Value\s+([\w.]+)\s*=\s*([-+.\deE]+)\s*\*\)")
_SOURCE = re.compile(r"\(\*\s*Source\s*=\s*'([^\n]*)'\s*\*\)")


@dataclass(frozen=True, slots=True)
class _File:
    """The assignments of a file: key -> (line number, texts of the values)."""

    path: str
    entries: Mapping[str, tuple[int, tuple[str, ...]]]

    def where(self, key: str) -> str:
        return f"{self.path}:{self.entries[key][0]}: {key}" if key in self.entries else self.path

    def vector(self, key: str, length: int, per: str) -> tuple[str, ...] | None:
        if key not in self.entries:
            return None
        values = self.entries[key][1]
        if len(values) != length:
            raise DescriptionError(
                f"{self.where(key)} has {len(values)} value(s); give {length}, one for each {per}"
            )
        return values

    def integer(self, key: str, text: str) -> int:
        value = to_float(expression(text, self.where(key)))
        if value is None or value != int(value):
            raise DescriptionError(f"{self.where(key)} is {text!r}; give a whole number")
        return int(value)

    def count(self, key: str) -> int:
        if key not in self.entries:
            raise DescriptionError(f"{self.path}: {key} is missing; add a line {key} = <number>")
        values = self.vector(key, 1, "robot")
        count = self.integer(key, values[0] if values else "")
        if not 1 <= count <= 1000:
            raise DescriptionError(f"{self.where(key)} is {count}; give 1 or more")
        return count


def read_par(path: str | Path, parameters: Mapping[str, float] | None = None) -> RobotTable:
    """The table in a .par file.

    Args:
        path: of the file.
        parameters: values of the symbols in it; the others stay without a value.

    Raises:
        DescriptionError: a line cannot be read, a vector has the wrong length, or the table is
            impossible; the message names the file and the line.
    """
    text = read_text(path)
    file = _File(str(path), _entries(str(path), text))
    NL, NJ = file.count("NL"), file.count("NJ")
    _check_kind(file, NL, NJ)
    NF = 2 * NJ - NL
    name = _NAME.search(text)
    source = _SOURCE.search(text)
    values = {symbol: float(number) for symbol, number in _VALUE.findall(text)}
    frames = _frames(file, NF, closed=NJ > NL)
    return RobotTable(
        name=name[1].strip() if name and name[1].strip() else Path(path).stem,
        frames=frames,
        bodies=tuple(_body(file, j, NL, frames[j - 1].sigma == 2) for j in range(1, NL + 1)),
        loops=tuple(_loop(NL + k, NJ + k, frames) for k in range(1, NJ - NL + 1)),
        gravity=_gravity(file),
        parameters={**values, **(parameters or {})},
        source=source[1] if source else "",
        extras=_extras(file, NL, NJ),
    )


def _entries(path: str, text: str) -> dict[str, tuple[int, tuple[str, ...]]]:
    lines = _COMMENT.sub(lambda m: "\n" * m[0].count("\n"), text).splitlines()
    entries: dict[str, tuple[int, tuple[str, ...]]] = {}
    number = 0
    while number < len(lines):
        start, line = number, lines[number]
        number += 1
        if not line.strip():
            continue
        while line.count("{") > line.count("}") and number < len(lines):
            line += "\n" + lines[number]
            number += 1
        key, values = _assignment(f"{path}:{start + 1}", line)
        if key in entries:
            raise DescriptionError(
                f"{path}:{start + 1}: {key} was given on line {entries[key][0]}; give it once"
            )
        entries[key] = (start + 1, values)
    return entries


def _assignment(where: str, line: str) -> tuple[str, tuple[str, ...]]:
    match = _ASSIGNMENT.fullmatch(line)
    value = match[2].strip() if match else ""
    braces = (value[:1], value[-1:])
    if match is None or not value or ("{" in braces) != ("}" in braces) or "{" in value[1:]:
        raise DescriptionError(
            f"{where}: {line.splitlines()[0].strip()!r} is not an assignment; write KEY = number,"
            " KEY = {value, ...} or a comment (* ... *)"
        )
    key = _OLD_SPELLING.get(match[1], match[1])
    return key, _split(value[1:-1]) if braces[0] == "{" else (value,)


def _split(text: str) -> tuple[str, ...]:
    """The values between commas that stand outside of brackets."""
    depth, parts = 0, [""]
    for letter in text:
        depth += (letter == "(") - (letter == ")")
        if letter == "," and depth == 0:
            parts.append("")
        else:
            parts[-1] += letter
    return tuple(" ".join(part.split()) for part in parts)


def _check_kind(file: _File, NL: int, NJ: int) -> None:
    if NJ < NL:
        raise DescriptionError(f"{file.where('NJ')} is {NJ}, below NL = {NL}; give NJ >= NL")
    if "Type" in file.entries:
        kind = file.integer("Type", file.entries["Type"][1][0])
        if kind not in (0, 1, 2) or (kind == 2) != (NJ > NL):
            raise DescriptionError(
                f"{file.where('Type')} is {kind} with NL = {NL} and NJ = {NJ}; use 0 or 1 for an"
                " open chain (NJ = NL) and 2 for closed loops (NJ > NL)"
            )
    for key in ("is_floating", "is_mobile"):
        if key in file.entries and file.entries[key][1][0] not in ("0", "False"):
            raise DescriptionError(
                f"{file.where(key)} is {file.entries[key][1][0]}, but the base of a table does not"
                " move; set it to 0 and put a free joint under the robot instead"
            )
    eta = file.vector("eta", NJ, "joint") or ()
    if any(to_float(expression(text, file.where("eta"))) != 0 for text in eta):
        raise DescriptionError(
            f"{file.where('eta')} makes joints flexible, which is not supported; set eta to 0"
        )


def _frames(file: _File, NF: int, closed: bool) -> tuple[FrameRow, ...]:
    columns = {key: file.vector(key, NF, "frame") for key in FRAME_KEYS}
    for key in ("ant", "sigma"):
        if columns[key] is None:
            raise DescriptionError(f"{file.path}: {key} is missing; add {key} = {{...}}")
    taken: dict[str, int] = {}
    rows = []
    for j in range(1, NF + 1):
        texts = {key: column[j - 1] for key, column in columns.items() if column is not None}
        row, variable = _frame(file, j, texts, closed)
        if variable in taken:
            raise DescriptionError(
                f"{file.path}: frames {taken[variable]} and {j} have the same joint variable"
                f" {variable}; give each joint its own"
            )
        if variable:
            taken[variable] = j
        rows.append(row)
    _check_variables(file, tuple(rows), taken)
    return tuple(rows)


def _frame(
    file: _File, j: int, texts: Mapping[str, str], closed: bool
) -> tuple[FrameRow, str | None]:
    sigma = file.integer("sigma", texts["sigma"])
    values: dict[str, Any] = {
        key: expression(texts[key], f"{file.where(key)} of frame {j}")
        for key in ("gamma", "b", "alpha", "d", "theta", "r")
        if key in texts
    }
    key = {0: "theta", 1: "r"}.get(sigma)
    variable = None
    if key in values:
        where = f"{file.where(key)} of frame {j}"
        variable, values[key] = split_variable(where, values[key], j, sigma)
    driven = file.integer("mu", texts["mu"]) == 1 if "mu" in texts else None if closed else True
    row = FrameRow(
        antecedent=file.integer("ant", texts["ant"]),
        sigma=sigma,
        actuated=None if sigma == 2 else driven,
        **values,
    )
    return row, variable


def _check_variables(file: _File, rows: tuple[FrameRow, ...], taken: Mapping[str, int]) -> None:
    for j, row in enumerate(rows, 1):
        for key, value in row.geometry.items():
            for symbol in parameters_of(expression(value)):
                if symbol.name in taken:
                    raise DescriptionError(
                        f"{file.where(key)} of frame {j} depends on {symbol.name}, the joint"
                        f" variable of frame {taken[symbol.name]}; write it with other symbols"
                    )


def _body(file: _File, j: int, NL: int, fixed: bool) -> BodyRow:
    values: dict[str, Any] = {}
    for key, name in BODY_KEYS.items():
        column = file.vector(key, NL, "link")
        if not (fixed and name in ("Ia", "Fv", "Fs")):
            text = f"{key}{j}" if column is None else column[j - 1]
            values[name] = expression(text, f"{file.where(key)} of link {j}")
    return BodyRow(frame=j, **values)


def _loop(moving: int, fixed: int, frames: tuple[FrameRow, ...]) -> LoopRow:
    prismatic = frames[moving - 1].sigma == 1
    return LoopRow((moving, fixed), "prismatic" if prismatic else "revolute")


def _gravity(file: _File) -> tuple[Expression, ...]:
    texts = file.vector("G", 3, "axis") or ("0", "0", "GZ")
    return tuple(expression(text, file.where("G")) for text in texts)


def _extras(file: _File, NL: int, NJ: int) -> dict[str, tuple[str, ...]]:
    lengths = {
        **dict.fromkeys(LINK_EXTRAS, NL),
        **dict.fromkeys(JOINT_EXTRAS, NJ),
        **BASE_EXTRAS,
    }
    kept: dict[str, tuple[str, ...]] = {}
    for key, length in lengths.items():
        texts = file.vector(key, length, "element")
        if texts is not None:
            kept[key] = tuple(str(expression(text, file.where(key))) for text in texts)
    return kept
