"""Ordinary least squares."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from mbs.identification.estimate import Estimate
from mbs.identification.excitation_quality import require_visible
from mbs.identification.observations import Observations
from mbs.identification.triangle import solve

Array = npt.NDArray[np.float64]


def least_squares(observations: Observations) -> Estimate:
    """The parameters that make the sum of squared errors of all efforts least.

    The standard deviations hold for errors that are independent and alike in every row.

    Source: Gautier & Khalil 1988; Khalil & Dombre 2002, chapter 12.

    Args:
        observations: that show every parameter.

    Raises:
        ModelError: the parameters that they do not show.
    """
    require_visible(observations)
    W, y = observations.rows
    x, covariance = solve(W, y, len(y) - len(observations.columns))
    weights = np.ones(observations.y.shape[1])
    return Estimate("least squares", observations.columns, x, covariance, weights, observations)
