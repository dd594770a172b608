"""Sources beside formulas in plain numbers, in run and in FMUs."""

import pickle

import fmpy
import numpy as np
import pytest

import mbs
from mbs.components import (
    ExpSine,
    KinematicPTP,
    Pulse,
    Ramp,
    ReferenceFilter,
    ShaftInertia,
    Sine,
    Step,
    Table,
    TorqueSource,
    Trapezoid,
)
from mbs.errors import DescriptionError, ModelError


def driven(*sources, torque=None, symbols=()):
    """A shaft of 1 kg m^2 beside sources, turned by one of their outputs."""
    m = mbs.Mechanism("shaft")
    shaft, drive = ShaftInertia("i", 1.0), TorqueSource("drive")
    m.connect(drive.flange, shaft.flange_a)
    for source in sources:
        m.add(source)
    if torque is not None:
        m.connect_signal(torque, drive.tau)
    for symbol in symbols:
        m.values[symbol.name] = symbol
    return m.assemble()


def run(system, duration=4.0, step=0.0375, **more):
    return mbs.simulate.run(system, duration, step=step, quiet=True, **more)


def pulse(t, period, duty, start):
    return np.where((t >= start) & (np.mod(t - start, period) < duty * period), 1.0, 0.0)


def trapezoid(t, period, rising, width, falling, start):
    s = np.where(t >= start, np.mod(t - start, period), period)
    knots = [0, rising, rising + width, rising + width + falling, period]
    return np.interp(s, knots, [0, 1, 1, 0, 0])


def after(t, start, value):
    return np.where(t >= start, value, 0.0)


def damped(s):
    return 2 * np.sin(2 * np.pi * 1.5 * s + 0.3) * np.exp(-0.8 * s)


