"""Reader and writer of SYMORO+ and OpenSYMORO robot files (.par) as tables of frames.

With NL links, NJ joints and B = NJ - NL loops there are NF = NJ + B frames: loop k is cut between
the frames NL + k, which moves with the joint, and NJ + k, which is fixed. The joint variable is the
symbol in theta of a revolute joint and in r of a prismatic joint.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from mbs.errors import DescriptionError
from mbs.expressions import (
    Expression,
    Number,
    Operation,
    Parameter,
    Scalar,
    expression,
    number,
    parameters_of,
    to_float,
    whole_number,
)
from mbs.files import write_text
from mbs.formats.files import read_text
from mbs.formats.table import (
    DRIVE,
    GEOMETRY,
    CutRow,
    FrameRow,
    InertiaRow,
    RobotTable,
    require_table,
)
from mbs.text import in_bracket_comment, quoted

# Keys and lines of .par files, without interpretation.

# A file contains `KEY = number` and `KEY = {value, ...}`; a vector may have several lines. `(* ...
# *)` is a comment. The comments `(* Value L = 0.3 *)`, `(* Guess q2 = -1.57 *)`, `(* Fs_width 3 =
# 0.01 *)`, `(* rest 3 = 0.1 *)` and `(* grouped 3 = 1 *)` contain data without a key in the format.


FRAME_KEYS = ("ant", "sigma", "b", "d", "r", "gamma", "alpha", "mu", "theta")
"""Vectors with one value per frame."""

BODY_KEYS = {
    **{key: key for key in ("XX", "XY", "XZ", "YY", "YZ", "ZZ", "MX", "MY", "MZ", "M")},
    **{"IA": "Ia", "FV": "Fv", "FS": "Fs"},
}
"""Vectors with one value per link, and the field of the body row for each."""

LINK_EXTRAS = ("FX", "FY", "FZ", "CX", "CY", "CZ")
"""Wrenches of links on their environment, stored as texts."""

FLEXIBLE, STIFFNESS = "eta", "k"
"""Vectors with one value per joint: 1 for a joint with a spring, and its stiffness."""

JOINT_EXTRAS = ("QP", "QDP", "GAM")
"""Vectors with one value per joint, stored as texts."""

BASE_EXTRAS = {"W0": 3, "WP0": 3, "V0": 3, "VP0": 3, "Z": 16}
"""Vectors of the base, stored as texts, and their lengths."""

_GEOMETRY = tuple(key for key in FRAME_KEYS if key in GEOMETRY)
"""Vectors of the six geometric parameters, in the order of the files."""

_OTHER_KEYS = ("NL", "NJ", "NF", "Type", "G", "is_floating", "is_mobile")

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
_KNOWN = (
    *FRAME_KEYS,
    *_OLD_SPELLING,
    *BODY_KEYS,
    *LINK_EXTRAS,
    FLEXIBLE,
    STIFFNESS,
    *JOINT_EXTRAS,
    *BASE_EXTRAS,
    *_OTHER_KEYS,
)
_ASSIGNMENT = re.compile(r"\s*([A-Za-z_]\w*)\s*=\s*(.*)", re.DOTALL)
_OF_JOINTS = ("Fs_width", "rest")
_REMARKS = ("Value", "Guess", *_OF_JOINTS, "grouped")
_REMARKED = re.compile(r"[\w.]+")
_SHORTEST_MISSPELT, _SIMILAR = 3, 0.75
"""Minimum length of a key that is checked for misspelling, and similarity ratio of difflib: one
wrong letter in four. With two of three letters alike it is considered another name."""


@dataclass(frozen=True, slots=True)
class ParFile:
    """Assignments and comments of a .par file.

    Attributes:
        path: path of the file.
        name, source: name and source of the robot; empty if the file does not contain them.
        entries: key -> (line number, texts of the values).
        remarks: (kind, name) -> (line number, text), with the kind Value, Guess, Fs_width, rest or
            grouped.
    """

    path: str
    name: str
    source: str
    entries: Mapping[str, tuple[int, tuple[str, ...]]]
    remarks: Mapping[tuple[str, str], tuple[int, str]]

    @staticmethod
    def of(path: str, text: str) -> ParFile:
        """Parse the text of a .par file.

        Args:
            path: path of the file, for error messages.
            text: content of the file.

        Raises:
            DescriptionError: a line cannot be read, or its key is misspelt or given twice.
        """
        lines, comments = _without_comments(text)
        entries, remarks = _entries(path, lines), _line_remarks(path, comments)
        said = [
            _key_and_value(comment) for _, comment in reversed(comments)
        ]  # first of a kind counts
        quotes = {key: value[1:] for key, value in said if value[:1] == "'"}
        name, closed, _ = quotes.get("Robotname", "").partition("'")
        source = quotes.get("Source", "")
        return ParFile(
            path,
            name.strip() if closed and "\n" not in name else "",
            source[:-1] if source[-1:] == "'" and "\n" not in source else "",
            entries,
            remarks,
        )

    def where(self, key: str) -> str:
        """Return file, line and key for error messages; the file alone if the key is missing.

        Args:
            key: key of the file, such as "theta".
        """
        return f"{self.path}:{self.entries[key][0]}: {key}" if key in self.entries else self.path

    def vector(self, key: str, length: int, per: str) -> tuple[str, ...] | None:
        """Return the values of a key as texts, or None if the file does not contain the key.

        Args:
            key: key of a vector.
            length: required number of values.
            per: element of the robot that has one value each, for the error message.

        Raises:
            DescriptionError: the number of values is not `length`.
        """
        if key not in self.entries:
            return None
        values = self.entries[key][1]
        if len(values) != length:
            raise DescriptionError(
                f"{self.where(key)} has {len(values)} value(s); give {length}, one for each {per}"
            )
        return values

    def integer(self, key: str, text: str) -> int:
        """Return the text of a value as an integer.

        Args:
            key: key of the value, for the error message.
            text: text of the value.

        Raises:
            DescriptionError: the text is not an integer.
        """
        return whole_number(text, self.where(key))

    def count(self, key: str) -> int:
        """Return the number of links, joints or frames.

        Args:
            key: NL (links), NJ (joints) or NF (frames).

        Raises:
            DescriptionError: the key is missing, or its value is not an integer from 1 to 1000.
        """
        if key not in self.entries:
            raise DescriptionError(f"{self.path}: {key} is missing; add a line {key} = <number>")
        values = self.vector(key, 1, "robot")
        count = self.integer(key, values[0] if values else "")
        if not 1 <= count <= 1000:
            raise DescriptionError(f"{self.where(key)} is {count}; give 1 to 1000")
        return count

    def remarked(self, kind: str) -> Iterator[tuple[str, str, str]]:
        """Yield (location for error messages, name, text) of every data comment of a kind.

        Args:
            kind: "Value", "Guess", "Fs_width", "rest" or "grouped".
        """
        for (found, name), (line, text) in self.remarks.items():
            if found == kind:
                yield f"{self.path}:{line}: {kind} {name}", name, text

    def numbers(self, kind: str) -> dict[str, float]:
        """Return the values of all data comments of a kind as numbers, by name.

        Args:
            kind: "Value" or "Guess".

        Raises:
            DescriptionError: a value is not a number.
        """
        return {name: number(text, where) for where, name, text in self.remarked(kind)}


def _without_comments(text: str) -> tuple[list[str], list[tuple[int, str]]]:
    """Return the lines of a text without comments, and (line number, text) of every comment."""
    kept, comments = [], []
    after, line = 0, 1
    while (start := text.find("(*", after)) >= 0 and (end := text.find("*)", start + 2)) >= 0:
        line += text.count("\n", after, start)
        inside = text[start + 2 : end]
        comments.append((line, inside))
        breaks = inside.count("\n")
        kept += [text[after:start], "\n" * breaks]
        after, line = end + 2, line + breaks
    kept.append(text[after:])
    return "".join(kept).splitlines(), comments


def _key_and_value(comment: str) -> tuple[str, str]:
    """Split a comment such as `Source = 'a book'` at the first "=" into key and value."""
    key, _, value = comment.partition("=")
    return " ".join(key.split()), value.strip()


def _entries(path: str, lines: list[str]) -> dict[str, tuple[int, tuple[str, ...]]]:
    """Return the assignments in lines without comments: key -> (line number, texts of the values).

    Raise a DescriptionError if a line is not an assignment or a key is given twice.
    """
    entries: dict[str, tuple[int, tuple[str, ...]]] = {}
    number = 0
    while number < len(lines):
        start, depth = number, 0
        while number < len(lines) and (number == start or depth > 0):
            depth += lines[number].count("{") - lines[number].count("}")
            number += 1
        if not lines[start].strip():
            continue
        key, values = _assignment(f"{path}:{start + 1}", "\n".join(lines[start:number]))
        if key in entries:
            raise DescriptionError(
                f"{path}:{start + 1}: {key} was given on line {entries[key][0]}; give it once"
            )
        entries[key] = (start + 1, values)
    return entries


def _line_remarks(
    path: str, comments: list[tuple[int, str]]
) -> dict[tuple[str, str], tuple[int, str]]:
    """Return the comments that contain data: (kind, name) -> (line number, text of the value).

    `comments` are (line number, text). Raise a DescriptionError if a datum is given twice.
    """
    remarks: dict[tuple[str, str], tuple[int, str]] = {}
    for line, comment in comments:
        key, value = _key_and_value(comment)
        kind, _, name = key.partition(" ")
        if kind not in _REMARKS or not _REMARKED.fullmatch(name) or "=" not in comment:
            continue
        if "\n" in value:  # an ordinary text, not an assignment
            continue
        if (kind, name) in remarks:
            raise DescriptionError(
                f"{path}:{line}: {kind} {name} was given on line {remarks[kind, name][0]}; give it"
                " once"
            )
        remarks[kind, name] = line, value
    return remarks


def _assignment(where: str, line: str) -> tuple[str, tuple[str, ...]]:
    """Split an assignment into its key, in the present spelling, and the texts of its values.

    Raise a DescriptionError that begins with `where` if the line is not an assignment.
    """
    match = _ASSIGNMENT.fullmatch(line)
    value = match[2].strip() if match else ""
    braces = (value[:1], value[-1:])
    if match is None or not value or ("{" in braces) != ("}" in braces) or "{" in value[1:]:
        raise DescriptionError(
            f"{where}: {quoted(line.splitlines()[0].strip())} is not an assignment; write"
            " KEY = number, KEY = {value, ...} or a comment (* ... *)"
        )
    _check_spelling(where, match[1])
    key = _OLD_SPELLING.get(match[1], match[1])
    return key, _split(value[1:-1]) if braces[0] == "{" else (value,)


def _split(text: str) -> tuple[str, ...]:
    """Split a text at the commas outside parentheses, and join the blanks inside each part."""
    depth, start, parts = 0, 0, []
    for k, letter in enumerate(text):
        depth += (letter == "(") - (letter == ")")
        if letter == "," and depth == 0:
            parts.append(text[start:k])
            start = k + 1
    return tuple(" ".join(part.split()) for part in (*parts, text[start:]))


def _check_spelling(where: str, key: str) -> None:
    """Raise a DescriptionError if a key is similar to a known key.

    Other unknown keys are allowed.
    """
    if key in _KNOWN:
        return
    folded = {known.casefold() for known in _KNOWN}
    cutoff = _SIMILAR if len(key) >= _SHORTEST_MISSPELT else 1.0
    near = get_close_matches(key.casefold(), folded, n=1, cutoff=cutoff)
    if near:
        meant = [known for known in _KNOWN if known.casefold() == near[0]]
        nearest = get_close_matches(key, meant, n=1, cutoff=0)[0]
        raise DescriptionError(f"{where}: key {key!r} is unknown; did you mean {nearest!r}?")


# Joint variable in an expression such as `th2 - Pi/2`, and its constant offset.


_USUAL = {0: r"(th|theta|q|t)_?{j}", 1: r"(r|q|R)_?{j}"}
_SHORT = {0: "th", 1: "r"}
"""Variable names of SYMORO, which are preferred if several symbols are candidates."""

_KIND = {0: "revolute", 1: "prismatic"}

_VARIED = {0: "theta", 1: "r"}
"""Vector that contains the joint variable."""


def split_variable(where: str, value: Expression, j: int, sigma: int) -> tuple[str, Expression]:
    """Split an expression into the joint variable of frame j and a constant.

    The variable is the only symbol in the expression or, among several, the symbol named after the
    joint: th2, else theta2, q2 or t2 in revolute joint 2; r2, else q2 or R2 in prismatic joint 2.

    Args:
        where: location of the expression, for error messages.
        value: theta of a revolute joint or r of a prismatic joint.
        j: number of the frame.
        sigma: 0 revolute, 1 prismatic.

    Returns:
        Name of the variable, and the constant that is added to it.

    Raises:
        DescriptionError: there is no variable, or the expression is not the variable plus a
            constant.
    """
    variable = _variable(where, value, j, sigma)
    rest: Expression | None = None
    found = 0
    for sign, term in _terms(value, variable):
        if isinstance(term, Parameter) and term.name == variable and sign > 0:
            found += 1
        else:
            rest = _add(rest, sign, term)
    constant = Number(0.0) if rest is None else rest
    if found != 1 or any(p.name == variable for p in parameters_of(constant)):
        raise DescriptionError(
            f"{where} is {value}; write the joint variable {variable} plus a constant"
        )
    return variable, constant


def _variable(where: str, value: Expression, j: int, sigma: int) -> str:
    """Return the name of the joint variable of frame j in the expression `value`.

    The rule is that of `split_variable`; sigma is 0 (revolute) or 1 (prismatic). Raise a
    DescriptionError if no symbol, or more than one, is a candidate.
    """
    names = list(dict.fromkeys(p.name for p in parameters_of(value)))
    if len(names) == 1:
        return names[0]
    if f"{_SHORT[sigma]}{j}" in names:
        return f"{_SHORT[sigma]}{j}"
    usual = [name for name in names if re.fullmatch(_USUAL[sigma].format(j=j), name)]
    if len(usual) != 1:
        raise DescriptionError(
            f"{where} is {value}, which does not show the variable of this {_KIND[sigma]} joint;"
            f" name it {_SHORT[sigma]}{j}"
        )
    return usual[0]


def _terms(value: Expression, variable: str, sign: int = 1) -> Iterator[tuple[int, Expression]]:
    """Yield the terms of a sum as (sign, term); terms with the variable are split completely."""
    if isinstance(value, Operation) and value.operator in ("+", "-"):
        left, right = value.arguments
        other = sign if value.operator == "+" else -sign
        yield from _terms(left, variable, sign)
        if any(p.name == variable for p in parameters_of(right)):
            yield from _terms(right, variable, other)
        else:
            yield other, right
    elif isinstance(value, Operation) and value.operator == "negate":
        yield from _terms(value.arguments[0], variable, -sign)
    else:
        yield sign, value


def _add(rest: Expression | None, sign: int, term: Expression) -> Expression:
    """Return rest + sign term; `rest` is None for an empty sum."""
    if rest is None:
        return term if sign > 0 else -term
    return rest + term if sign > 0 else rest - term


# Reader of complete files.


def read_par(path: str | Path, parameters: Mapping[str, float] | None = None) -> RobotTable:
    """Read a .par file as a table of frames.

    Args:
        path: path of the file.
        parameters: values of symbols, which override values in the file. Other symbols have no
            value.

    Raises:
        DescriptionError: a line cannot be read, a key is misspelt, a vector has the wrong length,
            or the table is inconsistent. The message names the file and the line.
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
    """Raise a DescriptionError if NF or Type contradicts NL and NJ, or if the base moves."""
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
    """Return the NF frame rows of a file; `closed` is True if the robot has closed loops.

    Raise a DescriptionError if `ant` or `sigma` is missing or two joints have the same variable.
    """
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
    """Return the row of frame j and the name of its joint variable (None for a fixed frame).

    `texts` are the values of the frame by key, `closed` is True for a robot with closed loops.
    """
    sigma = file.integer("sigma", texts["sigma"])
    values: dict[str, Any] = {
        key: expression(texts[key], f"{file.where(key)} of frame {j}")
        for key in GEOMETRY
        if key in texts
    }
    key = _VARIED.get(sigma)
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
    """Raise a DescriptionError if a geometric parameter depends on a joint variable.

    `taken` gives the frame of each joint variable.
    """
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
    """Return the body rows of a file with NL links and NJ joints.

    They contain the inertia of links, and the drive, spring and friction width of joints.
    """
    remarks = {kind: _remarks(file, kind, NJ) for kind in _OF_JOINTS}
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
    """Return the spring stiffness of the flexible joints (eta = 1) by joint number, from 1 to NJ.

    Raise a DescriptionError if eta is invalid or a fixed frame is flexible.
    """
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
    """Return inertial and drive parameters of link j by name; `fixed` is True for sigma = 2.

    A missing vector gives symbols, such as XX3.
    """
    values: dict[str, Any] = {}
    for key, name in BODY_KEYS.items():
        column = file.vector(key, NL, "link")
        if not (fixed and name in DRIVE):
            text = f"{key}{j}" if column is None else column[j - 1]
            values[name] = expression(text, f"{file.where(key)} of link {j}")
    return values


