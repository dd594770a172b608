"""Chains between frames of a tree: one function for their frames, in symbols and in numbers."""

import casadi
import numpy as np
import pytest
from casadi import DM, SX, Function
from support.catalogue_systems import catalogue_system
from support.random_trees import ALL_KINDS, random_state, random_tree

import mbs
from mbs.closed_forms.arm import arm_of
from mbs.closed_forms.ring import extent, ring_of
from mbs.components.joints import Motion
from mbs.recursions.chain import ChainJoint, frames_at_zero, transforms, tree_chain
from mbs.recursions.route import relative_pose

SINGLE = ("revolute", "prismatic")


def values(matrices, symbols, numbers):
    stacked = casadi.densify(casadi.vertcat(*matrices))
    return np.array(Function("f", symbols, [stacked])(*numbers))


@pytest.mark.parametrize("seed", range(5))
def test_known_joints_make_the_relative_pose(seed):
    system = random_tree(seed, n=6, kinds=ALL_KINDS).mechanism.assemble()
    q, rng = SX.sym("q", system.nq), np.random.default_rng(seed)
    names = ["base", *(row.name for row in system.bodies)]
    a, b = (system.frame(names[k]) for k in rng.permutation(len(names))[:2])
    chain = tree_chain(system.tree, a, b, range(system.nq), q)
    assert chain.joints == ()
    (pose,) = transforms(chain, SX(0, 1))
    expected = relative_pose(system.tree, q, a, b)
    found = values([pose.matrix - expected.matrix], [q], [random_state(system, rng)[0]])
    assert np.max(np.abs(found)) < 1e-13


@pytest.mark.parametrize("seed", range(5))
def test_unknown_joints_in_symbols_and_in_numbers(seed):
    system = random_tree(seed, n=5, kinds=SINGLE, serial=True).mechanism.assemble()
    rng = np.random.default_rng(seed)
    p = np.array(system.p_default)
    end = system.frame(len(system.links))
    chain = tree_chain(system.tree, system.frame("base"), end, [1], SX([0.0, 0.7, 0, 0, 0]))
    assert [joint.index for joint in chain.joints] == [0, 2, 3, 4]
    x = SX.sym("x", 4)
    numbers = rng.uniform(-1, 1, (3, 4))
    arm = arm_of(chain, system.p, p)
    many = transforms(arm, numbers)
    assert len(many) == 5
    q = np.insert(numbers, 1, 0.7, axis=1)
    for row in range(3):
        poses = [pose.matrix for pose in transforms(chain, x)]
        one = values(poses, [x, system.p], [numbers[row], p]).reshape(5, 4, 4)
        own = [many[0], *(T[row] for T in many[1:])]
        np.testing.assert_allclose(own, one, rtol=0, atol=1e-14)
        direct = mbs.models.transform(system, len(system.links))
        np.testing.assert_allclose(one[-1], np.array(direct(q[row])), rtol=0, atol=1e-14)


def test_backwards_through_a_joint_is_its_inverse():
    q = SX([0.6, -0.3, 0.2, 0.5, 0.1, -0.7, 0.4])
    for motion, size in (("REVOLUTE", 1), ("PRISMATIC", 1), ("SPHERICAL", 4), ("FREE", 7)):
        there, back = (ChainJoint("j", Motion[motion], 0, sign) for sign in (1, -1))
        pose = there.displacement(q[:size]) @ back.displacement(q[:size])
        assert float(casadi.norm_fro(DM(pose.matrix) - DM.eye(4))) < 1e-15


def test_the_ends_of_a_ring_coincide():
    system = catalogue_system("four_bar")
    q = SX.sym("q", extent(system))
    ring = ring_of(system, 0, (), q)
    found = mbs.loops.solve(system, {system.coordinates[system.independent[0]].name: 0.4})
    angle = {joint.name: joint.index for joint in ring.joints}
    x = [float(found[angle[joint.name]]) for joint in ring.joints if not joint.cut]
    assert len(ring.gaps) == len(ring.joints) == len(x) + 1
    opened = SX.sym("x")
    indices = [k for k, joint in enumerate(ring.joints) if not joint.cut]
    whole = SX(4, 1)
    whole[indices] = x
    whole[next(k for k, joint in enumerate(ring.joints) if joint.cut)] = opened
    end = Function("end", [opened], [transforms(ring, whole)[-1].matrix])
    # the one joint that is cut has no position in q: some angle of it closes the ring
    apart = [np.max(np.abs(np.array(end(t)) - np.eye(4))) for t in np.linspace(-np.pi, np.pi, 7201)]
    assert min(apart) < 1e-3 < max(apart)


def test_frames_at_zero_are_those_of_zero_positions():
    system = catalogue_system("rx90")
    chain = tree_chain(system.tree, system.frame("base"), system.frame(6), (), SX(0, 1))
    ends = [DM(pose.matrix) for pose in frames_at_zero(chain.gaps)]
    moved = [DM(pose.matrix) for pose in transforms(chain, SX(6, 1))]
    for a, b in zip(ends, moved, strict=True):
        assert float(casadi.norm_fro(a - b)) < 1e-15
