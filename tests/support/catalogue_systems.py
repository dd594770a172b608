"""Systems of the catalogue, assembled once for all tests that do not ask how."""

from functools import cache

from mbs.assembly import System
from mbs.robots import catalogue


@cache
def catalogue_system(name: str) -> System:
    """What `mbs.load(name).assemble()` gives: frozen, with the models that were built of it."""
    return catalogue()[name]().assemble()
