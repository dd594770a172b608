"""Events with modes, against motions that are known in closed form between events."""

import casadi as ca
import numpy as np
import pytest

from mbs.errors import SolverError
from mbs.solvers import Events, integrate_events

T, X = ca.SX.sym("t"), ca.SX.sym("x", 2)
BOTH = pytest.mark.parametrize("compiled", [True, False], ids=["compiled", "python"])
METHODS = pytest.mark.parametrize("method", ["dopri5", "rodas"])
TIGHT = {"rtol": 1e-10, "atol": 1e-10}


def ball(rest_below=0.0):
    """A ball on the ground, p = (gravity, restitution, resting); it rests after slow impacts."""
    p, fired = ca.SX.sym("p", 3), ca.SX.sym("fired")
    gravity, restitution, resting = ca.vertsplit(p)
    back = -restitution * X[1]
    stays = back <= rest_below
    rhs = ca.Function("fall", [T, X, p], [ca.vertcat(X[1], ca.if_else(resting, 0, -gravity))])
    height = ca.Function("height", [T, X, p], [ca.if_else(resting, 1, X[0])])
    after = ca.vertcat(0, ca.if_else(stays, 0, back))
    jump = ca.Function("bounce", [T, X, p, fired], [after, stays])
    return rhs, Events(height, jump, [0.0])


def impacts(count, gravity=9.81, restitution=0.8):
    """Times of the impacts of a ball that falls from 1 m."""
    first = np.sqrt(2 / gravity)
    flights = 2 * first * restitution ** np.arange(1, count)
    return first + np.concatenate([[0], np.cumsum(flights)])


@BOTH
@METHODS
def test_bouncing_ball(method, compiled):
    rhs, events = ball()
    times = np.linspace(0, 3.8, 77)
    options = {"method": method, "compiled": compiled, **TIGHT}
    motion = integrate_events(rhs, [1, 0], times, events, p=[9.81, 0.8], **options)
    expected = impacts(50)
    expected = expected[expected < 3.8]
    assert len(expected) == 12
    assert np.max(np.abs([event.time for event in motion.events] - expected)) < 1e-9
    assert {event.fired for event in motion.events} == {(0,)}
    begin = np.concatenate([[-expected[0]], expected])
    speed = 9.81 * expected[0] * 0.8 ** np.arange(len(begin))
    k = np.searchsorted(begin, times, side="right") - 1
    since = times - begin[k]
    assert np.max(np.abs(motion.x[:, 0] - (speed[k] * since - 9.81 / 2 * since**2))) < 1e-9


@BOTH
def test_the_ball_comes_to_rest(compiled):
    rhs, events = ball(rest_below=1e-6)
    options = {"compiled": compiled, **TIGHT}
    motion = integrate_events(rhs, [1, 0], [0, 4, 5, 9], events, p=[9.81, 0.8], **options)
    assert motion.events[-1].time == pytest.approx(impacts(200)[-1], abs=1e-6)
    assert np.array_equal(motion.modes[:, 0], [0, 0, 1, 1])
    assert np.array_equal(motion.x[2:], np.zeros((2, 2)))


@BOTH
def test_a_ball_that_never_rests_is_refused_where_time_stands_still(compiled):
    rhs, events = ball()
    with pytest.raises(SolverError, match=r"t = 4\.0637127\d* s: .*hardly advances.*indicators 0"):
        integrate_events(rhs, [1, 0], [0, 5], events, p=[9.81, 0.8], compiled=compiled)


def block_on_a_belt():
    """p = (stiffness, static and sliding friction force, belt speed, mode); mass 1 kg.

    The mode is 0 when the block sticks, else the direction in which friction pushes it.
    """
    p, fired = ca.SX.sym("p", 5), ca.SX.sym("fired")
    stiffness, static, sliding, belt, mode = ca.vertsplit(p)
    pull = stiffness * X[0]
    sticks = mode == 0
    rhs = ca.vertcat(ca.if_else(sticks, belt, X[1]), ca.if_else(sticks, 0, mode * sliding - pull))
    slack = ca.if_else(sticks, static - ca.fabs(pull), mode * (belt - X[1]))
    holds = ca.logic_and(mode != 0, ca.fabs(pull) < static)
    jump = [ca.vertcat(X[0], belt), ca.if_else(holds, 0, ca.sign(pull))]
    return (
        ca.Function("block", [T, X, p], [rhs]),
        ca.Function("slack", [T, X, p], [slack]),
        ca.Function("switch", [T, X, p, fired], jump),
    )


