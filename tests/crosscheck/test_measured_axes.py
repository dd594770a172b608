"""Axes as CAD programs export them: parallel but for a fifth digit, or a tenth; against pinocchio.

The numbers are those of a hand whose fingers bend about nearly parallel axes, and of an arm whose
right angles are written as 1.5708 and carry rounding. The inertias of the arm are round numbers.
"""

import numpy as np
import pytest

import mbs
import mbs.models

pin = pytest.importorskip("pinocchio")

# parent, xyz, rpy, axis; mass, centre of mass, ixx ixy ixz iyy iyz izz
THUMB_AND_MIDDLE = [
    (-1, (0.014, 0.012, -0.022546), (-3.1416, 0, 0), (0, 0, 1)),
    (0, (0.03385, -0.0078588, 0.0004), (1.5708, -0.039876, -0.22822), (0, 0, 1)),
    (1, (0.051723, 0.0053583, 0), (0, 9.6078e-05, -0.12589), (0, 0, 1)),
    (-1, (0.0091, 0.0113, -0.10005), (-1.5685, 1.5182, 1.573), (0, 0, 1)),
    (3, (0.038912, 0.0026251, 0), (-0.0020273, -7.4325e-05, -0.04236), (0, 0, 1)),
]
OF_THE_HAND = [
    (0.03498, (0.011297, -0.0024139, 0.00088027), (2.28e-6, 8e-7, 3.1e-7, 4.96e-6, -3e-8, 4.62e-6)),
    (0.047583, (0.02157, -0.0035616, -2.386e-5), (4.41e-6, -1.7e-7, -3e-8, 1.194e-5, 0, 1.308e-5)),
    (0.021803, (0.016377, -0.0025204, 0), (1.42e-6, -4.3e-7, 0, 3.85e-6, 0, 3.8e-6)),
    (0.035619, (0.017246, 0.0047094, 2.979e-5), (2.18e-6, -1e-8, 3e-8, 5.26e-6, -1e-8, 5.69e-6)),
    (0.021803, (0.016377, -0.0025204, 0), (1.42e-6, -4.3e-7, 0, 3.85e-6, 0, 3.8e-6)),
]
ARM = [
    (-1, (0, 0, 0.15643), (-3.1416, 2.7629e-18, -4.9305e-36), (0, 0, 1)),
    (0, (0, 0.005375, -0.12838), (1.5708, 2.1343e-17, -1.1102e-16), (0, 0, 1)),
    (1, (0, -0.21038, -0.006375), (-1.5708, 1.2326e-32, -2.9122e-16), (0, 0, 1)),
    (2, (0, 0.006375, -0.21038), (1.5708, -6.6954e-17, -1.6653e-16), (0, 0, 1)),
    (3, (0, -0.20843, -0.006375), (-1.5708, 2.2204e-16, -6.373e-17), (0, 0, 1)),
    (4, (0, 0.00017505, -0.10593), (1.5708, 9.2076e-28, -8.2157e-15), (0, 0, 1)),
    (5, (0, -0.10593, -0.00017505), (-1.5708, -5.5511e-17, 9.6396e-17), (0, 0, 1)),
]
OF_THE_ARM = [(1.0, (0.0, -0.02, -0.07), (0.004, 0, 0, 0.003, 2e-4, 0.001))] * 7
TILTED = [
    (-1, (0, 0, 0.1), (0, 0, 0), (0, 0, 1)),
    (0, (0.3, 0.1, 0), (0, 0, 0), (1e-9, 0, 1)),
    (1, (0.3, -0.1, 0.05), (1e-12, 0, 0.4), (0, 1e-6, 1)),
    (2, (0.2, 0.1, 0), (0, -1e-4, 0), (1e-14, 0, -1)),
]
OF_THE_TILTED = [(1.0, (0.1, 0.2, 0.3), (0.1, 0, 0, 0.1, 0, 0.1))] * 4


def urdf(rows, bodies):
    """The file."""

    def words(values):
        return " ".join(map(repr, values))

    text = '<robot name="measured"><link name="world"/>'
    for k, ((parent, xyz, rpy, axis), (mass, com, J)) in enumerate(zip(rows, bodies, strict=True)):
        keys = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
        inertia = " ".join(f'{key}="{value!r}"' for key, value in zip(keys, J, strict=True))
        before = "world" if parent < 0 else f"l{parent}"
        text += (
            f'<link name="l{k}"><inertial><origin xyz="{words(com)}"/><mass value="{mass!r}"/>'
            f'<inertia {inertia}/></inertial></link><joint name="j{k}" type="continuous">'
            f'<parent link="{before}"/><child link="l{k}"/><origin xyz="{words(xyz)}"'
            f' rpy="{words(rpy)}"/><axis xyz="{words(axis)}"/></joint>'
        )
    return text + "</robot>"


@pytest.mark.parametrize(
    ("rows", "bodies"),
    [(THUMB_AND_MIDDLE, OF_THE_HAND), (ARM, OF_THE_ARM), (TILTED, OF_THE_TILTED)],
    ids=["hand", "arm", "tilted"],
)
def test_models_equal_those_of_pinocchio(rows, bodies, tmp_path):
    text = urdf(rows, bodies)
    (tmp_path / "robot.urdf").write_text(text)
    system = mbs.load(tmp_path / "robot.urdf").assemble()
    model = pin.buildModelFromXML(text)
    data = model.createData()
    order = [int(c.name[1:]) for c in system.coordinates]
    rng = np.random.default_rng(0)
    for _ in range(3):
        angles, v, a = rng.uniform(-1.5, 1.5, (3, len(rows)))
        q = np.column_stack([np.cos(angles), np.sin(angles)])
        at = [int(model.names[k][1:]) for k in range(1, model.njoints)]
        q, v_pin, a_pin = q[at].ravel(), v[at], a[at]
        tau = np.empty(len(rows))
        tau[at] = pin.rnea(model, data, q, v_pin, a_pin)
        M = np.array(pin.crba(model, data, q))
        M = np.triu(M) + np.triu(M, 1).T
        ours = np.array(mbs.models.inertia_matrix(system)(angles[order]))
        places = [at.index(k) for k in order]
        M = M[np.ix_(places, places)]
        np.testing.assert_allclose(ours, M, rtol=0, atol=1e-13 * np.abs(M).max())
        given = angles[order], v[order], a[order]
        efforts = np.array(mbs.models.inverse_dynamics(system)(*given)).ravel()
        np.testing.assert_allclose(efforts, tau[order], rtol=0, atol=1e-13 * np.abs(tau).max())
        back = np.array(mbs.models.direct_dynamics(system)(*given[:2], tau[order])).ravel()
        np.testing.assert_allclose(back, a[order], rtol=0, atol=1e-12 * np.linalg.cond(M))
        pin.framesForwardKinematics(model, data, q)
        for k in range(len(rows)):
            T = data.oMf[model.getFrameId(f"l{k}")].homogeneous
            pose = np.array(mbs.models.transform(system, f"l{k}")(angles[order]))
            np.testing.assert_allclose(pose, T, rtol=0, atol=2e-14)
