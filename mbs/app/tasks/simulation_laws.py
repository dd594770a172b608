"""Laws that a user writes as texts: numbers, and functions of time, positions and velocities."""

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
from mbs.messages import did_you_mean, quoted

Laws = Mapping[str, float | str]
"""Name of a joint or of a quantity, to a number or a text of the grammar of `mbs.expressions`."""

TIME = "t"
"""The symbol of time [s] in a law."""

_LONGEST = 1000


def number(value: float | str, where: str, known: Mapping[str, float] | None = None) -> float:
    """The number that a user wrote, such as 0.3 or "pi/4 + A".

    Args:
        value: a number or a text.
        where: what it is of which system, for messages.
        known: values of the symbols that may stand in it.

    Raises:
        ExpressionError: it is no text of the grammar, or has no finite value.
    """
    read = _read(value, where)
    _require_known(read, known or {}, where)
    result = to_float(read, known)
    if result is None:
        raise ExpressionError(f"{where}: {quoted(value)} has no finite value; correct it")
    return result


def numbers(values: Laws, where: str, known: Mapping[str, float]) -> dict[str, float]:
    """Names to numbers, as `number` reads each.

    Raises:
        ExpressionError: one of them is none.
    """
    return {name: number(value, f"{where} of {name}", known) for name, value in values.items()}


def assignments(texts: Iterable[str], what: str) -> dict[str, str]:
    """Names and values of texts such as "j1=0.3".

    Args:
        texts: each NAME=VALUE.
        what: they are, for messages.

    Raises:
        DescriptionError: there is no "=" in one, a name or a value is empty, or a name is there
            twice.
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
    """Values as a function of (t, q, v), zero where no law is given.

    A law may hold t, the positions and velocities of the system as `j1.q` and `j1.v`, and
    the symbols of the system, as numbers.

    Args:
        system: open or closed.
        laws: by the names of values.
        names: of all values.
        known: values of the symbols of the system.
        what: the laws are, for messages.

    Raises:
        ExpressionError: a law cannot be read, or holds an unknown symbol.
    """
    signals = (
        *(f"{c.name}.q" for c in system.coordinates),
        *(f"{s.name}.v" for s in system.speeds),
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
    """One value as a number or a function of time.

    Args:
        law: of t and the symbols of the system, as numbers.
        known: values of the symbols.
        where: what it is of which system, for messages.

    Raises:
        ExpressionError: it cannot be read, or holds an unknown symbol.
    """
    read = _law(law, where, (TIME,), known)
    if isinstance(read, Number):
        return read.value
    return lambda t: to_sx(read, {TIME: t})


def _law(
    law: float | str, where: str, signals: Sequence[str], known: Mapping[str, float]
) -> Expression:
    """The law with numbers for the symbols of the system."""
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
    if isinstance(value, str) and len(value) > _LONGEST:
        raise ExpressionError(
            f"{where}: the text has {len(value)} characters; write at most {_LONGEST}"
        )
    return expression(value, where)


def _require_known(read: Expression, known: Iterable[str], where: str) -> None:
    names = list(known)
    for parameter in parameters_of(read):
        if parameter.name not in names:
            remedy = did_you_mean(parameter.name, names) if names else "write numbers"
            raise ModelError(f"{where}: there is no symbol {parameter.name!r} here; {remedy}")
