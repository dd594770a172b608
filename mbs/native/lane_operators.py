"""One operation of a graph as a C expression of vectors."""

from __future__ import annotations

from collections.abc import Mapping

import casadi

_OF_TWO = (
    *("lt", "le", "eq", "ne", "and", "or", "if_else_zero", "fmin", "fmax", "copysign"),
    *("atan2", "pow", "fmod", "remainder", "hypot"),
)
_OF_ONE = (
    *("not", "sign", "fabs", "sqrt", "floor", "ceil", "exp", "expm1", "log", "tan", "asin", "acos"),
    *("atan", "sinh", "cosh", "tanh"),
)
_EACH = ("erf", "asinh", "acosh", "atanh", "log1p")

FUNCTIONS: Mapping[int, str] = {
    **{getattr(casadi, f"OP_{name.upper()}"): f"mbs_{name}" for name in (*_OF_TWO, *_OF_ONE)},
    **{getattr(casadi, f"OP_{name.upper()}"): f"mbs_each_{name}" for name in _EACH},
    casadi.OP_CONSTPOW: "mbs_pow",
}
"""Of every other operation, the function in elementary.h."""
