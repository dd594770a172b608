"""Joints placed in any way, by numbers and symbols: the twin in numbers, pinocchio and MuJoCo."""

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from support.placed_trees import (
    Placed,
    mechanism,
    mujoco_text,
    pinocchio_model,
    transform,
)
from support.random_trees import random_rotation
from support.sweeps import examples

import mbs.models
from mbs.loops import closure_residual

COMMON = dict(deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
NAMES = "ABC"

TILTS = [10.0**-k for k in range(1, 16)]
numbers_of_angles = st.one_of(
    st.sampled_from([0.0, np.pi / 2, -np.pi / 2, np.pi, 0.3, -0.7, 2.5]),
    st.sampled_from([sign * tilt for tilt in TILTS for sign in (1, -1)]),
)
numbers_of_lengths = st.sampled_from([0.0, 0.1, -0.25, 0.4])


def symbols_in(constants):
    return st.tuples(
        st.sampled_from(NAMES), st.sampled_from([1.0, -1.0, 0.5]), st.sampled_from(constants)
    )


angles = st.one_of(numbers_of_angles, symbols_in([0.0, np.pi / 2, -0.4]))
lengths = st.one_of(numbers_of_lengths, numbers_of_lengths, symbols_in([0.0, 0.2]))
steps = st.lists(
    st.one_of(
        st.tuples(st.just("shift"), st.tuples(lengths, lengths, lengths)),
        st.tuples(st.sampled_from("xyz"), angles),
        st.integers(0, 5).map(
            lambda k: ("matrix", random_rotation(np.random.default_rng(k)).tolist())
        ),
    ),
    max_size=4,
).map(tuple)
axes = st.sampled_from([(0, 0, 1), (0, 0, -1), (1, 0, 0), (0, 1, 0), (1e-7, 0, 1), (1, 2, -3)])


@st.composite
def trees(draw, largest=4):
    n = draw(st.integers(2, largest))
    return tuple(
        Placed(
            parent=draw(st.integers(-1, k - 1)),
            kind=draw(st.sampled_from(["revolute", "revolute", "prismatic"])),
            axis=draw(axes),
            before=draw(steps),
            behind=draw(st.one_of(st.just(()), steps)),
            inertial=(1.0 + 0.3 * k, (0.1, -0.2, 0.05 * k), (0.1, 0.12, 0.15)),
            fixed=draw(st.booleans()),
        )
        for k in range(n)
    )


values = st.fixed_dictionaries(
    {name: st.sampled_from([0.0, 1e-9, -0.5, 0.5, 2.5, -2.0]) for name in NAMES}
)


def used(tree, loops=()):
    """The symbols in a description."""
    every = [s for one in tree for s in (*one.before, *one.behind)]
    every += [s for _, first, _, second in loops for s in (*first, *second)]
    scalars = [x for what, v in every if what != "matrix" for x in (v if what == "shift" else [v])]
    return {x[0] for x in scalars if isinstance(x, tuple)}


def models(system):
    return (
        mbs.models.inverse_dynamics(system),
        mbs.models.inertia_matrix(system),
        [mbs.models.transform(system, body.name) for body in system.bodies],
    )


A_TILT = (
    Placed(-1, "revolute", (0, 0, 1), (), (), (1.0, (0.1, 0.2, 0.3), (0.1, 0.1, 0.1))),
    Placed(
        0,
        "revolute",
        (1e-9, 0, 1),
        (("shift", (0.1, 0.2, 0.3)),),
        (),
        (1.0, (0.1, 0.2, 0.3), (0.1, 0.1, 0.1)),
    ),
)
A_SYMBOL = (
    A_TILT[0],
    Placed(0, "revolute", (0, 0, 1), (("x", ("A", 1.0, 0.0)), ("z", 0.3)), (), A_TILT[0].inertial),
)


@settings(max_examples=examples(80), **COMMON)
@example(A_TILT, {"A": 0.5, "B": 0.5, "C": 0.5}, {"A": 0.5, "B": 0.5, "C": 0.5}, 0)
@example(A_SYMBOL, {"A": 0.5, "B": 0.5, "C": 0.5}, {"A": -0.5, "B": 0.5, "C": 0.5}, 0)
@example(A_SYMBOL, {"A": 0.0, "B": 0.5, "C": 0.5}, {"A": -0.5, "B": 0.5, "C": 0.5}, 0)
@given(trees(), values, values, st.integers(0, 10**6))
def test_symbols_numbers_and_pinocchio_agree(tree, defaults, p, seed):
    pin = pytest.importorskip("pinocchio")
    inside = sorted(used(tree))
    symbolic = mechanism(
        tree, p, symbols=True, defaults={name: defaults[name] for name in inside}
    ).assemble()
    plain = mechanism(tree, p, symbols=False).assemble()
    given_p = [[p[parameter.name] for parameter in symbolic.parameters]] if inside else []
    model, frames = pinocchio_model(pin, tree, p)
    data = model.createData()
    rng = np.random.default_rng(seed)
    q, v, a = rng.uniform(-1.5, 1.5, (3, len(tree)))
    tau = pin.rnea(model, data, q, v, a)
    zero = np.zeros(len(tree))
    g = pin.rnea(model, data, q, zero, zero).copy()  # its inertia matrix wants depth-first numbers
    M = np.array([pin.rnea(model, data, q, zero, e) - g for e in np.eye(len(tree))])
    pin.forwardKinematics(model, data, q)
    for system, more in ((plain, []), (symbolic, given_p)):
        order = [int(c.joint[1:]) for c in system.coordinates]
        idm, inertia, poses = models(system)
        ours = np.array(idm(q[order], v[order], a[order], *more)).ravel()
        np.testing.assert_allclose(ours, tau[order], rtol=0, atol=1e-12 * max(1, np.abs(tau).max()))
        matrix = np.array(inertia(q[order], *more))
        scale = max(1.0, np.abs(M).max())
        np.testing.assert_allclose(matrix, M[np.ix_(order, order)], rtol=0, atol=1e-12 * scale)
        for body, pose in zip(system.bodies, poses, strict=True):
            if body.name.startswith("b"):
                number, in_joint = frames[int(body.name[1:])]
                T = data.oMi[number].homogeneous @ in_joint
                np.testing.assert_allclose(np.array(pose(q[order], *more)), T, rtol=0, atol=1e-12)
    if np.linalg.cond(M) < 1e8:
        for system, more in ((plain, []), (symbolic, given_p)):
            order = [int(c.joint[1:]) for c in system.coordinates]
            ddm = mbs.models.direct_dynamics(system)
            back = np.array(ddm(q[order], v[order], tau[order], *more)).ravel()
            error = np.abs(back - a[order]).max()
            assert error < 1e-12 * np.linalg.cond(M) * max(1.0, np.abs(tau).max())


@settings(max_examples=examples(60), **COMMON)
@given(trees(6), values)
def test_no_frame_is_far_from_the_joint_that_was_described(tree, p):
    pin = pytest.importorskip("pinocchio")
    system = mechanism(tree, p, symbols=False).assemble()
    model, frames = pinocchio_model(pin, tree, p)
    data = model.createData()
    pin.forwardKinematics(model, data, np.zeros(len(tree)))
    on = {k: [] for k in range(-1, len(tree))}  # where joints are, on each body
    for k, one in enumerate(tree):
        on[one.parent].append(transform(one.before, p)[:3, 3])
        on[k].append(np.linalg.inv(frames[k][1])[:3, 3])
    spans = [
        max((np.linalg.norm(x - y) for x in points for y in points), default=0.0)
        for body, points in on.items()
        if body >= 0
    ]
    # bodies on which all joints meet have no size; then that of the world counts, or one metre
    world = max((np.linalg.norm(x - y) for x in on[-1] for y in on[-1]), default=0.0)
    size = max(spans) or world or 1.0
    for j, link in enumerate(system.tree.links):
        T = np.array(mbs.models.transform(system, j + 1)(np.zeros(system.nq)))
        described = data.oMi[int(link.name[1:]) + 1].translation
        assert np.linalg.norm(T[:3, 3] - described) <= 3 * size * (1 + 1e-9)


@settings(max_examples=examples(30), **COMMON)
@given(trees(3), values, st.integers(0, 10**6))
def test_numbers_and_mujoco_agree(tree, p, seed):
    mujoco = pytest.importorskip("mujoco")
    system = mechanism(tree, p, symbols=False).assemble()
    model = mujoco.MjModel.from_xml_string(mujoco_text(tree, p))
    data = mujoco.MjData(model)
    rng = np.random.default_rng(seed)
    q, v, a = rng.uniform(-1.5, 1.5, (3, len(tree)))
    places = [model.jnt_qposadr[model.joint(f"j{k}").id] for k in range(len(tree))]
    data.qpos[places], data.qvel[places], data.qacc[places] = q, v, a
    mujoco.mj_inverse(model, data)
    order = [int(c.joint[1:]) for c in system.coordinates]
    idm, _, poses = models(system)
    ours = np.array(idm(q[order], v[order], a[order])).ravel()
    theirs = data.qfrc_inverse[places][order]
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-10 * max(1, np.abs(theirs).max()))
    for body, pose in zip(system.bodies, poses, strict=True):
        if body.name.startswith("b"):
            T = np.array(pose(q[order]))
            np.testing.assert_allclose(T[:3, 3], data.body(body.name).xpos, rtol=0, atol=1e-11)


