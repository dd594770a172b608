"""Inverse geometric models: the postures that take a frame of a robot to a pose."""

from mbs.models.inverse_geometry.families import Family
from mbs.models.inverse_geometry.follow import Followed, follow
from mbs.models.inverse_geometry.function import InverseGeometry, function
from mbs.models.inverse_geometry.many import ManySolutions, solve_many
from mbs.models.inverse_geometry.nearest import Nearest
from mbs.models.inverse_geometry.solutions import Solution, Solutions
from mbs.models.inverse_geometry.solve import solve
from mbs.models.inverse_geometry.text import text

__all__ = [
    "Family",
    "Followed",
    "InverseGeometry",
    "ManySolutions",
    "Nearest",
    "Solution",
    "Solutions",
    "follow",
    "function",
    "solve",
    "solve_many",
    "text",
]
