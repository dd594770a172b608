"""Configurations: random ones, and those that Gauss-Newton finds from many random starts."""

from __future__ import annotations

import numpy as np

from mbs.assembly.tree import quaternion_slices
from mbs.closed_forms.ring import independent_indices
from mbs.loops.closing import Closing, closure_parameters


def near_assembled(system, reach, seed):
    """A random configuration of the opened tree around the assembled one, quaternions unit."""
    rng = np.random.default_rng(seed)
    q = np.array(system.configuration) + rng.uniform(-reach, reach, system.nq)
    for part in quaternion_slices(system.tree):
        q[part] /= np.linalg.norm(q[part])
    return q


def searched(system, q_a, starts=150, seed=0, reach=3.5):
    """All configurations with these independent positions that random starts lead to.

    Rods that spin do so as they like.
    """
    rng = np.random.default_rng(seed)
    given = [(k, x) for k, x in zip(independent_indices(system), q_a, strict=True) if k < system.nq]
    indices, q_a = [k for k, _ in given], [x for _, x in given]
    closing = Closing(system, closure_parameters(system), tuple(indices))
    found = []
    for _ in range(starts):
        q = rng.uniform(-reach, reach, system.nq)
        q[indices] = q_a
        closed = closing.nearest(q)
        if closed.is_closed and not any(same(system, closed.q, other) for other in found):
            found.append(closed.q)
    return found


def same(system, q, other, tolerance=1e-5):
    """Whether two configurations agree, angles up to whole turns, quaternions up to their sign."""
    gap = np.subtract(q, other)
    turns = [coordinate.unit == "rad" for coordinate in system.coordinates]
    gap[turns] = np.remainder(gap[turns] + np.pi, 2 * np.pi) - np.pi
    for part in quaternion_slices(system.tree):
        opposite = np.add(q[part], other[part])
        gap[part] = min(gap[part], opposite, key=lambda x: np.abs(x).max())
    return np.abs(gap).max(initial=0.0) < tolerance


def active(system, q=None):
    """The positions of the independent joints at a configuration, the assembled one if none is
    given.

    Rods that spin are as in the assembled configuration.
    """
    whole = np.array(system.configuration if q is None else q)
    return np.array([whole[k] if k < system.nq else 0.0 for k in independent_indices(system)])
