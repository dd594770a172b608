"""Configurations of arms within a small distance of one singular configuration or of two."""

from __future__ import annotations

from functools import cache

import numpy as np
from support.arm_poses import stretched
from support.arm_search import plain_arm
from support.arms import general_6r
from support.catalogue_systems import catalogue_system

ROBOTS = ("puma560", "ur5", "rx90", "kr6", "general_6r")
KINDS = {
    "wrist": ("wrist",),
    "elbow": ("elbow",),
    "shoulder": ("shoulder",),
    "wrist and elbow": ("wrist", "elbow"),
    "wrist and shoulder": ("wrist", "shoulder"),
    "elbow and shoulder": ("elbow", "shoulder"),
}
_HALVINGS = 60


@cache
def robot(name):
    """A system of the catalogue, or an arm without a closed form."""
    return general_6r(0) if name == "general_6r" else catalogue_system(name)


@cache
def plain(name):
    """Its arm, by code that is no part of mbs."""
    return plain_arm(robot(name))


def near_singular(name, kind, seed):
    """A configuration (6,) next to singular ones of a kind, 1e-10 .. 1e-3 away from each [rad]."""
    rng = np.random.default_rng((7, seed, *f"{name} {kind}".encode()))
    system, q = robot(name), rng.uniform(-2.5, 2.5, 6)
    away = 10 ** rng.uniform(-10, -3, 3) * rng.choice((-1, 1), 3)
    if name == "general_6r":
        # of one kind only: where the determinant of the Jacobian changes its sign
        return _singular(name, q, rng, 2) + away[0] * np.eye(6)[2]
    return _moved(name, system, q, KINDS[kind], away, rng)


def _moved(name, system, q, kinds, away, rng):
    """A configuration moved to the distances `away` (3,) from singular ones."""
    if "wrist" in kinds:
        q[4] = away[0]
    if "elbow" in kinds:
        q = np.array([*q[:2], 0.0, *q[3:]]) if name == "ur5" else stretched(system, q)
        q[2] += away[1]
    if "shoulder" in kinds:
        q = _singular(name, q, rng, 1) + away[2] * np.eye(6)[1]
    return q


def _singular(name, q, rng, joint):
    """The configuration at which the Jacobian becomes singular when one joint moves."""
    for _ in range(200):
        values = np.linspace(-np.pi, np.pi, 60)
        every = np.tile(q, (60, 1))
        every[:, joint] = values
        signs = np.sign(_determinant(name, every))
        changes = np.flatnonzero(signs[1:] != signs[:-1])
        if len(changes):
            break
        q = q + rng.uniform(-0.3, 0.3, 6) * (np.arange(6) != 4) * (np.arange(6) != 2)
    low, high = every[changes[0]], every[changes[0] + 1]
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        if np.sign(_determinant(name, middle)) == signs[changes[0]]:
            low = middle
        else:
            high = middle
    return low


def _determinant(name, q):
    return np.linalg.det(plain(name).jacobian(q))


def told_apart(name, T, q, other):
    """By how much the arm misses T at most on the way from one solution to another one.

    The way may bend: points of the straight line are brought back across it. Two solutions between
    which an arm stays within rounding of the pose are one for whoever computes in doubles.
    """
    arm = plain(name)
    way = np.mod(other - q + np.pi, 2 * np.pi) - np.pi
    along = way / np.linalg.norm(way)
    x = q + np.linspace(0, 1, 9)[:, None] * way
    least = arm.residual(T, x)
    for _ in range(4):
        J = arm.jacobian(x)
        J = J - (J @ along)[..., None] * along
        pose = arm.pose(x)
        R = T[:3, :3] @ np.swapaxes(pose[:, :3, :3], 1, 2)
        turn = 0.5 * np.stack(
            [R[:, 2, 1] - R[:, 1, 2], R[:, 0, 2] - R[:, 2, 0], R[:, 1, 0] - R[:, 0, 1]], 1
        )
        gap = np.concatenate([T[:3, 3] - pose[:, :3, 3], turn], 1)
        x = x + (np.linalg.pinv(J, rcond=1e-10) @ gap[..., None])[..., 0]
        least = np.minimum(least, arm.residual(T, x))
    return float(np.max(least))


def at_distance(name, kind, seed, distance):
    """A configuration (6,) at 1 to 10 times a distance from singular ones of a kind [rad]."""
    rng = np.random.default_rng((11, seed, *f"{name} {kind}".encode()))
    system, q = robot(name), rng.uniform(-2.5, 2.5, 6)
    away = distance * rng.uniform(1, 10, 3) * rng.choice((-1, 1), 3)
    if name == "general_6r":
        return _singular(name, q, rng, 2) + away[0] * np.eye(6)[2]
    return _moved(name, system, q, KINDS[kind], away, rng)


def units_away(T, count, rng):
    """T (4, 4) with elements moved by -count, 0 or count units in the last place."""
    moved = T.copy()
    moved[:3] += rng.integers(-1, 2, (3, 4)) * count * np.spacing(np.abs(T[:3]))
    return moved
