"""Export of Functions as readable source code with the names of the classic notation."""

from __future__ import annotations

import os
import re

from casadi import Function

from mbs.errors import ModelError
from mbs.export.languages import language_of
from mbs.export.languages.language import Language
from mbs.files import write_text
from mbs.native._compiled import require_function
from mbs.text import quoted


def code(
    function: Function,
    language: str | Language,
    path: str | os.PathLike[str] | None = None,
    name: str | None = None,
) -> str:
    """Write a Function as readable source code.

    The code has one assignment per line and no loops. Sines and cosines of joint angles are named
    S2, C2, S23 (sine of q2 + q3). Velocities, accelerations and efforts of the joints are QP2, QDP2
    and GAM2. Quantities with a name in the model keep it, such as W32 for component 3 of the
    angular velocity of link 2. Other quantities are Z1, Z2, .... Expressions that depend only on
    parameters come first.

    Args:
        function: Function of scalar operations, or a Function that can be expanded to them.
        language: "c", "fortran", "matlab" or "octave", "maple", "mathematica", "python", "julia",
            "rust", "latex", "symoro" for the classic listing of equations, or a user-defined
            `Language`.
        path: file to which the text is also written, or None.
        name: name of the function in the text. By default the name of the Function.

    Returns:
        Text of a complete function, subroutine, procedure or document.

    Raises:
        ModelError: the language is unknown, function is not a Function or has no output, the name
            is invalid, or the language does not support an operation.
        ExportError: the file cannot be written.
    """
    from mbs.export.languages.build import build  # imports sympy, which takes a second

    target = language_of(language)
    require_function(function)
    if function.n_out() == 0:
        raise ModelError(f"{function.name()}: it has no output; there is nothing to write")
    text = target.text(build(function, target, _check_name(name or function.name())))
    if path is not None:
        write_text(text, path)
    return text


def _check_name(name: str) -> str:
    """Return a name if it is an identifier of ASCII letters; raise a ModelError otherwise."""
    if isinstance(name, str) and re.fullmatch(r"[A-Za-z]\w*", name, re.ASCII):
        return name
    raise ModelError(
        f"{quoted(name)} is no name of a function; use letters, digits and underscores, a letter"
        " first"
    )
