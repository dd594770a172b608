import dataclasses
import re
import zipfile
import zlib
from concurrent.futures import ThreadPoolExecutor

import casadi as ca
import numpy as np
import pytest

import mbs
from mbs import Result
from mbs.errors import ModelError, SolverError
from mbs.export.fmu.description import FmuModel, FmuState, FmuVariable, Jumps
from mbs.export.fmu.pack import write_fmu
from mbs.simulate import fmu

KINDS = pytest.mark.parametrize("kind", ["CoSimulation", "ModelExchange"])


def spring():
    """A mass on a spring that may tear: beyond `reach` its force is not a number."""
    t, z, x, u = ca.SX.sym("t"), ca.SX.sym("z", 0), ca.SX.sym("x", 2), ca.SX.sym("u")
    p = ca.SX.sym("p", 3)
    stiffness, mass, reach = ca.vertsplit(p)
    force = -stiffness * x[0] + 1e-30 * ca.sqrt(reach - x[0])
    return FmuModel(
        name="spring",
        states=(
            FmuState(name="s", unit="m", derivative_unit="m/s", start=1.0, output=True),
            FmuState(name="v", unit="m/s", derivative_unit="m/s2"),
        ),
        inputs=(FmuVariable(name="push", unit="N"),),
        outputs=(FmuVariable(name="force", unit="N"),),
        parameters=(
            FmuVariable(name="stiffness", unit="1", start=4.0, min=0.0),
            FmuVariable(name="mass", unit="kg", start=1.0, min=1e-9),
            FmuVariable(name="reach", unit="m", start=100.0),
        ),
        rhs=ca.Function("f", [t, x, z, u, p], [ca.vertcat(x[1], (force + u) / mass), force]),
        stop_time=2.0,
        step_size=0.05,
    )


