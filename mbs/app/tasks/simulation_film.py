"""A simulated motion with the postures that a picture needs to play it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mbs.app.tasks.simulation import SimulationSettings, run_arguments
from mbs.assembly import System
from mbs.errors import ModelError
from mbs.result import Result
from mbs.simulate import run

MOST_ROWS = 100_000
"""Rows of the longest result that a page is given."""

_MOST_FRAMES = 600
_FEWEST_FRAMES = 60
_PER_SECOND = 30.0


@dataclass(frozen=True, slots=True, eq=False)
class Film:
    """A result, and the postures of some of its rows.

    Attributes:
        result: of the simulation.
        times: (m,) of the frames [s].
        postures: (m, nq) of the frames, in the order of `system.coordinates` [rad or m].
    """

    result: Result
    times: NDArray[np.float64]
    postures: NDArray[np.float64]


def film(system: System, settings: SimulationSettings | None = None) -> Film:
    """Simulate, and keep about thirty frames a second for the picture, at most 600.

    Args:
        system: open or closed.
        settings: of the simulation.

    Raises:
        ModelError: there are more rows than a page is given.
        MbsError: as for `simulate`.
    """
    arguments = run_arguments(system, settings or SimulationSettings())
    duration, step = arguments["duration"], arguments["step"]
    if step > 0 and duration / step > MOST_ROWS:
        raise ModelError(
            f"{system.name}: {duration:g} s in steps of {step:g} s are more than {MOST_ROWS} rows;"
            " give a longer step, or simulate in a script"
        )
    return filmed(system, run(system, **arguments, quiet=True))


def filmed(system: System, result: Result) -> Film:
    """The frames of a result.

    Args:
        system: that moved.
        result: of `mbs.simulate.run`.
    """
    span = float(result.time[-1] - result.time[0])
    wanted = min(max(span * _PER_SECOND, _FEWEST_FRAMES), _MOST_FRAMES, len(result))
    rows = np.unique(np.linspace(0, len(result) - 1, int(wanted)).round().astype(int))
    q = np.column_stack([result[f"{c.name}.q"] for c in system.coordinates])
    return Film(result, result.time[rows], q[rows])
