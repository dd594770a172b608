"""Mechanisms whose bars are in one line at the start: branches, dead centres, rigid triangles."""

import numpy as np
import pytest

import mbs
from mbs.components import Box, JointStop, Revolute, RigidStop
from mbs.errors import LoopError, SolverError

JOINTS = ("j1", "j2", "j3", "j4")


def four_bar(a, b, c, ground, cut=None, motor=True):
    m = mbs.Mechanism("four_bar", gravity=(0, -9.81, 0))
    bars = [m.add(Box(n, length=x, mass=1.0)) for n, x in zip("abc", (a, b, c), strict=True)]
    joints = {name: Revolute(name, actuated=motor and name == "j1") for name in JOINTS}
    m.connect(m.world, joints["j1"], bars[0].left)
    m.connect(bars[0].right, joints["j2"], bars[1].left)
    m.connect(bars[1].right, joints["j3"], bars[2].right)
    m.connect(m.world.at(ground), joints["j4"], bars[2].left)
    if cut:
        m.cut(joints[cut])
    return m


def at(system):
    return dict(zip((c.name for c in system.coordinates), system.configuration, strict=True))


PARALLELOGRAM = (0.3, 0.8, 0.3, 0.8)


@pytest.mark.parametrize("cut", [None, "j2", "j4"])
def test_a_flat_parallelogram_is_assembled_next_to_it(cut):
    """Both branches are listed; the parallel bars move less than the crossed ones."""
    system = four_bar(*PARALLELOGRAM, cut).assemble()
    expected = {"j1": 0.1, "j2": -0.1, "j3": 0.1, "j4": 0.1}
    for name, value in at(system).items():
        assert value == pytest.approx(expected[name], abs=1e-9)
    assert system.closure.meets
    assert len(system.closure.others) == 1
    crossed = dict(zip(at(system), system.closure.others[0], strict=True))
    assert crossed["j1"] == pytest.approx(0.1, abs=1e-12)
    report = system.report()
    assert "branches of motion meet there" in report
    assert "Another configuration: j1 = 0.1" in report
    model = mbs.models.direct_dynamics(system)
    assert np.isfinite(float(model(system.configuration, 0.0, 0.0)))


@pytest.mark.parametrize("cut", [None, "j2"])
def test_a_guess_chooses_a_branch_of_a_flat_parallelogram(cut):
    system = four_bar(*PARALLELOGRAM, cut).assemble(guess={"j1": 0.0, "j4": -0.2})
    position = at(system)
    assert position["j1"] == pytest.approx(0.1, abs=1e-12)
    assert position["j4"] < -0.1
    mirrored = four_bar(*PARALLELOGRAM, cut).assemble(guess={"j1": 0.0, "j4": 0.2})
    assert at(mirrored)["j1"] == pytest.approx(-0.1, abs=1e-12)
    assert at(mirrored)["j4"] == pytest.approx(-position["j4"], abs=1e-9)


@pytest.mark.parametrize("cut", [None, "j2", "j4"])
def test_a_guess_of_a_motor_at_a_singular_configuration_is_kept_nearly(cut):
    """Coupler and rocker in one line with the crank and the ground: half a turn of the crank."""
    system = four_bar(0.4, 0.7, 0.3, 0.6, cut).assemble(guess={"j1": np.pi})
    assert system.closure.meets
    assert at(system)["j1"] == pytest.approx(np.pi + 0.1, abs=1e-12)
    assert "Guesses that are not met: j1 = 3.1416." in system.report()


@pytest.mark.parametrize("cut", [None, "j2", "j4"])
@pytest.mark.parametrize("motor", [True, False])
def test_bars_that_close_in_one_line_only_are_no_mechanism(motor, cut):
    """They allowed two velocities, and were analysed as a mechanism of mobility two."""
    with pytest.raises(LoopError, match=r"in one configuration only, j1 = .*; change lengths"):
        four_bar(0.25, 0.25, 0.5, 1.0, cut, motor).assemble()


@pytest.mark.parametrize("cut", [None, "j2", "j4"])
def test_a_dead_centre_of_the_motor_is_reported(cut):
    """Coupler and rocker are in one line at the end of the range of the crank."""
    end = float(np.arccos(-0.25))
    system = four_bar(0.4, 0.4, 0.4, 0.6, cut).assemble(guess={"j1": end})
    assert system.closure.dead
    assert "The configuration is a dead centre of j1" in system.report()
    regular = four_bar(0.4, 0.4, 0.4, 0.6, cut).assemble(guess={"j1": end - 0.1})
    assert not regular.closure.dead
    assert "dead centre" not in regular.report()


@pytest.mark.parametrize("cut", [None, "j2", "j4"])
def test_configurations_of_one_motion_are_not_listed_as_others(cut):
    """A kite without motor, for which Newton's method finds nothing from zero."""
    system = four_bar(0.5, 0.5, 0.8, 0.8, cut, motor=False).assemble()
    assert len(system.closure.others) == 1


def parallelogram_with(stop):
    m = four_bar(*PARALLELOGRAM, motor=False)
    m.add(stop)
    return m.assemble(guess={"j1": 0.5, "j2": -0.5})


@pytest.mark.parametrize(("limit", "restitution"), [(0.0, 0.0), (0.0, 0.5), (1e-4, 0.0)])
def test_a_rigid_stop_at_a_flat_parallelogram_is_named(limit, restitution):
    system = parallelogram_with(RigidStop("stop", "j1", lower=limit, restitution=restitution))
    with pytest.raises(SolverError, match=r"rigid stop at j1 is closed there: .* JointStop"):
        mbs.simulate.run(system, 1.0, quiet=True)


def test_stops_next_to_a_flat_parallelogram_hold_it():
    beside = parallelogram_with(RigidStop("stop", "j1", lower=0.01))
    result = mbs.simulate.run(beside, 1.0, quiet=True)
    assert result["j1.q"][-1] == pytest.approx(0.01, abs=1e-9)
    elastic = JointStop("stop", "j1", lower=0.0, stiffness=1e4, damping=10, width=1e-3)
    result = mbs.simulate.run(parallelogram_with(elastic), 1.0, quiet=True)
    assert abs(result["j1.q"][-1]) < 0.01
    np.testing.assert_allclose(result["j4.q"], result["j1.q"], atol=1e-6)  # on its branch
