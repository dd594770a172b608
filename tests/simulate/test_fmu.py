import dataclasses
import sys
from concurrent.futures import ThreadPoolExecutor

import casadi as ca
import numpy as np
import pytest

import mbs
from mbs.errors import ModelError, SolverError
from mbs.simulate.fmu import fmu
from mbs.solvers import integrate

KINDS = pytest.mark.parametrize("kind", ["CoSimulation", "ModelExchange"])


def spring():
    """A mass on a spring that may tear: beyond `reach` its force is not a number."""
    description = pytest.importorskip("mbs.export.fmu.description")
    State, Variable = description.State, description.Variable
    t, z, x, u = ca.SX.sym("t"), ca.SX.sym("z", 0), ca.SX.sym("x", 2), ca.SX.sym("u")
    p = ca.SX.sym("p", 3)
    stiffness, mass, reach = ca.vertsplit(p)
    force = -stiffness * x[0] + 1e-30 * ca.sqrt(reach - x[0])
    return description.FmuModel(
        name="spring",
        states=(
            State(name="s", unit="m", derivative_unit="m/s", start=1.0, output=True),
            State(name="v", unit="m/s", derivative_unit="m/s2"),
        ),
        inputs=(Variable(name="push", unit="N"),),
        outputs=(Variable(name="force", unit="N"),),
        parameters=(
            Variable(name="stiffness", unit="1", start=4.0, min=0.0),
            Variable(name="mass", unit="kg", start=1.0, min=1e-9),
            Variable(name="reach", unit="m", start=100.0),
        ),
        rhs=ca.Function("f", [t, x, z, u, p], [ca.vertcat(x[1], (force + u) / mass), force]),
        stop_time=2.0,
        step_size=0.05,
    )


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    pack = pytest.importorskip("mbs.export.fmu.pack")
    return pack.write_fmu(spring(), tmp_path_factory.mktemp("fmu") / "spring.fmu")


@KINDS
def test_a_free_swing(path, kind):
    result = fmu(path, kind=kind, tolerance=1e-10)
    assert result.name == "spring"
    assert dict(result.units) == {"s": "m", "v": "m/s", "push": "N", "force": "N"}
    assert result.time[-1] == pytest.approx(2.0)
    assert np.max(np.abs(result["s"] - np.cos(2 * result.time))) < 1e-5
    assert result["force"] == pytest.approx(-4 * result["s"])


def test_duration_step_start_and_parameters(path):
    result = fmu(path, 0.5, step=0.1, start={"s": 2.0}, parameters={"mass": 4.0}, record=["s"])
    assert np.allclose(result.time, [0, 0.1, 0.2, 0.3, 0.4, 0.5])
    assert result.names == ("s",)
    assert np.max(np.abs(result["s"] - 2 * np.cos(result.time))) < 1e-7


@KINDS
@pytest.mark.parametrize(
    "push",
    [4.0, lambda _: 4.0, ([0.0, 2.0], [4.0, 4.0])],
    ids=["number", "function", "points"],
)
def test_a_constant_input_shifts_the_rest(path, kind, push):
    result = fmu(path, inputs={"push": push}, start={"s": 1.0}, kind=kind, tolerance=1e-9)
    assert np.max(np.abs(result["s"] - 1.0)) < 1e-6


