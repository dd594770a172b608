"""The search for Fourier coefficients as a nonlinear programme with exact gradients."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import casadi
import numpy as np
import numpy.typing as npt
from casadi import DM, MX, Function

from mbs.errors import SolverError
from mbs.identification.exciting.criterion import Criterion, CriterionFunction
from mbs.identification.exciting.fourier_series import (
    FourierSeries,
    between_samples,
    harmonic_terms,
    resting_coefficients,
)
from mbs.identification.exciting.limits import MotionLimit, MotionLimits
from mbs.identification.follower import SolverFollower, Watch

Array = npt.NDArray[np.float64]

_STARTS = 30
_FILLED = 0.9
_ROUNDING = 1e-12
"""Part of the largest element of its column below which an element of the rates is zero: sines are
rounded to 1e-16, and the least of those that are not zero is far above 1e-6."""


@dataclass(frozen=True, slots=True, eq=False)
class SearchEnd:
    """How a search ended.

    Attributes:
        x: variables.
        value: of the criterion.
        violation: largest of a limit, as part of its range.
        status: of IPOPT.
        steps: of IPOPT.
    """

    x: Array
    value: float
    violation: float
    status: str
    steps: int


@dataclass(frozen=True, slots=True, eq=False)
class Programme:
    """A motion of rest-to-rest Fourier series and what is asked of it.

    The variables are q0 (m, 1), then the coefficients of each joint in the basis of motions that
    start at rest.

    Attributes:
        period: [s].
        harmonics: two or more.
        samples: instants in equal steps of one period.
        instant: see `mbs.identification.exciting.instant.instant`.
        criterion: of the observations at all samples.
        limits: of the motion.
    """

    period: float
    harmonics: int
    samples: int
    instant: Function
    criterion: Criterion
    limits: MotionLimits

    @property
    def joints(self) -> int:
        """M."""
        return int(self.instant.size1_in(0))

    def series(self, x: Array) -> FourierSeries:
        """The motion that variables stand for."""
        m, H = self.joints, self.harmonics
        Y = x[m:].reshape(m, 2 * H - 2) @ resting_coefficients(self.period, H).T
        return FourierSeries(self.period, x[:m], Y[:, :H], Y[:, H:])

    def start(self, rng: np.random.Generator) -> Array:
        """Variables of the best of some random motions that keep the ranges of the joints.

        Raises:
            SolverError: none of them gives observations that tell all columns apart.
        """
        rates, value_at = self._rates(), self._evaluation()
        found: list[tuple[float, Array]] = []
        for k in range(_STARTS):
            x = self._random(rates, _FILLED * 0.5 ** (k % 3), rng)
            value = value_at(x)
            if np.isfinite(value):
                found.append((value, x))
        if not found:
            raise SolverError(
                "excitation: no random motion in the ranges of the joints tells all columns apart;"
                " group them with base_parameters, or give wider ranges"
            )
        return min(found, key=lambda pair: pair[0])[1]

    def _random(self, rates: Array, filled: float, rng: np.random.Generator) -> Array:
        """Variables of a motion that fills this part of the ranges about their middles."""
        m = self.joints
        lower, upper = self._ranges(1.0)
        middle = (lower[:m] + upper[:m]) / 2
        Y = rng.standard_normal((m, 2 * self.harmonics - 2))
        moved = (rates[:, m:] @ Y.ravel()).reshape(3, m, self.samples)
        room = np.concatenate([(upper[:m] - lower[:m]) / 2, np.minimum(upper, -lower)[m:]])
        most = (np.abs(moved).max(axis=2) / room.reshape(3, m)).max(axis=0)
        return np.concatenate([middle, (filled * Y / most[:, None]).ravel()])

    def improve(
        self, x: Array, tightened: Array, rounds: int, watch: Watch | None = None
    ) -> SearchEnd:
        """Variables at a minimum of the criterion within the limits.

        Args:
            x: to start from.
            tightened: (r,) by how much the ranges of the models' quantities are narrowed.
            rounds: largest number of steps.
            watch: is told the part of the steps that is over, between 0 and 1.

        Returns:
            the last variables, also where they are no minimum.
        """
        variables, W, bounded = self._graph()
        criterion = CriterionFunction(self.criterion, W.shape[0])
        rates = self._bounded_rates()
        rows, ends = self._bounded_models(tightened)
        g = casadi.vertcat(_product(rates[0], variables), casadi.vec(bounded[rows, :]))
        scale = np.concatenate([rates[2] - rates[1], np.tile(_spans(ends), self.samples)])
        lower = np.concatenate([rates[1], np.tile(ends[:, 0], self.samples)]) / scale
        upper = np.concatenate([rates[2], np.tile(ends[:, 1], self.samples)]) / scale
        programme: dict[str, Any] = {"x": variables, "f": criterion(W @ W.T), "g": g / DM(scale)}
        follower = SolverFollower(programme, rounds, watch)
        options = follower.options | _options(rounds)
        solver = casadi.nlpsol("excitation", "ipopt", programme, options)
        answer = solver(x0=x, lbg=lower, ubg=upper)
        status = solver.stats()
        reached = np.array(answer["g"]).ravel()
        return SearchEnd(
            np.array(answer["x"]).ravel(),
            float(answer["f"]),
            float(np.maximum(lower - reached, reached - upper).max()),
            str(status["return_status"]),
            int(status["iter_count"]),
        )

    def _graph(self) -> tuple[MX, MX, MX]:
        """Variables, W' (k, m samples) and bounded (r, samples)."""
        variables = MX.sym("x", self.joints * (2 * self.harmonics - 1))
        moved = casadi.reshape(_product(self._rates(), variables), self.samples, 3 * self.joints).T
        q, v, a = casadi.vertsplit(moved, self.joints)
        W, bounded = self.instant.map(self.samples)(q, v, a)
        return variables, W, bounded

    def _evaluation(self) -> Callable[[Array], float]:
        variables, W, _ = self._graph()
        gram = Function("gram", [variables], [W @ W.T])
        return lambda x: self.criterion(np.array(gram(x)))[0]

    def _rates(self) -> Array:
        """(3 m samples, variables): positions, velocities, accelerations, joint by joint."""
        m, H = self.joints, self.harmonics
        t = np.arange(self.samples) * self.period / self.samples
        basis = resting_coefficients(self.period, H)
        ones = np.ones((self.samples, 1))
        blocks = []
        for order in range(3):
            terms = harmonic_terms(t, self.period, H, order) @ basis
            own = np.kron(np.eye(m), ones if order == 0 else 0 * ones)
            blocks.append(np.hstack([own, np.kron(np.eye(m), terms)]))
        return np.vstack(blocks)

    def _ranges(self, part: float) -> tuple[Array, Array]:
        """(3 m,) ends of the ranges of positions, velocities and accelerations."""
        ends = np.array([(limit.lower, limit.upper) for limit in self.limits.of_rates])
        limited = np.isfinite(ends).all(axis=1)
        half = np.where(limited[:, None], ends, 0.0).sum(axis=1) / 2
        return half + part * (ends[:, 0] - half), half + part * (ends[:, 1] - half)

    def _bounded_rates(self) -> tuple[Array, Array, Array]:
        """Rows of `_rates` that are limited, and the ends of their ranges between samples too."""
        lower, upper = self._ranges(between_samples(self.samples, self.harmonics))
        limited = np.repeat(np.isfinite(lower) & np.isfinite(upper), self.samples)
        first, last = (np.repeat(x, self.samples)[limited] for x in (lower, upper))
        return self._rates()[limited], first, last

    def _bounded_models(self, tightened: Array) -> tuple[list[int], Array]:
        """Rows of the models' quantities that are limited, and (rows, 2) ends of their ranges."""
        every: tuple[MotionLimit, ...] = self.limits.of_models
        rows = [k for k, limit in enumerate(every) if limit.is_finite]
        ends = [(every[k].lower + tightened[k], every[k].upper - tightened[k]) for k in rows]
        return rows, np.array(ends).reshape(-1, 2)


def _product(A: Array, x: MX) -> MX:
    """A x, dense also where rows of A are zero, as those of velocities at rest are."""
    sizes = np.abs(A)
    structure = np.where(sizes > _ROUNDING * sizes.max(axis=0, initial=0.0), A, 0.0)
    product: MX = casadi.densify(casadi.sparsify(DM(structure)) @ x)
    return product


def _spans(ends: Array) -> Array:
    """(rows,) sizes of ranges; of those open on one side, one."""
    span = ends[:, 1] - ends[:, 0]
    return np.where(np.isfinite(span), span, 1.0)


def _options(rounds: int) -> dict[str, Any]:
    return {
        "ipopt": {
            "print_level": 0,
            "sb": "yes",
            "max_iter": rounds,
            "tol": 1e-4,
            "hessian_approximation": "limited-memory",
            "mu_strategy": "adaptive",
            "constr_viol_tol": 1e-8,
        },
        "print_time": False,
        "error_on_fail": False,
    }
