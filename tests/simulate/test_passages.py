"""Motions through configurations in which the rows of loops become dependent."""

import casadi
import numpy as np
import pytest
from support.change_points import GRAVITY, linkage, rod, slider_crank

import mbs
from mbs.components import CoulombFriction, Revolute, RigidStop
from mbs.errors import SolverError


def coupling_rod():
    m = mbs.Mechanism("coupling_rod", gravity=GRAVITY)
    bar = m.add(rod("bar", 2.0))
    for k in range(3):
        crank, pin = m.add(rod(f"crank{k}", 0.4)), Revolute(f"p{k}")
        m.connect(m.world.at(float(k)), Revolute(f"j{k}", actuated=k == 0), crank)
        m.connect(crank.at(0.4), pin, bar.at(float(k)))
        if k:
            m.cut(pin)
    return m.assemble(guess={"j0": 1.0, "j1": 1.0, "j2": 1.0, "p0": -1.0})


MECHANISMS = {
    "parallelogram": lambda: mbs.robots.n_four_bar().assemble(active=["a0"]),
    "a+g=b+c": lambda: linkage((0.4, 0.9, 0.7, 1.2), (1.0, -0.5, 1.5)),
    "kite": lambda: linkage((0.5, 1.1, 1.1, 0.5), (1.0, 0.5, 2.0)),
    "antiparallelogram": lambda: linkage((0.4, 1.0, 0.4, 1.0), (1.0, -1.8, -1.5)),
    "coupling rod": coupling_rod,
    "piston": slider_crank,
    "sr400": lambda: mbs.robots.sr400().assemble(),
    "five_bar": lambda: mbs.robots.five_bar().assemble(),
}
SPEED = {"piston": ("slide", 1.5), "parallelogram": ("a0", -4.0), "coupling rod": ("j0", 5.0)}
FALLS = ("sr400", "five_bar")


@pytest.fixture(scope="module")
def systems():
    return {name: build() for name, build in MECHANISMS.items()}


def energy_error(result):
    energy = result["kinetic_energy"] + result["potential_energy"]
    return np.ptp(energy) / result["kinetic_energy"].max()


@pytest.mark.sweep
@pytest.mark.parametrize("name", MECHANISMS)
def test_energy_falls_with_the_tolerance_through_singular_configurations(systems, name):
    joint, speed = SPEED.get(name, ("j1", 6.0))
    v0 = None if name in FALLS else {joint: speed}
    for tolerance in (1e-4, 1e-6, 1e-8, 1e-10):
        result = mbs.simulate.run(
            systems[name], 3.0, v0=v0, tolerance=tolerance, step=0.05, quiet=True
        )
        assert energy_error(result) < 5 * tolerance
        assert result["closure_residual"].max() < 1e-11


@pytest.mark.parametrize("seed", range(6))
def test_random_starts_of_change_point_linkages(systems, seed):
    rng = np.random.default_rng(seed)
    for name in ("parallelogram", "a+g=b+c", "kite", "antiparallelogram", "coupling rod"):
        joint, _ = SPEED.get(name, ("j1", 0.0))
        v0, tolerance = {joint: rng.uniform(-6, 6)}, 10 ** rng.uniform(-10, -3)
        result = mbs.simulate.run(
            systems[name], 3.0, v0=v0, tolerance=tolerance, step=0.05, quiet=True
        )
        assert energy_error(result) < 30 * tolerance, (name, v0, tolerance)


def test_a_parallelogram_stays_one(systems):
    result = mbs.simulate.run(systems["parallelogram"], 5.0, v0={"a0": -3.0}, quiet=True)
    assert np.ptp(result["a0.q"]) > 4 * np.pi
    assert np.abs(result["a0.q"] - result["a1.q"]).max() < 1e-9


def test_an_antiparallelogram_stays_one(systems):
    system = systems["antiparallelogram"]
    result = mbs.simulate.run(system, 5.0, v0={"j1": 9.0}, quiet=True)
    turned = result["j4.q"] - result["j1.q"]
    assert np.ptp(result["j1.q"]) > 4 * np.pi
    assert np.ptp(turned) > 6.0  # cranks of a parallelogram would turn alike


def test_output_times_do_not_change_the_motion(systems):
    """Rows within a step that passes are on the branch that the steps are on."""
    system, v0 = systems["a+g=b+c"], {"j1": -4.005538012884346}
    q0 = {"j1": 0.739239379217}
    result = mbs.simulate.run(
        system, 1.0, q0=q0, v0=v0, tolerance=1.934421171055293e-05, step=0.05, quiet=True
    )
    assert energy_error(result) < 1e-4


