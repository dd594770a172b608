"""Parameter studies over executors, interrupted and resumed."""

import inspect
import os
import pickle
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import replace
from multiprocessing import get_context

import numpy as np
import pytest

import mbs
from mbs import Result
from mbs.components import Custom, PointMass, Prismatic, custom
from mbs.errors import ExportError, ModelError, SolverError


def pendulum(m=2.0, gravity=9.81):
    return mbs.load(
        {
            "name": "pendulum",
            "gravity": [0, -gravity, 0],
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


def test_the_folder_is_the_one_named_at_the_start(system, tmp_path, monkeypatch):
    """The working directory belongs to the process: another thread may change it meanwhile."""
    monkeypatch.chdir(tmp_path)
    (elsewhere := tmp_path / "elsewhere").mkdir()

    def torque(*_):
        os.chdir(elsewhere)
        return [0.0]

    study = mbs.simulate.sweep(system, GRID, 0.2, tau=torque, folder="study", **OPTIONS)
    assert not study.failures
    assert study[5].time[-1] == pytest.approx(0.2)
    assert not list(elsewhere.iterdir())
    monkeypatch.chdir(tmp_path)
    again = mbs.simulate.Sweep.open("study")
    os.chdir(elsewhere)
    assert np.array_equal(again[5].values, study[5].values)


def test_listed_cases_and_efforts(system):
    listed = [{"q1.tau": 1.0}, {"q1.tau": 2.0, "m": 4.0}]
    study = mbs.simulate.sweep(system, listed, 0.2, q0={"q1": 0.5}, **OPTIONS)
    assert [study[k]["q1.tau"][0] for k in (0, 1)] == [1.0, 2.0]
    assert study[0]["q1.q"][0] == 0.5


def test_an_interrupted_study_goes_on(system, tmp_path, monkeypatch):
    folder, run = tmp_path / "study", mbs.simulate.Simulator.__call__
    counted = []

    def interrupted(*arguments, **options):
        counted.append(options["parameters"])
        if len(counted) == 4:
            raise KeyboardInterrupt
        return run(*arguments, **options)

    monkeypatch.setattr(mbs.simulate.Simulator, "__call__", interrupted)
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
        ({"L": ["1.5"]}, "L is '1.5'; give numbers"),
        ({"L": [[0.5, 0.6]]}, "give one number for each case"),
    ],
)
def test_grids(system, grid, message):
    with pytest.raises(ModelError, match=message):
        mbs.simulate.sweep(system, grid, 0.1, **OPTIONS)


def prepared_state_equations(run):
    """How many state equations a process has of what was sent to it."""
    return len(run.system._cache["recent", "state equations"])


def test_processes_simulate_a_system_and_prepare_it_once():
    system = pendulum()
    grid = {"L": [0.4, 0.6], "q1.tau": [0.0, 1.0, 2.0]}
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as executor:
        spread = mbs.simulate.sweep(system, grid, 0.5, executor=executor, **OPTIONS)
        sent = inspect.getmodule(mbs.simulate.sweep)._SystemSimulation(system)
        assert executor.submit(prepared_state_equations, sent).result() == 1
    alone = mbs.simulate.sweep(system, grid, 0.5, **OPTIONS)
    assert not spread.failures
    for k in range(6):
        assert np.array_equal(spread[k].values, alone[k].values)


def test_a_law_that_a_module_does_not_define_is_not_sent_to_processes(system):
    with ProcessPoolExecutor(1) as executor, pytest.raises(ModelError, match="cannot be sent to"):
        mbs.simulate.sweep(
            system, GRID, 0.1, executor=executor, tau=lambda t, q, v: {"q1": t}, **OPTIONS
        )


