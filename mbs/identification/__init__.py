"""Base inertial parameters and identification."""

from mbs.identification.base_parameters import BaseParameters, base_parameters
from mbs.identification.columns import Column, columns_of, numbers_of, values_of
from mbs.identification.energy_regressor import energy_regressor, power_regressor
from mbs.identification.excitation import Series, excitation
from mbs.identification.excitation_limits import Plane
from mbs.identification.excitation_trajectory import Trajectory
from mbs.identification.filtered_regressor import filtered_regressor
from mbs.identification.identify import Identification, identify
from mbs.identification.record import Record, joint_side
from mbs.identification.regressor import Regressor, known_efforts, regressor

__all__ = [
    "BaseParameters",
    "Column",
    "Identification",
    "Plane",
    "Record",
    "Regressor",
    "Series",
    "Trajectory",
    "base_parameters",
    "columns_of",
    "energy_regressor",
    "excitation",
    "filtered_regressor",
    "identify",
    "joint_side",
    "known_efforts",
    "numbers_of",
    "power_regressor",
    "regressor",
    "values_of",
]
