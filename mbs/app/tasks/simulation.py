"""Simulation of a system from the texts and numbers of a form or a command."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from mbs.app.tasks.simulation_laws import Laws, law_of_motion, law_of_time, number, numbers
from mbs.assembly import System
from mbs.assembly.model_function import require_system
from mbs.errors import ModelError
from mbs.messages import did_you_mean
from mbs.models.effort import effort_function
from mbs.result import Result
from mbs.simulate import run
from mbs.simulate.inputs import input_function

METHODS = ("dopri5", "rodas")
"""Methods of integration: an explicit pair, and a linearly implicit one for stiff systems."""


@dataclass(frozen=True, slots=True)
class SimulationSettings:
    """What is simulated, and how; a text may stand wherever a number may.

    Attributes:
        duration: [s].
        step: time between rows of the result [s].
        q0: positions at the start by name of the coordinate [rad or m], the others as in the
            assembled posture.
        posture: in place of q0 all positions at the start, which close the loops; none when empty.
        v0: velocities at the start by name [rad/s or m/s].
        tau: efforts by name of a joint with a motor [N m or N]: numbers, or laws of t, of
            positions and velocities such as `j1.q` and `j1.v`, and of symbols of the system.
        inputs: inputs of devices by name of the device, laws as for tau.
        motion: laws of t for coordinates that drives move, by names such as "j1.q".
        parameters: values of symbols of the system, the others at their defaults.
        tolerance: what the error of the motion should stay near.
        method: one of `METHODS`.
    """

    duration: float | str = 2.0
    step: float | str = 0.01
    q0: Laws = field(default_factory=dict)
    posture: Sequence[float] = ()
    v0: Laws = field(default_factory=dict)
    tau: Laws = field(default_factory=dict)
    inputs: Laws = field(default_factory=dict)
    motion: Laws = field(default_factory=dict)
    parameters: Laws = field(default_factory=dict)
    tolerance: float | str = 1e-8
    method: str = "dopri5"


def simulate(
    system: System, settings: SimulationSettings | None = None, *, quiet: bool = False
) -> Result:
    """The motion of a system as `mbs.simulate.run` gives it.

    Args:
        system: open or closed.
        settings: of the simulation.
        quiet: no progress bar.

    Returns:
        for every coordinate `name.q`, `name.v`, `name.a`, `name.tau`, then the energies,
        `closure_residual`, devices and sensors.

    Raises:
        ExpressionError: a text cannot be read, or holds an unknown symbol.
        MbsError: as for `mbs.simulate.run`.
    """
    return run(system, **run_arguments(system, settings or SimulationSettings()), quiet=quiet)


def run_arguments(system: System, settings: SimulationSettings) -> dict[str, Any]:
    """The arguments of `mbs.simulate.run` that the settings stand for.

    Args:
        system: open or closed.
        settings: of the simulation.

    Raises:
        ExpressionError: a text cannot be read, or holds an unknown symbol.
        ModelError: a name is unknown or has no motor, or the method is none.
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
    }


def known_values(system: System, given: Mapping[str, float]) -> dict[str, float]:
    """Values of the symbols of a system, those that have one.

    Args:
        system: open or closed.
        given: values by name, the others at their defaults.

    Raises:
        ModelError: a name is unknown.
    """
    names = [parameter.name for parameter in system.parameters]
    values = system.parameter_values(given, needed=())
    return {n: x for n, x in zip(names, values, strict=True) if x == x}


def csv_bytes(result: Result) -> bytes:
    """The file that `Result.to_csv` writes."""
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


def _positions(
    system: System, settings: SimulationSettings, known: Mapping[str, float]
) -> dict[str, float] | list[float] | None:
    """Positions at the start, those that drives do not move where there are drives."""
    if not settings.posture:
        return numbers(settings.q0, f"{system.name}: q0", known) or None
    if settings.q0:
        raise ModelError(
            f"{system.name}: q0 and a posture are given for the start; leave one of them out"
        )
    values = list(settings.posture)
    if not settings.motion or len(values) != system.nq:
        return values
    rates = {speed.name for speed in system.speeds}
    held = {system.speeds[k].name for k in system.active}
    held -= {name.rpartition(".")[0] for name in settings.motion}
    pairs = zip((c.name for c in system.coordinates), values, strict=True)
    return {name: x for name, x in pairs if name in held or name not in rates}


def _efforts(system: System, laws: Laws, known: Mapping[str, float]) -> Any:
    """Laws of the efforts of all joints, None without any."""
    if not laws:
        return None
    effort_function(system, dict.fromkeys(laws, 0.0))  # refuses joints that have no motor
    names = [speed.name for speed in system.speeds]
    return law_of_motion(system, laws, names, known, "tau")


def _inputs(system: System, laws: Laws, known: Mapping[str, float]) -> Any:
    """Laws of the inputs of all devices, None without any."""
    if not laws:
        return None
    input_function(system, dict.fromkeys(laws, 0.0))  # refuses devices that are not there
    names = [device.name for device in system.devices]
    return law_of_motion(system, laws, names, known, "input")
