"""Model builders: a System in, a casadi.Function with named inputs and outputs out."""

from mbs.models.direct_dynamics import direct_dynamics, inertia_matrix
from mbs.models.energy import energy
from mbs.models.geometry import direct_geometry, transform
from mbs.models.inverse_dynamics import bias, gravity_effort, inverse_dynamics
from mbs.models.kinematics import jacobian
from mbs.models.lagrange import lagrange

__all__ = [
    "bias",
    "direct_dynamics",
    "direct_geometry",
    "energy",
    "gravity_effort",
    "inertia_matrix",
    "inverse_dynamics",
    "jacobian",
    "lagrange",
    "transform",
]
