"""Curves through points: continuity, beads by hand, cams."""

import itertools
import math

import casadi
import numpy as np
import pytest
from support.messages import refused
from support.parts import asked, run, stored

import mbs
from mbs.components import Body, Cam, PointMass, PointOnCurve, Prismatic, Revolute, Spherical
from mbs.components.curves import natural_spline, periodic_spline
from mbs.errors import DescriptionError

G = 9.81
CIRCLE = np.arange(24) * 2 * np.pi / 24


def derivatives(spline):
    """Value and three derivatives of the first element."""
    t = casadi.SX.sym("t")
    found = [spline.at(t)[0]]
    for _ in range(3):
        found.append(casadi.jacobian(found[-1], t))
    return casadi.Function("spline", [t], [casadi.vertcat(*found)])


@pytest.mark.parametrize("closed", [False, True])
def test_two_derivatives_are_continuous_and_no_more(closed):
    rng = np.random.default_rng(3)
    t = np.cumsum(rng.uniform(0.3, 1.0, 12))
    points = rng.uniform(-1, 1, (12, 2))
    period = t[-1] - t[0] + 0.4
    spline = periodic_spline(t, points, period) if closed else natural_spline(t, points)
    f = derivatives(spline)
    ends = [t[0] + period] if closed else []
    for knot in [*t, *ends]:
        before, at, after = (np.array(f(knot + d)).ravel() for d in (-1e-10, 0.0, 1e-10))
        np.testing.assert_allclose(after[:3], before[:3], atol=1e-7)  # slopes times 2e-10
        np.testing.assert_allclose(at[:3], after[:3], atol=1e-7)
    jumps = [abs(float(f(knot + 1e-9)[3] - f(knot - 1e-9)[3])) for knot in t]
    assert max(jumps) > 1
    values = [float(f(knot)[0]) for knot in t]
    np.testing.assert_allclose(values, points[:, 0], atol=1e-13)
    if closed:
        far = [np.array(f(x + 7 * period)) - np.array(f(x)) for x in (t[2] + 0.1, t[5] + 0.2)]
        np.testing.assert_allclose(far, 0, atol=1e-10)
    else:
        beyond = np.array([f(x) for x in (t[0] - 3, t[-1] + 3)])
        np.testing.assert_allclose(beyond[:, 2:], 0, atol=1e-12)


def test_a_spline_comes_near_a_smooth_curve_by_the_fourth_power():
    errors = []
    for n in (12, 24, 48):
        t = np.arange(n) * 2 * np.pi / n
        f = derivatives(periodic_spline(t, np.sin(t)[:, None], 2 * np.pi))
        x = np.linspace(0, 2 * np.pi, 331)
        errors.append(max(abs(float(f(a)[0]) - math.sin(a)) for a in x))
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    np.testing.assert_allclose(orders, 4, atol=0.15)


def bead(curve, s=0.0, closed=False, mass=0.5):
    """A bead in the plane of x and y."""
    m = mbs.Mechanism("bead", gravity=(0, -G, 0))
    slide, ball = m.add(Body("slide", mass=0.0)), m.add(PointMass("ball", mass))
    m.connect(m.world, Prismatic("x", axis="x", actuated=False), slide)
    m.connect(slide, Prismatic("y", axis="y", actuated=False), ball)
    m.add(PointOnCurve("wire", m.world, ball, curve=curve, closed=closed, s=s))
    return asked(m)


def test_a_bead_on_a_straight_wire_by_hand():
    system = bead([(0, 0, 0), (3, -1, 0), (6, -2, 0)])
    result = run(system, 2.0)
    sine, cosine = np.array([1, 3]) / math.sqrt(10)
    np.testing.assert_allclose(result["wire.s.q"], 0.5 * G * sine * result.time**2, atol=1e-10)
    # the force is m g cos, normal to the wire; the bead is at 6.2 m of 6.3 m at the end
    normal = 0.5 * G * cosine * np.array([sine, cosine])
    forces = np.array([result[f"wire.force_{axis}"] for axis in "xyz"])
    np.testing.assert_allclose(forces[:2], np.tile(normal[:, None], len(result.time)), atol=1e-10)
    np.testing.assert_allclose(forces[2], 0, atol=1e-15)


