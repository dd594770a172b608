"""RODAS5P, a Rosenbrock method of order 5(4): the twin of `native/runtime/rodas.c`.

Linearly implicit, stiffly accurate and L-stable, so that fast decays cost no steps.

Source: Steinebach 2023; Hairer and Wanner 1996, IV.7, for the form in which it is computed.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from mbs.solvers.problem import Failure, failure_of
from mbs.solvers.stepper import Array, Stepper, combine

Jacobian = Callable[[float, Array], tuple[Array, Array]]
"""(t, x) -> d rhs / d x (n, n), d rhs / d t (n,)."""

# The coefficients of RODAS5P, Steinebach 2023, in the form of Hairer and Wanner 1996, IV.7; the
# tests check the conditions of order on them.

GAMMA = 0.21193756319429014
"""The diagonal, which makes the method stiffly accurate and L-stable."""
_LAST = (
    -7.502846399306121,
    2.561846144803919,
    -11.627539656261098,
    -0.18268767659942256,
    0.030198172008377946,
)
"""Row of stage six: what is added to the state, on which the last two stages build."""
A: tuple[tuple[float, ...], ...] = (
    (),
    (3.0,),
    (2.849394379747939, 0.45842242204463923),
    (-6.954028509809101, 2.489845061869568, -10.358996098473584),
    (2.8029986275628964, 0.5072464736228206, -0.3988312541770524, -0.04721187230404641),
    _LAST,
    (*_LAST, 1.0),
    (*_LAST, 1.0, 1.0),
)
"""Weights of earlier stages in the state at which a stage is taken, a_ij."""
C: tuple[tuple[float, ...], ...] = (
    (),
    (-14.155112264123755,),
    (-17.97296035885952, -2.859693295451294),
    (147.12150275711716, -1.41221402718213, 71.68940251302358),
    (165.43517024871676, -0.4592823456491126, 42.90938336958603, -5.961986721573306),
    (
        24.854864614690072,
        -3.0009227002832186,
        47.4931110020768,
        5.5814197821558125,
        -0.6610691825249471,
    ),
    (
        30.91273214028599,
        -3.1208243349937974,
        77.79954646070892,
        34.28646028294783,
        -19.097331116725623,
        -28.087943162872662,
    ),
    (
        37.80277123390563,
        -3.2571969029072276,
        112.26918849496327,
        66.9347231244047,
        -40.06618937091002,
        -54.66780262877968,
        -9.48861652309627,
    ),
)
"""Weights of earlier stages in the right-hand side of a stage, c_ij, divided by the step."""
TIME = (
    0.0,
    0.6358126895828704,
    0.4095798393397535,
    0.9769306725060716,
    0.4288403609558664,
    1.0,
    1.0,
    1.0,
)
"""Time of every stage, alpha_i, in steps."""
TIME_SLOPE = (
    0.21193756319429014,
    -0.42387512638858027,
    -0.3384627126235924,
    1.8046452872882734,
    2.325825639765069,
    0.0,
    0.0,
    0.0,
)
"""Weight of the slope by time in every stage, gamma_i."""
DENSE: tuple[tuple[float, ...], ...] = (
    (
        25.948786856663858,
        -2.5579724845846235,
        10.433815404888879,
        -2.3679251022685204,
        0.524948541321073,
        1.1241088310450404,
        0.4272876194431874,
        -0.17202221070155493,
    ),
    (
        -9.91568850695171,
        -0.9689944594115154,
        3.0438037242978453,
        -24.495224566215796,
        20.176138334709044,
        15.98066361424651,
        -6.789040303419874,
        -6.710236069923372,
    ),
    (
        11.419903575922262,
        2.8879645146136994,
        72.92137995996029,
        80.12511834622643,
        -52.072871366152654,
        -59.78993625266729,
        -0.15582684282751913,
        4.883087185713722,
    ),
)
"""Weights of all stages in the three terms that bend the dense output, lowest power first."""


@dataclass(slots=True)
class Rodas(Stepper):
    """One integration under way; `table` takes it from step to step.

    Attributes:
        jacobian: derivatives of the right-hand side by state and time.
        derivatives: its values at the start of the step.
        u: stages of the last attempt.
    """

    jacobian: Jacobian = field(kw_only=True)
    derivatives: tuple[Array, Array] | None = None
    u: list[Array] = field(default_factory=list)

    def _open(self, slope: Array) -> None:
        try:
            J, f_t = self.jacobian(self.t, self.x)
        except RuntimeError as error:
            raise failure_of(error, "rhs") from error
        if not (np.isfinite(J).all() and np.isfinite(f_t).all()):
            raise Failure("finite")
        self.derivatives = J, f_t

    def _attempt(self, h: float, slope: Array) -> tuple[Array, Array]:
        assert self.derivatives is not None
        J, f_t = self.derivatives
        shifted = np.eye(len(self.x)) / (h * GAMMA) - J
        u = self.u = []
        y = self.x
        for k, (a, c) in enumerate(zip(A, C, strict=True)):
            f = slope
            if k:
                y = self.x + combine(a, u)
                f = self._slope(self.t + TIME[k] * h, y) + combine(c, u) / h
            u.append(_solved(shifted, f + h * TIME_SLOPE[k] * f_t))
        return y + u[-1], u[-1]

    def _keep(self, h: float, y: Array) -> tuple[Array, ...]:
        return self.x, y, *(combine(weights, self.u) for weights in DENSE)

    def _close(self, t: float, y: Array) -> Array | None:
        return None

    def _interpolate(self, a: float) -> Array:
        b = 1.0 - a
        y0, y1, bend, third, fourth = self.dense
        # a mode, which is constant, keeps its value bit for bit
        y: Array = y0 + a * ((y1 - y0) + b * (bend + a * (third + a * fourth)))
        return y


def _solved(matrix: Array, b: Array) -> Array:
    try:
        return np.asarray(np.linalg.solve(matrix, b))
    except np.linalg.LinAlgError as error:
        raise Failure("finite") from error
