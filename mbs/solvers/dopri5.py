"""Dormand and Prince's pair of order 5(4) in plain Python: the twin of `native/runtime/dopri5.c`.

Source: Dormand and Prince 1980; Hairer, Norsett and Wanner 1993, II.4 to II.6.
"""

from dataclasses import dataclass, field

from mbs.solvers.stepper import Array, Stepper, combine

C = (0.0, 1 / 5, 3 / 10, 4 / 5, 8 / 9, 1.0, 1.0)
A: tuple[tuple[float, ...], ...] = (
    (),
    (1 / 5,),
    (3 / 40, 9 / 40),
    (44 / 45, -56 / 15, 32 / 9),
    (19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729),
    (9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656),
    (35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84),
)
E = (71 / 57600, 0.0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40)
D = (
    -12715105075 / 11282082432,
    0.0,
    87487479700 / 32700410799,
    -10690763975 / 1880347072,
    701980252875 / 199316789632,
    -1453857185 / 822651844,
    69997945 / 29380423,
)


@dataclass(slots=True)
class Dopri5(Stepper):
    """One integration under way; `table` takes it from step to step."""

    k: list[Array] = field(default_factory=list)

    def _open(self, slope: Array) -> None:
        pass

    def _attempt(self, h: float, slope: Array) -> tuple[Array, Array]:
        k = self.k = [slope]
        y = self.x
        for c, row in zip(C[1:], A[1:], strict=True):
            y = self.x + h * combine(row, k)
            k.append(self._slope(self.t + c * h, y))
        return y, h * combine(E, k)

    def _keep(self, h: float, y: Array) -> tuple[Array, ...]:
        rise = y - self.x
        bend = h * self.k[0] - rise
        return self.x, rise, bend, rise - h * self.k[6] - bend, h * combine(D, self.k)

    def _close(self, t: float, y: Array) -> Array | None:
        return self._slope(t, y) if self.moved else self.k[6]

    def _interpolate(self, a: float) -> Array:
        b = 1.0 - a
        y0, rise, bend, third, fourth = self.dense
        y: Array = y0 + a * (rise + b * (bend + a * (third + b * fourth)))
        return y
