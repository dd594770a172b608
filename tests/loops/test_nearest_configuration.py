"""One search for the configuration nearest to a guess: assembly, solve, large mechanisms."""

import numpy as np
import pytest

import mbs
from mbs.components import Body, Box, Prismatic, Revolute
from mbs.loops.closing import Closing, closure_parameters
from mbs.loops.nearest import GuessTarget, nearest_configuration

CRANK, ROD = 0.1, 0.4
GROUND, ROCKER = 1.1, 0.6


def add_slider_crank(m, k, place):
    """A crank, a rod and a slider; positions main, big and slide, each with its number."""
    crank = m.add(Box(f"crank{k}", length=CRANK, width=0.04, density=7850))
    rod = m.add(Box(f"rod{k}", length=ROD, width=0.03, density=7850))
    slider = m.add(Body(f"slider{k}", 1.0, inertia=(1, 1, 1)))
    m.connect(place, Revolute(f"main{k}", actuated=True), crank.left)
    m.connect(crank.right, Revolute(f"big{k}"), rod.left)
    m.connect(rod.right, Revolute(f"small{k}"), slider)
    m.connect(place, Prismatic(f"slide{k}", axis="x"), slider)


def slider_cranks(count):
    m = mbs.Mechanism("slider_cranks", gravity=(0, 0, 0))
    for k in range(count):
        add_slider_crank(m, k, m.world.at(0.0, float(k)))
    return m


def modes(main):
    """Both configurations by hand: the rod swings by asin(0.25 sin main) to either side."""
    swing = np.arcsin(CRANK / ROD * np.sin(main))
    for big in (-main - swing, np.pi - main + swing):
        slide = CRANK * np.cos(main) + ROD * np.cos(main + big)
        yield (big + np.pi) % (2 * np.pi) - np.pi, slide


def four_bars(count):
    """Four-bar linkages in sequence: the rocker of one is the crank of the next one."""
    m = mbs.Mechanism("four_bars", gravity=(0, 0, 0))
    crank = m.add(Box("crank", length=0.3, width=0.03, density=2700))
    m.connect(m.world, Revolute("main", actuated=True), crank.left)
    for k in range(count):
        coupler = m.add(Box(f"coupler{k}", length=GROUND, width=0.03, density=2700))
        rocker = m.add(Box(f"rocker{k}", length=ROCKER, width=0.03, density=2700))
        m.connect(crank.right, Revolute(f"a{k}"), coupler.left)
        m.connect(coupler.right, Revolute(f"b{k}"), rocker.right)
        m.connect(m.world.at(GROUND * (k + 1)), Revolute(f"c{k}"), rocker.left)
        crank = rocker
    return m


def wrapped(angle):
    return (angle + np.pi) % (2 * np.pi) - np.pi


@pytest.mark.parametrize("main", np.linspace(0.1, 6.1, 9))
@pytest.mark.parametrize("side", [0, 1])
def test_solve_returns_what_assemble_returns(main, side):
    """Guesses in the middle of nowhere, nearer to one of both configurations."""
    big, slide = list(modes(main))[side]
    guess = {"big0": wrapped(big + 0.9), "slide0": slide}
    assembled = slider_cranks(1).assemble(guess={"main0": main, **guess})
    system = slider_cranks(1).assemble(guess={"main0": 0.3})
    solved = mbs.loops.solve(system, {"main0": main}, guess=guess)
    start = np.array(system.position({"main0": main, **guess}))
    closing = Closing(system, closure_parameters(system), (0,))
    named = [k for k, c in enumerate(system.coordinates) if c.name in guess]
    found = nearest_configuration(closing, GuessTarget.at(closing, start, named))
    np.testing.assert_array_equal(solved, found.q)
    np.testing.assert_allclose(solved[1:3], assembled.configuration[1:3], rtol=0, atol=1e-9)


def test_solve_returns_the_nearest_configuration_for_random_guesses():
    system = slider_cranks(1).assemble(guess={"main0": 0.3})
    names = [c.name for c in system.coordinates]
    size = Closing(system, closure_parameters(system)).size
    rng = np.random.default_rng(1)
    for _ in range(60):
        main, big, slide = [*rng.uniform(-3, 3, 2).tolist(), float(rng.uniform(-0.6, 0.6))]
        q = mbs.loops.solve(system, {"main0": main}, guess={"big0": big, "slide0": slide})
        far = [max(abs(wrapped(b - big)), abs(s - slide) / size) for b, s in modes(main)]
        found = wrapped(q[names.index("big0")] - big), (q[names.index("slide0")] - slide) / size
        if abs(far[0] - far[1]) > 1e-6 and min(far) > 0:
            assert max(map(abs, found)) == pytest.approx(min(far), abs=1e-8)