@pytest.mark.sweep
@pytest.mark.parametrize("longer", [1e-5, -1e-5, 1e-7, -1e-7, 1e-8, -1e-8])
def test_near_misses_turn_whatever_the_tolerance(longer):
    """Lengths that miss a + g = b + c by a little: the branches come near and do not meet."""
    system = linkage((0.4, 0.9, 0.7 + longer, 1.2), (1.0, -0.5, 1.5))
    ends = []
    for tolerance in (1e-3, 1e-5, 1e-7, 1e-9):
        result = mbs.simulate.run(
            system, 3.0, v0={"j1": 6.0}, tolerance=tolerance, step=0.05, quiet=True
        )
        # at the nearest, rounding changes velocities by 3e-16 / 1e-8
        assert energy_error(result) < 5 * tolerance + 5e-9
        assert result["closure_residual"].max() < 1e-13
        ends.append([result[f"{joint}.q"][-1] for joint in ("j1", "j2", "j4")])
    assert np.ptp(ends, axis=0).max() < 5e-3


@pytest.mark.parametrize("longer", [1e-9, -1e-11])
def test_misses_that_rounding_hides_are_passed_or_named(longer):
    system = linkage((0.4, 0.9, 0.7 + longer, 1.2), (1.0, -0.5, 1.5))
    result = mbs.simulate.run(system, 3.0, v0={"j1": 6.0}, tolerance=1e-5, quiet=True)
    assert energy_error(result) < 1e-5
    with pytest.raises(SolverError, match=r"^linkage: .*come near each other.*configuration is j1"):
        mbs.simulate.run(system, 3.0, v0={"j1": 6.0}, tolerance=1e-9, quiet=True)


def test_a_prescribed_crank_passes_flat(systems):
    result = mbs.simulate.run(
        systems["parallelogram"],
        4.0,
        q0={"a0": 1.0},
        motion={"a0.q": lambda t: 1.0 + 2.0 * t},
        quiet=True,
    )
    assert result["a1.q"] == pytest.approx(1.0 + 2.0 * result.time, abs=1e-8)


@pytest.mark.parametrize("name", ["a+g=b+c", "kite", "antiparallelogram"])
def test_a_prescribed_crank_leads_on_along_its_branch(systems, name):
    """The others move without a kink, and the drive gives what the energy takes."""
    ends = []
    for tolerance in (1e-5, 1e-9):
        result = mbs.simulate.run(
            systems[name],
            2.0,
            q0={"j1": 1.0},
            motion={"j1.q": lambda t: 1.0 + 3.0 * t},
            tolerance=tolerance,
            step=2e-3,
            quiet=True,
        )
        for joint in ("j2", "j4"):
            v, a = result[f"{joint}.v"], result[f"{joint}.a"]
            assert np.diff(v) == pytest.approx(2e-3 * (a[1:] + a[:-1]) / 2, abs=2e-3)
        work = np.trapezoid(result["j1.tau"] * result["j1.v"], result.time)
        energy = result["kinetic_energy"] + result["potential_energy"]
        assert energy[-1] - energy[0] == pytest.approx(work, abs=1e-4)
        ends.append([result["j2.q"][-1], result["j4.q"][-1]])
    assert np.ptp(ends, axis=0).max() < 1e-5


@pytest.mark.parametrize("miss", [0.0, 1.0])
def test_a_drive_that_starts_where_branches_meet(systems, miss):
    """Its first effort is that of the branch; where none is chosen there is an error."""
    start = {"q0": {"a0": 0.0}, "v0": {"b0": -2.0 + miss}, "motion": {"a0.q": lambda t: 2.0 * t}}
    if miss:
        with pytest.raises(SolverError, match=r"velocities of one branch.*hold b0"):
            mbs.simulate.run(systems["parallelogram"], 0.1, quiet=True, **start)
        return
    result = mbs.simulate.run(systems["parallelogram"], 0.1, step=1e-3, quiet=True, **start)
    assert result["a1.q"] == pytest.approx(2.0 * result.time, abs=1e-9)
    fit = np.polynomial.Polynomial.fit(result.time[1:], result["a0.tau"][1:], 4)
    assert result["a0.tau"][0] == pytest.approx(fit(0.0), abs=1e-4)