CASES = {
    "step": (Step("s", 2.0, 1.01, -1.0), lambda t: -1 + after(t, 1.01, 2.0)),
    "ramp": (
        Ramp("s", 3.0, 0.7, 1.01, 0.5),
        lambda t: 0.5 + 3 * np.clip((t - 1.01) / 0.7, 0, 1),
    ),
    "sine": (
        Sine("s", 2.0, 1.5, 0.3, 0.51, 0.1),
        lambda t: 0.1 + after(t, 0.51, 2 * np.sin(2 * np.pi * 1.5 * (t - 0.51) + 0.3)),
    ),
    "damped sine": (
        ExpSine("s", 2.0, 1.5, 0.3, 0.51, 0.1, 0.8),
        lambda t: 0.1 + after(t, 0.51, damped(t - 0.51)),
    ),
    "pulse": (Pulse("s", 0.5, 2.0, 0.2, 0.3), lambda t: 2 * pulse(t, 0.5, 0.2, 0.3)),
    "pulse that began before": (
        Pulse("s", 0.5, 2.0, 0.2, -0.33, 1.0),
        lambda t: 1 + 2 * pulse(t, 0.5, 0.2, -0.33),
    ),
    "three pulses": (
        Pulse("s", 0.5, 2.0, 0.2, 0.3, count=3),
        lambda t: 2 * pulse(t, 0.5, 0.2, 0.3) * (t < 1.8),
    ),
    "trapezoid": (
        Trapezoid("s", 1.1, 0.2, 2.0, 0.3, 0.15, 0.05),
        lambda t: 2 * trapezoid(t, 1.1, 0.3, 0.2, 0.15, 0.05),
    ),
    "rectangle": (
        Trapezoid("s", 1.1, 0.2, 2.0),
        lambda t: 2 * pulse(t, 1.1, 0.2 / 1.1, 0.0),
    ),
    "table": (
        Table("s", [0.5, 1.0, 1.0, 2.0], [1.0, 2.0, 5.0, 4.0]),
        lambda t: np.where(t < 1, np.interp(t, [0.5, 1], [1, 2]), np.interp(t, [1, 2], [5, 4])),
    ),
    "held table": (
        Table("s", [0.5, 1.0, 2.0], [1.0, 2.0, 5.0], "hold"),
        lambda t: np.array([1.0, 2.0, 5.0])[
            np.clip(np.searchsorted([0.5, 1, 2], t, "right") - 1, 0, 2)
        ],
    ),
    "table with slopes": (
        Table("s", [0.5, 1.0, 2.0], [1.0, 2.0, 5.0], extrapolation="linear"),
        lambda t: np.where(t < 1, 1 + 2 * (t - 0.5), 2 + 3 * (t - 1)),
    ),
    "periodic table": (
        Table("s", [0.5, 1.0, 1.7], [1.0, 2.0, 5.0], extrapolation="periodic"),
        lambda t: np.interp(np.mod(t - 0.5, 1.2) + 0.5, [0.5, 1.0, 1.7], [1.0, 2.0, 5.0]),
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_a_source_has_the_values_of_its_formula(case):
    source, formula = CASES[case]
    result = run(driven(source))
    assert np.abs(result["s.y"] - formula(result.time)).max() < 1e-9


@pytest.mark.parametrize("method", ["dopri5", "rodas"])
@pytest.mark.parametrize("tolerance", [1e-4, 1e-8])
@pytest.mark.parametrize("case", CASES)
def test_no_part_of_a_source_is_skipped(case, tolerance, method):
    source, formula = CASES[case]
    result = run(driven(source, torque="s.y"), 4.0, 1.0, tolerance=tolerance, method=method)
    t = np.linspace(0, 4, 400_001)
    impulse = np.mean(formula((t[1:] + t[:-1]) / 2)) * 4
    # the sum by midpoints errs by half an interval of 1e-5 s at each of up to 16 jumps of up to 3
    assert abs(result["i.v"][-1] - impulse) < 3e-4 + 10 * tolerance


def test_akima_and_monotone_tables_are_those_of_scipy():
    interpolate = pytest.importorskip("scipy.interpolate")
    t, y = [0.0, 0.5, 0.9, 1.7, 2.2, 4.0], [0.0, 1.0, 0.5, 0.6, 3.0, 2.0]
    kinds = {"akima": interpolate.Akima1DInterpolator, "monotone": interpolate.PchipInterpolator}
    for name, kind in kinds.items():
        result = run(driven(Table("s", t, y, name)))
        assert np.abs(result["s.y"] - kind(t, y)(result.time)).max() < 1e-9


def test_the_cost_of_a_table_does_not_depend_on_its_length():
    t = np.linspace(0, 20, 1001)
    system = driven(Table("s", t, np.sin(t)), torque="s.y")
    result = run(system, 20.0, 0.5, tolerance=1e-6)
    assert abs(result["i.v"][-1] - (1 - np.cos(20))) < 1e-4


@pytest.mark.parametrize(("begin", "end"), [(0.2, 1.4), (1.4, 0.2), (0.0, 0.01), (1.0, 1.0)])
@pytest.mark.parametrize("duration", [None, 2.5])
def test_a_point_to_point_motion_respects_its_limits(begin, end, duration):
    source = KinematicPTP("s", begin, end, 0.9, 2.0, 0.3, duration)
    result = run(driven(source, torque="s.a"), 4.0, 0.013)
    y, v, a = (result[f"s.{name}"] for name in ("y", "v", "a"))
    distance, sign = abs(end - begin), np.sign(end - begin)
    shortest = source.shortest_duration
    peak = min(0.9, np.sqrt(distance * 2.0))
    expected = distance / 0.9 + 0.9 / 2.0 if peak == 0.9 else 2 * np.sqrt(distance / 2.0)
    assert abs(shortest - expected) < 1e-12
    total = duration or shortest
    assert np.abs(v).max() <= 0.9 * (1 + 1e-12)
    assert np.abs(a).max() <= 2.0 * (1 + 1e-12)
    t = result.time
    assert np.abs(y[t <= 0.3] - begin).max() < 1e-12
    assert np.abs(y[t >= 0.3 + total + 1e-9] - end).max() < 1e-12
    if distance:
        middle = np.abs(y - (begin + end) / 2).argmin()
        assert abs(t[middle] - 0.3 - total / 2) < 0.013
        slowed = total / shortest
        assert abs(np.abs(v).max() - peak / slowed) < 2.0 * 0.013
        assert np.all(sign * v >= -1e-12)
    # the velocity is the integral of the acceleration, and the position that of the velocity
    assert np.abs(result["i.v"] - v).max() < 1e-8
    assert np.abs(result["i.q"] - (y - begin)).max() < 1e-7


def test_axes_with_one_duration_arrive_together():
    slow = KinematicPTP("slow", 0, 2.0, 0.5, 1.0)
    fast = KinematicPTP("fast", 0, 0.3, 0.5, 1.0, duration=slow.shortest_duration)
    result = run(driven(slow, fast), 5.0, 0.01)
    ends = [result.time[np.flatnonzero(result[f"{n}.v"])[-1]] for n in ("slow", "fast")]
    assert abs(ends[0] - ends[1]) < 0.011


def test_numbers_of_sources_may_be_symbols():
    symbols = [mbs.Parameter("P", 0.5, unit="s"), mbs.Parameter("S", 0.3, unit="s")]
    system = driven(Pulse("s", "P", 2.0, 0.2, "S"), torque="s.y", symbols=symbols)
    result = run(system, parameters={"P": 0.8, "S": -0.1})
    assert np.abs(result["s.y"] - 2 * pulse(result.time, 0.8, 0.2, -0.1)).max() < 1e-9


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
@pytest.mark.parametrize("kind", ["CoSimulation", "ModelExchange"])
def test_fmus_have_the_sources(tmp_path, fmi, kind):
    sources = (
        Pulse("s", 0.5, 2.0, 0.2, 0.3),
        Table("tab", [0.5, 1.0, 1.0, 2.0], [1.0, 2.0, 5.0, 4.0]),
        Step("st", 2.0, 1.01),
    )
    system = driven(*sources, torque="s.y")
    path = mbs.export.fmu(system, tmp_path / "shaft.fmu", fmi=fmi)
    # importers report rows at equal times before and after an event
    names = ["s.y", "tab.y", "st.y", "i.v"]
    found = fmpy.simulate_fmu(
        str(path),
        stop_time=4.0,
        output_interval=0.037,
        output=names,
        fmi_type=kind,
        relative_tolerance=1e-8,
    )
    expected = run(system, 4.0, 0.001)
    t = found["time"]
    edges = [0.3 + 0.5 * k + d for k in range(8) for d in (0, 0.1)] + [0.5, 1.0, 1.01, 2.0]
    away = np.min(np.abs(t[:, None] - edges), axis=1) > 2e-3
    for name in names:
        there = np.interp(t[away], expected.time, expected[name])
        # between the rows of the run, 1 ms apart, the values are straight lines
        assert np.abs(found[name][away] - there).max() < 1e-5, name


def test_a_table_comes_from_a_file(tmp_path):
    path = tmp_path / "load.csv"
    path.write_text("# measured\ntime;torque;speed\n0;1;2\n\n1;3;4\n2.5;-1;5\n")
    table = Table.from_csv("s", path, time="time", value="speed")
    assert (table.times, table.values) == ((0, 1, 2.5), (2, 4, 5))
    path.write_text("0,1\n1,3\n")
    assert Table.from_csv("s", path).values == (1, 3)
    assert Table.from_csv("s", path, smoothness="hold").smoothness == "hold"


@pytest.mark.parametrize(
    ("text", "arguments", "words"),
    [
        ("t,y\n0,1\n1,x\n", {}, ["line 3", "'x'"]),
        ("t,y\n0,1\n1\n", {}, ["line 3"]),
        ("t,y\n0,1\n1,2\n", {"value": "z"}, ["'z'", "t", "y"]),
        ("0,1\n1,2\n", {"value": "y"}, ["no names"]),
        ("0,1\n1,2\n", {"value": 2}, ["0 to 1"]),
        ("", {}, ["no rows"]),
        ("t,y\n0,1\n", {}, ["at least two"]),
        ("t,y\n1,1\n0,1\n", {}, ["increasing"]),
    ],
)
def test_files_that_are_no_tables_are_refused(tmp_path, text, arguments, words):
    path = tmp_path / "load.csv"
    path.write_text(text)
    with pytest.raises(DescriptionError) as caught:
        Table.from_csv("s", path, **arguments)
    assert all(word in str(caught.value) for word in ["s: ", *words])


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Pulse("s", 0.0), ["s: period is 0 s"]),
        (lambda: Pulse("s", 1.0, duty=1.5), ["s: duty is 1.5"]),
        (lambda: Pulse("s", 1.0, count=1.5), ["s: count is 1.5"]),
        (lambda: Pulse("s", 1.0, count=-1), ["s: count is -1"]),
        (lambda: Trapezoid("s", 1.0, 0.5, 1.0, 0.4, 0.2), ["1.1 s together", "is 1 s"]),
        (lambda: Ramp("s", 1.0, 0.0), ["s: duration is 0 s"]),
        (lambda: KinematicPTP("s", 0, 1, 0, 1), ["s: v_max is 0"]),
        (lambda: KinematicPTP("s", 0, 1, 1, 1, 0.0, 1.5), ["duration is 1.5 s", "2 s"]),
        (lambda: Table("s", [0, 1], [1]), ["2 times and 1 values"]),
        (lambda: Table("s", [0, 0], [1, 2]), ["all times are 0 s"]),
        (lambda: Table("s", [0, 1], [1, np.nan]), ["values", "finite"]),
        (lambda: Table("s", [0, 1], [1, 2], "spline"), ["smoothness is 'spline'"]),
        (lambda: Table("s", [0, 1], [1, 2], extrapolation="no"), ["extrapolation is 'no'"]),
        (lambda: Table("s", [0, 1, 1, 2], [1, 2, 3, 4], "akima"), ["jump"]),
        (lambda: ReferenceFilter("s", 0.0), ["s: frequency is 0"]),
    ],
)
def test_what_a_source_cannot_be_made_with_is_refused(make, words):
    with pytest.raises(DescriptionError) as caught:
        make()
    assert all(word in str(caught.value) for word in words)


