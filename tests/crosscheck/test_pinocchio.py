"""Catalogue robots against pinocchio, whose model is built here straight from the description."""

import numpy as np
import pytest

import mbs
import mbs.models
from mbs.components import Joint, Prismatic
from mbs.expressions import to_float
from mbs.spatial.inertia import TEN_PARAMETERS

pin = pytest.importorskip("pinocchio")

ROBOTS = ("puma560", "stanford", "rx90", "scara", "planar_2r", "cart_pole", "two_branch_tree")


def rotation(axis, angle):
    c, s = np.cos(angle), np.sin(angle)
    if axis == "x":
        return np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])


def placement(step):
    """Rz(gamma) Tz(b) Rx(alpha) Tx(d) Rz(theta) Tz(r)."""
    gamma, b, alpha, d, theta, r = (
        to_float(getattr(step, name)) for name in ("gamma", "b", "alpha", "d", "theta", "r")
    )
    p = rotation("z", gamma) @ ([0, 0, b] + rotation("x", alpha) @ [d, 0, r])
    return pin.SE3(rotation("z", gamma) @ rotation("x", alpha) @ rotation("z", theta), p)


def inertia(body):
    XX, XY, XZ, YY, YZ, ZZ, *ms, m = (to_float(getattr(body, name)) for name in TEN_PARAMETERS)
    c = np.array(ms) / m if m else np.zeros(3)
    J = np.array([[XX, XY, XZ], [XY, YY, YZ], [XZ, YZ, ZZ]])
    return pin.Inertia(m, c, J - m * (c @ c * np.eye(3) - np.outer(c, c)))


def twin(mechanism):
    """The pinocchio model of a mechanism that came from a table, with its joints in order."""
    model = pin.Model()
    model.gravity.linear = np.array([to_float(g) for g in mechanism.world.gravity])
    home = {mechanism.world.name: (0, pin.SE3.Identity())}
    before, joints = {}, []
    for a, b in mechanism.connections:
        (step,) = a.placement.steps or (None,)
        if isinstance(b.owner, Joint):
            number, offset = home[a.owner.name]
            before[b.owner.name] = number, offset * placement(step)
            continue
        if isinstance(a.owner, Joint):
            parent, place = before[a.owner.name]
            sliding = isinstance(a.owner, Prismatic)
            kind = pin.JointModelPZ() if sliding else pin.JointModelRZ()
            number = model.addJoint(parent, kind, place, a.owner.name)
            joints.append(a.owner)
            home[b.owner.name] = number, pin.SE3.Identity()
        else:
            number, offset = home[a.owner.name]
            home[b.owner.name] = number, offset * placement(step)
        model.appendBodyToJoint(home[b.owner.name][0], inertia(b.owner), home[b.owner.name][1])
    return model, joints


@pytest.mark.parametrize("name", ROBOTS)
def test_catalogue_robot(name):
    mechanism = mbs.load(name)
    system = mechanism.assemble()
    model, joints = twin(mechanism)
    data = model.createData()
    Ia, Fv, Fs = (
        np.array([to_float(getattr(joint, key)) for joint in joints]) for key in ("Ia", "Fv", "Fs")
    )
    rng = np.random.default_rng(0)
    for _ in range(5):
        q, v, a = rng.uniform(-2, 2, (3, model.nv))
        tau = pin.rnea(model, data, q, v, a) + Ia * a + Fv * v + Fs * np.tanh(v / 1e-3)
        ours = np.array(mbs.models.inverse_dynamics(system)(q, v, a)).ravel()
        np.testing.assert_allclose(ours, tau, rtol=0, atol=1e-10 * max(1.0, np.abs(tau).max()))
        back = np.array(mbs.models.direct_dynamics(system)(q, v, tau)).ravel()
        np.testing.assert_allclose(back, a, rtol=0, atol=1e-8)
        pin.forwardKinematics(model, data, q, v)
        T = np.array(mbs.models.transform(system, model.njoints - 1)(q))
        np.testing.assert_allclose(T, data.oMi[model.njoints - 1].homogeneous, rtol=0, atol=1e-12)
        E, U = (float(x) for x in mbs.models.energy(system)(q, v))
        kinetic = pin.computeKineticEnergy(model, data, q, v) + Ia @ v**2 / 2
        assert pytest.approx(kinetic, rel=1e-10) == E
        assert pytest.approx(pin.computePotentialEnergy(model, data, q), rel=1e-9, abs=1e-9) == U
