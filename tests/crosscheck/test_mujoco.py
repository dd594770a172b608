"""Every tree model against MuJoCo, on random trees with every kind of joint."""

import numpy as np
import pytest
from support.mujoco_rounding import as_exact_as
from support.random_trees import ALL_KINDS, KINDS, random_state, random_tree

import mbs.models
from mbs.components.joints import Motion

mujoco = pytest.importorskip("mujoco")
full_inertia = pytest.importorskip("support.mujoco_inertia").full_inertia

CASES = [
    *(pytest.param(s, dict(kinds=KINDS), id=f"tree{s}") for s in range(6)),
    *(pytest.param(s, dict(kinds=KINDS, aligned=True), id=f"aligned{s}") for s in range(10, 16)),
    *(pytest.param(s, dict(kinds=KINDS, serial=True), id=f"serial{s}") for s in range(20, 24)),
    *(pytest.param(s, dict(kinds=ALL_KINDS, n=6), id=f"floating{s}") for s in range(30, 36)),
]


class Twin:
    def __init__(self, seed, options):
        tree = random_tree(seed, **options)
        self.system = tree.mechanism.assemble()
        self.model = mujoco.MjModel.from_xml_string(tree.mjcf)
        self.data = mujoco.MjData(self.model)
        self._order()

    def _order(self):
        """Where each of our links stands in MuJoCo's q and v."""
        counts = {}
        self.q_at, self.v_at = [], []
        for link in self.system.tree.links:
            joint = link.name.split(".")[0]
            number = counts.setdefault(joint, 0)
            counts[joint] += 1
            entry = self.model.joint(f"{joint}_{number}")
            self.q_at.append(int(entry.qposadr[0]))
            self.v_at.append(int(entry.dofadr[0]))

    def matrix(self, q):
        """M with v_mujoco = M v, and its rate is left to the caller (free joints)."""
        M = np.zeros((self.model.nv, self.model.nv))
        for link, at in zip(self.system.tree.links, self.v_at, strict=True):
            n = link.motion.nv
            block = np.eye(n)
            if link.motion is Motion.FREE:
                block[:3, :3] = rotation(q[link.q.stop - 4 : link.q.stop])
            M[at : at + n, link.v] = block
        return M

    def q(self, q):
        result = np.zeros(self.model.nq)
        for link, at in zip(self.system.tree.links, self.q_at, strict=True):
            result[at : at + link.motion.nq] = q[link.q]
        return result

    def rate(self, q, v):
        """dM/dt v of free joints: the linear velocity turns with the body."""
        result = np.zeros(self.model.nv)
        for link, at in zip(self.system.tree.links, self.v_at, strict=True):
            if link.motion is Motion.FREE:
                own = v[link.v]
                R = rotation(q[link.q.stop - 4 : link.q.stop])
                result[at : at + 3] = R @ np.cross(own[3:], own[:3])
        return result

    def inverse(self, q, v, a):
        M = self.matrix(q)
        self.data.qpos[:] = self.q(q)
        self.data.qvel[:] = M @ v
        self.data.qacc[:] = M @ a + self.rate(q, v)
        self.model.opt.disableflags = mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
        mujoco.mj_inverse(self.model, self.data)
        return M.T @ self.data.qfrc_inverse


def rotation(quaternion):
    R = np.zeros(9)
    mujoco.mju_quat2Mat(R, quaternion)
    return R.reshape(3, 3)


def close(ours, theirs, tolerance=1e-10):
    tolerance = as_exact_as(mujoco, tolerance)
    theirs = np.asarray(theirs)
    scale = max(1.0, np.abs(theirs).max())
    ours = np.array(ours).reshape(theirs.shape)
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=tolerance * scale)


@pytest.mark.sweep
@pytest.mark.parametrize(("seed", "options"), CASES)
def test_dynamics(seed, options):
    twin = Twin(seed, options)
    system, rng = twin.system, np.random.default_rng(seed)
    idm = mbs.models.inverse_dynamics(system)
    A, H = mbs.models.inertia_matrix(system), mbs.models.bias(system)
    ddm, energy = mbs.models.direct_dynamics(system), mbs.models.energy(system)
    for _ in range(3):
        q, v, a = random_state(system, rng)
        tau = twin.inverse(q, v, a)
        close(idm(q, v, a), tau)
        close(H(q, v), twin.inverse(q, v, np.zeros_like(a)))
        close(ddm(q, v, tau), a, 1e-9)
        twin.data.qpos[:], twin.data.qvel[:] = twin.q(q), twin.matrix(q) @ v
        twin.model.opt.enableflags = mujoco.mjtEnableBit.mjENBL_ENERGY
        mujoco.mj_forward(twin.model, twin.data)
        full = full_inertia(twin.model, twin.data)
        M = twin.matrix(q)
        close(A(q), M.T @ full @ M)
        E, U = (float(x) for x in energy(q, v))
        close(E, twin.data.energy[1])
        close(U, twin.data.energy[0])


@pytest.mark.sweep
@pytest.mark.parametrize(("seed", "options"), CASES)
def test_kinematics(seed, options):
    twin = Twin(seed, options)
    system, rng = twin.system, np.random.default_rng(seed)
    q, v, _ = random_state(system, rng)
    twin.data.qpos[:], twin.data.qvel[:] = twin.q(q), twin.matrix(q) @ v
    mujoco.mj_forward(twin.model, twin.data)
    for row in system.bodies:
        body = twin.model.body(row.name).id
        T = np.array(mbs.models.transform(system, row.name)(q))
        close(T[:3, 3], twin.data.xpos[body])
        close(T[:3, :3], twin.data.xmat[body].reshape(3, 3))
        linear, angular = np.zeros((2, 3, twin.model.nv))
        mujoco.mj_jacBody(twin.model, twin.data, linear, angular, body)
        J = mbs.models.jacobian(system, row.name)(q)
        close(J, np.vstack([linear, angular]) @ twin.matrix(q))
