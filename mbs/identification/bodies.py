"""Physically consistent parameters: bodies that explain identified parameters, and priors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import casadi
import numpy as np
import numpy.typing as npt
from casadi import DM, SX, Function

from mbs.assembly import System
from mbs.errors import ModelError, SolverError
from mbs.identification.estimate import Estimate, NamedValues, repetition
from mbs.identification.exciting import SolverFollower, Watch
from mbs.identification.observations import Observations, excitation_quality
from mbs.identification.regressors import INERTIAL, Column
from mbs.identification.triangle import compressed
from mbs.numbers import NONZERO
from mbs.spatial.inertia import Inertia, PseudoInertia
from mbs.text import quoted

# Prior knowledge of the bodies.


Array = npt.NDArray[np.float64]

HEAVIEST = 100.0
"""Default upper bound on the mass of a link [kg]."""


@dataclass(frozen=True, slots=True, eq=False)
class Prior:
    """Mass bounds, and a guess of the parameters for regularisation.

    Source: Lee, Wensing & Park 2020 (divergence from a guess).

    Attributes:
        guess: (k,) parameters, such as CAD values, in the order of the columns. None means a ball
            of 1 kg at the origin of each link.
        emphasis: weight of the divergence from the guess. Weight 1 counts as one equation.
        heaviest: upper bound on the mass of every link, or one bound for each link [kg].
        total_mass: total mass of all links [kg], or None if unknown.
    """

    guess: npt.ArrayLike | None = None
    emphasis: float = 1.0
    heaviest: float | Sequence[float] = HEAVIEST
    total_mass: float | None = None

    def __post_init__(self) -> None:
        masses = np.atleast_1d(np.asarray(self.heaviest, dtype=float))
        if not ((masses > 0).all() and self.emphasis > 0):
            raise ModelError(
                f"prior: heaviest is {quoted(self.heaviest)} kg and emphasis {self.emphasis:g};"
                " give more than zero"
            )
        if self.guess is not None and not np.isfinite(np.asarray(self.guess, dtype=float)).all():
            raise ModelError("prior: a number of the guess is not finite; give one for each column")
        if self.total_mass is not None and not self.total_mass > 0:
            raise ModelError(
                f"prior: the total mass is {self.total_mass:g} kg; give what was weighed"
            )

    def masses(self, links: int) -> Array:
        """Return the upper bounds (links,) on the masses of the links [kg].

        Args:
            links: number of links.

        Raises:
            ModelError: the number of bounds differs from the number of links, or the total mass
                is not less than the sum of the bounds.
        """
        given = np.atleast_1d(np.asarray(self.heaviest, dtype=float))
        if given.size not in (1, links):
            raise ModelError(
                f"prior: {given.size} bounds on masses are given for {links} links; give one for"
                " each, or one for all"
            )
        bounds = np.array(np.broadcast_to(given, links))
        if self.total_mass is not None and self.total_mass >= bounds.sum():
            raise ModelError(
                f"prior: the total mass is {self.total_mass:g} kg and the links may have"
                f" {bounds.sum():g} kg; raise heaviest, or check the total mass"
            )
        return bounds


# Physically consistent full parameter sets: maximum-likelihood estimation.

# Every link has the pseudo-inertia P = C L L' C', where C C' is the pseudo-inertia of the guess and
# L is lower triangular with exponentials of free variables on its diagonal. P is therefore positive
# definite without constraints.

# Source: Wensing, Kim & Slotine 2018 (pseudo-inertia); Rucker & Wensing 2022 (log-Cholesky); Lee,
# Wensing & Park 2020 (entropic divergence from the guess).


FREE_KINDS = ("offset",)
"""Kinds of joint parameters that may be negative."""

_MASS, _RADIUS = 1.0, 0.1
"""Mass and radius of the ball that is the default guess of every body [kg, m]: the middle of
typical robot links on a logarithmic scale, which is the scale of the variables."""
_ROUNDS = 500
"""Maximum number of iterations. More are needed only if the units or the record do not fit the
model."""
_OPTIONS = {
    "ipopt": {
        "print_level": 0,
        "sb": "yes",
        "max_iter": _ROUNDS,
        "tol": 1e-7,  # tolerance of the scaled gradient, with the misfit in standard deviations
        "bound_relax_factor": 0.0,
    },
    "print_time": False,
    "error_on_fail": False,
}
_SMALLEST_ROOT, _LARGEST_ROOT = -7.0, 7.0
"""Bounds on the logarithms of the diagonal of L: masses and moments of inertia stay within a
factor of 1e6 of the guess, so that exponentials do not overflow during the iteration."""
_OFF_DIAGONAL = tuple((r, c) for r in range(4) for c in range(r))


@dataclass(frozen=True, slots=True, eq=False)
class Misfit:
    """Least-squares cost: half of |R K - rho|^2, in standard deviations.

    Attributes:
        R: (rows, k) matrix of the equations.
        rho: (rows,) right-hand side.
    """

    R: Array
    rho: Array

    @classmethod
    def of_rows(cls, A: Array, b: Array) -> Misfit:
        """Return the cost |A K - b|^2 / 2 with at most k + 1 rows; QR preserves it.

        Args:
            A: (n, k) weighted matrix of the equations.
            b: (n,) weighted right-hand side.
        """
        return cls(*compressed(A, b))


def whole_links(columns: Sequence[Column]) -> list[int]:
    """Return the numbers (from 1) of the links of the inertial parameters in `columns`.

    Args:
        columns: parameters, with all ten inertial parameters of a link or none.

    Raises:
        ModelError: a link has only some of its inertial parameters.
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
    """Return the pseudo-inertia (4, 4) of each link, by link number (from 1).

    It is [[S, m s], [m s', m]] about the origin and in the axes of the link frame [kg m^2, kg m,
    kg], and positive definite for a physical body.

    Args:
        columns: parameters, with all ten inertial parameters of every link.
        values: (k,) values of the columns.
    """
    at = {(column.kind, column.link): k for k, column in enumerate(columns)}
    found = {}
    for link in whole_links(columns):
        ten = SX(DM([float(values[at[kind, link]]) for kind in INERTIAL]))
        found[link] = _constant_array(
            _body_pseudo_inertia(PseudoInertia.of(Inertia.from_parameters(ten)))
        )
    return found


