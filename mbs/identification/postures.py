"""Postures of all joints from the positions of the independent ones."""

from __future__ import annotations

import casadi
import numpy as np
import numpy.typing as npt
from casadi import DM, MX, Function

from mbs.assembly import System
from mbs.errors import ModelError, NoClosedForm
from mbs.loops.function import function as closed_form
from mbs.loops.numeric import follow_active

Array = npt.NDArray[np.float64]


def active_places(system: System) -> list[int]:
    """Places in q of the independent joints, in the order of `system.active`.

    Raises:
        ModelError: an independent velocity is not the rate of one position.
    """
    links, places = system.tree.links, []
    for k in system.active:
        link = next(link for link in links if link.v.start <= k < link.v.stop)
        if link.motion.nq != 1:
            raise ModelError(
                f"{system.name}: {link.name} is a {system.coordinates[link.q.start].kind}, whose"
                " position is not the integral of one velocity; independent joints must be"
                " revolute or prismatic"
            )
        places.append(link.q.start)
    return places


def posture_of(system: System, q_a: MX) -> MX:
    """(nq, 1) positions that close the loops, by closed form or else by continuation.

    Args:
        system: open or closed, at the defaults of its parameters.
        q_a: (m, 1) positions of the independent joints.
    """
    if not system.is_closed:
        return q_a
    p = DM(system.parameter_values())
    if is_explicit(system):
        inputs = [q_a, p] if system.parameters else [q_a]
        return _near_posture(system, MX(Function.__call__(closed_form(system), *inputs)))
    return MX(follow_active(system)(q_a, p))


def _near_posture(system: System, q: MX) -> MX:
    """The same posture, angles that follow less than half a turn from the assembled ones.

    Closed forms give angles between -pi and pi, which would jump within a motion.
    """
    places, rows = active_places(system), casadi.vertsplit(q)
    for k, coordinate in enumerate(system.coordinates):
        if coordinate.unit == "rad" and k not in places:
            turned = rows[k] - system.posture[k]
            rows[k] = system.posture[k] + casadi.atan2(casadi.sin(turned), casadi.cos(turned))
    return MX(casadi.vertcat(*rows))


def is_explicit(system: System) -> bool:
    """Whether no iteration is needed to close the loops."""
    if not system.is_closed:
        return True
    try:
        closed_form(system)
    except NoClosedForm:
        return False
    return True


def positions(system: System, q_a: Array) -> Array:
    """(n, nq) positions of the tree for independent ones (n, m), NaN where loops cannot close."""
    if not system.is_closed:
        return q_a
    x = MX.sym("q_a", len(system.active))
    follow = Function("positions", [x], [posture_of(system, x)])
    return np.asarray(DM(follow.map(len(q_a))(q_a.T))).T