def test_a_bead_goes_on_straight_beyond_an_end():
    system = bead([(0, 0, 0), (3, -1, 0)])
    result = run(system, 2.0)
    assert result["wire.s.q"][-1] > math.sqrt(10)
    np.testing.assert_allclose(result["y.q"], -result["x.q"] / 3, atol=1e-12)


def test_a_bead_on_a_parabola_keeps_its_energy_and_feels_newton():
    x = np.linspace(-1, 1, 21)
    system = bead(np.c_[x, x**2, 0 * x], s=0.2)
    result = run(system, 3.0)
    E = stored(result)
    assert E[0] > 1
    np.testing.assert_allclose(E, E[0], rtol=0, atol=1e-8)
    np.testing.assert_allclose(result["wire.force_x"], 0.5 * result["x.a"], atol=1e-9)
    np.testing.assert_allclose(result["wire.force_y"], 0.5 * (result["y.a"] + G), atol=1e-9)


def test_a_bead_rests_where_two_pieces_of_the_wire_meet():
    """Rounding moves it to and fro over the point: the crossing is not watched for a while."""
    x = np.linspace(-1, 1, 21)
    result = run(bead(np.c_[x, x**2, 0 * x], s=1.47), 3.0, q0={"x": 0.0})
    np.testing.assert_allclose(result["x.q"], 0, atol=1e-12)


def test_a_bead_goes_round_and_round_a_closed_wire():
    system = bead(np.c_[np.cos(CIRCLE), np.sin(CIRCLE), 0 * CIRCLE], closed=True)
    result = run(system, 2.0, v0={"y": 9.0})
    assert result["wire.s.q"][-1] > 2 * 2 * np.pi
    radius = np.hypot(result["x.q"], result["y.q"])
    np.testing.assert_allclose(radius, 1, atol=2e-5)  # of a spline through 24 points
    E = stored(result)
    np.testing.assert_allclose(E, E[0], rtol=0, atol=1e-8)


def test_a_curve_on_a_body_that_moves():
    """A bar that swings, with a curved slot in it in which a pin slides."""
    m = mbs.Mechanism("slot", gravity=(0, 0, -G))
    bar = m.add(Body("bar", mass=2.0, com=(0.5, 0, 0), inertia=(0.02, 0.2, 0.2)))
    pin, carrier = m.add(PointMass("pin", 0.7)), m.add(Body("carrier", mass=0.0))
    m.connect(m.world, Revolute("j", axis="y", actuated=False), bar)
    m.connect(m.world.at(0, 0, -0.3), Prismatic("x", axis="x", actuated=False), carrier)
    m.connect(carrier, Prismatic("z", axis="z", actuated=False), pin)
    x = np.linspace(0.2, 1.4, 9)
    m.add(PointOnCurve("slot", bar, pin, curve=np.c_[x, 0 * x, 0.1 * np.sin(3 * x)], s=0.5))
    system = asked(m, guess={"j": 0.4, "x": 0.6})
    assert system.closure.mobility == 2
    result = run(system, 1.0, v0={"j": 0.5})
    E = stored(result)
    np.testing.assert_allclose(E, E[0], rtol=0, atol=1e-8)


def lift(t):
    return 0.02 * (1 - np.cos(t)) + 0.004 * np.sin(2 * t)


def cam(**options):
    """A cam of 0.1 kg m^2 that lifts 0.3 kg."""
    m = mbs.Mechanism("cam", gravity=(0, -G, 0))
    wheel = m.add(Body("wheel", mass=1.0, inertia=(0.1, 0.1, 0.1)))
    follower = m.add(PointMass("follower", 0.3))
    m.connect(m.world, Revolute("turn", axis="z"), wheel)
    m.connect(m.world.at(0.5), Prismatic("lift", axis="y", actuated=False), follower)
    t = np.arange(16) * 2 * np.pi / 16
    element = Cam("cam", "lift", "turn", profile=np.c_[t, lift(t)], **options)
    m.add(element)
    return asked(m), derivatives(element.spline)