@pytest.mark.parametrize(("law", "stops"), [(0.19, False), (0.3, True)])
def test_a_driven_slide_does_not_pass_its_dead_centre(systems, law, stops):
    """The loops end there: the error names the time, the configuration and the slide."""

    def driven():
        return mbs.simulate.run(
            systems["piston"],
            2.0,
            motion={"slide.q": lambda t: 0.9 + law * casadi.sin(t)},
            quiet=True,
        )

    if stops:
        with pytest.raises(SolverError, match=r"t = 0\.7297.*slide = 1\.1, .*hardly hold slide"):
            driven()
        return
    assert driven()["slide.q"].max() == pytest.approx(1.09, abs=1e-4)


def test_a_start_in_a_singular_configuration_with_velocities_of_one_branch(systems):
    system = systems["parallelogram"]
    result = mbs.simulate.run(
        system, 2.0, q0=[0.0, 0.0, 0.0], v0=[3.0, -3.0, 3.0], tolerance=1e-8, quiet=True
    )
    assert energy_error(result) < 1e-7
    assert np.ptp(result["a0.q"]) > 1.0
    assert np.abs(result["a0.q"] - result["a1.q"]).max() < 1e-8


@pytest.mark.parametrize("speed", [1e-2, -1e-5])
def test_a_slow_start_leaves_a_singular_configuration(systems, speed):
    """Gravity turns the first one back through the configuration that it starts in."""
    v0 = [speed, -speed, speed]
    for tolerance in (1e-4, 1e-8):
        result = mbs.simulate.run(
            systems["parallelogram"], 1.0, q0=[0.0] * 3, v0=v0, tolerance=tolerance, quiet=True
        )
        assert result["a0.q"][-1] < -3.0
        assert np.abs(result["a0.q"] - result["a1.q"]).max() < 1e-8
        assert energy_error(result) < tolerance


@pytest.mark.parametrize("speed", [2.0, -1e-2])
@pytest.mark.parametrize(
    ("name", "along"),
    [
        ("antiparallelogram", (1.0, -1.0, 1.0)),
        ("antiparallelogram", (-3.0, 7.0, 7.0)),
        ("kite", (0.0, 1.0, 1.0)),
        ("kite", (11.0, -8.0, 8.0)),
    ],
)
def test_either_branch_is_left_on_from_where_they_cross(systems, name, along, speed):
    v0 = list(speed * np.array(along) / np.max(np.abs(along)))
    for tolerance in (1e-4, 1e-9):
        result = mbs.simulate.run(
            systems[name], 1.0, q0=[0.0] * 3, v0=v0, tolerance=tolerance, quiet=True
        )
        assert result["j1.v"][0] == pytest.approx(v0[0], abs=1e-12)
        assert energy_error(result) < tolerance


@pytest.mark.parametrize("v0", [[0.0, 2.0, 2.0], [1.1, -0.8, 0.8]])
def test_accelerations_of_a_start_are_those_of_the_branch(systems, v0):
    """Those that the rows allow there are other ones, by 2 to 33 rad/s2."""
    result = mbs.simulate.run(systems["kite"], 1e-2, q0=[0.0] * 3, v0=v0, step=1e-3, quiet=True)
    for joint in ("j1", "j2", "j4"):
        fit = np.polynomial.Polynomial.fit(result.time, result[f"{joint}.v"], 4)
        assert result[f"{joint}.a"][0] == pytest.approx(fit.deriv()(0.0), abs=1e-2)


@pytest.mark.parametrize("name", ["kite", "a+g=b+c", "parallelogram"])
def test_the_implicit_method_passes_too(systems, name):
    joint, speed = SPEED.get(name, ("j1", 6.0))
    for tolerance in (1e-4, 1e-8):
        result = mbs.simulate.run(
            systems[name],
            3.0,
            v0={joint: speed},
            tolerance=tolerance,
            method="rodas",
            step=0.05,
            quiet=True,
        )
        assert energy_error(result) < 5 * tolerance


@pytest.mark.parametrize("miss", [1e-2, 1e-4])
def test_velocities_that_nearly_are_those_of_a_branch_are_refused(systems, miss):
    """What misses carries energy, which would be lost in silence."""
    with pytest.raises(SolverError, match=r"velocities of one branch.*hold b0"):
        mbs.simulate.run(
            systems["parallelogram"], 1.0, q0=[0.0] * 3, v0=[1, -1 - miss, 1 - miss], quiet=True
        )


