"""Dynamic model in Lagrange form: tau = A a + B v + Q."""

from __future__ import annotations

import casadi
from casadi import SX, Function

from mbs.assembly import System
from mbs.assembly.model_function import Named, model_function, require_system
from mbs.assembly.tree import position_rate
from mbs.errors import ModelError
from mbs.models._inverse_dynamics import static_efforts, tree_gravity
from mbs.models.symbols import ModelSymbols, configuration_check, symbols_of
from mbs.operations.counts import cheapest
from mbs.recursions.composite_body import inertia_matrix as tree_inertia
from mbs.recursions.lagrange import LagrangeForm, christoffel, lagrange_form
from mbs.text import quoted

_METHODS = ("auto", "renaud", "christoffel")
_SHORT = 8
"""Largest number of velocities at which method "christoffel" is tried: beyond it the recursion has
fewer operations even in planar mechanisms."""


def lagrange(system: System, method: str = "auto", coordinates: str = "independent") -> Function:
    """Return the Lagrange form of the dynamic model: ``lagrange(q, v) -> A, B, Q``.

    tau = A a + B v + Q with inertia matrix A, Coriolis matrix B, and gravity and spring efforts Q.

    dA/dt - 2 B is skew-symmetric. Friction and dampers are not included; Q contains the efforts of
    gravity and force elements at rest. For closed systems B is G' (A dG/dt + B G), where G is the
    reduction matrix.

    Source: Renaud 1986; Khalil & Creusot 1997, section 5.5.

    Args:
        system: open or closed mechanism; q must close the loops.
        method: "renaud" for a recursion over augmented bodies, "christoffel" for derivatives of the
            inertia matrix, "auto" for fewer operations. With quaternion joints B is not unique, so
            that the methods differ in B; "auto" then selects "renaud".
        coordinates: coordinates of a closed system, "independent" or "tree".

    Returns:
        Function of q (nq, 1) and v (m, 1); A (m, m), B (m, m), Q (m, 1).

    Raises:
        ModelError: the method is unknown.
    """
    require_system(system)
    if method not in _METHODS:
        raise ModelError(
            f"{system.name}: method is {quoted(method)}; use one of {', '.join(_METHODS)}"
        )
    if method == "auto":
        found: Function = system.cached(
            ("cheapest lagrange", coordinates), lambda: _cheapest(system, coordinates)
        )
        return found
    return _model(system, method, coordinates)


def _cheapest(system: System, coordinates: str) -> Function:
    """Return the cheaper Lagrange form: Renaud's, or by Christoffel symbols."""
    renaud = _model(system, "renaud", coordinates)
    if system.nv > _SHORT or system.nq > system.nv:
        return renaud
    return cheapest(renaud, _model(system, "christoffel", coordinates))


def _model(system: System, method: str, coordinates: str) -> Function:
    """Return the Lagrange form (A, B, Q) by the method "renaud" or "christoffel" as a Function."""

    def build() -> tuple[Named, Named]:
        s = symbols_of(system, coordinates)
        form = _by_renaud(system, s) if method == "renaud" else _by_christoffel(system, s)
        B = form.B
        if s.reduction is not None:
            G = s.reduction.G
            G_rate = casadi.jtimes(G, s.q, position_rate(system.tree, s.q, s.v_tree))
            B = casadi.mtimes(G.T, casadi.mtimes(form.A, G_rate) + casadi.mtimes(B, G))
        Q = s.reduced_effort(form.Q)
        outputs = (("A", s.reduced_matrix(form.A)), ("B", B), ("Q", Q))
        return [("q", s.q), ("v" + s.suffix, s.v)], [(n + s.suffix, x) for n, x in outputs]

    return model_function(
        system, ("lagrange", method, coordinates), build, configuration_check(system, coordinates)
    )


def _by_renaud(system: System, s: ModelSymbols) -> LagrangeForm:
    """Return A, B and Q of the tree by the recursion of Renaud."""
    form = lagrange_form(system.tree, s.poses, s.v_tree)
    return LagrangeForm(form.A, form.B, form.Q + static_efforts(system, s))


def _by_christoffel(system: System, s: ModelSymbols) -> LagrangeForm:
    """Return A, B and Q of the tree, with B from the Christoffel symbols of A."""
    A = tree_inertia(system.tree, s.poses)
    v = SX.sym("v", system.nv)
    B = casadi.substitute(christoffel(system.tree, s.q, v, A), v, s.v_tree)
    return LagrangeForm(A, B, tree_gravity(system, s))
