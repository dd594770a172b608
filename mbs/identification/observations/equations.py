"""The equations of a record by the name of their model."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

import numpy as np

from mbs.assembly import System
from mbs.identification.observations.energy import observe_energy
from mbs.identification.observations.momentum import observe_momentum
from mbs.identification.observations.observations import Observations, observe_filtered
from mbs.identification.records.filters import Samples
from mbs.identification.regressors.dynamic import regressor
from mbs.identification.regressors.energy import energy_regressor, power_regressor
from mbs.identification.regressors.filtered import filtered_regressor

INTERVALS = 1.0
"""Intervals of the energy model in a period of the bandwidth."""


def _dynamic(system: System, samples: Samples, bandwidth: float, options: Any) -> Observations:
    """Efforts, filtered once more on both sides."""
    return observe_filtered(regressor(system, **options), samples)


def _filtered(system: System, samples: Samples, bandwidth: float, options: Any) -> Observations:
    """Momenta behind a filter whose corner is the bandwidth; no accelerations."""
    return observe_momentum(filtered_regressor(system, **options), samples, 2 * np.pi * bandwidth)


def _energy(system: System, samples: Samples, bandwidth: float, options: Any) -> Observations:
    """Work over intervals of a period of the bandwidth; no accelerations."""
    models = energy_regressor(system, **options), power_regressor(system, **options)
    return observe_energy(*models, samples, 1 / (INTERVALS * bandwidth))


EQUATIONS: Mapping[str, Callable[[System, Samples, float, Any], Observations]] = MappingProxyType(
    {"dynamic": _dynamic, "filtered": _filtered, "energy": _energy}
)
"""Models by name: (system, samples, bandwidth, options of the columns) -> the equations."""
