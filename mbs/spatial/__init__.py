"""Rigid-body algebra on 3-vectors of CasADi scalars whose constants are exact.

Nothing here is larger than 3x3: zeros and ones fold into the graph, which is what keeps the
operation counts of the models low.
"""

from mbs.spatial.inertia import Body, Inertia, PseudoInertia
from mbs.spatial.khalil import Khalil, placed
from mbs.spatial.pose import (
    Displacement,
    FreeDisplacement,
    Movable,
    Pose,
    Screw,
    Wrench,
    add_wrenches,
    body_through,
    carried,
    origin,
    wrench_through,
)
from mbs.spatial.rotation import (
    MatrixTurn,
    Rotation,
    Turn,
    align_z,
    axis_turn,
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
    "Body",
    "Displacement",
    "FreeDisplacement",
    "Inertia",
    "Khalil",
    "MatrixTurn",
    "Movable",
    "Pose",
    "PseudoInertia",
    "Rotation",
    "Screw",
    "Turn",
    "Wrench",
    "add_wrenches",
    "align_z",
    "axis_turn",
    "body_through",
    "carried",
    "cross",
    "elements",
    "exact_product",
    "exact_sum",
    "formula",
    "is_zero",
    "nearest_rotation",
    "origin",
    "placed",
    "quaternion_rate",
    "quaternion_rotation",
    "sin_cos",
    "skew",
    "unit_vector",
    "vector",
    "wrench_through",
    "zeros",
]
