"""Configurations of arms with a spherical wrist at which the usual solutions run together."""

from __future__ import annotations

import numpy as np

import mbs


def with_wrist(q, q5):
    """The configuration with q5 in place; zero is the wrist singularity of the arms used here."""
    return np.array([*q[:4], q5, *q[5:]])


def stretched(system, q):
    """The configuration with the wrist centre as far from axis 2 as it gets."""
    return np.array([*q[:2], _stretch(system), *q[3:]])


def folded(system, q, gap):
    """The configuration with the wrist centre at a distance from axis 2 near the least [m]."""
    upper, fore, _ = _lengths(system)
    cosine = (upper**2 + fore**2 - gap**2) / (2 * upper * fore)
    return np.array([*q[:2], _stretch(system) + np.pi - np.arccos(cosine), *q[3:]])


def least_gap(system):
    """The least distance of the wrist centre from axis 2 [m]."""
    upper, fore, _ = _lengths(system)
    return abs(upper - fore)


def over_shoulder(system, q):
    """The configuration with the wrist centre on axis 1, of an arm that lies in a plane with it."""
    wrist = mbs.models.transform(system, 5)

    def radius(q2):
        return float(wrist([0, q2, *q[2:]])[0, 3])

    middle = (radius(0) + radius(np.pi)) / 2
    c, s = radius(0) - middle, radius(np.pi / 2) - middle
    q2 = np.arctan2(s, c) + np.arccos(-middle / np.hypot(c, s))
    return np.array([q[0], q2, *q[2:]])


def _lengths(system):
    """Upper arm and forearm across axes 2 and 3 [m], and the forearm's direction in frame 3."""
    zero = np.zeros(system.nq)
    upper = np.array(mbs.models.transform(system, 3, 2)(zero))[:2, 3]
    fore = np.array(mbs.models.transform(system, 5, 3)(zero))[:2, 3]
    return np.linalg.norm(upper), np.linalg.norm(fore), fore


def _stretch(system):
    zero = np.zeros(system.nq)
    T = np.array(mbs.models.transform(system, 3, 2)(zero))
    fore = T[:2, :2] @ _lengths(system)[2]
    angle = np.arctan2(T[1, 3], T[0, 3]) - np.arctan2(fore[1], fore[0])
    return angle
