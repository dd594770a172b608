"""Identification of a full set of parameters that bodies can have."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from mbs.errors import ModelError
from mbs.identification.bodies.physical_set import Misfit, likeliest
from mbs.identification.bodies.prior import Prior
from mbs.identification.estimation.estimate import Estimate
from mbs.identification.estimation.residuals import repetition
from mbs.identification.follower import Watch
from mbs.identification.observations.observations import Observations
from mbs.identification.observations.quality import excitation_quality
from mbs.identification.regressors.columns import INERTIAL

Array = npt.NDArray[np.float64]

_RANK = 1e-9

_EXACT = 1e-3
"""Part of an effort below which its error is not believed: what simulations give fits too well
for the search to end, and no sensor is that good."""


def consistent(
    observations: Observations, prior: Prior | None = None, watch: Watch | None = None
) -> Estimate:
    """The likeliest full set of parameters that bodies can have, with errors alike in all joints.

    Every pseudo-inertia is positive definite, masses keep their bounds, rotors and friction are
    not negative. What the record does not show comes from the guess. Deviations are those of
    errors that repeat themselves from row to row as the residuals do.

    Source: Wensing, Kim & Slotine 2018; Rucker & Wensing 2022; Lee, Wensing & Park 2020.

    Args:
        observations: in the full set of parameters.
        prior: guess and bounds; `Prior()` when None.
        watch: is told the part of the search that is over, between 0 and 1.

    Raises:
        ModelError: a rotor or friction cannot be seen, or the set is not a full one.
        SolverError: the search did not end.
    """
    error = unconstrained_error(observations)
    freedom = max(error.size - observations.W.shape[2], 1)
    deviation = float(np.linalg.norm(error)) / np.sqrt(freedom)
    weights = np.full(error.shape[1], 1 / _positive(deviation, observations.y))
    return _with_weights(observations, weights, prior or Prior(), watch)


def consistent_weighted(
    observations: Observations, prior: Prior | None = None, watch: Watch | None = None
) -> Estimate:
    """As `consistent`, every effort divided by the deviation of its own error.

    Args:
        observations: in the full set of parameters.
        prior: as for `consistent`.
        watch: as for `consistent`.
    """
    error = unconstrained_error(observations)
    rms = np.sqrt(np.mean(error**2, axis=0))
    weights = np.array(
        [1 / _positive(float(x), y) for x, y in zip(rms, observations.y.T, strict=True)]
    )
    return _with_weights(observations, weights, prior or Prior(), watch)


def unconstrained_error(observations: Observations) -> Array:
    """(n, m) what least squares leave of the efforts, whether or not the set is minimal."""
    W, y = observations.rows
    lengths = np.linalg.norm(W, axis=0)
    x = np.linalg.lstsq(W / np.where(lengths > 0, lengths, 1.0), y, rcond=_RANK)[0]
    error = y - (W / np.where(lengths > 0, lengths, 1.0)) @ x
    return np.asarray(error.reshape(observations.y.shape), dtype=float)


def _positive(deviation: float, efforts: Array) -> float:
    """The deviation, or a small part of the efforts where the equations fit exactly."""
    return max(deviation, _EXACT * float(np.sqrt(np.mean(efforts**2))), 1e-12)


def _with_weights(
    observations: Observations, weights: Array, prior: Prior, watch: Watch | None
) -> Estimate:
    unseen = set(excitation_quality(observations).unseen)
    hidden = [c.name for c in observations.columns if c.kind not in INERTIAL and c.name in unseen]
    if hidden:
        raise ModelError(
            f"observations: {', '.join(hidden)} cannot be seen in this record; move the joint, or"
            " select the other parameters"
        )
    W, y = observations.rows
    w = np.broadcast_to(weights, observations.y.shape).reshape(-1)
    misfit = Misfit.of_rows(W * w[:, None], y * w)
    values, covariance = likeliest(misfit, observations.columns, prior, watch)
    method, error = "physically consistent", observations.y - observations.W @ values
    repeated = weights * np.sqrt(repetition(error) - 1)
    spread = (W * np.broadcast_to(repeated, error.shape).reshape(-1, 1)) @ covariance
    covariance = covariance + spread.T @ spread
    return Estimate(method, observations.columns, values, covariance, weights, observations)