@pytest.fixture(scope="module")
def paths(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fmu")
    return [write_fmu(spring(), folder / f"spring{fmi[0]}.fmu", fmi=fmi) for fmi in ("2.0", "3.0")]


@pytest.fixture(scope="module")
def path(paths):
    return paths[0]


@pytest.fixture(scope="module")
def balls(tmp_path_factory):
    folder = tmp_path_factory.mktemp("balls")
    versions = ("2.0", "3.0")
    return {fmi: write_fmu(ball(), folder / f"ball{fmi[0]}.fmu", fmi=fmi) for fmi in versions}


def ball():
    """A ball that bounces, and rests where it would bounce off slower than 0.05 m/s."""
    t, z, x, u = ca.SX.sym("t"), ca.SX.sym("z", 0), ca.SX.sym("x", 2), ca.SX.sym("u", 0)
    p, fired = ca.SX.sym("p", 2), ca.SX.sym("fired")
    restitution, resting = ca.vertsplit(p)
    back = -restitution * x[1]
    stays, point = back < 0.05, [t, x, z, u, p]
    after = [ca.vertcat(0, ca.if_else(stays, 0, back)), stays]
    return FmuModel(
        name="ball",
        states=(
            FmuState(name="h", unit="m", start=1.0, derivative_unit="m/s", output=True),
            FmuState(name="v", unit="m/s", derivative_unit="m/s2", output=True),
        ),
        parameters=(FmuVariable(name="restitution", start=0.5, min=0.0, max=1.0),),
        rhs=ca.Function(
            "fall", point, [ca.vertcat(x[1], ca.if_else(resting, 0, -9.81)), ca.SX(0, 1)]
        ),
        jumps=Jumps(
            modes=(FmuVariable(name="resting"),),
            first=ca.Function("first", point, [ca.SX(0.0), -x[0]]),
            indicators=ca.Function("height", point, [ca.if_else(resting, 1, x[0])]),
            jump=ca.Function("impact", [*point, fired], after),
            names=("height",),
        ),
        stop_time=2.0,
    )


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


RATE = 3.0


def swung(t):
    """The free swing with a push of sin(RATE t)."""
    share = 1 / (4 - RATE**2)
    return np.cos(2 * t) - RATE * share / 2 * np.sin(2 * t) + share * np.sin(RATE * t)


def test_an_input_is_taken_at_its_time_in_model_exchange(path):
    inputs = {"push": lambda time: np.sin(RATE * time)}
    result = fmu(path, inputs=inputs, kind="ModelExchange", tolerance=1e-10)
    assert np.max(np.abs(result["s"] - swung(result.time))) < 1e-7
    assert np.array_equal(result["push"], [inputs["push"](t) for t in result.time])


def test_in_co_simulation_shorter_steps_follow_an_input_better(paths):
    inputs = {"push": lambda time: np.sin(RATE * time)}
    for path in paths:  # FMI 2.0 follows their slopes, 3.0 holds them at their middle
        errors = [
            np.max(np.abs(r["s"] - swung(r.time)))
            for r in (fmu(path, inputs=inputs, step=step, tolerance=1e-11) for step in (0.04, 0.02))
        ]
        assert errors[0] / errors[1] == pytest.approx(4, rel=0.1)
        assert errors[1] < 1e-4


def ramp(t, start, slope):
    """The free swing with a push of start + slope t."""
    rest = (start + slope * t) / 4
    return rest + (1 - start / 4) * np.cos(2 * t) - slope / 8 * np.sin(2 * t)


@KINDS
def test_straight_lines_are_exact_whatever_the_step(path, kind):
    inputs = {"push": ([-1.0, 3.0], [0.0, 2.0])}
    for step in (2.0, 0.3):
        result = fmu(path, inputs=inputs, kind=kind, step=step, tolerance=1e-11)
        assert np.max(np.abs(result["s"] - ramp(result.time, 0.5, 0.5))) < 1e-8


def bent(t):
    """The free swing with a push of t up to 0.777, then of 2 - 2 (t - 0.777)."""
    s, v = ramp(0.777, 0, 1), (ramp(0.777 + 1e-6, 0, 1) - ramp(0.777 - 1e-6, 0, 1)) / 2e-6
    after = t - 0.777
    rest = (2 - 2 * after) / 4
    swing = rest + (s - 0.5) * np.cos(2 * after) + (v + 0.5) / 2 * np.sin(2 * after)
    return np.where(t <= 0.777, ramp(t, 0, 1), swing)


@KINDS
def test_a_table_that_jumps_between_rows(paths, kind):
    table = ([0.0, 0.777, 0.777, 2.777], [0.0, 0.777, 2.0, -2.0])
    for path, limit in zip(paths, (1e-8, 1e-8 if kind == "ModelExchange" else 2e-3), strict=True):
        result = fmu(path, inputs={"push": table}, kind=kind, step=0.1, tolerance=1e-11)
        assert np.max(np.abs(result["s"] - bent(result.time))) < limit
        assert not result.events
        assert set(np.round(np.arange(0, 2.05, 0.1), 9)) <= set(np.round(result.time, 9))
        where = result.time == 0.777
        if where.any():  # a row before and one after
            assert result["push"][where].tolist() == [0.777, 2.0]


def test_a_dense_table_is_followed_in_one_long_step(path):
    times = np.linspace(0, 2, 2001)
    result = fmu(path, inputs={"push": (times, np.sin(RATE * times))}, step=2.0, tolerance=1e-11)
    assert result.time.tolist() == [0.0, 2.0]
    assert result["s"][-1] == pytest.approx(swung(2.0), abs=1e-6)


def test_a_result_feeds_the_inputs_of_its_columns(path):
    times = np.linspace(0, 2, 501)
    recorded = Result(times, np.column_stack([np.sin(RATE * times)] * 2), {"push": "N", "x": "1"})
    told = fmu(path, inputs=recorded, kind="ModelExchange", tolerance=1e-10)
    assert np.max(np.abs(told["s"] - swung(told.time))) < 1e-5
    again = fmu(path, inputs=told, kind="ModelExchange", tolerance=1e-10)
    assert np.max(np.abs(again["s"] - told["s"])) < 2e-3  # rows of 0.05 s, straight between them
    other = Result(times, times[:, None], {"pull": "N"})
    with pytest.raises(ModelError, match="has no column of an input; the FMU has use one of push"):
        fmu(path, inputs=other)


@KINDS
@pytest.mark.parametrize("step", [0.3, 0.7, 1.0, 2.0, 5.0])
def test_steps_that_do_not_divide_the_duration(path, kind, step):
    result = fmu(path, step=step, kind=kind, tolerance=1e-10)
    expected = np.append(np.arange(0, 2 - 1e-9, step), 2.0)
    assert result.time == pytest.approx(expected, abs=1e-12)
    assert np.max(np.abs(result["s"] - np.cos(2 * result.time))) < 1e-6


def changed(path, folder, old, new):
    """The same FMU with another description."""
    with zipfile.ZipFile(path) as whole, zipfile.ZipFile(folder / "changed.fmu", "w") as other:
        for name in whole.namelist():
            content = whole.read(name)
            if name == "modelDescription.xml":
                assert old in content
                content = content.replace(old, new)
            other.writestr(name, content)
    return folder / "changed.fmu"


def test_an_fmu_with_steps_of_one_length(path, tmp_path):
    flexible = b'canHandleVariableCommunicationStepSize="true"'
    rigid = changed(path, tmp_path, flexible, b"")
    message = "steps of 0.3 s do not divide 2 s .* give step=0.285714285714"
    with pytest.raises(ModelError, match=message):
        fmu(rigid, step=0.3)
    table = ([0.0, 0.777, 2.0], [0.0, 1.0, 0.0])
    result = fmu(rigid, step=0.5, inputs={"push": table})
    assert result.time.tolist() == [0.0, 0.5, 1.0, 1.5, 2.0]


def test_versions_that_are_not_simulated(tmp_path):
    with zipfile.ZipFile(tmp_path / "old.fmu", "w") as archive:
        archive.writestr(
            "modelDescription.xml",
            '<fmiModelDescription fmiVersion="1.0" modelName="old" modelIdentifier="old" guid="1"'
            ' numberOfContinuousStates="0" numberOfEventIndicators="0"/>',
        )
    with pytest.raises(ModelError, match=r"old.fmu is of FMI 1.0; export it as FMI 2.0 or 3.0"):
        fmu(tmp_path / "old.fmu")


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
    with pytest.raises(SolverError, match=r"parameter mass is -1; give 1e-09 or more"):
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

    with ThreadPoolExecutor(4) as pool:
        answers = list(pool.map(run, [100.0, 0.5] * 4))
    assert [isinstance(answer, str) for answer in answers] == [False, True] * 4
    capfd.readouterr()


def test_inputs_that_are_not_given_keep_their_start_and_nothing_is_printed(tmp_path, capfd):
    model = spring()
    t, z, x, u, p = (ca.SX.sym(n, k) for n, k in (("t", 1), ("z", 0), ("x", 2), ("u", 2), ("p", 3)))
    pull = FmuVariable(name="pull", unit="N", start=4.0)
    rhs = ca.Function("f", [t, x, z, u, p], [ca.vertcat(x[1], ca.sum1(u) - 4 * x[0]), u[1]])
    model = dataclasses.replace(model, inputs=(*model.inputs, pull), rhs=rhs)
    two = write_fmu(model, tmp_path / "two.fmu")
    for start, force in (({}, 4.0), ({"pull": 3.0}, 3.0)):
        result = fmu(two, inputs={"push": 1.0}, start=start, quiet=True)
        assert np.array_equal(result["force"], np.full(len(result), force))
    out = capfd.readouterr()
    assert (out.out, out.err) == ("", "")


def test_the_path_is_the_one_of_now(path, tmp_path, monkeypatch):
    monkeypatch.chdir(path.parent)
    assert len(fmu("spring2.fmu", 0.1, step=0.05)) == 3


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


def packed(path, **entries):
    """A zip file with these contents, by their names."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        for name, content in entries.items():
            archive.writestr(name, content)
    return path


def packed_once(path, content, times):
    """A zip file with one content under several names, which is compressed a single time."""
    packer = zlib.compressobj(9, zlib.DEFLATED, -zlib.MAX_WBITS)
    deflated = packer.compress(content) + packer.flush()
    with zipfile.ZipFile(path, "w") as archive:
        for k in range(times):
            entry = zipfile.ZipInfo(f"resources/{k}")
            entry.compress_type, entry.CRC = zipfile.ZIP_DEFLATED, zlib.crc32(content)
            entry.file_size, entry.compress_size = len(content), len(deflated)
            entry.header_offset = archive.fp.tell()
            archive.fp.write(entry.FileHeader() + deflated)
            archive.filelist.append(entry)
        archive.start_dir, archive._didModify = archive.fp.tell(), True
    return path


def refuse(path, reason):
    """Every reader of FMUs says why, and writes nothing."""
    for read, error in (
        (lambda: fmu(path), ModelError),
        (lambda: mbs.simulate.sweep(path, {"k": [1.0, 2.0]}, duration=1.0), ModelError),
        (lambda: mbs.export.ssp(path.with_suffix(".ssp"), [path], []), mbs.errors.ExportError),
    ):
        with pytest.raises(error, match=f"is not an FMU: {reason}"):
            read()


def test_an_fmu_that_would_fill_the_disk_is_refused_before_it_is_unpacked(tmp_path, monkeypatch):
    bomb = packed_once(tmp_path / "bomb.fmu", bytes(150_000_000), times=7)
    assert bomb.stat().st_size < 1_100_000
    monkeypatch.setattr(zipfile.ZipFile, "extractall", lambda *_: pytest.fail("unpacked"))
    refuse(bomb, r"it would unpack to 1\.1 GB, 1\d\d\d times its size of 1 MB, and 100 times")


@pytest.mark.parametrize(
    ("limit", "value", "reason"),
    [
        ("MOST_ENTRIES", 2, "it has 3 entries, and 2 are the most that are unpacked; pack it"),
        ("MOST_BYTES", 2_000_000, "it would unpack to 3 MB, and 2 MB are the most; pack it again"),
        ("HARMLESS_BYTES", 1_000_000, r"it would unpack to 3 MB, \d\d\d times its size of .* MB"),
    ],
)
def test_what_is_unpacked_has_limits(limit, value, reason, tmp_path, monkeypatch):
    file = packed(tmp_path / "x.fmu", **{f"resources/{k}": bytes(1_000_000) for k in range(3)})
    with pytest.raises(ModelError, match="is not a valid FMU"):  # only that no description is there
        fmu(file)
    monkeypatch.setattr(mbs.files, limit, value)
    refuse(file, reason)


@pytest.mark.parametrize(
    "name", ["../out.txt", "a/../../out.txt", "/tmp/out.txt", "C:/out.txt", "a\\..\\..\\out.txt"]
)
def test_an_entry_that_leads_out_of_the_folder_is_refused(name, tmp_path):
    file = packed(tmp_path / "x.fmu", **{name: "out"})
    refuse(file, f"its entry {re.escape(repr(name))} leads out of the folder in which it")


FALL = np.sqrt(2 / 9.81)
IMPACTS = [FALL * (1 + 2 * sum(0.5**i for i in range(1, k + 1))) for k in range(7)]  # then it rests


@pytest.mark.parametrize(
    ("fmi", "kind", "where", "limit"),
    [
        ("2.0", "ModelExchange", ("ball", "state event"), 1e-8),
        ("3.0", "ModelExchange", ("indicator.height", "state event"), 1e-8),
        ("3.0", "CoSimulation", ("ball", "event"), 1e-9),
    ],
)
def test_events_have_their_times_and_rows_before_and_after(balls, fmi, kind, where, limit):
    result = fmu(balls[fmi], kind=kind, step=0.1, tolerance=1e-11)
    times = [time for time, *_ in result.events]
    assert times == pytest.approx(IMPACTS, abs=limit)
    assert [tuple(event[1:]) for event in result.events[:-1]] == [where] * 6
    assert result.events[-1][1:] == ("resting", "0 -> 1")
    for time in times[:-1]:
        before, after = result["v"][result.time == time]
        assert after == pytest.approx(-0.5 * before, rel=1e-6)
    assert result["h"][-1] == 0.0
    assert result["v"][-1] == 0.0
    assert np.all(result["h"] > -1e-8)


def test_events_of_an_fmu_2_in_co_simulation_are_changes_over_a_step(balls):
    result = fmu(balls["2.0"], step=0.1)
    assert [tuple(event[1:]) for event in result.events] == [("resting", "0 -> 1")]
    assert result.events[0][0] - 0.1 < IMPACTS[-1] <= result.events[0][0]
    assert result["h"][-1] == 0.0


def test_a_parameter_moves_the_events(balls):
    for kind, fmi in (("ModelExchange", "2.0"), ("CoSimulation", "3.0")):
        result = fmu(balls[fmi], 1.0, parameters={"restitution": 0.0}, kind=kind, step=0.1)
        assert [tuple(event[1:]) for event in result.events] == [("resting", "0 -> 1")]
        assert result.events[0][0] == pytest.approx(FALL, abs=1e-6)


def test_modes_are_no_start_values(balls):
    with pytest.raises(ModelError, match="start: variable 'resting' cannot be set here; use one"):
        fmu(balls["2.0"], start={"resting": 1.0})


def test_rows_at_the_steps_of_the_solver_inside(paths, tmp_path):
    told = paths[1]
    with zipfile.ZipFile(told) as archive:
        marked = b"intermediateUpdate" in archive.read("modelDescription.xml")
    if not marked:
        told = changed(
            told, tmp_path, b'causality="output"', b'causality="output" intermediateUpdate="true"'
        )
    result = fmu(told, rows="solver", step=1.0, tolerance=1e-9)
    assert len(result) > 10
    assert {0.0, 1.0, 2.0} <= set(result.time)
    assert np.max(np.abs(result["s"] - np.cos(2 * result.time))) < 1e-6
    for path, kind in ((paths[0], "CoSimulation"), (paths[1], "ModelExchange")):
        with pytest.raises(ModelError, match="the FMU does not tell the steps of its solver"):
            fmu(path, rows="solver", kind=kind)


@KINDS
def test_what_an_input_says_in_the_middle_of_a_run_is_not_lost(paths, kind):
    def broken(time):
        if time > 0.5:
            raise ValueError("no more numbers")
        return 0.0

    for path in paths:
        with pytest.raises(ModelError, match=r"input push: no number at time .*no more numbers"):
            fmu(path, inputs={"push": broken}, kind=kind)
