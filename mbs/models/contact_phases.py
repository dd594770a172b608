"""Phases of motion in which points of a mechanism stand on planes, slide on them or are free.

Every phase has the same inputs and outputs: what a point that is free gives is zero. So a phase
is chosen by the Function that is called, never by a state.

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
from mbs.models.inverse_dynamics import tree_efforts
from mbs.models.symbols import ModelSymbols, surroundings, symbols_of
from mbs.recursions.composite_body import inertia_matrix
from mbs.solvers.linear import solve_saddle


@dataclass(frozen=True, slots=True)
class ContactPhases:
    """The equations of a mechanism in each of its phases.

    All Functions are in tree coordinates. Forces f (3, n) [N] are those that the planes exert on
    the points, in the axes of the planes: a column for each point, the third of a column the one
    that presses. A point that is "fixed" keeps its velocity in its plane at zero, one that is
    "sliding" that along z alone and meets no friction.

    Attributes:
        system: open or closed.
        points: what may touch.
    """

    system: System
    points: tuple[ContactPoint, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Of the points."""
        return tuple(point.name for point in self.points)

    def accelerations(self, touching: Touching = ()) -> Function:
        """``phase(q, v, tau) -> a, f, lam``: accelerations, forces of planes, efforts of loops.

        A a + H = tau + J_f' f + J' lam, and the points that touch have no acceleration where they
        are constrained. Nothing pulls back what has drifted. Points that constrain each other, such
        as four corners of one foot, share their forces.

        Args:
            touching: the points that do.

        Returns:
            Function of q (nq, 1), v and tau (nv, 1); a (nv, 1), f (3, n), and of a closed system
            lam (r, 1), as of `direct_dynamics(system, coordinates="tree")`.

        Raises:
            ModelError: there is no such point, or a point touches in no known mode.
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
        """``phase_residuals(q, v, a, tau, f, lam) -> motion, contact, loops``: zero in the phase.

        The equations of `accelerations`, nothing solved: as many as a, f and lam have elements.

        Args:
            touching: the points that do.

        Returns:
            Function of q, v, a, tau, f and, of a closed system, lam; motion (nv, 1) efforts that
            are missing [N m or N]; contact (3, n), the acceleration of a point where it is
            constrained [m/s^2], its force where it is free [N]; loops (r, 1), J a + dJ/dt v.

        Raises:
            ModelError: as of `accelerations`.
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
        """``touchdown(q, v) -> v_plus, P``: velocities after the points have landed for good.

        A (v_plus - v) = J_f' P + J' Lambda: the points that touch then have no velocity where they
        are constrained, loops stay closed, and nothing rebounds. A point that touched before and is
        to leave without being pulled is not among those that touch.

        Args:
            touching: the points that do after it.

        Returns:
            Function of q (nq, 1) and v (nv, 1) before; v_plus (nv, 1), and impulses P (3, n) of the
            planes on the points [N s].

        Raises:
            ModelError: as of `accelerations`.
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
        """``points(q, v) -> r, V``: where the points are and how they move, in every phase alike.

        Returns:
            Function of q (nq, 1) and v (nv, 1); positions r (3, n) in the frames of the planes, the
            third row the distances from them [m], and their rates V (3, n) [m/s]. These are what a
            phase must start with: r[2] = 0 and V = 0 of the points that stand.
        """

        def build() -> tuple[Named, Named]:
            s = symbols_of(self.system, "tree")
            rows, shape = point_rows(self.system, s, self.points), (3, len(self.points))
            r, V = (casadi.reshape(x, shape) for x in (rows.r, rows.V))
            return [("q", s.q), ("v", s.v)], [("r", r), ("V", V)]

        return model_function(self.system, ("points", self.points), build)

    def friction(self, sides: int | None = None) -> Function:
        """``cone(f) -> margin``: elements of zero or more where nothing pulls and nothing slips.

        For each point f_z, then, where it has a coefficient mu, mu^2 f_z^2 - f_x^2 - f_y^2. That
        is smooth at f = 0, where the slope of the cone itself is not determined. It serves for
        impulses too.

        Args:
            sides: of a pyramid within the cone, three or more: instead of the square, for each side
                c mu f_z - (f_x cos + f_y sin), linear in f, with c = cos(pi / sides).

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
        """The phase as differential-algebraic equations; points that touch are rows like loops.

        x = [q; v] in every form. "reduced" is `accelerations`, without z; the others are those of
        `mbs.models.dae`: lam has the forces of the rows. A point that touches binds its distance
        from the plane, one that is "fixed" its velocity along the plane too, as a rolling disc
        does: where it stands is not asked for, so that the equations are those of every place.
        Rows that depend on others are left out, and have no force.

        Args:
            touching: the points that do.
            form: one of the five words of `mbs.models.dae`.
            q0: positions at the start by name, which are kept; the others move from the assembled
                configuration as little as the points and the loops need.
            v0: velocities at the start by name, or all of them; the others are the smallest.
            tau0: efforts of motors at the start by name, the others zero.
            parameters: values of symbols at the start, the others at their defaults.

        Raises:
            ModelError: as of `accelerations` and `mbs.models.dae`; or the points allow no motion
                with the velocities v0.
            Unclosable: no configuration with the positions q0 lets all of them touch.
        """
        modes, begin = self._modes(touching), PhaseStart(q0, v0, tau0, parameters)
        explicit = self.accelerations(touching)
        return phase_dae(Standing(self.system, self.points, modes), explicit, form, begin)

    def _loops(self, name: str, value: SX) -> Named:
        """An input or output that only closed systems have."""
        return [(name, value)] if self.system.is_closed else []

    def _modes(self, touching: Touching) -> tuple[str, ...]:
        """Of each point how it touches."""
        return modes_of(self.system.name, self.points, touching)

    def _solve_constrained(
        self, s: ModelSymbols, rows: PointRows, modes: tuple[str, ...], right: tuple[SX, SX, SX]
    ) -> tuple[SX, SX, SX]:
        """The x, y and z of A x = b + J_f' y + J' z, J_f x = d, J x = e.

        Args:
            s: symbols of the tree.
            rows: of the points.
            modes: of each point how it touches; the other rows have no part.
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
    """The equations of a mechanism whose points touch planes in some phases and not in others.

    Frames that `Mechanism.add_frame` names serve as points and as planes, on links and on the
    world. Loops of the mechanism stay closed in all phases.

    Args:
        system: open or closed.
        points: each with a name of its own.

    Raises:
        ModelError: there is no such frame, two points have one name, something is no point, or a
            point and its plane are on the same link.
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
    return tree_efforts(system, s, a, surroundings(system))
