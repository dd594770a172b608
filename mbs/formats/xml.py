"""XML of robot files: a parser with the tolerance of common robot tools, and a writer.

Prefixes need no declaration, since tag names are not interpreted. Errors that expat rejects and the
tools of URDF (TinyXML) accept are repaired, with a note: a declaration that is not at the
beginning, two hyphens in a comment, a bare `&`, bytes that are invalid in the encoding, text after
the root element.
"""

from __future__ import annotations

import codecs
import os
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Comment, Element, indent, tostring
from xml.parsers import expat

from mbs.errors import DescriptionError
from mbs.files import path_of, write_bytes
from mbs.formats.files import Notes, decoded, read_bytes

_MOST_ELEMENTS = 1_000_000  # limit of memory: a file of the largest size could have 16 times more
_DEEPEST = 200  # maximum nesting of elements; robot files have about ten levels


class XmlElement(Element):
    """Element with its line number.

    Attributes:
        line: line number in the file, from 1; None for a text that is not from a file.
    """

    line: int | None = None


def line_of(element: Element | None) -> int | None:
    """Return the line number (from 1) at which an element begins; None if it is unknown.

    Args:
        element: XML element, or None.
    """
    return getattr(element, "line", None)


def parse_xml(path: str | Path, notes: Notes | None = None) -> Element:
    """Return the root element of an XML file; all elements are `XmlElement`.

    Args:
        path: path of the file.
        notes: collection that receives one note per repair of the file.

    Raises:
        DescriptionError: the file is missing, too large or is not XML.
    """
    return parse_content(str(path), read_bytes(path), notes)


def parse_content(path: str, content: bytes, notes: Notes | None = None) -> Element:
    """Return the root element of the content of an XML file.

    Args:
        path: path of the file, for error messages.
        content: content of the file.
        notes: collection that receives one note per repair of the content.

    Raises:
        DescriptionError: the content is too large or is not XML.
    """
    try:
        return _Builder(path).parse(content)
    except DescriptionError:
        raise
    except (expat.ExpatError, LookupError, ValueError):
        pass  # expat raises the last two for an unknown encoding
    notes = Notes(path) if notes is None else notes
    text = _repaired(content, notes)
    builder = _Builder(path)
    try:
        return builder.parse(text)
    except expat.ExpatError as error:
        if error.code == _JUNK and builder.root is not None:
            notes.add("ignored", "the text behind the root element", "left out", error.lineno)
            return builder.root
        raise DescriptionError(f"{path}: the file is not XML: {error}; correct it") from None
    except DescriptionError:
        raise
    except ValueError as error:
        raise DescriptionError(f"{path}: the file is not XML: {error}; correct it") from None


_JUNK = expat.errors.codes[expat.errors.XML_ERROR_JUNK_AFTER_DOC_ELEMENT]


class _Builder:
    """Parser that builds an element tree from the events of expat.

    Attributes:
        path: path of the file, for error messages.
        root: root element, None before the first element.
        open: elements that are not closed yet, the innermost last.
        count: number of elements so far.
        closed: last closed element, which receives the text after it; None after a start tag.
        parser: the expat parser.
    """

    def __init__(self, path: str) -> None:
        self.path = path
        self.root: XmlElement | None = None
        self.open: list[XmlElement] = []
        self.count = 0
        self.closed: XmlElement | None = None
        self.parser: Any = expat.ParserCreate()  # without a separator, names keep their prefixes
        self.parser.buffer_text = True
        self.parser.buffer_size = 1 << 20  # each full buffer copies the element text so far
        self.parser.StartElementHandler = self._start
        self.parser.EndElementHandler = self._end
        self.parser.CharacterDataHandler = self._data

    def parse(self, content: bytes | str) -> Element:
        """Parse a complete XML text and return the root element.

        Raise ExpatError if it is invalid.
        """
        self.parser.Parse(content, True)
        assert self.root is not None  # expat raises if a text has no elements
        return self.root

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        """Add an element; raise a DescriptionError for too many or too deeply nested elements."""
        self.count += 1
        if self.count > _MOST_ELEMENTS or len(self.open) >= _DEEPEST:
            what = (
                f"more than {_MOST_ELEMENTS} elements"
                if self.count > _MOST_ELEMENTS
                else f"elements in elements, {_DEEPEST} deep"
            )
            raise DescriptionError(f"{self.path}: the file has {what}; give that of a robot")
        element = XmlElement(tag, attributes)
        element.line = self.parser.CurrentLineNumber
        if self.open:
            self.open[-1].append(element)
        else:
            self.root = element
        self.open.append(element)
        self.closed = None

    def _end(self, tag: str) -> None:
        """Close the innermost element."""
        self.closed = self.open.pop()

    def _data(self, text: str) -> None:
        """Append text to the innermost element or, as its tail, to the last closed element."""
        if self.closed is not None:
            self.closed.tail = (self.closed.tail or "") + text
        else:
            self.open[-1].text = (self.open[-1].text or "") + text


