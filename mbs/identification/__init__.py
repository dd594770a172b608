"""Base inertial parameters and parameter identification."""

from mbs.identification.base_parameters import BaseParameters, base_parameters
from mbs.identification.bodies import (
    Prior,
    consistent,
    consistent_links,
    consistent_weighted,
    recovered,
)
from mbs.identification.estimate import (
    Estimate,
    Residuals,
    cross_validated,
    held_out,
    plot_residuals,
)
from mbs.identification.exciting import Series, excitation
from mbs.identification.identify import Identification, identify, report
from mbs.identification.least_squares import (
    instrumental,
    least_squares,
    reweighted,
    robust,
    simulated_motion,
    weighted,
)
from mbs.identification.methods import Essential, essential
from mbs.identification.observations import (
    Observations,
    excitation_quality,
    observe,
    observe_energy,
    observe_filtered,
    observe_momentum,
)
from mbs.identification.record import (
    Record,
    Samples,
    joint_side,
    resampled,
    smoothed,
    smoothed_with_velocity,
)
from mbs.identification.regressors import (
    Column,
    Regressor,
    columns_of,
    energy_regressor,
    filtered_regressor,
    known_efforts,
    numbers_of,
    power_regressor,
    regressor,
    values_of,
)
from mbs.identification.trajectory import Plane, Trajectory

__all__ = [
    "BaseParameters",
    "Column",
    "Essential",
    "Estimate",
    "Identification",
    "Observations",
    "Plane",
    "Prior",
    "Record",
    "Regressor",
    "Residuals",
    "Samples",
    "Series",
    "Trajectory",
    "base_parameters",
    "columns_of",
    "consistent",
    "consistent_links",
    "consistent_weighted",
    "cross_validated",
    "energy_regressor",
    "essential",
    "excitation",
    "excitation_quality",
    "filtered_regressor",
    "held_out",
    "identify",
    "instrumental",
    "joint_side",
    "known_efforts",
    "least_squares",
    "numbers_of",
    "observe",
    "observe_energy",
    "observe_filtered",
    "observe_momentum",
    "plot_residuals",
    "power_regressor",
    "recovered",
    "regressor",
    "report",
    "resampled",
    "reweighted",
    "robust",
    "simulated_motion",
    "smoothed",
    "smoothed_with_velocity",
    "values_of",
    "weighted",
]
