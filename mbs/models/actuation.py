"""Motors of a closed system: what their efforts do, and how they share what a motion takes.

The efforts tau_m of the motors do the work of tau_a = B tau_m at the independent joints, where the
actuation matrix B has a column for each motor. Where there are more motors than independent joints,
B has a null space: efforts that only strain the mechanism.

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
    """``actuation(q) -> B``: efforts at the independent joints from those of the motors.

    The power of the motors, tau_m' v_m, is that of tau_a = B tau_m, which is tau_a' v_a. Efforts of
    `bias`, `gravity_effort` and `lagrange`, and the derivatives of the dynamic models, are tau_a.

    Source: Nakamura & Ghodoussi 1989.

    Args:
        system: open or closed; q must close the loops.

    Returns:
        Function of q (nq, 1); B (m, k) for k motors, `system.motors`, the identity where they are
        the independent joints.
    """

    def build() -> tuple[Named, Named]:
        s = symbols_of(system)
        return [("q", s.q)], [("B", SX(_velocities(system, s).T))]

    require_system(system)
    return model_function(system, ("actuation",), build, configuration_check(system, "independent"))


def actuation_null_space(system: System) -> Function:
    """``actuation_null_space(q) -> N``: efforts of motors that move nothing, B N = 0.

    Any tau_m + N z drives the same motion: z loads the mechanism against itself, to take up
    backlash or to keep efforts within limits. Column j is a unit effort of a motor beyond the
    mobility, and what it takes of m motors that are independent, the same at all configurations.

    Source: Nakamura & Ghodoussi 1989.

    Args:
        system: open or closed; q must close the loops.

    Returns:
        Function of q (nq, 1); N (k, k - m), without columns where motors are not more than the
        independent joints.
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
    """Whether efforts of motors are others than those at the velocities that a model takes."""
    return s.reduction is not None and system.motors != system.active


def effort_input(system: System, s: ModelSymbols) -> tuple[str, SX, SX]:
    """An input of efforts, and what it is at the velocities that a model takes.

    Returns:
        its name, tau, tau_a or tau_m; its symbol; the efforts (m, 1).
    """
    if not motors_apart(system, s):
        name, tau = s.input("tau")
        return name, tau, tau
    tau_m = SX.sym("tau_m", len(system.motors))
    return "tau_m", tau_m, casadi.mtimes(_velocities(system, s).T, tau_m)


def effort_output(system: System, s: ModelSymbols, tau: SX) -> tuple[str, SX]:
    """An output of efforts (m, 1) at the velocities that a model takes, shared by motors.

    Of all efforts of motors that do the same those of the least sum of squares:
    tau_m = B' (B B')^-1 tau_a.

    Returns:
        its name, tau, tau_a or tau_m, and its value.
    """
    if not motors_apart(system, s):
        return "tau" + s.suffix, tau
    moved = _velocities(system, s)
    shared = solve_square(casadi.mtimes(moved.T, moved), tau)
    return "tau_m", casadi.mtimes(moved, shared)


def shared_efforts(system: System, s: ModelSymbols, needed: SX) -> SX:
    """(nv, 1) efforts of the tree that motors give where it takes `needed` (nv, 1)."""
    tau = zeros(system.nv)
    tau[list(system.motors)] = effort_output(system, s, s.reduced_effort(needed))[1]
    return tau


def _velocities(system: System, s: ModelSymbols) -> SX:
    """(k, m) velocities of the motors from the independent ones, B'."""
    if s.reduction is None:
        return SX.eye(s.size)
    return s.reduction.G[list(system.motors), :]


def _independent_motors(system: System) -> list[int]:
    """Among the motors, by their place, as many as drive the mechanism; the active ones first."""
    if system.closure is None:
        return list(range(system.nv))
    J = np.array(constraint_jacobian(system)(system.configuration, closure_parameters(system)))
    free = null_space_of(J, system.closure.mobility)[list(system.motors)]
    first = tuple(k for k, motor in enumerate(system.motors) if motor in system.active)
    return independent_rows([free], system.closure.mobility, first)
