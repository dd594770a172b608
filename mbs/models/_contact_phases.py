"""Contact phases: points of a mechanism are fixed on planes, slide on planes or are free.

Each phase has its own Function. The inputs and outputs are the same in all phases; the outputs of a
free point are zero.

Source: Featherstone 2008, sections 8.2 and 11.7; Pfeiffer and Glocker 1996, section 6.2.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import casadi
from casadi import DM, SX, Function

from mbs.assembly import System
from mbs.assembly.model_function import Named, model_function, require_system
from mbs.errors import ModelError
from mbs.loops.configuration import Values
from mbs.models._inverse_dynamics import tree_efforts
from mbs.models.constrained_accelerations import inertia_size, loop_rows
from mbs.models.contacts import require_no_contacts
from mbs.models.dae_phases import (
    ContactPoint,
    PhaseDae,
    PhaseStart,
    PointRows,
    Standing,
    Touching,
    checked_points,
    constrained_elements,
    friction_cone,
    modes_of,
    phase_dae,
    point_rows,
)
from mbs.models.symbols import ModelSymbols, surroundings, symbols_of
from mbs.recursions.composite_body import inertia_matrix
from mbs.solvers.linear import solve_saddle


@dataclass(frozen=True, slots=True)
class ContactPhases:
    """Equations of motion of a mechanism in each contact phase.

    All Functions use tree coordinates. Forces f (3, n) [N] are exerted by the planes on the n
    points, one column per point, in the axes of the planes; the third row is the normal force. A
    "fixed" point has no velocity relative to its plane. A "sliding" point has no normal velocity,
    and no friction acts on it.

    Attributes:
        system: open or closed mechanism.
        points: contact points that may touch their planes.
    """

    system: System
    points: tuple[ContactPoint, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the contact points, in the order of the columns of forces."""
        return tuple(point.name for point in self.points)

    def accelerations(self, touching: Touching = ()) -> Function:
        """Return the forward dynamics in a phase: ``phase(q, v, tau) -> a, f, lam``.

        Solves A a + H = tau + J_f' f + J' lam, with zero acceleration of the touching points in
        their constrained directions. Drift is not corrected. Redundant points, for instance at the
        four corners of a foot, share their forces.

        Args:
            touching: names of the touching points, or a dict from name to "fixed" or "sliding".

        Returns:
            Function of q (nq, 1), v and tau (nv, 1); accelerations a (nv, 1), plane forces f (3, n)
            and, for a closed system, loop efforts lam (r, 1), as in `direct_dynamics(system,
            coordinates="tree")`.

        Raises:
            ModelError: a point or its mode is unknown.
        """
        modes = self._modes(touching)

        def build() -> tuple[Named, Named]:
            s = symbols_of(self.system, "tree")
            tau, rows = SX.sym("tau", s.size), point_rows(self.system, s, self.points)
            H = _efforts(self.system, s, SX.zeros(s.size))
            _, psi = loop_rows(self.system, s)
            a, f, lam = self._solve_constrained(s, rows, modes, (tau - H, -rows.bias, -psi))
            inputs: Named = [("q", s.q), ("v", s.v), ("tau", tau)]
            return inputs, [("a", a), ("f", f), *self._loops("lam", lam)]

        return model_function(self.system, ("phase", self.points, modes), build)

    def residuals(self, touching: Touching = ()) -> Function:
        """Return the implicit equations of motion in a phase.

        They are ``phase_residuals(q, v, a, tau, f, lam) -> motion, contact, loops``.

        The residuals are zero in the phase. They are the equations of `accelerations`, unsolved,
        with as many rows as a, f and lam have elements.

        Args:
            touching: names of the touching points, or a dict from name to "fixed" or "sliding".

        Returns:
            Function of q, v, a, tau, f and, for a closed system, lam. Outputs: motion (nv, 1),
            residual joint efforts [N m or N]; contact (3, n), point acceleration in constrained
            directions [m/s^2] and force in free directions [N]; for a closed system also loops (r,
            1), J a + dJ/dt v.

        Raises:
            ModelError: a point or its mode is unknown.
        """
        modes = self._modes(touching)

        def build() -> tuple[Named, Named]:
            s = symbols_of(self.system, "tree")
            rows, (J, psi) = point_rows(self.system, s, self.points), loop_rows(self.system, s)
            a, tau = SX.sym("a", s.size), SX.sym("tau", s.size)
            f, lam = SX.sym("f", 3, len(self.points)), SX.sym("lam", psi.numel())
            pushed = casadi.mtimes(rows.J.T, casadi.vec(f)) + casadi.mtimes(J.T, lam)
            motion = _efforts(self.system, s, a) - tau - pushed
            constrained = constrained_elements(modes)
            accelerations = constrained * (casadi.mtimes(rows.J, a) + rows.bias)
            contact = (
                casadi.reshape(accelerations, f.shape)
                + casadi.reshape(1 - constrained, f.shape) * f
            )
            loops = casadi.mtimes(J, a) + psi
            inputs: Named = [("q", s.q), ("v", s.v), ("a", a), ("tau", tau), ("f", f)]
            outputs: Named = [("motion", motion), ("contact", contact)]
            return [*inputs, *self._loops("lam", lam)], [*outputs, *self._loops("loops", loops)]

        return model_function(self.system, ("phase_residuals", self.points, modes), build)

    def impact(self, touching: Touching) -> Function:
        """Return the velocities after an inelastic impact: ``touchdown(q, v) -> v_plus, P``.

        Solves A (v_plus - v) = J_f' P + J' Lambda. After the impact the touching points have no
        velocity in their constrained directions (no rebound), and loops stay closed. Leave out of
        `touching` each point that lifts off in this impact, so that no impulse pulls it.

        Args:
            touching: names of the points that touch after the impact, or a dict from name to
                "fixed" or "sliding".

        Returns:
            Function of q (nq, 1) and v (nv, 1) before the impact; v_plus (nv, 1), and impulses P
            (3, n) of the planes on the points [N s].

        Raises:
            ModelError: a point or its mode is unknown.
        """
        modes = self._modes(touching)

        def build() -> tuple[Named, Named]:
            s = symbols_of(self.system, "tree")
            rows, (J, _) = point_rows(self.system, s, self.points), loop_rows(self.system, s)
            asked = SX.zeros(s.size), -rows.V, -casadi.mtimes(J, s.v)
            dv, P, _ = self._solve_constrained(s, rows, modes, asked)
            return [("q", s.q), ("v", s.v)], [("v_plus", s.v + dv), ("P", P)]

        return model_function(self.system, ("touchdown", self.points, modes), build)

    def motion(self) -> Function:
        """Return positions and velocities of the points, in any phase: ``points(q, v) -> r, V``.

        Returns:
            Function of q (nq, 1) and v (nv, 1); positions r (3, n) in the frames of the planes [m]
            (third row: distance from the plane) and their rates V (3, n) [m/s]. A phase must start
            with r[2] = 0 and V = 0 at its fixed points.
        """

        def build() -> tuple[Named, Named]:
            s = symbols_of(self.system, "tree")
            rows, shape = point_rows(self.system, s, self.points), (3, len(self.points))
            r, V = (casadi.reshape(x, shape) for x in (rows.r, rows.V))
            return [("q", s.q), ("v", s.v)], [("r", r), ("V", V)]

        return model_function(self.system, ("points", self.points), build)

    def friction(self, sides: int | None = None) -> Function:
        """Return the friction cone margins: ``cone(f) -> margin``.

        All elements are zero or positive if no contact force pulls and no point slips. For each
        point: f_z and, if the point has a friction coefficient mu, mu^2 f_z^2 - f_x^2 - f_y^2. This
        square is smooth at f = 0. Impulses may replace forces.

        Args:
            sides: number of sides (at least 3) of a friction pyramid inside the cone. It replaces
                the square by one margin per side, linear in f: c mu f_z - (f_x cos + f_y sin), with
                c = cos(pi / sides). None for the cone.

        Returns:
            Function of f (3, n); margin (m, 1).

        Raises:
            ModelError: a pyramid has fewer than three sides.
        """
        return friction_cone(self.system.name, self.points, sides)

    def dae(
        self,
        touching: Touching = (),
        form: str = "reduced",
        *,
        q0: Values = None,
        v0: Values = None,
        tau0: Values = None,
        parameters: Mapping[str, float] | None = None,
    ) -> PhaseDae:
        """Return the differential-algebraic equations of a phase, with rows for contacts and loops.

        x = [q; v] in every form. "reduced" solves for the accelerations and has no z. The other
        forms are as in `mbs.models.dae`, with contact forces in lam. The distance of a touching
        point from its plane is a position constraint. A "fixed" point also has two velocity
        constraints along the plane, like a rolling disc, so that its location on the plane is free.
        Dependent rows are dropped, and their force is zero.

        Args:
            touching: names of the touching points, or a dict from name to "fixed" or "sliding".
            form: "reduced", "index1", "index2", "index3" or "ggl", see `mbs.models.dae`.
            q0: start positions by name, kept exactly. Other positions are moved from the assembled
                configuration until the points touch and the loops close.
            v0: start velocities by name, or all of them; other velocities are minimised.
            tau0: start efforts of motors by name; zero by default.
            parameters: values of symbols at the start; other symbols have their defaults.

        Raises:
            ModelError: a point, mode, form or name is unknown, or the contacts and loops allow no
                motion with the velocities v0.
            Unclosable: no configuration with the positions q0 lets all touching points touch.
        """
        modes, begin = self._modes(touching), PhaseStart(q0, v0, tau0, parameters)
        explicit = self.accelerations(touching)
        return phase_dae(Standing(self.system, self.points, modes), explicit, form, begin)

    def _loops(self, name: str, value: SX) -> Named:
        """Return a list with the input or output `name` for a closed system.

        Empty for an open one.
        """
        return [(name, value)] if self.system.is_closed else []

    def _modes(self, touching: Touching) -> tuple[str, ...]:
        """Return the mode of each point: "fixed", "sliding" or "" if it is free.

        Raise ModelError if a point or a mode in `touching` is unknown.
        """
        return modes_of(self.system.name, self.points, touching)

    def _solve_constrained(
        self, s: ModelSymbols, rows: PointRows, modes: tuple[str, ...], right: tuple[SX, SX, SX]
    ) -> tuple[SX, SX, SX]:
        """Return the solution (x, y, z) of A x = b + J_f' y + J' z, J_f x = d, J x = e.

        A is the mass matrix, J_f the constrained rows of the points, J the closure Jacobian.

        Args:
            s: symbols of the tree.
            rows: motion of the points.
            modes: mode of each point; only rows constrained by it are used, other y are zero.
            right: b, d and e.

        Returns:
            x (nv, 1), y (3, n) and z (r, 1).
        """
        b, d, e = right
        A, (J, _) = inertia_matrix(self.system.tree, s.poses), loop_rows(self.system, s)
        flags = DM(constrained_elements(modes)).elements()
        kept = [k for k, flag in enumerate(flags) if flag]
        # rows that constrain each other share their force
        shared = casadi.densify(SX.zeros(len(kept)))
        x, efforts = solve_saddle(
            A,
            casadi.vertcat(J, rows.J[kept, :]),
            b,
            casadi.vertcat(e, d[kept]),
            inertia_size(self.system, A, s),
            casadi.vertcat(SX(J.shape[0], 1), shared),
        )
        y = SX.zeros(3 * len(self.points))
        y[kept] = efforts[J.shape[0] :]
        return x, casadi.reshape(y, 3, len(self.points)), efforts[: J.shape[0]]


def contact_phases(system: System, points: Iterable[ContactPoint]) -> ContactPhases:
    """Return the equations of a mechanism with intermittent contacts of points with planes.

    Named frames of `Mechanism.add_frame`, on links or on the world, define points and planes. Loops
    of the mechanism stay closed in all phases.

    Source: Featherstone 2008, sections 8.2 and 11.7.

    Args:
        system: open or closed mechanism.
        points: contact points with distinct names.

    Raises:
        ModelError: a frame is unknown, two points have the same name, an element is not a
            ContactPoint, or a point and its plane are on the same link.
    """
    require_system(system)
    require_no_contacts(system, "contact_phases")
    every = checked_points(system.name, points)
    for point in every:
        if system.frame(point.frame)[0] == system.frame(point.plane)[0]:
            raise ModelError(
                f"{system.name}: contact point {point.name!r} and its plane are on the same link;"
                " take a plane of another one, or of the base"
            )
    return ContactPhases(system, every)


def _efforts(system: System, s: ModelSymbols, a: SX) -> SX:
    """Return the joint efforts (nv, 1) of the tree for accelerations a, without contact forces."""
    return tree_efforts(system, s, a, surroundings(system))
