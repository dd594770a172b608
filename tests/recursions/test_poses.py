"""Poses of links, piece by piece."""

import casadi
import numpy as np
import pytest
from casadi import SX

import mbs
from mbs.recursions.link_motions import link_poses


def test_height_is_the_distance_from_the_seat_along_the_axis():
    rows = [
        {"antecedent": 0, "joint": "revolute", "b": 0.7, "r": 0.3},
        {"antecedent": 1, "joint": "prismatic", "alpha": np.pi / 2, "d": 0.2, "r": -0.1},
        {"antecedent": 2, "joint": "revolute", "gamma": 0.4, "d": 0.5},
    ]
    bodies = [{"frame": k + 1, "M": 1.0} for k in range(3)]
    system = mbs.load({"name": "arm", "frame": rows, "body": bodies}).assemble()
    q = SX.sym("q", 3)
    poses = link_poses(system.tree, q)
    heights = casadi.Function("f", [q], [casadi.vertcat(*(pose.height for pose in poses))])
    found = np.array(heights([0.9, 1.5, 0.4])).ravel()
    np.testing.assert_allclose(found, [0.3, 1.4, 0], atol=1e-16)
    for pose in poses:
        step = pose.p - pose.foot
        along = casadi.dot(pose.at_seat(step), SX([0, 0, 1]))
        f = casadi.Function("f", [q], [along - pose.height])
        assert float(f([0.9, 1.5, 0.4])) == pytest.approx(0, abs=1e-15)
