"""Platforms on six legs in plain numbers: places of their ends, poses by search."""

import numpy as np

TRIPLES = {
    "6-6": (range(6), range(6)),
    "6-5": (range(6), (0, 1, 2, 3, 4, 4)),
    "6-4": (range(6), (0, 1, 2, 2, 3, 3)),
    "6-4, three in one": (range(6), (0, 1, 2, 3, 3, 3)),
    "5-5": ((0, 0, 1, 2, 3, 4), (0, 1, 2, 2, 3, 4)),
    "5-5, in a row": ((0, 0, 1, 2, 3, 4), (0, 1, 1, 2, 3, 4)),
    "4-4": ((0, 0, 1, 1, 2, 3), (0, 1, 1, 2, 2, 3)),
    "6-3": (range(6), (0, 0, 1, 1, 2, 2)),
    "6-3, three in one": (range(6), (0, 0, 0, 1, 1, 2)),
    "3-3": ((0, 0, 1, 1, 2, 2), (0, 1, 1, 2, 2, 0)),
}
"""Which ends are one, on the ground and on the platform."""

DEGREES = {
    "6-6": 40,
    "6-5": 40,
    "6-4": 32,
    "6-4, three in one": 16,
    "5-5": 24,
    "5-5, in a row": 40,
    "4-4": 24,
    "6-3": 16,
    "6-3, three in one": 8,
    "3-3": 16,
    "plane": 40,
    "semi-regular": 28,
    "point-symmetric": 24,
    "mirror": 36,
}
"""Complex poses."""


def ends(kind, rng):
    """(6, 3) ends on the ground and on the platform."""
    if kind in TRIPLES:
        low, high = TRIPLES[kind]
        return rng.normal(size=(6, 3))[list(low)], 0.7 * rng.normal(size=(6, 3))[list(high)]
    if kind == "plane":
        return rng.normal(size=(6, 3)) * [1, 1, 0], rng.normal(size=(6, 3)) * [0.7, 0.7, 0]
    if kind == "semi-regular":
        return hexagon(1.0, np.pi / 3 - rng.uniform(0.1, 0.4)), hexagon(0.6, rng.uniform(0.1, 0.4))
    half = [rng.normal(size=(3, 3)) for _ in range(2)]
    image = -np.eye(3) if kind == "point-symmetric" else np.diag([-1, 1, 1])
    return tuple(np.concatenate([points, points @ image]) for points in half)


def hexagon(radius, half):
    """Six points in pairs, this angle on either side of the middles of a triangle."""
    angles = np.repeat(2 * np.pi / 3 * np.arange(3), 2) + np.tile([-half, half], 3)
    return radius * np.column_stack([np.cos(angles), np.sin(angles), 0 * angles])


def lengths_at(a, b, e, p):
    """(6,) of the legs where the platform is at p, rotated by the quaternion e."""
    return np.linalg.norm(p + b @ matrix(e).T - a, axis=1)


def matrix(e):
    """The rotation by a quaternion of any length."""
    w, v = e[0] / np.linalg.norm(e), np.array(e[1:]) / np.linalg.norm(e)
    K = np.cross(v, np.eye(3)).T
    return np.eye(3) + 2 * w * K + 2 * K @ K


def random_pose(rng):
    """A quaternion and a place."""
    e = rng.normal(size=4)
    return e / np.linalg.norm(e), rng.normal(size=3)


def searched(a, b, length, starts, seed):
    """Distinct poses, quaternions and places, to which Levenberg and Marquardt's steps lead."""
    rng = np.random.default_rng(seed)
    e = rng.normal(size=(starts, 4))
    e /= np.linalg.norm(e, axis=1, keepdims=True)
    p = rng.normal(size=(starts, 3)) * np.max(length)

    def rows(e, p):
        arm = np.array([b @ matrix(own).T for own in e])
        way = p[:, None, :] + arm - a
        J = 2 * np.concatenate([way, np.cross(arm, way)], axis=2)
        return np.sum(way**2, axis=2) - length**2, J

    r, J = rows(e, p)
    cost, damping = np.sum(r**2, axis=1), np.full(starts, 1e-2)
    for _ in range(120):
        H = np.einsum("kij,kil->kjl", J, J) + (damping * cost + 1e-18)[:, None, None] * np.eye(6)
        step = -np.linalg.solve(H, np.einsum("kij,ki->kj", J, r)[..., None])[..., 0]
        w, v = np.ones((starts, 1)), step[:, 3:] / 2
        scalar = w * e[:, :1] - np.sum(v * e[:, 1:], axis=1, keepdims=True)
        vector = w * e[:, 1:] + e[:, :1] * v + np.cross(v, e[:, 1:])
        tried_e, tried_p = np.concatenate([scalar, vector], axis=1), p + step[:, :3]
        tried_e /= np.linalg.norm(tried_e, axis=1, keepdims=True)
        tried_r, tried_J = rows(tried_e, tried_p)
        tried_cost = np.sum(tried_r**2, axis=1)
        better = tried_cost < cost
        e[better], p[better] = tried_e[better], tried_p[better]
        r[better], J[better] = tried_r[better], tried_J[better]
        cost = np.where(better, tried_cost, cost)
        damping = np.where(better, damping * 0.2, damping * 5).clip(1e-12, 1e30)
    found = []
    for k in np.flatnonzero(cost < 1e-22):
        if all(distance(e[k], p[k], *other) > 1e-4 for other in found):
            found.append((e[k], p[k]))
    return found


def distance(e, p, other_e, other_p):
    """Between two poses, quaternions up to their sign."""
    turn = min(np.abs(e - other_e).max(), np.abs(e + other_e).max())
    return max(turn, np.abs(p - other_p).max())


def missed(poses, found):
    """How many of the poses that a search found are not there."""
    own = [(x[3:], x[:3]) for x in poses.values]
    return sum(all(distance(*pose, *other) > 1e-3 for other in own) for pose in found)
