"""Direct dynamic models: the inertia matrix and the accelerations that efforts produce."""

from __future__ import annotations

from collections.abc import Sequence

import casadi
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
from mbs.models.actuation import effort_input
from mbs.models.constrained_accelerations import constrained_accelerations
from mbs.models.inverse_dynamics import own_efforts, tree_efforts
from mbs.models.symbols import (
    ModelSymbols,
    Surroundings,
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
from mbs.recursions.poses import link_poses
from mbs.solvers.rank import dense, first_best, rank
from mbs.text import did_you_mean, quoted

_METHODS = ("auto", "articulated", "composite")
_ARTICULATED = 260  # operations that articulated bodies take at most for one more velocity
_SEED = 20260103
_VANISHING = 1e-12
"""Inertia left, in parts of what it is with the links behind locked, that counts as none: rounding
of as many terms as there are links leaves 1e-15 of it."""
_NO_INERTIA = 1e-30
"""Stands for an inertia of zero where one divides [kg m^2 or kg]; no body has so little."""


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
    """``ddm(q, v, tau) -> a``: the accelerations that the joint efforts produce.

    Open chains: by articulated bodies, linear in the number of links, or from A a = tau - H with
    the composite-body inertia matrix, factorised without filling the zeros that branches leave.
    Closed systems: the latter in the independent joints, ddm(q, v_a, tau_a) -> a_a, or with
    `coordinates="tree"` ddm(q, v, tau) -> a, lam, where lam are the efforts of the independent
    closure rows (A a + H = tau + J' lam). Where a closed system has more motors than independent
    joints, or others, they are ddm(q, v_a, tau_m) -> a_a, of the efforts of all `system.motors`.

    Source: Featherstone 1983; Featherstone 2008, section 6.5; Khalil & Creusot 1997, eq. 24 and
    section 5.4.

    Args:
        system: open or closed; q must close the loops.
        method: "articulated" for open chains, "composite", or "auto" for the one that takes
            fewer operations.
        coordinates: of a closed system, "independent" or "tree".
        f_ext: add an input f_ext (6, bodies): for each row of `system.bodies` the wrench
            [force; moment] that the body exerts on its environment, in the body's frame.
        moving_base: add the inputs v_0 (6), velocity [V; w] of the base, a_0 (6), accelerations
            [vd; wd] of its origin and angular, both in its own axes, and R_0 (3, 3), orientation
            of the base in the frame in which gravity is given.

    Returns:
        Function of q (nq, 1), v and tau (m, 1), or tau_m (k, 1), f_ext, v_0, a_0, R_0; a (m, 1)
        [rad/s^2 or m/s^2].

    Raises:
        ModelError: some joint moves no inertia, so that its acceleration is not determined; or
            the method is unknown, or is for open chains and the system has loops.
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
    """``ddm(q, v_a, tau_a) -> a_a``: `direct_dynamics` of efforts at the independent joints.

    It is the same but where motors are others than these.
    """
    if system.motors == system.active:
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
    """Methods one of which takes the fewest operations."""
    if system.is_closed:
        return ("composite",)
    return ("composite", "articulated") if _composite_may_win(system) else ("articulated",)


def _composite_may_win(system: System) -> bool:
    """Whether factorising A and solving alone take less than articulated bodies can take."""
    depths: list[int] = []
    for before in velocity_antecedents(system.tree):
        depths.append(depths[before] + 1 if before >= 0 else 0)
    return sum(d * (d + 1) + 4 * d for d in depths) < _ARTICULATED * system.nv


def _model(
    system: System, method: str, coordinates: str, f_ext: bool, moving_base: bool
) -> Function:
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


def _articulated(system: System, s: ModelSymbols, tau: SX, around: Surroundings) -> SX:
    left = tau - own_efforts(system, s, SX.zeros(system.nv))
    external = exerted(system, around, s.poses, s.q, s.v)
    return articulated_accelerations(system.tree, s.poses, s.v, left, around.base, external)


def _composite(system: System, s: ModelSymbols, tau: SX, around: Surroundings) -> SX:
    A = tree_inertia(system.tree, s.poses)
    H = s.reduced_effort(tree_efforts(system, s, s.tree_acceleration(SX.zeros(s.size)), around))
    return solve_tree(s.reduced_matrix(A), tau - H, solution_order(system, s))


def require_inertia(system: System) -> None:
    """Refuse a chain in which some velocity moves no inertia.

    Raises:
        ModelError: which velocity, and what to give mass to.
    """

    def check() -> bool:
        if any(p.default is None for p in system.parameters):
            return True
        loose = _loose_in_loops(system) if system.is_closed else _loose_in_tree(system)
        if loose is not None:
            number = system.active[loose]
            name = system.speeds[number].name
            raise ModelError(
                f"{system.name}: {name} can move without moving any inertia, so its acceleration"
                " is not determined; give mass to what it carries, or a rotor inertia Ia; a mass of"
                f" zero needs springs or dampers, and no motor{obstacles(system, number)}"
            )
        return True

    system.cached("has inertia", check)


def _loose_in_tree(system: System) -> int | None:
    """A velocity of an open chain that moves no inertia when those behind it are free."""
    q = SX.sym("q", system.nq)
    poses = link_poses(system.tree, normalised(system.tree, q))
    both = casadi.horzcat(*inertia_pivots(system.tree, poses))
    pivots = Function("pivots", [q, system.p], [both], {"cse": True})
    rng = np.random.default_rng(_SEED)
    configuration = np.array(system.configuration) + rng.uniform(-1.0, 1.0, system.nq)
    free, locked = np.array(pivots(configuration, system.p_default)).T
    # The inertia of files may be negative: what counts is whether anything is there.
    moves = np.abs(free) > _VANISHING * np.maximum(np.abs(locked), _NO_INERTIA)
    return None if moves.all() else int(np.max(np.flatnonzero(~moves)))


def _loose_in_loops(system: System) -> int | None:
    """An independent velocity of a closed system that moves no inertia."""
    closure, q = system.closure, list(system.configuration)
    assert closure is not None
    active, passive = list(closure.active), list(closure.passive)
    # rows that are chosen for another configuration may be dependent here
    here = rows_at(system, np.array(q), np.array(system.p_default))
    J = dense(constraint_jacobian(here)(q, system.p_default))[kept_rows(here)]
    G = np.zeros((system.nv, len(active)))
    G[active], G[passive] = np.eye(len(active)), -np.linalg.solve(J[:, passive], J[:, active])
    A = G.T @ np.array(inertia_matrix(system, "tree")(q)) @ G
    size = 1 / np.sqrt(np.maximum(np.diag(A), _NO_INERTIA))
    A = A * np.outer(size, size)
    return None if rank(A) == len(A) else first_best(np.abs(np.linalg.svd(A)[2][-1]))


# Hybrid dynamics: some accelerations are given, the efforts of the others.


def hybrid_dynamics(system: System, prescribed: Sequence[str]) -> Function:
    """``hybrid(q, v, tau, a_p) -> a, tau_p``: motion where some joints are driven along a law.

    tau_p is the effort that a drive must add to tau at each prescribed velocity. In a closed
    system q and v close the loops, and lam, the efforts of the independent closure rows, is a
    third output.

    Source: Featherstone 2008, section 9.2; loops as in `direct_dynamics`.

    Args:
        system: open or closed; all coordinates are those of the tree.
        prescribed: names of velocities whose accelerations are given.

    Returns:
        Function of q (nq, 1), v and tau (nv, 1), a_p (k, 1) in the order of the names; a (nv, 1)
        and tau_p (k, 1) [N m or N].

    Raises:
        ModelError: a name is unknown or comes twice, or the loops let the named velocities not
            move independently.
    """
    require_system(system)
    numbers = _numbers(system, prescribed)

    def build() -> tuple[Named, Named]:
        s = symbols_of(system, "tree")
        tau, a_p = SX.sym("tau", system.nv), SX.sym("a_p", len(numbers))
        a, lam, tau_p = constrained_accelerations(
            system, s, tau, surroundings(system), numbers, a_p
        )
        outputs = [("a", a), ("tau_p", tau_p), *([("lam", lam)] if system.is_closed else [])]
        return [("q", s.q), ("v", s.v), ("tau", tau), ("a_p", a_p)], outputs

    return model_function(system, ("hybrid", numbers), build)


def _numbers(system: System, prescribed: Sequence[str]) -> tuple[int, ...]:
    names = [speed.name for speed in system.speeds]
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
        told = ", ".join(system.speeds[k].name for k in numbers)
        raise ModelError(
            f"{system.name}: {told} cannot all be prescribed, since the loops tie them (mobility"
            f" {len(system.active)}); prescribe joints that can move independently"
        )
    return numbers


def are_independent(system: System, numbers: tuple[int, ...], *rows: NDArray[np.float64]) -> bool:
    """Whether the loops leave these velocities, and rows (1, nv), independent as assembled."""
    if not system.is_closed and not rows:
        return True
    J = np.empty((0, system.nv))
    if system.is_closed:
        p = [system.p_default] if system.parameters else []
        J = np.array(closure_jacobian(system)(list(system.configuration), *p))
    E = np.vstack([np.eye(system.nv)[list(numbers)], *rows])
    return rank(np.vstack([J, E])) == rank(J) + len(E)
