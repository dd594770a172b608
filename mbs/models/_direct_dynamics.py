"""Forward dynamics (direct dynamic models) and the inertia matrix."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from casadi import SX, Function
from numpy.typing import NDArray

from mbs.arguments import names_given
from mbs.assembly import System
from mbs.assembly.model_function import Named, model_function, require_system
from mbs.assembly.tree import normalised
from mbs.errors import ModelError
from mbs.loops.analysis import rows_at
from mbs.loops.balance import obstacles, require_no_balance
from mbs.loops.velocity import closure_jacobian, constraint_jacobian, kept_rows
from mbs.models._inverse_dynamics import own_efforts, tree_efforts
from mbs.models.actuation import effort_input
from mbs.models.constrained_accelerations import constrained_accelerations
from mbs.models.symbols import (
    ExternalForces,
    ModelSymbols,
    check_coordinates,
    configuration_check,
    exerted,
    solution_order,
    surroundings,
    symbols_of,
)
from mbs.models.tree_table import TreeLoops
from mbs.operations.counts import cheapest
from mbs.recursions.articulated_body import articulated_accelerations, inertia_pivots
from mbs.recursions.composite_body import inertia_matrix as tree_inertia
from mbs.recursions.composite_body import solve_tree, velocity_antecedents
from mbs.recursions.link_motions import link_poses
from mbs.solvers.rank import dense, first_best, rank
from mbs.text import did_you_mean, quoted

_METHODS = ("auto", "articulated", "composite")
_ARTICULATED = 260  # upper bound of operations per velocity of the articulated-body algorithm
_SEED = 20260103
_VANISHING = 1e-12
"""Ratio of the inertia against a velocity with free descendants to its inertia with locked
descendants, below which it counts as zero: a sum over all links has a rounding error of 1e-15."""
_NO_INERTIA = 1e-30
"""Smallest denominator of this ratio [kg m^2 or kg]; it avoids 0/0, and no body has so little."""


def inertia_matrix(system: System, coordinates: str = "independent") -> Function:
    """Return the inertia matrix (mass matrix): ``inertia(q) -> A``.

    The kinetic energy is v' A v / 2.

    Source: Walker & Orin 1982; Khalil & Creusot 1997, eq. 27-38; for closed systems G' A G.

    Args:
        system: open or closed mechanism; q must close the loops.
        coordinates: coordinates of a closed system, "independent" or "tree".

    Returns:
        Function of q (nq, 1); A (m, m) symmetric, including rotors [kg m^2, kg m or kg].
    """

    def build() -> tuple[Named, Named]:
        s = symbols_of(system, coordinates)
        A = s.reduced_matrix(tree_inertia(system.tree, s.poses))
        return [("q", s.q)], [("A" + s.suffix, A)]

    check, loops = configuration_check(system, coordinates), TreeLoops(system, "inertia")
    return model_function(system, ("inertia", coordinates), build, check, loops)


def direct_dynamics(
    system: System,
    method: str = "auto",
    coordinates: str = "independent",
    *,
    f_ext: bool = False,
    moving_base: bool = False,
) -> Function:
    """Return the forward dynamics, accelerations due to joint efforts: ``ddm(q, v, tau) -> a``.

    For open chains: articulated bodies, linear in the number of links, or A a = tau - H with the
    composite-body inertia matrix A, factorised without fill-in between branches. For closed
    systems: A a = tau - H in the independent joints, ddm(q, v_a, tau_a) -> a_a. With
    `coordinates="tree"`: ddm(q, v, tau) -> a, lam, where lam are the efforts of the independent
    closure rows (A a + H = tau + J' lam). If the motors of a closed system are not exactly its
    independent joints: ddm(q, v_a, tau_m) -> a_a with the efforts of all `system.motors`.

    Source: Featherstone 1983; Featherstone 2008, section 6.5; Khalil & Creusot 1997, eq. 24 and
    section 5.4.

    Args:
        system: open or closed mechanism; q must close the loops.
        method: "articulated" (open chains only), "composite", or "auto" for fewer operations.
        coordinates: coordinates of a closed system, "independent" or "tree".
        f_ext: whether to add an input f_ext (6, bodies): for each row of `system.bodies` the wrench
            [force; moment] that the body exerts on its environment, in the body frame.
        moving_base: whether to add the inputs v_0 (6, 1), velocity [V; w] of the base, a_0 (6, 1),
            linear acceleration of its origin and angular acceleration [vd; wd], both in base axes,
            and R_0 (3, 3), orientation of the base in the frame that gravity is expressed in.

    Returns:
        Function of q (nq, 1), v and tau (m, 1), or tau_m (k, 1), f_ext, v_0, a_0, R_0; a (m, 1)
        [rad/s^2 or m/s^2].

    Raises:
        ModelError: a joint moves no inertia, so that its acceleration is undetermined; the method
            is unknown; or it is "articulated" and the system has loops.
    """
    require_system(system)
    check_coordinates(system, coordinates)
    _check_method(system, method)
    require_inertia(system)

    def model(method: str) -> Function:
        return _model(system, method, coordinates, f_ext, moving_base)

    if method != "auto":
        return model(method)
    key = ("cheapest ddm", coordinates, f_ext, moving_base)
    found: Function = system.cached(key, lambda: cheapest(*map(model, _candidates(system))))
    return found


def independent_dynamics(system: System) -> Function:
    """Return the forward dynamics for efforts of the independent joints of a system.

    It is ``ddm(q, v_a, tau_a) -> a_a``, equal to `direct_dynamics(system)` if the motors are on the
    independent joints.

    Args:
        system: open or closed mechanism.

    Raises:
        ModelError: a joint moves no inertia, so that its acceleration is undetermined.
    """
    if system.motors == system.independent:
        return direct_dynamics(system)
    require_inertia(system)

    def build() -> tuple[Named, Named]:
        s = symbols_of(system)
        name, tau = s.input("tau")
        a = _composite(system, s, tau, surroundings(system))
        return [("q", s.q), ("v" + s.suffix, s.v), (name, tau)], [("a" + s.suffix, a)]

    return model_function(
        system, ("ddm", "independent"), build, configuration_check(system, "independent")
    )


def _check_method(system: System, method: str) -> None:
    """Raise ModelError if a method is unknown, or "articulated" for a system with loops."""
    if method not in _METHODS:
        raise ModelError(
            f"{system.name}: method is {quoted(method)}; use one of {', '.join(_METHODS)}"
        )
    if method == "articulated" and system.is_closed:
        raise ModelError(
            f"{system.name}: method 'articulated' is for open chains and this system has loops;"
            " use 'composite' or 'auto'"
        )


def _candidates(system: System) -> tuple[str, ...]:
    """Return the methods among which "auto" selects the fewest operations."""
    if system.is_closed:
        return ("composite",)
    return ("composite", "articulated") if _composite_may_win(system) else ("articulated",)


def _composite_may_win(system: System) -> bool:
    """Return whether method "composite" may need fewer operations than articulated bodies.

    The operations to factorise and solve with A are compared to the bound `_ARTICULATED`.
    """
    depths: list[int] = []
    for before in velocity_antecedents(system.tree):
        depths.append(depths[before] + 1 if before >= 0 else 0)
    return sum(d * (d + 1) + 4 * d for d in depths) < _ARTICULATED * system.nv


def _model(
    system: System, method: str, coordinates: str, f_ext: bool, moving_base: bool
) -> Function:
    """Return the direct dynamic model by a method, "composite" or "articulated".

    `f_ext` and `moving_base` add inputs.
    """
    in_tree = coordinates == "tree" and system.is_closed

    def build() -> tuple[Named, Named]:
        s = symbols_of(system, coordinates)
        name, given, tau = effort_input(system, s)
        around = surroundings(system, f_ext, moving_base)
        inputs: Named = [("q", s.q), ("v" + s.suffix, s.v), (name, given), *around.inputs]
        if in_tree:
            a, lam, _ = constrained_accelerations(system, s, tau, around)
            return inputs, [("a", a), ("lam", lam)]
        accelerations = _articulated if method == "articulated" else _composite
        return inputs, [("a" + s.suffix, accelerations(system, s, tau, around))]

    return model_function(
        system,
        ("ddm", method, coordinates, f_ext, moving_base),
        build,
        configuration_check(system, coordinates),
        None if f_ext or moving_base else TreeLoops(system, "ddm"),
    )


def _articulated(system: System, s: ModelSymbols, tau: SX, around: ExternalForces) -> SX:
    """Return the accelerations (nv, 1) of an open chain for efforts tau, by articulated bodies.

    `around` has the base motion and external wrenches.
    """
    left = tau - own_efforts(system, s, SX.zeros(system.nv))
    external = exerted(system, around, s.poses, s.q, s.v)
    return articulated_accelerations(system.tree, s.poses, s.v, left, around.base, external)


def _composite(system: System, s: ModelSymbols, tau: SX, around: ExternalForces) -> SX:
    """Return the accelerations (m, 1) for efforts tau (m, 1) by solving A a = tau - H.

    They are in the coordinates of the symbols `s`. `around` has the base motion and external
    wrenches.
    """
    A = tree_inertia(system.tree, s.poses)
    H = s.reduced_effort(tree_efforts(system, s, s.tree_acceleration(SX.zeros(s.size)), around))
    return solve_tree(s.reduced_matrix(A), tau - H, solution_order(system, s))


def require_inertia(system: System) -> None:
    """Raise if an independent velocity moves no inertia, so that its acceleration is undetermined.

    Systems with a symbol without default are not checked.

    Args:
        system: open or closed mechanism.

    Raises:
        ModelError: the message names the velocity and the remedy.
    """

    def check() -> bool:
        if any(p.default is None for p in system.parameters):
            return True
        loose = (
            _without_inertia_in_loops(system)
            if system.is_closed
            else _without_inertia_in_tree(system)
        )
        if loose is not None:
            number = system.independent[loose]
            name = system.velocity_coordinates[number].name
            raise ModelError(
                f"{system.name}: {name} can move without moving any inertia, so its acceleration"
                " is not determined; give mass to what it carries, or a rotor inertia Ia; a mass of"
                f" zero needs springs or dampers, and no motor{obstacles(system, number)}"
            )
        return True

    system.cached("has inertia", check)


def _without_inertia_in_tree(system: System) -> int | None:
    """Return the index in v of a velocity that moves no inertia, or None.

    The joints of descendants are free to move.
    """
    q = SX.sym("q", system.nq)
    pivots = inertia_pivots(system.tree, link_poses(system.tree, normalised(system.tree, q)))
    return velocity_without_inertia(
        system, Function("pivots", [q, system.p], list(pivots), {"cse": True})
    )


def velocity_without_inertia(system: System, pivots: Function) -> int | None:
    """Return the largest index in v of a velocity of the tree that moves no inertia, or None.

    It is tested at a random configuration.

    Args:
        system: open or closed mechanism.
        pivots: Function of q, and of p if the system has parameters. It returns, by velocity, the
            inertia with free joints of descendants, and that with locked ones.
    """
    rng = np.random.default_rng(_SEED)
    q = np.array(system.configuration) + rng.uniform(-1.0, 1.0, system.nq)
    given = [q, system.p_default][: pivots.n_in()]
    free, locked = (np.array(x).ravel() for x in pivots(*given))
    # magnitude: inertia from files may be negative, but must not be zero
    moves = np.abs(free) > _VANISHING * np.maximum(np.abs(locked), _NO_INERTIA)
    return None if moves.all() else int(np.max(np.flatnonzero(~moves)))


def _without_inertia_in_loops(system: System) -> int | None:
    """Return the index in `system.independent` of a velocity that moves no inertia, or None."""
    closure, q = system.closure, list(system.configuration)
    assert closure is not None
    active, passive = list(closure.independent), list(closure.passive)
    # rows selected for a different configuration may be dependent here
    here = rows_at(system, np.array(q), np.array(system.p_default))
    J = dense(constraint_jacobian(here)(q, system.p_default))[kept_rows(here)]
    G = np.zeros((system.nv, len(active)))
    G[active], G[passive] = np.eye(len(active)), -np.linalg.solve(J[:, passive], J[:, active])
    A = G.T @ np.array(inertia_matrix(system, "tree")(q)) @ G
    size = 1 / np.sqrt(np.maximum(np.diag(A), _NO_INERTIA))
    A = A * np.outer(size, size)
    return None if rank(A) == len(A) else first_best(np.abs(np.linalg.svd(A)[2][-1]))


# Hybrid dynamics: prescribed accelerations at some velocities, given efforts at all velocities.


def hybrid_dynamics(system: System, prescribed: Sequence[str]) -> Function:
    """Return the dynamics with prescribed motion of some joints.

    It is ``hybrid(q, v, tau, a_p) -> a, tau_p``.

    tau_p is the effort that a drive must add to tau at each prescribed velocity. For a closed
    system q and v must close the loops, and a third output lam contains the efforts of the
    independent closure rows.

    Source: Featherstone 2008, section 9.2; loops as in `direct_dynamics`.

    Args:
        system: open or closed mechanism; all coordinates are tree coordinates.
        prescribed: names of velocities with prescribed acceleration.

    Returns:
        Function of q (nq, 1), v and tau (nv, 1), a_p (k, 1) in the order of the names; a (nv, 1)
        and tau_p (k, 1) [N m or N].

    Raises:
        ModelError: a name is unknown or repeated, or the loops do not let the named velocities move
            independently.
    """
    require_system(system)
    numbers = _prescribed_indices(system, prescribed)

    def build() -> tuple[Named, Named]:
        s = symbols_of(system, "tree")
        tau, a_p = SX.sym("tau", system.nv), SX.sym("a_p", len(numbers))
        a, lam, tau_p = constrained_accelerations(
            system, s, tau, surroundings(system), numbers, a_p
        )
        outputs = [("a", a), ("tau_p", tau_p), *([("lam", lam)] if system.is_closed else [])]
        return [("q", s.q), ("v", s.v), ("tau", tau), ("a_p", a_p)], outputs

    return model_function(system, ("hybrid", numbers), build)


def _prescribed_indices(system: System, prescribed: Sequence[str]) -> tuple[int, ...]:
    """Return the indices in v of the prescribed velocities.

    Raise ModelError if a name is unknown or repeated, or the loops tie the velocities.
    """
    names = [speed.name for speed in system.velocity_coordinates]
    prescribed = names_given(f"{system.name}: prescribed", prescribed, names[0])
    if not prescribed:
        raise ModelError(f"{system.name}: prescribed is empty; give names of velocities")
    for name in prescribed:
        if name not in names:
            raise ModelError(
                f"{system.name}: there is no velocity {quoted(name)} to prescribe;"
                f" {did_you_mean(str(name), names)}"
            )
    numbers = tuple(names.index(name) for name in prescribed)
    require_no_balance(system, "the motion", velocities=numbers)
    if len(set(numbers)) < len(numbers):
        raise ModelError(f"{system.name}: a velocity is prescribed twice; name each once")
    if not are_independent(system, numbers):
        told = ", ".join(system.velocity_coordinates[k].name for k in numbers)
        raise ModelError(
            f"{system.name}: {told} cannot all be prescribed, since the loops tie them (mobility"
            f" {len(system.independent)}); prescribe joints that can move independently"
        )
    return numbers


def are_independent(system: System, numbers: tuple[int, ...], *rows: NDArray[np.float64]) -> bool:
    """Return whether some velocities and rows are independent of each other and of the loops.

    The rank is tested at the assembled configuration.

    Args:
        system: open or closed mechanism.
        numbers: indices in v of the velocities.
        rows: (1, nv) coefficients of further velocities.
    """
    if not system.is_closed and not rows:
        return True
    J = np.empty((0, system.nv))
    if system.is_closed:
        p = [system.p_default] if system.parameters else []
        J = np.array(closure_jacobian(system)(list(system.configuration), *p))
    E = np.vstack([np.eye(system.nv)[list(numbers)], *rows])
    return rank(np.vstack([J, E])) == rank(J) + len(E)