@settings(max_examples=examples(40), **COMMON)
@given(trees(3), values, values, steps, steps, st.integers(0, 10**6))
def test_cut_joints_with_symbols_close_where_those_with_numbers_do(
    tree, defaults, p, first, second, seed
):
    """The rows of a cut joint, at positions that need not close the loop, and their Jacobian."""
    loops = ((0, first, len(tree) - 1, second),)
    if all(one.parent < 0 for one in tree):
        loops = ((0, first, 1, second),)
    inside = sorted(used(tree, loops))
    known = {name: defaults[name] for name in inside}
    from mbs.assembly.open_system import open_system

    symbolic = open_system(mechanism(tree, p, symbols=True, defaults=known, loops=loops))
    plain = open_system(mechanism(tree, p, symbols=False, loops=loops))
    given_p = [p[parameter.name] for parameter in symbolic.parameters]
    assert [c.name for c in symbolic.coordinates] == [c.name for c in plain.coordinates]
    q = np.random.default_rng(seed).uniform(-1.5, 1.5, plain.nq)
    ours = np.array(closure_residual(symbolic)(q, *([given_p] if inside else []))).ravel()
    theirs = np.array(closure_residual(plain)(q)).ravel()
    # a spherical joint leaves the coincidence of two points, in axes that may differ
    assert np.linalg.norm(ours) == pytest.approx(np.linalg.norm(theirs), abs=1e-12)
