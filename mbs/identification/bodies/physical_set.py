"""Full sets of parameters that some distribution of mass has: the search for the likeliest.

Every link has the pseudo-inertia P = C L L' C', where C C' is that of a link guessed beforehand and
L is lower triangular with the exponentials of free numbers on its diagonal, so that P stays
positive definite without any constraint.

Source: Wensing, Kim & Slotine 2018 (pseudo-inertia); Rucker & Wensing 2022 (log-Cholesky); Lee,
Wensing & Park 2020 (entropic divergence from the guess).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi
import numpy as np
import numpy.typing as npt
from casadi import DM, SX

from mbs.errors import ModelError, SolverError
from mbs.identification.bodies.prior import Prior
from mbs.identification.estimation.triangle import compressed
from mbs.identification.follower import SolverFollower, Watch
from mbs.identification.regressors.columns import INERTIAL, Column
from mbs.spatial.inertia import Inertia
from mbs.spatial.pseudo_inertia import PseudoInertia

Array = npt.NDArray[np.float64]

FREE_KINDS = ("offset",)
"""Kinds that may be negative though they belong to a joint."""

_MASS = 1.0
_RADIUS = 0.1
_ROUNDS = 500
_OPTIONS = {
    "ipopt": {
        "print_level": 0,
        "sb": "yes",
        "max_iter": _ROUNDS,
        "tol": 1e-7,
        "bound_relax_factor": 0.0,
    },
    "print_time": False,
    "error_on_fail": False,
}
_SMALLEST_ROOT = -7.0
_LARGEST_ROOT = 7.0
_OFF_DIAGONAL = tuple((r, c) for r in range(4) for c in range(r))


@dataclass(frozen=True, slots=True, eq=False)
class Misfit:
    """Half the square of R K - rho, in standard deviations.

    Attributes:
        R: (rows, k).
        rho: (rows,).
    """

    R: Array
    rho: Array

    @classmethod
    def of_rows(cls, A: Array, b: Array) -> Misfit:
        """The same sum of squares, but for a constant, in at most k + 1 rows."""
        return cls(*compressed(A, b))


def whole_links(columns: Sequence[Column]) -> list[int]:
    """Numbers of the links of which all ten inertial parameters are among the columns.

    Raises:
        ModelError: a link has some of them only.
    """
    kinds: dict[int, set[str]] = {}
    for column in columns:
        if column.kind in INERTIAL:
            kinds.setdefault(column.link, set()).add(column.kind)
    for link, have in kinds.items():
        missing = [kind for kind in INERTIAL if kind not in have]
        if missing:
            raise ModelError(
                f"physical consistency: link {link} is without {', '.join(missing)}; give the"
                " observations of the full set, not of base parameters"
            )
    return list(kinds)


def pseudo_inertias(columns: Sequence[Column], values: Array) -> dict[int, Array]:
    """For each link its (4, 4) pseudo-inertia [kg m^2, kg m, kg]; a body has a positive one.

    Args:
        columns: with all ten inertial parameters of every link.
        values: (k,) of the columns.
    """
    at = {(column.kind, column.link): k for k, column in enumerate(columns)}
    found = {}
    for link in whole_links(columns):
        ten = SX(DM([float(values[at[kind, link]]) for kind in INERTIAL]))
        found[link] = _numbers(_matrix(PseudoInertia.of(Inertia.from_parameters(ten))))
    return found


def consistent_links(columns: Sequence[Column], values: Array) -> list[int]:
    """Numbers of the links whose pseudo-inertia is positive definite: a body may have it."""
    pairs = pseudo_inertias(columns, values).items()
    return [link for link, P in pairs if np.linalg.eigvalsh(P)[0] > 0]


def likeliest(
    misfit: Misfit, columns: Sequence[Column], prior: Prior, watch: Watch | None = None
) -> tuple[Array, Array]:
    """The set of parameters of least misfit plus the weighted divergence from the guess.

    Args:
        misfit: of the k columns.
        columns: with all ten inertial parameters of every link; rotors and friction are kept from
            being negative.
        prior: guess and bounds.
        watch: is told the part of the search that is over, between 0 and 1.

    Returns:
        (k,) values and (k, k) their covariance, the guess taken as a measurement.

    Raises:
        ModelError: the guess is no consistent set, or the bounds do not fit.
        SolverError: the search did not end.
    """
    problem = _PhysicalProblem(misfit, tuple(columns), _guessed_roots(columns, prior.guess), prior)
    values = problem.solved(watch)
    return values, _covariance(misfit, columns, values, prior.emphasis)


@dataclass(frozen=True, slots=True, eq=False)
class _PhysicalProblem:
    """The non-linear programme in the logarithms of the roots."""

    misfit: Misfit
    columns: tuple[Column, ...]
    roots: dict[int, Array]
    prior: Prior

    def solved(self, watch: Watch | None) -> Array:
        """(k,) the parameters at the minimum."""
        own = [c for c in self.columns if c.kind not in INERTIAL]
        scale = self._scales(own)
        x, z = SX.sym("x", 10, len(self.roots)), SX.sym("z", len(own))
        links = {link: self._link(link, x[:, k]) for k, link in enumerate(self.roots)}
        K = self._parameters(links, {c.name: z[k] * scale[k] for k, c in enumerate(own)})
        error = casadi.mtimes(DM(self.misfit.R), K) - DM(self.misfit.rho)
        distance = sum((_divergence(x[:, k]) for k in range(x.shape[1])), SX(0))
        masses = casadi.vertcat(SX(0, 1), *(ten[9] for ten in links.values()))
        variables = casadi.vertcat(casadi.vec(x), z)
        cost = 0.5 * casadi.sumsqr(error) + self.prior.emphasis * distance
        at = casadi.Function("parameters", [variables], [K])
        if self.prior.total_mass is not None:
            masses = casadi.vertcat(masses, casadi.sum1(masses))
        programme = {"x": variables, "f": cost, "g": masses}
        return _numbers(at(self._minimum(programme, own, watch)))[:, 0]

    def _minimum(self, programme: dict[str, SX], own: list[Column], watch: Watch | None) -> DM:
        links = len(self.roots)
        total = [] if self.prior.total_mass is None else [self.prior.total_mass]
        follower = SolverFollower(programme, _ROUNDS, watch)
        solver = casadi.nlpsol("physical", "ipopt", programme, follower.options | _OPTIONS)
        lower = [_SMALLEST_ROOT] * 4 + [-np.inf] * 6
        upper = [_LARGEST_ROOT] * 4 + [np.inf] * 6
        least = [-np.inf if c.kind in FREE_KINDS else 0.0 for c in own]
        answer = solver(
            x0=[0.0] * (10 * links) + [0.0 if low < 0 else 0.1 for low in least],
            lbx=lower * links + least,
            ubx=upper * links + [np.inf] * len(own),
            lbg=[-np.inf] * links + total,
            ubg=[*self.prior.masses(links), *total],
        )
        status = solver.stats()
        if not status["success"]:
            raise SolverError(
                f"physical consistency: IPOPT ended with {status['return_status']} after"
                f" {status['iter_count']} steps; check the units of the record, or give a guess"
            )
        return DM(answer["x"])

    def _scales(self, own: list[Column]) -> list[float]:
        """What each parameter of a joint has to be to move the misfit by one."""
        lengths = np.linalg.norm(self.misfit.R, axis=0)
        at = {c.name: float(lengths[k]) or 1.0 for k, c in enumerate(self.columns)}
        return [max(float(np.linalg.norm(self.misfit.rho)), 1.0) / at[c.name] for c in own]

    def _link(self, link: int, x: SX) -> SX:
        """(10, 1) parameters of the pseudo-inertia C L L' C'."""
        root = casadi.mtimes(DM(self.roots[link]), _triangle(x))
        P = casadi.mtimes(root, root.T)
        return PseudoInertia(P[:3, :3], P[:3, 3], P[3, 3]).inertia().parameters

    def _parameters(self, links: dict[int, SX], own: dict[str, SX]) -> SX:
        every = (
            links[c.link][INERTIAL.index(c.kind)] if c.kind in INERTIAL else own[c.name]
            for c in self.columns
        )
        return casadi.vertcat(*every)


def _triangle(x: SX) -> SX:
    """(4, 4) lower triangle: four logarithms of its diagonal, then the six others row by row."""
    L = SX(4, 4)
    for k in range(4):
        L[k, k] = casadi.exp(x[k])
    for k, (row, column) in enumerate(_OFF_DIAGONAL):
        L[row, column] = x[4 + k]
    return L


def _divergence(x: SX) -> SX:
    """tr(P0^-1 P) - log det(P0^-1 P) - 4, zero where P is the guess P0."""
    return casadi.sumsqr(_triangle(x)) - 2 * casadi.sum1(x[:4]) - 4


def _guessed_roots(columns: Sequence[Column], guess: npt.ArrayLike | None) -> dict[int, Array]:
    """For each link C with C C' the guessed pseudo-inertia."""
    if guess is None:
        ball = np.diag([np.sqrt(_MASS / 5) * _RADIUS] * 3 + [np.sqrt(_MASS)])
        return {link: ball for link in whole_links(columns)}
    values = np.asarray(guess, dtype=float)
    if values.shape != (len(columns),):
        raise ModelError(
            f"physical consistency: the guess has the shape {values.shape} for {len(columns)}"
            " columns; give one value for each"
        )
    roots: dict[int, Array] = {}
    for link, P in pseudo_inertias(columns, values).items():
        if np.linalg.eigvalsh(P)[0] <= 0:
            raise ModelError(
                f"physical consistency: the guess for link {link} is no body, its pseudo-inertia"
                " has an eigenvalue that is not positive; give it mass and extent"
            )
        roots[link] = np.asarray(np.linalg.cholesky(P), dtype=float)
    return roots


