"""Equations of the filtered model, which need no accelerations.

Source: Khalil & Creusot 1997, eq. 41-46.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from mbs.errors import ModelError
from mbs.identification.observations.evaluated import evaluated, known_of
from mbs.identification.observations.observations import Observations, clear_of_singular
from mbs.identification.records.filters import Samples
from mbs.result import optional_module

Array = npt.NDArray[np.float64]

_SETTLED = 15.0
_ROWS = 2.0


def observe_momentum(filtered: Any, samples: Samples, corner: float) -> Observations:
    """F tau = (F' D1 + F D2) K with F = a^2 / (s + a)^2 and F' = s F.

    The time in which the filter forgets its start is left out, and rows that come sooner after
    another than two of its time constants, since their errors are alike.

    Source: Khalil & Creusot 1997, eq. 44-46; the filter by the bilinear transform.

    Args:
        filtered: ``filtered_regressor``, (q, v) -> D1, D2 with `.columns` and `.system`.
        samples: positions, velocities and efforts; accelerations are not used.
        corner: a [rad/s]; five to ten times the highest frequency of the motion.

    Raises:
        ModelError: the corner does not suit the samples, or they have not the coordinates.
    """
    rate = samples.rate
    settled = int(np.ceil(_SETTLED * rate / corner)) if corner > 0 else len(samples.time)
    if corner >= rate or settled >= len(samples.time) - 1:
        raise ModelError(
            f"filtered model: the corner is {corner:g} rad/s for {rate:g} samples in a second over"
            f" {len(samples.time) / rate:.3g} s; give less than {rate:g} and a longer record"
        )
    D1, D2 = evaluated(filtered, samples)
    tau = samples.tau - known_of(filtered, samples)
    plain, slope = ([0.0, 0.0, corner**2], [0.0, corner**2, 0.0])
    keep = slice(settled, None, max(round(_ROWS * rate / corner), 1))
    W = _filtered(D1, slope, corner, rate)[keep] + _filtered(D2, plain, corner, rate)[keep]
    found = Observations(
        samples.time[keep],
        W,
        _filtered(tau, plain, corner, rate)[keep],
        tuple(filtered.columns),
        samples.efforts,
        samples.effort_units,
    )
    return clear_of_singular(found, filtered, samples, 0.0, _SETTLED / corner)


def _filtered(values: Array, numerator: list[float], corner: float, rate: float) -> Array:
    signal = optional_module("scipy.signal", "identify")
    b, a = signal.bilinear(numerator, [1.0, 2 * corner, corner**2], fs=rate)
    return np.asarray(signal.lfilter(b, a, values, axis=0), dtype=float)
