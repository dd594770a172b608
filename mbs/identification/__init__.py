"""Base inertial parameters and parameter identification."""

from mbs.deprecation import moved
from mbs.identification._base_parameters import BaseParameters, base_parameters
from mbs.identification._identify import Identification, identify, report
from mbs.identification._least_squares import (
    huber,
    instrumental,
    iteratively_reweighted,
    least_squares,
    simulated_motion,
    weighted,
)
from mbs.identification.bodies import (
    Prior,
    consistent_links,
    consistent_weighted,
    full_parameters,
    physically_consistent,
)
from mbs.identification.estimate import (
    Estimate,
    Residuals,
    cross_validated,
    holdout_residuals,
    plot_residuals,
)
from mbs.identification.exciting import FourierSettings, excitation
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
    motor_to_joint,
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
    numeric_parameters,
    power_regressor,
    regressor,
    symbolic_parameters,
)
from mbs.identification.trajectory import Plane, Trajectory

__getattr__ = moved(
    __name__,
    {
        "joint_side": "mbs.identification.motor_to_joint",
        "held_out": "mbs.identification.holdout_residuals",
        "recovered": "mbs.identification.full_parameters",
        "reweighted": "mbs.identification.iteratively_reweighted",
        "robust": "mbs.identification.huber",
        "consistent": "mbs.identification.physically_consistent",
        "values_of": "mbs.identification.symbolic_parameters",
        "numbers_of": "mbs.identification.numeric_parameters",
        "Series": "mbs.identification.FourierSettings",
    },
)

__all__ = [
    "BaseParameters",
    "Column",
    "Essential",
    "Estimate",
    "FourierSettings",
    "Identification",
    "Observations",
    "Plane",
    "Prior",
    "Record",
    "Regressor",
    "Residuals",
    "Samples",
    "Trajectory",
    "base_parameters",
    "columns_of",
    "consistent_links",
    "consistent_weighted",
    "cross_validated",
    "energy_regressor",
    "essential",
    "excitation",
    "excitation_quality",
    "filtered_regressor",
    "full_parameters",
    "holdout_residuals",
    "huber",
    "identify",
    "instrumental",
    "iteratively_reweighted",
    "known_efforts",
    "least_squares",
    "motor_to_joint",
    "numeric_parameters",
    "observe",
    "observe_energy",
    "observe_filtered",
    "observe_momentum",
    "physically_consistent",
    "plot_residuals",
    "power_regressor",
    "regressor",
    "report",
    "resampled",
    "simulated_motion",
    "smoothed",
    "smoothed_with_velocity",
    "symbolic_parameters",
    "weighted",
]