def consistent_links(columns: Sequence[Column], values: Array) -> list[int]:
    """Return the numbers (from 1) of the links whose parameters are those of a physical body.

    Their pseudo-inertia is positive definite.

    Args:
        columns: parameters, with all ten inertial parameters of every link.
        values: (k,) values of the columns.

    Raises:
        ModelError: a link has only some of its inertial parameters.
    """
    pairs = pseudo_inertias(columns, values).items()
    return [link for link, P in pairs if np.linalg.eigvalsh(P)[0] > 0]


def penalised_minimum(
    misfit: Misfit, columns: Sequence[Column], prior: Prior, watch: Watch | None = None
) -> tuple[Array, Array]:
    """Return the parameters that minimise the misfit plus the weighted divergence from the guess.

    Args:
        misfit: least-squares cost of the k columns.
        columns: parameters, with all ten inertial parameters of every link. Rotor inertias and
            friction are constrained to be nonnegative.
        prior: guess and bounds.
        watch: progress callback; its argument is the completed fraction, between 0 and 1.

    Returns:
        Values (k,) and their covariance (k, k), with the guess treated as a measurement.

    Raises:
        ModelError: the guess is not physically consistent, or the bounds do not match the links.
        SolverError: the optimisation did not converge.
    """
    problem = _PhysicalProblem(misfit, tuple(columns), _guessed_roots(columns, prior.guess), prior)
    values = problem.solved(watch)
    return values, _covariance(misfit, columns, values, prior.emphasis)