def test_a_class_that_a_module_does_not_define_is_not_sent_to_processes():
    class Local(Custom):
        point = custom.frame()

        def loads(self, at):
            return {"point": custom.force(-at.point.v)}

    m = mbs.Mechanism("fall", gravity=(0, 0, -9.81))
    stone = m.add(PointMass("stone", mass=0.3))
    m.connect(m.world, Prismatic("z", axis="z", actuated=False), stone)
    m.add(Local("drag", stone))
    with (
        ProcessPoolExecutor(1) as executor,
        pytest.raises(ModelError, match=r"fall cannot be sent to .*Local.*in a module"),
    ):
        mbs.simulate.sweep(m.assemble(), {"z.q": [0.1]}, 0.1, executor=executor, **OPTIONS)


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
    last_digit = pendulum(gravity=9.810000000000002)
    with pytest.raises(ModelError, match="holds another study"):
        mbs.simulate.sweep(last_digit, *arguments, folder=tmp_path / "a", **OPTIONS)
    sent = pickle.loads(pickle.dumps(pendulum()))
    assert not mbs.simulate.sweep(sent, *arguments, folder=tmp_path / "a", **OPTIONS).failures
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


def test_a_broken_off_study_begins_no_further_case(system, tmp_path, monkeypatch):
    begun, first = [], threading.Event()

    def simulated(*arguments, **options):
        begun.append(options["parameters"])
        first.wait(0.05)
        return Result(np.zeros(1), np.zeros((1, 1)), {"x": "1"})

    def full(*arguments):
        raise ExportError("the disk is full")

    home = inspect.getmodule(mbs.simulate.sweep)
    monkeypatch.setattr(mbs.simulate.Simulator, "__call__", simulated)
    monkeypatch.setattr(home.ResultStore, "write", full)
    with ThreadPoolExecutor(1) as executor, pytest.raises(ExportError, match="disk is full"):
        mbs.simulate.sweep(system, {"L": [0.1] * 50}, 0.1, executor=executor, **OPTIONS)
    assert len(begun) < 50


def test_any_error_of_a_case_is_kept_with_its_sentence(system, tmp_path, monkeypatch):
    def broken(*arguments, **options):
        if options["parameters"]["L"] == 0.6:
            raise ZeroDivisionError("no length")
        return Result(np.zeros(1), np.zeros((1, 1)), {"x": "1"})

    monkeypatch.setattr(mbs.simulate.Simulator, "__call__", broken)
    grid = {"L": [0.4, 0.6, 0.8]}
    study = mbs.simulate.sweep(system, grid, 0.1, folder=tmp_path / "s", **OPTIONS)
    assert study.failures == {1: "ZeroDivisionError: no length"}
    again = mbs.simulate.Sweep.open(tmp_path / "s")
    assert again.failures == study.failures
    monkeypatch.undo()
    healed = mbs.simulate.sweep(system, grid, 0.1, folder=tmp_path / "s", **OPTIONS)
    assert not healed.failures
    assert not mbs.simulate.Sweep.open(tmp_path / "s").failures
    assert healed[0].names == ("x",)  # that of before
    assert "q1.q" in healed[1]


def test_cases_are_counted_from_the_end_and_sliced(system):
    study = mbs.simulate.sweep(system, {"m": [1.0, 0.0, 3.0]}, 0.1, q0={"q1": 0.3}, **OPTIONS)
    assert np.array_equal(study[-1].values, study[2].values)
    assert not np.array_equal(study[0]["q1.tau"], study[-1]["q1.q"])
    part = study[1:]
    assert part.cases == ({"m": 0.0}, {"m": 3.0})
    assert list(part.failures) == [0]
    assert np.array_equal(part[1].values, study[2].values)
    assert np.array_equal(study[::-1][0].values, study[2].values)
    assert len(study[:0]) == 0
    assert study[np.int64(2)].name == "pendulum"
    for wrong in (3, -4, "first", 1.0):
        with pytest.raises(ModelError, match=r"there is no case .*; they are 0 to 2, or -1 for"):
            study[wrong]


