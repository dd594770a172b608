"""Inverse geometric models: configurations of a robot for given poses of a frame."""

from mbs.closed_forms.arm_search import Nearest
from mbs.models.inverse_geometry._follow import Followed, follow
from mbs.models.inverse_geometry._free_orientation import FreeOrientation, free_orientation
from mbs.models.inverse_geometry._solve import solve
from mbs.models.inverse_geometry._solve_many import ManySolutions, solve_many
from mbs.models.inverse_geometry._solver import PoseAnswer, PoseSolver, solver
from mbs.models.inverse_geometry.functions import InverseGeometry, function
from mbs.models.inverse_geometry.listing import text
from mbs.models.inverse_geometry.self_motions import Family
from mbs.models.inverse_geometry.solutions import Solution, Solutions

__all__ = [
    "Family",
    "Followed",
    "FreeOrientation",
    "InverseGeometry",
    "ManySolutions",
    "Nearest",
    "PoseAnswer",
    "PoseSolver",
    "Solution",
    "Solutions",
    "follow",
    "free_orientation",
    "function",
    "solve",
    "solve_many",
    "solver",
    "text",
]
