"""Assembly near a guess: the nearest configuration, guesses that are met, springs at rest."""

import numpy as np
import pytest

import mbs
from mbs.components import Body, Box, Free, Prismatic, Revolute, Spherical
from mbs.errors import AssemblyError


def slider_crank():
    m = mbs.Mechanism("slider_crank", gravity=(0, 0, 0))
    crank = m.add(Box("crank", length=0.1, width=0.04, density=7850))
    rod = m.add(Box("rod", length=0.4, width=0.03, density=7850))
    slider = m.add(Body("slider", 1.0, inertia=(1, 1, 1)))
    m.connect(m.world, Revolute("main", actuated=True), crank.left)
    m.connect(crank.right, Revolute("big"), rod.left)
    m.connect(rod.right, Revolute("small"), slider)
    m.connect(m.world, Prismatic("slide", axis="x"), slider)
    return m


@pytest.mark.parametrize("main", np.linspace(0.1, 6.1, 16))
def test_the_configuration_nearest_to_a_guess(main):
    """Both configurations by hand: the rod swings by asin(0.25 sin main) to either side.

    The joint "small", which is cut, counts too.
    """
    system = slider_crank().assemble(guess={"main": main})
    swing = np.arcsin(0.25 * np.sin(main))
    modes, far = [], []
    size = 2.0  # of the mechanism [m]: no decision here is closer than that
    for big in (-main - swing, np.pi - main + swing):
        slide = 0.1 * np.cos(main) + 0.4 * np.cos(main + big)
        big, small = ((x + np.pi) % (2 * np.pi) - np.pi for x in (big, -main - big))
        modes.append((main, big, slide))
        far.append(max(abs(big), abs(small), abs(slide) / size))
    assert len(system.closure.others) == 1
    expected = modes[int(np.argmin(far))]
    np.testing.assert_allclose(system.configuration, expected, rtol=0, atol=1e-9)


def four_bar(joint):
    m = mbs.Mechanism("four_bar", gravity=(0, 0, 0))
    lengths = {"a": 0.4, "b": 0.5, "e": 0.5, "c": 0.9}
    a, b, e, c = (m.add(Box(n, length=x, width=0.03, density=2700)) for n, x in lengths.items())
    m.connect(m.world, Revolute("j1", actuated=True), a.left)
    m.connect(a.right, Revolute("j2"), b.left)
    m.connect(b.right, joint, e.left)
    m.connect(e.right, Revolute("j3"), c.right)
    m.connect(m.world.at(0.8), Revolute("j4"), c.left)
    return m


def test_springs_of_joints_stay_at_rest():
    joint = Revolute("soft", stiffness=1e4, rest=0.1, actuated=False)
    system = four_bar(joint).assemble(guess={"j1": 0.3, "j2": 1.0})
    at = dict(zip((c.name for c in system.coordinates), system.configuration, strict=True))
    assert at["soft"] == 0.1
    assert at["j1"] == 0.3
    result = mbs.simulate.run(system, 0.05, quiet=True)
    assert np.abs(result["soft.v"]).max() < 1e-6


def test_springs_of_joints_have_no_velocity_at_the_start():
    joint = Revolute("soft", stiffness=1e4, actuated=False)
    system = four_bar(joint).assemble(guess={"j1": 0.3})
    result = mbs.simulate.run(system, 1e-3, v0={"j1": 5.0}, quiet=True)
    assert abs(result["soft.v"][0]) < 1e-12
    rigid = four_bar(mbs.components.Fixed("soft")).assemble(guess={"j1": 0.3})
    stiff = mbs.simulate.run(rigid, 1e-3, v0={"j1": 5.0}, quiet=True)
    assert result["j2.v"][0] == pytest.approx(stiff["j2.v"][0], rel=1e-9)


def test_guessed_positions_are_met_if_the_others_can_follow():
    joint = Revolute("free", actuated=False)
    system = four_bar(joint).assemble(guess={"j2": 1.0, "free": 0.2})
    at = dict(zip((c.name for c in system.coordinates), system.configuration, strict=True))
    assert (at["j2"], at["free"]) == (1.0, 0.2)
    assert mbs.loops.configuration_report(system, system.configuration).is_closed


def test_the_report_shows_the_configuration_and_the_guess():
    report = slider_crank().assemble(guess={"main": 0.4, "big": 3.0, "slide": 0.7}).report()
    assert "Assembled at main = 0.4, big = 2.8" in report
    assert "Guesses that are not met: big = 3, slide = 0.7." in report
    assert "Another configuration: main = 0.4, big = 5.7" in report


