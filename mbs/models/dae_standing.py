"""Points that stand, as rows beside those of loops, and a start that fulfils both."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import casadi
import numpy as np
from casadi import SX, Function
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.assembly.rates import norm_rows
from mbs.errors import ModelError, Unclosable
from mbs.loops.closure import closure_rows
from mbs.loops.start import Values, smallest_velocity
from mbs.loops.velocity import acceleration_bias, constraint_rows, kept_rows
from mbs.models.contact_points import ContactPoint, held_elements, point_rows
from mbs.models.dae_forms import Held
from mbs.models.dae_names import Elements
from mbs.models.dae_rows import Rows
from mbs.models.inverse_dynamics import tree_efforts
from mbs.models.surroundings import surroundings
from mbs.models.symbols import ModelSymbols, symbols_of
from mbs.recursions.composite_body import inertia_matrix
from mbs.solvers.gauss_newton import gauss_newton
from mbs.solvers.rank import independent_rows, rank

Array = NDArray[np.float64]

_POSTURES, _REACH, _SEED = 4, 0.05, 20
"""Postures near the start at which dependent rows show, and how far from it they are tried."""
_OFF = 1e-10
"""How far a given posture may be from touching by rounding [m]."""


@dataclass(frozen=True, slots=True)
class PhaseStart:
    """Where a phase begins, as a user says it; see `ContactPhases.dae`."""

    q0: Values
    v0: Values
    tau0: Values
    parameters: Mapping[str, float] | None


@dataclass(frozen=True, slots=True)
class Standing:
    """Points and how each touches.

    Attributes:
        system: open or closed.
        points: all that may touch.
        ways: of each point "fixed", "sliding" or "" where it is free.
    """

    system: System
    points: tuple[ContactPoint, ...]
    ways: tuple[str, ...]

    @property
    def held(self) -> list[int]:
        """Numbers of what planes hold among the elements x, y, z of all points."""
        return [k for k, held in enumerate(held_elements(self.ways).elements()) if held]

    @property
    def names(self) -> str:
        """Of the points that touch."""
        return ", ".join(p.name for p, way in zip(self.points, self.ways, strict=True) if way)

    def rows(self, kept: tuple[int, ...]) -> Held:
        """The kept elements as rows; the distances bind positions, and come first."""
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
        """Name and unit of the rows that bind positions, and of those that bind velocities."""
        distances, drifts = (
            tuple((f"{self.points[k // 3].name}: {'xyz'[k % 3]}", "m") for k in part)
            for part in split(kept)
        )
        return distances, drifts

    def independent(self, q: Array, p: Array) -> tuple[int, ...]:
        """The held elements that depend neither on loops nor on each other near a posture q.

        Rows that depend on others only there, as those of a straight leg, are kept.
        """
        held, loops = self.held, kept_rows(self.system)
        numbers = _numbers(self)
        matrices = []
        for posture in self._near(q, p):
            _, _, J_loops, _, J, _ = (np.array(x) for x in numbers(posture, 0 * q[:1], p))
            matrices.append(np.vstack([J_loops[loops], J[held]]))
        ranks = [rank(matrix) for matrix in matrices]
        best = [m for m, r in zip(matrices, ranks, strict=True) if r == max(ranks)]
        first = tuple(range(len(loops)))
        chosen = independent_rows(best, max(ranks), first)
        return tuple(held[k - len(loops)] for k in chosen if k >= len(loops))

    def _near(self, q: Array, p: Array) -> Iterator[Array]:
        """The posture q, and others that touch and close the loops too."""
        yield q
        rng, function = np.random.default_rng(_SEED), _touching(self)

        def residual(x: Array) -> tuple[Array, Array]:
            return _pair(function(x, p))

        for _ in range(_POSTURES):
            root = gauss_newton(residual, q + rng.uniform(-_REACH, _REACH, len(q)))
            if root.converged:
                yield root.x

    def start(self, begin: PhaseStart) -> tuple[Array, Array]:
        """Positions (nq,) at which the points touch, and velocities (nv,) that keep them there.

        Raises:
            Unclosable: no posture with the positions that are given touches.
            ModelError: a name is unknown, or the velocities that are given do not fit.
        """
        system = self.system
        p = np.array(system.parameter_values(begin.parameters), dtype=float)
        q, names = np.array(system.position(begin.q0)), [c.name for c in system.coordinates]
        given = (begin.q0 or {}) if begin.q0 is None or isinstance(begin.q0, Mapping) else names
        free = [k for k, name in enumerate(names) if name not in given]
        function = _touching(self)

        def residual(x: Array) -> tuple[Array, Array]:
            r, J = _pair(function(_with(q, free, x), p))
            return r, J[:, free]

        if free:
            q = _with(q, free, gauss_newton(residual, q[free]).x)
        missing = _pair(function(q, p))[0]
        if np.abs(missing).max(initial=0) > _OFF:
            raise Unclosable(
                f"{system.name}: no posture near the start lets {self.names or 'no point'} touch,"
                f" {np.abs(missing).max():.2g} m is missing; give fewer positions in q0"
            )
        return q, self._velocity(q, p, begin.v0)

    def _velocity(self, q: Array, p: Array, v0: Values) -> Array:
        _, _, J_loops, _, J, _ = (np.array(x) for x in _numbers(self)(q, np.zeros(1), p))
        rows = np.vstack([J_loops, J[self.held]])
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
        """Accelerations (nv,) and efforts of the kept rows, as z of "index1" has them.

        Raises:
            ModelError: they are not determined there, as where a leg is straight.
        """
        q, v = motion
        distances, drifts = split(kept)
        s = len(self.system.closure.rows) if self.system.closure else 0
        A, H, J_loops, psi, J, bias = (np.array(x) for x in _numbers(self)(q, v, p))
        loops = kept_rows(self.system)
        J_loops, psi = J_loops[loops], psi[loops]
        rows = np.vstack([J_loops[:s], J[distances], J_loops[s:], J[drifts]])
        slopes = np.vstack([psi[:s], bias[distances], psi[s:], bias[drifts]])
        r = len(rows)
        K = np.block([[A, -rows.T], [rows, np.zeros((r, r))]])
        right = np.concatenate([tau - H.ravel(), -slopes.ravel()])
        found: Array = np.linalg.lstsq(K, right, rcond=None)[0]
        if not np.allclose(K @ found, right, rtol=1e-8, atol=1e-8 * np.abs(right).max(initial=1)):
            raise ModelError(
                f"{self.system.name}: the forces on {self.names} are not determined at the start,"
                " where some of them move nothing; bend what is straight there, by q0"
            )
        return found


def split(kept: tuple[int, ...]) -> tuple[list[int], list[int]]:
    """The distances among elements x, y, z of points, and the others."""
    return [k for k in kept if k % 3 == 2], [k for k in kept if k % 3 != 2]


def _numbers(standing: Standing) -> Function:
    """``numbers(q, v, p) -> A, H, J_loops, psi, J, bias``, every row of loops and points."""
    system = standing.system

    def build() -> Function:
        s = symbols_of(system, "tree")
        rows = point_rows(system, s, standing.points)
        J, psi = SX(0, system.nv), SX(0, 1)
        if system.is_closed:
            J = constraint_rows(system, s.q)
            psi = acceleration_bias(system, s.q, s.v, J)
        A = inertia_matrix(system.tree, s.poses)
        H = tree_efforts(system, s, SX.zeros(system.nv), surroundings(system))
        outputs = [casadi.densify(x) for x in (A, H, J, psi, rows.J, rows.bias)]
        return Function("numbers", [s.q, s.v, system.p], outputs, {"cse": True})

    function: Function = system.cached(("standing", standing.points), build)
    return function


def _touching(standing: Standing) -> Function:
    """``touching(q, p) -> r, J``: distances, loops and quaternions, all zero where they hold."""
    system = standing.system

    def build() -> Function:
        s = symbols_of(system, "tree")
        distances = split(tuple(standing.held))[0]
        rows = [point_rows(system, s, standing.points).r[distances], norm_rows(system.tree, s.q)]
        if system.is_closed:
            rows.append(closure_rows(system, s.q))
        r = casadi.densify(casadi.vertcat(*rows))
        J = casadi.densify(casadi.jacobian(r, s.q))
        return Function("touching", [s.q, system.p], [r, J], {"cse": True})

    function: Function = system.cached(("touching", standing.points, standing.ways), build)
    return function


def _pair(results: Any) -> tuple[Array, Array]:
    r, J = results
    return np.array(r).ravel(), np.array(J)


def _with(q: Array, places: list[int], values: Array) -> Array:
    result = q.copy()
    result[places] = values
    return result
