"""The rules of events: order, rows, settling, what is refused."""

import casadi as ca
import numpy as np
import pytest
from support.counted import counted

from mbs.errors import ModelError, SolverError
from mbs.solvers import Events, integrate, integrate_events
from mbs.solvers.problem import equations

T, X = ca.SX.sym("t"), ca.SX.sym("x", 2)
BOTH = pytest.mark.parametrize("compiled", [True, False], ids=["compiled", "interpreted"])
METHODS = pytest.mark.parametrize("method", ["dopri5", "rodas"])
TIGHT = {"rtol": 1e-10, "atol": 1e-10}


def clock(*indicators, jump=None, modes=(0.0,)):
    """x = (t, number of events), m = the number of events too."""
    p, fired = ca.SX.sym("p", len(modes)), ca.SX.sym("fired", len(indicators))
    rhs = ca.Function("f", [T, X, p], [ca.vertcat(1, 0)])
    g = ca.Function("g", [T, X, p], [ca.vertcat(*indicators)])
    after = jump or (lambda x, p, fired: [ca.vertcat(x[0], x[1] + 1), p + 1])
    return rhs, Events(g, ca.Function("j", [T, X, p, fired], after(X, p, fired)), modes)


@BOTH
def test_several_events_in_one_step_come_in_order(compiled):
    marks = [0.71, 0.7, 0.3, 0.3, 0.7000001]
    done = ca.SX.sym("p", 5)
    fired = ca.SX.sym("fired", 5)
    g = ca.vertcat(*[ca.if_else(done[k], 1, mark - X[0]) for k, mark in enumerate(marks)])
    events = Events(
        ca.Function("g", [T, X, done], [g]),
        ca.Function("j", [T, X, done, fired], [X, ca.fmax(done, fired)]),
        np.zeros(5),
    )
    rhs = ca.Function("f", [T, X, done], [ca.vertcat(1, 0)])
    motion = integrate_events(rhs, [0, 0], [0, 10], events, compiled=compiled)
    assert [event.fired for event in motion.events] == [(2, 3), (1,), (4,), (0,)]
    assert np.allclose([e.time for e in motion.events], [0.3, 0.7, 0.7000001, 0.71], atol=1e-15)


@BOTH
def test_a_row_at_the_time_of_an_event_is_after_it(compiled):
    p = ca.SX.sym("p")
    _, events = clock(0.5 - T)
    rhs = ca.Function("f", [T, X, p], [ca.vertcat(1 + p, 0)])
    once = ca.Function("g", [T, X, p], [ca.if_else(p > 0, 1, 0.5 - T)])
    times = [0, 0.25, 0.5, 0.5, 0.75, 1]
    motion = integrate_events(
        rhs, [0, 0], times, Events(once, events.jump, [0.0]), compiled=compiled
    )
    assert motion.events[0].time == 0.5
    assert np.array_equal(motion.x[:, 1], [0, 0, 1, 1, 1, 1])
    assert np.array_equal(motion.modes[:, 0], [0, 0, 1, 1, 1, 1])
    assert np.allclose(motion.x[:, 0], [0, 0.25, 0.5, 0.5, 1.0, 1.5], atol=1e-14)


@BOTH
@pytest.mark.parametrize(("last", "count"), [(0.5, 1), (np.nextafter(0.5, 0), 0)])
def test_an_event_at_the_last_row(last, count, compiled):
    rhs, _ = clock(T)
    p, fired = ca.SX.sym("p"), ca.SX.sym("fired")
    g = ca.Function("g", [T, X, p], [ca.if_else(p > 0, 1, 0.5 - T)])
    jump = ca.Function("j", [T, X, p, fired], [-X, p + 1])
    motion = integrate_events(rhs, [0, 3], [0, last], Events(g, jump, [0.0]), compiled=compiled)
    assert len(motion.events) == count
    assert motion.x[-1, 1] == (-3 if count else 3)


