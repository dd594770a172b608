"""Dynamic models: efforts, accelerations, matrices, energy, wrenches and derivatives."""

from __future__ import annotations

from mbs.models._direct_dynamics import direct_dynamics, inertia_matrix
from mbs.models._energy import energy
from mbs.models._inverse_dynamics import bias, gravity_effort, inverse_dynamics
from mbs.models._joint_wrenches import joint_wrenches
from mbs.models._lagrange import lagrange
from mbs.models.actuation import actuation_matrix, actuation_null_space
from mbs.models.catalogue.entry import COORDINATES, F_EXT, METHODS, MOVING_BASE, Entry, choice
from mbs.models.derivatives import direct_dynamics_derivatives, inverse_dynamics_derivatives

DYNAMIC: tuple[Entry, ...] = (
    Entry(
        "idm",
        "Dynamic",
        "Inverse dynamic model, Newton and Euler",
        "tau(q, v, a)",
        (COORDINATES, F_EXT, MOVING_BASE),
        inverse_dynamics,
    ),
    Entry(
        "lagrange",
        "Dynamic",
        "Inverse dynamic model, Lagrange",
        "A(q) a + B(q, v) v + Q(q)",
        (choice("method", "method", "auto", "renaud", "christoffel"), COORDINATES),
        lagrange,
    ),
    Entry("inertia", "Dynamic", "Inertia matrix", "A(q)", (COORDINATES,), inertia_matrix),
    Entry(
        "bias",
        "Dynamic",
        "Centrifugal, Coriolis and gravity efforts",
        "H(q, v)",
        (COORDINATES, MOVING_BASE),
        bias,
    ),
    Entry(
        "gravity",
        "Dynamic",
        "Gravity efforts",
        "Q(q)",
        (COORDINATES, MOVING_BASE),
        gravity_effort,
    ),
    Entry(
        "ddm",
        "Dynamic",
        "Direct dynamic model",
        "a(q, v, tau)",
        (METHODS, COORDINATES, F_EXT, MOVING_BASE),
        direct_dynamics,
    ),
    Entry(
        "wrenches",
        "Dynamic",
        "Wrenches in the joints",
        "jfj, jmj",
        (COORDINATES, F_EXT, MOVING_BASE),
        joint_wrenches,
    ),
    Entry(
        "actuation",
        "Dynamic",
        "Actuation matrix",
        "tau_a = B(q) tau_m",
        (),
        actuation_matrix,
    ),
    Entry(
        "actuation_null_space",
        "Dynamic",
        "Efforts of motors that move nothing",
        "B N(q) = 0",
        (),
        actuation_null_space,
    ),
    Entry("energy", "Dynamic", "Energy", "E(q, v), U(q)", (COORDINATES,), energy),
    Entry(
        "didm",
        "Dynamic",
        "Derivatives of the inverse dynamic model",
        "d tau / d (q, v, a)",
        (COORDINATES,),
        inverse_dynamics_derivatives,
    ),
    Entry(
        "dddm",
        "Dynamic",
        "Derivatives of the direct dynamic model",
        "d a / d (q, v, tau)",
        (COORDINATES,),
        direct_dynamics_derivatives,
    ),
)