def _remarks(file: ParFile, kind: str, NJ: int) -> dict[int, Expression]:
    """Return the expressions in data comments of a kind, such as "rest", by joint number.

    Raise a DescriptionError if a number is not between 1 and NJ.
    """
    values: dict[int, Expression] = {}
    for where, name, text in file.remarked(kind):
        if not name.isdecimal() or not 1 <= int(name) <= NJ:
            raise DescriptionError(f"{where}: there is no such joint; use 1 to {NJ}")
        values[int(name)] = expression(text, where)
    return values


def _loop(moving: int, fixed: int, frames: tuple[FrameRow, ...]) -> CutRow:
    """Return the cut of a loop between the frames with the numbers `moving` and `fixed`."""
    prismatic = frames[moving - 1].sigma == 1
    return CutRow((moving, fixed), "prismatic" if prismatic else "revolute")


def _gravity(file: ParFile) -> tuple[Expression, ...]:
    """Return the gravity of a file in the base frame; by default along z, with the symbol GZ."""
    texts = file.vector("G", 3, "axis") or ("0", "0", "GZ")
    return tuple(expression(text, file.where("G")) for text in texts)


def _extras(file: ParFile, NL: int, NJ: int) -> dict[str, tuple[str, ...]]:
    """Return the vectors that are only kept for writing, as texts by key.

    NL and NJ are the numbers of links and joints, which give the lengths of the vectors.
    """
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


