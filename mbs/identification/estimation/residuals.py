"""What a set of parameters leaves unexplained."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

_CHANCE = 2.0
"""Correlation of independent errors that is rarely passed, in parts of 1/sqrt(n)."""


@dataclass(frozen=True, slots=True, eq=False)
class Residuals:
    """Measured efforts and those that the parameters predict.

    Attributes:
        time: (n,) [s].
        measured: (n, m) [N m or N].
        predicted: (n, m) [N m or N].
        efforts: names of the m efforts.
        effort_units: their units.
    """

    time: Array
    measured: Array
    predicted: Array
    efforts: tuple[str, ...]
    effort_units: tuple[str, ...]

    @property
    def error(self) -> Array:
        """(n, m) measured minus predicted [N m or N]."""
        return self.measured - self.predicted

    @property
    def rms(self) -> Array:
        """(m,) root mean square of the error of each effort [N m or N]."""
        return np.asarray(np.sqrt(np.mean(self.error**2, axis=0)), dtype=float)

    @property
    def percent(self) -> Array:
        """(m,) norm of the error of each effort in percent of the norm of the effort."""
        sizes = np.linalg.norm(self.measured, axis=0)
        shares = np.linalg.norm(self.error, axis=0) / np.where(sizes > 0, sizes, 1.0)
        return np.asarray(100 * shares, dtype=float)

    @property
    def repetition(self) -> Array:
        """(m,) rows that say as much as one of independent error; see `repetition`."""
        return repetition(self.error)

    @property
    def total_percent(self) -> float:
        """Norm of all errors in percent of the norm of all efforts."""
        size = float(np.linalg.norm(self.measured))
        return 100 * float(np.linalg.norm(self.error)) / (size or 1.0)


def repetition(error: Array) -> Array:
    """(m,) rows that say as much as one of independent error: one plus twice the correlations.

    Correlations of each column with itself are summed from one row to the next up to the first
    that could be chance.

    Source: Bayley & Hammersley 1946.

    Args:
        error: (n, m) in equal steps of time.
    """
    n = len(error)
    found = np.ones(error.shape[1])
    for j, e in enumerate(error.T):
        size = float(e @ e)
        lag = 1
        while size > 0 and lag < n // 2:
            part = float(e[lag:] @ e[:-lag]) / size
            if part < _CHANCE / np.sqrt(n):
                break
            found[j] += 2 * part
            lag += 1
    return found
