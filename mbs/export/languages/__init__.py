"""The languages that functions are written in; each is loaded, with sympy, when it is used."""

from __future__ import annotations

import importlib

from mbs.errors import ModelError
from mbs.export.languages.language import Language
from mbs.text import did_you_mean, quoted

_CLASSES = {
    "c": "C",
    "fortran": "Fortran",
    "matlab": "Matlab",
    "maple": "Maple",
    "mathematica": "Mathematica",
    "python": "Python",
    "julia": "Julia",
    "rust": "Rust",
    "latex": "Latex",
    "symoro": "Symoro",
}
_ALIASES = {"octave": "matlab"}

LANGUAGES = (*_CLASSES, *_ALIASES)
"""Names of the languages."""


def language_of(name: object) -> Language:
    """The language of a name, in lower or upper case; a language of the user's own as it is.

    Raises:
        ModelError: there is no such language.
    """
    if isinstance(name, Language):
        return name
    key = name.lower() if isinstance(name, str) else ""
    key = _ALIASES.get(key, key)
    if key not in _CLASSES:
        raise ModelError(f"there is no language {quoted(name)}; {did_you_mean(key, LANGUAGES)}")
    module = importlib.import_module(f"mbs.export.languages.{key}")
    language: Language = getattr(module, _CLASSES[key])()
    return language
