"""Values of the variables of an FMU that a user gives."""

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from mbs.errors import ModelError
from mbs.messages import did_you_mean, quoted
from mbs.simulate.fmu_variables import numbers_of

Array = npt.NDArray[np.float64]
Signal = float | Callable[[float], float] | tuple[npt.ArrayLike, npt.ArrayLike]

_FORMS = "a number, a function of time, or (times, values)"


def start_values(
    description: Any, parameters: Mapping[str, float], start: Mapping[str, float]
) -> dict[str, float]:
    """Values of parameters, states and inputs before the run, their names and numbers checked."""
    known = numbers_of(description)
    every = (*known, *(v.name for v in description.modelVariables))
    fixed = {n for n, v in known.items() if v.causality == "parameter"}
    check_names("parameters", parameters, fixed, every)
    check_names("start", start, {n for n, v in known.items() if _settable(v)} - fixed, every)
    return {name: finite_number(name, value) for name, value in {**start, **parameters}.items()}


def _settable(variable: Any) -> bool:
    """Whether the standard allows to set it before the run."""
    if variable.variability == "constant" or variable.causality == "independent":
        return False
    return variable.causality == "input" or variable.initial in ("exact", "approx")


def check_names(what: str, given: Iterable[str], allowed: set[str], known: Iterable[str]) -> None:
    """Refuse names that are unknown or may not be given.

    Args:
        what: the argument that names them.
        given: names.
        allowed: names that may be given.
        known: all names.

    Raises:
        ModelError: says which name, and the nearest one that may be given.
    """
    everything = set(known)
    for name in given:
        if name not in allowed:
            why = "cannot be set" if name in everything else "does not exist"
            hint = did_you_mean(name, sorted(allowed))
            raise ModelError(f"{what}: variable {name!r} {why} here; {hint}")


def pair(name: str, signal: tuple[Any, ...]) -> tuple[Array, Array]:
    """The times and values of a table.

    Raises:
        ModelError: it is no pair of arrays of numbers.
    """
    try:
        times, values = (np.asarray(part, dtype=float) for part in signal)
    except (TypeError, ValueError):
        raise ModelError(f"input {name} is {quoted(signal)}; give {_FORMS}") from None
    return times, values


def finite_number(name: str, value: Any) -> float:
    """A value as a finite number.

    Raises:
        ModelError: it is none.
    """
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = float("nan")
    if not np.isfinite(number):
        raise ModelError(f"{name} = {quoted(value)}: use a finite number")
    return number
