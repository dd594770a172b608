"""What loops ask of a motion, on the levels of positions, velocities and accelerations."""

from __future__ import annotations

from dataclasses import dataclass

import casadi
from casadi import SX

from mbs.assembly import System
from mbs.assembly.rates import norm_rows
from mbs.loops.closure import independent_closure
from mbs.loops.velocity import acceleration_bias, independent_constraint_rows


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """The independent rows of a system; all are zero along every motion.

    Attributes:
        J: (r, nv), the efforts of the rows act along its lines; those of rows that bind positions
            come first.
        positions: (s, 1) rows phi(q) that bind positions, s <= r [m or 1].
        velocities: (r, 1) J v.
        accelerations: (r, 1) J a + dJ/dt v.
        norms: one element a quaternion, its squared length less one.
    """

    J: SX
    positions: SX
    velocities: SX
    accelerations: SX
    norms: SX

    @property
    def deepest(self) -> SX:
        """(r, 1) every row on the lowest level that it has: positions, else velocities."""
        return casadi.vertcat(self.positions, self.velocities[self.positions.numel() :])

    @property
    def J_positions(self) -> SX:
        """(s, nv) the lines of J that belong to rows that bind positions."""
        return self.J[: self.positions.numel(), :]

    def joined(self, other: Rows) -> Rows:
        """These rows and others of the same system; of each kind these come first."""
        s, t = self.positions.numel(), other.positions.numel()

        def both(mine: SX, theirs: SX) -> SX:
            return casadi.vertcat(mine[:s, :], theirs[:t, :], mine[s:, :], theirs[t:, :])

        return Rows(
            J=both(self.J, other.J),
            positions=casadi.vertcat(self.positions, other.positions),
            velocities=both(self.velocities, other.velocities),
            accelerations=both(self.accelerations, other.accelerations),
            norms=self.norms,
        )


def rows_of(system: System, q: SX, v: SX, a: SX) -> Rows:
    """The independent rows at the symbols q (nq, 1), v (nv, 1), a (nv, 1)."""
    phi, J = SX(0, 1), SX(0, system.nv)
    if system.is_closed:
        phi, J = independent_closure(system, q), independent_constraint_rows(system, q)
    return Rows(
        J=J,
        positions=phi,
        velocities=casadi.mtimes(J, v),
        accelerations=casadi.mtimes(J, a) + acceleration_bias(system, q, v, J),
        norms=norm_rows(system.tree, q),
    )
