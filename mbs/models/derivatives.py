"""Derivatives of inverse and forward dynamics."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Sequence
from itertools import accumulate
from typing import Any

import casadi
from casadi import DM, MX, SX, Function

from mbs.assembly import System
from mbs.assembly.model_function import (
    ModelFunction,
    Named,
    default_in,
    model_function,
    require_system,
    signals_in,
)
from mbs.assembly.tree import normalised, position_rate, quaternion_slices
from mbs.errors import ModelError
from mbs.models._direct_dynamics import independent_dynamics, require_inertia
from mbs.models._inverse_dynamics import tree_efforts
from mbs.models.symbols import (
    ModelSymbols,
    check_coordinates,
    derivatives_check,
    is_reduced,
    outputs_of,
    solution_order,
    surroundings,
    symbols_of,
)
from mbs.models.tree_table import TreeLoops
from mbs.operations.counts import cheapest
from mbs.recursions.composite_body import (
    TreeFactor,
    factor_symbols,
    factorize,
    substitute,
    velocity_antecedents,
)
from mbs.recursions.composite_body import inertia_matrix as tree_inertia
from mbs.recursions.force_elements import element_efforts
from mbs.recursions.link_motions import resting_base
from mbs.recursions.newton_euler import joint_efforts
from mbs.recursions.newton_euler_derivatives import newton_euler_derivatives
from mbs.recursions.parts import PartsAt
from mbs.text import quoted

# Derivatives of efforts and accelerations by each method.
#
# Source: Carpentier & Mansard 2018; Singh, Russell & Wensing 2022.


Blocks = dict[str, SX]
"""Derivatives by the name of the input with respect to which they are taken."""


def efforts_by_ad(system: System, s: ModelSymbols, a: SX) -> tuple[Blocks, SX]:
    """Return the derivatives of inverse dynamics by algorithmic differentiation.

    Args:
        system: open or closed mechanism.
        s: symbols of the system.
        a: (m, 1) symbols of accelerations.

    Returns:
        blocks "q", "v" and "a" (m, m); efforts (m, 1).
    """
    tau = s.reduced_effort(tree_efforts(system, s, s.tree_acceleration(a), surroundings(system)))
    blocks = {
        "q": _along_motion(system, s, tau),
        "v": casadi.jacobian(tau, s.v),
        "a": s.reduced_matrix(tree_inertia(system.tree, s.poses)),
    }
    return blocks, tau


def efforts_by_recursion(system: System, s: ModelSymbols, a: SX) -> tuple[Blocks, SX]:
    """Return the derivatives of inverse dynamics by analytical recursions, in tree coordinates.

    Args:
        system: open or closed mechanism.
        s: symbols of the system, in tree coordinates.
        a: (nv, 1) symbols of accelerations.

    Returns:
        blocks "q", "v" and "a" (nv, nv); efforts (nv, 1).
    """
    tree = system.tree
    moving = newton_euler_derivatives(tree, s.poses, s.v, a, resting_base(tree.gravity))
    acting = element_efforts(PartsAt(system, s.q, s.v), s.poses)
    joints = joint_efforts(tree, s.q, s.v, a) + acting
    blocks = {
        "q": moving.dq + _along_motion(system, s, joints),
        "v": moving.dv + casadi.jacobian(joints, s.v),
        "a": moving.A + casadi.jacobian(joints, a),
    }
    return blocks, moving.efforts + joints


def implicit_formula(
    system: System, s: ModelSymbols, tau: SX, names: Collection[str]
) -> tuple[TreeFactor, SX, Blocks]:
    """Return the linear systems whose solutions are the derivatives of accelerations.

    They are A x = -dtau/dname for each input name.

    Args:
        system: open or closed mechanism.
        s: symbols of the system.
        tau: (m, 1) efforts.
        names: inputs of the derivatives, among "q", "v", "z", "u" and "p".

    Returns:
        factors of the mass matrix A, the accelerations, and for each name the right-hand side:
        minus the derivative of the inverse dynamics at these accelerations.
    """
    before = solution_order(system, s)
    by = efforts_by_recursion if s.reduction is None else efforts_by_ad
    symbol = SX.sym("a", s.size)
    slopes, efforts = by(system, s, symbol)
    factor = factorize(slopes["a"], before)
    slopes |= _by_symbols_of(system, efforts, names)
    H = casadi.substitute(efforts, symbol, SX.zeros(s.size))
    a = substitute(factor, tau - H, before)
    minus = casadi.substitute([-SX(slopes[name]) for name in names], [symbol], [a])
    return factor, a, dict(zip(names, map(casadi.densify, minus), strict=True))


def accelerations_by_efforts(
    system: System, s: ModelSymbols, tau: SX, names: tuple[str, ...]
) -> tuple[Blocks, SX]:
    """Return the derivatives of forward dynamics by the implicit formula, and the accelerations.

    Args:
        system: open or closed mechanism.
        s: symbols of the system.
        tau: (m, 1) symbols of efforts.
        names: inputs of the derivatives, among "q", "v", "tau", "z", "u" and "p".

    Returns:
        derivatives by input name, and accelerations (m, 1).
    """
    wanted = [name for name in names if name != "tau"]
    factor, a, right = implicit_formula(system, s, tau, wanted)
    sides = [*right.values(), casadi.densify(SX.eye(s.size))]
    ends = [0, *accumulate(side.shape[1] for side in sides)]
    every = substitute(factor, casadi.horzcat(*sides), solution_order(system, s))
    *solved, inverse = casadi.horzsplit(every, ends)
    blocks = dict(zip(wanted, solved, strict=True))
    return {**blocks, "tau": casadi.triu2symm(casadi.triu(inverse))}, a


def accelerations_by_ad(
    system: System, s: ModelSymbols, tau: SX, names: tuple[str, ...]
) -> tuple[Blocks, SX]:
    """Return the derivatives of forward dynamics by algorithmic differentiation, and a.

    Args:
        system: open or closed mechanism.
        s: symbols of the system.
        tau: (m, 1) symbols of efforts.
        names: inputs of the derivatives, among "q", "v", "tau", "z", "u" and "p".

    Returns:
        derivatives by input name, and accelerations (m, 1).
    """
    a = outputs_of(system, independent_dynamics(system), s.q, s.v, tau)[0]
    blocks = {
        "q": _along_motion(system, s, a),
        "v": casadi.jacobian(a, s.v),
        "tau": casadi.jacobian(a, tau),
    }
    return blocks | _by_symbols_of(system, a, names), a


def _by_symbols_of(system: System, value: SX, names: Collection[str]) -> Blocks:
    """Return the derivatives with respect to component states z, inputs u or parameters p.

    Names other than "z", "u" and "p" are ignored.
    """
    own = {"z": system.component_states, "u": system.u, "p": system.p}
    return {name: casadi.jacobian(value, own[name]) for name in names if name in own}


def _along_motion(system: System, s: ModelSymbols, value: SX) -> SX:
    """Return the derivative (k, m) of a value (k, 1) along unit input velocities.

    It is d(value)/dq dq/dv.
    """
    slope = casadi.jacobian(value, s.q)
    if system.nq != system.nv:
        u = SX.sym("u", system.nv)
        rate = casadi.jacobian(position_rate(system.tree, s.q, u), u)
        slope = casadi.mtimes(slope, rate)
    return slope if s.reduction is None else casadi.mtimes(slope, s.reduction.G)


# Derivatives of accelerations in two stages: the front Function factorises A and forms the
# right-hand sides; then a mapped Function solves for each column.


def solve_column(before: list[int]) -> Function:
    """Return the Function that solves A x = right for one column.

    It is ``solve_column(ratios, inverse, right) -> x``.

    Args:
        before: index of the nearest ancestor of each row of A, or -1; see `factorize`.

    Returns:
        Function of the factors of A and one column (n, 1).
    """
    factor, right = factor_symbols(before), SX.sym("right", len(before))
    names = ["ratios", "inverse", "right"], ["x"]
    return Function("solve_column", [*factor, right], [substitute(factor, right, before)], *names)


def staged_accelerations(system: System, names: Sequence[str]) -> tuple[dict[str, MX], list[MX]]:
    """Return the derivatives of forward dynamics in tree coordinates, as an MX graph.

    The columns of the solution are mapped.

    Args:
        system: open mechanism.
        names: inputs of the derivatives, among "q", "v", "tau", "z", "u" and "p".

    Returns:
        inputs by name: q, v, tau, then z and u if components need them, and p if the system has
        parameters; then a list of the derivatives in the order of `names`, and the accelerations.
    """
    solve = solve_column(velocity_antecedents(system.tree))
    order = [name for name in names if name != "tau"]
    front = _first_stage(system, order)
    inputs = {name: MX.sym(name, front.size_in(name)) for name in front.name_in()}
    ratios, inverse, a, *right = front.call(list(inputs.values()))
    if "tau" in names:
        order, right = [*order, "tau"], [*right, MX(DM.eye(system.nv))]
    sides = casadi.densify(casadi.horzcat(*right))
    every = solve.map("solve_columns", "serial", sides.shape[1], [0, 1], [])
    ends = [0, *accumulate(side.shape[1] for side in right)]
    columns = casadi.horzsplit(every(ratios, inverse, sides), ends)
    blocks = dict(zip(order, columns, strict=True))
    if "tau" in names:
        blocks["tau"] = casadi.triu2symm(casadi.triu(blocks["tau"]))
    return inputs, [*(blocks[name] for name in names), a]


def _first_stage(system: System, names: Sequence[str]) -> Function:
    """Return the Function (q, v, tau) -> factors of A, accelerations, right-hand sides.

    The derivatives of the accelerations are the solutions for these right-hand sides.
    """
    s = symbols_of(system, "tree")
    tau = SX.sym("tau", s.size)
    factor, a, sides = implicit_formula(system, s, tau, names)
    outputs: Named = [
        *zip(("ratios", "inverse", "a"), (*factor, a), strict=True),
        *((f"minus_dtau_d{name}", side) for name, side in sides.items()),
    ]
    inputs: Named = [("q", s.q), ("v", s.v), ("tau", tau)]
    parameters = [("p", system.p)] if system.parameters else []
    every = [*inputs, *signals_in(system, inputs, outputs), *parameters]
    names_in, symbols = zip(*every, strict=True)
    names_out, values = zip(*outputs, strict=True)
    return Function("front", symbols, values, names_in, names_out, {"cse": True})


_COMPARED = 6
"""Largest number of velocities on a branch at which "auto" builds both methods and counts their
operations; on longer branches algorithmic differentiation needs more operations."""

_STAGED = 10
"""Smallest number of velocities at which the columns of -A^-1 dtau are a CasADi map: smaller trees
have expanded columns."""


def inverse_dynamics_derivatives(
    system: System,
    method: str = "auto",
    coordinates: str = "independent",
    with_respect_to: Iterable[str] = ("q", "v", "a"),
) -> Function:
    """Return the derivatives of inverse dynamics by motion, states and parameters.

    ``idm_derivatives(q, v, a) -> dtau_dq, dtau_dv, dtau_da, tau``. Column k of dtau_dq is the rate
    of the efforts if the positions move with unit velocity k, dq/dt = `system.qdot(q, v)`, while v
    and a are constant. For joints without quaternions it is the partial derivative. dtau_da is the
    inertia matrix. All terms of `inverse_dynamics` are included.

    Source: Carpentier & Mansard 2018; Singh, Russell & Wensing 2022.

    Args:
        system: open or closed mechanism; q must close the loops.
        method: "ad" for algorithmic differentiation of the recursion, "analytical" for recursions
            of the derivatives, "auto" for fewer operations.
        coordinates: coordinates of a closed system, "independent" for idm_derivatives(q, v_a, a_a)
            -> dtau_a_dq_a, dtau_a_dv_a, dtau_a_da_a, tau_a, or "tree". tau_a acts on the
            independent joints; it equals `actuation_matrix` times the motor efforts.
        with_respect_to: inputs of the derivatives: "q", "v", "a", component states "z", component
            inputs "u", parameters "p".

    Returns:
        Function of q (nq, 1), v and a (m, 1). Outputs: matrices (m, m), and tau (m, 1). Derivatives
        with respect to z, u and p have as many columns as these vectors have elements.

    Raises:
        ModelError: a word is unknown; "z", "u" or "p" is requested of a system that has none; "p"
            or the analytical method is requested in independent coordinates of a closed system.
    """
    require_system(system)
    names = _checked_names(system, coordinates, with_respect_to, ("q", "v", "a", "z", "u", "p"))
    _check_method(system, coordinates, method, ("auto", "ad", "analytical"))

    def build(chosen: str) -> Function:
        def symbols() -> tuple[Named, Named]:
            s = symbols_of(system, coordinates)
            label, a = s.input("a")
            by = efforts_by_ad if chosen == "ad" else efforts_by_recursion
            blocks, tau = by(system, s, a)
            blocks |= _by_symbols_of(system, tau, names)
            inputs: Named = [("q", s.q), ("v" + s.suffix, s.v), (label, a)]
            return inputs, _outputs("tau" + s.suffix, s, names, blocks, tau)

        key = ("idm_derivatives", chosen, coordinates, names)
        check = derivatives_check(system, coordinates)
        return model_function(system, key, symbols, check, TreeLoops(system, "idm_derivatives"))

    candidates = (
        ("ad",) if is_reduced(system, coordinates) else _compared_methods(system, "analytical")
    )
    return _choose(system, ("idm_derivatives", coordinates, names), method, build, candidates)


def direct_dynamics_derivatives(
    system: System,
    method: str = "auto",
    coordinates: str = "independent",
    with_respect_to: Iterable[str] = ("q", "v", "tau"),
) -> Function:
    """Return the derivatives of forward dynamics.

    They are ``ddm_derivatives(q, v, tau) -> da_dq, da_dv, da_dtau, a``.

    The accelerations solve tau = idm(q, v, a). So da_dq = -A^-1 dtau_dq and da_dv = -A^-1 dtau_dv
    with the derivatives of idm at these accelerations, and da_dtau = A^-1. A is factorised once.
    da_dq is taken along the velocities, as in `inverse_dynamics_derivatives`. For a tree with many
    velocities the columns of the solution are a CasADi map, which compiled code vectorises;
    `expand()` replaces the map by scalar operations.

    Source: Carpentier & Mansard 2018, section IV.

    Args:
        system: open or closed mechanism; q must close the loops.
        method: "implicit" for the formula above, "ad" for algorithmic differentiation of the
            forward dynamics, "auto" for fewer operations.
        coordinates: "independent", with tau_a as for `inverse_dynamics_derivatives`; "tree" is
            equivalent for an open chain.
        with_respect_to: inputs of the derivatives: "q", "v", "tau", component states "z", component
            inputs "u", parameters "p".

    Returns:
        Function of q (nq, 1), v and tau (m, 1). Outputs: matrices (m, m), and a (m, 1). Derivatives
        with respect to z, u and p have as many columns as these vectors have elements.

    Raises:
        ModelError: a word is unknown; "z", "u" or "p" is requested of a system that has none; "p"
            or tree coordinates are requested of a closed system; or a joint moves no inertia.
    """
    require_system(system)
    names = _checked_names(system, coordinates, with_respect_to, ("q", "v", "tau", "z", "u", "p"))
    if coordinates == "tree" and system.is_closed:
        raise ModelError(
            f"{system.name}: ddm_derivatives of a closed system are in its independent"
            " coordinates; differentiate direct_dynamics(system, coordinates='tree') with"
            " casadi.jacobian for those of the tree"
        )
    _check_method(system, coordinates, method, ("auto", "ad", "implicit"))
    require_inertia(system)

    def build(chosen: str) -> Function:
        def symbols() -> tuple[Named, Named]:
            s = symbols_of(system, coordinates)
            label, tau = s.input("tau")
            by = accelerations_by_ad if chosen == "ad" else accelerations_by_efforts
            blocks, a = by(system, s, tau, names)
            inputs: Named = [("q", s.q), ("v" + s.suffix, s.v), (label, tau)]
            return inputs, _outputs("a" + s.suffix, s, names, blocks, a)

        key = ("ddm_derivatives", chosen, coordinates, names)
        if chosen == "implicit" and not system.is_closed and system.nv >= _STAGED:
            staged: Function = system.cached(key, lambda: _mapped_derivatives(system, names))
            return staged
        check = derivatives_check(system, coordinates)
        return model_function(system, key, symbols, check, TreeLoops(system, "ddm_derivatives"))

    candidates = ("implicit",) if system.is_closed else _compared_methods(system, "implicit")
    return _choose(system, ("ddm_derivatives", coordinates, names), method, build, candidates)


def _mapped_derivatives(system: System, names: tuple[str, ...]) -> Function:
    """Return ``ddm_derivatives`` of a large tree with mapped columns, for the inputs `names`."""
    inputs, outputs = staged_accelerations(system, names)
    labels = list(inputs), [*(f"da_d{name}" for name in names), "a"]
    options = {"default_in": default_in(system, len(inputs.keys() - {"p"}))}
    function = Function("ddm_derivatives", [*inputs.values()], outputs, *labels, options)
    return ModelFunction(function, system, loops=TreeLoops(system, "ddm_derivatives"))


def _checked_names(
    system: System, coordinates: str, with_respect_to: Iterable[str], known: tuple[str, ...]
) -> tuple[str, ...]:
    """Return the names of the inputs of the requested derivatives, as a tuple.

    Raise ModelError if a name is not in `known`, is repeated, or the system has no such input.
    """
    check_coordinates(system, coordinates)
    given = [with_respect_to] if isinstance(with_respect_to, str) else list(with_respect_to)
    for name in given:
        if name not in known:
            words = ", ".join(known)
            raise ModelError(f"{system.name}: with_respect_to has {quoted(name)}; use {words}")
    if not given or len(set(given)) < len(given):
        raise ModelError(f"{system.name}: with_respect_to is {given!r}; name each input once")
    lacking = {
        "z": (system.states, "states of components"),
        "u": (system.inputs, "inputs of components"),
        "p": (system.parameters, "parameters"),
    }
    for name, (found, words) in lacking.items():
        if name in given and not found:
            raise ModelError(
                f"{system.name}: it has no {words}; leave {name!r} out of with_respect_to"
            )
    if "p" in given and is_reduced(system, coordinates):
        raise ModelError(
            f"{system.name}: when a parameter changes, q no longer closes the loops; leave 'p' out"
            " of with_respect_to"
        )
    return tuple(given)


def _check_method(system: System, coordinates: str, method: str, known: tuple[str, ...]) -> None:
    """Raise ModelError if a method is not in `known`, or is "analytical" for loops."""
    if method not in known:
        words = ", ".join(map(repr, known))
        raise ModelError(f"{system.name}: method is {quoted(method)}; use one of {words}")
    if method == "analytical" and is_reduced(system, coordinates):
        raise ModelError(
            f"{system.name}: method 'analytical' is for trees and this system has loops; use 'ad'"
            " or coordinates='tree'"
        )


def _compared_methods(system: System, recursive: str) -> tuple[str, ...]:
    """Return the methods that "auto" compares: `recursive`, and "ad" if branches are short."""
    behind: list[int] = []
    for link in system.tree.links:
        before = behind[link.antecedent] if link.antecedent >= 0 else 0
        behind.append(before + link.motion.nv)
    return (recursive,) if max(behind) > _COMPARED else (recursive, "ad")


def _choose(
    system: System,
    key: tuple[object, ...],
    method: str,
    build: Callable[[str], Function],
    candidates: tuple[str, ...],
) -> Function:
    """Return the model by the method `method`, made by `build`.

    For "auto" it is the cheapest of the models by the methods `candidates`, cached with the key
    `key`.
    """
    if method != "auto":
        return build(method)
    function: Function = system.cached(
        ("cheapest", *key), lambda: cheapest(*map(build, candidates))
    )
    return function


def _outputs(of: str, s: ModelSymbols, names: tuple[str, ...], blocks: Blocks, value: SX) -> Named:
    """Return the outputs of a model of derivatives as pairs (name, value).

    They are the derivatives "d<of>_d<name>" in `blocks` for the inputs `names`, then `value` itself
    with the name `of`.
    """
    labels = [name if name in "zup" else name + s.suffix for name in names]
    pairs = zip(labels, names, strict=True)
    return [*((f"d{of}_d{label}", blocks[name]) for label, name in pairs), (of, value)]


# Forward dynamics with a Jacobian by the implicit formula.
#
# Source: Carpentier & Mansard 2018, section IV.


def with_implicit_jacobian(system: System, ddm: Function) -> Function:
    """Return forward dynamics with a custom CasADi Jacobian by the implicit formula.

    CasADi uses it for full Jacobians of calls in MX graphs. Single directional derivatives still
    use algorithmic differentiation, which is cheaper. Quaternions are normalised first, so that
    derivatives with respect to q are along motions; for unit quaternions the values do not change.

    Args:
        system: open mechanism.
        ddm: Function `direct_dynamics(system)`.

    Returns:
        Function with the inputs and outputs of ddm.

    Raises:
        ModelError: the system has loops, or ddm is not the forward dynamics of the system.
    """
    require_system(system)
    _require_ddm(system, ddm)
    names, symbols, output = ddm.name_in(), ddm.sx_in(), ddm.name_out()[0]
    q = symbols[0]
    arguments = [normalised(system.tree, q), *symbols[1:]]
    slopes = direct_dynamics_derivatives(system, with_respect_to=names)
    along_motion, *others = slopes.call(arguments)[:-1]
    jacobian = Function(
        f"jac_{ddm.name()}",
        [*symbols, SX(*ddm.size_out(0))],
        [casadi.densify(casadi.mtimes(along_motion, _velocities(system, q))), *others],
        [*names, f"out_{output}"],
        [f"jac_{output}_{name}" for name in names],
        {"cse": True},
    )
    options: dict[str, Any] = {
        "cse": True,
        "custom_jacobian": jacobian,
        "jac_penalty": 1 / system.nv,
        "default_in": [ddm.default_in(k) for k in range(ddm.n_in())],
    }
    model = Function(ddm.name(), symbols, ddm.call(arguments), names, ddm.name_out(), options)
    like: Callable[[Function], Function] = getattr(ddm, "like", Function)
    made = like(model)
    if isinstance(made, ModelFunction):
        made.loops = TreeLoops(system, "ddm", normalises=True)
    return made


def _require_ddm(system: System, ddm: Function) -> None:
    """Raise ModelError unless the Function `ddm` is the direct dynamic model of this open chain."""
    if system.is_closed:
        raise ModelError(
            f"{system.name}: the implicit Jacobian is for open chains and this system has loops;"
            " use its direct model as it is"
        )
    wanted = ["q", "v", "tau", *(["p"] if system.parameters else [])]
    own = isinstance(ddm, Function) and [name for name in ddm.name_in() if name not in "zu"]
    if own != wanted or ddm.size1_in(0) != system.nq:
        raise ModelError(
            f"{system.name}: with_implicit_jacobian takes the direct model of the system; give"
            " mbs.models.direct_dynamics(system)"
        )


def _velocities(system: System, q: SX) -> SX:
    """Return the map (nv, nq) from changes of q, projected on motions, to velocities.

    It is the pseudoinverse of N in dq/dt = N v, divided by the norm of a quaternion. Columns of N
    are orthogonal. Their norm is 1/2 for a rotation (orthogonal to the quaternion) and 1 for a
    translation.
    """
    u = SX.sym("u", system.nv)
    N = casadi.jacobian(position_rate(system.tree, normalised(system.tree, q), u), u)
    for part in quaternion_slices(system.tree):
        N[part, :] *= 4 / casadi.norm_2(q[part])
    return N.T
