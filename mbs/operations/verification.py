"""Numeric comparison of Functions at random points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from casadi import DM, Function

from mbs.errors import ModelError

_POINTS = 3
"""Number of test points: an error that is hidden at one point is visible at another."""
_BOXES = ((0.1, 0.9), (-1.0, 1.0), (-3.0, 3.0), (0.5, 2.0), (1.0, 30.0), (-100.0, 100.0))
"""Ranges of the inputs, tried in order until the Function is finite: first the domain of arcsines,
roots and logarithms, then ranges for functions that need larger or negative inputs."""
_TRIES = 4
_OF_THE_LARGEST, _OF_ALL = 1e-9, 1e-12
"""Allowed differences, relative to the largest element of the output and of all outputs. A new
order of sums changes values by 1e-15 times their condition; a wrong term by a large fraction."""
_NUDGES, _NUDGE, _MARGIN = 16, 1e-12, 10.0
"""Rounding test if these are exceeded, such as for an output that is zero except for rounding:
number of perturbations, relative size (some thousand roundings), factor on the largest effect."""

Values = tuple[np.ndarray, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Witness:
    """Values of a Function at test points.

    Attributes:
        function: Function that was evaluated.
        points: values of all inputs, for each point.
        values: non-zero elements of all outputs, for each point.
    """

    function: Function
    points: tuple[tuple[DM, ...], ...]
    values: tuple[Values, ...]

    def require_equal(self, function: Function, what: str) -> None:
        """Raise if another Function has different values where this Function is finite.

        Args:
            function: Function to compare.
            what: name of the transformation that made it, for the error message.

        Raises:
            ModelError: an output differs. The message gives the output and `what`.
        """
        for point, expected in zip(self.points, self.values, strict=True):
            got = _values(function, point)
            scale = max((_largest(v) for v in expected), default=0.0)
            for k, (one, other) in enumerate(zip(expected, got, strict=True)):
                allowed = max(_OF_THE_LARGEST * _largest(one), _OF_ALL * scale)
                if _within(one, other, allowed) or _within(one, other, self._rounding(k)):
                    continue
                raise ModelError(
                    f"{self.function.name()}: {function.name_out(k)} is no longer the same after"
                    f" {what}; leave that pass out, and please report it"
                )

    def _rounding(self, output: int) -> float:
        """Return the largest change of an output, times 10, by tiny random changes of the inputs.

        It bounds the rounding error of an output that should be zero. `output` is its index.
        """
        random, found = np.random.default_rng(0), 0.0
        for point, expected in zip(self.points, self.values, strict=True):
            for _ in range(_NUDGES):
                nudged = [x * (1 + random.uniform(-_NUDGE, _NUDGE, x.shape)) for x in point]
                change = _values(self.function, nudged)[output] - expected[output]
                found = max(found, _largest(change))
        return _MARGIN * found


def witness(function: Function, seed: int = 0) -> Witness:
    """Evaluate a Function at three random points at which all, or most, of its elements are finite.

    Args:
        function: Function to evaluate.
        seed: seed of the random numbers.

    Raises:
        ModelError: no output element is finite at any of many points.
    """
    random = np.random.default_rng(seed)
    tried: list[tuple[int, tuple[DM, ...], Values]] = []
    for low, high in _BOXES * _TRIES:
        point = tuple(
            DM(function.sparsity_in(k), random.uniform(low, high, function.nnz_in(k)))
            for k in range(function.n_in())
        )
        values = _values(function, point)
        tried.append((sum(int(np.isfinite(v).sum()) for v in values), point, values))
        elements = sum(v.size for v in values)
        if sum(1 for finite, _, _ in tried if finite == elements) == _POINTS:
            break
    tried.sort(key=lambda trial: -trial[0])
    best = tried[:_POINTS]
    if elements and not best[0][0]:
        raise ModelError(
            f"{function.name()}: it gives no number at any of {len(tried)} points, so that a"
            " simpler Function cannot be compared with it; check it for divisions by zero"
        )
    return Witness(function, tuple(p for _, p, _ in best), tuple(v for _, _, v in best))


def _values(function: Function, point: Sequence[DM]) -> Values:
    """Return the non-zero elements of each output of a Function at a point.

    `point` has one value per input.
    """
    outputs = Function.call(function, list(point))
    return tuple(np.array(DM(output).nonzeros(), dtype=float) for output in outputs)


def _within(one: np.ndarray, other: np.ndarray, allowed: float) -> bool:
    """Return whether two arrays differ by at most `allowed`.

    Elements where `one` is not finite pass.
    """
    known = np.isfinite(one)
    return bool(np.all(np.abs(one[known] - other[known]) <= allowed))


def _largest(values: np.ndarray) -> float:
    """Return the largest magnitude of the finite elements; zero if there are none."""
    return float(np.max(np.abs(values[np.isfinite(values)]), initial=0.0))
