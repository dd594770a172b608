"""Menu entries of the identification models."""

from __future__ import annotations

from casadi import Function

from mbs.assembly import System
from mbs.identification._base_parameters import METHODS, base_parameters
from mbs.identification.regressors import energy_regressor, filtered_regressor, regressor
from mbs.models.catalogue import Entry
from mbs.models.catalogue.entry import MOVING_BASE, choice


def entries() -> tuple[Entry, ...]:
    """Return the menu entries of the identification models, in menu order."""
    return _ENTRIES


def _base_function(system: System, method: str, moving_base: bool) -> Function:
    """Return the Function ``base_parameters(K) -> K_base``; see `base_parameters`.

    The arguments are those of `base_parameters`.
    """
    return base_parameters(system, method, moving_base=moving_base).function


def _base_text(system: System, method: str, moving_base: bool) -> str:
    """Return the base parameters as text for the menu entry; see `base_parameters`.

    The arguments are those of `base_parameters`.
    """
    return base_parameters(system, method, moving_base=moving_base).text() + "\n"


_ENTRIES = (
    Entry(
        "base-parameters",
        "Identification",
        "Base inertial parameters",
        "K_b = beta(K)",
        (choice("method", "method", *METHODS), MOVING_BASE),
        _base_function,
        _base_text,
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
