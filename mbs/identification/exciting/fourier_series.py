"""Periodic motions of joints as finite Fourier series."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from casadi import DM, MX, SX, cos, mtimes, sin

from mbs.errors import ModelError

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class FourierSeries:
    """q(t) = q0 + sum of a_k/(w k) sin(w k t) - b_k/(w k) cos(w k t), with w = 2 pi/period.

    Velocities and accelerations follow without differences, and every period repeats the same
    motion, so that measured periods can be averaged.

    Source: Swevers, Ganseman, Tukel, Schutter & Brussel 1997, eq. 5.

    Attributes:
        period: [s].
        middle: (m,) q0 of each joint [rad or m].
        sine: (m, harmonics) a_k [rad/s or m/s].
        cosine: (m, harmonics) b_k [rad/s or m/s].
    """

    period: float
    middle: Array
    sine: Array
    cosine: Array

    @property
    def harmonics(self) -> int:
        """How many multiples of 1/period the motion has."""
        return int(self.sine.shape[1])

    def q(self, t: npt.ArrayLike) -> Array:
        """(n, m) positions [rad or m] at the instants t (n,) [s], or (m,) at one instant."""
        return self.middle + self._sum(t, 0)

    def v(self, t: npt.ArrayLike) -> Array:
        """(n, m) or (m,) velocities [rad/s or m/s]; see `q`."""
        return self._sum(t, 1)

    def a(self, t: npt.ArrayLike) -> Array:
        """(n, m) or (m,) accelerations [rad/s2 or m/s2]; see `q`."""
        return self._sum(t, 2)

    def law(self, t: SX | MX, order: int = 0) -> SX | MX:
        """(m, 1) positions as an expression, for controllers and motions that are prescribed.

        Args:
            t: symbol of the time [s].
            order: 0 for positions, 1 for velocities, 2 for accelerations.
        """
        w = 2 * np.pi / self.period * np.arange(1, self.harmonics + 1)
        turned = w ** (order - 1)
        a, b = (DM(x * turned) for x in (self.sine, self.cosine))
        angle: Any = DM(w) * t + order * np.pi / 2
        moved: SX | MX = mtimes(a, sin(angle)) - mtimes(b, cos(angle))
        return moved + DM(self.middle) if order == 0 else moved

    def _sum(self, t: npt.ArrayLike, order: int) -> Array:
        if isinstance(t, SX | MX):
            raise ModelError("excitation: the time is a symbol; use law(t), which takes symbols")
        instants = np.asarray(t, dtype=float)
        terms = harmonic_terms(instants.ravel(), self.period, self.harmonics, order)
        values = terms @ np.hstack([self.sine, self.cosine]).T
        return np.asarray(values.reshape(*instants.shape, len(self.middle)), dtype=float)


def harmonic_terms(t: Array, period: float, harmonics: int, order: int) -> Array:
    """(n, 2 harmonics) what multiplies a_1 .. and b_1 .. in a derivative of the series.

    Args:
        t: (n,) instants [s].
        period: [s].
        harmonics: how many.
        order: 0 for q - q0, 1 for the velocity, 2 for the acceleration.
    """
    w = 2 * np.pi / period * np.arange(1, harmonics + 1)
    sin, cos = np.sin(np.outer(t, w)), np.cos(np.outer(t, w))
    pairs = {0: (sin / w, -cos / w), 1: (cos, sin), 2: (-w * sin, w * cos)}
    return np.hstack(pairs[order])


def resting_coefficients(period: float, harmonics: int) -> Array:
    """(2 harmonics, 2 harmonics - 2) orthonormal coefficients of motions that start at rest.

    Velocity and acceleration are zero at the start and so at the end of every period.

    Args:
        period: [s].
        harmonics: two or more.
    """
    w = np.asarray(2 * np.pi / period * np.arange(1, harmonics + 1), dtype=float)
    # v(0) is the sum of a_k, a(0) that of w_k b_k: each half has one condition of its own
    halves = [_across(condition) for condition in (w**0, w)]
    none = np.zeros((harmonics, harmonics - 1))
    return np.block([[halves[0], none], [none, halves[1]]])


def _across(direction: Array) -> Array:
    """(n, n - 1) orthonormal columns across a direction (n,): a reflection of the axes.

    It is written out, since the basis that a singular value decomposition gives differs from
    processor to processor, and with it every motion that is drawn at random in it.
    """
    unit = direction / np.sqrt(np.sum(direction * direction))
    v = unit.copy()
    v[0] += 1.0
    reflection = np.eye(len(v)) - np.outer(v, v) / v[0]
    across: Array = reflection[:, 1:]
    return across


def between_samples(samples: int, harmonics: int) -> float:
    """Part of a bound that samples must keep so that the series keeps it at every instant.

    A trigonometric polynomial of degree n is nowhere larger than 1/cos(pi n/N) times its largest
    value at N > 2 n equal steps of its period.

    Source: Ehlich & Zeller 1964.
    """
    return float(np.cos(np.pi * harmonics / samples))
