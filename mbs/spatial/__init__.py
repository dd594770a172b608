"""Rigid-body algebra on 3-vectors and 3x3 matrices of CasADi scalars with exact constants.

Exact zeros and ones are folded by CasADi, which keeps the operation counts of models low.
"""

from mbs.deprecation import moved
from mbs.spatial.inertia import Body, Inertia, PseudoInertia
from mbs.spatial.khalil import Khalil, frames_to
from mbs.spatial.pose import (
    Displacement,
    FreeDisplacement,
    Pose,
    ScrewDisplacement,
    Transformable,
    Wrench,
    add_wrenches,
    origin,
    transform_inertia_along,
    transform_wrench,
    transform_wrench_along,
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

__getattr__ = moved(
    __name__,
    {
        "Movable": "mbs.spatial.Transformable",
        "body_through": "mbs.spatial.transform_inertia_along",
        "wrench_through": "mbs.spatial.transform_wrench_along",
    },
)

__all__ = [
    "AxisRotation",
    "Body",
    "Displacement",
    "FreeDisplacement",
    "Inertia",
    "Khalil",
    "MatrixRotation",
    "Pose",
    "PseudoInertia",
    "Rotation",
    "ScrewDisplacement",
    "Transformable",
    "Wrench",
    "add_wrenches",
    "align_z",
    "axis_rotation",
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
    "transform_inertia_along",
    "transform_wrench",
    "transform_wrench_along",
    "unit_vector",
    "vector",
    "zeros",
]