@BOTH
@METHODS
def test_stick_and_slip(method, compiled):
    stiffness, static, sliding, belt = 4.0, 3.0, 2.0, 0.5
    w, extra = np.sqrt(stiffness), (static - sliding) / stiffness
    rhs, slack, switch = block_on_a_belt()
    times = np.linspace(0, 20, 401)
    motion = integrate_events(
        rhs,
        [0, belt],
        times,
        Events(slack, switch, [0.0]),
        p=[stiffness, static, sliding, belt],
        method=method,
        compiled=compiled,
        **TIGHT,
    )
    slip = (2 * np.pi - 2 * np.arctan(extra * w / belt)) / w
    stick = 2 * extra / belt
    expected = static / stiffness / belt + np.cumsum([0, *[slip, stick] * 5])
    expected = expected[expected < 20]
    assert len(expected) > 7
    found = np.array([event.time for event in motion.events])
    assert np.max(np.abs(found - expected)) < 1e-8
    assert [event.modes[0] for event in motion.events] == [1, 0] * (len(expected) // 2) + [1] * (
        len(expected) % 2
    )
    since = times - expected[0]
    during = (since > 0) & (since < slip)
    x = sliding / stiffness + extra * np.cos(w * since) + belt / w * np.sin(w * since)
    assert np.max(np.abs(motion.x[during, 0] - x[during])) < 1e-8
    sticking = motion.modes[:, 0] == 0
    assert np.max(np.abs(motion.x[sticking, 1] - belt)) < 1e-12


@BOTH
def test_a_fast_block_slips_to_the_other_side_first(compiled):
    rhs, slack, switch = block_on_a_belt()
    p, options = [4.0, 3.0, 2.0, 0.5], {"compiled": compiled, **TIGHT}
    motion = integrate_events(rhs, [0, 2.5], [0, 3], Events(slack, switch, [-1.0]), p=p, **options)
    # x = (cos 2t - 1)/2 + 1.25 sin 2t until v = 0.5; the spring then pulls too hard to stick
    angle = np.arctan2(1, 2.5)
    reversal = (np.arccos(0.5 / np.hypot(1, 2.5)) - angle) / 2
    assert motion.events[0].time == pytest.approx(reversal, abs=1e-9)
    place = (np.cos(2 * reversal) - 1) / 2 + 1.25 * np.sin(2 * reversal)
    assert 4 * place > 3
    assert [event.modes[0] for event in motion.events[:2]] == [1, 0]
    # x = 0.5 + (place - 0.5) cos 2s + 0.25 sin 2s until v = 0.5 again
    back = np.pi - np.arctan(4 * (place - 0.5))
    assert motion.events[1].time == pytest.approx(reversal + back, abs=1e-9)


@BOTH
def test_rigid_stop_keeps_and_releases(compiled):
    # a unit mass pushed by cos t against a stop on the right: it rests while the push is positive
    p, fired = ca.SX.sym("p"), ca.SX.sym("fired", 2)
    rhs = ca.Function("f", [T, X, p], [(1 - p) * ca.vertcat(X[1], ca.cos(T))])
    free = ca.vertcat(ca.if_else(p, 1, -X[0]), ca.if_else(p, ca.cos(T), 1))
    stop = ca.Function("stop", [T, X, p], [free])
    jump = ca.Function("j", [T, X, p, fired], [ca.vertcat(0, 0), fired[0]])
    times = np.linspace(0, 12, 121)
    motion = integrate_events(
        rhs, [-0.5, 0], times, Events(stop, jump, [0.0]), compiled=compiled, **TIGHT
    )
    # 0.5 - cos t reaches 0 at pi/3; the push is negative from pi/2 on
    first = np.arccos(0.5)
    assert [event.fired for event in motion.events] == [(0,), (1,)]
    assert motion.events[0].time == pytest.approx(first, abs=1e-9)
    assert motion.events[1].time == pytest.approx(np.pi / 2, abs=1e-9)
    assert len(motion.events) == 2
    flight = times > np.pi / 2
    x = -np.cos(times) - (times - np.pi / 2)
    assert np.max(np.abs(motion.x[flight, 0] - x[flight])) < 1e-8
    assert np.max(motion.x[:, 0]) < 1e-12


