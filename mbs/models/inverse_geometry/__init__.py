"""Inverse geometric models: the postures that take a frame of a robot to a pose."""

from mbs.models.inverse_geometry.answers.families import Family
from mbs.models.inverse_geometry.answers.solutions import Solution, Solutions
from mbs.models.inverse_geometry.batches.many import ManySolutions, solve_many
from mbs.models.inverse_geometry.equations.function import InverseGeometry, function
from mbs.models.inverse_geometry.equations.text import text
from mbs.models.inverse_geometry.numeric.nearest import Nearest
from mbs.models.inverse_geometry.paths.follow import Followed, follow
from mbs.models.inverse_geometry.solve import solve

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
