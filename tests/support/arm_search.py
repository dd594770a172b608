"""Every configuration of an arm for a pose, by damped Gauss-Newton from many random starts.

It shares nothing with the solvers but the numbers of the arm: the constant poses between its
joints, read off the direct geometric models of single links.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import mbs
from mbs.models.geometry import terminal_frame

CLOSED = 1e-10
MERGED = 1e-4
_ROUND, _ROUNDS, _STEPS = 250, 12, 60


@dataclass(frozen=True, slots=True, eq=False)
class PlainArm:
    """Constant poses (n + 1, 4, 4) before, between and after n joints; which of them slide."""

    gaps: np.ndarray
    slides: np.ndarray

    @property
    def reach(self):
        """The sum of its lengths [m]."""
        return float(np.linalg.norm(self.gaps[:, :3, 3], axis=1).sum()) or 1.0

    def pose(self, q):
        """(..., 4, 4) pose of the tool at configurations q (..., n)."""
        return self._chain(np.asarray(q, dtype=float))[0]

    def jacobian(self, q):
        """(..., 6, n) of the velocity and the rotation speed of the tool, in the base."""
        T, frames = self._chain(np.asarray(q, dtype=float))
        columns = []
        for k, slide in enumerate(self.slides):
            z, arm = frames[k][..., :3, 2], T[..., :3, 3] - frames[k][..., :3, 3]
            linear, turn = (z, 0 * z) if slide else (np.cross(z, arm), z)
            columns.append(np.concatenate([linear, turn], axis=-1))
        return np.stack(columns, axis=-1)

    def smallest(self, q):
        """The smallest singular value of the Jacobian, its lengths divided by the reach."""
        J = self.jacobian(q)
        J[..., :3, :] /= self.reach
        J[..., :, self.slides] *= self.reach
        return np.linalg.svd(J, compute_uv=False)[..., -1]

    def residual(self, T, q):
        """The largest element of the tool's pose at q less T."""
        return np.max(np.abs(self.pose(q) - T), axis=(-1, -2))

    def random(self, rng, count=None):
        """Configurations, (count, n) or (n,): any angles, slides within half the reach."""
        shape = (len(self.slides),) if count is None else (count, len(self.slides))
        wide = np.where(self.slides, 0.5 * self.reach, np.pi)
        return rng.uniform(-wide, wide, shape)

    def _chain(self, q):
        T = np.broadcast_to(self.gaps[0], (*q.shape[:-1], 4, 4))
        frames = []
        for k, slide in enumerate(self.slides):
            frames.append(T)
            J = np.zeros((*q.shape[:-1], 4, 4))
            J[..., range(4), range(4)] = 1
            if slide:
                J[..., 2, 3] = q[..., k]
            else:
                J[..., 0, 0] = J[..., 1, 1] = np.cos(q[..., k])
                J[..., 1, 0] = np.sin(q[..., k])
                J[..., 0, 1] = -J[..., 1, 0]
            T = T @ J @ self.gaps[k + 1]
        return T, frames


def plain_arm(system, locked=None):
    """The arm of an open chain; locked joints, by name, are part of the constant poses."""
    zero, held = np.zeros(system.nq), dict(locked or {})
    gaps, slides = [np.eye(4)], []
    for k, row in enumerate(system.coordinates):
        gaps[-1] = gaps[-1] @ np.array(mbs.models.transform(system, k + 1, k)(zero))
        if row.name in held:
            step = np.eye(4)
            c, s = np.cos(held[row.name]), np.sin(held[row.name])
            step[:2, :2] = [[c, -s], [s, c]]
            gaps[-1] = gaps[-1] @ step
            continue
        slides.append(row.unit == "m")
        gaps.append(np.eye(4))
    last, hand = len(system.coordinates), terminal_frame(system)
    gaps[-1] = gaps[-1] @ np.array(mbs.models.transform(system, hand, last)(zero))
    return PlainArm(np.array(gaps), np.array(slides))


def searched(arm, T, seed=0):
    """All configurations (m, n) that lead to T; more starts until three rounds find nothing new.

    Not valid close to two singularities at once, where the search crawls.
    """
    rng, found, quiet = np.random.default_rng(seed), np.empty((0, len(arm.slides))), 0
    for _ in range(_ROUNDS):
        before = len(found)
        found = merged(arm, T, np.concatenate([found, some(arm, T, rng)]))
        quiet = quiet + 1 if len(found) == before else 0
        if quiet == 3:
            break
    return found


def some(arm, T, rng, starts=_ROUND):
    """Configurations (m, n) that random starts lead to, as often as they do."""
    q = _descended(arm, T, arm.random(rng, starts) * np.where(arm.slides, 3, 1))
    return q[arm.residual(T, q) < CLOSED]


def merged(arm, T, q, tolerance=MERGED):
    """One configuration of each bunch, that of the smallest residual; angles in (-pi, pi]."""
    q = wrapped(arm, q[np.argsort(arm.residual(T, q))])
    kept = list[np.ndarray]()
    for configuration in q:
        if not kept or np.min(distance(arm, np.array(kept), configuration)) > tolerance:
            kept.append(configuration)
    return np.array(kept).reshape(-1, len(arm.slides))


def wrapped(arm, q):
    """The configurations with their angles in (-pi, pi]."""
    return np.where(arm.slides, q, np.pi - np.mod(np.pi - q, 2 * np.pi))


def distance(arm, q, other):
    """The largest difference of a joint, angles up to whole turns."""
    gap = np.subtract(q, other)
    gap = np.where(arm.slides, gap, np.remainder(gap + np.pi, 2 * np.pi) - np.pi)
    return np.max(np.abs(gap), axis=-1, initial=0.0)


def _descended(arm, T, q):
    """Levenberg's steps, the damping of each start by itself."""
    damping = np.full(len(q), 1e-2)
    error = _error(arm, T, q)
    size = np.sum(error**2, axis=-1)
    for step in range(_STEPS):
        J = arm.jacobian(q)
        J[:, :3] /= arm.reach
        H = np.swapaxes(J, 1, 2) @ J
        H = H + (damping * size + 1e-15)[:, None, None] * np.eye(q.shape[1])
        new = q + np.linalg.solve(H, np.swapaxes(J, 1, 2) @ error[..., None])[..., 0]
        other = _error(arm, T, new)
        smaller = np.sum(other**2, axis=-1)
        better = smaller < size
        q, error = np.where(better[:, None], new, q), np.where(better[:, None], other, error)
        size = np.where(better, smaller, size)
        damping = np.where(better, damping / 4, damping * 8).clip(1e-4, 1e8)
        if step % 10 == 9:
            hopeful = size < np.array([np.inf, np.inf, 1e-2, 1e-4, 1e-6, 1e-8])[step // 10]
            q, error, size, damping = (x[hopeful] for x in (q, error, size, damping))
    return q


def _error(arm, T, q):
    """(..., 6) translation over the reach, and rotation as an angle times an axis."""
    now = arm.pose(q)
    R = T[:3, :3] @ np.swapaxes(now[..., :3, :3], -1, -2)
    S = R - np.swapaxes(R, -1, -2)
    turn = np.stack([S[..., 2, 1], S[..., 0, 2], S[..., 1, 0]], axis=-1) / 2
    sine = np.linalg.norm(turn, axis=-1)
    angle = np.arctan2(sine, (np.trace(R, axis1=-2, axis2=-1) - 1) / 2)
    turn = turn * np.where(sine > 1e-8, angle / np.maximum(sine, 1e-300), 1.0)[..., None]
    return np.concatenate([(T[:3, 3] - now[..., :3, 3]) / arm.reach, turn], axis=-1)