# Writer.


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
    """Yield the lines of the .par file of a table; `note` is written as a comment.

    Raise a DescriptionError if the format cannot express a part of the table.
    """
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
    yield from _remark_lines(table, NJ)
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
    yield from _extra_lines(table, LINK_EXTRAS)
    yield "\n(* Joint parameters *)"
    yield from _spring_lines(table, NJ)
    yield from _extra_lines(table, JOINT_EXTRAS)
    yield "\n(* Base: motion, gravity, place *)"
    yield _vector("G", (_text(value) for value in table.gravity))
    yield from _extra_lines(table, BASE_EXTRAS)
    yield "\n(* End of definition *)"


def _remark_lines(table: RobotTable, NJ: int) -> Iterator[str]:
    """Yield comments with the data that have no key in the format; joints are 1 to NJ."""
    numbers = {table.joint_name(j): j for j in range(1, len(table.frames) + 1)}
    yield from (f"(* Value {name} = {value!r} *)" for name, value in table.parameters.items())
    yield from (f"(* Guess q{numbers[name]} = {value!r} *)" for name, value in table.guess.items())
    for row in table.bodies:
        for kind in _OF_JOINTS:
            value, usual = expression(getattr(row, kind)), getattr(InertiaRow(row.frame), kind)
            if row.frame <= NJ and to_float(value) != usual:
                yield f"(* {kind} {row.frame} = {_text(value)} *)"
        if row.grouped and not row.is_body:
            yield f"(* grouped {row.frame} = 1 *)"


