"""Motions of the benchmark mechanisms by means that share nothing with mbs.

Pendulum and windows have closed forms in elliptic functions. The others are Lagrange's equations in
coordinates chosen by hand, of energies written by hand: extrapolated midpoint steps of
order 16, and CVODES for the stiff governor.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from math import pi
from pathlib import Path
from typing import Any

import casadi
import numpy as np
from casadi import SX, cos, horzcat, sin, vertcat

sys.path.append(str(Path(__file__).parents[1] / "tests"))
from support.elliptic import swing, whirl
from support.errors import rms_error
from support.extrapolation import solution

__all__ = ["bricard", "governor", "pendulum", "rms_error", "squeezer", "windows"]

Array = np.ndarray[Any, Any]
G = 9.81
TOLERANCE = 1e-13
"""Of the extrapolated midpoint steps."""
STIFF_TOLERANCE = 3e-15
"""Of CVODES, whose errors add up to a thousand times as much."""


def pendulum(times: Array) -> Array:
    """(m, 2) x and y of the mass, which falls from x = -1 m."""
    fallen = swing(times, np.sqrt(G), pi / 2)
    return np.column_stack([-np.sin(fallen), -np.cos(fallen)])


def windows(loops: int) -> Callable[[Array], Array]:
    """(m, 2) x and y of the first top of N windows; see tests/robots/test_benchmarks_pendulum.py.

    The uprights turn together and the couplers only translate: a pendulum of one degree of freedom.
    """

    def motion(times: Array) -> Array:
        rate = np.sqrt(G * ((loops + 1) / 2 + loops) / ((loops + 1) / 3 + loops))
        phi = 1.5 * pi - whirl(times, rate, 1.0)
        return np.column_stack([np.cos(phi), np.sin(phi)])

    return motion


@dataclass(frozen=True, slots=True, eq=False)
class Lagrange:
    """A system by its energies, as functions of q and v, (n, 1).

    Attributes:
        T, U: kinetic and potential energy [J].
        phi: (m, 1) constraints of position.
        effort: (n, 1) generalised forces without potential.
    """

    q: SX
    v: SX
    T: SX
    U: SX
    phi: SX = field(default_factory=lambda: SX(0, 1))
    effort: SX | float = 0.0

    def motion(self, q0: Sequence[float], v0: Sequence[float], times: Array, first: float) -> Array:
        """(m, n) positions at times, starting with steps of length `first`."""
        n, m = len(q0), self.phi.shape[0]
        M, force = self._equations()
        J = casadi.jacobian(self.phi, self.q)
        rate = casadi.mtimes(J, self.v)
        bend = -casadi.mtimes(casadi.jacobian(rate, self.q), self.v)
        K = vertcat(horzcat(M, J.T), horzcat(J, SX(m, m)))
        x = vertcat(self.q, self.v)
        equations = casadi.Function("equations", [x], [K, vertcat(force, bend)])
        rows = casadi.Function("rows", [x], [J, self.phi, rate])

        def slope(_: float, state: Array) -> Array:
            matrix, right = equations(state)
            a = np.linalg.solve(matrix.full(), right.full())[:n, 0]
            return np.concatenate([state[n:], a])

        def project(state: Array) -> Array:
            for _ in range(2):
                A, r, s = (value.full() for value in rows(state))
                step = [np.linalg.lstsq(A, b, rcond=None)[0][:, 0] for b in (r, s)]
                state = state - np.concatenate(step)
            return state

        start = np.array([*q0, *v0], dtype=float)
        states: Array = solution(slope, start, times, TOLERANCE, project=project, first=first)
        return states[:, :n]

    def stiff_motion(self, q0: Sequence[float], v0: Sequence[float], times: Array) -> Array:
        """(m, n) positions at times of a system without constraints, by CVODES."""
        M, force = self._equations()
        x = vertcat(self.q, self.v)
        equations = {"x": x, "ode": vertcat(self.v, casadi.solve(M, force))}
        options = {"reltol": STIFF_TOLERANCE, "abstol": STIFF_TOLERANCE, "max_num_steps": 10**7}
        cvodes = casadi.integrator("motion", "cvodes", equations, times[0], list(times), options)
        return cvodes(x0=[*q0, *v0])["xf"].full().T[:, : len(q0)]

    def _equations(self) -> tuple[SX, SX]:
        """M and f of M a = f, without constraints."""
        momentum = casadi.gradient(self.T, self.v)
        drift = casadi.mtimes(casadi.jacobian(momentum, self.q), self.v)
        force = casadi.gradient(self.T - self.U, self.q) - drift + self.effort
        return casadi.jacobian(momentum, self.v), force


def squeezer(times: Array) -> Array:
    """(m, 2) x and y of F, the end of the crank, of Andrews' squeezing mechanism.

    Source: Hairer & Wanner 1996, section VII.7, equations and data.
    """
    q, v = SX.sym("q", 7), SX.sym("v", 7)
    beta, theta, gamma, phi, delta, omega, epsilon = casadi.vertsplit(q)
    A, B, C = SX([-0.06934, -0.00227]), SX([-0.03635, 0.03273]), SX([0.014, 0.072])
    F = 0.007 * _along(beta)
    E = F - 0.028 * _along(beta + theta)
    zt, u = A + 0.04 * _along(delta), A + 0.04 * _along(epsilon - pi / 2)
    parts = [
        (0.04325, 2.194e-6, 0.00092 * _along(beta), beta),
        (0.00365, 4.410e-7, F - 0.0115 * _along(beta + theta), beta + theta),
        (0.02373, 5.255e-6, B + _turned(gamma, 0.01043, -0.01874), gamma),
        (0.00706, 5.667e-7, zt + 0.00579 * _along(phi + delta - pi / 2), phi + delta),
        (0.07050, 1.169e-5, A + _turned(delta, 0.02308, 0.00916), delta),
        (0.00706, 5.667e-7, u + 0.00579 * _along(omega + epsilon), omega + epsilon),
        (0.05498, 1.912e-5, A + _turned(epsilon, -0.00449, -0.01228), epsilon),
    ]
    T = SX(0)
    for mass, inertia, place, angle in parts:
        T += (mass * casadi.sumsqr(_rate(place, q, v)) + inertia * _rate(angle, q, v) ** 2) / 2
    stretch = casadi.norm_2(B + _turned(gamma, 0.02, -0.018) - C) - 0.07785
    ends = [B + _turned(gamma, 0, -0.035), zt + 0.02 * _along(phi + delta - pi / 2)]
    ends.append(u + 0.02 * _along(omega + epsilon))
    effort = vertcat(0.033, SX(6, 1))
    model = Lagrange(q, v, T, 2265 * stretch**2, vertcat(*(end - E for end in ends)), effort)
    start = [-0.0617138900142764496358948458001, 0, 0.455279819163070380255912382449]
    start += [0.222668390165885884674473185609, 0.487364979543842550225598953530]
    start += [-0.222668390165885884674473185609, 1.23054744454982119249735015568]
    found = model.motion(start, [0.0] * 7, times, 1e-5)
    return 0.007 * np.column_stack([np.cos(found[:, 0]), np.sin(found[:, 0])])


def bricard(times: Array) -> Array:
    """(m, 3) end of the third rod of Bricard's mechanism.

    By its symmetry every second joint has the same angle, a or b, and the loop closes when
    sin a sin b + sin a + sin b = 0, which is checked at every time.

    Raises:
        ArithmeticError: the end of the fifth rod leaves its place on the ground.
    """
    q, v = SX.sym("q", 2), SX.sym("v", 2)
    T, U, turn, place, spin = SX(0), SX(0), SX.eye(3), SX(3, 1), SX(3, 1)
    along = np.array([[1, 0, 0], [0, -1, 0], [0, 0, 1], [-1, 0, 0], [0, 1, 0]])
    ends = []
    for k, (axis, rod) in enumerate(zip("yzxyz", along, strict=True)):
        spin += casadi.mtimes(turn, SX(np.eye(3)["xyz".index(axis)])) * v[k % 2]
        turn = casadi.mtimes(turn, _about(axis, q[k % 2]))
        u = casadi.mtimes(turn, SX(rod))
        middle = place + u / 2
        place = place + u
        ends.append(place)
        twist = casadi.dot(spin, u) ** 2
        across = casadi.sumsqr(spin) - twist
        T += (casadi.sumsqr(_rate(middle, q, v)) + (0.02 * twist + 1.01 * across) / 12) / 2
        U += G * middle[1]
    model = Lagrange(q, v, T, U, sin(q[0]) * sin(q[1]) + sin(q[0]) + sin(q[1]))
    found = model.motion([0, 0], [0, 0], times, 1e-3)
    places = casadi.Function("ends", [q], [ends[2], ends[4]])
    third, last = (value.full().T for value in places.map(len(times))(found.T))
    if not np.max(np.abs(last - [0, 0, 1])) < 1e-12:
        raise ArithmeticError("the loop is not closed: the reference is wrong")
    return third


def governor(times: Array) -> Array:
    """(m, 1) height of the slider of the flyball governor; both rods move alike."""
    q, v = SX.sym("q", 3), SX.sym("v", 3)
    s, alpha = q[1], q[2]
    spin, height = v[0], v[1]
    steel, arm = 3000.0, 0.05
    shaft, slider, rod, ball = steel * 1e-4, steel * 1e-3, steel * 1e-4, 5.0
    about = shaft * 2e-4 / 12 + slider * 0.02 / 12
    T = (about * spin**2 + slider * height**2) / 2
    long, thick = rod * (1 + 1e-4) / 12, rod * 2e-4 / 12
    turning = (thick * sin(alpha) ** 2 + long * cos(alpha) ** 2) * spin**2 + long * v[2] ** 2
    T += 2 * turning / 2
    U = slider * G * s
    for mass, at in ((rod, 0.5), (ball, 1.0)):
        out, down = arm + at * cos(alpha), at * sin(alpha)
        moving = (out * spin) ** 2 + casadi.sumsqr(_rate(vertcat(out, down), q, v))
        T += 2 * mass * moving / 2
        U -= 2 * mass * G * down
    length = casadi.norm_2(vertcat(0.5 * cos(alpha), 1 - 0.5 * sin(alpha) - s))
    U += 2 * 8e5 * (length - 0.5) ** 2 / 2
    effort = -2 * 4e4 * _rate(length, q, v) * casadi.gradient(length, q)
    model = Lagrange(q, v, T, U, effort=effort)
    return model.stiff_motion([0, 0.5, pi / 6], [2 * pi, 0, 0], times)[:, 1:2]


def _along(angle: SX) -> SX:
    return vertcat(cos(angle), sin(angle))


def _turned(angle: SX, x: float, y: float) -> SX:
    return vertcat(cos(angle) * x - sin(angle) * y, sin(angle) * x + cos(angle) * y)


def _rate(value: SX, q: SX, v: SX) -> SX:
    return casadi.jtimes(value, q, v)


def _about(axis: str, angle: SX) -> SX:
    """(3, 3) turn about x, y or z."""
    k = "xyz".index(axis)
    S = casadi.skew(SX(np.eye(3)[k]))
    return SX.eye(3) + sin(angle) * S + (1 - cos(angle)) * casadi.mtimes(S, S)
