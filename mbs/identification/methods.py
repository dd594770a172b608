"""Every method of estimation by its name, as one function of the equations in base parameters."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

from mbs.errors import ModelError
from mbs.identification.base_parameters import BaseParameters
from mbs.identification.consistent import consistent_weighted
from mbs.identification.estimate import Estimate, Estimator
from mbs.identification.filters import Samples
from mbs.identification.instrumental import instrumental
from mbs.identification.least_squares import least_squares
from mbs.identification.observations import Observations, observe_filtered
from mbs.identification.prior import Prior
from mbs.identification.regressor import Regressor
from mbs.identification.robust import robust
from mbs.identification.simulated_motion import simulated_motion
from mbs.identification.weighted import reweighted, weighted


@dataclass(frozen=True, slots=True, eq=False)
class Setting:
    """What methods need beside the equations in base parameters.

    Attributes:
        model: regressor of the full set.
        base: base parameters of its columns.
        samples: of the record.
        full: the equations in the full set.
        bodies: a full set that explains them.
        prior: of the bodies.
    """

    model: Regressor
    base: BaseParameters
    samples: Samples
    full: Observations
    bodies: Estimate
    prior: Prior


def _by_instruments(setting: Setting) -> Estimator:
    """Instruments from the motion that the bodies make under the measured efforts."""
    if setting.full.effort_units == ("J",) or setting.samples.bandwidth is None:
        raise ModelError(
            f"{setting.base.system.name}: instruments are for filtered efforts; use"
            " equations='dynamic', or another method"
        )
    simulated = simulated_motion(setting.model, setting.bodies.values, setting.samples)
    instruments = observe_filtered(setting.model, simulated).grouped(setting.base)

    def estimator(observations: Observations) -> Estimate:
        weights = weighted(observations).weights
        return instrumental(observations, instruments.at(observations.time), weights)

    return estimator


def _by_bodies(setting: Setting) -> Estimator:
    """Base parameters of the bodies that explain the efforts best."""

    def estimator(observations: Observations) -> Estimate:
        rows = setting.full.at(observations.time)
        bodies = consistent_weighted(rows, setting.prior)
        B = setting.base.matrix
        values, covariance = B @ bodies.values, B @ bodies.covariance @ B.T
        return Estimate(
            bodies.method, observations.columns, values, covariance, bodies.weights, observations
        )

    return estimator


def _always(estimator: Estimator) -> Callable[[Setting], Estimator]:
    return lambda _: estimator


METHODS: Mapping[str, Callable[[Setting], Estimator]] = MappingProxyType(
    {
        "least_squares": _always(least_squares),
        "weighted": _always(weighted),
        "reweighted": _always(reweighted),
        "robust": _always(robust),
        "instrumental": _by_instruments,
        "consistent": _by_bodies,
    }
)
"""Methods for base parameters by name."""