def _spring_lines(table: RobotTable, NJ: int) -> Iterator[str]:
    """Yield the lines of the vectors eta and k; none if no joint has a spring."""
    stiffness = ["0"] * NJ
    for row in table.bodies:
        if "stiffness" in row.drive:
            stiffness[row.frame - 1] = _text(row.stiffness)
    if any(text != "0" for text in stiffness):
        yield _vector(FLEXIBLE, (int(text != "0") for text in stiffness))
        yield _vector(STIFFNESS, stiffness)


def _motors(table: RobotTable) -> Iterator[int]:
    """Yield 1 for each frame with an actuated joint, else 0.

    By default, joints in loops are passive.
    """
    passive = set(table.cut_frames)
    for loop in table.loops:
        moving, fixed = (_path(table, frame) for frame in loop.cut)
        passive |= moving ^ fixed
    for j, row in enumerate(table.frames, 1):
        chosen = j not in passive if row.actuated is None else row.actuated
        yield int(bool(chosen) and row.sigma != 2)


def _path(table: RobotTable, frame: int) -> set[int]:
    """Return the numbers of a frame and of all its antecedents, without the base."""
    path: set[int] = set()
    while frame:
        path.add(frame)
        frame = table.frames[frame - 1].antecedent
    return path


def _kind(table: RobotTable) -> int:
    """Return the key Type: 0 serial chain, 1 tree, 2 closed loops."""
    if table.loops:
        return 2
    return int(any(row.antecedent != j for j, row in enumerate(table.frames)))