def test_a_start_where_branches_meet_is_reported():
    """A parallelogram that lies flat."""
    m = mbs.Mechanism("flat", gravity=(0, 0, 0))
    a, b, c = (
        m.add(Box(n, length=x, width=0.03, density=2700))
        for n, x in {"a": 0.3, "b": 0.8, "c": 0.3}.items()
    )
    m.connect(m.world, Revolute("j1", actuated=True), a.left)
    m.connect(a.right, Revolute("j2"), b.left)
    m.connect(b.right, Revolute("j3"), c.right)
    m.connect(m.world.at(0.8), Revolute("j4"), c.left)
    system = m.assemble()
    assert system.closure.meets
    assert "branches of motion meet there" in system.report()


def test_bodies_that_no_loop_holds_stay_where_they_are():
    m = slider_crank()
    m.connect(m.world, Free("ball"), m.add(Body("b", 1.0, inertia=(1, 1, 1))))
    system = m.assemble(guess={"main": 2.0, "ball.x": 0.3})
    at = dict(zip((c.name for c in system.coordinates), system.configuration, strict=True))
    assert [at[f"ball.{k}"] for k in ("x", "y", "z", "qw", "qx")] == [0.3, 0, 0, 1, 0]
    assert len(system.closure.others) == 1


def test_of_two_guesses_that_exclude_each_other_one_is_kept():
    """The coupler keeps its guess, since the crank is nearer to its own then."""
    m = mbs.Mechanism("four_bar", gravity=(0, 0, 0))
    a, b, c = (m.add(Box(n, length=x, mass=1.0)) for n, x in (("a", 0.3), ("b", 0.8), ("c", 0.7)))
    m.connect(m.world, Revolute("j1"), a.left)
    m.connect(a.right, Revolute("j2"), b.left)
    m.connect(b.right, Revolute("j3"), c.right)
    m.connect(m.world.at(0.9), Revolute("j4"), c.left)
    system = m.assemble(guess={"j1": 1.0, "j2": -0.5})
    j1, j2, _ = system.configuration
    assert j2 == -0.5
    assert j1 == pytest.approx(1.0702916595, abs=1e-9)
    assert "Guesses that are not met: j1 = 1." in system.report()


@pytest.mark.parametrize("guess", [1.5, 2.0, -1.5])
@pytest.mark.parametrize("cut", [None, "s1", "s2"])
def test_a_rod_between_balls_does_not_hide_the_nearest_branch(cut, guess):
    """The rod spins freely about its line; cos j4 = 0.0175 on both branches."""
    m = mbs.Mechanism("rssr")
    masses = {"inertia": (0.01, 0.02, 0.02), "mass": 1.0}
    a, b, c = (
        m.add(Body(n, com=(x, 0, 0), **masses)) for n, x in (("a", 0.1), ("b", 0.5), ("c", 0.2))
    )
    balls = {name: Spherical(name) for name in ("s1", "s2")}
    m.connect(m.world, Revolute("j1", actuated=True), a)
    m.connect(a.at(0.2, rotation=("x", 0.4)), balls["s1"], b.at(0, rotation=("y", 0.3)))
    m.connect(b.at(1), balls["s2"], c.at(0.5))
    m.connect(m.world.at(0.6, 0.5), Revolute("j4", axis="x"), c.at(0, rotation=("z", 0.3)))
    if cut:
        m.cut(balls[cut])
    system = m.assemble(guess={"j1": 0.3, "j4": guess})
    at = dict(zip((row.name for row in system.coordinates), system.configuration, strict=True))
    assert at["j1"] == 0.3
    assert at["j4"] == pytest.approx(np.copysign(1.5532693796, guess), abs=1e-9)
    assert len(system.closure.others) == 1


@pytest.mark.parametrize(
    ("guess", "message"),
    [
        ({1: 0.3}, "the guess names 1, which is no coordinate"),
        ({"small": float("nan")}, "the guess of small is nan; give one finite number"),
        ({"main": [1, 2]}, "the guess of main is [1, 2]; give one finite number"),
    ],
)
def test_other_guesses_are_refused(guess, message):
    with pytest.raises(AssemblyError) as error:
        slider_crank().assemble(guess=guess)
    assert message in str(error.value)


def test_a_guess_of_a_cut_joint_that_is_not_met_is_reported():
    m = slider_crank()
    m.cut(m.components["small"])
    system = m.assemble(guess={"main": 0.3, "small": 2.0})
    assert [row.name for row in system.cut_coordinates] == ["small"]
    assert "Guesses that are not met: small = 2." in system.report()
