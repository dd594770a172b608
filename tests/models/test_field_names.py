"""Names of models that other tools use."""

import numpy as np
import pytest

import mbs
from mbs.errors import ModelError


@pytest.fixture(scope="module")
def arm():
    return mbs.load("puma560").assemble()


@pytest.mark.parametrize(
    ("name", "own"),
    [
        ("forward_kinematics", "direct_geometry"),
        ("forward_dynamics", "direct_dynamics"),
        ("mass_matrix", "inertia_matrix"),
        ("crba", "inertia_matrix"),
        ("rnea", "inverse_dynamics"),
        ("nonlinear_effects", "bias"),
        ("generalised_gravity", "gravity_effort"),
        ("geometric_jacobian", "jacobian"),
        ("jacobian_drift", "jacobian_dot_velocity"),
    ],
)
def test_names_of_the_field_are_the_same_models(name, own):
    assert getattr(mbs.models, name) is getattr(mbs.models, own)
    assert name in mbs.models.__all__


def test_the_articulated_body_algorithm(arm):
    rng = np.random.default_rng(1)
    q, v, tau = rng.uniform(-1, 1, (3, 6))
    a = mbs.models.aba(arm)(q, v, tau)
    np.testing.assert_allclose(a, mbs.models.direct_dynamics(arm)(q, v, tau), rtol=1e-9)


def test_inverse_kinematics_takes_a_pose(arm):
    q = np.array([0.1, 0.2, 0.3, 0.4, 0.5, 0.6])
    T = mbs.models.forward_kinematics(arm)(q).full()
    found = mbs.models.inverse_kinematics(arm, T)
    assert np.min(np.max(np.abs(found.q - q), axis=1)) < 1e-9
    assert len(found) == len(mbs.models.inverse_geometry.solve(arm, T))


@pytest.mark.parametrize(
    ("arguments", "options"),
    [((), {}), ((6,), {}), (("link6",), {}), ((np.eye(4),), {"rows": [0, 1, 2]})],
)
def test_the_former_meaning_of_inverse_kinematics_is_refused(arm, arguments, options):
    with pytest.raises(ModelError, match="inverse_differential_kinematics"):
        mbs.models.inverse_kinematics(arm, *arguments, **options)


def test_unknown_models_have_near_names():
    with pytest.raises(AttributeError, match=r"no 'inertia_matrx'; did you mean 'inertia_matrix'"):
        _ = mbs.models.inertia_matrx


def test_assembly_modes():
    assert mbs.loops.assembly_modes is mbs.loops.assembly_modes


def test_actuated_velocities_are_no_independent_ones():
    m = mbs.Mechanism("m", guess={"j2": 1.0})
    lengths = {"a": 0.4, "b": 1.0, "c": 0.9}
    a, b, c = (
        m.add(mbs.components.Box(n, length=x, width=0.05, density=2700)) for n, x in lengths.items()
    )
    m.connect(m.world, mbs.components.Revolute("j1", actuated=False), a.left)
    m.connect(a.right, mbs.components.Revolute("j2", actuated=False), b.left)
    m.connect(b.right, mbs.components.Revolute("j3", actuated=False), c.right)
    m.connect(m.world.at(0.8), mbs.components.Revolute("j4", actuated=True), c.left)
    system = m.assemble(active=["j1"])
    names = [speed.name for speed in system.velocity_coordinates]
    assert [names[k] for k in system.independent] == ["j1"]
    assert [names[k] for k in system.actuated] == ["j4"]
