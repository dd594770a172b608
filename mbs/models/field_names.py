"""Names of the models that other tools use, in addition to the names of Khalil."""

from __future__ import annotations

from typing import Any

from casadi import Function

from mbs.assembly import System
from mbs.errors import ModelError
from mbs.models._direct_dynamics import direct_dynamics, inertia_matrix
from mbs.models._inverse_dynamics import bias, gravity_effort, inverse_dynamics
from mbs.models.geometry import direct_geometry
from mbs.models.inverse_geometry import Solutions, solve
from mbs.models.kinematics import jacobian, jacobian_dot_velocity

forward_kinematics = direct_geometry
forward_dynamics = direct_dynamics
mass_matrix = inertia_matrix
crba = inertia_matrix
rnea = inverse_dynamics
nonlinear_effects = bias
generalised_gravity = gravity_effort
geometric_jacobian = jacobian
jacobian_drift = jacobian_dot_velocity


def aba(system: System, **options: Any) -> Function:
    """Return the forward dynamics by the articulated-body algorithm.

    Source: Featherstone 2008, section 7.3.

    Args:
        system: open mechanism.
        **options: further keyword arguments of `direct_dynamics`.

    Returns:
        Function ``ddm(q, v, tau) -> a``, as for `direct_dynamics`.
    """
    return direct_dynamics(system, method="articulated", **options)


_OLD = frozenset(("rows", "columns", "expressed_in", "coordinates"))
"""Arguments of `inverse_differential_kinematics`, which was `inverse_kinematics` up to version
0.2."""


def inverse_kinematics(system: System, T: Any = None, *args: Any, **options: Any) -> Solutions:
    """Return all configurations at which a frame has a given pose.

    Args:
        system: open or closed mechanism.
        T: (4, 4) pose of the frame relative to the base. It is required.
        *args: further arguments of `mbs.models.inverse_geometry.solve`.
        **options: keyword arguments of `mbs.models.inverse_geometry.solve`.

    Raises:
        ModelError: T is missing, or the arguments belong to `inverse_differential_kinematics`,
            which had this name up to version 0.2. Errors of `mbs.models.inverse_geometry.solve`
            are also possible.
    """
    if T is None or isinstance(T, int | str) or _OLD & set(options):
        raise ModelError(
            f"inverse_kinematics takes a pose (4, 4) now, not {T!r}; the model from a twist to"
            " joint velocities is mbs.models.inverse_differential_kinematics(system, frame, rows)"
        )
    return solve(system, T, *args, **options)
