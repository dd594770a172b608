"""Direct dynamic models: the inertia matrix and the accelerations that efforts produce."""

from __future__ import annotations

import casadi
import numpy as np
from casadi import SX, Function

from mbs.assembly import System
from mbs.assembly.model_function import Named, model_function, require_system
from mbs.errors import ModelError
from mbs.loops.reduction import independent_closure
from mbs.loops.velocity import acceleration_bias, velocity_rows
from mbs.models.inverse_dynamics import tree_efforts
from mbs.models.symbols import ModelSymbols, symbols_of
from mbs.recursions.composite_body import inertia_matrix as tree_inertia
from mbs.recursions.tree_factorization import solve_tree, velocity_antecedents
from mbs.solvers.rank import rank
from mbs.solvers.small_linear import solve_symmetric

_METHODS = ("auto", "composite")
_SEED = 20260103
_SINGULAR = 1e-12


def inertia_matrix(system: System, coordinates: str = "independent") -> Function:
    """``inertia(q) -> A``: kinetic energy is v' A v / 2.

    Source: Walker & Orin 1982; Khalil & Creusot 1997, eq. 27-38; for closed systems G' A G.

    Args:
        system: open or closed; q must close the loops.
        coordinates: of a closed system, "independent" or "tree".

    Returns:
        Function of q (nq, 1); A (m, m) symmetric, rotors included [kg m^2, kg m or kg].
    """

    def build() -> tuple[Named, Named]:
        s = symbols_of(system, coordinates)
        A = s.reduced_matrix(tree_inertia(system.tree, s.poses))
        return [("q", s.q)], [("A" + s.suffix, A)]

    return model_function(system, ("inertia", coordinates), build)


def direct_dynamics(
    system: System, method: str = "auto", coordinates: str = "independent"
) -> Function:
    """``ddm(q, v, tau) -> a``: the accelerations that the joint efforts produce.

    Open chains: A a = tau - H with the composite-body inertia matrix, factorised without filling
    the zeros that branches leave. Closed systems: the same in the independent joints,
    ddm(q, v_a, tau_a) -> a_a, or with `coordinates="tree"` ddm(q, v, tau) -> a, lam, where lam
    are the efforts of the independent closure rows (A a + H = tau + J' lam).

    Source: Khalil & Creusot 1997, eq. 24; Featherstone 2008, section 6.5.

    Args:
        system: open or closed; q must close the loops.
        method: "composite", or "auto" for the cheapest there is.
        coordinates: of a closed system, "independent" or "tree".

    Returns:
        Function of q (nq, 1), v and tau (m, 1); a (m, 1) [rad/s^2 or m/s^2].

    Raises:
        ModelError: some joint moves no inertia, so that its acceleration is not determined.
    """
    require_system(system)
    if method not in _METHODS:
        raise ModelError(f"{system.name}: method is {method!r}; use one of {', '.join(_METHODS)}")
    in_tree = coordinates == "tree" and system.is_closed

    def build() -> tuple[Named, Named]:
        s = symbols_of(system, coordinates)
        name, tau = s.input("tau")
        inputs: Named = [("q", s.q), ("v" + s.suffix, s.v), (name, tau)]
        if in_tree:
            a, lam = _tree_accelerations(system, s, tau)
            return inputs, [("a", a), ("lam", lam)]
        return inputs, [("a" + s.suffix, _accelerations(system, s, tau))]

    _require_inertia(system)
    return model_function(system, ("ddm", coordinates), build)


def _accelerations(system: System, s: ModelSymbols, tau: SX) -> SX:
    A = tree_inertia(system.tree, s.poses)
    H = s.reduced_effort(tree_efforts(system, s, s.tree_acceleration(SX.zeros(s.size))))
    if s.reduction is None:
        return solve_tree(A, tau - H, velocity_antecedents(system.tree))
    return solve_tree(s.reduced_matrix(A), tau - H, list(range(-1, s.size - 1)))


def _tree_accelerations(system: System, s: ModelSymbols, tau: SX) -> tuple[SX, SX]:
    """Accelerations of the tree and efforts of the closure, massless links included.

    K = A + c J'J is regular where A alone is not; then a Schur complement gives the efforts, kept
    finite where rows become dependent, and one refinement restores the digits that this costs.
    """
    A = tree_inertia(system.tree, s.poses)
    H = tree_efforts(system, s, SX.zeros(system.nv))
    J = velocity_rows(system, s.q, independent_closure(system, s.q))
    psi = acceleration_bias(system, s.q, s.v, J)
    c = _penalty(system)
    K = A + c * casadi.mtimes(J.T, J)
    free = solve_symmetric(K, casadi.horzcat(tau - H - c * casadi.mtimes(J.T, psi), J.T))
    a, Y = free[:, 0], free[:, 1:]
    S = casadi.mtimes(J, Y) + _SINGULAR / c * SX.eye(J.shape[0])
    lam = solve_symmetric(S, -psi - casadi.mtimes(J, a))
    a = a + casadi.mtimes(Y, lam)
    correction = solve_symmetric(S, -psi - casadi.mtimes(J, a))
    return a + casadi.mtimes(Y, correction), lam + correction


def _penalty(system: System) -> float:
    """A constant that makes c J'J as large as A at the assembled posture."""
    if any(p.default is None for p in system.parameters):
        return 1.0
    A = np.array(inertia_matrix(system, "tree")(list(system.posture)))
    return float(max(np.trace(A), 1e-6)) / system.nv


def _require_inertia(system: System) -> None:
    """Refuse a chain in which some velocity moves no inertia."""

    def check() -> bool:
        if any(p.default is None for p in system.parameters):
            return True
        rng = np.random.default_rng(_SEED)
        inertia = inertia_matrix(system)
        posture = np.array(system.posture)
        if not system.is_closed:
            posture = posture + rng.uniform(-1.0, 1.0, posture.shape)
        A = np.array(inertia(posture))
        size = 1 / np.sqrt(np.maximum(np.diag(A), 1e-30))
        A = A * np.outer(size, size)
        if rank(A) < len(A):
            k = int(np.argmax(np.abs(np.linalg.svd(A)[2][-1])))
            name = system.speeds[system.active[k]].name
            raise ModelError(
                f"{system.name}: {name} can move without moving any inertia, so its acceleration"
                " is not determined; give mass to what it carries, or a rotor inertia Ia"
            )
        return True

    system.cached("has inertia", check)
