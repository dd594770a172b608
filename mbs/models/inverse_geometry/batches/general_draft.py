"""What the general method gives for many poses, and which of them it leaves in doubt."""

from __future__ import annotations

import numpy as np

from mbs.models.inverse_geometry.answers.gathering import general_ready
from mbs.models.inverse_geometry.answers.target import Target
from mbs.models.inverse_geometry.arm import Array
from mbs.models.inverse_geometry.batches.draft import BranchSolutions
from mbs.models.inverse_geometry.chain import Chain
from mbs.models.inverse_geometry.numeric.general import General, general_many

_NEARLY_SINGULAR = 1e-4
"""Smallest singular value below which a solution next to the one found may be missing."""
_REGULAR = 1e-9


def ready(chain: Chain, p: Array) -> General | None:
    """The general method of a chain for parameters p, (np,); None where it hardly holds."""
    found = general_ready(chain, p)
    return found if found and found.prepared.regularity >= _REGULAR else None


def general_draft(general: General, T: Array) -> BranchSolutions:
    """The solutions by the general method, in no order.

    Args:
        general: the method, made ready for an arm.
        T: (N, 4, 4) poses [m].
    """
    arm = general.arm
    pose, q = general_many(general, T)
    first = np.searchsorted(pose, np.arange(len(T)))
    column = np.arange(len(q)) - first[pose]
    shape = len(T), int(np.max(column, initial=-1)) + 1
    every, valid = np.zeros((*shape, arm.size)), np.zeros(shape, dtype=bool)
    residual, searched = np.full(shape, np.inf), np.zeros(len(T), dtype=bool)
    target = Target(arm, T[pose])
    reached, least = target.residual(q), target.singular_values(q)[:, -1]
    every[pose, column], valid[pose, column], residual[pose, column] = q, True, reached
    unsure = (least < _NEARLY_SINGULAR) | (reached > target.tolerance)
    searched[pose[unsure]] = True
    return BranchSolutions(every, valid, residual, ("",) * shape[1], searched)
