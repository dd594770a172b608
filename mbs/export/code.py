"""Readable source text of Functions, in the names of the classic notation."""

from __future__ import annotations

import os
import re

from casadi import Function

from mbs.errors import ModelError
from mbs.export.languages import language_of
from mbs.export.languages.language import Language
from mbs.files import write_text
from mbs.native.compiled import require_function
from mbs.text import quoted


def code(
    function: Function,
    language: str | Language,
    path: str | os.PathLike[str] | None = None,
    name: str | None = None,
) -> str:
    """A Function as source text that people can read.

    One quantity a line, in assignments that need no loop. Sines and cosines of joint angles are
    S2, C2, S23 (of q2 + q3); velocities, accelerations and efforts of the joints QP2, QDP2, GAM2;
    what the model names keeps its name (W32 is component 3 of the angular velocity of link 2);
    the rest is Z1, Z2 and so on. What depends on parameters alone comes first.

    Args:
        function: made of scalar operations, or a Function that can be expanded to them.
        language: "c", "fortran", "matlab" or "octave", "maple", "mathematica", "python", "julia",
            "rust", "latex", or "symoro" for the classic text of equations; or a `Language` of your
            own.
        path: a file to write the text to as well.
        name: of the function in the text, its own when left out.

    Returns:
        A complete unit: one function, subroutine or procedure, or one document.

    Raises:
        ModelError: there is no such language, it is no Function, or the Function has operations
            that the language cannot write.
        ExportError: the file cannot be written.
    """
    from mbs.export.languages.build import build  # with sympy, which takes a second to load

    target = language_of(language)
    require_function(function)
    if function.n_out() == 0:
        raise ModelError(f"{function.name()}: it has no output; there is nothing to write")
    text = target.text(build(function, target, _check_name(name or function.name())))
    if path is not None:
        write_text(text, path)
    return text


def _check_name(name: str) -> str:
    if isinstance(name, str) and re.fullmatch(r"[A-Za-z]\w*", name, re.ASCII):
        return name
    raise ModelError(
        f"{quoted(name)} is no name of a function; use letters, digits and underscores, a letter"
        " first"
    )
