"""Simulation of a system from the texts and numbers of a form or a command line."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import casadi
import numpy as np
from casadi import SX
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.assembly.model_function import require_system
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
from mbs.models.state.signals import effort_function, full_name
from mbs.result import Result
from mbs.simulate import run
from mbs.simulate.device_inputs import input_function
from mbs.text import did_you_mean, quoted

# Laws that a user writes as text: numbers, and functions of time, positions and velocities.


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
    """
    read = _read(value, where)
    _require_known(read, known or {}, where)
    result = to_float(read, known)
    if result is None:
        raise ExpressionError(f"{where}: {quoted(value)} has no finite value; correct it")
    return result


def numbers(values: Laws, where: str, known: Mapping[str, float]) -> dict[str, float]:
    """Convert the values of a mapping to numbers by `number`.

    Raises:
        ExpressionError: a value is not a number.
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

    A law may contain t, the positions and velocities of the system, such as `j1.q` and `j1.v`,
    and the symbols of the system, which are replaced by numbers.

    Args:
        system: open or closed system.
        laws: laws by name of the value.
        names: names of all values, in the order of the vector.
        known: values of the symbols of the system.
        what: description of the laws, for error messages.

    Raises:
        ExpressionError: a law cannot be read, or contains an unknown symbol.
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
    """Return a law of time as a number, or as a function of t if it depends on time.

    Args:
        law: number, or text of t and the symbols of the system.
        known: values of the symbols.
        where: system and quantity, for error messages.

    Raises:
        ExpressionError: the law cannot be read, or contains an unknown symbol.
    """
    read = _law(law, where, (TIME,), known)
    if isinstance(read, Number):
        return read.value
    return lambda t: to_sx(read, {TIME: t})


def _law(
    law: float | str, where: str, signals: Sequence[str], known: Mapping[str, float]
) -> Expression:
    """Read a law, with numbers instead of the symbols of the system."""
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


METHODS = ("dopri5", "rodas")
"""Integration methods: "dopri5" is explicit, "rodas" is linearly implicit for stiff systems."""


@dataclass(frozen=True, slots=True)
class SimulationSettings:
    """Settings of a simulation. Every number may also be a text, such as "pi/2".

    Attributes:
        duration: duration [s].
        step: time between rows of the result [s].
        q0: initial positions by name of the coordinate [rad or m]. Default: the position in the
            assembled configuration.
        configuration: all initial positions, instead of q0; they must close the loops. Empty to
            use q0.
        v0: initial velocities by name [rad/s or m/s].
        tau: efforts by name of an actuated joint [N m or N]: numbers, or laws of t, of positions
            and velocities such as `j1.q` and `j1.v`, and of symbols of the system.
        inputs: inputs of devices by name of the device: numbers or laws, as for tau.
        motion: laws of t for coordinates with prescribed motion, by names such as "j1.q".
        parameters: values of symbols of the system. Default: their default values.
        tolerance: approximate error of the motion.
        method: method, a name in `METHODS`.
        max_step: maximum integration step [s]; empty for no limit.
    """

    duration: float | str = 2.0
    step: float | str = 0.01
    q0: Laws = field(default_factory=dict)
    configuration: Sequence[float] = ()
    v0: Laws = field(default_factory=dict)
    tau: Laws = field(default_factory=dict)
    inputs: Laws = field(default_factory=dict)
    motion: Laws = field(default_factory=dict)
    parameters: Laws = field(default_factory=dict)
    tolerance: float | str = 1e-8
    method: str = "dopri5"
    max_step: float | str = ""


def simulate(
    system: System, settings: SimulationSettings | None = None, *, quiet: bool = False
) -> Result:
    """Simulate a system by `mbs.simulate.run`.

    Args:
        system: open or closed system.
        settings: settings of the simulation.
        quiet: whether to hide the progress bar.

    Returns:
        result with `name.q`, `name.v`, `name.a` and `name.tau` for every coordinate, then the
        energies, `closure_residual`, devices and sensors.

    Raises:
        ExpressionError: a text cannot be read, or contains an unknown symbol.
        MbsError: see `mbs.simulate.run`.
    """
    return run(system, **run_arguments(system, settings or SimulationSettings()), quiet=quiet)


def run_arguments(system: System, settings: SimulationSettings) -> dict[str, Any]:
    """Convert settings to the arguments of `mbs.simulate.run`.

    Args:
        system: open or closed system.
        settings: settings of the simulation.

    Raises:
        ExpressionError: a text cannot be read, or contains an unknown symbol.
        ModelError: a name is unknown or a joint has no motor, or the method is unknown.
    """
    require_system(system)
    if settings.method not in METHODS:
        raise ModelError(
            f"{system.name}: there is no method {settings.method!r};"
            f" {did_you_mean(settings.method, METHODS)}"
        )
    where = system.name
    parameters = numbers(settings.parameters, f"{where}: parameter", {})
    known = known_values(system, parameters)
    return {
        **_times(settings, where, known),
        "q0": _positions(system, settings, known),
        "v0": numbers(settings.v0, f"{where}: v0", known) or None,
        "tau": _efforts(system, settings.tau, known),
        "u": _inputs(system, settings.inputs, known),
        "motion": {
            name: law_of_time(law, known, f"{where}: motion of {name}")
            for name, law in settings.motion.items()
        }
        or None,
        "parameters": parameters or None,
        "method": settings.method,
        **_longest(settings, where, known),
    }


def known_values(system: System, given: Mapping[str, float]) -> dict[str, float]:
    """Return the values of the symbols of a system, by name; symbols without value are omitted.

    Args:
        system: open or closed system.
        given: values by name. Default: the default values of the symbols.

    Raises:
        ModelError: a name is unknown.
    """
    names = [parameter.name for parameter in system.parameters]
    values = system.parameter_values(given, needed=())
    return {n: x for n, x in zip(names, values, strict=True) if x == x}


def csv_bytes(result: Result) -> bytes:
    """Return the content of the file that `Result.to_csv` writes."""
    with tempfile.TemporaryDirectory(prefix="mbs-csv-") as folder:
        path = Path(folder) / "result.csv"
        result.to_csv(path)
        return path.read_bytes()


def _times(
    settings: SimulationSettings, where: str, known: Mapping[str, float]
) -> dict[str, float]:
    return {
        name: number(getattr(settings, name), f"{where}: {name}", known)
        for name in ("duration", "step", "tolerance")
    }


def _longest(
    settings: SimulationSettings, where: str, known: Mapping[str, float]
) -> dict[str, float]:
    if settings.max_step == "":
        return {}
    return {"max_step": number(settings.max_step, f"{where}: max_step", known)}


def _positions(
    system: System, settings: SimulationSettings, known: Mapping[str, float]
) -> dict[str, float] | list[float] | None:
    """Return the initial positions, except of coordinates with prescribed motion."""
    if not settings.configuration:
        return numbers(settings.q0, f"{system.name}: q0", known) or None
    if settings.q0:
        raise ModelError(
            f"{system.name}: q0 and a configuration are given for the start; leave one of them out"
        )
    values = list(settings.configuration)
    if not settings.motion or len(values) != system.nq:
        return values
    rates = {speed.name for speed in system.speeds}
    held = {system.speeds[k].name for k in system.active}
    held -= {name.rpartition(".")[0] for name in settings.motion}
    pairs = zip((c.name for c in system.coordinates), values, strict=True)
    return {name: x for name, x in pairs if name in held or name not in rates}


def _efforts(system: System, laws: Laws, known: Mapping[str, float]) -> Any:
    """Return the laws of the efforts of all joints; None without laws."""
    if not laws:
        return None
    effort_function(system, dict.fromkeys(laws, 0.0))  # raises for joints that have no motor
    names = [speed.name for speed in system.speeds]
    return law_of_motion(system, laws, names, known, "tau")


def _inputs(system: System, laws: Laws, known: Mapping[str, float]) -> Any:
    """Return the laws of the inputs of all devices; None without laws."""
    if not laws:
        return None
    input_function(system, dict.fromkeys(laws, 0.0))  # raises for unknown devices
    names = [name for name, _ in system.inputs]
    given = {full_name(name, system.inputs): law for name, law in laws.items()}
    return law_of_motion(system, given, names, known, "input")


# A simulated motion with the configurations that a picture needs to play it.


MOST_ROWS = 100_000
"""Maximum number of rows of a result that the app simulates."""

_FEWEST_FRAMES, _MOST_FRAMES, _PER_SECOND = 60, 600, 30.0
"""Minimum and maximum number of frames of a movie, and frames per second: as smooth as a video,
enough frames of a short motion, and not more than a page can load at once."""


@dataclass(frozen=True, slots=True, eq=False)
class Movie:
    """Movie of a simulation: the result, and the configurations at some of its rows.

    Attributes:
        result: result of the simulation.
        times: (m,) times of the frames [s].
        configurations: (m, nq) configurations of the frames, in the order of `system.coordinates`
            [rad or m].
    """

    result: Result
    times: NDArray[np.float64]
    configurations: NDArray[np.float64]


def film(system: System, settings: SimulationSettings | None = None) -> Movie:
    """Simulate a system and select about thirty frames per second for a movie, at most 600.

    Args:
        system: open or closed system.
        settings: settings of the simulation.

    Raises:
        ModelError: the result would have too many rows for a page.
        MbsError: see `simulate`.
    """
    arguments = run_arguments(system, settings or SimulationSettings())
    duration, step = arguments["duration"], arguments["step"]
    if step > 0 and duration / step > MOST_ROWS:
        raise ModelError(
            f"{system.name}: {duration:g} s in steps of {step:g} s are more than {MOST_ROWS} rows;"
            " give a longer step, or simulate in a script"
        )
    return filmed(system, run(system, **arguments, quiet=True))


def filmed(system: System, result: Result) -> Movie:
    """Select the frames of a movie from a result.

    Args:
        system: system that was simulated.
        result: result of `mbs.simulate.run`.
    """
    span = float(result.time[-1] - result.time[0])
    wanted = min(max(span * _PER_SECOND, _FEWEST_FRAMES), _MOST_FRAMES, len(result))
    rows = np.unique(np.linspace(0, len(result) - 1, int(wanted)).round().astype(int))
    q = np.column_stack([result[f"{c.name}.q"] for c in system.coordinates])
    return Movie(result, result.time[rows], q[rows])
