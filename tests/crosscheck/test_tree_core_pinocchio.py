"""The tree core against pinocchio, on big trees whose model is built here from the tree."""

import numpy as np
import pytest
from casadi import DM, evalf
from support.random_trees import random_state, random_tree

from mbs.components.joints import Motion
from mbs.models import tree_core

pin = pytest.importorskip("pinocchio")

JOINTS = {
    Motion.REVOLUTE: pin.JointModelRZ,
    Motion.PRISMATIC: pin.JointModelPZ,
    Motion.SPHERICAL: pin.JointModelSpherical,
    Motion.FREE: pin.JointModelFreeFlyer,
}


def number(x):
    return np.array(DM(evalf(x)))


def twin(system):
    """The pinocchio model with the links of a system in the same order, rotors as armature."""
    model = pin.Model()
    model.gravity.linear = number(system.tree.gravity).ravel()
    for link in system.tree.links:
        pose, body = link.pose(), link.inertia
        place = pin.SE3(number(pose.R), number(pose.p).ravel())
        joint = model.addJoint(link.antecedent + 1, JOINTS[link.motion](), place, link.name)
        m, ms, J = float(body.m), number(body.ms).ravel(), number(body.J)
        c = ms / m if m else np.zeros(3)
        own = pin.Inertia(m, c, J - m * (c @ c * np.eye(3) - np.outer(c, c)))
        model.appendBodyToJoint(joint, own, pin.SE3.Identity())
    each = [float(link.Ia) for link in system.tree.links for _ in range(link.motion.nv)]
    model.armature = np.array(each)
    return model


def in_its_order(system, q):
    """Positions with quaternions as x, y, z, w."""
    result = q.copy()
    for link in system.tree.links:
        if link.motion in (Motion.SPHERICAL, Motion.FREE):
            part = slice(link.q.stop - 4, link.q.stop)
            result[part] = np.roll(q[part], -1)
    return result


def close(ours, theirs, tolerance):
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=tolerance * np.abs(theirs).max())


@pytest.mark.parametrize(
    ("n", "kinds", "serial"),
    [
        (60, ("revolute",), True),
        (40, ("revolute", "prismatic", "spherical"), False),
        (25, ("free", "revolute", "revolute", "universal"), False),
    ],
)
def test_big_trees(n, kinds, serial):
    system = random_tree(n, n=n, kinds=kinds, serial=serial).mechanism.assemble()
    core, model = tree_core(system), twin(system)
    data = model.createData()
    Fv = np.array([float(link.Fv) for link in system.tree.links for _ in range(link.motion.nv)])
    rng = np.random.default_rng(0)
    for _ in range(3):
        q, v, a = random_state(system, rng)
        there = in_its_order(system, q)
        A = core.inertia_matrix(q)
        upper = np.triu(pin.crba(model, data, there))
        close(A, upper + np.triu(upper, 1).T, 1e-13)
        tau = pin.rnea(model, data, there, v, a) + Fv * v
        close(core.idm(q, v, a), tau, 1e-13)
        # what rounding bounds of an acceleration is the effort that it leaves
        back = core.ddm(q, v, tau)
        close(A @ back, A @ pin.aba(model, data, there, v, tau - Fv * v), 1e-11)
        pin.computeRNEADerivatives(model, data, there, v, a)
        dq, dv, da, same = core.idm_derivatives(q, v, a)
        close(dq, data.dtau_dq, 1e-12)
        close(dv, data.dtau_dv + np.diag(Fv), 1e-12)
        close(da, A, 1e-14)
        close(same, tau, 1e-13)
