"""A chain of hinges whose last body is bound to the ground again, in world axes with numpy."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

X, Y, Z = np.eye(3)


@dataclass(frozen=True)
class Part:
    """A hinge where it is in the configuration at zero, and the body behind it.

    Attributes:
        point: on the axis [m].
        axis: unit vector.
        mass, com, inertia: of the body, com in the configuration at zero, inertia about it.
    """

    point: np.ndarray
    axis: np.ndarray
    mass: float = 0.0
    com: np.ndarray = field(default_factory=lambda: np.zeros(3))
    inertia: np.ndarray = field(default_factory=lambda: np.zeros((3, 3)))


@dataclass(frozen=True)
class Moved:
    """A body: R, the place p of what was at the origin, w, and accelerations at constant v."""

    R: np.ndarray
    p: np.ndarray
    w: np.ndarray
    wd: np.ndarray
    a: np.ndarray

    def acceleration(self, arm):
        """Of the point at `arm` from p, at constant v."""
        return self.a + _cross(self.wd, arm) + _cross(self.w, _cross(self.w, arm))


@dataclass(frozen=True)
class Chain:
    """Parts from the ground on; a point of the last body meets the ground again.

    Attributes:
        parts: the chain.
        end: that point in the configuration at zero.
        held: which of x, y, z it may not move along (0, 1, 2), the body turn about (3, 4, 5).
        rank: of these rows, where some follow from the others.
        gravity: [m/s^2].
    """

    parts: Sequence[Part]
    end: np.ndarray
    held: Sequence[int]
    rank: int
    gravity: np.ndarray

    def accelerations(self, q, v):
        """Of the hinges; the best combinations of the rows are the constraints."""
        n = len(q)
        M, h = np.zeros((n, n)), np.zeros(n)
        bodies, axes, places = self._moved(q, v)
        for k, (part, body) in enumerate(zip(self.parts, bodies, strict=True)):
            if not part.mass:
                continue
            J, bias = _jacobian(body, axes, places, k, part.com)
            inertia = body.R @ part.inertia @ body.R.T
            force = part.mass * (bias[:3] - self.gravity)
            moment = inertia @ bias[3:] + _cross(body.w, inertia @ body.w)
            M += part.mass * J[:3].T @ J[:3] + J[3:].T @ inertia @ J[3:]
            h += J[:3].T @ force + J[3:].T @ moment
        J, bias = _jacobian(bodies[-1], axes, places, n - 1, self.end)
        U, sizes, V = np.linalg.svd(J[self.held])
        J, bias = V[: self.rank], (U.T @ bias[self.held])[: self.rank] / sizes[: self.rank]
        matrix = np.block([[M, J.T], [J, np.zeros((self.rank, self.rank))]])
        return np.linalg.solve(matrix, np.concatenate([-h, -bias]))[:n]

    def point(self, q, k, at):
        """Where the point of body k is that is at `at` in the configuration at zero."""
        body = self._moved(q, np.zeros(len(q)))[0][k]
        return body.p + body.R @ at

    def closed(self, x):
        """The state [q; v] put on the loop by the shortest Newton steps."""
        n = len(x) // 2
        q, v = x[:n].copy(), x[n:]
        for _ in range(20):
            bodies, axes, places = self._moved(q, v)
            J = _jacobian(bodies[-1], axes, places, n - 1, self.end)[0][self.held]
            R = bodies[-1].R
            turn = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / 2
            gap = np.concatenate([bodies[-1].p + R @ self.end - self.end, turn])[self.held]
            U, sizes, V = np.linalg.svd(J, full_matrices=False)
            inverse = V[: self.rank].T / sizes[: self.rank] @ U[:, : self.rank].T
            if np.max(np.abs(gap)) < 1e-12:
                return np.concatenate([q, v - inverse @ (J @ v)])
            q -= inverse @ gap
        raise AssertionError("the chain does not close")

    def _moved(self, q, v):
        """The bodies, and the axes and places of the hinges as columns."""
        body = Moved(np.eye(3), *np.zeros((4, 3)))
        bodies, axes, places = [], [], []
        for part, x, dx in zip(self.parts, q, v, strict=True):
            e, arm = body.R @ part.axis, body.R @ part.point
            c, of_c = body.p + arm, body.acceleration(arm)
            R = body.R @ _turn(part.axis, x)
            w, wd = body.w + e * dx, body.wd + _cross(body.w, e) * dx
            back = R @ part.point
            body = Moved(R, c - back, w, wd, of_c - _cross(wd, back) - _cross(w, _cross(w, back)))
            bodies.append(body)
            axes.append(e)
            places.append(c)
        return bodies, np.array(axes).T, np.array(places).T


def _jacobian(body, axes, places, k, point):
    """Of a point of body k: (6, n), and its acceleration and its body's at constant v."""
    arm = body.R @ point
    J = np.zeros((6, axes.shape[1]))
    J[:3, : k + 1] = _cross(axes[:, : k + 1], (body.p + arm)[:, None] - places[:, : k + 1])
    J[3:, : k + 1] = axes[:, : k + 1]
    return J, np.concatenate([body.acceleration(arm), body.wd])


def _cross(a, b):
    return np.array(
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    )


def _turn(axis, angle):
    K = np.cross(axis, np.eye(3)).T
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K
