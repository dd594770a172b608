"""What the general method gives for many poses, and which of them it leaves in doubt."""

from __future__ import annotations

import numpy as np

from mbs.errors import ModelError, NoClosedForm
from mbs.models.inverse_geometry.answers.target import SOLVED
from mbs.models.inverse_geometry.arm import Arm, Array
from mbs.models.inverse_geometry.batches.draft import Draft
from mbs.models.inverse_geometry.numeric.general import General, general_many, general_of

_NEARLY_SINGULAR = 1e-4
"""Smallest singular value below which a solution next to the one found may be missing."""
_REGULAR = 1e-9


def ready(arm: Arm) -> General | None:
    """The general method of an arm; None where it does not hold, or hardly."""
    try:
        found = general_of(arm)
    except (ModelError, NoClosedForm):
        return None
    return found if found.prepared.regularity >= _REGULAR else None


def general_draft(general: General, T: Array) -> Draft:
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
    reached, least = _residual_and_least(arm, q, T[pose])
    every[pose, column], valid[pose, column], residual[pose, column] = q, True, reached
    unsure = (least < _NEARLY_SINGULAR) | (reached > SOLVED * max(1.0, arm.length))
    searched[pose[unsure]] = True
    return Draft(every, valid, residual, ("",) * shape[1], searched)


def _residual_and_least(arm: Arm, q: Array, T: Array) -> tuple[Array, Array]:
    """(m,) residuals, and smallest singular values of the Jacobian, in lengths of the arm."""
    pose, J = arm.pose_and_jacobian(q)
    J[..., :3, :] /= arm.length
    J = J * np.where(arm.prismatic, arm.length, 1.0)
    residual: Array = np.max(np.abs(pose - T), axis=(-2, -1))
    least: Array = np.asarray(np.linalg.svd(J, compute_uv=False)[..., -1], dtype=np.float64)
    return residual, least