@dataclass(frozen=True, slots=True, eq=False)
class _PhysicalProblem:
    """Nonlinear programme in the log-Cholesky variables of the links.

    `roots` maps the link number to C with C C' equal to the pseudo-inertia of the guess.
    """

    misfit: Misfit
    columns: tuple[Column, ...]
    roots: dict[int, Array]
    prior: Prior

    def solved(self, watch: Watch | None) -> Array:
        """Return the parameters (k,) at the minimum, in the order of the columns.

        Args:
            watch: progress callback, or None.

        Raises:
            SolverError: IPOPT does not converge.
        """
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
        return _constant_array(at(self._minimum(programme, own, watch)))[:, 0]

    def _minimum(self, programme: dict[str, SX], own: list[Column], watch: Watch | None) -> DM:
        """Solve `programme` with IPOPT and return its variables; raise SolverError if it fails.

        `own` are the columns that are not inertial parameters: rotor inertias, friction, offsets.
        """
        links = len(self.roots)
        total = [] if self.prior.total_mass is None else [self.prior.total_mass]
        follower = SolverFollower(programme, _ROUNDS, watch)
        solver = casadi.nlpsol("physical", "ipopt", programme, follower.options | _OPTIONS)
        lower = [_SMALLEST_ROOT] * 4 + [-np.inf] * 6
        upper = [_LARGEST_ROOT] * 4 + [np.inf] * 6
        least = [-np.inf if c.kind in FREE_KINDS else 0.0 for c in own]
        answer = solver(
            # bodies start at the guess, nonnegative parameters at a tenth of their scale
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
        """Return for each column in `own` the change of value that changes the misfit by one."""
        lengths = np.linalg.norm(self.misfit.R, axis=0)
        at = {c.name: float(lengths[k]) or 1.0 for k, c in enumerate(self.columns)}
        return [max(float(np.linalg.norm(self.misfit.rho)), 1.0) / at[c.name] for c in own]

    def _link(self, link: int, x: SX) -> SX:
        """Return the inertial parameters (10, 1) of a link from log-Cholesky variables x (10, 1).

        Its pseudo-inertia is C L L' C', with C the root of the guess.
        """
        root = casadi.mtimes(DM(self.roots[link]), _cholesky_factor(x))
        P = casadi.mtimes(root, root.T)
        return PseudoInertia(P[:3, :3], P[:3, 3], P[3, 3]).inertia().parameters

    def _parameters(self, links: dict[int, SX], own: dict[str, SX]) -> SX:
        """Return the parameters (k, 1) in the order of the columns.

        `links` maps link numbers to ten inertial parameters, `own` names to the other parameters.
        """
        every = (
            links[c.link][INERTIAL.index(c.kind)] if c.kind in INERTIAL else own[c.name]
            for c in self.columns
        )
        return casadi.vertcat(*every)


def _cholesky_factor(x: SX) -> SX:
    """Return the lower triangular factor L (4, 4) of log-Cholesky variables x (10, 1).

    They are the logarithms of its diagonal, then the elements below it, row by row.
    """
    L = SX(4, 4)
    for k in range(4):
        L[k, k] = casadi.exp(x[k])
    for k, (row, column) in enumerate(_OFF_DIAGONAL):
        L[row, column] = x[4 + k]
    return L


def _divergence(x: SX) -> SX:
    """Return the entropic divergence of a pseudo-inertia P from the guess P0, for variables x.

    With log-Cholesky variables x (10, 1), it is tr(P0^-1 P) - log det(P0^-1 P) - 4, zero for P =
    P0.
    """
    return casadi.sumsqr(_cholesky_factor(x)) - 2 * casadi.sum1(x[:4]) - 4


def _guessed_roots(columns: Sequence[Column], guess: npt.ArrayLike | None) -> dict[int, Array]:
    """Return a matrix C (4, 4) for each link number, with C C' the pseudo-inertia of the guess.

    `guess` (k,) is in the order of the columns; None means a ball of 1 kg. Raises ModelError if it
    is not physically consistent.
    """
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
    """Return the covariance (k, k): inverse Hessian of misfit and weighted divergence at `values`.

    `emphasis` is the weight of the divergence.
    """
    H = misfit.R.T @ misfit.R
    at = {(column.kind, column.link): k for k, column in enumerate(columns)}
    for link, P in pseudo_inertias(columns, values).items():
        inverse = np.linalg.inv(P)
        indices = [at[kind, link] for kind in INERTIAL]
        units = [inverse @ _pseudo_inertia_unit(k) for k in range(10)]
        H[np.ix_(indices, indices)] += emphasis * np.array(
            [[np.trace(X @ Y) for Y in units] for X in units]
        )
    size = np.sqrt(np.maximum(np.diag(H), NONZERO))
    covariance = np.linalg.pinv(H / np.outer(size, size), hermitian=True)
    return np.asarray(covariance / np.outer(size, size), dtype=float)


def _pseudo_inertia_unit(k: int) -> Array:
    """Return the derivative (4, 4) of the pseudo-inertia with respect to inertial parameter k.

    k is the index in XX XY XZ YY YZ ZZ MX MY MZ M.
    """
    ten = SX(DM([float(k == n) for n in range(10)]))
    return _constant_array(_body_pseudo_inertia(PseudoInertia.of(Inertia.from_parameters(ten))))


def _body_pseudo_inertia(body: PseudoInertia) -> SX:
    """Return the pseudo-inertia (4, 4) of a body."""
    upper = casadi.horzcat(body.S, body.ms)
    return casadi.densify(casadi.vertcat(upper, casadi.horzcat(body.ms.T, body.m)))


def _constant_array(value: Any) -> Array:
    """Return a constant CasADi expression `value` as a NumPy array of the same shape."""
    return np.asarray(DM(value).full(), dtype=float)


# Identified bodies as in drawings: mass, centre of mass and central inertia.


@dataclass(frozen=True, slots=True, eq=False)
class BodyValues:
    """Mass properties of a link, in the frame of its first body.

    Attributes:
        name: name of the body; names of bodies fixed to each other are joined by " + ".
        mass: mass [kg].
        centre: (3,) centre of mass in the frame of the body [m].
        inertia: (3, 3) inertia about the centre of mass, in the axes of the frame [kg m2].
    """

    name: str
    mass: float
    centre: Array
    inertia: Array


def body_values(system: System, columns: Sequence[Column], values: Array) -> tuple[BodyValues, ...]:
    """Return the mass properties of every moving body, at the default values of the symbols.

    Args:
        system: system of the bodies; its symbols have their default values.
        columns: parameters, with all ten inertial parameters of the links.
        values: (k,) values of the columns, with positive masses.
    """
    found = []
    for link, P in pseudo_inertias(columns, values).items():
        names = [row.name for row in system.bodies if row.link == link]
        first = names[0] if names else link
        T = _pose(system, first)
        R, p, mass = T[:3, :3], T[:3, 3], float(P[3, 3])
        centre = P[:3, 3] / mass
        second = R.T @ (P[:3, :3] - mass * np.outer(centre, centre)) @ R
        inertia = np.trace(second) * np.eye(3) - second
        name = " + ".join(names) or f"link {link}"
        found.append(BodyValues(name, mass, R.T @ (centre - p), inertia))
    return tuple(found)


def bodies_table(system: System, columns: Sequence[Column], values: Array) -> str:
    """Return the mass properties of `body_values` as a text table, in kg, m and kg m2.

    Args:
        system: system of the bodies.
        columns: parameters, with all ten inertial parameters of the links.
        values: (k,) values of the columns, with positive masses.
    """
    rows = body_values(system, columns, values)
    width = max([len("body"), *(len(row.name) for row in rows)])
    heads = ("mass", "x", "y", "z", "Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz")
    head = f"{'body':<{width}}" + "".join(f"{name:>11}" for name in heads)
    lines = ["Bodies in their own frames, inertia about the centre of mass [kg, m, kg m2]", head]
    for row in rows:
        J = row.inertia
        six = (J[0, 0], J[1, 1], J[2, 2], J[0, 1], J[0, 2], J[1, 2])
        numbers = (row.mass, *row.centre, *six)
        lines.append(f"{row.name:<{width}}" + "".join(f"{x:>11.4g}" for x in numbers))
    return "\n".join(lines)


def _pose(system: System, frame: str | int) -> Array:
    """Return the pose (4, 4) of `frame` relative to its link, at the default parameter values."""
    pose = system.frame(frame)[1].matrix
    at = Function("pose", [system.p], [pose])(DM(system.parameter_values()))
    return np.asarray(DM(at).full(), dtype=float)


# Identification of a physically consistent full parameter set.


_RANK = 1e-9
"""Singular values of scaled columns below this fraction of the largest count as zero. For
dependent columns they are rounding errors, 1e-15 times the root of the number of rows."""
_EXACT = 1e-3
"""Smallest standard deviation of an effort, as a fraction of its root mean square. Simulated
data fit so well that the optimisation would not converge; no sensor is that accurate."""
_NO_DEVIATION = 1e-12
"""Smallest standard deviation of an effort [N m or N]; it avoids a division by zero."""


def physically_consistent(
    observations: Observations, prior: Prior | None = None, watch: Watch | None = None
) -> Estimate:
    """Estimate a physically consistent full parameter set, with equal error variance of all joints.

    Every pseudo-inertia is positive definite, masses are within their bounds, and rotor inertias
    and friction are nonnegative. The guess determines the parameters that are not observable in the
    record. The standard deviations account for the autocorrelation of the residuals.

    Source: Wensing, Kim & Slotine 2018; Rucker & Wensing 2022; Lee, Wensing & Park 2020.

    Args:
        observations: observations in the full parameter set.
        prior: guess and bounds; `Prior()` if None.
        watch: progress callback; its argument is the completed fraction, between 0 and 1.

    Raises:
        ModelError: a rotor inertia or friction parameter is not observable, or the parameter set is
            not complete.
        SolverError: the optimisation did not converge.
    """
    error = unconstrained_error(observations)
    freedom = max(error.size - observations.W.shape[2], 1)
    deviation = float(np.linalg.norm(error)) / np.sqrt(freedom)
    weights = np.full(error.shape[1], 1 / _above_floor(deviation, observations.y))
    return _consistent_estimate(observations, weights, prior or Prior(), watch)


def consistent_weighted(
    observations: Observations, prior: Prior | None = None, watch: Watch | None = None
) -> Estimate:
    """Estimate a physically consistent full parameter set, with each effort weighted separately.

    It differs from `physically_consistent` only in the weights: the inverse standard deviation of
    the residuals of each effort.

    Args:
        observations: observations in the full parameter set.
        prior: guess and bounds; `Prior()` if None.
        watch: progress callback; its argument is the completed fraction, between 0 and 1.

    Raises:
        ModelError: a rotor inertia or friction parameter is not observable, or the parameter set is
            not complete.
        SolverError: the optimisation did not converge.
    """
    error = unconstrained_error(observations)
    rms = np.sqrt(np.mean(error**2, axis=0))
    weights = np.array(
        [1 / _above_floor(float(x), y) for x, y in zip(rms, observations.y.T, strict=True)]
    )
    return _consistent_estimate(observations, weights, prior or Prior(), watch)


def unconstrained_error(observations: Observations) -> Array:
    """Return the residual (n, m) [N m or N] of unconstrained least squares.

    Columns may be linearly dependent.

    Args:
        observations: equations y = W K.
    """
    W, y = observations.rows
    lengths = np.linalg.norm(W, axis=0)
    x = np.linalg.lstsq(W / np.where(lengths > 0, lengths, 1.0), y, rcond=_RANK)[0]
    error = y - (W / np.where(lengths > 0, lengths, 1.0)) @ x
    return np.asarray(error.reshape(observations.y.shape), dtype=float)


def _above_floor(deviation: float, efforts: Array) -> float:
    """Return `deviation`, but at least a small fraction of the rms of `efforts` [N m or N].

    Equations that fit exactly would otherwise get infinite weights.
    """
    return max(deviation, _EXACT * float(np.sqrt(np.mean(efforts**2))), _NO_DEVIATION)


def _consistent_estimate(
    observations: Observations, weights: Array, prior: Prior, watch: Watch | None
) -> Estimate:
    """Return the physically consistent estimate for the weights (m,) of the efforts.

    Raises ModelError if a joint parameter is not observable.

    `prior` is the guess with mass bounds, `watch` the progress callback.
    """
    unseen = set(excitation_quality(observations).unseen)
    hidden = [c.name for c in observations.columns if c.kind not in INERTIAL and c.name in unseen]
    if hidden:
        raise ModelError(
            f"observations: {', '.join(hidden)} cannot be seen in this record; move the joint, or"
            " select the other parameters"
        )
    W, y = observations.rows
    w = np.broadcast_to(weights, observations.y.shape).reshape(-1)
    misfit = Misfit.of_rows(W * w[:, None], y * w)
    values, covariance = penalised_minimum(misfit, observations.columns, prior, watch)
    method, error = "physically consistent", observations.y - observations.W @ values
    repeated = weights * np.sqrt(repetition(error) - 1)
    spread = (W * np.broadcast_to(repeated, error.shape).reshape(-1, 1)) @ covariance
    covariance = covariance + spread.T @ spread
    return Estimate(method, observations.columns, values, covariance, weights, observations)


# Full parameter sets of physical bodies from identified base parameters.


@dataclass(frozen=True, slots=True, eq=False)
class FullSet(NamedValues):
    """Full parameter set recovered from base parameters, and its error.

    Attributes:
        columns: the k parameters.
        values: (k,) values, in the units of the columns.
        covariance: (k, k) covariance of the values, with the guess treated as a measurement.
        base_names: names of the base parameters.
        misfit: (count,) base parameters of the full set minus identified base parameters, in
            standard deviations.
    """

    what: ClassVar[str] = "full set"

    columns: tuple[Column, ...]
    values: Array
    covariance: Array
    base_names: tuple[str, ...]
    misfit: Array


def full_parameters(
    estimate: Estimate,
    columns: Sequence[Column],
    matrix: Array,
    prior: Prior | None = None,
) -> FullSet:
    """Return the full parameter set that is closest to the guess and explains the base parameters.

    The distance is the entropic divergence. Deviations from the base parameters are weighted by the
    inverse of their covariance.

    Source: Lee, Wensing & Park 2020; Gautier & Venture 2013 (standard parameters from base ones).

    Args:
        estimate: estimate of base parameters.
        columns: columns of the full set.
        matrix: (count, k) mapping from full to base parameters, `BaseParameters.matrix`.
        prior: guess and bounds; `Prior()` if None.

    Raises:
        ModelError: the shape of the matrix does not match, or the estimate has no covariance.
        SolverError: the optimisation did not converge.
    """
    if matrix.shape != (len(estimate.values), len(columns)):
        raise ModelError(
            f"recovery: the matrix has the shape {matrix.shape} for {len(estimate.values)} base"
            f" parameters of {len(columns)}; give that of the base parameters identified"
        )
    if not np.isfinite(estimate.covariance).all():
        raise ModelError(f"recovery: {estimate.method} has no covariance; use weighted()")
    deviations = estimate.deviations
    correlation = estimate.covariance / np.outer(deviations, deviations)
    root = np.linalg.inv(np.linalg.cholesky(correlation)) / deviations
    data = Misfit(root @ matrix, root @ estimate.values)
    values, covariance = penalised_minimum(data, columns, prior or Prior())
    misfit = (matrix @ values - estimate.values) / deviations
    return FullSet(tuple(columns), values, covariance, estimate.names, misfit)
