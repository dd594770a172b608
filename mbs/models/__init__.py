"""Model builders: functions of a System that return a casadi.Function with named arguments."""

from typing import NoReturn

from mbs.models import catalogue, inverse_geometry
from mbs.models._contact_phases import ContactPhases, contact_phases
from mbs.models._dae import Dae, dae
from mbs.models._direct_dynamics import direct_dynamics, hybrid_dynamics, inertia_matrix
from mbs.models._energy import energy
from mbs.models._inverse_dynamics import bias, gravity_effort, inverse_dynamics
from mbs.models._joint_wrenches import joint_wrenches
from mbs.models._lagrange import lagrange
from mbs.models._limits import Limits, limits
from mbs.models._linearise import Linearisation, LinearModel, linearise
from mbs.models._measurements import measurements
from mbs.models._singularities import singularities
from mbs.models._tree_core import TreeCore, tree_core
from mbs.models._validity import validity, validity_rows
from mbs.models.actuation import actuation_matrix, actuation_null_space
from mbs.models.dae_phases import ContactPoint
from mbs.models.derivatives import (
    direct_dynamics_derivatives,
    inverse_dynamics_derivatives,
    with_implicit_jacobian,
)
from mbs.models.field_names import (
    aba,
    crba,
    forward_dynamics,
    forward_kinematics,
    generalised_gravity,
    geometric_jacobian,
    inverse_kinematics,
    jacobian_drift,
    mass_matrix,
    nonlinear_effects,
    rnea,
)
from mbs.models.geometry import direct_geometry, transform
from mbs.models.jacobian_inverse import (
    inverse_differential_kinematics,
    inverse_jacobian,
    jacobian_determinant,
)
from mbs.models.kinematics import (
    jacobian,
    jacobian_dot_velocity,
    link_accelerations,
    link_velocities,
)
from mbs.models.loop_kinematics import acceleration_closure, velocity_closure
from mbs.models.symbols import devices
from mbs.text import did_you_mean

__all__ = [
    "ContactPhases",
    "ContactPoint",
    "Dae",
    "Limits",
    "LinearModel",
    "Linearisation",
    "TreeCore",
    "aba",
    "acceleration_closure",
    "actuation_matrix",
    "actuation_null_space",
    "bias",
    "catalogue",
    "contact_phases",
    "crba",
    "dae",
    "devices",
    "direct_dynamics",
    "direct_dynamics_derivatives",
    "direct_geometry",
    "energy",
    "forward_dynamics",
    "forward_kinematics",
    "generalised_gravity",
    "geometric_jacobian",
    "gravity_effort",
    "hybrid_dynamics",
    "inertia_matrix",
    "inverse_differential_kinematics",
    "inverse_dynamics",
    "inverse_dynamics_derivatives",
    "inverse_geometry",
    "inverse_jacobian",
    "inverse_kinematics",
    "jacobian",
    "jacobian_determinant",
    "jacobian_dot_velocity",
    "jacobian_drift",
    "joint_wrenches",
    "lagrange",
    "limits",
    "linearise",
    "link_accelerations",
    "link_velocities",
    "mass_matrix",
    "measurements",
    "nonlinear_effects",
    "rnea",
    "singularities",
    "transform",
    "tree_core",
    "validity",
    "validity_rows",
    "velocity_closure",
    "with_implicit_jacobian",
]


def __getattr__(name: str) -> NoReturn:
    """Raise AttributeError; the message suggests similar names."""
    raise AttributeError(f"mbs.models has no {name!r}; {did_you_mean(name, __all__)}")
