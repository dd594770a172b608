"""Result and shared parts of the transcriptions into `casadi.Opti`."""

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
from mbs.models._dae import Dae
from mbs.native import compiled
from mbs.native._batch import cores
from mbs.text import did_you_mean, quoted

CODES: Mapping[str, Callable[[Function], Function]] = {
    "compiled": partial(compiled, derivatives=2),
    "interpreted": Function,
}
"""Functions that prepare a stage Function for evaluation, by the name of `Grid.code`."""

PARALLEL = ("serial", "thread", "openmp")


@dataclass(frozen=True, slots=True, kw_only=True)
class Grid:
    """Time grid of stages of equal length.

    Attributes:
        stages: number of stages.
        duration: total duration [s]: a number, or an expression of `opti` such as a variable.
        code: "compiled" for machine code of the stage Function with exact first and second
            derivatives, which is cached on disk; or "interpreted".
        parallel: parallelization of `casadi.Function.map`: "serial", "thread" with one thread per
            core, or "openmp", which the CasADi wheels do not support.
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
        """Length of a stage [s]."""
        return MX(self.duration) / self.stages

    def mapped(self, function: Function, columns: int) -> Function:
        """Return the stage Function, compiled or interpreted, mapped over many columns.

        Args:
            function: Function of one stage or point.
            columns: number of columns.
        """
        threads = cores() if self.parallel == "thread" else columns
        mapped: Function = CODES[self.code](function).map(columns, self.parallel, threads)
        return mapped


@dataclass(frozen=True, slots=True, eq=False)
class Transcription:
    """Variables of an Opti problem whose constraints include the equations of motion.

    Attributes:
        opti: Opti problem of the variables.
        x: (nx, stages + 1) states at the knots.
        u: (nu, stages) efforts, constant on each stage.
        p: (np, 1) parameters.
        step: length of a stage [s].
        x_points: (nx, points) states at the points of the equations: collocation points, or the
            first knot of each stage.
        z_points: (nz, points) algebraic states at these points.
        u_points: (nu, points) efforts at these points.
        weights: (points / stages,) quadrature weights for a stage of length 1.
        nodes: (points / stages,) positions of the points in a stage of length 1.
        variables: decision variables by name: "x", "u", "z", "x_points".
        elements: (name, unit) of each row of "x", "z", "u" and "p" of a Dae; see `row`.
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
        """Return a state, effort or parameter by name, such as "j1.q", "j1.v" or "j1.tau".

        Args:
            name: name in `elements`.

        Returns:
            (1, stages + 1) for a state, (1, stages) for an effort, (1, points) for an algebraic
            state, (1, 1) for a parameter.

        Raises:
            ModelError: the name is unknown.
        """
        every: dict[str, MX] = {}
        for kind, rows in (("x", self.x), ("u", self.u), ("z", self.z_points), ("p", self.p)):
            for number, (title, _) in enumerate(self.elements.get(kind, ())):
                every[title] = rows[number, :]
        if name not in every:
            raise ModelError(f"there is no {quoted(name)}; {did_you_mean(str(name), every)}")
        return every[name]

    def integral(self, values: MX) -> MX:
        """Return the integral over time of a row of values.

        Values at points (1, points) are integrated by the quadrature of the points, of order 2K-1
        ("radau") or 2K ("legendre") for K collocation points. For multiple shooting it is the sum
        of stage length times value. Values of stages (1, stages), such as a row of u, are constant
        on each stage, so the integral is exact.

        Args:
            values: (1, points) or (1, stages) values.

        Returns:
            (1, 1) integral.

        Raises:
            ModelError: the values do not have one of these shapes.
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
        """Set the initial guess of the solver.

        Args:
            x: (nx, stages + 1) states at the knots, or (nx,) for the same state at all knots.
                Points inside a stage get the state at its end, so that states that close the loops
                remain consistent.
            u: (nu, stages) or (nu,) efforts; zero by default.
            z: (nz, stages + 1) or (nz,) algebraic states, in the same form as x.

        Raises:
            ModelError: an array has another shape.
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
        """Set the initial guess of the variables `name`, unless there are none."""
        if values.size:
            self.opti.set_initial(self.variables[name], values)

    def _repeat(self, knots: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return values at the points inside stages: those of the knot at the end of the stage."""
        return np.repeat(knots[:, 1:], len(self.weights), axis=1)


def elements_of(model: Model) -> Mapping[str, tuple[tuple[str, str], ...]]:
    """Return (name, unit) of the rows of x, z, u and p of a Dae; empty for a Function.

    Args:
        model: equations of motion.
    """
    return model.elements if isinstance(model, Dae) else {}


def variable(opti: Opti, rows: int, columns: int) -> MX:
    """Return an Opti variable (rows, columns), or an empty matrix if it has no rows.

    `opti.initial` does not accept variables without rows.

    Args:
        opti: problem that receives the variable.
        rows: number of rows.
        columns: number of columns.
    """
    return opti.variable(rows, columns) if rows else MX(0, columns)


def require_counts(opti: Any, grid: Any, **counts: Any) -> None:
    """Raise if an argument is not an Opti, not a Grid or not a positive integer.

    Args:
        opti: problem.
        grid: time grid.
        **counts: numbers that must be positive integers, by name.

    Raises:
        ModelError: the message describes the required argument.
    """
    if not isinstance(opti, Opti):
        raise ModelError(f"{quoted(opti)} is not an Opti; give casadi.Opti()")
    if not isinstance(grid, Grid):
        raise ModelError(f"{quoted(grid)} is not a Grid; give Grid(stages=40, duration=2.0)")
    for what, count in counts.items():
        _require_count(what, count)


def parameter_values(model: Model, count: int, p: Any) -> MX:
    """Return the parameters (np, 1) of a model as numbers or expressions.

    Args:
        model: equations of motion.
        count: number np of parameters.
        p: values as numbers, an expression, or a dict by name; None for the default values of a
            Dae.

    Raises:
        ModelError: no values are given to a Function with parameters, their number differs from
            that of the model, or a name is unknown.
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
    """Return the parameters (np,) of a Dae: values by name, and default values.

    Raises ModelError for an unknown name.
    """
    names = [name for name, _ in model.elements["p"]]
    values = np.array(model.p0)
    for name, value in given.items():
        if name not in names:
            raise ModelError(f"p has no {quoted(name)}; {did_you_mean(str(name), names)}")
        values[names.index(name)] = value
    return values


def _require_count(what: str, count: Any) -> None:
    """Raise ModelError unless `count` is a positive integer; `what` is its name."""
    if isinstance(count, bool) or not isinstance(count, int) or count < 1:
        raise ModelError(f"{what} is {quoted(count)}; use 1 or more")


def _columns(name: str, values: ArrayLike, shape: tuple[int, int]) -> NDArray[np.float64]:
    """Return the guess `values` of the variables `name` as an array of this shape.

    A single column is repeated. Raises ModelError if the guess has another shape.
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