def filtered():
    """A shaft of 2 kg m^2 beside a filter of a pulse."""
    pulse, smooth = Pulse("s", 1.5, 1.0, 0.5), ReferenceFilter("f", 3.0)
    m = mbs.Mechanism("shaft")
    shaft, drive = ShaftInertia("i", 2.0), TorqueSource("drive")
    m.connect(drive.flange, shaft.flange_a)
    m.add(pulse)
    m.add(smooth)
    m.connect_signal(pulse.y, smooth.u)
    return m.assemble(), smooth


def test_a_signal_prescribes_a_position_with_its_rates():
    system, smooth = filtered()
    for law in ("f.q", smooth.q):
        result = run(system, motion={"i.q": law})
        for joint, signal in (("i.q", "f.q"), ("i.v", "f.v"), ("i.a", "f.a")):
            assert np.array_equal(result[joint], result[signal])
        np.testing.assert_allclose(result["i.tau"], 2 * result["f.a"], rtol=0, atol=1e-12)
        assert 1.0 < result["i.q"].max() < 1.01  # overshoot of a Bessel filter of order 2


def test_a_signal_prescribes_a_velocity_or_an_acceleration():
    system, _ = filtered()
    for kind in "va":
        result = run(system, motion={f"i.{kind}": "f.q"})
        assert np.array_equal(result[f"i.{kind}"], result["f.q"])