def _covariance(misfit: Misfit, columns: Sequence[Column], values: Array, emphasis: float) -> Array:
    """Inverse of the second derivative of misfit and divergence by the parameters."""
    H = misfit.R.T @ misfit.R
    at = {(column.kind, column.link): k for k, column in enumerate(columns)}
    for link, P in pseudo_inertias(columns, values).items():
        inverse = np.linalg.inv(P)
        places = [at[kind, link] for kind in INERTIAL]
        units = [inverse @ _unit(k) for k in range(10)]
        H[np.ix_(places, places)] += emphasis * np.array(
            [[np.trace(X @ Y) for Y in units] for X in units]
        )
    size = np.sqrt(np.maximum(np.diag(H), 1e-300))
    covariance = np.linalg.pinv(H / np.outer(size, size), hermitian=True)
    return np.asarray(covariance / np.outer(size, size), dtype=float)


def _unit(k: int) -> Array:
    ten = SX(DM([float(k == n) for n in range(10)]))
    return _numbers(_matrix(PseudoInertia.of(Inertia.from_parameters(ten))))


def _matrix(body: PseudoInertia) -> SX:
    upper = casadi.horzcat(body.S, body.ms)
    return casadi.densify(casadi.vertcat(upper, casadi.horzcat(body.ms.T, body.m)))


def _numbers(value: Any) -> Array:
    return np.asarray(DM(value).full(), dtype=float)
