"""What calls of generated C are checked for, and what they return."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi
from casadi import SX, Function

from mbs.assembly.model_function import ModelFunction
from mbs.assembly.validity import Kind, ValidityRow
from mbs.native.scalar_source import Real

STATUS_OF: dict[Kind, str] = {
    "quaternion": "MBS_QUATERNION",
    "parameter": "MBS_PARAMETER",
    "open": "MBS_OPEN",
    "undetermined": "MBS_UNDETERMINED",
}
"""The status of a call where a row does not hold."""

_SINGLE: dict[Kind, float] = {"open": 1e-5, "undetermined": -1e-6}
"""Bounds in single precision: positions that close loops leave some 1e-6 of the size when each is
rounded to 6e-8 of itself, and a squared sine below 1e-6 is rounding of its rows."""

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
    """What the inputs of a model must fulfil beside being numbers.

    Attributes:
        function: of the inputs of the model, all of them: (k, 1), 1 where a row holds, else 0.
        statuses: (k) what a call returns where a row does not hold; the first one counts.
    """

    function: Function
    statuses: tuple[str, ...]


def check_of(model: Function, real: Real) -> StatusCheck | None:
    """The rows of validity that a model asks for; None where it asks for numbers alone.

    Args:
        model: any Function.
        real: precision in which it is evaluated.
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
    """A comparison with NaN is false."""
    single = _SINGLE if real == "float" else {}
    values = [row.residual <= single.get(row.kind, row.bound) for row in rows]
    return casadi.vertcat(*values)


def _column(value: SX, k: int) -> SX:
    return value[:, min(k, value.shape[1] - 1)]
