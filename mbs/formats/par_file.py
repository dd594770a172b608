"""The keys and the lines of .par files, before they mean a robot.

A file holds `KEY = number` and `KEY = {value, ...}`, where a vector may run over several lines.
`(* ... *)` is a comment; comments `(* Value L = 0.3 *)`, `(* Guess q2 = -1.57 *)` and
`(* Fs_width 3 = 0.01 *)`, `(* rest 3 = 0.1 *)`, `(* grouped 3 = 1 *)` say what the format
has no key for.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from difflib import get_close_matches

from mbs.errors import DescriptionError
from mbs.expressions import expression, to_float

FRAME_KEYS = ("ant", "sigma", "b", "d", "r", "gamma", "alpha", "mu", "theta")
"""Vectors with one value for each frame."""

BODY_KEYS = {
    **{key: key for key in ("XX", "XY", "XZ", "YY", "YZ", "ZZ", "MX", "MY", "MZ", "M")},
    **{"IA": "Ia", "FV": "Fv", "FS": "Fs"},
}
"""Vectors with one value for each link, and the field of a body row that takes them."""

LINK_EXTRAS = ("FX", "FY", "FZ", "CX", "CY", "CZ")
"""Wrenches that links exert on their environment, kept as texts."""

FLEXIBLE, STIFFNESS = "eta", "k"
"""Vectors with one value for each joint: 1 for a flexible one, and its stiffness."""

JOINT_EXTRAS = ("QP", "QDP", "GAM")
"""Vectors with one value for each joint, kept as texts."""

BASE_EXTRAS = {"W0": 3, "WP0": 3, "V0": 3, "VP0": 3, "Z": 16}
"""Vectors about the base, kept as texts, and their lengths."""

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
_COMMENT = re.compile(r"\(\*.*?\*\)", re.DOTALL)
_NAME = re.compile(r"\(\*\s*Robotname\s*=\s*'([^'\n]*)'")
_SOURCE = re.compile(r"\(\*\s*Source\s*=\s*'([^\n]*)'\s*\*\)")
_REMARK = re.compile(
    r"\(\*\s*(Value|Guess|Fs_width|rest|grouped)\s+([\w.]+)\s*=\s*([^\n]*?)\s*\*\)"
)
_SHORTEST_MISSPELT, _SIMILAR = 3, 0.75


@dataclass(frozen=True, slots=True)
class ParFile:
    """The assignments and remarks of a file.

    Attributes:
        path: of the file.
        name, source: of the robot, empty where the file does not say them.
        entries: key -> (line number, texts of the values).
        remarks: (kind, name) -> (line number, text), the kind Value, Guess, Fs_width, rest or
            grouped.
    """

    path: str
    name: str
    source: str
    entries: Mapping[str, tuple[int, tuple[str, ...]]]
    remarks: Mapping[tuple[str, str], tuple[int, str]]

    @staticmethod
    def of(path: str, text: str) -> ParFile:
        """The file with this text.

        Raises:
            DescriptionError: a line cannot be read, or its key is misspelt or given twice.
        """
        name, source = _NAME.search(text), _SOURCE.search(text)
        return ParFile(
            path,
            name[1].strip() if name else "",
            source[1] if source else "",
            _entries(path, text),
            _remarks(path, text),
        )

    def where(self, key: str) -> str:
        """File, line and key for messages."""
        return f"{self.path}:{self.entries[key][0]}: {key}" if key in self.entries else self.path

    def vector(self, key: str, length: int, per: str) -> tuple[str, ...] | None:
        """The values of a key, None where the file does not have it."""
        if key not in self.entries:
            return None
        values = self.entries[key][1]
        if len(values) != length:
            raise DescriptionError(
                f"{self.where(key)} has {len(values)} value(s); give {length}, one for each {per}"
            )
        return values

    def integer(self, key: str, text: str) -> int:
        """The whole number that a value of a key is."""
        value = to_float(expression(text, self.where(key)))
        if value is None or value != int(value):
            raise DescriptionError(f"{self.where(key)} is {text!r}; give a whole number")
        return int(value)

    def count(self, key: str) -> int:
        """The number of links, joints or frames."""
        if key not in self.entries:
            raise DescriptionError(f"{self.path}: {key} is missing; add a line {key} = <number>")
        values = self.vector(key, 1, "robot")
        count = self.integer(key, values[0] if values else "")
        if not 1 <= count <= 1000:
            raise DescriptionError(f"{self.where(key)} is {count}; give 1 to 1000")
        return count

    def remarked(self, kind: str) -> Iterator[tuple[str, str, str]]:
        """Place, name and text of every remark of a kind."""
        for (found, name), (line, text) in self.remarks.items():
            if found == kind:
                yield f"{self.path}:{line}: {kind} {name}", name, text

    def numbers(self, kind: str) -> dict[str, float]:
        """The remarks of a kind that must be numbers, by name."""
        values: dict[str, float] = {}
        for where, name, text in self.remarked(kind):
            value = to_float(expression(text, where))
            if value is None:
                raise DescriptionError(f"{where} is {text!r}; give a number")
            values[name] = value
        return values


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


def _remarks(path: str, text: str) -> dict[tuple[str, str], tuple[int, str]]:
    remarks: dict[tuple[str, str], tuple[int, str]] = {}
    for match in _REMARK.finditer(text):
        kind, name, value = match.groups()
        line = text.count("\n", 0, match.start()) + 1
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
            f"{where}: {line.splitlines()[0].strip()!r} is not an assignment; write KEY = number,"
            " KEY = {value, ...} or a comment (* ... *)"
        )
    _check_spelling(where, match[1])
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


def _check_spelling(where: str, key: str) -> None:
    """Refuse a key that is nearly a known one; other unknown keys are of no use here."""
    if key in _KNOWN:
        return
    folded = {known.casefold() for known in _KNOWN}
    cutoff = _SIMILAR if len(key) >= _SHORTEST_MISSPELT else 1.0
    near = get_close_matches(key.casefold(), folded, n=1, cutoff=cutoff)
    if near:
        meant = [known for known in _KNOWN if known.casefold() == near[0]]
        nearest = get_close_matches(key, meant, n=1, cutoff=0)[0]
        raise DescriptionError(f"{where}: key {key!r} is unknown; did you mean {nearest!r}?")
