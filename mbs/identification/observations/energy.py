"""Equations of the energy model: work of the efforts over intervals of time.

Source: Gautier & Khalil 1988; Khalil & Creusot 1997, eq. 47-52.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from mbs.errors import ModelError
from mbs.identification.observations.evaluated import evaluated, known_of, motion_of
from mbs.identification.observations.observations import Observations, clear_of_singular
from mbs.identification.records.filters import Samples

Array = npt.NDArray[np.float64]


def observe_energy(energy: Any, power: Any, samples: Samples, interval: float) -> Observations:
    """One equation for each interval: work of the efforts = change of h K + integral of P K.

    Integrals are taken by the trapezoidal rule. One equation in place of one for each joint and
    instant: it is the weakest of the models in noise.

    Source: Khalil & Creusot 1997, eq. 47.

    Args:
        energy: ``energy_regressor``, (q, v) -> h with `.columns` and `.system`.
        power: ``power_regressor`` of the same columns.
        samples: positions, velocities and efforts; accelerations are not used.
        interval: [s].

    Raises:
        ModelError: the interval is shorter than a sample or longer than the record.
    """
    step = round(interval * samples.rate)
    if not 1 <= step < len(samples.time):
        raise ModelError(
            f"energy model: an interval of {interval:g} s has {step} of the {len(samples.time)}"
            " samples; give one or more, and less than the record has"
        )
    (h,), (P,) = evaluated(energy, samples), evaluated(power, samples)
    v = motion_of(energy, samples)[1]
    work = _integral(np.sum(v * (samples.tau - known_of(energy, samples)), axis=1), samples.rate)
    taken = h[:, 0] + _integral(P[:, 0], samples.rate)
    ends = np.arange(0, len(samples.time), step)
    found = Observations(
        samples.time[ends[1:]],
        np.diff(taken[ends], axis=0)[:, None, :],
        np.diff(work[ends])[:, None],
        tuple(energy.columns),
        ("energy",),
        ("J",),
    )
    return clear_of_singular(found, energy, samples, 0.0, step / samples.rate)


def _integral(values: Array, rate: float) -> Array:
    """From the first sample on, by the trapezoidal rule."""
    parts = (values[1:] + values[:-1]) / (2 * rate)
    return np.concatenate([np.zeros((1, *values.shape[1:])), np.cumsum(parts, axis=0)])
