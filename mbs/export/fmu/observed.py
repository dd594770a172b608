"""What an FMU shows on request: sensors, energies, how far the loops are open."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import casadi
from casadi import SX

from mbs.assembly import System
from mbs.errors import ModelError
from mbs.export.fmu.description import Variable
from mbs.loops.closure import closure_rows
from mbs.messages import did_you_mean
from mbs.models.composition import outputs_of
from mbs.models.energy import energy
from mbs.models.measurements import measurements


@dataclass(frozen=True, slots=True)
class Observed:
    """Something that may be asked for, beside motions and the pose of the terminal frame.

    Attributes:
        variables: of a system.
        values: of them at positions q (nq, 1) that close the loops, velocities and accelerations
            (m, 1) of the independent joints.
    """

    variables: Callable[[System], list[Variable]]
    values: Callable[[System, SX, SX, SX], Sequence[SX]]


def chosen(system: System, names: Sequence[str]) -> list[Observed]:
    """What has these names, each once.

    Raises:
        ModelError: there is nothing of that name.
    """
    given = dict.fromkeys([names] if isinstance(names, str) else names)
    for name in given:
        if name not in OBSERVED:
            raise ModelError(
                f"{system.name}: the FMU has no outputs {name!r}; {did_you_mean(name, OBSERVED)}"
            )
    return [OBSERVED[name] for name in given]


def _sensor_variables(system: System) -> list[Variable]:
    return [
        Variable(name=name, unit=unit, description=f"read by {attached.sensor.name}")
        for attached in system.sensors
        for name, unit in attached.columns
    ]


def _sensor_values(system: System, q: SX, v: SX, a: SX) -> list[SX]:
    return [SX(casadi.vec(read)) for read in outputs_of(system, measurements(system), q, v, a)]


def _energy_variables(system: System) -> list[Variable]:
    return [
        Variable(name=f"energy.{kind}", unit="J", description=f"{kind} energy")
        for kind in ("kinetic", "potential")
    ]


def _energy_values(system: System, q: SX, v: SX, a: SX) -> list[SX]:
    return outputs_of(system, energy(system), q, v)


def _closure_variables(system: System) -> list[Variable]:
    text = "largest closure row of the loops, lengths in m and angles in rad"
    return [Variable(name="closure", description=text)]


def _closure_values(system: System, q: SX, v: SX, a: SX) -> list[SX]:
    rows = closure_rows(system, q) if system.is_closed else SX(0)
    return [SX(casadi.mmax(casadi.fabs(rows)))]


OBSERVED = {
    "sensors": Observed(_sensor_variables, _sensor_values),
    "energy": Observed(_energy_variables, _energy_values),
    "closure": Observed(_closure_variables, _closure_values),
}