def test_an_input_that_varies(path):
    t, x = ca.SX.sym("t"), ca.SX.sym("x", 2)
    f = ca.Function("f", [t, x], [ca.vertcat(x[1], -4 * x[0] + ca.sin(t))])
    exact = integrate(f, [1, 0], [0, 2])[-1, 0]
    inputs = {"push": lambda time: np.sin(time)}
    me = fmu(path, inputs=inputs, kind="ModelExchange", step=0.01)
    assert me["s"][-1] == pytest.approx(exact, abs=1e-3)
    cs = fmu(path, inputs=inputs, step=0.001)
    assert cs["s"][-1] == pytest.approx(exact, abs=1e-3)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"start": {"ss": 1.0}}, "start: variable 'ss' does not exist here; did you mean 's'"),
        (
            {"start": {"force": 1.0}},
            "start: variable 'force' cannot be set here; use one of push, s, v",
        ),
        ({"start": {"mass": 1.0}}, "start: variable 'mass' cannot be set here"),
        ({"parameters": {"stifness": 1.0}}, "did you mean 'stiffness'?"),
        ({"parameters": {"s": 1.0}}, "parameters: variable 's' cannot be set here"),
        ({"parameters": {"mass": float("nan")}}, "mass = nan: use a finite number"),
        ({"inputs": {"pusch": 1.0}}, "inputs: variable 'pusch' does not exist here"),
        ({"inputs": {"push": ([0, 1], [0])}}, "as many values as increasing times"),
        ({"inputs": {"push": float("inf")}}, "push = inf: use a finite number"),
        ({"inputs": {"push": lambda t: np.inf}}, "input push has a value that is not finite"),
        ({"record": ["nothing"]}, "record: variable 'nothing' does not exist here"),
        ({"kind": "CS"}, "kind is 'CS'; use CoSimulation or ModelExchange"),
        ({"duration": -1.0}, r"duration \[s\] is -1.0; give a finite positive number"),
        ({"duration": "2"}, r"duration \[s\] is '2'; give a finite positive number"),
        ({"step": 0.0}, r"step \[s\] is 0.0; give a finite positive number"),
        ({"step": 1e-12}, "more than 10000000 rows; give a longer step"),
        ({"tolerance": None}, "tolerance is None; give"),
        ({"solver": "Ode"}, "solver is 'Ode'; use CVode or Euler"),
        ({"record": "s"}, "record is 's'; give a list of names"),
        ({"record": 3}, "record is 3; give a list of names"),
        ({"start": {"s": "x"}}, "s = 'x': use a finite number"),
        ({"start": ["s"]}, r"start is \['s'\]; give a dict of names to values"),
        ({"inputs": 3.0}, "inputs is 3.0; give a dict of names to values"),
        ({"inputs": {"push": "strong"}}, "input push = 'strong': use a finite number"),
        ({"inputs": {"push": (1, 2, 3)}}, r"input push is \(1, 2, 3\); give a number, a function"),
        ({"inputs": {"push": lambda t: None}}, "input push: no number at time 0 s"),
        ({"inputs": {"push": lambda: 1.0}}, "give a function of time that returns one"),
    ],
)
def test_what_does_not_fit_is_refused(path, arguments, message):
    with pytest.raises(ModelError, match=message):
        fmu(path, **arguments)


@KINDS
def test_what_the_fmu_says_is_passed_on(path, kind):
    with pytest.raises(SolverError, match=r"parameter mass = -1 is outside 1e-09 to inf"):
        fmu(path, parameters={"mass": -1.0}, kind=kind)


@KINDS
def test_a_failure_on_the_way_is_not_lost(path, kind, capfd):
    options = {"start": {"s": -1.0}, "parameters": {"reach": 0.5}, "kind": kind}
    with pytest.raises(SolverError, match=r"FMU spring stopped: .*not finite"):
        fmu(path, **options)
    capfd.readouterr()


def test_runs_in_threads_keep_their_errors_apart(path, capfd):
    def run(reach):
        try:
            return fmu(path, parameters={"reach": reach}, kind="ModelExchange", start={"s": -1.0})
        except SolverError as error:
            return str(error)

    before = sys.unraisablehook
    with ThreadPoolExecutor(4) as pool:
        answers = list(pool.map(run, [100.0, 0.5] * 4))
    assert [isinstance(answer, str) for answer in answers] == [False, True] * 4
    assert sys.unraisablehook is before
    capfd.readouterr()


def test_inputs_that_are_not_given_keep_their_start_and_nothing_is_printed(tmp_path, capfd):
    description = pytest.importorskip("mbs.export.fmu.description")
    pack = pytest.importorskip("mbs.export.fmu.pack")
    model = spring()
    t, z, x, u, p = (ca.SX.sym(n, k) for n, k in (("t", 1), ("z", 0), ("x", 2), ("u", 2), ("p", 3)))
    pull = description.Variable(name="pull", unit="N", start=4.0)
    rhs = ca.Function("f", [t, x, z, u, p], [ca.vertcat(x[1], ca.sum1(u) - 4 * x[0]), u[1]])
    model = dataclasses.replace(model, inputs=(*model.inputs, pull), rhs=rhs)
    two = pack.write_fmu(model, tmp_path / "two.fmu")
    for start, force in (({}, 4.0), ({"pull": 3.0}, 3.0)):
        result = fmu(two, inputs={"push": 1.0}, start=start, quiet=True)
        assert np.array_equal(result["force"], np.full(len(result), force))
    out = capfd.readouterr()
    assert (out.out, out.err) == ("", "")


def test_the_path_is_the_one_of_now(path, tmp_path, monkeypatch):
    monkeypatch.chdir(path.parent)
    assert len(fmu("spring.fmu", 0.1, step=0.05)) == 3


@pytest.mark.parametrize("wrong", [None, 3, mbs.Mechanism("m")])
def test_what_is_no_path(wrong):
    with pytest.raises(ModelError, match="is not the path of an FMU; write one"):
        fmu(wrong)


def test_files_that_are_no_fmu(tmp_path):
    with pytest.raises(ModelError, match="is not a file"):
        fmu(tmp_path / "none.fmu")
    bad = tmp_path / "bad.fmu"
    bad.write_text("nothing")
    with pytest.raises(ModelError, match="is not an FMU"):
        fmu(bad)
