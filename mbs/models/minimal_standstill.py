"""What keeps dependent joints at rest that rigid stops or dry friction hold.

A state equation of the independent joints is integrated without any projection. What it holds of
these stays where it is; a dependent joint would creep by the errors of the steps.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi
from casadi import DM, SX

from mbs.assembly import System
from mbs.models.contacts import Contacts
from mbs.models.minimal_motion import TreeMotion

RETURN_RATE = 20.0
"""How fast what is held returns to where it should be [1/s]."""
_SHARED = 1e-6
"""Square that is added to rows: they may depend on others, or vanish."""


def standstill(
    system: System,
    contacts: Contacts,
    motion: TreeMotion,
    wanted: tuple[SX, SX],
    moved: Sequence[int],
) -> SX:
    """A small change of the independent coordinates that changes dependent ones as wanted.

    Independent coordinates that are held do not change, nor do those whose motion is prescribed.

    Args:
        system: open or closed.
        contacts: the k coordinates.
        motion: of the tree.
        wanted: (k, 1) 1 where a coordinate is held, 0 elsewhere; and (k, 1) the changes of what is
            held.
        moved: numbers of the velocities whose motion is prescribed.

    Returns:
        (m, 1) in the order of the independent velocities; changes of positions or of rates.
    """
    active = list(system.active)
    rows = [j for j, number in enumerate(contacts.velocities) if number not in active]
    if not rows or motion.G is None:
        return SX.zeros(len(active))
    held, change = wanted
    may_move = SX.ones(len(active))
    for k, number in enumerate(active):
        if number in moved:
            may_move[k] = 0
        elif number in contacts.velocities:
            may_move[k] = 1 - held[contacts.velocities.index(number)]
    G = motion.G[[contacts.velocities[j] for j in rows], :]
    R = casadi.mtimes(casadi.diag(held[rows]), casadi.mtimes(G, casadi.diag(may_move)))
    S = casadi.mtimes(R, R.T) + casadi.diag(1 - held[rows]) + _SHARED * SX(DM.eye(len(rows)))
    D, LT, order = casadi.ldl(casadi.densify(S))
    shares = casadi.ldl_solve(held[rows] * change[rows], D, LT, order)
    return casadi.densify(casadi.mtimes(R.T, shares))
