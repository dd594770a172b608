"""Coordinates of joints with several degrees of freedom belong to `connect`, not to the tree.

`connect(a, joint, b)` describes b relative to a, whichever of the two is nearer to the base. Each
tree here is described twice: with all spherical and free joints from the base outwards, and with
some of them the other way round. Positions, velocities and efforts of the second description follow
from those of the first by the inverse of a displacement alone.
"""

import numpy as np
import pytest
from casadi import DM, SX, Function
from support.random_trees import random_body, random_rotation

from mbs import Mechanism, identification, models
from mbs.components import (
    Free,
    Prismatic,
    Revolute,
    Spherical,
)
from mbs.recursions.route import relative_pose
from mbs.simulate import run

KINDS = {
    "one ball": ("spherical",),
    "one free body": ("free",),
    "arm with balls": ("revolute", "spherical", "revolute", "spherical"),
    "free robot": ("free", "revolute", "spherical", "prismatic"),
    "free on an arm": ("revolute", "free", "revolute", "free", "prismatic"),
}


def tree(kinds, seed, backward, branch=False):
    """A tree of these joints; spherical and free ones connect the outer body to the inner one."""
    rng = np.random.default_rng(seed)
    mechanism = Mechanism("tree", gravity=tuple(rng.uniform(-10, 10, 3)))
    bodies = [mechanism.world]
    for k, kind in enumerate(kinds):
        body = mechanism.add(random_body(rng, f"body{k}"))
        before = bodies[int(rng.integers(len(bodies)))] if branch else bodies[-1]
        inner = before.at(*rng.uniform(-0.5, 0.5, 3), rotation=random_rotation(rng))
        outer = body.at(*rng.uniform(-0.5, 0.5, 3), rotation=random_rotation(rng))
        drive = {"Ia": rng.uniform(0, 0.2), "Fv": rng.uniform(0, 0.2)}
        if kind in ("spherical", "free"):
            joint = Spherical(f"j{k}", **drive) if kind == "spherical" else Free(f"j{k}")
            ends = (outer, joint, inner) if backward else (inner, joint, outer)
        else:
            one_axis = Revolute if kind == "revolute" else Prismatic
            joint = one_axis(f"j{k}", axis=tuple(rng.standard_normal(3)), **drive)
            ends = inner, joint, outer
        mechanism.connect(*ends)
        bodies.append(body)
    return mechanism.assemble()


def rotation(quaternion):
    w, x, y, z = quaternion
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + 2 * w * K + 2 * K @ K


def skew(u):
    return np.array([[0, -u[2], u[1]], [u[2], 0, -u[0]], [-u[1], u[0], 0]])


class Pair:
    """A tree described outwards and backwards, and the same motion in both coordinates.

    S turns velocities of the backward description into those of the outward one, and R is its
    rate: v_out = S v, a_out = S a + R v.
    """

    def __init__(self, kinds, seed, branch=False):
        self.out = tree(kinds, seed, False, branch)
        self.back = tree(kinds, seed, True, branch)
        rng = np.random.default_rng(seed + 100)
        self.q = rng.uniform(-1, 1, self.back.nq)
        self.v, self.a, self.tau = rng.uniform(-1, 1, (3, self.back.nv))
        for link in self.back.tree.links:
            if link.motion.nq > 1:
                q = self.q[link.q.stop - 4 : link.q.stop]
                q /= np.linalg.norm(q)
        self.q_out, self.S, self.rate = self.outward(self.q, self.v)
        self.v_out = self.S @ self.v
        self.a_out = self.S @ self.a + self.rate @ self.v

    def outward(self, q, v):
        q_out, n = np.array(q, float), self.back.nv
        S, rate = np.eye(n), np.zeros((n, n))
        for link in self.back.tree.links:
            if link.motion.nq == 1:
                continue
            own = q[link.q]
            turn = rotation(own[-4:])
            w = v[link.v][-3:]
            q_out[link.q.stop - 3 : link.q.stop] *= -1
            if link.motion.nq == 4:
                S[link.v, link.v] = -turn
                rate[link.v, link.v] = -turn @ skew(w)
            else:
                p, linear = own[:3], v[link.v][:3]
                q_out[link.q.start : link.q.start + 3] = -turn.T @ p
                # a twist in frame_b about its origin, about the origin of frame_a and in its axes
                Ad = np.block([[turn, skew(p) @ turn], [np.zeros((3, 3)), turn]])
                ad = np.block([[skew(w), skew(linear)], [np.zeros((3, 3)), skew(w)]])
                S[link.v, link.v] = -Ad
                rate[link.v, link.v] = -Ad @ ad
        return q_out, S, rate


