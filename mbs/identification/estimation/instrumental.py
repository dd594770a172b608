"""Instrumental variables: least squares that noise in the regressor does not bias."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from mbs.errors import ModelError
from mbs.identification.estimation.estimate import Estimate
from mbs.identification.estimation.residuals import repetition
from mbs.identification.observations.observations import Observations
from mbs.identification.observations.quality import require_visible

Array = npt.NDArray[np.float64]


def instrumental(
    observations: Observations, instruments: Observations, weights: Array | None = None
) -> Estimate:
    """The parameters whose errors are uncorrelated with the instruments: Z' (y - W K) = 0.

    Source: Janot, Vandanjon & Gautier 2014, section III (IDIM-IV).

    Args:
        observations: y = W K, W made of measured motion.
        instruments: of the same rows and columns, Z in place of W, made of a motion that is free
            of the measurement's noise, such as `simulated_motion` or the motion that was ordered.
        weights: (m,) of each effort [1/(N m) or 1/N]; ones when None.

    Raises:
        ModelError: the instruments do not fit, or they do not show every parameter.
    """
    if instruments.W.shape != observations.W.shape or instruments.names != observations.names:
        raise ModelError(
            f"instruments: W has the shape {instruments.W.shape}, the observations"
            f" {observations.W.shape}; make both from the same instants and columns"
        )
    require_visible(observations)
    require_visible(instruments)
    used = np.ones(observations.y.shape[1]) if weights is None else np.asarray(weights, dtype=float)
    w = np.broadcast_to(used, observations.y.shape).reshape(-1)
    (W, y), (Z, _) = observations.rows, instruments.rows
    lengths = np.linalg.norm(Z * w[:, None], axis=0)
    A = (Z * w[:, None] / lengths).T @ (W * w[:, None] / lengths)
    inverse = np.linalg.inv(A) / lengths[:, None]
    x = inverse @ ((Z * (w * w)[:, None] / lengths).T @ y)
    covariance = _covariance(
        instruments, inverse / lengths, used, observations.y - observations.W @ x
    )
    return Estimate(
        "instrumental variables", observations.columns, x, covariance, used, observations
    )


def _covariance(instruments: Observations, inverse: Array, weights: Array, error: Array) -> Array:
    """(k, k) of the parameters (Z' W)^-1 Z' y, every effort with the deviation of its error."""
    n, m = error.shape
    left = max(n - inverse.shape[0] / m, 1.0)
    deviations = np.sqrt(np.sum(error**2, axis=0) * repetition(error) / left)
    spread = np.einsum("j,njk,ik->nji", weights**2 * deviations, instruments.W, inverse)
    rows = spread.reshape(-1, spread.shape[2])
    return np.asarray(rows.T @ rows, dtype=float)
