"""Bodies in a plane, each with x, y and an angle of its own, held by pins: Haug's way, in numpy."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

GROUND = -1


@dataclass(frozen=True)
class Pin:
    """A point of body i that is a point of body j; complex, from the mass centres (ground: 0)."""

    i: int
    on_i: complex
    j: int
    on_j: complex


@dataclass(frozen=True)
class PlanarBodies:
    """The state is [x_k, y_k, angle_k ..; their rates].

    Source: Haug 1989, chapter 6: multipliers with the mass matrix of free bodies.

    Attributes:
        masses: [kg]; moments: about the mass centres [kg m^2].
        pins: whose rows must be independent.
        loads: (places, angles, velocities) -> complex forces at the centres, and moments.
    """

    masses: np.ndarray
    moments: np.ndarray
    pins: Sequence[Pin]
    loads: Callable

    def rates(self, t, state):
        n = 3 * len(self.masses)
        y, dy = state[:n], state[n:]
        forces, moments = self.loads(y[0::3] + 1j * y[1::3], y[2::3])
        load = np.column_stack([forces.real, forces.imag, moments]).ravel()
        inverse = 1 / np.column_stack([self.masses, self.masses, self.moments]).ravel()
        J, gamma = self._rows(y, dy)
        free = inverse * load
        pushes = np.linalg.solve((J * inverse) @ J.T, gamma - J @ free)
        return np.concatenate([dy, free + inverse * (J.T @ pushes)])

    def gaps(self, state):
        """How far the pins are open, complex [m]."""
        y = state[: 3 * len(self.masses)]
        return np.array(
            [self._place(y, p.i, p.on_i) - self._place(y, p.j, p.on_j) for p in self.pins]
        )

    def _place(self, y, k, at):
        return at if k == GROUND else y[3 * k] + 1j * y[3 * k + 1] + np.exp(1j * y[3 * k + 2]) * at

    def _rows(self, y, dy):
        """Jacobian of the pins, and J dy' of motions that keep them closed."""
        J, gamma = np.zeros((2 * len(self.pins), len(y))), np.zeros(2 * len(self.pins))
        for row, pin in enumerate(self.pins):
            for k, at, sign in ((pin.i, pin.on_i, 1), (pin.j, pin.on_j, -1)):
                if k == GROUND:
                    continue
                arm = sign * np.exp(1j * y[3 * k + 2]) * at
                J[2 * row, 3 * k], J[2 * row + 1, 3 * k + 1] = sign, sign
                J[2 * row : 2 * row + 2, 3 * k + 2] = -arm.imag, arm.real
                inwards = dy[3 * k + 2] ** 2 * arm
                gamma[2 * row : 2 * row + 2] += inwards.real, inwards.imag
        return J, gamma