@pytest.fixture(params=[(name, branch) for name in KINDS for branch in (False, True)], ids=str)
def pair(request):
    name, branch = request.param
    return Pair(KINDS[name], 7, branch)


def test_bodies_stand_and_move_where_they_did(pair):
    for body in (name for name in ("body0", f"body{len(pair.back.tree.links) - 1}")):
        T_out = models.direct_geometry(pair.out, body)(q=pair.q_out)["T"]
        T = models.direct_geometry(pair.back, body)(q=pair.q)["T"]
        np.testing.assert_allclose(T.full(), T_out.full(), atol=1e-12)
        J_out = models.jacobian(pair.out, body)(q=pair.q_out)["J"].full()
        J = models.jacobian(pair.back, body)(q=pair.q)["J"].full()
        np.testing.assert_allclose(J, J_out @ pair.S, atol=1e-12)
        drift_out = models.jacobian_dot_velocity(pair.out, body)
        drift = models.jacobian_dot_velocity(pair.back, body)
        out = (
            drift_out.call([pair.q_out, pair.v_out])[0].full().ravel() + J_out @ pair.rate @ pair.v
        )
        np.testing.assert_allclose(drift.call([pair.q, pair.v])[0].full().ravel(), out, atol=1e-11)


def test_inverse_dynamics_and_inertia_matrix(pair):
    S = pair.S
    tau_out = models.inverse_dynamics(pair.out)(pair.q_out, pair.v_out, pair.a_out).full().ravel()
    tau = models.inverse_dynamics(pair.back)(pair.q, pair.v, pair.a).full().ravel()
    np.testing.assert_allclose(tau, S.T @ tau_out, atol=1e-10)
    A = models.inertia_matrix(pair.back)(pair.q).full()
    A_out = models.inertia_matrix(pair.out)(pair.q_out).full()
    np.testing.assert_allclose(A, S.T @ A_out @ S, atol=1e-11)


def test_drive_of_a_free_joint_acts_on_its_own_velocities():
    rng = np.random.default_rng(5)
    efforts = []
    for drive in ({"Ia": 0.3, "Fv": 0.7}, {}):
        m = Mechanism("m")
        body = m.add(random_body(np.random.default_rng(1), "body"))
        m.connect(body.at(0.1, 0.2, 0.3), Free("j", **drive), m.world)
        efforts.append(models.inverse_dynamics(m.assemble()))
    q = rng.standard_normal(7)
    q[3:] /= np.linalg.norm(q[3:])
    v, a = rng.standard_normal((2, 6))
    difference = (efforts[0](q, v, a) - efforts[1](q, v, a)).full().ravel()
    rate = a + np.r_[np.cross(v[3:], v[:3]), np.zeros(3)]
    np.testing.assert_allclose(difference, 0.3 * rate + 0.7 * v, atol=1e-12)


def test_accelerations_invert_efforts(pair):
    tau = models.inverse_dynamics(pair.back)(pair.q, pair.v, pair.a)
    for method in ("articulated", "composite"):
        f = models.direct_dynamics(pair.back, method=method)
        np.testing.assert_allclose(
            f(pair.q, pair.v, tau).full().ravel(), pair.a, atol=1e-8, err_msg=method
        )


@pytest.mark.parametrize("method", ["renaud", "christoffel"])
def test_lagrange_form(pair, method):
    back = pair.back
    form = models.lagrange(back, method=method)(q=pair.q, v=pair.v)
    A, B, Q = (form[name].full() for name in ("A", "B", "Q"))
    tau = models.inverse_dynamics(back)(pair.q, pair.v, pair.a).full().ravel()
    friction = np.concatenate([float(link.Fv) * pair.v[link.v] for link in back.tree.links])
    np.testing.assert_allclose(A @ pair.a + B @ pair.v + Q.ravel() + friction, tau, atol=1e-10)
    np.testing.assert_allclose(A, models.inertia_matrix(back)(pair.q).full(), atol=1e-11)
    # dA/dt - 2 B is skew-symmetric; the rate by a central difference along the motion
    A_at, h = models.inertia_matrix(back), 1e-6
    ends = [moved(back, pair.q, sign * h * pair.v) for sign in (1, -1)]
    rate = (A_at(ends[0]).full() - A_at(ends[1]).full()) / (2 * h)
    np.testing.assert_allclose(rate, B + B.T, atol=1e-7)


