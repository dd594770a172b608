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
from mbs.expressions import number, whole_number
from mbs.messages import quoted

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
_REMARKS = ("Value", "Guess", "Fs_width", "rest", "grouped")
_REMARKED = re.compile(r"[\w.]+")
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
        lines, comments = _without_comments(text)
        entries, remarks = _entries(path, lines), _remarks(path, comments)
        said = [_said(comment) for _, comment in reversed(comments)]  # the first of a kind counts
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
        return whole_number(text, self.where(key))

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
        return {name: number(text, where) for where, name, text in self.remarked(kind)}


def _without_comments(text: str) -> tuple[list[str], list[tuple[int, str]]]:
    """The lines of a text without its comments; line and inside of every comment."""
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


def _said(comment: str) -> tuple[str, str]:
    """What a comment such as `Source = 'a book'` speaks of, and what it says."""
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


def _remarks(path: str, comments: list[tuple[int, str]]) -> dict[tuple[str, str], tuple[int, str]]:
    remarks: dict[tuple[str, str], tuple[int, str]] = {}
    for line, comment in comments:
        key, value = _said(comment)
        kind, _, name = key.partition(" ")
        if kind not in _REMARKS or not _REMARKED.fullmatch(name) or "=" not in comment:
            continue
        if "\n" in value:  # prose
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
    """The values between commas that stand outside of brackets."""
    depth, start, parts = 0, 0, []
    for k, letter in enumerate(text):
        depth += (letter == "(") - (letter == ")")
        if letter == "," and depth == 0:
            parts.append(text[start:k])
            start = k + 1
    return tuple(" ".join(part.split()) for part in (*parts, text[start:]))


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