def test_a_study_prints_its_cases(system):
    study = mbs.simulate.sweep(system, {"m": [1.0, 0.0], "L": [0.5]}, 0.1, **OPTIONS)
    lines = str(study).splitlines()
    assert lines[0].startswith("Sweep of pendulum: 2 cases, 1 failed, ")
    assert lines[1].split() == ["case", "m", "L"]
    assert lines[2].split() == ["0", "1", "0.5"]
    assert lines[3].split(maxsplit=3) == ["1", "0", "0.5", study.failures[1]]
    many = mbs.simulate.Sweep("arm", tuple({"m": float(k)} for k in range(30)), None, {}, ())
    assert "and 10 more" in str(replace(many, folder=study.folder))


def test_one_number_of_each_case(system):
    study = mbs.simulate.sweep(system, GRID | {"m": [2.0, 0.0]}, 0.2, **OPTIONS)
    lowest = study.summary({"lowest": lambda result: result["q1.q"].min()})
    assert list(lowest) == ["lowest"]
    assert np.array_equal(np.isnan(lowest["lowest"]), [False, True] * 6)
    assert lowest["lowest"][10] == study[10]["q1.q"].min()
    ends = study.summary()
    assert ends["q1.q.end"][4] == study[4]["q1.q"][-1]
    with pytest.raises(ModelError, match=r"measure 'x' gives no number of case 0 \(.*'nothing'"):
        study.summary({"x": lambda result: result["nothing"]})
    with pytest.raises(ModelError, match="measure 'L' has the name of what varies; rename it"):
        study.summary({"L": lambda result: 1.0})


def test_tables_of_a_study(system):
    pandas = pytest.importorskip("pandas")
    xarray = pytest.importorskip("xarray")
    study = mbs.simulate.sweep(system, GRID, 0.2, **OPTIONS)
    frame = study.to_pandas()
    assert isinstance(frame, pandas.DataFrame)
    assert frame["L"].tolist() == [0.4] * 3 + [0.6] * 3
    assert frame.loc[5, "q1.q.end"] == study[5]["q1.q"][-1]
    table = study.to_xarray({"lowest": lambda result: result["q1.q"].min()})
    assert isinstance(table, xarray.Dataset)
    found = table["lowest"].sel({"L": 0.6, "q1.q": 0.2})
    assert float(found) == study[4]["q1.q"].min()
    listed = study[1:].to_xarray({"lowest": lambda result: result["q1.q"].min()})
    assert listed["lowest"].dims == ("case",)
    assert listed["L"].values.tolist() == [0.4, 0.4, 0.6, 0.6, 0.6]


def test_without_pandas_the_message_says_what_to_install(system, monkeypatch):
    study = mbs.simulate.sweep(system, {"L": [0.4]}, 0.1, **OPTIONS)
    for name, method in (("pandas", study.to_pandas), ("xarray", study.to_xarray)):
        monkeypatch.setitem(sys.modules, name, None)
        with pytest.raises(ModelError, match=rf"{name} is not installed; .*casadi-mbs\[tables\]"):
            method()


def test_options_that_there_are_not(system, fmu):
    with pytest.raises(ModelError, match="run has no argument 'stepp'; did you mean 'step'"):
        mbs.simulate.sweep(system, GRID, 0.1, stepp=0.1)
    with pytest.raises(ModelError, match="fmu has no argument 'q0'; use one of"):
        mbs.simulate.sweep(fmu, GRID, 0.1, q0={})


def test_names_that_an_fmu_does_not_have(fmu):
    with pytest.raises(ModelError, match="pendulum has no 'mass' to vary; use one of"):
        mbs.simulate.sweep(fmu, {"mass": [1.0]}, 0.1, **OPTIONS)


def test_an_executor_that_cannot_have_the_options(fmu):
    inputs = {"q1.tau": lambda time: time}
    with ProcessPoolExecutor(1) as executor, pytest.raises(ModelError, match="cannot be sent to"):
        mbs.simulate.sweep(fmu, GRID, 0.1, inputs=inputs, executor=executor, **OPTIONS)