_DECLARED = re.compile(rb"""encoding\s*=\s*["']([A-Za-z0-9._-]{1,40})["']""")
_DECLARATION = re.compile(r"<\?xml\b[^<>]*\?>")
_BARE = re.compile(r"&(?!#?\w{1,32};)")
_UNSEEN = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\ufffe\uffff]")
_REPAIRS = (
    (_DECLARATION, "", "the XML declaration", "left out, for it is not at the beginning"),
    (_BARE, "&amp;", "a bare &", "read as &amp;"),
    (_UNSEEN, "", "control characters", "left out"),
)


def _repaired(content: bytes, notes: Notes) -> str:
    """Return the text of a malformed XML file with common errors repaired.

    Line numbers are kept, and a note reports each kind of repair.
    """
    declared = _DECLARED.search(content[:200])
    encoding = declared.group(1).decode() if declared else "utf-8"
    try:
        known = codecs.lookup(encoding).name
    except LookupError:
        known = ""
    # A declaration that is readable as ASCII is not encoded in UTF-16 or UTF-32.
    if not known or known.startswith(("utf-16", "utf-32")):
        known = "utf-8"
    try:
        text = decoded(content, known)
    except (LookupError, ValueError):  # codecs that do not decode to text
        text = decoded(content)
    if "\ufffd" in text:
        line = text[: text.index("\ufffd")].count("\n") + 1
        notes.add("doubted", "the text", f"not all is {known}; read as Latin-1", line)
        text = content.decode("latin-1")
    text = _without_comments(text)
    first = _DECLARATION.match(text)
    if first is not None:  # its encoding has already been read
        text = text[first.end() :]
    for pattern, by, element, what in _REPAIRS:
        found = pattern.search(text)
        if found is not None:
            line = text[: found.start()].count("\n") + 1
            notes.add("ignored", element, what, line)
            text = _replace(pattern, by, text)
    return text.lstrip("\ufeff")


def _replace(pattern: re.Pattern[str], by: str, text: str) -> str:
    """Replace every match of a pattern by a text, and keep the line breaks of the matches."""

    def replacement(found: re.Match[str]) -> str:
        return by + "\n" * found.group().count("\n")

    return pattern.sub(replacement, text)


def _without_comments(text: str) -> str:
    """Remove XML comments and keep their line breaks; a comment may contain two hyphens."""
    parts, at = [], 0
    while (start := text.find("<!--", at)) >= 0:
        end = text.find("-->", start + 4)
        if end < 0:
            break
        parts += [text[at:start], "\n" * text.count("\n", start, end)]
        at = end + 3
    return "".join([*parts, text[at:]])


# Writer.


def text_of(values: Iterable[Any]) -> str:
    """Return numbers as a text separated by blanks, with all digits of a double."""
    return " ".join(repr(float(value) + 0.0) for value in values)


def write_xml(root: Element, path: str | os.PathLike[str], note: str = "") -> None:
    """Write an indented XML file as a whole or not at all.

    Args:
        root: element of the robot.
        path: path of the file.
        note: text of a comment at the beginning of the file.

    Raises:
        ExportError: the file cannot be written.
    """
    if note:
        root.insert(0, Comment(f" {note.replace('--', '- -')} "))
    indent(root)
    content = tostring(root, encoding="utf-8", xml_declaration=True) + b"\n"
    write_bytes(content, path_of(path))
