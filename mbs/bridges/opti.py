"""What a transcription into `casadi.Opti` gives back, and what both transcriptions share."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from numbers import Real
from typing import Any

import casadi
import numpy as np
from casadi import DM, MX, Function, Opti
from numpy.typing import ArrayLike, NDArray

from mbs.bridges.explicit import Model
from mbs.errors import ModelError
from mbs.models.dae import Dae
from mbs.native import compiled
from mbs.native.batch import cores
from mbs.text import did_you_mean, quoted

CODES: Mapping[str, Callable[[Function], Function]] = {
    "compiled": partial(compiled, derivatives=2),
    "interpreted": Function,
}
"""How stage Functions are evaluated."""

PARALLEL = ("serial", "thread", "openmp")


@dataclass(frozen=True, slots=True, kw_only=True)
class Grid:
    """Stages of equal length.

    Attributes:
        stages: how many.
        duration: of all together [s]; a number, or an expression of `opti` such as a variable.
        code: "compiled" for machine code of the stage Function, with exact first and second
            derivatives, kept in a cache on disk; or "interpreted".
        parallel: of `casadi.Function.map`: "serial", "thread" with a thread for each core, or
            "openmp", which CasADi's wheels do not have.
    """

    stages: int
    duration: float | MX
    code: str = "compiled"
    parallel: str = "serial"

    def __post_init__(self) -> None:
        _require_count("stages", self.stages)
        for what, word, words in (
            ("code", self.code, CODES),
            ("parallel", self.parallel, PARALLEL),
        ):
            if word not in words:
                raise ModelError(f"{what} is {quoted(word)}; use one of {', '.join(words)}")
        number = isinstance(self.duration, Real) and not isinstance(self.duration, bool)
        if number and not 0 < self.duration < float("inf"):
            raise ModelError(f"duration is {self.duration} s; use a number above zero")
        if not number and not (isinstance(self.duration, MX) and self.duration.numel() == 1):
            raise ModelError(
                f"duration is {quoted(self.duration)}; give seconds, or an expression of opti"
            )

    @property
    def step(self) -> MX:
        """The length of a stage [s]."""
        return MX(self.duration) / self.stages

    def mapped(self, function: Function, columns: int) -> Function:
        """The stage Function, in its code, over so many columns."""
        threads = cores() if self.parallel == "thread" else columns
        mapped: Function = CODES[self.code](function).map(columns, self.parallel, threads)
        return mapped


@dataclass(frozen=True, slots=True, eq=False)
class Transcription:
    """Variables of an Opti whose constraints hold the equations of motion.

    Attributes:
        opti: that has them.
        x: (nx, stages + 1) states at the knots.
        u: (nu, stages) efforts, constant on each stage.
        p: (np, 1) parameters.
        step: length of a stage [s].
        x_points: (nx, points) states where the equations are asked: collocation points, or the
            first knot of each stage.
        z_points: (nz, points) algebraic states there.
        u_points: (nu, points) efforts there.
        weights: (points / stages,) of the quadrature of a stage of length 1.
        nodes: (points / stages,) where the points of a stage of length 1 are.
        variables: the decision variables by name: "x", "u", "z", "x_points".
        elements: of a Dae, for "x", "z", "u" and "p" the name and unit of each row; see `row`.
    """

    opti: Opti
    x: MX
    u: MX
    p: MX
    step: MX
    x_points: MX
    z_points: MX
    u_points: MX
    weights: NDArray[np.float64]
    nodes: NDArray[np.float64]
    variables: Mapping[str, MX]
    elements: Mapping[str, tuple[tuple[str, str], ...]]

    def row(self, name: str) -> MX:
        """What has this name, such as "j1.q", "j1.v", "j1.tau" or a parameter.

        Returns:
            (1, stages + 1) of a state, (1, stages) of an effort, (1, points) of an algebraic
            state, (1, 1) of a parameter.

        Raises:
            ModelError: nothing has the name.
        """
        every: dict[str, MX] = {}
        for kind, rows in (("x", self.x), ("u", self.u), ("z", self.z_points), ("p", self.p)):
            for number, (title, _) in enumerate(self.elements.get(kind, ())):
                every[title] = rows[number, :]
        if name not in every:
            raise ModelError(f"there is no {quoted(name)}; {did_you_mean(str(name), every)}")
        return every[name]

    def integral(self, values: MX) -> MX:
        """The integral over time of a row of values.

        Values at points, (1, points), go by the quadrature of the points: it is of order 2K - 1
        or 2K with K collocation points, and with shooting the sum of stage lengths times values.
        Values of stages, (1, stages), such as those of u, are constant on each: it is exact.

        Raises:
            ModelError: it is no row of one of these lengths.
        """
        stages, points = self.u.shape[1], self.u_points.shape[1]
        if values.shape == (1, stages):
            return self.step * casadi.sum2(MX(values))
        if values.shape != (1, points):
            raise ModelError(
                f"integral: the values have the shape {values.shape}; give (1, {points}), one for"
                f" each point, or (1, {stages}), one for each stage"
            )
        weights = casadi.repmat(DM(self.weights.reshape(1, -1)), 1, stages)
        return self.step * casadi.dot(weights, values)

    def guess(self, x: ArrayLike, u: ArrayLike | None = None, z: ArrayLike | None = None) -> None:
        """Where the solver starts.

        Args:
            x: (nx, stages + 1) states at the knots, or (nx,), the same everywhere. Points of a
                stage take those of its end, so that states that close the loops stay so.
            u: (nu, stages) or (nu,) efforts; zero when left out.
            z: (nz, stages + 1) or (nz,) algebraic states, as x.

        Raises:
            ModelError: one has another shape.
        """
        stages = self.u.shape[1]
        knots = _columns("x", x, self.x.shape)
        self._set("x", knots[:, : self.variables["x"].shape[1]])
        if u is not None:
            self._set("u", _columns("u", u, self.u.shape))
        if "x_points" in self.variables:
            self._set("x_points", self._repeat(knots))
        if z is not None:
            rows = _columns("z", z, (self.z_points.shape[0], stages + 1))
            self._set("z", self._repeat(rows))

    def _set(self, name: str, values: NDArray[np.float64]) -> None:
        if values.size:
            self.opti.set_initial(self.variables[name], values)

    def _repeat(self, knots: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.repeat(knots[:, 1:], len(self.weights), axis=1)


def elements_of(model: Model) -> Mapping[str, tuple[tuple[str, str], ...]]:
    """Names of the rows of a Dae; a Function has none."""
    return model.elements if isinstance(model, Dae) else {}


def variable(opti: Opti, rows: int, columns: int) -> MX:
    """A variable; of no rows an empty matrix, of which `opti.initial` cannot speak."""
    return opti.variable(rows, columns) if rows else MX(0, columns)


def require_counts(opti: Any, grid: Any, **counts: Any) -> None:
    """Refuse what is no Opti, no Grid or no count.

    Raises:
        ModelError: says what to give.
    """
    if not isinstance(opti, Opti):
        raise ModelError(f"{quoted(opti)} is not an Opti; give casadi.Opti()")
    if not isinstance(grid, Grid):
        raise ModelError(f"{quoted(grid)} is not a Grid; give Grid(stages=40, duration=2.0)")
    for what, count in counts.items():
        _require_count(what, count)


def parameter_values(model: Model, count: int, p: Any) -> MX:
    """(np, 1) the parameters of a model: given, or the defaults of a Dae.

    Raises:
        ModelError: there are none, not as many as the model takes, or a name is unknown.
    """
    if isinstance(model, Dae) and (p is None or isinstance(p, Mapping)):
        return MX(DM(_by_name(model, p or {})))
    try:
        values = p if isinstance(p, MX) else MX(DM(np.array([] if p is None else p, dtype=float)))
    except (TypeError, ValueError):
        raise ModelError(f"p is {quoted(p)}; give numbers, or an expression of opti") from None
    if values.numel() != count:
        raise ModelError(f"p has {values.numel()} values, the model has {count} parameters")
    return casadi.vec(values)


def _by_name(model: Dae, given: Mapping[str, float]) -> NDArray[np.float64]:
    names = [name for name, _ in model.elements["p"]]
    values = np.array(model.p0)
    for name, value in given.items():
        if name not in names:
            raise ModelError(f"p has no {quoted(name)}; {did_you_mean(str(name), names)}")
        values[names.index(name)] = value
    return values


def _require_count(what: str, count: Any) -> None:
    if isinstance(count, bool) or not isinstance(count, int) or count < 1:
        raise ModelError(f"{what} is {quoted(count)}; use 1 or more")


def _columns(name: str, values: ArrayLike, shape: tuple[int, int]) -> NDArray[np.float64]:
    """A guess in its full shape; one column serves for all.

    Raises:
        ModelError: it has another shape.
    """
    try:
        array = np.array(values, dtype=float)
    except (TypeError, ValueError):
        raise ModelError(f"{name}: the guess is {quoted(values)}; give numbers") from None
    if array.ndim == 0 or array.shape == shape[:1]:
        return np.tile(np.broadcast_to(array, shape[:1])[:, None], (1, shape[1]))
    if array.shape != shape:
        raise ModelError(
            f"{name}: the guess has the shape {array.shape}; give {shape}, or ({shape[0]},) that is"
            " the same everywhere"
        )
    return array