def test_a_process_that_ends_ends_the_study_and_what_is_written_stays(fmu, tmp_path):
    folder = tmp_path / "study"
    with ProcessPoolExecutor(1) as executor:
        executor.submit(os._exit, 1)
        with pytest.raises(SolverError, match="a process of the executor ended"):
            mbs.simulate.sweep(fmu, GRID, 0.1, folder=folder, executor=executor, **OPTIONS)
    assert not mbs.simulate.sweep(fmu, GRID, 0.1, folder=folder, **OPTIONS).failures


KILLED = """
import sys
import mbs
mbs.simulate.sweep(sys.argv[1], {"q1.q": [k / 100 for k in range(24)]}, 0.5, folder=sys.argv[2],
    step=0.1, tolerance=1e-9, quiet=True)
"""


@pytest.mark.skipif(os.name == "nt", reason="no such signal")
def test_a_killed_study_loses_nothing(fmu, tmp_path):
    folder = tmp_path / "study"
    with subprocess.Popen([sys.executable, "-c", KILLED, str(fmu), str(folder)]) as process:
        while process.poll() is None and len(list(folder.glob("case_*.npz"))) < 4:
            time.sleep(0.002)
        process.kill()
    assert process.returncode == -signal.SIGKILL
    written = {file: file.stat().st_mtime_ns for file in folder.glob("case_*.npz")}
    part = mbs.simulate.Sweep.open(folder)
    assert 4 <= len(written) < 24
    assert len(part.failures) == 24 - len(written)
    assert set(part.failures.values()) == {"not simulated yet"}
    assert len(list(part)) == len(written)  # each reads back
    grid = {"q1.q": [k / 100 for k in range(24)]}
    study = mbs.simulate.sweep(fmu, grid, 0.5, folder=folder, **OPTIONS)
    assert not study.failures
    assert {file: file.stat().st_mtime_ns for file in written} == written
    alone = mbs.simulate.sweep(fmu, grid, 0.5, **OPTIONS)
    assert all(np.array_equal(study[k].values, alone[k].values) for k in range(24))


def test_a_result_that_was_cut_off_is_made_again(system, tmp_path):
    study = mbs.simulate.sweep(system, GRID, 0.2, folder=tmp_path / "s", **OPTIONS)
    whole = study[3]
    file = study.folder.file(3)
    file.write_bytes(file.read_bytes()[:500])
    with pytest.raises(ModelError, match="is no saved result"):
        study[3]
    again = mbs.simulate.sweep(system, GRID, 0.2, folder=tmp_path / "s", **OPTIONS)
    assert np.array_equal(again[3].values, whole.values)


def test_folders_without_a_study(tmp_path):
    with pytest.raises(ModelError, match="holds no study; give the folder that a sweep was given"):
        mbs.simulate.Sweep.open(tmp_path)
    (tmp_path / "study.json").write_text("[]")
    with pytest.raises(ModelError, match="holds no study"):
        mbs.simulate.Sweep.open(tmp_path)


def test_a_cluster_simulates_an_fmu_and_gives_the_same_bits(fmu, tmp_path):
    distributed = pytest.importorskip("distributed")
    options = {"dashboard_address": None, "local_directory": str(tmp_path)}
    cluster = distributed.LocalCluster(n_workers=2, threads_per_worker=1, **options)
    with cluster, distributed.Client(cluster) as client:
        executor = client.get_executor()
        grid = {**GRID, "m": [2.0, 0.0]}
        study = mbs.simulate.sweep(fmu, grid, 0.5, executor=executor, **OPTIONS)
    alone = mbs.simulate.sweep(fmu, grid, 0.5, **OPTIONS)
    assert study.failures == alone.failures
    assert len(study.failures) == 6
    for (_, result), (_, same) in zip(study, alone, strict=True):
        assert np.array_equal(result.values, same.values)
