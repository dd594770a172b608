"""Co-simulation through configurations in which the states of an FMU determine nothing."""

import numpy as np
import pytest
from fmpy.fmi2 import FMU2Slave
from fmu_instances import Fmu

import mbs
from mbs.simulate.fmu import fmu

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
    for speed in system.speeds:
        assert result[f"{speed.name}.q"] == pytest.approx(shown[f"{speed.name}.q"], abs=1e-5)
        assert result[f"{speed.name}.v"] == pytest.approx(shown[f"{speed.name}.v"], abs=1e-3)


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
