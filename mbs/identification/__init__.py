"""Base inertial parameters and identification."""

from mbs.identification.base_parameters import BaseParameters, base_parameters
from mbs.identification.columns import Column, columns_of, numbers_of, values_of
from mbs.identification.consistent import consistent, consistent_weighted
from mbs.identification.energy_observations import observe_energy
from mbs.identification.energy_regressor import energy_regressor, power_regressor
from mbs.identification.essential import Essential, essential
from mbs.identification.estimate import Estimate, cross_validated, held_out
from mbs.identification.excitation import Series, excitation
from mbs.identification.excitation_limits import Plane
from mbs.identification.excitation_quality import excitation_quality
from mbs.identification.excitation_trajectory import Trajectory
from mbs.identification.filtered_observations import observe_momentum
from mbs.identification.filtered_regressor import filtered_regressor
from mbs.identification.filters import Samples, resampled, smoothed, smoothed_with_velocity
from mbs.identification.identify import Identification, identify
from mbs.identification.instrumental import instrumental
from mbs.identification.least_squares import least_squares
from mbs.identification.observations import Observations, observe, observe_filtered
from mbs.identification.physical_set import consistent_links
from mbs.identification.prior import Prior
from mbs.identification.record import Record, joint_side
from mbs.identification.recovery import recovered
from mbs.identification.regressor import Regressor, known_efforts, regressor
from mbs.identification.report import report
from mbs.identification.residual_plot import plot_residuals
from mbs.identification.residuals import Residuals
from mbs.identification.robust import robust
from mbs.identification.simulated_motion import simulated_motion
from mbs.identification.weighted import reweighted, weighted

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
