"""Differential-algebraic equations of a mechanism while some of its points touch planes."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from numbers import Real
from typing import Any, ClassVar

import casadi
import numpy as np
from casadi import DM, SX, Function
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.assembly.tree import norm_rows, position_rate
from mbs.assembly.variable_names import POSITIONS
from mbs.components.custom import RelativeMotion
from mbs.errors import ModelError, Unclosable
from mbs.loops.closure_equations import closure_rows
from mbs.loops.configuration import Values, smallest_velocity
from mbs.loops.velocity import acceleration_bias, constraint_drift, constraint_rows, kept_rows
from mbs.models._dae import (
    FORMS,
    ConstraintRows,
    Dae,
    DaeEquations,
    Elements,
    Rows,
    driving,
    elements_of,
    equations,
    implicit,
    motors,
    require_no_later,
    rows_of,
    start_efforts,
)
from mbs.models._inverse_dynamics import tree_efforts
from mbs.models.symbols import ModelSymbols, outputs_of, surroundings, symbols_of
from mbs.recursions.composite_body import inertia_matrix
from mbs.recursions.link_motions import link_accelerations, link_velocities, resting_base
from mbs.recursions.route import relative_acceleration, relative_motion
from mbs.solvers.least_squares import gauss_newton
from mbs.solvers.rank import independent_rows, rank
from mbs.spatial import zeros
from mbs.text import did_you_mean, quoted

# Contact points on links: definition, motion relative to their planes, friction cone.


Touching = Iterable[str] | Mapping[str, str]
"""Names of fixed contact points, or a mapping from names to "fixed" or "sliding"."""

MODES = ("fixed", "sliding")


@dataclass(frozen=True, slots=True)
class ContactPoint:
    """Contact point: origin of a frame that may touch the x, y plane of another frame from above.

    Attributes:
        name: name of the contact.
        frame: frame of the point: name of a body or frame, or index of a link.
        plane: frame of the plane: name of a body or frame, or index of a link, 0 for the base. Its
            z axis points from the ground to the point.
        friction: coefficient of Coulomb friction; None if the point never slips.
    """

    name: str
    frame: str | int
    plane: str | int = 0
    friction: float | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name:
            raise ModelError(
                f"contact point {quoted(self.name)}: the name is not a text; give it a name"
            )
        mu = self.friction
        if mu is None:
            return
        if isinstance(mu, bool) or not isinstance(mu, Real) or not 0 <= mu < math.inf:
            raise ModelError(
                f"{quoted(self.name)}: friction is {quoted(mu)}; give a coefficient of zero or"
                " more, or None"
            )
        object.__setattr__(self, "friction", float(mu))


@dataclass(frozen=True, slots=True, eq=False)
class PointRows:
    """Motion of n contact points relative to their planes, in the axes of the planes.

    Attributes:
        r: (3 n, 1) positions [m]; the third element of each point is its distance from the plane.
        V: (3 n, 1) velocities [m/s].
        J: (3 n, nv) Jacobian, V = J v; point forces f act on the joints as J' f.
        bias: (3 n, 1) accelerations for zero joint accelerations [m/s^2].
    """

    r: SX
    V: SX
    J: SX
    bias: SX


def point_rows(system: System, s: ModelSymbols, points: Sequence[ContactPoint]) -> PointRows:
    """Return positions, velocities, Jacobian and bias accelerations of contact points.

    Args:
        system: open or closed mechanism.
        s: symbols of the system, in tree coordinates.
        points: one or more contact points.

    Raises:
        ModelError: a frame is unknown.
    """
    tree = system.tree
    moving = link_velocities(tree, s.poses, s.v)
    rest = SX.zeros(system.nv)
    drifting = link_accelerations(tree, s.poses, s.v, rest, resting_base(zeros()))
    seen: list[RelativeMotion] = []
    bias: list[SX] = []
    for point in points:
        plane, frame = system.frame(point.plane), system.frame(point.frame)
        motion = relative_motion(tree, plane, frame, s.q, moving)
        seen.append(motion)
        bias.append(relative_acceleration(motion, plane, frame, drifting).A)
    V = casadi.densify(casadi.vertcat(*(motion.V for motion in seen)))
    r = casadi.densify(casadi.vertcat(*(motion.p for motion in seen)))
    return PointRows(r, V, casadi.jacobian(V, s.v), casadi.densify(casadi.vertcat(*bias)))


def constrained_elements(modes: Sequence[str]) -> DM:
    """Return flags (3 n, 1): 1 for each point coordinate that the plane constrains, else 0.

    The coordinates of each point are x, y, z.

    Args:
        modes: mode of each point: "fixed", "sliding" or "" if it is free.
    """
    constrained = {"fixed": (1, 1, 1), "sliding": (0, 0, 1), "": (0, 0, 0)}
    return DM([element for mode in modes for element in constrained[mode]])


def checked_points(name: str, points: Iterable[ContactPoint]) -> tuple[ContactPoint, ...]:
    """Return contact points as a tuple after checking their type and names.

    Args:
        name: name of the mechanism, for error messages.
        points: contact points.

    Raises:
        ModelError: there are no points, two points have the same name, or an element is not a
            ContactPoint.
    """
    every = tuple(points) if isinstance(points, Iterable) else (points,)
    for point in every:
        if not isinstance(point, ContactPoint):
            raise ModelError(
                f"{name}: {quoted(point)} is no contact point; give ContactPoint(name, frame)"
            )
    names = [point.name for point in every]
    if not every or len(set(names)) < len(names):
        raise ModelError(
            f"{name}: the contact points are {', '.join(names) or 'none'}; give one or more, each a"
            " name of its own"
        )
    return every


def modes_of(name: str, points: Sequence[ContactPoint], touching: Touching) -> tuple[str, ...]:
    """Return the mode of each point: "fixed", "sliding" or "" if it is free.

    Args:
        name: name of the mechanism, for error messages.
        points: all contact points.
        touching: names of fixed points, or a mapping from names to modes.

    Raises:
        ModelError: a point is unknown or repeated, or its mode is unknown.
    """
    names = [point.name for point in points]
    given = _modes_by_name(name, touching)
    for point, mode in given.items():
        if point not in names:
            raise ModelError(
                f"{name}: there is no contact point {quoted(point)}; "
                + did_you_mean(str(point), names)
            )
        if mode not in MODES:
            raise ModelError(
                f"{name}: point {point!r} touches {quoted(mode)}; use 'fixed' or 'sliding', or"
                " leave it out"
            )
    return tuple(given.get(point, "") for point in names)


def _modes_by_name(name: str, touching: Touching) -> dict[str, str]:
    """Return the mode of each touching point by name; "fixed" if no mode is given.

    Raise ModelError, with the mechanism `name`, if a point is repeated.
    """
    if isinstance(touching, Mapping):
        return dict(touching)
    alone = isinstance(touching, str) or not isinstance(touching, Iterable)
    standing = [str(point) for point in ([touching] if alone else touching)]
    if len(set(standing)) < len(standing):
        raise ModelError(f"{name}: the points that touch are {', '.join(standing)}; name each once")
    return dict.fromkeys(standing, "fixed")


def friction_cone(name: str, points: Sequence[ContactPoint], sides: int | None) -> Function:
    """Return the friction cone margins ``cone(f) -> margin``; see `ContactPhases.friction`.

    Args:
        name: name of the mechanism, for error messages.
        points: n contact points, one column of f (3, n) each.
        sides: number of sides of a friction pyramid, None for the cone.

    Raises:
        ModelError: a pyramid has fewer than three sides.
    """
    if sides is not None and (isinstance(sides, bool) or sides not in range(3, 1000)):
        raise ModelError(
            f"{name}: sides is {quoted(sides)}; give a number of sides from 3, or None for the cone"
        )
    f = SX.sym("f", 3, len(points))
    margins = [
        casadi.vertcat(f[2, k], _cone_margin(f[:, k], point.friction, sides))
        for k, point in enumerate(points)
    ]
    return Function("cone", [f], [casadi.densify(casadi.vertcat(*margins))], ["f"], ["margin"])


def _cone_margin(f: SX, friction: float | None, sides: int | None) -> SX:
    """Return the margin of a contact force f (3, 1) to its friction cone.

    With a pyramid, it is one margin per side. Empty (0, 1) without a friction coefficient.
    """
    if friction is None:
        return SX(0, 1)
    if sides is None:
        return (friction * f[2]) ** 2 - f[0] ** 2 - f[1] ** 2
    turns = 2 * casadi.pi / sides * casadi.DM(range(sides))
    reach = casadi.cos(casadi.pi / sides) * friction * f[2]
    return reach - casadi.cos(turns) * f[0] - casadi.sin(turns) * f[1]


# Contact constraints as additional rows next to the loop rows, and a consistent start.


Array = NDArray[np.float64]

_CONFIGURATIONS, _REACH, _SEED = 4, 0.05, 20
"""Number of random configurations near the start that detect dependent rows, their largest
displacement [rad or m], which stays near the start, and the seed, for repeatable results."""
_OFF = 1e-10
"""Rounding tolerance on the distances and loop closure of a start configuration [m]."""


@dataclass(frozen=True, slots=True)
class PhaseStart:
    """Start of a phase as passed by the user; see the arguments of `ContactPhases.dae`."""

    q0: Values
    v0: Values
    tau0: Values
    parameters: Mapping[str, float] | None


@dataclass(frozen=True, slots=True)
class Standing:
    """Contact points of a system with the mode of each point in one phase.

    Attributes:
        system: open or closed mechanism.
        points: all contact points.
        modes: mode of each point: "fixed", "sliding" or "" if it is free.
    """

    system: System
    points: tuple[ContactPoint, ...]
    modes: tuple[str, ...]

    @property
    def constrained(self) -> list[int]:
        """Indices of the constrained elements among the coordinates x, y, z of all points."""
        flags = constrained_elements(self.modes).elements()
        return [k for k, flag in enumerate(flags) if flag]

    @property
    def names(self) -> str:
        """Names of the touching points, joined by commas."""
        return ", ".join(p.name for p, mode in zip(self.points, self.modes, strict=True) if mode)

    def rows(self, kept: tuple[int, ...]) -> ConstraintRows:
        """Return a callable (symbols, accelerations) -> constraint rows of point coordinates.

        Distances are position constraints and come first. Coordinates in the plane are velocity
        constraints.

        Args:
            kept: indices of the point coordinates, see `constrained`.
        """
        distances, drifts = split(kept)
        order = [*distances, *drifts]

        def rows(s: ModelSymbols, a: SX) -> Rows:
            found = point_rows(self.system, s, self.points)
            J = found.J[order, :]
            return Rows(
                J=J,
                positions=found.r[distances],
                velocities=casadi.mtimes(J, s.v),
                accelerations=casadi.mtimes(J, a) + found.bias[order],
                norms=SX(0, 1),
            )

        return rows

    def elements(self, kept: tuple[int, ...]) -> tuple[Elements, Elements]:
        """Return (name, unit) of the position constraints, and of the velocity constraints.

        Args:
            kept: indices of the point coordinates, see `constrained`.
        """
        distances, drifts = (
            tuple((f"{self.points[k // 3].name}: {'xyz'[k % 3]}", "m") for k in part)
            for part in split(kept)
        )
        return distances, drifts

    def independent(self, q: Array, p: Array) -> tuple[int, ...]:
        """Return the indices of constrained point coordinates that are independent.

        They are independent of each other and of the loops. The rank is the largest rank near q.
        Rows that are dependent only at q, for instance at a straight leg, are kept.

        Args:
            q: (nq,) start positions.
            p: (np,) parameters.
        """
        constrained, loops = self.constrained, kept_rows(self.system)
        numbers = _phase_terms(self)
        matrices = []
        for configuration in self._nearby_closed(q, p):
            _, _, J_loops, _, J, _ = (np.array(x) for x in numbers(configuration, 0 * q[:1], p))
            matrices.append(np.vstack([J_loops[loops], J[constrained]]))
        ranks = [rank(matrix) for matrix in matrices]
        best = [m for m, r in zip(matrices, ranks, strict=True) if r == max(ranks)]
        first = tuple(range(len(loops)))
        chosen = independent_rows(best, max(ranks), first)
        return tuple(constrained[k - len(loops)] for k in chosen if k >= len(loops))

    def _nearby_closed(self, q: Array, p: Array) -> Iterator[Array]:
        """Yield q (nq,), then nearby configurations that satisfy the contacts and the loops."""
        yield q
        rng, function = np.random.default_rng(_SEED), _touch_residuals(self)

        def residual(x: Array) -> tuple[Array, Array]:
            return _pair(function(x, p))

        for _ in range(_CONFIGURATIONS):
            root = gauss_newton(residual, q + rng.uniform(-_REACH, _REACH, len(q)))
            if root.converged:
                yield root.x

    def start(self, begin: PhaseStart) -> tuple[Array, Array]:
        """Return positions (nq,) and velocities (nv,) that satisfy contacts and loops.

        Args:
            begin: start values of the user.

        Raises:
            Unclosable: no configuration with the given positions satisfies the contacts.
            ModelError: a name is unknown, or the given velocities violate the constraints.
        """
        system = self.system
        p = np.array(system.parameter_values(begin.parameters), dtype=float)
        q, names = np.array(system.position(begin.q0)), [c.name for c in system.coordinates]
        q0 = system.plain_names({} if begin.q0 is None else begin.q0, POSITIONS)
        given = q0 if isinstance(q0, Mapping) else names
        free = [k for k, name in enumerate(names) if name not in given]
        function = _touch_residuals(self)

        def residual(x: Array) -> tuple[Array, Array]:
            r, J = _pair(function(_with_values(q, free, x), p))
            return r, J[:, free]

        if free:
            q = _with_values(q, free, gauss_newton(residual, q[free]).x)
        missing = _pair(function(q, p))[0]
        if np.abs(missing).max(initial=0) > _OFF:
            raise Unclosable(
                f"{system.name}: no configuration near the start lets {self.names or 'no point'}"
                " touch,"
                f" {np.abs(missing).max():.2g} m is missing; give fewer positions in q0"
            )
        return q, self._velocity(q, p, begin.v0)

    def _velocity(self, q: Array, p: Array, v0: Values) -> Array:
        """Return the smallest velocities (nv,) that satisfy loops and contacts and agree with v0.

        v0 are velocities by name or all of them. Raise ModelError if they are not possible.
        """
        _, _, J_loops, _, J, _ = (np.array(x) for x in _phase_terms(self)(q, np.zeros(1), p))
        rows = np.vstack([J_loops, J[self.constrained]])
        v, missed = smallest_velocity(self.system, rows, v0)
        if missed:
            raise ModelError(
                f"{self.system.name}: {self.names or 'the loops'} allow no motion with the"
                f" velocities {missed}; give fewer of them, or take those after `impact`"
            )
        return v

    def efforts(
        self, kept: tuple[int, ...], motion: tuple[Array, Array], tau: Array, p: Array
    ) -> Array:
        """Return the initial [a; lam] of form "index1": accelerations and row efforts.

        Args:
            kept: indices of the point coordinates whose rows are kept.
            motion: positions (nq,) and velocities (nv,).
            tau: (nv,) joint efforts.
            p: (np,) parameters.

        Raises:
            ModelError: the equations are contradictory at this configuration, such as with a
                straight leg.
        """
        q, v = motion
        distances, drifts = split(kept)
        s = len(self.system.closure.rows) if self.system.closure else 0
        A, H, J_loops, psi, J, bias = (np.array(x) for x in _phase_terms(self)(q, v, p))
        loops = kept_rows(self.system)
        J_loops, psi = J_loops[loops], psi[loops]
        rows = np.vstack([J_loops[:s], J[distances], J_loops[s:], J[drifts]])
        slopes = np.vstack([psi[:s], bias[distances], psi[s:], bias[drifts]])
        r = len(rows)
        K = np.block([[A, -rows.T], [rows, np.zeros((r, r))]])
        right = np.concatenate([tau - H.ravel(), -slopes.ravel()])
        found: Array = np.linalg.lstsq(K, right, rcond=None)[0]
        # relative residual: of order one for contradictory equations, of rounding size for
        # consistent equations, even if they are dependent
        if not np.allclose(K @ found, right, rtol=1e-8, atol=1e-8 * np.abs(right).max(initial=1)):
            raise ModelError(
                f"{self.system.name}: the forces on {self.names} are not determined at the start,"
                " where some of them move nothing; bend what is straight there, by q0"
            )
        return found


def split(kept: tuple[int, ...]) -> tuple[list[int], list[int]]:
    """Return the indices of distances (z) and of coordinates in the plane (x, y).

    Args:
        kept: indices of point coordinates, three per point.
    """
    return [k for k in kept if k % 3 == 2], [k for k in kept if k % 3 != 2]


def _phase_terms(standing: Standing) -> Function:
    """Return ``numbers(q, v, p) -> A, H, J_loops, psi, J, bias``, with all rows.

    Outputs: mass matrix, bias efforts, Jacobian and acceleration bias of loops and of points.
    """
    system = standing.system

    def build() -> Function:
        s = symbols_of(system, "tree")
        rows = point_rows(system, s, standing.points)
        J, psi = SX(0, system.nv), SX(0, 1)
        if system.is_closed:
            J = constraint_rows(system, s.q)
            psi = acceleration_bias(system, s.q, s.v, J, constraint_drift(system, s.q))
        A = inertia_matrix(system.tree, s.poses)
        H = tree_efforts(system, s, SX.zeros(system.nv), surroundings(system))
        outputs = [casadi.densify(x) for x in (A, H, J, psi, rows.J, rows.bias)]
        outputs = with_starts(system, outputs)
        return Function("numbers", [s.q, s.v, system.p], outputs, {"cse": True})

    function: Function = system.cached(("standing", standing.points), build)
    return function


def with_starts(system: System, values: Sequence[SX]) -> list[SX]:
    """Return expressions with start values of component states and default component inputs.

    Args:
        system: open or closed mechanism.
        values: expressions that may contain `system.component_states` and `system.u`.
    """
    signals = casadi.vertcat(system.component_states, system.u)
    if not signals.numel():
        return list(values)
    numbers = SX(DM([*system.component_start, *system.u_default]))
    return [SX(value) for value in casadi.substitute(list(values), [signals], [numbers])]


def _touch_residuals(standing: Standing) -> Function:
    """Return ``touching(q, p) -> r, J``: residuals of contacts, quaternions and loops.

    r is zero if the points touch, quaternions have unit norm and loops close. J is dr/dq.
    """
    system = standing.system

    def build() -> Function:
        s = symbols_of(system, "tree")
        distances = split(tuple(standing.constrained))[0]
        rows = [point_rows(system, s, standing.points).r[distances], norm_rows(system.tree, s.q)]
        if system.is_closed:
            rows.append(closure_rows(system, s.q))
        r = casadi.densify(casadi.vertcat(*rows))
        J = casadi.densify(casadi.jacobian(r, s.q))
        return Function("touching", [s.q, system.p], [r, J], {"cse": True})

    function: Function = system.cached(("touching", standing.points, standing.modes), build)
    return function


def _pair(results: Any) -> tuple[Array, Array]:
    """Return a residual (m,) and its derivative (m, n) as NumPy arrays."""
    r, J = results
    return np.array(r).ravel(), np.array(J)


def _with_values(q: Array, places: list[int], values: Array) -> Array:
    """Return a copy of q with `values` at the indices `places`."""
    result = q.copy()
    result[places] = values
    return result


@dataclass(frozen=True, slots=True, eq=False)
class PhaseDae(Dae):
    """Differential-algebraic equations of a contact phase; see `ContactPhases.dae`.

    Attributes:
        f: (3, n) forces of the planes on the points, in the axes of the planes, as expressions of
            x, z, u and p; zero for free points. It is also the last output of `function`.
    """

    _outputs: ClassVar[tuple[str, ...]] = (*Dae._outputs, "f")
    f: SX


def phase_dae(standing: Standing, explicit: Function, form: str, begin: PhaseStart) -> PhaseDae:
    """Return the differential-algebraic equations of a phase with a consistent start.

    Args:
        standing: contact points and their modes.
        explicit: forward dynamics of the phase, `ContactPhases.accelerations`.
        form: form of the equations, see `mbs.models.dae`.
        begin: start values of the user.

    Raises:
        ModelError: the form is unknown, or the start is not possible.
        Unclosable: no configuration lets all touching points touch.
    """
    system = standing.system
    if form not in FORMS:
        raise ModelError(f"{system.name}: form is {quoted(form)}; use one of {', '.join(FORMS)}")
    tau = start_efforts(system, begin.tau0)
    q, v = standing.start(begin)
    p = np.array(system.parameter_values(begin.parameters), dtype=float)
    kept = standing.independent(q, p)
    made, f, elements = _built(standing, explicit, form, kept)
    parts = {field.name: getattr(made, field.name) for field in fields(made)}
    z0 = np.zeros(made.z.numel())
    if len(z0):
        found = standing.efforts(kept, (q, v), tau, p)
        z0[: len(found)] = found
    return PhaseDae(
        **parts,
        form=form,
        elements=elements,
        x0=np.concatenate([q, v, system.component_start]),
        z0=z0,
        u0=np.concatenate([tau[motors(system)], system.u_default]),
        p0=p,
        f=f,
    )


_Built = tuple[DaeEquations, SX, Mapping[str, Elements]]


def _built(standing: Standing, explicit: Function, form: str, kept: tuple[int, ...]) -> _Built:
    """Return equations, plane forces and named elements of a contact phase; cached.

    Args:
        standing: points in contact and their modes.
        explicit: function of the accelerations of the phase.
        form: form of the DAE.
        kept: indices of the constraint rows that are kept.
    """
    system = standing.system

    def build() -> _Built:
        names = standing.elements(kept)
        if form == "reduced":
            made, f = _explicit_equations(standing, explicit, kept)
            return made, f, elements_of(system, "phase", names)
        made = implicit(system, form, standing.rows(kept))
        return made, _forces(standing, kept, made.z), elements_of(system, form, names)

    key = ("phase dae", standing.points, standing.modes, form, kept)
    built: _Built = system.cached(key, build)
    return built


def _explicit_equations(
    standing: Standing, explicit: Function, kept: tuple[int, ...]
) -> tuple[DaeEquations, SX]:
    """Return explicit equations of a contact phase (no z), and the forces f (3, n) of its planes.

    x is [q; v; component states]. `explicit` is the function of the accelerations of the phase
    `standing`, and `kept` are the indices of its independent constraint rows.
    """
    system = standing.system
    s = symbols_of(system, "tree")
    require_no_later(system)
    u, tau, rates = driving(system, s.q, s.v, resolved=False)
    a, f, *_ = outputs_of(system, explicit, s.q, s.v, tau)
    rows = rows_of(system, s.q, s.v, a).join(standing.rows(kept)(s, a))
    made = equations(
        system,
        states=(casadi.vertcat(s.q, s.v, system.component_states), SX(0, 1), u),
        ode=casadi.vertcat(position_rate(system.tree, s.q, s.v), a, rates),
        alg=SX(0, 1),
        invariants=casadi.vertcat(rows.positions, rows.velocities, rows.norms),
        motion=(s.q, s.v),
    )
    return made, f


def _forces(standing: Standing, kept: tuple[int, ...], z: SX) -> SX:
    """Return the forces (3, n) of the planes on the n points of the phase `standing`.

    They are the elements of lam in z = [a; lam; mu] that belong to the constraint rows `kept`;
    others are zero.
    """
    closure, (distances, drifts) = standing.system.closure, split(kept)
    loops, slips = (len(closure.rows), len(closure.slips)) if closure else (0, 0)
    first = standing.system.nv + loops
    second = first + len(distances) + slips
    f = SX.zeros(3 * len(standing.points))
    f[distances] = z[first : first + len(distances)]
    f[drifts] = z[second : second + len(drifts)]
    return casadi.reshape(f, 3, len(standing.points))