def moved(system, q, d):
    """The positions after a small displacement d along the velocities."""
    return np.array(q) + system.qdot(q, d).full().ravel()


def test_derivatives_of_inverse_dynamics(pair):
    back, h = pair.back, 1e-5
    found = models.inverse_dynamics_derivatives(back)(q=pair.q, v=pair.v, a=pair.a)
    f = models.inverse_dynamics(back)
    for of in ("q", "v", "a"):
        columns = []
        for step in h * np.eye(back.nv):
            ends = []
            for sign in (1, -1):
                at = {"q": pair.q, "v": pair.v, "a": pair.a}
                at[of] = moved(back, pair.q, sign * step) if of == "q" else at[of] + sign * step
                ends.append(f(at["q"], at["v"], at["a"]).full().ravel())
            columns.append((ends[0] - ends[1]) / (2 * h))
        np.testing.assert_allclose(
            found[f"dtau_d{of}"].full(), np.column_stack(columns), atol=3e-7, err_msg=of
        )


def test_energy(pair):
    out = models.energy(pair.out)(pair.q_out, pair.v_out)
    back = models.energy(pair.back)(pair.q, pair.v)
    for found, expected in zip(back, out, strict=True):
        assert float(found) == pytest.approx(float(expected), abs=1e-11)


def test_regressors(pair):
    back, h = pair.back, 1e-6
    D = identification.regressor(back)
    tau = models.inverse_dynamics(back)(pair.q, pair.v, pair.a).full().ravel()
    X = DM(identification.symbolic_parameters(back, D.columns)).full().ravel()
    np.testing.assert_allclose(D(pair.q, pair.v, pair.a).full() @ X, tau, atol=1e-10)
    # the rate of the momenta, by a central difference, and the rest are the dynamic model
    filtered = identification.filtered_regressor(back)
    ends = [
        filtered(moved(back, pair.q, s * h * pair.v), pair.v + s * h * pair.a)[0].full()
        for s in (1, -1)
    ]
    rest = filtered(pair.q, pair.v)[1].full()
    dynamic = D(pair.q, pair.v, pair.a).full()
    np.testing.assert_allclose((ends[0] - ends[1]) / (2 * h) + rest, dynamic, atol=1e-7)


def test_base_parameters_are_as_many(pair):
    counts = {
        method: identification.base_parameters(pair.back, method).count
        for method in ("symbolic", "numeric")
    }
    assert len(set(counts.values())) == 1
    assert counts["numeric"] == identification.base_parameters(pair.out, "numeric").count


def test_wrench_of_a_joint_is_the_opposite_at_its_other_frame(pair):
    F_out = models.joint_wrenches(pair.out)(pair.q_out, pair.v_out, pair.a_out).full()
    F = models.joint_wrenches(pair.back)(pair.q, pair.v, pair.a).full()
    backward = {link.name for link in pair.back.tree.links if link.backward}
    columns = [row.name for row in pair.out.joints]
    for k, row in enumerate(pair.back.joints):
        f, m = F[:3, k], F[3:, k]
        if row.name in backward:
            T = transform(pair.back, pair.q, row.frame_a, row.frame_b)
            f = T[:3, :3] @ f
            f, m = -f, -(T[:3, :3] @ m + np.cross(T[:3, 3], f))
        np.testing.assert_allclose(np.r_[f, m], F_out[:, columns.index(row.name)], atol=1e-9)


def transform(system, q, a, b):
    """(4, 4) frame b in frame a, each a link and a pose in it."""
    symbols = SX.sym("q", system.nq)
    pose = relative_pose(system.tree, symbols, a, b)
    return Function("T", [symbols], [pose.matrix])(q).full()


def test_motions_are_the_same(pair):
    """Both descriptions move alike from the same start."""
    kinds = {"q0": pair.q, "v0": pair.v}, {"q0": pair.q_out, "v0": pair.v_out}
    ends = []
    for system, start in zip((pair.back, pair.out), kinds, strict=True):
        result = run(system, 0.3, tolerance=1e-10, **start)
        f = models.direct_geometry(system, "body0")
        ends.append(f(q=[result.state().q[c.name] for c in system.coordinates])["T"].full())
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-7)
