"""Derivatives against pinocchio, whose model is built here from the links of the tree."""

import casadi
import numpy as np
import pytest
from support.random_trees import ALL_KINDS, random_state, random_tree
from test_derivatives import assert_close

import mbs
from mbs.components.joints import Motion
from mbs.models import direct_dynamics_derivatives, inverse_dynamics_derivatives

pin = pytest.importorskip("pinocchio")

JOINTS = {
    Motion.REVOLUTE: "JointModelRZ",
    Motion.PRISMATIC: "JointModelPZ",
    Motion.SPHERICAL: "JointModelSpherical",
    Motion.FREE: "JointModelFreeFlyer",
}


def numbers(value):
    return np.array(casadi.DM(casadi.evalf(value)))


def twin(system):
    """The pinocchio model of a system, with its joints in order."""
    model = pin.Model()
    model.gravity.linear = numbers(system.tree.gravity).ravel()
    for j, link in enumerate(system.tree.links):
        seat = link.placement.pose()
        place = pin.SE3(numbers(seat.R), numbers(seat.p).ravel())
        joint = getattr(pin, JOINTS[link.motion])()
        number = model.addJoint(link.antecedent + 1, joint, place, str(j))
        m, ms = float(link.inertia.m), numbers(link.inertia.ms).ravel()
        c = ms / m if m else ms
        J = numbers(link.inertia.J) - m * (c @ c * np.eye(3) - np.outer(c, c))
        model.appendBodyToJoint(number, pin.Inertia(m, c, J), pin.SE3.Identity())
    return model


def reordered(system, q):
    """The positions with the scalar part of quaternions last."""
    q = np.array(q)
    for link in system.tree.links:
        if link.motion.nq != link.motion.nv:
            q[link.q.stop - 4 : link.q.stop] = np.roll(q[link.q.stop - 4 : link.q.stop], -1)
    return q


def friction(system, v):
    """Efforts of friction, and their slopes along the velocities."""
    efforts, slopes = [], []
    for link in system.tree.links:
        Fv, Fs, width = (float(x) for x in (link.Fv, link.Fs, link.Fs_width))
        step = np.tanh(v[link.v] / width)
        efforts.extend(Fv * v[link.v] + Fs * step)
        slopes.extend(Fv + Fs / width * (1 - step**2))
    return np.array(efforts), np.diag(slopes)


def rotor_inertia(system):
    return np.array([float(link.Ia) for link in system.tree.links for _ in range(link.motion.nv)])


SYSTEMS = {
    **{name: (lambda name=name: mbs.load(name)) for name in ("puma560", "rx90", "stanford")},
    **{
        f"tree{seed}": (
            lambda seed=seed: random_tree(seed, n=5, kinds=(*ALL_KINDS, "free", "free")).mechanism
        )
        for seed in range(5)
    },
}


@pytest.fixture(params=SYSTEMS, scope="module")
def pair(request):
    system = SYSTEMS[request.param]().assemble()
    return system, twin(system)


@pytest.mark.sweep
def test_efforts(pair):
    system, model = pair
    data, Ia = model.createData(), rotor_inertia(system)
    rng = np.random.default_rng(0)
    for _ in range(3):
        q, v, a = random_state(system, rng)
        f, slope = friction(system, v)
        dq, dv, da = pin.computeRNEADerivatives(model, data, reordered(system, q), v, a)
        da = np.triu(da) + np.triu(da, 1).T
        tau = data.tau + Ia * a + f
        expected = (dq, dv + slope, da + np.diag(Ia), tau.reshape(-1, 1))
        for method in ("ad", "analytical"):
            assert_close(inverse_dynamics_derivatives(system, method)(q, v, a), expected, 1e-11)


@pytest.mark.sweep
def test_accelerations(pair):
    system, model = pair
    model.armature = rotor_inertia(system)
    data = model.createData()
    rng = np.random.default_rng(0)
    for _ in range(3):
        q, v, tau = random_state(system, rng)
        f, slope = friction(system, v)
        pin.computeABADerivatives(model, data, reordered(system, q), v, tau - f)
        inverse = np.triu(data.Minv) + np.triu(data.Minv, 1).T
        dv = data.ddq_dv - inverse @ slope
        expected = (data.ddq_dq, dv, inverse, data.ddq.reshape(-1, 1))
        assert_close(direct_dynamics_derivatives(system)(q, v, tau), expected, 1e-9)
