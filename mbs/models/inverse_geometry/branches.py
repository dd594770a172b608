"""Names of the branches of an inverse geometric model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mbs.closed_forms.arm import Arm, Array
from mbs.closed_forms.sequence import StepSequence
from mbs.models.inverse_geometry.chain import FrameChain
from mbs.models.inverse_geometry.closed_form import at_poses, plain_branches

# Branch names of an arm with a spherical wrist: shoulder, elbow, wrist.
#
# Source: Lee & Ziegler 1984, definitions of the arm, elbow and wrist indicators.


_PARALLEL = 1e-9
"""Sine or cosine between axes, or fraction of the arm length, that counts as zero. Products of six
transforms have rounding errors of 1e-15, model data with twelve digits 1e-12."""
_UNDECIDED = 1e-9
"""Largest indicator of a branch (lengths divided by the arm length) at which two branches meet. The
sign of the indicator is due to rounding there, so no name is used."""
_MEETING = 1e-5
"""Largest indicator at a multiple root at which branches meet. Rounding of a pose by 2e-14 moves a
double root by 2e-7, and solutions up to 1e-6 apart are one."""


@dataclass(frozen=True, slots=True)
class BranchLabels:
    """Parts of an arm that distinguish named branches.

    Attributes:
        shoulder: whether axes 1 and 2 are perpendicular, so that the wrist centre is on either side
            of the plane through axis 2 and parallel to axis 1.
        elbow: whether axes 2 and 3 are parallel, so that the elbow is above or below the line from
            the shoulder to the wrist centre.
        wrist: whether axes 4, 5 and 6 intersect in one point.
    """

    shoulder: bool
    elbow: bool
    wrist: bool


def anatomy(arm: Arm) -> BranchLabels:
    """Return whether an arm has a shoulder, an elbow and a spherical wrist."""
    if arm.size != 6 or any(arm.prismatic[3:]) or not _wrist_meets(arm):
        return BranchLabels(False, False, False)
    axes, origins = arm.lines(np.zeros(6))
    shoulder = not any(arm.prismatic[:2]) and abs(axes[0] @ axes[1]) < _PARALLEL
    parallel = np.linalg.norm(np.cross(axes[1], axes[2])) < _PARALLEL
    apart = np.linalg.norm(np.cross(axes[1], origins[2] - origins[1])) > _PARALLEL * arm.length
    elbow = shoulder and not arm.prismatic[2] and bool(parallel and apart)
    return BranchLabels(bool(shoulder), elbow, True)


def labels(
    arm: Arm, has: BranchLabels, q: Array, meeting: NDArray[np.bool_] | None = None
) -> list[str]:
    """Return branch names of configurations, such as "shoulder right, elbow up, no flip".

    A part of the name is omitted at the boundary of two branches. For an arm without a spherical
    wrist all names are empty.

    Args:
        arm: numeric geometry of the chain.
        has: named parts of the arm (shoulder, elbow, wrist).
        q: (m, n) configurations [rad or m].
        meeting: (m,) whether each configuration is a multiple root; default is False.
    """
    if not has.wrist:
        return [""] * len(q)
    axes, points = arm.lines(q)
    a, p = np.moveaxis(axes, 1, 0), np.moveaxis(points, 1, 0)
    reach = _meeting(a[4], p[4], a[5], p[5]) - p[1]
    right = _dot(a[0], np.cross(a[1], reach)) / arm.length
    bend = _dot(a[1], np.cross(reach, p[2] - p[1])) / arm.length**2
    turn = _dot(np.cross(a[3], a[5]), a[4])
    met = np.zeros(len(q), dtype=bool) if meeting is None else meeting
    zero = np.where(met, _MEETING, _UNDECIDED)
    return [_label(has, *four) for four in zip(right, bend, turn, zero, strict=True)]


def _label(has: BranchLabels, right: float, bend: float, turn: float, zero: float) -> str:
    names = []
    if has.shoulder and abs(right) > zero:
        names.append("shoulder right" if right > 0 else "shoulder left")
    if has.elbow:
        names.append(_elbow(bend, right, zero))
    if abs(turn) > zero:
        names.append("no flip" if turn > 0 else "flip")
    return ", ".join(name for name in names if name)


def _elbow(bend: float, right: float, zero: float) -> str:
    if abs(bend) <= zero:
        return "elbow straight"
    if abs(right) <= zero:
        return ""
    return "elbow up" if bend * right > 0 else "elbow down"


def _wrist_meets(arm: Arm) -> bool:
    """Whether axes 4, 5, 6 intersect in one point: always if they do at two configurations."""
    # two generic configurations [rad or m], without joints at zero or half a revolution
    return all(_meet(arm, q) for q in (np.full(6, 0.3), np.full(6, 1.1)))


def _meet(arm: Arm, q: Array) -> bool:
    axes, points = arm.lines(q)
    if min(np.linalg.norm(np.cross(axes[k], axes[k + 1])) for k in (3, 4)) < _PARALLEL:
        return False
    centre = _meeting(axes[4], points[4], axes[5], points[5])
    away = [np.linalg.norm(np.cross(axes[k], centre - points[k])) for k in (3, 4, 5)]
    return bool(max(away) < _PARALLEL * arm.length)


def _meeting(a: Array, p: Array, b: Array, r: Array) -> Array:
    """Return the point (..., 3) of the line (p, a) nearest to the line (r, b)."""
    n = np.cross(a, b)
    s = _dot(np.cross(r - p, b), n) / _dot(n, n)
    return np.asarray(p + s[..., None] * a, dtype=float)


def _dot(a: Array, b: Array) -> Array:
    return np.asarray(np.sum(a * b, axis=-1), dtype=float)


# Branch names of a closed form: shoulder, elbow and wrist if they are one to one, else its signs.


_SAMPLES, _SEED = 1000, 20261123
"""Number of random configurations at which branches are named: enough to meet each of eight
branches, and to meet a branch with a varying name under both names."""


def branch_labels(chain: FrameChain, sequence: StepSequence, p: Array) -> tuple[str, ...]:
    """Return the names of all branches of a closed form, cached on the system.

    Names of shoulder, elbow and wrist are used if each branch has a unique name at all
    configurations. Otherwise, and for chains with varied joints, names are signs such as
    "q3:+ q2:- q5:+".

    Args:
        chain: chain that is solved for.
        sequence: closed form of the chain, for the same p.
        p: (np,) parameter values.
    """
    signs = tuple(sequence.label(b) or "1" for b in range(sequence.branches))

    def named() -> tuple[str, ...]:
        if chain.varied:
            return signs
        arm = chain.arm(p)
        has = anatomy(arm)
        names = _names_at_samples(chain, sequence, p, arm, has) if has.wrist else []
        if names and len(set(names)) == len(names) and all(names):
            return tuple(names)
        return signs

    found: tuple[str, ...] = chain.system.cached(
        ("branch labels", sequence, *chain.key, p.tobytes()), named
    )
    return found


def _names_at_samples(
    chain: FrameChain, sequence: StepSequence, p: Array, arm: Arm, has: BranchLabels
) -> list[str]:
    """Return the name of each branch at all samples, "" if it has no unique name."""
    rng = np.random.default_rng(_SEED)
    spread = np.where(arm.prismatic, arm.length, np.pi)
    T = arm.pose(rng.uniform(-1.0, 1.0, (_SAMPLES, arm.size)) * spread)
    every = at_poses(plain_branches(chain, sequence, p), T)
    # solutions up to rounding errors
    solved = every.residual < _UNDECIDED * max(1.0, arm.length)
    names = []
    for b in range(sequence.branches):
        own = set(labels(arm, has, every.q[solved[:, b], b]))
        names.append(own.pop() if len(own) == 1 else "")
    return names
