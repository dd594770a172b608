"""Self-motions found and followed."""

import numpy as np

import mbs
from mbs.models.inverse_geometry.chain import frame_chain
from mbs.models.inverse_geometry.self_motions import connected, curve, freedoms
from mbs.models.inverse_geometry.target import Target, reduction


def planar(count):
    rows = [
        {"antecedent": k, "joint": "revolute", "d": 0.0 if k == 0 else 0.4} for k in range(count)
    ]
    return frame_chain(mbs.load({"name": "planar", "frame": rows}).assemble()).arm(np.zeros(0))


def at(arm, q):
    q = np.array(q, dtype=float)
    return Target(arm, arm.pose(q)), q


def test_regular_configurations_and_folds_do_not_move():
    target, q = at(planar(3), [0.3, 0.8, -0.4])
    assert freedoms(reduction(target, q))[0] == 0
    target, q = at(planar(3), [0.3, 0.0, -0.4])
    assert freedoms(reduction(target, q))[0] == 0


def test_a_curve_comes_back_to_its_start():
    target, q = at(planar(4), [0.3, 0.9, -0.5, 0.4])
    count, direction = freedoms(reduction(target, q))
    assert count == 1
    found = curve(target, q, direction)
    assert found.closed
    assert np.max(np.abs(target.wrapped(found.x[-1] - found.x[0]))) < 1e-12
    assert np.max(target.residual(found.x)) < 1e-13
    assert np.max(np.linalg.norm(np.diff(found.x, axis=0), axis=1)) < 0.16


def test_two_freedoms_join_what_is_on_one_surface():
    target, q = at(planar(5), [0.3, 0.9, -0.5, 0.4, 0.2])
    reduced = reduction(target, q)
    assert freedoms(reduced)[0] == 2
    held = reduced.null.T
    away = [target.corrected(q + held.T @ h, held, held @ q + h) for h in ([0.3, 0.1], [-0.2, 0.4])]
    joined = connected(target, np.array(away), q)
    assert list(joined) == [True, True]
    assert np.max(target.residual(np.array(away))) < 1e-13