@pytest.mark.parametrize("v0", [None, [1.0, -1.5, 0.5]], ids=["rest", "between branches"])
def test_a_start_that_chooses_no_branch_is_refused(systems, v0):
    """The error names the configuration, the joint, and what would decide."""
    with pytest.raises(SolverError, match=r"velocities of one branch.*a0 = 0, b0 = 0.*hold b0"):
        mbs.simulate.run(systems["parallelogram"], 1.0, q0=[0.0, 0.0, 0.0], v0=v0, quiet=True)


def test_a_crank_bounces_between_passages():
    """An elastic stop keeps the energy, and comes a moment after the linkage has been flat."""
    stop = RigidStop("stop", joint="j1", lower=-20.0, upper=7.5, restitution=1.0)
    system = linkage((0.4, 0.9, 0.7, 1.2), (1.0, -0.5, 1.5), (stop,))
    for tolerance in (1e-5, 1e-8):
        result = mbs.simulate.run(
            system, 3.0, v0={"j1": 9.0}, tolerance=tolerance, step=0.02, quiet=True
        )
        assert len(result.events) == 2
        assert energy_error(result) < 10 * tolerance


def test_coulomb_friction_acts_through_passages():
    dry = CoulombFriction("dry", joint="j1", sliding=0.3, sticking=0.4)
    system = linkage((0.4, 0.9, 0.7, 1.2), (1.0, -0.5, 1.5), (dry,))
    rough, fine = (
        mbs.simulate.run(system, 3.0, v0={"j1": 9.0}, tolerance=tolerance, step=0.01, quiet=True)
        for tolerance in (1e-5, 1e-9)
    )
    assert np.ptp(fine["j1.q"]) > 4 * np.pi
    assert rough["j1.q"] == pytest.approx(fine["j1.q"], abs=1e-3)
    energy = fine["kinetic_energy"] + fine["potential_energy"]
    work = np.trapezoid(fine["dry.effort"] * fine["j1.v"], fine.time)
    assert energy[-1] - energy[0] == pytest.approx(work, abs=1e-3)


def test_a_law_without_a_value_is_named_with_its_time_and_configuration():
    """At the start it is an indicator that has no value, later a rate."""
    dry = CoulombFriction("dry", joint="j1", sliding=0.3, sticking=0.4)
    system = linkage((0.4, 0.9, 0.7, 1.2), (1.0, -0.5, 1.5), (dry,))
    for sign, message in ((1, r"t = 0 s: an event indicator.*j1 = 1,"), (-1, r"t = 0\.5 s.*j1 = ")):
        with pytest.raises(SolverError, match=rf"^linkage: integration stopped at {message}"):
            mbs.simulate.run(
                system,
                1.0,
                tau=lambda t, q, v, s=sign: casadi.vertcat(casadi.sqrt(s * (t - 0.5)), 0, 0),
                quiet=True,
            )


@pytest.fixture(scope="module")
def two_windows():
    return mbs.robots.n_four_bar(2).assemble()


@pytest.mark.sweep
@pytest.mark.parametrize("speed", np.linspace(-3, -1, 81))
def test_errors_behind_singular_configurations_follow_the_tolerance(two_windows, speed):
    """Two windows of parallelograms move as a pendulum: a'' = -11.445 cos(a)."""
    y, step, exact = np.array([np.pi / 2, speed]), 2e-3, [np.pi / 2]
    for k in range(5000):  # Runge-Kutta of order 4 with two half steps, extrapolated
        whole, half = _pendulum(y, step), _pendulum(_pendulum(y, step / 2), step / 2)
        y = half + (half - whole) / 15
        if (k + 1) % 500 == 0:
            exact.append(y[0])
    options = {"v0": {"a0": speed}, "step": 1.0, "quiet": True}
    for tolerance in (1e-5, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11):
        result = mbs.simulate.run(two_windows, 10.0, tolerance=tolerance, **options)
        assert np.abs(result["a0.q"] - exact).max() < 100 * tolerance


def _pendulum(y, h):
    """A step of the classical method of order 4."""

    def slope(y):
        return np.array([y[1], -11.445 * np.cos(y[0])])

    a = slope(y)
    b = slope(y + h / 2 * a)
    c = slope(y + h / 2 * b)
    return y + h / 6 * (a + 2 * b + 2 * c + slope(y + h * c))
