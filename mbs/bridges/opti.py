"""What a transcription into `casadi.Opti` gives back, and what both transcriptions share."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import casadi
import numpy as np
from casadi import DM, MX, Function, Opti
from numpy.typing import ArrayLike, NDArray

from mbs.errors import ModelError
from mbs.messages import quoted
from mbs.models.dae import Dae
from mbs.native import compiled

CODES: Mapping[str, Callable[[Function], Function]] = {
    "compiled": partial(compiled, derivatives=2),
    "interpreted": Function,
}
"""How stage Functions are evaluated."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Grid:
    """Stages of equal length.

    Attributes:
        stages: how many.
        duration: of all together [s]; a number, or an expression of `opti` such as a variable.
        code: "compiled" for machine code of the stage Function, with exact first and second
            derivatives, kept in a cache on disk; or "interpreted".
        parallel: of `casadi.Function.map`: "serial", "thread" or "openmp".
    """

    stages: int
    duration: float | MX
    code: str = "compiled"
    parallel: str = "serial"

    def __post_init__(self) -> None:
        if not isinstance(self.stages, int) or self.stages < 1:
            raise ModelError(f"stages is {quoted(self.stages)}; use 1 or more")
        if self.code not in CODES:
            raise ModelError(f"code is {quoted(self.code)}; use one of {', '.join(CODES)}")

    @property
    def step(self) -> MX:
        """The length of a stage [s]."""
        return MX(self.duration) / self.stages

    def mapped(self, function: Function, columns: int) -> Function:
        """The stage Function, in its code, over so many columns."""
        mapped: Function = CODES[self.code](function).map(columns, self.parallel)
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

    def integral(self, values: MX) -> MX:
        """The integral over time of a row of values (1, points), by the quadrature of the points.

        It is exact for u, and of order 2K - 1 or 2K with K collocation points; with shooting it
        is the sum of stage lengths times values.
        """
        count = values.shape[1] // len(self.weights)
        return self.step * casadi.dot(
            casadi.repmat(DM(self.weights.reshape(1, -1)), 1, count), values
        )

    def guess(self, x: ArrayLike, u: ArrayLike | None = None, z: ArrayLike | None = None) -> None:
        """Where the solver starts.

        Args:
            x: (nx, stages + 1) states at the knots, or (nx,), the same everywhere. Points of a
                stage take those of its end, so that states that close the loops stay so.
            u: (nu, stages) or (nu,) efforts; zero when left out.
            z: (nz, stages + 1) or (nz,) algebraic states, as x.
        """
        count = self.u.shape[1]
        knots = _columns(x, count + 1)
        self._set("x", knots[:, : self.variables["x"].shape[1]])
        if u is not None:
            self._set("u", _columns(u, count))
        if "x_points" in self.variables:
            self._set("x_points", self._repeated(knots))
        if z is not None:
            self._set("z", self._repeated(_columns(z, count + 1)))

    def _set(self, name: str, values: NDArray[np.float64]) -> None:
        variable = self.variables.get(name)
        if variable is None or variable.shape != values.shape:
            wanted = "none" if variable is None else f"{variable.shape}"
            raise ModelError(f"{name}: the guess has the shape {values.shape}, it needs {wanted}")
        self.opti.set_initial(variable, values)

    def _repeated(self, knots: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.repeat(knots[:, 1:], len(self.weights), axis=1)


def parameter_values(model: Dae | Function, count: int, p: Any) -> MX:
    """(np, 1) the parameters of a model: given, or the defaults of a Dae.

    Raises:
        ModelError: there are none, or not as many as the model takes.
    """
    if p is None and isinstance(model, Dae):
        return MX(DM(model.p0))
    values = MX(0, 1) if p is None else MX(p) if isinstance(p, MX) else MX(DM(p))
    if values.numel() != count:
        raise ModelError(f"p has {values.numel()} values, the model has {count} parameters")
    return values


def _columns(values: ArrayLike, count: int) -> NDArray[np.float64]:
    array = np.array(values, dtype=float)
    return array if array.ndim == 2 else np.tile(array.reshape(-1, 1), (1, count))
