"""Co-simulation through configurations in which the states of an FMU determine nothing."""

import numpy as np
import pytest
from fmpy.fmi2 import FMU2Slave
from fmu_instances import Fmu
from support.change_points import linkage

import mbs
from mbs.errors import SolverError
from mbs.simulate import fmu

MECHANISMS = {
    "n_four_bar": (lambda: mbs.robots.n_four_bar().assemble(active=["a0"]), {"a0.v": -1.0}),
    "five_bar": (lambda: mbs.robots.five_bar().assemble(), {}),
}
VERSIONS = {"n_four_bar": "3.0", "five_bar": "2.0"}


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("passages")
    return {
        name: mbs.export.fmu(
            build(), folder / f"{name}.fmu", fmi=VERSIONS[name], outputs=["energy", "closure"]
        )
        for name, (build, _) in MECHANISMS.items()
    }


def energy(result):
    total = result["energy.kinetic"] + result["energy.potential"]
    return np.ptp(total) / result["energy.kinetic"].max()


@pytest.mark.parametrize("name", MECHANISMS)
def test_energy_falls_with_the_tolerance(made, name):
    start = MECHANISMS[name][1]
    for tolerance in (1e-4, 1e-6, 1e-8, 1e-10):
        result = fmu(made[name], 3.0, start=start, tolerance=tolerance, step=0.02)
        assert energy(result) < 100 * tolerance
        assert result["closure"].max() < 1e-9


@pytest.mark.parametrize("name", MECHANISMS)
def test_the_motion_is_that_of_a_simulation(made, name):
    build, start = MECHANISMS[name]
    system = build()
    v0 = {key.removesuffix(".v"): value for key, value in start.items()}
    shown = mbs.simulate.run(system, 1.5, v0=v0, tolerance=1e-10, step=0.02, quiet=True)
    result = fmu(made[name], 1.5, start=start, tolerance=1e-10, step=0.02)
    for speed in system.velocity_coordinates:
        assert result[f"{speed.name}.q"] == pytest.approx(shown[f"{speed.name}.q"], abs=1e-5)
        assert result[f"{speed.name}.v"] == pytest.approx(shown[f"{speed.name}.v"], abs=1e-3)


@pytest.fixture(scope="module")
def implicit(tmp_path_factory):
    kite = linkage((0.5, 1.1, 1.1, 0.5), (1.0, 0.5, 2.0))
    path = tmp_path_factory.mktemp("implicit") / "kite.fmu"
    return kite, mbs.export.fmu(kite, path, solver="rodas", outputs=["energy", "closure"])


def test_the_implicit_solver_passes_too(implicit):
    kite, path = implicit
    shown = mbs.simulate.run(kite, 3.0, v0={"j1": 6.0}, tolerance=1e-10, step=0.05, quiet=True)
    assert np.ptp(shown["j1.q"]) > 2 * np.pi
    for tolerance in (1e-4, 1e-6, 1e-8):
        result = fmu(path, 3.0, start={"j1.v": 6.0}, tolerance=tolerance, step=0.05, quiet=True)
        assert energy(result) < 50 * tolerance
        assert result["closure"].max() < 1e-11
        assert result["j4.q"] == pytest.approx(shown["j4.q"], abs=300 * tolerance)


def test_the_implicit_solver_starts_in_a_singular_configuration(implicit):
    kite, path = implicit
    v0 = [1.1, -0.8, 0.8]
    shown = mbs.simulate.run(kite, 1.0, q0=[0] * 3, v0=v0, tolerance=1e-10, step=0.05, quiet=True)
    start = {"j1.q": 0.0, "j1.v": 1.1, "j2.v": -0.8}
    result = fmu(path, 1.0, start=start, tolerance=1e-9, step=0.05, quiet=True)
    assert result["j4.q"] == pytest.approx(shown["j4.q"], abs=1e-6)


def test_a_state_of_the_implicit_solver_goes_on_bit_for_bit(implicit, tmp_path):
    """The Jacobian is none of it: it is taken again."""
    kite = Fmu(implicit[1], tmp_path)
    instance, other = (kite.open(FMU2Slave, start={"j1.v": 6.0}, tolerance=1e-7) for _ in range(2))
    for k in range(15):
        state = instance.serializeFMUstate(instance.getFMUstate())
        expected = kite.step(instance, 1, 0.05, begin=0.05 * k)
        other.setFMUstate(other.deSerializeFMUstate(state))
        assert np.array_equal(kite.step(other, 1, 0.05, begin=0.05 * k), expected)
    for each in (instance, other):
        each.freeInstance()


