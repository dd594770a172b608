"""Rigid-body algebra on 3-vectors and 3x3 matrices of CasADi scalars with exact constants.

Exact zeros and ones are folded by CasADi, which keeps the operation counts of models low.
"""

from mbs.spatial.inertia import Body, Inertia, PseudoInertia
from mbs.spatial.khalil import Khalil, frames_to
from mbs.spatial.pose import (
    Displacement,
    FreeDisplacement,
    Movable,
    Pose,
    ScrewDisplacement,
    Wrench,
    add_wrenches,
    body_through,
    origin,
    transform_wrench,
    wrench_through,
)
from mbs.spatial.rotation import (
    AxisRotation,
    MatrixRotation,
    Rotation,
    align_z,
    axis_rotation,
    nearest_rotation,
    quaternion_rate,
    quaternion_rotation,
    unit_vector,
)
from mbs.spatial.vectors import (
    cross,
    elements,
    exact_product,
    exact_sum,
    formula,
    is_zero,
    sin_cos,
    skew,
    vector,
    zeros,
)

__all__ = [
    "AxisRotation",
    "Body",
    "Displacement",
    "FreeDisplacement",
    "Inertia",
    "Khalil",
    "MatrixRotation",
    "Movable",
    "Pose",
    "PseudoInertia",
    "Rotation",
    "ScrewDisplacement",
    "Wrench",
    "add_wrenches",
    "align_z",
    "axis_rotation",
    "body_through",
    "cross",
    "elements",
    "exact_product",
    "exact_sum",
    "formula",
    "frames_to",
    "is_zero",
    "nearest_rotation",
    "origin",
    "quaternion_rate",
    "quaternion_rotation",
    "sin_cos",
    "skew",
    "transform_wrench",
    "unit_vector",
    "vector",
    "wrench_through",
    "zeros",
]
