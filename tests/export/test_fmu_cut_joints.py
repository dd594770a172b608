"""Guesses of joints that are cut, as start values of an FMU."""

import numpy as np
import pytest

import mbs
from mbs.components import Body, Revolute, Spherical
from mbs.errors import ModelError
from mbs.loops.cut_positions import cut_positions

LENGTHS = 0.3, 0.6, 0.5, 0.7
"""Lengths of crank, coupler, rocker and ground [m]."""


def linkage(cut, kinds="RRRR"):
    """A four-bar in a plane whose joint number `cut` is cut."""
    m = mbs.Mechanism("linkage", gravity=(0, -9.81, 0))
    links = [
        m.add(Body(name, mass=1.0, com=(x / 2, 0, 0), inertia=(0.03, 0.05, 0.06)))
        for name, x in zip("abc", LENGTHS, strict=False)
    ]
    ends = [m.world.at(), *(link.at(x) for link, x in zip(links, LENGTHS, strict=False))]
    starts = [*(link.at() for link in links), m.world.at(LENGTHS[3])]
    for k, (kind, a, b) in enumerate(zip(kinds, ends, starts, strict=True)):
        joint = Spherical(f"j{k}")
        if kind == "R":
            joint = Revolute(f"j{k}", axis="z", actuated=k == 0)
        m.connect(a, joint, b)
        if k == cut:
            m.cut(joint)
    return m.assemble(guess={"j0": 1.0})


def same_start(system, path, guess, kind):
    """Compare the first row and the last row of an FMU with those of `run` for the same guess."""
    start = {"j0.q": 1.0} | {f"{name}.solved": value for name, value in guess.items()}
    found = mbs.simulate.fmu(path, 0.05, start=start, kind=kind, quiet=True)
    expected = mbs.simulate.run(system, 0.05, q0={"j0": 1.0}, guess=guess, quiet=True)
    names = [f"{row.name}.q" for row in system.coordinates]
    for name in names:
        np.testing.assert_allclose(found[name][0], expected[name][0], atol=1e-11)
        np.testing.assert_allclose(found[name][-1], expected[name][-1], atol=1e-6)
    return [float(found[name][0]) for name in names]


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_a_guess_of_a_cut_joint_chooses_the_branch(fmi, tmp_path):
    for cut in (1, 3):
        system = linkage(cut)
        path = mbs.export.fmu(system, tmp_path / f"cut{cut}.fmu", fmi=fmi)
        for kind in ("ModelExchange", "CoSimulation"):
            starts = [
                same_start(system, path, {f"j{cut}": guess}, kind) for guess in (-2.5, -1.0, 1.0)
            ]
            assert np.abs(np.array(starts) - starts[0]).max() > 1.0


@pytest.mark.parametrize("sign", [1, -1])
def test_a_guess_of_a_cut_ball_joint_is_an_orientation(sign, tmp_path):
    """A quaternion and its negative are one orientation."""
    system = linkage(1, "RSRR")
    path = mbs.export.fmu(system, tmp_path / "ball.fmu")
    for q in (mbs.loops.solve(system, {"j0": 1.0}, guess={"j3": x}) for x in (-2.0, 2.0)):
        at_cut = sign * np.array(cut_positions(system)(q, [])).ravel()
        guess = dict(zip([row.name for row in system.cut_coordinates], at_cut, strict=True))
        start = {"j0.q": 1.0} | {f"{name}.solved": value for name, value in guess.items()}
        found = mbs.simulate.fmu(path, 0.01, start=start, kind="CoSimulation", quiet=True)
        for row, value in zip(system.coordinates, q, strict=True):
            assert found[f"{row.name}.q"][0] == pytest.approx(value, abs=1e-9)


def test_a_cut_joint_is_a_local_variable_with_its_position(tmp_path):
    fmpy = pytest.importorskip("fmpy")
    system = linkage(1)
    path = mbs.export.fmu(system, tmp_path / "cut.fmu")
    variables = {v.name: v for v in fmpy.read_model_description(str(path)).modelVariables}
    variable, at_cut = variables["j1.solved"], cut_positions(system)(system.configuration, [])
    assert (variable.causality, variable.initial) == ("local", "approx")
    assert float(variable.start) == pytest.approx(float(at_cut), abs=1e-15)
    result = fmpy.simulate_fmu(
        str(path), stop_time=0.1, output=["j1.solved", *(f"j{k}.q" for k in (0, 2, 3))]
    )
    for row in (result[0], result[-1]):
        q = [row[f"{one.name}.q"] for one in system.coordinates]
        assert row["j1.solved"] == pytest.approx(float(cut_positions(system)(q, [])), abs=1e-8)


def test_the_name_of_run_for_a_cut_joint_is_an_error_with_the_name_of_the_guess(tmp_path):
    path = mbs.export.fmu(linkage(1), tmp_path / "cut.fmu")
    with pytest.raises(ModelError, match=r"j1.q follows from the loops; .*j1.solved as a guess"):
        mbs.simulate.fmu(path, 0.1, start={"j1": 0.5}, quiet=True)
