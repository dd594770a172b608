"""Numbers and laws that a user writes as text: functions of time, positions and velocities."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence

import casadi
from casadi import SX

from mbs.assembly import System
from mbs.errors import DescriptionError, ExpressionError, ModelError
from mbs.expressions import (
    Expression,
    Number,
    expression,
    parameters_of,
    to_float,
    to_sx,
    with_values,
)
from mbs.text import did_you_mean, quoted

Laws = Mapping[str, float | str]
"""Name of a joint or quantity to a number or a text of the grammar of `mbs.expressions`."""


TIME = "t"
"""Symbol of time [s] in a law."""


_LONGEST = 1000


def number(value: float | str, where: str, known: Mapping[str, float] | None = None) -> float:
    """Return the value of a number that a user wrote, such as 0.3 or "pi/4 + A".

    Args:
        value: number or text.
        where: system and quantity, for error messages.
        known: values of the symbols that the text may contain.

    Raises:
        ExpressionError: the text is not in the grammar, or has no finite value.
        ModelError: the text contains an unknown symbol.
    """
    read = _read(value, where)
    _require_known(read, known or {}, where)
    result = to_float(read, known)
    if result is None:
        raise ExpressionError(f"{where}: {quoted(value)} has no finite value; correct it")
    return result


def numbers(values: Laws, where: str, known: Mapping[str, float]) -> dict[str, float]:
    """Convert the values of a mapping to numbers by `number`.

    Args:
        values: numbers or texts, by name.
        where: system and quantity, for error messages.
        known: values of the symbols that texts may contain.

    Raises:
        ExpressionError: a text is not in the grammar, or has no finite value.
        ModelError: a text contains an unknown symbol.
    """
    return {name: number(value, f"{where} of {name}", known) for name, value in values.items()}


def assignments(texts: Iterable[str], what: str) -> dict[str, str]:
    """Return names and values of texts such as "j1=0.3".

    Args:
        texts: texts of the form NAME=VALUE.
        what: description of the texts, for error messages.

    Raises:
        DescriptionError: a text has no "=", a name or a value is empty, or a name occurs twice.
    """
    found: dict[str, str] = {}
    for text in texts:
        name, mark, value = (part.strip() for part in text.partition("="))
        if not (name and mark and value):
            raise DescriptionError(f"{what}: {quoted(text)} is no NAME=VALUE; write it as j1=0.3")
        if name in found:
            raise DescriptionError(f"{what}: {quoted(name)} is given twice; give it once")
        found[name] = value
    return found


def law_of_motion(
    system: System, laws: Laws, names: Sequence[str], known: Mapping[str, float], what: str
) -> Callable[[SX, SX, SX], SX]:
    """Return a vector of values as a function of (t, q, v); values without a law are zero.

    A law may contain t, the positions and velocities of the system, such as `j1.q` and `j1.v`, and
    the symbols of the system, which are replaced by numbers.

    Args:
        system: open or closed system.
        laws: laws by name of the value.
        names: names of all values, in the order of the vector.
        known: values of the symbols of the system.
        what: description of the laws, for error messages.

    Returns:
        Callable (t (1, 1), q (nq, 1), v (nv, 1)) -> values (len(names), 1).

    Raises:
        ExpressionError: a law cannot be read, or has no finite value.
        ModelError: a law contains an unknown symbol.
    """
    signals = (
        *(f"{c.name}.q" for c in system.coordinates),
        *(f"{s.name}.v" for s in system.velocity_coordinates),
    )
    read = {
        name: _law(law, f"{system.name}: {what} of {name}", (TIME, *signals), known)
        for name, law in laws.items()
    }

    def values(t: SX, q: SX, v: SX) -> SX:
        elements = casadi.vertsplit(casadi.vertcat(t, q, v))
        symbols = dict(zip((TIME, *signals), elements, strict=True))
        return casadi.vertcat(*(to_sx(read.get(name, 0.0), symbols) for name in names))

    return values


def law_of_time(
    law: float | str, known: Mapping[str, float], where: str
) -> float | Callable[[SX], SX]:
    """Return a law of time as a number, or as a function of t if it depends on time.

    Args:
        law: number, or text of t and the symbols of the system.
        known: values of the symbols.
        where: system and quantity, for error messages.

    Raises:
        ExpressionError: the law cannot be read, or has no finite value.
        ModelError: the law contains an unknown symbol.
    """
    read = _law(law, where, (TIME,), known)
    if isinstance(read, Number):
        return read.value
    return lambda t: to_sx(read, {TIME: t})


def _law(
    law: float | str, where: str, signals: Sequence[str], known: Mapping[str, float]
) -> Expression:
    """Return a law as an expression of `signals`, with numbers for the symbols of the system.

    Raise an ExpressionError or ModelError that begins with `where` if it is invalid.
    """
    values = {name: value for name, value in known.items() if name not in signals}
    read = _read(law, where)
    _require_known(read, [*signals, *values], where)
    try:
        known_law = with_values(read, values)
    except ExpressionError as error:
        raise ExpressionError(f"{where}: {error}") from None
    worth = to_sx(known_law, {name: SX.sym(name) for name in signals})
    if not casadi.symvar(worth) and not casadi.evalf(worth).is_regular():
        raise ExpressionError(f"{where}: {quoted(law)} has no finite value; correct it")
    return known_law


def _read(value: float | str, where: str) -> Expression:
    """Return a text or number as an expression; raise an ExpressionError if it is invalid."""
    if isinstance(value, str) and len(value) > _LONGEST:
        raise ExpressionError(
            f"{where}: the text has {len(value)} characters; write at most {_LONGEST}"
        )
    return expression(value, where)


def _require_known(read: Expression, known: Iterable[str], where: str) -> None:
    """Raise a ModelError if an expression contains a symbol that is not in `known`."""
    names = list(known)
    for parameter in parameters_of(read):
        if parameter.name not in names:
            remedy = did_you_mean(parameter.name, names) if names else "write numbers"
            raise ModelError(f"{where}: there is no symbol {parameter.name!r} here; {remedy}")
