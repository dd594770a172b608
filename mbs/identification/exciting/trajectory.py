"""An exciting motion: positions, rates, how near it comes to its limits, and a table of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from casadi import MX, SX

from mbs.assembly import System
from mbs.assembly.tables import ACCELERATION_UNIT
from mbs.errors import ModelError
from mbs.identification.exciting.fourier_series import FourierSeries
from mbs.identification.exciting.limits import RATE_UNITS, Margin
from mbs.identification.postures import active_places, positions
from mbs.identification.regressors.columns import Column
from mbs.result import Result

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Trajectory:
    """A motion of the independent joints that repeats itself and starts at rest.

    Attributes:
        system: that moves.
        columns: parameters that it shows.
        series: of the independent joints.
        condition: condition number of the regressor over one period, in SI units.
        scaled_condition: the same with columns of length one.
        margins: to every limit; of quantities without one, the range that they have.
        objective: what was minimised.
        status: how the search ended.
        steps: of the last search.
    """

    system: System
    columns: tuple[Column, ...]
    series: FourierSeries
    condition: float
    scaled_condition: float
    margins: tuple[Margin, ...]
    objective: str = ""
    status: str = ""
    steps: int = 0

    def __repr__(self) -> str:
        return (
            f"<Trajectory {self.system.name}: {self.series.period:g} s, {len(self.columns)}"
            f" columns, condition {self.condition:.3g}>"
        )

    def q(self, t: npt.ArrayLike) -> Array:
        """(n, m) positions of the independent joints [rad or m] at t (n,) [s], or (m,)."""
        return self.series.q(t)

    def v(self, t: npt.ArrayLike) -> Array:
        """(n, m) or (m,) velocities of the independent joints [rad/s or m/s]."""
        return self.series.v(t)

    def a(self, t: npt.ArrayLike) -> Array:
        """(n, m) or (m,) accelerations of the independent joints [rad/s2 or m/s2]."""
        return self.series.a(t)

    def law(self, t: SX | MX, order: int = 0) -> SX | MX:
        """(m, 1) positions of the independent joints as an expression; see `FourierSeries.law`."""
        return self.series.law(t, order)

    def posture(self, t: npt.ArrayLike) -> Array:
        """(n, nq) positions of all joints of the tree, which close the loops, or (nq,)."""
        instants = np.asarray(t, dtype=float)
        q = positions(self.system, self.series.q(instants.ravel()))
        return np.asarray(q.reshape(*instants.shape, self.system.nq), dtype=float)

    def table(self, rate: float, periods: int = 1) -> Result:
        """Positions, velocities and accelerations for a controller.

        Args:
            rate: rows in a second [1/s].
            periods: how often the motion is repeated.

        Returns:
            columns such as "j1.q", "j1.v" and "j1.a" of the independent joints; the last row is at
            the end of the last period.

        Raises:
            ModelError: the rate or the number of periods is not positive.
        """
        if not rate > 0 or periods < 1:
            raise ModelError(
                f"trajectory: {rate:g} rows in a second for {periods} periods; give a positive rate"
                " and one period or more"
            )
        span = periods * self.series.period
        time = np.linspace(0.0, span, round(span * rate) + 1)
        values = np.hstack([self.q(time), self.v(time), self.a(time)])
        joints = [self.system.coordinates[k] for k in active_places(self.system)]
        rates = [RATE_UNITS[joint.unit] for joint in joints]
        units = {f"{joint.name}.q": joint.unit for joint in joints}
        units |= {f"{j.name}.v": unit for j, unit in zip(joints, rates, strict=True)}
        units |= {
            f"{j.name}.a": ACCELERATION_UNIT[unit] for j, unit in zip(joints, rates, strict=True)
        }
        return Result(time, values, units, f"excitation of {self.system.name}")

    def worst(self, quantity: str) -> Margin:
        """The margin of a kind of limit that is smallest as part of its limit.

        Args:
            quantity: position, velocity, acceleration, effort, plane or leading.

        Raises:
            ModelError: no such quantity is limited.
        """
        found = [m for m in self.margins if m.limit.quantity == quantity and m.limit.is_finite]
        if not found:
            raise ModelError(f"trajectory: no {quantity} of {self.system.name} is limited")
        return min(found, key=lambda margin: margin.part)

    def text(self) -> str:
        """Conditions, how the search ended, and the range of every limited quantity."""
        lines = [
            f"{self.system.name}: {self.series.period:g} s, {self.series.harmonics} harmonics,"
            f" {len(self.columns)} columns",
            f"Condition number: {self.condition:.4g}; with columns of length one"
            f" {self.scaled_condition:.4g}",
            f"Objective {self.objective}: {self.status} after {self.steps} steps",
            "quantity      name       lowest    highest      limits                margin",
        ]
        lines += [_line(margin) for margin in self.margins if margin.limit.is_finite]
        return "\n".join(lines)


def _line(margin: Margin) -> str:
    limit = margin.limit
    ends = f"{limit.lower:9.4g} .. {limit.upper:<9.4g}"
    return (
        f"{limit.quantity:<13} {limit.name:<8} {margin.lowest:9.4f} {margin.highest:10.4f}"
        f"   {ends} {margin.worst:9.2g} {limit.unit}"
    )
