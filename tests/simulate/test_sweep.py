"""Parameter studies over executors, interrupted and resumed."""

import inspect
import threading
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor

import numpy as np
import pytest

import mbs
from mbs.errors import ExportError, ModelError


def pendulum(m=2.0):
    return mbs.load(
        {
            "name": "pendulum",
            "gravity": [0, -9.81, 0],
            "parameters": {"L": 0.5, "m": m},
            "frame": [{"antecedent": 0, "joint": "revolute"}],
            "body": [{"frame": 1, "YY": "m*L^2", "ZZ": "m*L^2", "MX": "m*L", "M": "m"}],
        }
    ).assemble()


GRID = {"L": [0.4, 0.6], "q1.q": [0.1, 0.2, 0.3]}
OPTIONS = {"step": 0.1, "tolerance": 1e-9, "quiet": True}


@pytest.fixture(scope="module")
def system():
    return pendulum()


@pytest.fixture(scope="module")
def fmu(system, tmp_path_factory):
    return mbs.export.fmu(system, tmp_path_factory.mktemp("fmu") / "pendulum.fmu")


def test_every_combination_is_simulated_as_by_hand(system):
    study = mbs.simulate.sweep(system, GRID, 1.0, **OPTIONS)
    assert len(study) == 6
    assert not study.failures
    assert study.cases[1] == {"L": 0.4, "q1.q": 0.2}
    for case, result in study:
        alone = mbs.simulate.run(
            system, 1.0, q0={"q1": case["q1.q"]}, parameters={"L": case["L"]}, **OPTIONS
        )
        assert np.array_equal(result.values, alone.values)
        assert result.units == alone.units


def test_listed_cases_and_efforts(system):
    listed = [{"q1.tau": 1.0}, {"q1.tau": 2.0, "m": 4.0}]
    study = mbs.simulate.sweep(system, listed, 0.2, q0={"q1": 0.5}, **OPTIONS)
    assert [study[k]["q1.tau"][0] for k in (0, 1)] == [1.0, 2.0]
    assert study[0]["q1.q"][0] == 0.5


def test_an_interrupted_study_goes_on(system, tmp_path, monkeypatch):
    folder, run = tmp_path / "study", mbs.simulate.run
    counted = []

    def interrupted(*arguments, **options):
        counted.append(options["parameters"])
        if len(counted) == 4:
            raise KeyboardInterrupt
        return run(*arguments, **options)

    home = inspect.getmodule(mbs.simulate.sweep)
    monkeypatch.setattr(home, "run", interrupted)
    with pytest.raises(KeyboardInterrupt):
        mbs.simulate.sweep(system, GRID, 1.0, folder=folder, **OPTIONS)
    study = mbs.simulate.sweep(system, GRID, 1.0, folder=folder, **OPTIONS)
    assert len(counted) == 4 + 3
    assert not study.failures
    whole = mbs.simulate.sweep(system, GRID, 1.0, **OPTIONS)
    for k in range(6):
        assert np.array_equal(study[k].values, whole[k].values)
    with pytest.raises(ModelError, match="holds another study"):
        mbs.simulate.sweep(system, {"L": [1.0]}, 1.0, folder=folder, **OPTIONS)


def test_processes_simulate_an_fmu_and_give_the_same_bits(fmu):
    with ProcessPoolExecutor(2) as executor:
        spread = mbs.simulate.sweep(fmu, GRID, 0.5, executor=executor, **OPTIONS)
    alone = mbs.simulate.sweep(fmu, GRID, 0.5, **OPTIONS)
    assert not spread.failures
    for k in range(6):
        assert np.array_equal(spread[k].values, alone[k].values)
    assert np.ptp([spread[k]["q1.q"][-1] for k in range(6)]) > 0.1


def test_threads_simulate_a_system(system):
    with ThreadPoolExecutor(2) as executor:
        study = mbs.simulate.sweep(system, GRID, 0.5, executor=executor, **OPTIONS)
    assert [study[k]["q1.q"][0] for k in range(3)] == GRID["q1.q"]


def test_a_failed_case_does_not_stop_the_others(system):
    study = mbs.simulate.sweep(system, {"m": [1.0, 0.0]}, 0.2, q0={"q1": 0.3}, **OPTIONS)
    assert list(study.failures) == [1]
    assert len(list(study)) == 1
    with pytest.raises(ModelError, match="case 1 failed"):
        study[1]


