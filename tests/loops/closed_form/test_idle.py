"""Plane loops with joints of the tree that can do more than the plane needs."""

import numpy as np
import pytest
from support.configurations import active, same, searched
from support.random_trees import random_body, random_rotation

from mbs import Mechanism
from mbs.components import (
    Cylindrical,
    Prismatic,
    Revolute,
    Spherical,
    Universal,
)
from mbs.loops import assembly_modes, function, solve

JOINTS = {
    "universal": Universal("x", axes=("z", "x")),
    "universal backwards": Universal("x", axes=("y", "z")),
    "cylinder": Cylindrical("x"),
    "ball": Spherical("x"),
}
CLOSING = {"turn": Revolute("j4"), "slide": Prismatic("j4", axis="x")}


def loop(joint, closing, offset):
    """A crank, a coupler and a rocker or slider in an oblique plane, the joint between the two."""
    rng = np.random.default_rng(3)
    m = Mechanism("idle", guess={"j1": 1.0, "j2": -0.8})
    ground = m.world.at(0.2, -0.1, 0.4, rotation=random_rotation(rng))
    crank, coupler, rocker = (m.add(random_body(rng, name)) for name in ("a", "b", "c"))
    m.connect(ground, Revolute("j1", actuated=True), crank)
    m.connect(crank.at(0.4, 0, 0.1), Revolute("j2"), coupler)
    m.connect(coupler.at(1.0, 0, offset), joint, rocker.at(0.8, 0, -0.15))
    m.connect(rocker, closing, ground.at(0.9, 0, 0.3))
    m.cut(closing)
    return m.assemble()


@pytest.mark.sweep
@pytest.mark.parametrize("closing", CLOSING.values(), ids=CLOSING.keys())
@pytest.mark.parametrize("joint", JOINTS.values(), ids=JOINTS.keys())
def test_what_a_joint_of_the_tree_does_not_use_is_found_as_well(joint, closing):
    free = isinstance(joint, Cylindrical)
    system = loop(joint, closing, offset=0.35 if free else 0.05)
    listed, found = assembly_modes(system), searched(system, active(system), starts=100)
    assert len(listed) == len(found) > 0
    assert all(any(same(system, mode.q, q) for q in found) for mode in listed)
    assert max(mode.residual for mode in listed) < 1e-12
    q_a = active(system) + 0.05
    assert same(system, np.array(function(system)(q_a)).ravel(), followed(system, q_a), 1e-8)
    if free:
        names = [coordinate.name for coordinate in system.coordinates]
        assert abs(listed[0].q[names.index("x.s")] + 0.3) < 1e-12  # 0.1 + 0.35 - 0.3 + 0.15


def followed(system, q_a):
    """The configuration that following from the assembled one leads to."""
    return solve(system, {"j1": q_a[0]})