@pytest.mark.parametrize("closed", [False, True])
@pytest.mark.parametrize("count", [4, 5])
def test_a_bend_is_crossed_at_every_knot(count, closed):
    t = np.cumsum(np.random.default_rng(count).uniform(0.3, 1.0, count))
    points, period = np.sin(3 * t)[:, None], t[-1] - t[0] + 0.4
    spline = periodic_spline(t, points, period) if closed else natural_spline(t, points)
    s = casadi.SX.sym("s")
    f = casadi.Function("bend", [s], [spline.bend(s)])
    knots = [knot + k * period for k in range(-2, 3) for knot in t] if closed else t
    assert all(abs(float(f(knot))) < 1e-14 for knot in knots)
    assert all(float(f(knot - 1e-3)) * float(f(knot + 1e-3)) < -1e-7 for knot in knots)
    ends = [*knots, knots[-1] + 0.4] if closed else [knots[0] - 1, *knots, knots[-1] + 1]
    inside = [np.linspace(a, b, 9)[1:-1] for a, b in itertools.pairwise(ends)]
    signs = [{np.sign(float(f(x))) for x in piece} for piece in inside]
    assert all(len(found) == 1 for found in signs)


@pytest.mark.parametrize("method", ["dopri5", "rodas"])
def test_steps_end_at_knots(method):
    # steps over the jumps of the third derivative lose a hundred times as much
    system, _ = cam()
    result = mbs.simulate.run(
        system, 2.0, v0={"turn": 10.0}, tolerance=1e-8, method=method, quiet=True
    )
    assert np.ptp(stored(result)) < 2e-7  # J, of 5


def test_a_cam_by_hand():
    system, f = cam()
    ddm = mbs.models.direct_dynamics(system)
    for q in (0.0, 0.3, np.pi, 2.0, 6.2, 9.0, -4.0):
        h, slope, curvature, _ = np.array(f(q)).ravel()
        a = (2.0 - 0.3 * slope * (curvature * 49 + G)) / (0.1 + 0.3 * slope**2)
        assert float(ddm([q, h], 7.0, 2.0)[0]) == pytest.approx(a, abs=1e-12)


def test_a_cam_keeps_energy_over_turns_and_tells_its_effort():
    system, f = cam()
    result = run(system, 2.0, v0={"turn": 10.0})
    assert result["turn.q"][-1] > 6 * np.pi
    h = np.array([np.array(f(q)).ravel() for q in result["turn.q"]])
    np.testing.assert_allclose(result["lift.q"], h[:, 0], atol=1e-12)
    np.testing.assert_allclose(result["lift.v"], h[:, 1] * result["turn.v"], atol=1e-9)
    E = stored(result)
    np.testing.assert_allclose(E, E[0], rtol=1e-8)
    assert result.units["cam.effort"] == "N"
    np.testing.assert_allclose(result["cam.effort"], 0.3 * (result["lift.a"] + G), atol=1e-9)


def test_the_projection_measures_lengths_by_the_mechanism_where_a_cam_dwells():
    """A slope of 1e-18 is no unit of length, with which corrections would move the cam alone."""
    m = mbs.Mechanism("dwell", gravity=(0, -G, 0))
    wheel, follower = m.add(Body("wheel", 1.0, inertia=(1, 1, 0.1))), m.add(PointMass("f", 0.3))
    m.connect(m.world, Revolute("turn", axis="z"), wheel)
    m.connect(m.world, Prismatic("lift", axis="y", actuated=False), follower)
    t = np.arange(12) * 2 * np.pi / 12
    element = Cam("cam", "lift", "turn", profile=np.c_[t, 0.02 * (1 - np.cos(t))])
    m.add(element)
    slope = float(derivatives(element.spline)(0)[1])
    assert 0 < abs(slope) < 1e-15
    system = asked(m)
    scale = mbs.loops.velocity.scales(system).length
    assert 0.01 < scale < 1.1
    result = run(system, 0.8, v0={"turn": 10.0})
    E = stored(result)
    np.testing.assert_allclose(E, E[0], rtol=1e-7)