@BOTH
@METHODS
@pytest.mark.parametrize(("level", "count"), [(1 + 1e-6, 0), (1 - 1e-6, 4)])
def test_an_indicator_that_almost_touches_zero(level, count, method, compiled):
    # sin t reaches 1 twice in 8 s; it is above the level for 3 ms, in steps of about 100
    side, fired = ca.SX.sym("side"), ca.SX.sym("fired")
    rhs = ca.Function("f", [T, X, side], [ca.vertcat(X[1], -X[0])])
    g = ca.Function("g", [T, X, side], [side * (level - X[0])])
    jump = ca.Function("j", [T, X, side, fired], [X, -side])
    options = {"compiled": compiled, "method": method, **TIGHT}
    motion = integrate_events(rhs, [0, 1], [0, 8], Events(g, jump, [1]), **options)
    top, half = np.pi / 2, np.arccos(1 - 1e-6)
    expected = [top - half, top + half, 5 * top - half, 5 * top + half]
    assert np.allclose([event.time for event in motion.events], expected[:count], atol=1e-6)
    assert len(motion.events) == count
    assert np.allclose(motion.x[1], [np.sin(8), np.cos(8)], atol=1e-8)


@BOTH
def test_two_dips_in_one_step(compiled):
    # the fifth parts of a second around 2 and 3 s, in a motion of which one step would be enough
    side, fired = ca.SX.sym("side"), ca.SX.sym("fired", 2)
    rhs = ca.Function("f", [T, X, side], [ca.vertcat(1, 0)])
    g = [(X[0] - 3) ** 2 - 0.01, (X[0] - 2) ** 2 - 0.01]
    events = Events(
        ca.Function(
            "g", [T, X, side], [ca.if_else(side > 0, ca.vertcat(*g), -ca.mmin(ca.vertcat(*g)))]
        ),
        ca.Function("j", [T, X, side, fired], [X, -side]),
        [1],
    )
    motion = integrate_events(rhs, [0, 0], [0, 10], events, compiled=compiled)
    assert np.allclose([e.time for e in motion.events], [1.9, 2.1, 2.9, 3.1], rtol=0, atol=1e-12)


@BOTH
def test_a_dip_before_the_first_look(compiled):
    # below zero from 0.7 to 1.3 ms; the first step is 25 ms long
    side, fired = ca.SX.sym("side"), ca.SX.sym("fired")
    rhs = ca.Function("f", [T, X, side], [ca.vertcat(1, 0)])
    g = 0.5 * (1 - 1e3 * T) ** 2 - 0.045
    jump = ca.Function("j", [T, X, side, fired], [X, -side])
    events = Events(ca.Function("g", [T, X, side], [side * g]), jump, [1])
    motion = integrate_events(rhs, [1, 1], [0, 1], events, compiled=compiled)
    assert np.allclose([e.time for e in motion.events], [7e-4, 1.3e-3], rtol=0, atol=1e-15)


@BOTH
def test_a_dip_that_only_the_look_within_a_step_tells(compiled):
    # one step of a second, at whose ends the indicator rises; below zero from 7/12 to 11/12 s
    side, fired = ca.SX.sym("side"), ca.SX.sym("fired")
    rhs = ca.Function("f", [T, X, side], [ca.vertcat(1, 0)])
    g = ca.Function("g", [T, X, side], [ca.if_else(side, 0.5 + ca.sin(2 * ca.pi * T), 1)])
    events = Events(g, ca.Function("j", [T, X, side, fired], [X, 0]), [1])
    loose = {"rtol": 1e3, "atol": 1e3}
    motion = integrate_events(rhs, [1, 1], [0, 1], events, compiled=compiled, **loose)
    assert [e.time for e in motion.events] == pytest.approx([7 / 12], rel=0, abs=1e-15)


@BOTH
@pytest.mark.parametrize("power", [1, 3, 9])
def test_an_event_is_at_the_first_number_where_its_indicator_is_not_positive(power, compiled):
    p, fired = ca.SX.sym("p", 9), ca.SX.sym("fired", 9)
    rhs, levels = ca.Function("f", [T, X, p], [ca.vertcat(1, 0)]), np.linspace(0.1, 0.9, 9) ** power
    value = ca.Function("value", [T], [ca.vertcat(*levels) - T**power])
    g = ca.Function("g", [T, X, p], [ca.if_else(p, 1, value(T))])
    events = Events(g, ca.Function("j", [T, X, p, fired], [X, ca.fmax(p, fired)]), np.zeros(9))
    motion = integrate_events(rhs, [0, 0], [0, 1], events, compiled=compiled)
    assert [event.fired for event in motion.events] == [(k,) for k in range(9)]
    for k, event in enumerate(motion.events):
        assert value(event.time)[k] <= 0 < value(np.nextafter(event.time, 0))[k]


