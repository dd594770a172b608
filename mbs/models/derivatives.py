"""Derivatives of the inverse and the direct dynamic model."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import casadi
from casadi import SX, Function

from mbs.assembly import System
from mbs.assembly.model_function import (
    ModelFunction,
    Named,
    default_in,
    model_function,
    require_system,
)
from mbs.errors import ModelError
from mbs.messages import quoted
from mbs.models.direct_dynamics import require_inertia
from mbs.models.slopes import (
    Blocks,
    accelerations_by_ad,
    accelerations_by_efforts,
    efforts_by_ad,
    efforts_by_recursion,
)
from mbs.models.staged_accelerations import staged_accelerations
from mbs.models.symbols import (
    ModelSymbols,
    check_coordinates,
    is_reduced,
    posture_check,
    symbols_of,
)
from mbs.operations.counts import cheapest

_COMPARED = 6
"""Velocities from the base to a leaf up to which both methods are built and their operations
counted; in longer trees differentiation takes more."""

_STAGED = 10
"""Velocities from which the columns of -A^-1 dtau are a map, not written out one by one."""


def inverse_dynamics_derivatives(
    system: System,
    method: str = "auto",
    coordinates: str = "independent",
    with_respect_to: Iterable[str] = ("q", "v", "a"),
) -> Function:
    """``idm_derivatives(q, v, a) -> dtau_dq, dtau_dv, dtau_da, tau``.

    Column k of dtau_dq is the change of the efforts when the positions move with unit velocity k
    while v and a stay: dq/dt = `system.qdot(q, v)`. For joints without quaternions it is the
    plain derivative. dtau_da is the inertia matrix. All that `inverse_dynamics` holds is in it.

    Source: Carpentier & Mansard 2018; Singh, Russell & Wensing 2022.

    Args:
        system: open or closed; q must close the loops.
        method: "ad" for the differentiated recursion, "analytical" for recursions of the
            derivatives themselves, "auto" for the one that takes fewer operations.
        coordinates: of a closed system, "independent" for idm_derivatives(q, v_a, a_a) ->
            dtau_a_dq_a, dtau_a_dv_a, dtau_a_da_a, tau_a, or "tree"; whatever motors there are,
            tau_a is at the independent joints, `actuation_matrix` times that of the motors.
        with_respect_to: which derivatives: of "q", "v", "a" and "p", the parameters.

    Returns:
        Function of q (nq, 1), v and a (m, 1); matrices (m, m), with respect to p (m, number of
        parameters), and tau (m, 1).

    Raises:
        ModelError: an unknown word; derivatives with respect to p of a system without parameters
            or in independent coordinates; or the analytical method in these.
    """
    require_system(system)
    names = _checked(system, coordinates, with_respect_to, ("q", "v", "a", "p"))
    _check_method(system, coordinates, method, ("auto", "ad", "analytical"))

    def build(chosen: str) -> Function:
        def symbols() -> tuple[Named, Named]:
            s = symbols_of(system, coordinates)
            label, a = s.input("a")
            by = efforts_by_ad if chosen == "ad" else efforts_by_recursion
            blocks, tau = by(system, s, a)
            if "p" in names:
                blocks["p"] = casadi.jacobian(tau, system.p)
            inputs: Named = [("q", s.q), ("v" + s.suffix, s.v), (label, a)]
            return inputs, _outputs("tau" + s.suffix, s, names, blocks, tau)

        key = ("idm_derivatives", chosen, coordinates, names)
        return model_function(system, key, symbols, posture_check(system, coordinates))

    candidates = ("ad",) if is_reduced(system, coordinates) else _compared(system, "analytical")
    return _chosen(system, ("idm_derivatives", coordinates, names), method, build, candidates)


def direct_dynamics_derivatives(
    system: System,
    method: str = "auto",
    coordinates: str = "independent",
    with_respect_to: Iterable[str] = ("q", "v", "tau"),
) -> Function:
    """``ddm_derivatives(q, v, tau) -> da_dq, da_dv, da_dtau, a``.

    The accelerations solve tau = idm(q, v, a), so that their derivatives are those of the efforts
    at these accelerations, multiplied by -A^-1; da_dtau = A^-1. One factorisation of A serves
    them and the accelerations. da_dq is along the velocities, as in
    `inverse_dynamics_derivatives`. For a tree with many velocities the columns of the solution
    are a map, which fast machine code computes several at a time; `expand()` writes them out.

    Source: Carpentier & Mansard 2018, section IV.

    Args:
        system: open or closed; q must close the loops.
        method: "implicit" for the formula above, "ad" for the differentiated direct model, "auto"
            for the one that takes fewer operations.
        coordinates: "independent", where tau_a is as for `inverse_dynamics_derivatives`; "tree" is
            the same in an open chain.
        with_respect_to: which derivatives: of "q", "v", "tau" and "p", the parameters.

    Returns:
        Function of q (nq, 1), v and tau (m, 1); matrices (m, m), with respect to p (m, number of
        parameters), and a (m, 1).

    Raises:
        ModelError: an unknown word; derivatives with respect to p of a system without parameters
            or with loops; tree coordinates of a closed system; or some joint moves no inertia.
    """
    require_system(system)
    names = _checked(system, coordinates, with_respect_to, ("q", "v", "tau", "p"))
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
            staged: Function = system.cached(key, lambda: _staged(system, names))
            return staged
        return model_function(system, key, symbols, posture_check(system, coordinates))

    candidates = ("implicit",) if system.is_closed else _compared(system, "implicit")
    return _chosen(system, ("ddm_derivatives", coordinates, names), method, build, candidates)


def _staged(system: System, names: tuple[str, ...]) -> Function:
    """The derivatives of accelerations of a large tree."""
    inputs, outputs = staged_accelerations(system, names)
    labels = ["q", "v", "tau", "p"][: len(inputs)], [*(f"da_d{name}" for name in names), "a"]
    options = {"default_in": default_in(system, 3)}
    function = Function("ddm_derivatives", inputs, outputs, *labels, options)
    return ModelFunction(function, system)


def _checked(
    system: System, coordinates: str, with_respect_to: Iterable[str], known: tuple[str, ...]
) -> tuple[str, ...]:
    check_coordinates(system, coordinates)
    given = [with_respect_to] if isinstance(with_respect_to, str) else list(with_respect_to)
    for name in given:
        if name not in known:
            words = ", ".join(known)
            raise ModelError(f"{system.name}: with_respect_to has {quoted(name)}; use {words}")
    if not given or len(set(given)) < len(given):
        raise ModelError(f"{system.name}: with_respect_to is {given!r}; name each input once")
    if "p" in given and not system.parameters:
        raise ModelError(f"{system.name}: it has no parameters; leave 'p' out of with_respect_to")
    if "p" in given and is_reduced(system, coordinates):
        raise ModelError(
            f"{system.name}: when a parameter changes, q no longer closes the loops; leave 'p' out"
            " of with_respect_to"
        )
    return tuple(given)


def _check_method(system: System, coordinates: str, method: str, known: tuple[str, ...]) -> None:
    if method not in known:
        words = ", ".join(map(repr, known))
        raise ModelError(f"{system.name}: method is {quoted(method)}; use one of {words}")
    if method == "analytical" and is_reduced(system, coordinates):
        raise ModelError(
            f"{system.name}: method 'analytical' is for trees and this system has loops; use 'ad'"
            " or coordinates='tree'"
        )


def _compared(system: System, recursive: str) -> tuple[str, ...]:
    """The recursive method, and the differentiated one while it may win."""
    behind: list[int] = []
    for link in system.tree.links:
        before = behind[link.antecedent] if link.antecedent >= 0 else 0
        behind.append(before + link.motion.nv)
    return (recursive,) if max(behind) > _COMPARED else (recursive, "ad")


def _chosen(
    system: System,
    key: tuple[object, ...],
    method: str,
    build: Callable[[str], Function],
    candidates: tuple[str, ...],
) -> Function:
    """The model by a method, or of the candidates the one of fewer operations."""
    if method != "auto":
        return build(method)
    function: Function = system.cached(
        ("cheapest", *key), lambda: cheapest(*map(build, candidates))
    )
    return function


def _outputs(of: str, s: ModelSymbols, names: tuple[str, ...], blocks: Blocks, value: SX) -> Named:
    labels = [name if name == "p" else name + s.suffix for name in names]
    pairs = zip(labels, names, strict=True)
    return [*((f"d{of}_d{label}", blocks[name]) for label, name in pairs), (of, value)]
