"""Base inertial parameters and identification."""

from mbs.identification.columns import Column, columns_of, numbers_of, values_of
from mbs.identification.energy_regressor import energy_regressor, power_regressor
from mbs.identification.filtered_regressor import filtered_regressor
from mbs.identification.regressor import Regressor, known_efforts, regressor

__all__ = [
    "Column",
    "Regressor",
    "columns_of",
    "energy_regressor",
    "filtered_regressor",
    "known_efforts",
    "numbers_of",
    "power_regressor",
    "regressor",
    "values_of",
]
