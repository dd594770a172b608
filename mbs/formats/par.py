"""Reader of SYMORO+ and OpenSYMORO robot files (.par) as tables of frames.

With NL links, NJ joints and B = NJ - NL loops there are NF = NJ + B frames: loop k is cut between
the frames NL + k, which moves with the joint, and NJ + k, which is fixed. The joint variable is the
symbol in theta of a revolute joint and in r of a prismatic joint.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
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
    expression,
    number,
    parameters_of,
    whole_number,
)
from mbs.formats.files import read_text
from mbs.formats.table import DRIVE, GEOMETRY, CutRow, FrameRow, InertiaRow, RobotTable
from mbs.text import quoted

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
_REMARKS = ("Value", "Guess", "Fs_width", "rest", "grouped")
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
        """Parse the text of a file.

        Raises:
            DescriptionError: a line cannot be read, or its key is misspelt or given twice.
        """
        lines, comments = _without_comments(text)
        entries, remarks = _entries(path, lines), _line_remarks(path, comments)
        said = [_say(comment) for _, comment in reversed(comments)]  # first of a kind counts
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
        """File, line and key, for error messages."""
        return f"{self.path}:{self.entries[key][0]}: {key}" if key in self.entries else self.path

    def vector(self, key: str, length: int, per: str) -> tuple[str, ...] | None:
        """Return the values of a key, or None if the file does not contain it."""
        if key not in self.entries:
            return None
        values = self.entries[key][1]
        if len(values) != length:
            raise DescriptionError(
                f"{self.where(key)} has {len(values)} value(s); give {length}, one for each {per}"
            )
        return values

    def integer(self, key: str, text: str) -> int:
        """Convert a value of a key to an integer."""
        return whole_number(text, self.where(key))

    def count(self, key: str) -> int:
        """Return the number of links, joints or frames."""
        if key not in self.entries:
            raise DescriptionError(f"{self.path}: {key} is missing; add a line {key} = <number>")
        values = self.vector(key, 1, "robot")
        count = self.integer(key, values[0] if values else "")
        if not 1 <= count <= 1000:
            raise DescriptionError(f"{self.where(key)} is {count}; give 1 to 1000")
        return count

    def remarked(self, kind: str) -> Iterator[tuple[str, str, str]]:
        """Yield the location, name and text of every comment of a kind."""
        for (found, name), (line, text) in self.remarks.items():
            if found == kind:
                yield f"{self.path}:{line}: {kind} {name}", name, text

    def numbers(self, kind: str) -> dict[str, float]:
        """Return the comments of a kind as numbers, by name."""
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


def _say(comment: str) -> tuple[str, str]:
    """Split a comment such as `Source = 'a book'` into key and value."""
    key, _, value = comment.partition("=")
    return " ".join(key.split()), value.strip()


def _entries(path: str, lines: list[str]) -> dict[str, tuple[int, tuple[str, ...]]]:
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
    remarks: dict[tuple[str, str], tuple[int, str]] = {}
    for line, comment in comments:
        key, value = _say(comment)
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
    """Split a text at the commas outside parentheses."""
    depth, start, parts = 0, 0, []
    for k, letter in enumerate(text):
        depth += (letter == "(") - (letter == ")")
        if letter == "," and depth == 0:
            parts.append(text[start:k])
            start = k + 1
    return tuple(" ".join(part.split()) for part in (*parts, text[start:]))


def _check_spelling(where: str, key: str) -> None:
    """Raise if a key is similar to a known key. Other unknown keys are ignored."""
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


def split_variable(where: str, value: Expression, j: int, sigma: int) -> tuple[str, Expression]:
    """Split an expression into the joint variable of frame j and a constant.

    The variable is the only symbol in the expression or, among several, the symbol named after the
    joint: th2, else theta2, q2 or t2 in revolute joint 2; r2, else q2 or R2 in prismatic joint 2.

    Args:
        where: location of the expression, for error messages.
        value: theta of a revolute joint or r of a prismatic joint.
        j: number of the frame.
        sigma: 0 revolute, 1 prismatic.

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
    """Yield the signed terms of a sum, with the variable as a separate term."""
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
    if rest is None:
        return term if sign > 0 else -term
    return rest + term if sign > 0 else rest - term


def read_par(path: str | Path, parameters: Mapping[str, float] | None = None) -> RobotTable:
    """Read a .par file as a table of frames.

    Args:
        path: path of the file.
        parameters: values of symbols in the file. Other symbols have no value.

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
    """Return the stiffness of the joints that are flexible according to eta."""
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
    """Return the expressions in comments of a kind, by joint number."""
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
