"""The models of identification as menus show them."""

from __future__ import annotations

from mbs.assembly import System
from mbs.identification.base.base_parameters import base_parameters
from mbs.identification.regressors.dynamic import regressor
from mbs.identification.regressors.energy import energy_regressor
from mbs.identification.regressors.filtered import filtered_regressor
from mbs.models.catalogue import Entry


def entries() -> tuple[Entry, ...]:
    """The models in the order of the menu."""
    return _ENTRIES


def _base(system: System) -> str:
    return base_parameters(system).text()


_ENTRIES = (
    Entry(
        "base-parameters",
        "Identification",
        "Base inertial parameters",
        "K_b = beta(K)",
        text=_base,
    ),
    Entry(
        "dynamic-identification",
        "Identification",
        "Dynamic identification model",
        "tau = D(q, v, a) K",
        function=regressor,
    ),
    Entry(
        "energy-identification",
        "Identification",
        "Energy identification model",
        "H = h(q, v) K",
        function=energy_regressor,
    ),
    Entry(
        "filtered-identification",
        "Identification",
        "Filtered dynamic identification model",
        "tau = d/dt D1(q, v) K + D2(q, v) K",
        function=filtered_regressor,
    ),
)
