"""Models along a motion, and distance of closed systems from singular configurations."""

from __future__ import annotations

from typing import Any

import casadi
import numpy as np
import numpy.typing as npt
from casadi import DM, MX, SX, Function

from mbs.assembly import System
from mbs.errors import ModelError, NoClosedForm
from mbs.loops._function import follow_active
from mbs.loops._function import function as closed_form
from mbs.loops.examination import configuration_health
from mbs.loops.velocity import determining_rows

Array = npt.NDArray[np.float64]

REGULAR = 2.5e-3
"""Squared sine between the rows of the passive joints in the closure Jacobian (3 degrees) below
which a configuration counts as close to a singular one. Errors of the independent joints are
then amplified by 20 or more in the passive joints."""

CLEAR = 0.01
"""Smallest squared sine of the same kind that exciting trajectories keep."""

_LARGEST = 8


def leads_of(system: System, q: Array) -> Array:
    """Return the signed distance from singular configurations at q, negative beyond a singularity.

    Its magnitude is `leads` of `configuration_report`: it measures how well the independent joints
    determine the passive joints; 1 is best, 0 is singular. Its sign is that of det(J_p) relative to
    the assembled configuration, where J_p is the passive columns of the closure Jacobian. The value
    is never negative if the choice of rows varies with the configuration.

    Args:
        system: closed system, at the default values of its parameters.
        q: (n, nq) positions [rad or m].

    Returns:
        (n,) signed values without unit.
    """
    n, p = len(q), DM(system.parameter_values())
    leads = np.asarray(configuration_health(system).map(n)(DM(q.T), p)[1]).ravel()
    assert system.closure is not None
    if system.closure.varies:
        return leads
    size = len(system.closure.passive)
    rows = np.asarray(_passive_closure_columns(system).map(n)(DM(q.T), p)).T.reshape(n, size, size)
    return np.asarray(leads * np.linalg.slogdet(rows)[0] * _usual_sign(system), dtype=float)


def signed_leads(system: System) -> Function:
    """Return Function ``leads(q)``: signed distance from singular configurations, see `leads_of`.

    The value is never negative if there are more than 8 passive joints.

    Args:
        system: closed system, at the default values of its parameters.
    """

    def build() -> Function:
        q, p = SX.sym("q", system.nq), DM(system.parameter_values())
        value = configuration_health(system)(q, p)[1]
        assert system.closure is not None
        size = len(system.closure.passive)
        if not system.closure.varies and size <= _LARGEST:
            rows = casadi.reshape(_passive_closure_columns(system)(q, p), size, size)
            value = value * casadi.sign(_determinant(rows)) * _usual_sign(system)
        return Function("leads", [q], [value], {"cse": True})

    function: Function = system.cached("signed leads", build)
    return function


def regular(system: System, q: Array) -> npt.NDArray[np.bool_]:
    """Return a mask (n,) of the configurations of a motion that are not close to singular ones.

    Both samples of a step that crosses a singularity are False.

    Args:
        system: closed system, at the default values of its parameters.
        q: (n, nq) positions [rad or m] in the order of time.
    """
    leads = leads_of(system, q)
    good = np.abs(leads) > REGULAR
    crossed = np.sign(leads[1:]) != np.sign(leads[:-1])
    good[1:] &= ~crossed
    good[:-1] &= ~crossed
    return good


def _usual_sign(system: System) -> float:
    """Return the sign of det(J_p) at the assembled configuration: 1.0 or -1.0, see `leads_of`."""
    rows = np.asarray(
        _passive_closure_columns(system)(DM(system.configuration), DM(system.parameter_values()))
    )
    size = round(rows.size**0.5)
    return float(np.linalg.slogdet(rows.reshape(size, size))[0]) or 1.0


def _passive_closure_columns(system: System) -> Function:
    """Return the Function (q, p) -> (r r, 1): columns of the r passive joints in the Jacobian.

    The Jacobian is that of r independent closure rows; the result is its column-major vector.
    """

    def build() -> Function:
        q = SX.sym("q", system.nq)
        assert system.closure is not None
        J = determining_rows(system, q).J[:, list(system.closure.passive)]
        return Function("passive_rows", [q, system.p], [casadi.densify(casadi.vec(J))])

    function: Function = system.cached("passive rows", build)
    return function


