"""The joint variable inside an expression such as `th2 - Pi/2`, and the constant beside it."""

from __future__ import annotations

import re
from collections.abc import Iterator

from mbs.errors import DescriptionError
from mbs.expressions import Expression, Number, Operation, Parameter, parameters_of

_USUAL = {0: r"(th|theta|q|t)_?{j}", 1: r"(r|q|R)_?{j}"}
_SHORT = {0: "th", 1: "r"}
"""The name of SYMORO, which is the variable among several that would be."""

_KIND = {0: "revolute", 1: "prismatic"}


def split_variable(where: str, value: Expression, j: int, sigma: int) -> tuple[str, Expression]:
    """The joint variable of frame j and what is added to it.

    It is the only symbol in the expression or, among several, the one that is named after the
    joint: th2, else theta2, q2 or t2 in a revolute, r2, else q2 in a prismatic joint 2.

    Args:
        where: of the expression, for the messages.
        value: theta of a revolute or r of a prismatic joint.
        j: number of the frame.
        sigma: 0 revolute, 1 prismatic.

    Raises:
        DescriptionError: there is no variable, or more is done with it than adding a constant.
    """
    variable = _variable(where, value, j, sigma)
    rest: Expression | None = None
    found = 0
    for sign, term in _terms(value, variable):
        if isinstance(term, Parameter) and term.name == variable and sign > 0:
            found += 1
        else:
            rest = _added(rest, sign, term)
    constant = Number(0.0) if rest is None else rest
    if found != 1 or any(p.name == variable for p in parameters_of(constant)):
        raise DescriptionError(
            f"{where} is {value}; write the joint variable {variable} plus a constant"
        )
    return variable, constant


def _variable(where: str, value: Expression, j: int, sigma: int) -> str:
    names = list(dict.fromkeys(p.name for p in parameters_of(value)))
    if len(names) == 1:
        return names[0]
    if f"{_SHORT[sigma]}{j}" in names:
        return f"{_SHORT[sigma]}{j}"
    usual = [name for name in names if re.fullmatch(_USUAL[sigma].format(j=j), name)]
    if len(usual) != 1:
        raise DescriptionError(
            f"{where} is {value}, which does not show the variable of this {_KIND[sigma]} joint;"
            f" name it {_SHORT[sigma]}{j}"
        )
    return usual[0]


def _terms(value: Expression, variable: str, sign: int = 1) -> Iterator[tuple[int, Expression]]:
    """Signed terms of a sum, the variable a term of its own."""
    if isinstance(value, Operation) and value.operator in ("+", "-"):
        left, right = value.arguments
        other = sign if value.operator == "+" else -sign
        yield from _terms(left, variable, sign)
        if any(p.name == variable for p in parameters_of(right)):
            yield from _terms(right, variable, other)
        else:
            yield other, right
    elif isinstance(value, Operation) and value.operator == "negate":
        yield from _terms(value.arguments[0], variable, -sign)
    else:
        yield sign, value


def _added(rest: Expression | None, sign: int, term: Expression) -> Expression:
    if rest is None:
        return term if sign > 0 else -term
    return rest + term if sign > 0 else rest - term