@pytest.mark.parametrize("count", [9, 14])
def test_independent_loops_of_a_large_mechanism_are_each_nearest(count):
    """Twenty-seven free positions and more: Newton's method alone kept the mode that it met."""
    rng = np.random.default_rng(count)
    expected, guess = {}, {}
    for k in range(count):
        main = float(rng.uniform(-3, 3))
        big, slide = list(modes(main))[int(rng.integers(2))]
        expected[f"big{k}"], expected[f"slide{k}"] = big, slide
        guess |= {
            f"main{k}": main,
            f"big{k}": wrapped(big + rng.uniform(-1, 1)),
            f"slide{k}": slide,
        }
    system = slider_cranks(count).assemble(guess=guess)
    at = dict(zip((c.name for c in system.coordinates), system.configuration, strict=True))
    for name, value in expected.items():
        assert wrapped(at[name] - value) == pytest.approx(0, abs=1e-9), name


def four_bar_angles(main, sides):
    """Positions of joints by hand: intersections of circles about a crank's end and a pivot."""
    angle, end, at = main, 0.3 * np.array([np.cos(main), np.sin(main)]), {"main": main}
    least = np.inf
    for k, side in enumerate(sides):
        pivot = np.array([GROUND * (k + 1), 0.0])
        to = pivot - end
        far = np.linalg.norm(to)
        along = (far**2 + GROUND**2 - ROCKER**2) / (2 * far)
        across = side * np.sqrt(GROUND**2 - along**2)
        least = min(least, abs(across))
        point = end + (along * to + across * np.array([-to[1], to[0]])) / far
        coupler = np.arctan2(*(point - end)[::-1])
        at[f"a{k}"], rocker = wrapped(coupler - angle), np.arctan2(*(point - pivot)[::-1])
        at[f"b{k}"], at[f"c{k}"] = wrapped(rocker - coupler), rocker
        angle, end = rocker, point
    return at, least


@pytest.mark.parametrize("seed", range(4))
def test_loops_in_sequence_are_each_nearest(seed):
    """Twenty-six free positions: every loop follows from the one before it."""
    rng = np.random.default_rng(seed)
    least = 0.0
    while least < 0.2:  # modes that are nearly one cannot be told apart by a guess
        wanted, least = four_bar_angles(0.4, rng.choice((-1, 1), 13))
    system = four_bars(13).assemble(guess={"main": 0.4})
    names = [c.name for c in system.coordinates]
    # of every loop the angle of one joint, from which Newton's method does not find the others
    told = [n for n in names if n[0] == "c"] or [n for n in names if n[0] == "b"]
    guess = {n: wrapped(wanted[n] + rng.uniform(-0.1, 0.1)) for n in told}
    again = four_bars(13).assemble(guess={"main": 0.4, **guess})
    for q in (again.configuration, mbs.loops.solve(system, {"main": 0.4}, guess=guess)):
        for name, value in zip(names, q, strict=True):
            assert wrapped(value - wanted[name]) == pytest.approx(0, abs=1e-8), name
    assert mbs.loops.configuration_report(again, again.configuration).is_closed


def test_a_loop_of_a_large_mechanism_moves_to_the_end_of_its_range():
    """The crank and the rod of one loop are in one line; the others follow their own guesses."""
    guess = {f"main{k}": 0.3 for k in range(9) if k != 4}
    system = slider_cranks(9).assemble(guess={**guess, "slide4": -0.9})
    at = dict(zip((c.name for c in system.coordinates), system.configuration, strict=True))
    assert at["slide4"] == pytest.approx(-CRANK - ROD, abs=1e-9)
    for k in set(range(9)) - {4}:
        assert at[f"main{k}"] == 0.3
        big, slide = min(modes(0.3), key=lambda mode: abs(mode[0]))
        assert (at[f"big{k}"], at[f"slide{k}"]) == pytest.approx((big, slide), abs=1e-9)