def _determinant(A: SX) -> SX:
    """Return det(A) by the Faddeev-Le Verrier method, without division by elements of A."""
    n = A.shape[0]
    M, c = SX.eye(n), SX(1)
    for k in range(1, n + 1):
        product = casadi.mtimes(A, M)
        c = -casadi.trace(product) / k
        M = product + c * SX.eye(n)
    return SX((-1) ** n * c)


# Configurations of all joints from the positions of the independent joints.


def active_indices(system: System) -> list[int]:
    """Return the indices in q of the independent joints, in the order of `system.independent`.

    Args:
        system: open or closed.

    Raises:
        ModelError: an independent velocity is not the derivative of one position.
    """
    links, indices = system.tree.links, []
    for k in system.independent:
        link = next(link for link in links if link.v.start <= k < link.v.stop)
        if link.motion.nq != 1:
            raise ModelError(
                f"{system.name}: {link.name} is a {system.coordinates[link.q.start].kind}, whose"
                " position is not the integral of one velocity; independent joints must be"
                " revolute or prismatic"
            )
        indices.append(link.q.start)
    return indices


def configuration_of(system: System, q_a: MX) -> MX:
    """Return the positions (nq, 1) that close the loops, in closed form or by continuation.

    Args:
        system: open or closed, at the default values of its parameters.
        q_a: (m, 1) positions of the independent joints.
    """
    if not system.is_closed:
        return q_a
    p = DM(system.parameter_values())
    if is_explicit(system):
        inputs = [q_a, p] if system.parameters else [q_a]
        return _unwrapped_configuration(system, MX(Function.__call__(closed_form(system), *inputs)))
    return MX(follow_active(system)(q_a, p))


def _unwrapped_configuration(system: System, q: MX) -> MX:
    """Shift the passive angles in q (nq, 1) by full turns, to within half a turn of the assembly.

    Closed forms return angles between -pi and pi, which would jump within a motion.
    """
    indices, rows = active_indices(system), casadi.vertsplit(q)
    for k, coordinate in enumerate(system.coordinates):
        if coordinate.unit == "rad" and k not in indices:
            turned = rows[k] - system.configuration[k]
            rows[k] = system.configuration[k] + casadi.atan2(casadi.sin(turned), casadi.cos(turned))
    return MX(casadi.vertcat(*rows))


def motion_function(model: Any) -> Function:
    """Return a model as a Function of the motion only, with parameters at their default values.

    Args:
        model: model of a system with the inputs q, v, a (or fewer), followed by z, u and p.

    Raises:
        ModelError: the model depends on states or inputs of components.
    """
    system: System = model.system
    own = {name: model.name_in().index(name) for name in "zup" if name in model.name_in()}
    if own.keys() & {"z", "u"}:
        names = [name for name, _ in (*system.states, *system.inputs)]
        raise ModelError(
            f"{system.name}: its equations depend on states or inputs of components"
            f" ({', '.join(names)}), which no record of a motion holds; identify the mechanism"
            " without these components, and take their forces from the efforts"
        )
    if not own:
        return Function(model)
    motion = [MX.sym(model.name_in(k), model.size_in(k)) for k in range(own["p"])]
    outputs = Function(model).call([*motion, DM(system.parameter_values())])
    names = model.name_in()[: own["p"]]
    return Function(model.name(), motion, outputs, names, model.name_out())


def is_explicit(system: System) -> bool:
    """Whether the positions of all joints follow from the independent joints without iteration.

    True for open systems.

    Args:
        system: open or closed system.
    """
    if not system.is_closed:
        return True
    try:
        closed_form(system)
    except NoClosedForm:
        return False
    return True


def positions(system: System, q_a: Array) -> Array:
    """Return the positions (n, nq) of all joints of the tree that close the loops.

    Rows are NaN if the loops cannot close.

    Args:
        system: open or closed, at the default values of its parameters.
        q_a: (n, m) positions of the independent joints [rad or m].
    """
    if not system.is_closed:
        return q_a
    x = MX.sym("q_a", len(system.independent))
    follow = Function("positions", [x], [configuration_of(system, x)])
    return np.asarray(DM(follow.map(len(q_a))(q_a.T))).T