def test_a_motion_along_a_signal_starts_where_its_states_start():
    system, _ = filtered()
    simulator = mbs.simulate.Simulator(system, motion={"i.q": "f.q"})
    again = pickle.loads(pickle.dumps(simulator))
    first, second = (one(1.0, z0={"f.x": 0.3}) for one in (simulator, again))
    assert first["i.q"][0] == 0.3
    assert np.array_equal(first["i.q"], second["i.q"])


def test_a_source_drives_the_crank_of_a_closed_mechanism():
    four_bar = mbs.load("four_bar")
    start = float(run(four_bar.assemble(), 0.01, step=0.01)["j1.q"][0])
    source = KinematicPTP("go", start, start + 0.4, 1.0, 4.0)
    four_bar.add(source)
    result = run(four_bar.assemble(), 1.0, step=0.05, motion={"j1.q": source.y})
    s = result.time  # speeds up for 0.25 s, moves at 1 rad/s, slows down from 0.4 s on
    moved = np.where(s < 0.25, 2 * s**2, s - 0.125)
    moved = np.where(s > 0.4, 0.4 - 2 * np.maximum(0.65 - s, 0) ** 2, moved)
    np.testing.assert_allclose(result["j1.q"], start + moved, rtol=0, atol=1e-9)
    assert np.abs(result["closure_residual"]).max() < 1e-9


@pytest.mark.parametrize(
    ("law", "words"),
    [
        ("f.zz", ["the motion of i.q is 'f.zz'", "f.q"]),
        ("i.q", ["an output or a state of a component"]),
        ("drive.w", ["follows from i.v", "states of components"]),
    ],
)
def test_signals_that_cannot_prescribe_are_refused(law, words):
    smooth = ReferenceFilter("f", 3.0)
    system = driven(smooth)
    with pytest.raises(ModelError) as caught:
        run(system, motion={"i.q": law})
    assert all(word in str(caught.value) for word in words)
