"""Every method of estimation by its name, as one function of the equations in base parameters."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from mbs.errors import SolverError
from mbs.identification.base.base_parameters import BaseParameters
from mbs.identification.bodies.consistent import consistent_weighted
from mbs.identification.bodies.prior import Prior
from mbs.identification.estimation.estimate import Estimate, Estimator
from mbs.identification.estimation.instrumental import instrumental
from mbs.identification.estimation.least_squares import least_squares
from mbs.identification.estimation.robust import robust
from mbs.identification.estimation.simulated_motion import simulated_motion
from mbs.identification.estimation.weighted import reweighted, weighted
from mbs.identification.observations.observations import Observations, observe_filtered, stacked
from mbs.identification.records.filters import Samples
from mbs.identification.regressors.dynamic import Regressor

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Setting:
    """What methods need beside the equations in base parameters.

    Attributes:
        model: regressor of the full set.
        base: base parameters of its columns.
        samples: of each record.
        full: the equations in the full set.
        bodies: that explain them, by `consistent_weighted`; None where none were found.
        prior: of the bodies.
    """

    model: Regressor
    base: BaseParameters
    samples: tuple[Samples, ...]
    full: Observations
    bodies: Estimate | None
    prior: Prior

    def bodies_of(self, part: Observations) -> Estimate:
        """The bodies that explain these equations, all or some of the record's."""
        if self.bodies is not None and len(part.time) == len(self.full.time):
            return self.bodies
        return consistent_weighted(self.full.at(part.time), self.prior)

    def moving(self, part: Observations) -> Array:
        """Values of the full set that move as these equations say.

        They are those of bodies; where none are found, the base parameters by weighted least
        squares in their places, which have the same efforts.
        """
        try:
            return self.bodies_of(part).values
        except SolverError:
            values = np.zeros(len(self.base.columns))
            values[self.base.places] = weighted(part).values
            return values


def _by_instruments(setting: Setting) -> Estimator:
    """Instruments from the motion that bodies of these equations make under the efforts."""

    def estimator(observations: Observations) -> Estimate:
        values = setting.moving(observations)
        moved = [simulated_motion(setting.model, values, one) for one in setting.samples]
        whole = stacked([observe_filtered(setting.model, one) for one in moved])
        instruments = whole.grouped(setting.base)
        weights = weighted(observations).weights
        return instrumental(observations, instruments.at(observations.time), weights)

    return estimator


def _by_bodies(setting: Setting) -> Estimator:
    """Base parameters of the bodies that explain the efforts best."""

    def estimator(observations: Observations) -> Estimate:
        bodies = setting.bodies_of(observations)
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
