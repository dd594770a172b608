"""Arms that Pieper's method solves, and the configurations of all branches of its steps."""

from __future__ import annotations

from functools import cache

import casadi
import numpy as np
from support.arm_search import distance, merged, plain_arm, searched
from support.catalogue_systems import catalogue_system

import mbs
from mbs.closed_forms.pieper import pieper
from mbs.models.inverse_geometry.chain import frame_chain
from mbs.robots.rows import frame, robot

EXACT, NOISE = 1e-11, 1e-10


def with_wrist(kinds, first, seed, special=None):
    """A random arm of joints R or P; the axes of joint `first` and of the next two meet."""
    rng = np.random.default_rng((41, seed))
    rows = []
    for kind in kinds:
        values = {"alpha": rng.uniform(0.4, 1.2) * rng.choice((-1, 1)), "d": rng.uniform(0.1, 0.6)}
        values |= {"theta": rng.uniform(-3, 3), "r": rng.uniform(-0.4, 0.4)}
        joint = "revolute" if kind == "R" else "prismatic"
        rows.append(frame(len(rows), joint, **{k: float(v) for k, v in values.items()}))
    rows[first]["d"] = rows[first + 1]["d"] = rows[first]["r"] = 0.0
    for number, values in (special or {}).items():
        rows[number] |= values
    mechanism = robot("arm", "random", rows, [])
    hand = mechanism.bodies()
    mechanism.add_frame("tool", list(hand)[-1].at_khalil(b=0.1, alpha=0.7, d=-0.2, r=0.15))
    return mechanism.assemble()


def lengths():
    """An arm whose lengths and one twist are symbols."""
    values = {"R1": 0.4, "D2": 0.3, "R2": 0.1, "D3": 0.5, "D4": 0.05, "R4": 0.6, "A6": 1.1}
    rows = [
        frame(0, r="R1"),
        frame(1, alpha=-1.1, d="D2", r="R2"),
        frame(2, alpha=0.4, d="D3"),
        frame(3, alpha=1.3, d="D4", r="R4"),
        frame(4, alpha=-1.2),
        frame(5, alpha="A6"),
    ]
    system = mbs.load({"name": "lengths", "parameters": values, "frame": rows}).assemble()
    return system, np.array([values[str(symbol)] for symbol in casadi.vertsplit(system.p)])


def leaves_of(problem):
    """given -> configurations, smallest radicands and regularity, a column a branch; the
    sequence."""
    sequence = pieper(problem)
    rows = [
        casadi.vertcat(leaf.x, casadi.mmin(casadi.vertcat(leaf.real, 1)), square(leaf.regular))
        for leaf in sequence.leaves(problem.given)
    ]
    return casadi.Function("leaves", [problem.given], [casadi.horzcat(*rows)]), sequence


def square(values):
    return casadi.mmin(casadi.vertcat(values * values, 1))


@cache
def solved(build, *arguments):
    """The system, its leaves, its sequence and its plain arm."""
    system = build(*arguments)
    return system, *leaves_of(frame_chain(system).problem()), plain_arm(system)


def configurations(leaves, T, p=()):
    """(m, n) of all branches whose radicands are not negative."""
    columns = np.array(leaves(np.concatenate([p, np.ravel(T[:3], order="F")])))
    assert np.isfinite(columns).all()
    return columns[:-2].T[(columns[-2] >= -NOISE) & (columns[-1] > 1e-24)]


def assert_all(leaves, arm, q, p=()):
    """The configurations for the pose of q: exact, distinct, q among them."""
    T = arm.pose(q)
    ours = configurations(leaves, T, p)
    assert len(ours) > 0
    assert np.max(arm.residual(T, ours)) < EXACT
    assert len(merged(arm, T, ours)) == len(ours)
    assert np.min(distance(arm, ours, q)) < 1e-6
    return ours


def assert_complete(leaves, arm, seed):
    """As many configurations as a search from many starts finds, and these."""
    q = arm.random(np.random.default_rng(seed))
    ours = assert_all(leaves, arm, q)
    theirs = searched(arm, arm.pose(q))
    assert len(ours) == len(theirs)
    assert max(np.min(distance(arm, ours, other)) for other in theirs) < 1e-6


def catalogue(name):
    return catalogue_system(name)


def kinds_of(sequence):
    return tuple(one.kind for one in sequence.steps)
