"""Docstrings as reStructuredText: their plain text is kept as it is, sources become a paragraph."""

import re
from typing import Any

from names import target_of
from sources import cited_docstring
from sphinx.application import Sphinx
from sphinx.domains.python import PyObject
from sphinx.util.docfields import GroupedField
from sphinx.util.inspect import TypeAliasForwardRef

_CODE = re.compile(r"(``.*?``|`[^`\n]*`)")
_LABELS = {"parameter": "Parameters", "variable": "Attributes"}
_MARKUP = re.compile(r"(\*|\||(?<=\w)_(?=\W|$))")


def plain(line: str) -> str:
    """A line whose stars, bars and trailing underscores stand for themselves."""
    parts = _CODE.split(line)
    return "".join(_code(p) if p.startswith("`") else _MARKUP.sub(r"\\\1", p) for p in parts)


def _code(text: str) -> str:
    code = text.strip("`")
    target = target_of(code)
    return f":py:obj:`{code} <{target}>`" if target else f"``{code}``"


def _source_paragraphs(text: str) -> str:
    """`Source: ...` begins a paragraph with a bold word."""
    return re.sub(r"^( *)Sources?: (?=\S)", r"\n\1**Source.** ", text, flags=re.M)


def _on_docstring(
    app: Sphinx, kind: str, name: str, thing: object, options: object, lines: list[str]
) -> None:
    text = "\n".join(plain(line) for line in lines)
    lines[:] = cited_docstring(_source_paragraphs(text)).splitlines()


def setup(app: Sphinx) -> dict[str, Any]:
    """Run before napoleon reads the sections; several names in one entry stay together."""
    TypeAliasForwardRef.__repr__ = lambda alias: alias.name
    for place, field in enumerate(PyObject.doc_field_types):
        if field.name in _LABELS:
            label, names = _LABELS[field.name], tuple(field.names)
            PyObject.doc_field_types[place] = GroupedField(
                field.name, names=names, label=label, can_collapse=True
            )
    app.connect("autodoc-process-docstring", _on_docstring, priority=400)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
