"""Motions that stop, by an error or by control-C, hand over what they have."""

import contextlib
import os
import pickle
import signal
import threading
import time

import casadi
import numpy as np
import pytest
from support.bennett import bennett

import mbs
from mbs import Result
from mbs.components import CoulombFriction, PointMass, Prismatic, RigidStop
from mbs.errors import Interrupted, ModelError, SolverError
from mbs.solvers import integrate_events
from mbs.solvers.control_c import control_c

END = 0.55
QUIET = {"quiet": True, "tolerance": 1e-9}


def until(end):
    """Efforts that have no value after some time."""
    return lambda t, _q, _v: 0.1 * casadi.sqrt(end - t)


def cart(*elements):
    m = mbs.Mechanism("cart", gravity=(0, -9.81, 0))
    body = m.add(PointMass("body", mass=2.0))
    m.connect(m.world, Prismatic("x", axis="x", actuated=True), body)
    for element in elements:
        m.add(element)
    return m.assemble()


def stopped(system, duration=1.0, **options):
    with pytest.raises(SolverError) as caught:
        mbs.simulate.run(system, duration, tau=until(END), **QUIET, **options)
    return caught.value


@pytest.fixture(autouse=True)
def control_c_is_heard():
    """Shells start jobs in the background with signals of control-C ignored."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture(scope="module")
def system():
    return cart()


def test_an_error_hands_over_the_rows_before_it(system):
    error = stopped(system, step=0.1, v0={"x": 1.0})
    part = error.result
    whole = mbs.simulate.run(system, 0.5, tau=until(END), step=0.1, v0={"x": 1.0}, **QUIET)
    assert whole.stopped is None
    np.testing.assert_allclose(part.time, np.arange(6) / 10)
    assert part.names == whole.names
    np.testing.assert_allclose(part.values, whole.values, atol=1e-7)
    when, sentence = part.stopped
    assert when == error.time == pytest.approx(END, abs=1e-6)
    assert sentence == str(error)
    assert error.state[1] == pytest.approx(whole["x.v"][-1], abs=0.01)
    assert part.system is system


def test_without_a_compiler_too(system, monkeypatch):
    monkeypatch.setitem(integrate_events.__globals__, "compiler_found", lambda: False)
    part = stopped(system, step=0.1).result
    assert len(part) == 6
    assert part.stopped[0] == pytest.approx(END, abs=1e-6)


def test_what_is_done_with_a_result_is_done_with_a_part_of_one(system, tmp_path):
    part = stopped(system, step=0.1, v0={"x": 1.0}).result
    assert "stopped at 0.55 s" in repr(part)
    part.save(tmp_path / "part.npz")
    part.to_csv(tmp_path / "part.csv")
    for same in (Result.load(tmp_path / "part.npz"), pickle.loads(pickle.dumps(part))):
        assert same.stopped == part.stopped
        np.testing.assert_array_equal(same.values, part.values)
    assert len((tmp_path / "part.csv").read_text().splitlines()) == 7
    assert part.at(0.45)["x.q"] == pytest.approx(0.45, abs=0.02)
    pytest.importorskip("matplotlib")
    part.plot(path=tmp_path / "part.png")
    mbs.view.animate(part, system, tmp_path / "part.html")
    assert (tmp_path / "part.html").stat().st_size > 1000


def test_tables_of_a_part_tell_the_stop(system):
    pytest.importorskip("pandas")
    part = stopped(system, step=0.1).result
    assert part.to_pandas().attrs["stopped"] == part.stopped
    assert part.to_xarray().attrs["stopped"] == part.stopped[1]


def test_a_stop_before_the_first_row(system):
    with pytest.raises(SolverError) as caught:
        mbs.simulate.run(system, 1.0, tau=until(-1.0), **QUIET)
    part = caught.value.result
    assert part.stopped[0] == 0
    assert len(part) <= 1
    assert "x.q" in part


def test_events_and_modes_up_to_the_stop():
    system = cart(
        RigidStop("wall", "x", upper=0.25, restitution=0.5),
        CoulombFriction("rub", "x", sliding=0.01),
    )
    part = stopped(system, step=0.1, v0={"x": 1.0}).result
    assert {name for _, name, _ in part.events} == {"wall", "rub"}
    assert part.events[0][0] == pytest.approx(0.25, abs=0.01)
    assert len(part["wall.mode"]) == len(part) == 6
    assert part["x.v"][2] > 0 > part["x.v"][3]


def test_rows_of_all_legs_up_to_the_stop():
    system = bennett(1, 3, (0.9, 1.7))
    options = {"v0": {"j1": 6.0}, "step": 0.05, **QUIET}
    with pytest.raises(SolverError) as caught:
        mbs.simulate.run(
            system, 3.0, tau=lambda t, _q, _v: {"j1": 1e-9 * casadi.sqrt(2.02 - t)}, **options
        )
    part, whole = caught.value.result, mbs.simulate.run(system, 2.0, **options)
    assert len(part) == len(whole) == 41
    np.testing.assert_allclose(part["j1.q"], whole["j1.q"], atol=1e-5)


def pressed_after(seconds):
    """Control-C, as a terminal sends it."""
    timer = threading.Timer(seconds, lambda: os.kill(os.getpid(), signal.SIGINT))
    timer.start()
    return timer


@pytest.mark.skipif(os.name == "nt", reason="a process does not send itself control-C there")
def test_control_c_in_compiled_code_hands_over_the_motion():
    system = mbs.load("planar_2r").assemble()
    mbs.simulate.run(system, 0.1, step=0.1, **QUIET)  # compiles
    pressed_after(0.5)
    begin = time.monotonic()
    with pytest.raises(KeyboardInterrupt) as caught:
        mbs.simulate.run(system, 1e5, step=0.1, **QUIET)
    assert time.monotonic() - begin < 5
    stop = caught.value
    assert isinstance(stop, Interrupted)
    assert 1 < len(stop.result) < 1e6
    assert stop.result.stopped == (stop.time, str(stop))
    assert stop.result.time[-1] <= stop.time
    energy = stop.result["kinetic_energy"] + stop.result["potential_energy"]
    assert np.isfinite(energy).all()


@pytest.mark.parametrize("compiled", [True, False])
def test_control_c_while_progress_is_told(compiled):
    t, x = casadi.SX.sym("t"), casadi.SX.sym("x")
    rhs = casadi.Function("rhs", [t, x], [-x])

    def pressed(reached):
        if reached > 1:
            raise KeyboardInterrupt

    given = {"progress": pressed, "compiled": compiled, "max_step": 1e-3}
    times = np.linspace(0, 10, 101)
    motion = integrate_events(rhs, [1.0], times, None, partial=True, **given)
    count = len(motion.x)
    assert 10 <= count < 30
    np.testing.assert_allclose(motion.x[:, 0], np.exp(-times[:count]), atol=1e-7)
    assert motion.stop.time > 1
    with pytest.raises(Interrupted):
        integrate_events(rhs, [1.0], times, None, **given)


def test_a_failed_case_of_a_study_keeps_its_rows(system, tmp_path):
    grid = {"x.v": [0.0, 1.0]}
    study = mbs.simulate.sweep(system, grid, 1.0, tau=until(END), folder=tmp_path / "s", **QUIET)
    assert list(study.failures) == [0, 1]
    part = study.reached(1)
    assert part.stopped[1] == study.failures[1]
    assert part["x.q"][-1] == pytest.approx(END, abs=0.05)
    assert len(mbs.simulate.Sweep.open(tmp_path / "s").reached(-2)) == len(study.reached(0)) == 55
    short = mbs.simulate.sweep(system, grid, 0.3, **QUIET)
    assert short.reached(0).stopped is None
    refused = mbs.simulate.sweep(system, [{"x.v": np.nan}], 0.3, **QUIET)
    with pytest.raises(ModelError, match="case 0 reached nothing"):
        refused.reached(0)


def test_control_c_in_a_study_hands_over_the_cases(system, monkeypatch):
    run, counted = mbs.simulate.Simulator.__call__, []

    def pressed(*arguments, **options):
        counted.append(1)
        if len(counted) < 3:
            return run(*arguments, **options)
        stop = Interrupted("integration interrupted at t = 0.1 s", time=0.1)
        stop.result = run(*arguments, **{**options, "duration": 0.1})
        raise stop

    monkeypatch.setattr(mbs.simulate.Simulator, "__call__", pressed)
    with pytest.raises(KeyboardInterrupt) as caught:
        mbs.simulate.sweep(system, {"x.v": [0.0, 1.0, 2.0, 3.0]}, 0.5, **QUIET)
    study = caught.value.result
    assert len(list(study)) == 2
    assert study.failures[2] == "integration interrupted at t = 0.1 s"
    assert study.failures[3] == "not simulated yet"
    assert len(study.reached(2)) == 11


@pytest.mark.parametrize("kind", ["CoSimulation", "ModelExchange"])
def test_an_fmu_that_stops_hands_over_its_rows(system, tmp_path, kind):
    path = mbs.export.fmu(system, tmp_path / "cart.fmu", outputs=["energy"])
    effort = ([0.0, END, END, 2.0], [1.0, 1.0, 1e250, 1e250])  # whose energy is no number
    with pytest.raises(SolverError, match="not finite") as caught:
        mbs.simulate.fmu(path, inputs={"x.tau": effort}, step=0.1, kind=kind, quiet=True)
    rows_are_kept(caught.value)


@pytest.mark.parametrize("kind", ["CoSimulation", "ModelExchange"])
def test_control_c_in_the_simulation_of_an_fmu(system, tmp_path, kind):
    path = mbs.export.fmu(system, tmp_path / "cart.fmu")

    def effort(t):
        if t > END:
            raise KeyboardInterrupt
        return 1.0

    with pytest.raises(Interrupted) as caught:
        mbs.simulate.fmu(path, inputs={"x.tau": effort}, step=0.1, kind=kind, quiet=True)
    rows_are_kept(caught.value)


def rows_are_kept(stop):
    part = stop.result
    assert part.stopped == (part.time[-1], str(stop))
    np.testing.assert_allclose(part["x.q"], part.time**2 / 4, atol=1e-6)
    assert 5 <= len(part) <= 8


class Deleted:
    """Presses control-C while it is deleted, where Python drops the exception."""

    def __del__(self):
        signal.raise_signal(signal.SIGINT)


@pytest.mark.skipif(os.name == "nt", reason="a process does not send itself control-C there")
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize("compiled", [True, False])
def test_control_c_that_python_drops_is_noticed(compiled):
    t, x = casadi.SX.sym("t"), casadi.SX.sym("x")
    rhs = casadi.Function("rhs", [t, x], [-x])
    kept = [Deleted()]

    def progress(reached):
        if reached > 1:
            kept.clear()

    times = np.linspace(0, 10, 101)
    options = {"progress": progress, "compiled": compiled, "max_step": 1e-3}
    motion = integrate_events(rhs, [1.0], times, None, partial=True, **options)
    assert isinstance(motion.stop, Interrupted)
    assert len(motion.x) < 30
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def fails_under_control_c(is_pressed):
    with control_c():
        if is_pressed:
            with contextlib.suppress(KeyboardInterrupt):
                signal.raise_signal(signal.SIGINT)
        raise TypeError


@pytest.mark.parametrize("is_pressed", [False, True])
def test_errors_after_control_c_are_interrupts(is_pressed):
    """A call of CasADi that is interrupted may return None, and what reads it fails."""
    with pytest.raises(KeyboardInterrupt if is_pressed else TypeError) as caught:
        fails_under_control_c(is_pressed)
    assert isinstance(caught.value.__cause__, TypeError) == is_pressed