@pytest.mark.parametrize("falling", [0.5 - T**2, ca.exp(-5 * T) - 0.2])
def test_an_event_is_located_in_few_looks(falling):
    # halving would take 50, and secants with an end that never moves 20 and then halving; the
    # step is made twice, the second time as far as the event, and looked at twice
    looks, indicator = counted(ca.Function("falling", [T], [falling]))
    rhs, events = clock(T)
    t, x, p = ca.MX.sym("t"), ca.MX.sym("x", 2), ca.MX.sym("p")
    after = ca.if_else(p, 1, indicator(t))
    once = Events(ca.Function("g", [t, x, p], [after]), events.jump, [0.0])
    motion = integrate_events(rhs, [0, 0], [0, 1], once, compiled=False)
    assert len(motion.events) == 1
    between = [at for (at,) in looks if abs(at - motion.events[0].time) < 0.1]
    assert len(between) <= 20


@BOTH
def test_max_step_bounds_the_steps(compiled):
    # a switch that is on for a tenth of a second, and no indicator says so
    rhs = ca.Function("f", [T, X], [ca.vertcat(ca.fabs(T - 5) < 0.05, 0)])
    x = integrate(rhs, [0, 0], [0, 10], max_step=0.02, compiled=compiled)
    assert x[1, 0] == pytest.approx(0.1, abs=1e-5)
    assert integrate(rhs, [0, 0], [0, 10], compiled=compiled)[1, 0] == 0


@BOTH
def test_too_many_steps_between_two_rows(compiled):
    rhs = ca.Function("f", [T, X], [ca.vertcat(1, 0)])
    with pytest.raises(SolverError, match="more than 100000 steps between two output times"):
        integrate(rhs, [0, 0], [0, 1.0], max_step=9e-6, compiled=compiled)
    x = integrate(rhs, [0, 0], [0, 3e-4, 6e-4, 9e-4], max_step=9e-6, compiled=compiled)
    assert x[-1, 0] == pytest.approx(9e-4, rel=1e-12)


@pytest.mark.parametrize("modes", [0, 2])
def test_a_jump_leaves_as_many_modes_as_there_are(modes):
    rhs, events = clock(T, modes=np.zeros(modes))
    p, fired = ca.SX.sym("p", modes), ca.SX.sym("fired")
    jump = ca.Function("j", [T, X, p, fired], [X, p] if modes else [X])
    functions = equations(rhs, None, "dopri5", Events(events.indicators, jump, np.zeros(modes)))
    assert functions.jump.numel_out(1) == modes


@BOTH
def test_without_modes(compiled):
    p, fired = ca.SX.sym("p", 0), ca.SX.sym("fired")
    rhs = ca.Function("f", [T, X], [ca.vertcat(X[1], -X[0])])
    g = ca.Function("g", [T, X], [X[0]])
    jump = ca.Function("j", [T, X, p, fired], [ca.vertcat(X[0], -X[1])])
    motion = integrate_events(rhs, [0, 1], [0, 8], Events(g, jump), compiled=compiled, **TIGHT)
    assert np.allclose([e.time for e in motion.events], [np.pi, 2 * np.pi], rtol=0, atol=1e-8)
    assert np.allclose(motion.x[1], [np.sin(8 - 2 * np.pi), np.cos(8)], atol=1e-8)
    assert motion.modes.shape == (2, 0)


@BOTH
def test_an_indicator_that_is_not_positive_at_first_fires_at_once(compiled):
    rhs, events = clock(X[1] - 1.5)
    motion = integrate_events(rhs, [0, 0], [1, 2], events, compiled=compiled)
    found = [(event.time, event.fired, event.modes[0]) for event in motion.events]
    assert found == [(1.0, (0,), 2.0)]
    assert np.array_equal(motion.x[:, 1], [2, 2])


