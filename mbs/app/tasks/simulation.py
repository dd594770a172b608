"""Simulation of a system from the texts and numbers of a form or a command line."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbs.app.tasks.laws import Laws, law_of_motion, law_of_time, number, numbers
from mbs.app.tasks.options import keywords
from mbs.assembly import System
from mbs.assembly.model_function import require_system
from mbs.errors import ModelError
from mbs.models.state.signals import effort_function, full_name
from mbs.result import Result
from mbs.simulate import run
from mbs.simulate.device_inputs import input_function
from mbs.simulate.options import MotionOptions, RunArguments


@dataclass(frozen=True, slots=True)
class SimulationSettings:
    """Settings of a simulation. Every number may also be a text, such as "pi/2".

    Attributes:
        duration: duration [s].
        options: options of `mbs.simulate.run` by name, such as "step". The others have their
            defaults.
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
    """

    duration: float | str = 2.0
    options: Mapping[str, Any] = field(default_factory=dict)
    q0: Laws = field(default_factory=dict)
    configuration: Sequence[float] = ()
    v0: Laws = field(default_factory=dict)
    tau: Laws = field(default_factory=dict)
    inputs: Laws = field(default_factory=dict)
    motion: Laws = field(default_factory=dict)
    parameters: Laws = field(default_factory=dict)


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
        ExpressionError: a text cannot be read, or has no finite value.
        MbsError: see `mbs.simulate.run`.
    """
    return run(system, **run_arguments(system, settings or SimulationSettings()), quiet=quiet)


def run_arguments(system: System, settings: SimulationSettings) -> dict[str, Any]:
    """Return the arguments of `mbs.simulate.run` from settings.

    Args:
        system: open or closed system.
        settings: settings of the simulation.

    Raises:
        ExpressionError: a text cannot be read, or has no finite value.
        ModelError: a name or symbol is unknown, a joint has no motor, or the method is unknown.
    """
    require_system(system)
    where = system.name
    parameters = numbers(settings.parameters, f"{where}: parameter", {})
    known = known_values(system, parameters)
    return {
        "duration": number(settings.duration, f"{where}: duration", known),
        **keywords(MotionOptions, settings.options, where, known),
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
    """Return the content of the CSV file that `Result.to_csv` writes.

    Args:
        result: result of a simulation.
    """
    with tempfile.TemporaryDirectory(prefix="mbs-csv-") as folder:
        path = Path(folder) / "result.csv"
        result.to_csv(path)
        return path.read_bytes()


def _positions(
    system: System, settings: SimulationSettings, known: Mapping[str, float]
) -> dict[str, float] | list[float] | None:
    """Return the initial positions, except those of coordinates with prescribed motion.

    None for the assembled configuration. `known` are the values of symbols in texts. Raise a
    ModelError if the settings contain both q0 and a configuration.
    """
    if not settings.configuration:
        return numbers(settings.q0, f"{system.name}: q0", known) or None
    if settings.q0:
        raise ModelError(
            f"{system.name}: q0 and a configuration are given for the start; leave one of them out"
        )
    values = list(settings.configuration)
    if not settings.motion or len(values) != system.nq:
        return values
    rates = {speed.name for speed in system.velocity_coordinates}
    held = {system.velocity_coordinates[k].name for k in system.independent}
    held -= {name.rpartition(".")[0] for name in settings.motion}
    pairs = zip((c.name for c in system.coordinates), values, strict=True)
    return {name: x for name, x in pairs if name in held or name not in rates}


def _efforts(system: System, laws: Laws, known: Mapping[str, float]) -> Any:
    """Return the efforts (nv, 1) of all joints as a function of (t, q, v); None without laws."""
    if not laws:
        return None
    effort_function(system, dict.fromkeys(laws, 0.0))  # raises for joints that have no motor
    names = [speed.name for speed in system.velocity_coordinates]
    return law_of_motion(system, laws, names, known, "tau")


def _inputs(system: System, laws: Laws, known: Mapping[str, float]) -> Any:
    """Return the inputs of all devices as a function of (t, q, v); None without laws."""
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
    """Simulate a system and select frames of a movie: about thirty per second, at most 600.

    Args:
        system: open or closed system.
        settings: settings of the simulation.

    Raises:
        ModelError: the result would have too many rows for a page.
        MbsError: see `simulate`.
    """
    arguments = run_arguments(system, settings or SimulationSettings())
    chosen = RunArguments(system, **arguments)
    duration, step = chosen.duration, chosen.step
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
