"""Arms as bare numbers, for tests of what works on numbers."""

import numpy as np

from mbs.closed_forms.arm import Arm


def khalil(rows, slides=None):
    """Rows (alpha, d, theta, r) of Khalil & Kleinfinger; q adds to theta, or to r of a slide."""
    gaps = [np.eye(4)]
    for alpha, d, theta, r in rows:
        gaps[-1] = gaps[-1] @ _turned("x", alpha) @ _moved(d, 0, 0)
        gaps.append(_turned("z", theta) @ _moved(0, 0, r))
    return _arm(gaps, slides)


def denavit_hartenberg(rows):
    """Rows (d, a, alpha), q being theta."""
    gaps = [_moved(0, 0, d) @ _moved(a, 0, 0) @ _turned("x", alpha) for d, a, alpha in rows]
    return _arm([np.eye(4), *gaps], None)


def puma():
    """A spherical wrist: eight solutions."""
    h = np.pi / 2
    rows = [(0, 0, 0, 0), (-h, 0, 0, 0), (0, 0.4318, 0, 0.15), (-h, 0.02, 0, 0.4318)]
    return khalil([*rows, (h, 0, 0, 0), (-h, 0, 0, 0)])


def manseur_doty():
    """The arm and the pose with sixteen solutions of Manseur & Doty, from Manocha & Canny 1994."""
    h, small = np.pi / 2, np.pi / 180
    rows = [(0, 0.3, h), (0, 1, small), (0.2, 0, h), (0, 1.5, small), (0, 0, h)]
    T = np.array(
        [
            [-0.760117, -0.641689, 0.102262, -1.140175],
            [0.133333, 0, 0.991071, 0],
            [-0.635959, 0.766965, 0.085558, 0],
            [0, 0, 0, 1],
        ]
    )
    u, _, v = np.linalg.svd(T[:3, :3])
    T[:3, :3] = u @ v
    return denavit_hartenberg([*rows, (0, 0, small)]), T


def random_arm(rng, size, slides=None):
    """Axes that neither meet nor are parallel."""
    draw = rng.uniform
    rows = [(draw(-3, 3), draw(-0.5, 0.5), draw(-3, 3), draw(-0.5, 0.5)) for _ in range(size)]
    return khalil(rows, slides)


def apart(arm, a, b):
    """(len(a), len(b)) largest differences of joints, angles modulo whole turns."""
    d = np.asarray(a)[:, None] - np.asarray(b)[None]
    turns = (d + np.pi) % (2 * np.pi) - np.pi
    return np.abs(np.where(arm.prismatic, d, turns)).max(axis=-1)


def _arm(gaps, slides):
    names = tuple(f"j{k + 1}" for k in range(len(gaps) - 1))
    kinds = np.zeros(len(names), dtype=bool) if slides is None else np.array(slides, dtype=bool)
    return Arm(names, kinds, np.array(gaps))


def _turned(axis, angle):
    i, j = {"x": (1, 2), "z": (0, 1)}[axis]
    T = np.eye(4)
    T[i, i] = T[j, j] = np.cos(angle)
    T[j, i], T[i, j] = np.sin(angle), -np.sin(angle)
    return T


def _moved(x, y, z):
    T = np.eye(4)
    T[:3, 3] = x, y, z
    return T