@pytest.mark.parametrize("seed", range(12))
def test_crossings_of_random_motions(seed):
    # the sum of two oscillations crosses a level up and down; every crossing is found on a grid too
    rng = np.random.default_rng(seed)
    x, p = ca.SX.sym("x", 4), ca.SX.sym("p", 4)
    w1, w2, level, side = ca.vertsplit(p)
    rhs = ca.vertcat(x[1], -(w1**2) * x[0], x[3], -(w2**2) * x[2])
    g = ca.Function("g", [T, x, p], [side * (level - x[0] - x[2])])
    jump = ca.Function("j", [T, x, p, ca.SX.sym("fired")], [x, -side])
    frequencies, level = rng.uniform(0.5, 6, 2), rng.uniform(0.2, 1.6)
    method = ("dopri5", "rodas")[seed % 2]
    motion = integrate_events(
        ca.Function("f", [T, x, p], [rhs]),
        [0, frequencies[0], 0, frequencies[1]],
        [0, 30],
        Events(g, jump, [1]),
        p=[*frequencies, level],
        method=method,
        **TIGHT,
    )
    grid = np.linspace(0, 30, 600_001)
    value = np.sin(frequencies[0] * grid) + np.sin(frequencies[1] * grid) - level
    k = np.flatnonzero(np.sign(value[:-1]) != np.sign(value[1:]))
    expected = grid[k] - value[k] * (grid[1] - grid[0]) / (value[k + 1] - value[k])
    assert len(motion.events) == len(expected)
    assert np.allclose([event.time for event in motion.events], expected, rtol=0, atol=1e-6)


@METHODS
def test_interpreted_functions_give_the_same_bits(method):
    rhs, slack, switch = block_on_a_belt()
    p, times = [4.0, 3.0, 2.0, 0.5], np.linspace(0, 15, 201)
    a, b = (
        integrate_events(
            rhs, [0, 2.5], times, Events(slack, switch, [-1.0]), p=p, method=method, compiled=c
        )
        for c in (True, False)
    )
    assert a.x.tobytes() == b.x.tobytes()
    assert np.array_equal(a.modes, b.modes)
    assert [e.fired for e in a.events] == [e.fired for e in b.events]
    assert [e.time for e in a.events] == [e.time for e in b.events]
    assert len(a.events) > 5


@BOTH
def test_projection_after_the_jump(compiled):
    # a point on a circle meets a wall: the jump turns its velocity, not quite along the circle
    x, fired = ca.SX.sym("x", 4), ca.SX.sym("fired")
    p = ca.SX.sym("p", 0)
    place, velocity = x[:2], x[2:]
    pull = (ca.dot(velocity, velocity) - 9.81 * place[1]) / ca.dot(place, place)
    rhs = ca.Function("circle", [T, x, p], [ca.vertcat(velocity, -pull * place - ca.DM([0, 9.81]))])
    rows = ca.vertcat(ca.dot(place, place) - 1, ca.dot(place, velocity))
    J = ca.jacobian(rows, x)
    step = ca.Function("onto", [T, x], [x - J.T @ ca.solve(J @ J.T, rows), ca.norm_inf(rows)])
    wall = ca.Function("wall", [T, x], [x[0]])
    jump = ca.Function("j", [T, x, p, fired], [ca.vertcat(place * 1.001, -velocity)])
    times = np.linspace(0, 3, 61)
    motion = integrate_events(
        rhs, [1, 0, 0, 0], times, Events(wall, jump), project=step, compiled=compiled, **TIGHT
    )
    # the quarter of a period of a pendulum that swings by a right angle: K(sin 45 deg) sqrt(l/g)
    quarter = 1.8540746773013719 / np.sqrt(9.81)
    assert np.allclose([e.time for e in motion.events], quarter * np.array([1, 3, 5]), atol=1e-7)
    assert np.max(np.abs(np.sum(motion.x[:, :2] ** 2, 1) - 1)) < 1e-12
