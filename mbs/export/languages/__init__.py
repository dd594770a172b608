"""Output languages for functions. A language, and sympy, is imported when it is first used."""

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
    """Return the language with a name (case-insensitive). A `Language` is returned unchanged.

    Args:
        name: name in `LANGUAGES`, or a `Language`.

    Raises:
        ModelError: the language is unknown.
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
