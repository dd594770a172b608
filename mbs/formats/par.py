"""SYMORO+ and OpenSYMORO robot files (.par), read as tables of frames.

With NL links, NJ joints and B = NJ - NL loops there are NF = NJ + B frames: loop k is cut between
the frames NL + k, which moves, and NJ + k, which is fixed. The joint variable is the symbol that
stands in theta of a revolute and in r of a prismatic joint.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from mbs.errors import DescriptionError
from mbs.expressions import Expression, expression, parameters_of
from mbs.formats.files import read_text
from mbs.formats.par_file import (
    BASE_EXTRAS,
    BODY_KEYS,
    FLEXIBLE,
    FRAME_KEYS,
    JOINT_EXTRAS,
    LINK_EXTRAS,
    STIFFNESS,
    ParFile,
)
from mbs.formats.par_variable import split_variable
from mbs.formats.rows import DRIVE, GEOMETRY, CutRow, FrameRow, InertiaRow
from mbs.formats.table import RobotTable


def read_par(path: str | Path, parameters: Mapping[str, float] | None = None) -> RobotTable:
    """The table in a .par file.

    Args:
        path: of the file.
        parameters: values of the symbols in it; the others stay without a value.

    Raises:
        DescriptionError: a line cannot be read, a key is misspelt, a vector has the wrong length,
            or the table is impossible; the message names the file and the line.
    """
    file = ParFile.of(str(path), read_text(path))
    NL, NJ = file.count("NL"), file.count("NJ")
    _check_kind(file, NL, NJ)
    NF = 2 * NJ - NL
    frames = _frames(file, NF, closed=NJ > NL)
    return RobotTable(
        name=file.name or Path(path).stem,
        frames=frames,
        bodies=_bodies(file, NL, NJ, frames),
        loops=tuple(_loop(NL + k, NJ + k, frames) for k in range(1, NJ - NL + 1)),
        gravity=_gravity(file),
        parameters={**file.numbers("Value"), **(parameters or {})},
        source=file.source,
        guess=file.numbers("Guess"),
        extras=_extras(file, NL, NJ),
    )


def _check_kind(file: ParFile, NL: int, NJ: int) -> None:
    if NJ < NL:
        raise DescriptionError(f"{file.where('NJ')} is {NJ}, below NL = {NL}; give NJ >= NL")
    if "NF" in file.entries and file.count("NF") != 2 * NJ - NL:
        raise DescriptionError(
            f"{file.where('NF')} is {file.count('NF')} with NL = {NL} and NJ = {NJ}; give"
            f" 2 NJ - NL = {2 * NJ - NL}, or leave it out"
        )
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


def _frames(file: ParFile, NF: int, closed: bool) -> tuple[FrameRow, ...]:
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
    file: ParFile, j: int, texts: Mapping[str, str], closed: bool
) -> tuple[FrameRow, str | None]:
    sigma = file.integer("sigma", texts["sigma"])
    values: dict[str, Any] = {
        key: expression(texts[key], f"{file.where(key)} of frame {j}")
        for key in GEOMETRY
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


def _check_variables(file: ParFile, rows: tuple[FrameRow, ...], taken: Mapping[str, int]) -> None:
    for j, row in enumerate(rows, 1):
        for key, value in row.geometry.items():
            for symbol in parameters_of(expression(value)):
                if symbol.name in taken:
                    raise DescriptionError(
                        f"{file.where(key)} of frame {j} depends on {symbol.name}, the joint"
                        f" variable of frame {taken[symbol.name]}; write it with other symbols"
                    )


def _bodies(
    file: ParFile, NL: int, NJ: int, frames: tuple[FrameRow, ...]
) -> tuple[InertiaRow, ...]:
    remarks = {kind: _remarks(file, kind, NJ) for kind in ("Fs_width", "rest")}
    springs, grouped = _springs(file, NJ, frames), _remarks(file, "grouped", NJ)
    rows = []
    for j in range(1, NJ + 1):
        values: dict[str, Any] = {kind: at[j] for kind, at in remarks.items() if j in at}
        if j in springs:
            values["stiffness"] = springs[j]
        if j <= NL:
            values.update(_body(file, j, NL, fixed=frames[j - 1].sigma == 2))
        if values:
            rows.append(InertiaRow(j, grouped=j in grouped, **values))
    return tuple(rows)


def _springs(file: ParFile, NJ: int, frames: tuple[FrameRow, ...]) -> dict[int, Expression]:
    """The stiffness of the joints that eta makes flexible."""
    eta = file.vector(FLEXIBLE, NJ, "joint") or ()
    stiffness = file.vector(STIFFNESS, NJ, "joint")
    springs: dict[int, Expression] = {}
    for j, text in enumerate(eta, 1):
        flexible = file.integer(FLEXIBLE, text)
        if flexible not in (0, 1) or (flexible and frames[j - 1].sigma == 2):
            raise DescriptionError(
                f"{file.where(FLEXIBLE)} of joint {j} is {text}; use 0 for a rigid or fixed joint"
                " and 1 for one with a spring"
            )
        if flexible:
            value = f"{STIFFNESS}{j}" if stiffness is None else stiffness[j - 1]
            springs[j] = expression(value, f"{file.where(STIFFNESS)} of joint {j}")
    return springs


def _body(file: ParFile, j: int, NL: int, *, fixed: bool) -> dict[str, Any]:
    values: dict[str, Any] = {}
    for key, name in BODY_KEYS.items():
        column = file.vector(key, NL, "link")
        if not (fixed and name in DRIVE):
            text = f"{key}{j}" if column is None else column[j - 1]
            values[name] = expression(text, f"{file.where(key)} of link {j}")
    return values


def _remarks(file: ParFile, kind: str, NJ: int) -> dict[int, Expression]:
    """What remarks of a kind say of joints."""
    values: dict[int, Expression] = {}
    for where, name, text in file.remarked(kind):
        if not name.isdecimal() or not 1 <= int(name) <= NJ:
            raise DescriptionError(f"{where}: there is no such joint; use 1 to {NJ}")
        values[int(name)] = expression(text, where)
    return values


def _loop(moving: int, fixed: int, frames: tuple[FrameRow, ...]) -> CutRow:
    prismatic = frames[moving - 1].sigma == 1
    return CutRow((moving, fixed), "prismatic" if prismatic else "revolute")


def _gravity(file: ParFile) -> tuple[Expression, ...]:
    texts = file.vector("G", 3, "axis") or ("0", "0", "GZ")
    return tuple(expression(text, file.where("G")) for text in texts)


def _extras(file: ParFile, NL: int, NJ: int) -> dict[str, tuple[str, ...]]:
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
