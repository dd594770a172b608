"""Motors of closed systems: actuation matrix, its null space, and distribution of motor efforts.

Motor efforts tau_m are equivalent to efforts tau_a = B tau_m of the independent joints; the
actuation matrix B has one column per motor. With more motors than independent joints, B has a null
space: efforts that only preload the mechanism.

Source: Nakamura & Ghodoussi 1989.
"""

from __future__ import annotations

import casadi
import numpy as np
from casadi import SX, Function

from mbs.assembly import System
from mbs.assembly.model_function import Named, model_function, require_system
from mbs.loops.closing import closure_parameters
from mbs.loops.velocity import constraint_jacobian
from mbs.models.symbols import ModelSymbols, configuration_check, symbols_of
from mbs.solvers.linear import solve_square
from mbs.solvers.rank import independent_rows, null_space_of
from mbs.spatial import zeros


def actuation_matrix(system: System) -> Function:
    """Return the actuation matrix of a system: ``actuation(q) -> B`` with tau_a = B tau_m.

    B maps efforts tau_m of the motors to efforts tau_a of the independent joints with equal power:
    tau_m' v_m = tau_a' v_a. `bias`, `gravity_effort`, `lagrange` and the derivatives of the dynamic
    models use tau_a.

    Source: Nakamura & Ghodoussi 1989.

    Args:
        system: open or closed mechanism; q must close the loops.

    Returns:
        Function of q (nq, 1); B (m, k) for the k motors of `system.motors`. B is the identity if
        the motors are on the independent joints.
    """

    def build() -> tuple[Named, Named]:
        s = symbols_of(system)
        return [("q", s.q)], [("B", SX(_velocities(system, s).T))]

    require_system(system)
    return model_function(system, ("actuation",), build, configuration_check(system, "independent"))


def actuation_null_space(system: System) -> Function:
    """Return the null space of the actuation matrix: ``actuation_null_space(q) -> N``, B N = 0.

    All motor efforts tau_m + N z produce the same motion. z is an internal load that may remove
    backlash or keep efforts within limits. Column j is a unit effort of one redundant motor and the
    balancing efforts of m independent motors. The choice of motors is the same at all q.

    Source: Nakamura & Ghodoussi 1989.

    Args:
        system: open or closed mechanism; q must close the loops.

    Returns:
        Function of q (nq, 1); N (k, k - m) for k motors and m independent joints; no columns if k =
        m.
    """

    def build() -> tuple[Named, Named]:
        s = symbols_of(system)
        moved, first = _velocities(system, s), _independent_motors(system)
        surplus = [row for row in range(len(system.motors)) if row not in first]
        N = zeros(len(system.motors), len(surplus))
        if surplus:
            N[first, :] = -solve_square(moved[first, :].T, moved[surplus, :].T)
            N[surplus, :] = SX.eye(len(surplus))
        return [("q", s.q)], [("N", N)]

    require_system(system)
    return model_function(
        system, ("actuation_null_space",), build, configuration_check(system, "independent")
    )


def motors_apart(system: System, s: ModelSymbols) -> bool:
    """Return whether the motor efforts of a model differ from efforts at its input velocities.

    Args:
        system: open or closed mechanism.
        s: symbols of the model.
    """
    return s.reduction is not None and system.motors != system.independent


def effort_input(system: System, s: ModelSymbols) -> tuple[str, SX, SX]:
    """Return the effort input of a model, and the efforts at its input velocities.

    Args:
        system: open or closed mechanism.
        s: symbols of the model.

    Returns:
        name of the input ("tau", "tau_a" or "tau_m"), its symbol, and the equivalent efforts (m, 1)
        at the input velocities.
    """
    if not motors_apart(system, s):
        name, tau = s.input("tau")
        return name, tau, tau
    tau_m = SX.sym("tau_m", len(system.motors))
    return "tau_m", tau_m, casadi.mtimes(_velocities(system, s).T, tau_m)


def effort_output(system: System, s: ModelSymbols, tau: SX) -> tuple[str, SX]:
    """Return the effort output of a model, distributed over the motors.

    Redundant motors get the efforts of smallest norm: tau_m = B' (B B')^-1 tau_a.

    Args:
        system: open or closed mechanism.
        s: symbols of the model.
        tau: (m, 1) efforts at the input velocities of the model.

    Returns:
        name of the output ("tau", "tau_a" or "tau_m") and its value.
    """
    if not motors_apart(system, s):
        return "tau" + s.suffix, tau
    moved = _velocities(system, s)
    shared = solve_square(casadi.mtimes(moved.T, moved), tau)
    return "tau_m", casadi.mtimes(moved, shared)


def shared_efforts(system: System, s: ModelSymbols, needed: SX) -> SX:
    """Return the joint efforts (nv, 1) of the motors that produce a motion.

    Args:
        system: open or closed mechanism.
        s: symbols of the model.
        needed: (nv, 1) joint efforts of the tree that the motion requires.
    """
    tau = zeros(system.nv)
    tau[list(system.motors)] = effort_output(system, s, s.reduced_effort(needed))[1]
    return tau


def _velocities(system: System, s: ModelSymbols) -> SX:
    """Return the matrix B' (k, m) that maps independent velocities to the k motor velocities."""
    if s.reduction is None:
        return SX.eye(s.size)
    return s.reduction.G[list(system.motors), :]


def _independent_motors(system: System) -> list[int]:
    """Return m indices into `system.motors` of motors with independent velocities.

    Motors on independent joints come first.
    """
    if system.closure is None:
        return list(range(system.nv))
    J = np.array(constraint_jacobian(system)(system.configuration, closure_parameters(system)))
    free = null_space_of(J, system.closure.mobility)[list(system.motors)]
    first = tuple(k for k, motor in enumerate(system.motors) if motor in system.independent)
    return independent_rows([free], system.closure.mobility, first)