def test_the_fmu_of_a_cam_moves_as_the_simulation(tmp_path):
    system, _ = cam()
    path = mbs.export.fmu(system, tmp_path / "cam.fmu")
    start = {"turn.v": 10.0, "turn.tau": 0.5}
    result = mbs.simulate.fmu(path, 0.5, start=start, step=0.05, tolerance=1e-12, quiet=True)
    expected = run(system, 0.5, v0={"turn": 10.0}, tau={"turn": 0.5}, step=0.05)
    for name in ("turn.q", "lift.v", "cam.effort"):
        np.testing.assert_allclose(result[name], expected[name], atol=1e-7)


def test_a_curve_with_ends_between_two_displacements():
    m = mbs.Mechanism("wedge", gravity=(0, -G, 0))
    for axis in "xy":
        m.connect(m.world, Prismatic(axis, axis=axis), m.add(PointMass(f"m_{axis}", 2.0)))
    m.add(Cam("wedge", "y", "x", profile=[(0, 0), (1, 0.5), (2, 1)], period=None))
    system = asked(m)
    result = run(system, 1.0, q0={"x": 3.0})
    a = -2 * G * 0.5 / (2 + 2 * 0.25)
    np.testing.assert_allclose(result["x.a"], a, rtol=1e-12)


SQUARE = [(0, 0, 0), (1, 0, 0), (1, 1, 0)]


def wire(**options):
    world = mbs.Mechanism("m").world
    return lambda: PointOnCurve("c", world, world.at(1), **{"curve": SQUARE, **options})


def lobe(**options):
    return lambda: Cam("c", "a", "b", **{"profile": [(0, 0), (1, 1), (2, 0)], **options})


@pytest.mark.parametrize(
    ("make", "parts"),
    [
        (wire(curve=3), ["c: curve is 3", "2 rows of 3 numbers"]),
        (wire(curve=[(0, 0), (1, 1)]), ["c: curve is", "3 numbers"]),
        (wire(curve=SQUARE[:2], closed=True), ["3 rows of 3 numbers"]),
        (wire(curve=[*SQUARE, (1, 1, 0)]), ["c: point 2 of the curve is the same as the next"]),
        (wire(curve=[*SQUARE, (0, 0, 0)], closed=True), ["c: point 3 of the curve"]),
        (wire(curve=[(0, 0, 0), (1, math.nan, 0)]), ["c: curve holds a number that is not finite"]),
        (lobe(profile=[(0, 0), (1, 1)]), ["c: profile is", "3 rows of 2 numbers"]),
        (lobe(profile=[(0, 0), (2, 1), (1, 2)]), ["c: the driver is at 2 in row 1", "at 1"]),
        (lobe(profile=[(0, 0), (1, 1), (1, 2)]), ["c: the driver is at 1 in row 1"]),
        (lobe(period=2.0), ["c: profile spans 2 of the driver", "the period is 2"]),
        (lobe(period=-1), ["c: period is -1", "above zero"]),
        (lobe(period="x"), ["c: period is 'x'"]),
    ],
)
def test_what_is_refused(make, parts):
    refused(DescriptionError, *parts, by=make)


def test_a_cam_on_a_ball_is_refused():
    m = mbs.Mechanism("m")
    m.connect(m.world, Spherical("ball"), m.add(Body("b", 1.0, inertia=(1, 1, 1))))
    m.connect(m.world, Prismatic("y", axis="y"), m.add(PointMass("p", 1.0)))
    m.add(Cam("c", "y", "ball.wx", profile=[(0, 0), (1, 1), (2, 0)]))
    refused(mbs.errors.AssemblyError, "c: there is no coordinate 'ball.wx'", by=m.assemble)
