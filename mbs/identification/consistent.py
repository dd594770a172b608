"""Identification of a full set of parameters that bodies can have."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from mbs.errors import ModelError
from mbs.identification.columns import INERTIAL
from mbs.identification.estimate import Estimate
from mbs.identification.excitation_quality import excitation_quality
from mbs.identification.observations import Observations
from mbs.identification.physical_set import Misfit, likeliest

Array = npt.NDArray[np.float64]

HEAVIEST = 100.0
"""Bound on the mass of a link where none is given [kg]."""

_RANK = 1e-9


def consistent(
    observations: Observations,
    guess: Array | None = None,
    heaviest: float = HEAVIEST,
    emphasis: float = 1.0,
) -> Estimate:
    """The likeliest full set of parameters that bodies can have, with errors alike in all joints.

    Every pseudo-inertia is positive definite, no link is heavier than the bound, rotors and
    friction are not negative. What the record does not show comes from the guess.

    Source: Wensing, Kim & Slotine 2018; Rucker & Wensing 2022; Lee, Wensing & Park 2020.

    Args:
        observations: in the full set of parameters.
        guess: (k,) parameters such as those of a drawing; balls of 1 kg when None.
        heaviest: bound on the mass of a link [kg].
        emphasis: weight of the guess; 1 lets it count as one equation.

    Raises:
        ModelError: a rotor or friction cannot be seen, or the set is not a full one.
        SolverError: the search did not end.
    """
    error = unconstrained_error(observations)
    freedom = max(error.size - observations.W.shape[2], 1)
    deviation = float(np.linalg.norm(error)) / np.sqrt(freedom)
    weights = np.full(error.shape[1], 1 / _positive(deviation, observations))
    return _with_weights(observations, weights, guess, heaviest, emphasis)


def consistent_weighted(
    observations: Observations,
    guess: Array | None = None,
    heaviest: float = HEAVIEST,
    emphasis: float = 1.0,
) -> Estimate:
    """As `consistent`, every effort divided by the deviation of its own error.

    Args:
        observations: in the full set of parameters.
        guess: as for `consistent`.
        heaviest: as for `consistent`.
        emphasis: as for `consistent`.
    """
    error = unconstrained_error(observations)
    rms = np.sqrt(np.mean(error**2, axis=0))
    weights = np.array([1 / _positive(float(x), observations) for x in rms])
    return _with_weights(observations, weights, guess, heaviest, emphasis)


def unconstrained_error(observations: Observations) -> Array:
    """(n, m) what least squares leave of the efforts, whether or not the set is minimal."""
    W, y = observations.rows
    lengths = np.linalg.norm(W, axis=0)
    x = np.linalg.lstsq(W / np.where(lengths > 0, lengths, 1.0), y, rcond=_RANK)[0]
    error = y - (W / np.where(lengths > 0, lengths, 1.0)) @ x
    return np.asarray(error.reshape(observations.y.shape), dtype=float)


def _positive(deviation: float, observations: Observations) -> float:
    """The deviation, or a small part of the efforts where the equations fit exactly."""
    return max(deviation, 1e-6 * float(np.sqrt(np.mean(observations.y**2))), 1e-12)


def _with_weights(
    observations: Observations,
    weights: Array,
    guess: Array | None,
    heaviest: float,
    emphasis: float,
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
    values, covariance = likeliest(misfit, observations.columns, guess, heaviest, emphasis)
    return Estimate(
        "physically consistent",
        observations.columns,
        values,
        covariance,
        weights,
        observations,
    )
