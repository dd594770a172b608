"""Writer of SYMORO+ and OpenSYMORO robot files (.par) from tables of frames."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from pathlib import Path

from mbs.errors import DescriptionError
from mbs.expressions import Scalar, expression, parameters_of, to_float
from mbs.files import write_text
from mbs.formats.par import (
    BASE_EXTRAS,
    BODY_KEYS,
    FLEXIBLE,
    JOINT_EXTRAS,
    LINK_EXTRAS,
    STIFFNESS,
)
from mbs.formats.table import FrameRow, InertiaRow, RobotTable, require_table
from mbs.text import in_bracket_comment

_GEOMETRY = ("b", "d", "r", "gamma", "alpha", "theta")
_VARIABLE = {0: ("theta", "th"), 1: ("r", "r")}


def write_par(table: RobotTable, path: str | Path, *, note: str = "") -> None:
    """Write a table as a .par file.

    The format has no names of joints and bodies and no limits. They are lost, and joint j is named
    q<j> when the file is read again. Values of symbols, `guess`, `Fs_width`, `rest` and the marks
    of bodies with grouped inertial parameters are written as comments, which `read_par` reads. The
    file specifies for every joint whether it is actuated. If the table does not, the choice of the
    assembly is written.

    Args:
        table: table of frames.
        path: path of the .par file.
        note: text of a comment at the beginning of the file.

    Raises:
        DescriptionError: `table` is not a table, or a loop, a symbol, a rotor, or the drive of a
            cut joint cannot be expressed in this format.
        ExportError: the file cannot be written.
    """
    require_table(table)
    write_text("\n".join(_lines(table, note)) + "\n", path)


def _lines(table: RobotTable, note: str) -> Iterator[str]:
    NF, B = len(table.frames), len(table.loops)
    NL, NJ = NF - 2 * B, NF - B
    _check_loops(table, NL, NJ)
    _check_drives(table, NL)
    _check_symbols(table)
    yield f"(* Robotname = '{re.sub(r'[^A-Za-z0-9 _-]', '_', table.name)}' *)"
    if table.source:
        yield f"(* Source = '{in_bracket_comment(table.source)}' *)"
    if note:
        yield f"(* {in_bracket_comment(note)} *)"
    yield from _remarks(table, NJ)
    yield f"NL = {NL}\nNJ = {NJ}\nNF = {NF}\nType = {_kind(table)}"
    yield "\n(* Geometric parameters *)"
    yield _vector("ant", (row.antecedent for row in table.frames))
    yield _vector("sigma", (row.sigma for row in table.frames))
    yield _vector("mu", _motors(table))
    for key in _GEOMETRY:
        yield _vector(key, (_cell(key, j, row) for j, row in enumerate(table.frames, 1)))
    yield "\n(* Dynamic parameters and external forces *)"
    bodies = {body.frame: body for body in table.bodies}
    for key, name in BODY_KEYS.items():
        rows = (bodies.get(j, InertiaRow(j)) for j in range(1, NL + 1))
        yield _vector(key, (_text(getattr(row, name)) for row in rows))
    yield from _extras(table, LINK_EXTRAS)
    yield "\n(* Joint parameters *)"
    yield from _springs(table, NJ)
    yield from _extras(table, JOINT_EXTRAS)
    yield "\n(* Base: motion, gravity, place *)"
    yield _vector("G", (_text(value) for value in table.gravity))
    yield from _extras(table, BASE_EXTRAS)
    yield "\n(* End of definition *)"


def _remarks(table: RobotTable, NJ: int) -> Iterator[str]:
    """Yield comments for data that have no key in the format."""
    numbers = {table.joint_name(j): j for j in range(1, len(table.frames) + 1)}
    yield from (f"(* Value {name} = {value!r} *)" for name, value in table.parameters.items())
    yield from (f"(* Guess q{numbers[name]} = {value!r} *)" for name, value in table.guess.items())
    for row in table.bodies:
        for kind in ("Fs_width", "rest"):
            value, usual = expression(getattr(row, kind)), getattr(InertiaRow(row.frame), kind)
            if row.frame <= NJ and to_float(value) != usual:
                yield f"(* {kind} {row.frame} = {_text(value)} *)"
        if row.grouped and not row.is_body:
            yield f"(* grouped {row.frame} = 1 *)"


def _springs(table: RobotTable, NJ: int) -> Iterator[str]:
    stiffness = ["0"] * NJ
    for row in table.bodies:
        if "stiffness" in row.drive:
            stiffness[row.frame - 1] = _text(row.stiffness)
    if any(text != "0" for text in stiffness):
        yield _vector(FLEXIBLE, (int(text != "0") for text in stiffness))
        yield _vector(STIFFNESS, stiffness)


def _motors(table: RobotTable) -> Iterator[int]:
    """Yield 1 for actuated frames, else 0. By default, joints inside loops are passive."""
    passive = set(table.cut_frames)
    for loop in table.loops:
        moving, fixed = (_path(table, frame) for frame in loop.cut)
        passive |= moving ^ fixed
    for j, row in enumerate(table.frames, 1):
        chosen = j not in passive if row.actuated is None else row.actuated
        yield int(bool(chosen) and row.sigma != 2)


def _path(table: RobotTable, frame: int) -> set[int]:
    """Return the frames on the path from the base to this frame."""
    path: set[int] = set()
    while frame:
        path.add(frame)
        frame = table.frames[frame - 1].antecedent
    return path


def _kind(table: RobotTable) -> int:
    if table.loops:
        return 2
    return int(any(row.antecedent != j for j, row in enumerate(table.frames)))


def _cell(key: str, j: int, row: FrameRow) -> str:
    text = _text(getattr(row, key))
    moved, prefix = _VARIABLE.get(row.sigma, ("", ""))
    if key != moved:
        return text
    if text == "0":
        return f"{prefix}{j}"
    return f"{prefix}{j}{text}" if text.startswith("-") else f"{prefix}{j}+{text}"


def _text(value: Scalar) -> str:
    return str(expression(value)).replace("^", "**")


def _vector(key: str, values: Iterable[object]) -> str:
    return f"{key} = {{{','.join(map(str, values))}}}"


def _extras(table: RobotTable, keys: Iterable[str]) -> Iterator[str]:
    for key in keys:
        if key in table.extras:
            yield _vector(key, (_text(text) for text in table.extras[key]))


def _check_loops(table: RobotTable, NL: int, NJ: int) -> None:
    for k, loop in enumerate(table.loops, 1):
        if loop.joint not in ("revolute", "prismatic"):
            raise DescriptionError(
                f"{table.name}/loop {k}: a .par file has no {loop.joint} cut joint; write TOML"
            )
        if loop.cut != (NL + k, NJ + k):
            raise DescriptionError(
                f"{table.name}/loop {k}: a .par file needs the cut [{NL + k}, {NJ + k}], not"
                f" {list(loop.cut)}; number the frames of loops last"
            )


def _check_drives(table: RobotTable, NL: int) -> None:
    for row in table.bodies:
        where = f"{table.name}/body {row.frame}"
        if row.rotor is not None:
            raise DescriptionError(f"{where}: a .par file has no rotor; give Ia, or write TOML")
        given = [name for name in row.drive if name != "stiffness"]
        if row.frame > NL and given:
            raise DescriptionError(
                f"{where}: a .par file has no {given[0]} of a cut joint; cut the loop at another"
                " joint, or write TOML"
            )


def _check_symbols(table: RobotTable) -> None:
    variables = {
        f"{_VARIABLE[row.sigma][1]}{j}" for j, row in enumerate(table.frames, 1) if row.sigma != 2
    }
    for j, row in enumerate(table.frames, 1):
        for value in row.geometry.values():
            for symbol in parameters_of(expression(value)):
                if symbol.name in variables:
                    raise DescriptionError(
                        f"{table.name}/frame {j}: parameter {symbol.name} has the name of a joint"
                        " variable of .par files; rename it"
                    )
