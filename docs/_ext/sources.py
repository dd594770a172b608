"""Authors with a year, such as "Luh, Walker & Paul 1980", become links to the bibliography.

Pages and docstrings stay readable as they are; the build looks each author and year up in
references.bib.
"""

import re
from functools import cache
from pathlib import Path
from typing import Any

from names import target_of
from sphinx.application import Sphinx

_BIBLIOGRAPHY = Path(__file__).parents[1] / "references.bib"
_ENTRY = re.compile(r"@\w+\{(\w+),\s*author = \{(.+?)\},\n.*?year = \{(\d+)\}", re.DOTALL)
_ACCENT = re.compile(r"\{?\\(?:[`'^\"~=]|o(?=\W))\{?(\w?)\}*")
_NAME = r"[A-Z][\w’-]+"
MENTION = re.compile(
    rf"(?P<first>{_NAME})(?P<others>(?:(?:,|\s+&|,?\s+and)\s+(?:Van )?{_NAME})*)(?: et al\.)?,?"
    r"\s+(?P<open>\()?(?P<year>(?:19|20)\d\d)\b(?(open)\)?)"
)
_PROTECTED = re.compile(
    r"^(`{3,})[\s\S]*?^\1$"  # blocks of code
    r"|`[^`\n]*`|\]\([^)\n]*\)"  # code, targets of links
    r"|^#.*$|^ {4}.*$",  # headings, literal blocks
    re.MULTILINE,
)


@cache
def entries() -> dict[tuple[str, str], list[tuple[str, tuple[str, ...]]]]:
    """(family name of the first author, year) -> keys with the family names of all authors."""
    found: dict[tuple[str, str], list[tuple[str, tuple[str, ...]]]] = {}
    for key, people, year in _ENTRY.findall(_BIBLIOGRAPHY.read_text(encoding="utf-8")):
        plain = _ACCENT.sub(lambda accent: accent[1] or "o", people)
        names = tuple(person.split(",")[0].strip("{} ") for person in plain.split(" and "))
        found.setdefault((names[0], year), []).append((key, names))
    return found


def key_of(mention: re.Match[str]) -> str | None:
    """The key of the work that a mention means, None where the bibliography has no such work."""
    works = entries().get((mention["first"], mention["year"]), [])
    others = re.findall(_NAME, mention["others"])
    fitting = [key for key, names in works if all(name in names for name in others)]
    return fitting[0] if fitting else None


def _replaced(text: str, role: str) -> str:
    def cite(mention: re.Match[str]) -> str:
        key = key_of(mention)
        return role.format(key) if key else mention[0]

    return MENTION.sub(cite, text)


def cited_markdown(text: str) -> str:
    """A page with its mentions as {cite} roles; code, links and headings stay."""
    parts, end = [], 0
    for protected in _PROTECTED.finditer(text):
        parts.append(_replaced(text[end : protected.start()], "{{cite:t}}`{}`"))
        parts.append(_linked(protected[0]))
        end = protected.end()
    return "".join([*parts, _replaced(text[end:], "{{cite:t}}`{}`")])


def _linked(code: str) -> str:
    """Inline code that is the path of a public name, as a link to it."""
    name = code.strip("`")
    target = target_of(name) if name.startswith("mbs.") and code == f"`{name}`" else None
    return f"{{py:obj}}`{name} <{target}>`" if target else code


def cited_docstring(text: str) -> str:
    """A docstring with its mentions as :cite: roles."""
    return _replaced(text, ":cite:t:`{}`")


def _on_page(app: Sphinx, page: str, source: list[str]) -> None:
    if page != "changelog":
        source[0] = cited_markdown(source[0])


def setup(app: Sphinx) -> dict[str, Any]:
    """Rewrite each page when it is read."""
    app.connect("source-read", _on_page)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
