"""Inverse geometric models: configurations of a robot for given poses of a frame."""

from mbs.closed_forms.arm_search import Nearest
from mbs.models.inverse_geometry.follow import Followed, follow
from mbs.models.inverse_geometry.free_orientation import FreeOrientation, free_orientation
from mbs.models.inverse_geometry.functions import InverseGeometry, function
from mbs.models.inverse_geometry.self_motions import Family
from mbs.models.inverse_geometry.sheet import text
from mbs.models.inverse_geometry.solutions import Solution, Solutions
from mbs.models.inverse_geometry.solve import solve
from mbs.models.inverse_geometry.solve_many import ManySolutions, solve_many
from mbs.models.inverse_geometry.solver import PoseAnswer, PoseSolver, solver

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
