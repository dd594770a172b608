"""Base inertial parameters and identification."""

from mbs.identification.base.base_parameters import BaseParameters, base_parameters
from mbs.identification.bodies.consistent import consistent, consistent_weighted
from mbs.identification.bodies.physical_set import consistent_links
from mbs.identification.bodies.prior import Prior
from mbs.identification.bodies.recovery import recovered
from mbs.identification.estimation.essential import Essential, essential
from mbs.identification.estimation.estimate import Estimate, cross_validated, held_out
from mbs.identification.estimation.instrumental import instrumental
from mbs.identification.estimation.least_squares import least_squares
from mbs.identification.estimation.residual_plot import plot_residuals
from mbs.identification.estimation.residuals import Residuals
from mbs.identification.estimation.robust import robust
from mbs.identification.estimation.simulated_motion import simulated_motion
from mbs.identification.estimation.weighted import reweighted, weighted
from mbs.identification.exciting.excitation import Series, excitation
from mbs.identification.exciting.limits import Plane
from mbs.identification.exciting.trajectory import Trajectory
from mbs.identification.identify import Identification, identify
from mbs.identification.observations.energy import observe_energy
from mbs.identification.observations.momentum import observe_momentum
from mbs.identification.observations.observations import Observations, observe, observe_filtered
from mbs.identification.observations.quality import excitation_quality
from mbs.identification.records.filters import Samples, resampled, smoothed, smoothed_with_velocity
from mbs.identification.records.record import Record, joint_side
from mbs.identification.regressors.columns import Column, columns_of, numbers_of, values_of
from mbs.identification.regressors.dynamic import Regressor, known_efforts, regressor
from mbs.identification.regressors.energy import energy_regressor, power_regressor
from mbs.identification.regressors.filtered import filtered_regressor
from mbs.identification.report import report

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
