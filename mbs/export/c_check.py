"""Input checks of generated C functions, and the status codes that they return."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi
from casadi import SX, Function

from mbs.assembly.model_function import ModelFunction
from mbs.assembly.validity import Kind, ValidityRow
from mbs.native.c_code import Real

STATUS_OF: dict[Kind, str] = {
    "quaternion": "MBS_QUATERNION",
    "parameter": "MBS_PARAMETER",
    "open": "MBS_OPEN",
    "undetermined": "MBS_UNDETERMINED",
}
"""Status code of a call, by the kind of the violated condition."""

_SINGLE: dict[Kind, float] = {"open": 1e-5, "undetermined": -1e-6}
"""Bounds in single precision. Closed positions that are rounded to a relative error of 6e-8 have
closure residuals of about 1e-6 of the size. Rounding of the rows makes squared sines below 1e-6."""

STATUS = """\
#ifndef MBS_STATUS
#define MBS_STATUS
/** What calls return. At any other status than MBS_OK all outputs are NaN. */
typedef enum {
  MBS_OK = 0,           /* the outputs are the model */
  MBS_NOT_FINITE = 1,   /* an input is NaN or infinite, or a step is not positive */
  MBS_QUATERNION = 2,   /* a quaternion is not of unit length, to 1e-5: divide it by its length */
  MBS_PARAMETER = 3,    /* a parameter lies out of its bounds, such as a mass below zero */
  MBS_OPEN = 4,         /* the positions leave loops open, by more than 1e-6 (float: 1e-5) of the
                           size of the mechanism */
  MBS_UNDETERMINED = 5, /* the configuration is singular: there the independent joints do not
                           determine how the others move */
  MBS_NO_RESULT = 6     /* an output would not be a finite number: a singular matrix, or positions
                           that nothing reaches */
} mbs_status;
#endif
"""


NO_FAST_MATH = """\
#if defined __FAST_MATH__ || (defined __FINITE_MATH_ONLY__ && __FINITE_MATH_ONLY__ > 0)
#error "compile without -ffast-math: the checks of this file need NaN and infinity"
#endif

"""


@dataclass(frozen=True, slots=True, eq=False)
class StatusCheck:
    """Conditions on the inputs of a model, in addition to being finite.

    Attributes:
        function: function of all inputs of the model. It returns (k, 1): 1 if a condition holds,
            else 0.
        statuses: status codes (k,) of violated conditions. A call returns the first violated one.
    """

    function: Function
    statuses: tuple[str, ...]


def check_of(model: Function, real: Real) -> StatusCheck | None:
    """Return the conditions on the inputs of a model, in addition to being finite.

    Args:
        model: any Function.
        real: type of numbers in which the model is evaluated, "double" or "float".

    Returns:
        The conditions; None if the inputs only have to be finite.
    """
    if not isinstance(model, ModelFunction):
        return None
    system, asked = model.system, model.asked()
    q = SX.sym("q", system.nq)
    rows = model.rows(q)
    if not rows:
        return None
    inputs = [SX.sym(f"x{k}", *model.size_in(k)) for k in range(model.n_in())]
    given = dict(zip(model.name_in(), inputs, strict=True))
    symbols = {"q": q, "p": system.p}
    of_one = Function(
        "rows", [symbols[name] for name in asked], [_holds(rows, real)], {"cse": True}
    )
    columns = max(given[name].shape[1] for name in asked)
    holds = [of_one(*(_column(given[name], k) for name in asked)) for k in range(columns)]
    function = Function("holds", inputs, [casadi.densify(casadi.vertcat(*holds))], {"cse": True})
    return StatusCheck(function, tuple(STATUS_OF[row.kind] for row in rows) * columns)


def _holds(rows: Sequence[ValidityRow], real: Real) -> SX:
    """Return 1 or 0 for each condition (k, 1): whether it holds for numbers of the type `real`.

    `rows` are the conditions. A NaN residual violates its condition.
    """
    single = _SINGLE if real == "float" else {}
    values = [row.residual <= single.get(row.kind, row.bound) for row in rows]
    return casadi.vertcat(*values)


def _column(value: SX, k: int) -> SX:
    """Return column k of an input, or its last column if it has fewer columns."""
    return value[:, min(k, value.shape[1] - 1)]