@pytest.mark.parametrize(
    ("grid", "message"),
    [
        ({}, "no case"),
        ({"L": []}, "no case"),
        ([], "no case"),
        ({"L": ["long"]}, "L is 'long'; give numbers"),
    ],
)
def test_grids(system, grid, message):
    with pytest.raises(ModelError, match=message):
        mbs.simulate.sweep(system, grid, 0.1, **OPTIONS)


def test_a_system_is_not_sent_to_processes(system):
    with ProcessPoolExecutor(1) as executor, pytest.raises(ModelError, match="path of the FMU"):
        mbs.simulate.sweep(system, GRID, 0.1, executor=executor, **OPTIONS)


@pytest.mark.parametrize(("name", "meant"), [("K", "L"), ("q1", "q1.q"), ("q1.p", "q1.q")])
def test_an_unknown_name_is_refused_before_anything_runs(system, name, meant):
    with pytest.raises(ModelError, match=rf"pendulum has no '{name}' to vary; .*{meant}"):
        mbs.simulate.sweep(system, {name: [1.0]}, 0.1, **OPTIONS)


def test_the_reason_of_a_failure_is_that_of_the_fmu(fmu):
    study = mbs.simulate.sweep(fmu, {"m": [0.0]}, 0.1, **OPTIONS)
    assert "not finite" in study.failures[0]


def test_what_is_no_executor(system):
    with pytest.raises(ModelError, match=r"executor is 2; give one of concurrent\.futures"):
        mbs.simulate.sweep(system, GRID, 0.1, executor=2, **OPTIONS)


def test_a_folder_is_for_one_model_with_its_numbers(tmp_path):
    arguments = ({"q1.q": [0.1]}, 0.1)
    mbs.simulate.sweep(pendulum(), *arguments, folder=tmp_path / "a", **OPTIONS)
    assert not mbs.simulate.sweep(pendulum(), *arguments, folder=tmp_path / "a", **OPTIONS).failures
    with pytest.raises(ModelError, match="holds another study"):
        mbs.simulate.sweep(pendulum(2.5), *arguments, folder=tmp_path / "a", **OPTIONS)
    (tmp_path / "a" / "study.json").unlink()  # whose results these are is not known any more
    with pytest.raises(ModelError, match="holds another study"):
        mbs.simulate.sweep(pendulum(), *arguments, folder=tmp_path / "a", **OPTIONS)


def test_common_values_as_an_array_are_refused_beside_those_of_the_grid(system):
    study = mbs.simulate.sweep(system, {"q1.q": [0.1]}, 0.1, q0=np.array([0.2, 0.3]), **OPTIONS)
    assert "give q0 as a dict" in study.failures[0]


def test_a_system_needs_a_duration_and_an_fmu_must_be_there(system, tmp_path):
    with pytest.raises(ModelError, match="has no duration; give one"):
        mbs.simulate.sweep(system, GRID, **OPTIONS)
    with pytest.raises(ModelError, match=r"no.fmu cannot be read .*; give the path of an FMU"):
        mbs.simulate.sweep(tmp_path / "no.fmu", GRID, **OPTIONS)
    with pytest.raises(ModelError, match="sweep: 3 is no model"):
        mbs.simulate.sweep(3, GRID, **OPTIONS)


def test_a_folder_that_cannot_be_made(system, tmp_path):
    (tmp_path / "taken").write_text("")
    with pytest.raises(ExportError, match="taken cannot be made"):
        mbs.simulate.sweep(system, GRID, 0.1, folder=tmp_path / "taken", **OPTIONS)


def test_a_broken_off_study_begins_no_further_case(system, monkeypatch):
    begun, first = [], threading.Event()

    def broken(*arguments, **options):
        begun.append(options["parameters"])
        if len(begun) == 1:
            raise RuntimeError("broken")
        first.wait(0.2)

    monkeypatch.setattr(inspect.getmodule(mbs.simulate.sweep), "run", broken)
    with ThreadPoolExecutor(1) as executor, pytest.raises(RuntimeError, match="broken"):
        mbs.simulate.sweep(system, {"L": [0.1] * 50}, 0.1, executor=executor, **OPTIONS)
    assert len(begun) < 50