@BOTH
def test_one_event_may_cause_another_at_the_same_time(compiled):
    p, fired = ca.SX.sym("p", 2), ca.SX.sym("fired", 2)
    g = ca.vertcat(ca.if_else(p[0], 1, 0.5 - T), ca.if_else(p[0] * (1 - p[1]), -1, 1))
    jump = ca.Function("j", [T, X, p, fired], [X, ca.fmax(p, fired)])
    rhs = ca.Function("f", [T, X, p], [ca.vertcat(1, p[1])])
    events = Events(ca.Function("g", [T, X, p], [g]), jump, [0, 0])
    motion = integrate_events(rhs, [0, 0], [0, 1], events, compiled=compiled)
    assert [(event.time, event.fired) for event in motion.events] == [(0.5, (0, 1))]
    assert motion.x[1, 1] == pytest.approx(0.5)


@BOTH
def test_events_that_do_not_settle(compiled):
    rhs, events = clock(2.0, 0.5 - T)
    with pytest.raises(SolverError, match=r"t = 0\.5 s: .*do not settle.*; indicators 1"):
        integrate_events(rhs, [0, 0], [0, 1], events, compiled=compiled)


@BOTH
@pytest.mark.parametrize(
    ("indicator", "after", "message"),
    [
        (ca.sqrt(0.5 - X[0]), None, "event indicator has no value"),
        (0.5 - X[0], lambda x, p, f: [x / (x[1] * 0), p], "jump of an event has no value"),
    ],
)
def test_functions_without_value(indicator, after, message, compiled):
    rhs, events = clock(indicator, jump=after)
    with pytest.raises(SolverError, match=message):
        integrate_events(rhs, [0, 0], [0, 1], events, compiled=compiled)


@METHODS
def test_without_events_the_motion_is_the_same_to_the_last_bit(method):
    p, fired = ca.SX.sym("p"), ca.SX.sym("fired")
    rhs = ca.Function("pendulum", [T, X, p], [ca.vertcat(X[1], -p * ca.sin(X[0]))])
    events = Events(
        ca.Function("g", [T, X, p], [10 - X[0]]), ca.Function("j", [T, X, p, fired], [X])
    )
    times = np.linspace(0, 10, 101)
    for compiled in (True, False):
        options = {"p": 9.81, "method": method, "compiled": compiled}
        motion = integrate_events(rhs, [2, 0], times, events, **options)
        assert np.array_equal(motion.x, integrate(rhs, [2, 0], times, **options))
        assert motion.events == ()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"indicators": ca.Function("g", [X], [X])}, r"indicators\(t, x, p\) -> g"),
        ({"jump": ca.Function("j", [T, X], [X])}, r"jump\(t, x, p, fired\) -> \(x, modes\)"),
        ({"modes": [0, 1]}, "2 states and 1 parameters"),
        ({"modes": ["a"]}, "are not numbers"),
        ({"modes": [np.nan]}, "not finite"),
    ],
)
def test_events_that_do_not_fit(change, message):
    rhs, events = clock(0.5 - T)
    given = {"indicators": events.indicators, "jump": events.jump, "modes": events.modes, **change}
    with pytest.raises(ModelError, match=message):
        integrate_events(rhs, [0, 0], [0, 1], Events(**given))


def test_the_longest_step_is_positive():
    rhs, events = clock(2 - T)
    with pytest.raises(ModelError, match="longest step 0 must be a positive number"):
        integrate_events(rhs, [0, 0], [0, 1], events, max_step=0)


@BOTH
@METHODS
def test_what_begins_at_an_event_and_is_short_needs_a_first_step(compiled, method):
    # a wall of 1e-4 m, elastic, that is met at 10 m/s and cannot be passed
    side, fired = ca.SX.sym("side"), ca.SX.sym("fired")
    depth = X[0] - 1
    inside = ca.fmin(ca.fmax(depth, 0), ca.fmax(1e-4 - depth, 0))
    rhs = ca.Function("f", [T, X, side], [ca.vertcat(X[1], -1e11 * inside)])
    g = ca.Function("g", [T, X, side], [side * depth])
    j = ca.Function("j", [T, X, side, fired], [X, -side])
    ends = []
    for first in (0.0, 1e-9):
        events = Events(g, j, [-1.0], first)
        options = {"method": method, "rtol": 1e-8, "atol": 1e-8, "compiled": compiled}
        ends.append(integrate_events(rhs, [0, 10], [0, 1], events, **options).x[-1, 1])
    assert ends[1] == pytest.approx(-10, rel=1e-4)
    if method == "dopri5":  # the other one looks at slopes where it begins
        assert ends[0] == pytest.approx(10, rel=1e-4)
