"""Rigid-body algebra on 3-vectors of CasADi scalars whose constants are exact.

Nothing here is larger than 3x3: zeros and ones fold into the graph, which is what keeps the
operation counts of the models low.
"""

from mbs.spatial.angles import sin_cos
from mbs.spatial.inertia import Inertia
from mbs.spatial.khalil import Khalil
from mbs.spatial.pose import Pose
from mbs.spatial.pseudo_inertia import PseudoInertia
from mbs.spatial.quaternion import quaternion_rate, quaternion_rotation
from mbs.spatial.rotation import MatrixTurn, Rotation, Turn, align_z, axis_turn
from mbs.spatial.screw import Body, Displacement, FreeDisplacement, Screw
from mbs.spatial.vectors import cross, elements, exact_sum, is_zero, skew, snapped, vector, zeros

__all__ = [
    "Body",
    "Displacement",
    "FreeDisplacement",
    "Inertia",
    "Khalil",
    "MatrixTurn",
    "Pose",
    "PseudoInertia",
    "Rotation",
    "Screw",
    "Turn",
    "align_z",
    "axis_turn",
    "cross",
    "elements",
    "exact_sum",
    "is_zero",
    "quaternion_rate",
    "quaternion_rotation",
    "sin_cos",
    "skew",
    "snapped",
    "vector",
    "zeros",
]
