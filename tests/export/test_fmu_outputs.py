"""What an FMU shows on request, beside motions and the pose of the terminal frame."""

import numpy as np
import pytest
from support.observed_four_bar import four_bar

import mbs
from mbs.errors import ModelError


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    path = tmp_path_factory.mktemp("outputs") / "observed.fmu"
    system = four_bar()
    mbs.export.fmu(system, path, fmi="3.0", outputs=("sensors", "energy", "closure"))
    fmu = mbs.simulate.fmu(
        path, 0.5, step=0.05, inputs={"j1.tau": 1.5}, tolerance=1e-10, quiet=True
    )
    own = mbs.simulate.run(
        system, 0.5, q0={}, tau={"j1": 1.5}, step=0.05, tolerance=1e-10, quiet=True
    )
    return system, fmu, own


def test_sensors_read_what_a_simulation_reads(run):
    system, fmu, own = run
    names = [name for sensor in system.sensors for name, _ in sensor.columns]
    assert len(names) > 30
    for name in names:
        size = 1 + np.abs(own[name]).max()
        assert np.abs(fmu[name] - own[name]).max() < 1e-6 * size, name
        assert fmu.units[name] == own.units[name]


def test_energy_grows_by_the_work_of_the_motor(run):
    _, fmu, _ = run
    total = fmu["energy.kinetic"] + fmu["energy.potential"]
    work = 1.5 * (fmu["j1.q"] - fmu["j1.q"][0])
    assert np.abs(total - total[0] - work).max() < 1e-8 * np.abs(total).max()


def test_loops_are_closed(run):
    _, fmu, _ = run
    assert np.abs(fmu["closure"]).max() < 1e-12


def test_unknown_outputs_are_refused_with_a_proposal(tmp_path):
    with pytest.raises(ModelError, match=r"four_bar: the FMU has no outputs 'energie'.*'energy'"):
        mbs.export.fmu(four_bar(), tmp_path / "x.fmu", outputs=["energie"])
