"""Kinematic models: Jacobians, their inverses and singularities, motion of links and loops."""

from __future__ import annotations

from typing import Any

from mbs.assembly import System
from mbs.models._singularities import singularities
from mbs.models.catalogue.entry import (
    AXES,
    COORDINATES,
    MOVING_BASE,
    SELECTION,
    TARGET,
    Entry,
    choice,
)
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


def _factors(system: System, **options: Any) -> str:
    return f"det J = {singularities(system, **options)}"


KINEMATIC: tuple[Entry, ...] = (
    Entry(
        "jacobian",
        "Kinematic",
        "Jacobian matrix",
        "[V; w] = J(q) v",
        (TARGET, AXES, choice("form", "form", "full", "renaud"), COORDINATES),
        jacobian,
    ),
    Entry(
        "inverse-jacobian",
        "Kinematic",
        "Inverse Jacobian",
        "J^-1(q)",
        SELECTION,
        inverse_jacobian,
    ),
    Entry(
        "determinant",
        "Kinematic",
        "Determinant of the Jacobian and singular configurations",
        "det J(q)",
        SELECTION,
        jacobian_determinant,
        _factors,
    ),
    Entry(
        "ikm",
        "Kinematic",
        "Inverse kinematic model",
        "v = J^-1(q) [V; w]",
        SELECTION,
        inverse_differential_kinematics,
    ),
    Entry(
        "velocities",
        "Kinematic",
        "Velocity of links",
        "jVj, jwj",
        (COORDINATES, MOVING_BASE),
        link_velocities,
    ),
    Entry(
        "accelerations",
        "Kinematic",
        "Acceleration of links",
        "jVPj, jwPj",
        (COORDINATES, MOVING_BASE),
        link_accelerations,
    ),
    Entry(
        "jpqp",
        "Kinematic",
        "JPQP: derivative of the Jacobian times velocities",
        "(dJ/dt) v",
        (TARGET, AXES, COORDINATES, MOVING_BASE),
        jacobian_dot_velocity,
    ),
    Entry(
        "velocity-closure",
        "Kinematic",
        "Constraint kinematic equations of loops: velocities",
        "Wa v_a + Wp v_p = 0",
        function=velocity_closure,
        structures="closed",
    ),
    Entry(
        "acceleration-closure",
        "Kinematic",
        "Constraint kinematic equations of loops: accelerations",
        "Wa a_a + Wp a_p + Psi = 0",
        (COORDINATES,),
        acceleration_closure,
        structures="closed",
    ),
)
