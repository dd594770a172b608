"""Systems of the catalogue, assembled once for all tests that do not ask how."""

from functools import cache

from mbs.assembly import System
from mbs.robots import catalogue

CLOSED = (
    "akr3000",
    "andrews_squeezer",
    "bricard",
    "delta",
    "differential_wrist",
    "five_bar",
    "four_bar",
    "modelica_four_bar",
    "modelica_rod_four_bar",
    "n_four_bar",
    "single_cylinder_engine",
    "slider_crank",
    "sr400",
    "stewart_platform",
    "whipple_bicycle",
)
"""The mechanisms of the catalogue with loops."""


@cache
def catalogue_system(name: str) -> System:
    """What `mbs.load(name).assemble()` gives: frozen, with the models that were built of it."""
    return catalogue()[name]().assemble()