@pytest.mark.parametrize("step", [0.005, 0.3])
def test_communication_steps_do_not_change_the_motion(made, step):
    start = MECHANISMS["n_four_bar"][1]
    fine, coarse = (
        fmu(made["n_four_bar"], 3.0, start=start, tolerance=1e-9, step=h) for h in (0.1, step)
    )
    assert coarse["a1.q"][-1] == pytest.approx(fine["a1.q"][-1], abs=1e-5)


def test_a_state_saved_before_a_singular_configuration_goes_on_bit_for_bit(made, tmp_path):
    five_bar = Fmu(made["five_bar"], tmp_path)
    instance = five_bar.open(FMU2Slave, tolerance=1e-7)
    five_bar.step(instance, 38)
    state = instance.getFMUstate()
    expected = five_bar.step(instance, 40, begin=0.38)
    instance.setFMUstate(state)
    assert np.array_equal(five_bar.step(instance, 40, begin=0.38), expected)
    other = five_bar.open(FMU2Slave)
    other.setFMUstate(other.deSerializeFMUstate(instance.serializeFMUstate(state)))
    assert np.array_equal(five_bar.step(other, 40, begin=0.38), expected)
    for each in (instance, other):
        each.freeInstance()


@pytest.mark.parametrize("kind", ["CoSimulation", "ModelExchange"])
def test_a_start_beyond_where_branches_cross_is_on_the_branch_that_leads_there(made, kind):
    """One long step from the start values landed on the branch whose rocker stands still."""
    for start in (3.15, 4.0, 7.0, -0.5, -3.2):
        result = fmu(
            made["n_four_bar"], 1e-4, start={"a0.q": start}, step=1e-4, kind=kind, quiet=True
        )
        assert result["a1.q"][0] == pytest.approx(start, abs=1e-9)
        assert result["b0.q"][0] == pytest.approx(-start, abs=1e-9)


def test_errors_fall_with_the_tolerance_where_communication_steps_are_long(made):
    """A short step ends every step of the solver: the errors are then those of the steps."""
    found = {
        step: [
            energy(fmu(made["five_bar"], 3.0, tolerance=tolerance, step=step, quiet=True))
            for tolerance in (1e-3, 1e-5, 1e-7)
        ]
        for step in (1e-3, 0.5)
    }
    assert found[1e-3][0] == found[1e-3][1]
    assert found[0.5][0] > 10 * found[0.5][1] > 100 * found[0.5][2]


def test_a_stop_names_the_system_the_time_and_the_configuration(tmp_path):
    """Branches that come near each other by 1e-9 and do not meet."""
    system = linkage((0.4, 0.9, 0.7 + 1e-9, 1.2), (1.0, -0.5, 1.5))
    path = mbs.export.fmu(system, tmp_path / "linkage.fmu")
    message = r"linkage: integration stopped at time 0\.\d+ \(j1\.q = .*come near each other"
    with pytest.raises(SolverError, match=message):
        fmu(path, 3.0, start={"j1.v": 6.0}, tolerance=1e-11, step=0.5, quiet=True)


@pytest.mark.parametrize("kind", ["CoSimulation", "ModelExchange"])
def test_a_near_miss_turns(tmp_path, kind):
    """Branches come near each other by 1e-8 and do not meet: a long step went across."""
    system = linkage((0.4, 0.9, 0.7 + 1e-8, 1.2), (1.0, -0.5, 1.5))
    path = mbs.export.fmu(system, tmp_path / "linkage.fmu")
    rough, fine = (
        fmu(path, 3.0, start={"j1.v": 6.0}, tolerance=x, kind=kind, step=0.02, quiet=True)
        for x in (1e-6, 1e-9)
    )
    assert fine["j4.q"][-1] == pytest.approx(1.7526, abs=1e-3)
    assert rough["j4.q"][-1] == pytest.approx(fine["j4.q"][-1], abs=0.01)
