"""What rows of a closure are measured by: lengths by the size of the mechanism, cosines as such.

How far a loop is open says nothing by itself: 1e-6 m is nothing for a crane, and 1 % of a link of
100 um.
"""

from __future__ import annotations

import casadi
import numpy as np
from casadi import SX, Function

from mbs.assembly import System
from mbs.assembly.rates import norm_rows, quaternion_slices
from mbs.loops.closure import closure_rows, row_labels
from mbs.loops.rolling import SLIPS, rolling_discs

_ROUNDING = 1e-9
"""Length [m] below which levers are rounding, which is 1e-13 of a mechanism of 1 km."""
_SAMPLES, _SEED = 3, 20260201
"""Postures at which levers are measured, the zero posture among them."""


def mechanism_size(system: System) -> SX:
    """The longest lever by which an angle moves the ends of a loop, or their largest distance [m].

    It is taken at some postures, always the same and open as a rule, so that it is known before a
    loop is closed; 1 m where nothing tells a small mechanism from a large one.

    Returns:
        (1, 1) expression of the parameters p.
    """

    def build() -> SX:
        places = [k for k, is_length in enumerate(_lengths(system)) if is_length]
        if not places:
            return SX(1)
        q = SX.sym("q", system.nq)
        rows = closure_rows(system, q)[places]
        turns = [k for k, c in enumerate(system.coordinates) if not c.unit.startswith("m")]
        levers = casadi.jacobian(rows, q)[:, turns]
        lengths = casadi.vertcat(rows, casadi.vec(levers.nz[:])) if levers.nnz() else rows
        found = Function("lengths", [q, system.p], [lengths])
        every = casadi.vertcat(*(found(posture, system.p) for posture in _postures(system)))
        size = SX(casadi.mmax(casadi.fabs(every)))
        # around the centre of a sphere levers are rounding
        return SX(casadi.if_else(size > _ROUNDING, size, 1))

    size: SX = system.cached("mechanism size", build)
    return size


def row_sizes(system: System) -> SX:
    """(m, 1) what each closure row is measured by [m or 1], as a function of p."""
    size = mechanism_size(system)
    return casadi.vertcat(SX(0, 1), *(size if own else SX(1) for own in _lengths(system)))


def constraint_sizes(system: System) -> SX:
    """(m, 1) the same of the rows of J: those of the closure, then slips of discs [m or 1]."""
    slips = len(SLIPS) * sum(1 for _ in rolling_discs(system))
    return casadi.vertcat(row_sizes(system), *(mechanism_size(system) for _ in range(slips)))


def relative_rows(system: System, q: SX) -> SX:
    """(m + k, 1) closure rows as parts of what they are measured by, then norms of quaternions."""
    return casadi.vertcat(closure_rows(system, q) / row_sizes(system), norm_rows(system.tree, q))


def _lengths(system: System) -> list[bool]:
    """Whether each closure row is a length."""
    driven = iter(system.coordinates[coupling.driven].unit for coupling in system.couplings)
    return [
        next(driven).startswith("m") if label == "coordinate" else label.startswith("force")
        for _, labels in row_labels(system)
        for label in labels
    ]


def _postures(system: System) -> list[list[float]]:
    """The zero posture and random ones; displacements are zero, quaternions of unit length."""
    rng, postures = np.random.default_rng(_SEED), list[list[float]]()
    for number in range(_SAMPLES):
        reach = np.pi if number else 0.0
        q = [
            0.0 if c.unit.startswith("m") else float(rng.uniform(-reach, reach))
            for c in system.coordinates
        ]
        for part in quaternion_slices(system.tree):
            q[part] = [1.0, 0.0, 0.0, 0.0]
        postures.append(q)
    return postures
