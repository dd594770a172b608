"""Equations of plane loops with random lengths that close somewhere, and their roots by search."""

import numpy as np

from mbs.closed_forms.planar_loops import KNOWN, PlanarLoops


def complex_numbers(rng, *shape):
    """Of normal distribution."""
    return rng.normal(size=shape) + 1j * rng.normal(size=shape)


def closed_loops(rng, count, slides=0, zeros=()):
    """So many loops in twice as many unknowns, at elements of `zeros` without a link."""
    angles = complex_numbers(rng, count, 2 * count - slides)
    for r, k in zeros:
        angles[r, k] = 0
    return closed(rng, angles, complex_numbers(rng, count, slides), [KNOWN] * slides)


def triad(rng, kinds):
    """A platform on three legs.

    Args:
        rng: of lengths and directions.
        kinds: of each leg its passive joints from the ground on: "RR", "PR" or "RP".
    """
    E = np.array([[1, -1, 0], [1, 0, -1]], complex)
    angles, slides, carriers = [E @ complex_numbers(rng, 3) / 2], [], []
    for k, kind in enumerate(kinds):
        if kind == "RR":
            angles.append(-E[:, k] * rng.uniform(0.3, 1.5))
        else:
            slides.append(-E[:, k] * np.exp(1j * rng.uniform(0, 6)))
            carriers.append(KNOWN if kind == "PR" else 0)
    return closed(rng, np.array(angles).T, np.array(slides).reshape(-1, 2).T, carriers)


def closed(rng, angles, slides, carriers):
    """The constant such that random angles and displacements close the loops."""
    theta = rng.uniform(-np.pi, np.pi, (1, angles.shape[1]))
    s = rng.uniform(-1, 1, (1, slides.shape[1]))
    carriers = np.array(carriers, dtype=int)
    loops = PlanarLoops(angles, slides, carriers, np.zeros(len(angles), complex))
    return PlanarLoops(angles, slides, carriers, -loops.rows(theta, s)[0][0])


def searched(loops, starts, seed, reach=3.0):
    """(r, n + m) distinct roots to which Levenberg and Marquardt's steps lead."""
    n, m = loops.counts
    rng = np.random.default_rng(seed)
    x = rng.uniform(-1, 1, (starts, n + m)) * np.array([np.pi] * n + [reach] * m)

    def rows(x):
        value, slope = loops.rows(x[:, :n], x[:, n:])
        return (
            np.concatenate([value.real, value.imag], axis=1),
            np.concatenate([slope.real, slope.imag], axis=1),
        )

    r, J = rows(x)
    cost, damping = np.sum(r**2, axis=1), np.full(starts, 1e-2)
    for _ in range(80):
        shift = damping * cost + 1e-16
        H = np.einsum("kij,kil->kjl", J, J) + shift[:, None, None] * np.eye(n + m)
        g = np.einsum("kij,ki->kj", J, r)
        tried = x - np.linalg.solve(H, g[..., None])[..., 0]
        tried_r, tried_J = rows(tried)
        tried_cost = np.sum(tried_r**2, axis=1)
        better = tried_cost < cost
        x[better], r[better], J[better] = tried[better], tried_r[better], tried_J[better]
        cost = np.where(better, tried_cost, cost)
        damping = np.where(better, damping * 0.2, damping * 5).clip(1e-12, 1e30)
    found = []
    for own in x[cost < 1e-24]:
        if all(distance(loops, own, other) > 1e-5 for other in found):
            found.append(own)
    return np.array(found).reshape(-1, n + m)


def distance(loops, x, other):
    """Between two configurations, angles up to whole turns."""
    n, _ = loops.counts
    turn = np.abs(np.exp(1j * x[:n]) - np.exp(1j * other[:n]))
    return max(turn.max(initial=0.0), np.abs(x[n:] - other[n:]).max(initial=0.0))


def missed(loops, roots, found):
    """How many of the roots that a search found are not there."""
    return sum(all(distance(loops, x, own) > 1e-4 for own in roots.values) for x in found)