def _cell(key: str, j: int, row: FrameRow) -> str:
    """Return geometric parameter `key` of frame j as text, with the joint variable it contains."""
    text = _text(getattr(row, key))
    if key != _VARIED.get(row.sigma):
        return text
    variable = f"{_SHORT[row.sigma]}{j}"
    if text == "0":
        return variable
    return f"{variable}{text}" if text.startswith("-") else f"{variable}+{text}"


def _text(value: Scalar) -> str:
    """Return a number or expression as text in the syntax of the format."""
    return str(expression(value)).replace("^", "**")


def _vector(key: str, values: Iterable[object]) -> str:
    """Return the line `key = {value, ...}`."""
    return f"{key} = {{{','.join(map(str, values))}}}"


def _extra_lines(table: RobotTable, keys: Iterable[str]) -> Iterator[str]:
    """Yield the lines of the given keys that the table keeps as extra data."""
    for key in keys:
        if key in table.extras:
            yield _vector(key, (_text(text) for text in table.extras[key]))


def _check_loops(table: RobotTable, NL: int, NJ: int) -> None:
    """Raise a DescriptionError if the format does not support a loop of the table.

    It needs revolute or prismatic cut joints, and loop k cut between the frames NL + k and NJ + k.
    """
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
    """Raise a DescriptionError for rotors, and for the drive of a cut joint (frame above NL)."""
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
    """Raise a DescriptionError if a symbol has the name of a joint variable of the written file."""
    variables = {
        f"{_SHORT[row.sigma]}{j}" for j, row in enumerate(table.frames, 1) if row.sigma != 2
    }
    for j, row in enumerate(table.frames, 1):
        for value in row.geometry.values():
            for symbol in parameters_of(expression(value)):
                if symbol.name in variables:
                    raise DescriptionError(
                        f"{table.name}/frame {j}: parameter {symbol.name} has the name of a joint"
                        " variable of .par files; rename it"
                    )
