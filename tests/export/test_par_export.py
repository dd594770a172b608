"""Mechanisms written as .par files and read back: the same models."""

import casadi
import numpy as np
import pytest
from support.random_trees import random_tree

import mbs
import mbs.models
from mbs.components import Body, Free, Mechanism, Revolute, Rotor, Spherical
from mbs.errors import ExportError, ModelError


def efforts(system, q, v, a, names):
    """Efforts of the tree by the order of the given joints."""
    idm = mbs.models.inverse_dynamics(system, coordinates="tree")
    values = {p.name: p.default for p in system.parameters}
    assert all(value is not None for value in values.values())
    order = [[c.name for c in system.coordinates].index(name) for name in names]
    inputs = [np.zeros(system.nq) for _ in range(3)]
    for array, given in zip(inputs, (q, v, a), strict=True):
        array[order] = given
    return np.array(idm(*inputs)).ravel()[order]


def same_models(before, path):
    system = before.assemble() if isinstance(before, Mechanism) else before
    mbs.export.par(before, path)
    after = mbs.load(path).assemble()
    rng = np.random.default_rng(3)
    for _ in range(3):
        q, v, a = rng.uniform(-1, 1, (3, system.nq))
        ours = efforts(system, q, v, a, [c.name for c in system.coordinates])
        theirs = efforts(after, q, v, a, [f"q{j}" for j in range(1, system.nq + 1)])
        np.testing.assert_allclose(theirs, ours, atol=1e-11 * np.abs(ours).max())
    return system, after


@pytest.mark.parametrize("name", ["puma560", "stanford", "two_branch_tree", "sr400", "scara"])
def test_catalogue_robots_survive(name, tmp_path):
    same_models(mbs.load(name).assemble(), tmp_path / f"{name}.par")


@pytest.mark.parametrize("seed", range(4))
def test_random_trees_survive(seed, tmp_path):
    kinds = ("revolute", "prismatic", "universal", "cylindrical", "planar")
    same_models(random_tree(seed, 4, kinds).mechanism, tmp_path / "tree.par")


def test_symbols_stay_symbols(tmp_path):
    m = Mechanism("arm", parameters={"L2": 0.7, "A": 0.3, "M1": 2.0})
    first = m.add(
        Body("first", mass="M1", com=("L2/2", 0, 0), inertia=(0.1, 0.1, "M1*L2^2/12 + 0.1"))
    )
    second = m.add(Body("second", mass=1.0, com=(0, 0.2, 0.1), inertia=(0.2, 0.3, 0.4)))
    m.connect(m.world, Revolute("shoulder", axis="y", Fs=0.2, Fs_width=0.1), first)
    m.connect(
        first.at("L2", 0.1, 0), Revolute("elbow", axis="x", Ia="A", stiffness=3.0, rest=0.2), second
    )
    system, after = same_models(m, tmp_path / "arm.par")
    assert {p.name: p.default for p in after.parameters} == {"L2": 0.7, "A": 0.3, "M1": 2.0}
    text = (tmp_path / "arm.par").read_text()
    assert "M1*L2" in text.replace("L2*M1", "M1*L2")
    other = {"L2": 1.3, "A": 0.1, "M1": 0.5}
    q, v, a = np.random.default_rng(1).uniform(-1, 1, (3, 2))
    ours, theirs = (
        mbs.models.inverse_dynamics(s)(q, v, a, s.parameter_values(other)) for s in (system, after)
    )
    np.testing.assert_allclose(np.array(theirs), np.array(ours), rtol=1e-12)


def test_closed_loops_keep_their_cuts_and_posture(tmp_path):
    system = mbs.load("four_bar").assemble()
    mbs.export.par(system, tmp_path / "four_bar.par")
    after = mbs.load(tmp_path / "four_bar.par").assemble()
    assert after.is_closed
    assert len(after.active) == len(system.active) == 1
    np.testing.assert_allclose(after.posture, system.posture, atol=1e-9)
    ours, theirs = (mbs.models.inverse_dynamics(s)(s.posture, 0.7, -0.4) for s in (system, after))
    np.testing.assert_allclose(float(theirs), float(ours), rtol=1e-9)


@pytest.mark.parametrize(("joint", "word"), [(Free("j"), "free"), (Spherical("j"), "spherical")])
def test_joints_that_the_format_does_not_have(joint, word, tmp_path):
    m = Mechanism("m")
    m.connect(m.world, joint, m.add(Body("b", mass=1.0, inertia=(1, 1, 1))))
    with pytest.raises(ModelError, match=f"m/j: a .par file has no {word} joint"):
        mbs.export.par(m, tmp_path / "m.par")
    assert not list(tmp_path.iterdir())


def test_rotors_on_moving_links_are_refused(tmp_path):
    m = Mechanism("m")
    joint = Revolute("j", axis="z", rotor=Rotor(inertia=1e-4, ratio=50))
    m.connect(m.world, joint, m.add(Body("b", mass=1.0, inertia=(1, 1, 1))))
    with pytest.raises(ModelError, match=r"m/j: a \.par file has no rotor"):
        mbs.export.par(m, tmp_path / "m.par")


def test_other_arguments_are_refused(tmp_path):
    with pytest.raises(ModelError, match="give a System or a Mechanism"):
        mbs.export.par(casadi.SX(1), tmp_path / "m.par")
    with pytest.raises(ExportError, match="not a path"):
        mbs.export.par(mbs.load("planar_2r"), 3)
