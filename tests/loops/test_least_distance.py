"""Guesses that the loops cannot meet: the configuration of least distance, for every cut."""

import numpy as np
import pytest
from support.sweeps import examples

import mbs
from mbs.components import Body, Box, Prismatic, Revolute
from mbs.loops.cut_positions import cut_positions

JOINTS = ("j1", "j2", "j3", "j4")


def four_bar(a, b, c, ground, cut=None, motor=False):
    """A crank a, a coupler b and a rocker c."""
    m = mbs.Mechanism("four_bar", gravity=(0, 0, 0))
    bars = {
        name: m.add(Box(name, length=x, mass=1.0)) for name, x in zip("abc", (a, b, c), strict=True)
    }
    joints = {name: Revolute(name, actuated=motor and name == "j1") for name in JOINTS}
    m.connect(m.world, joints["j1"], bars["a"].left)
    m.connect(bars["a"].right, joints["j2"], bars["b"].left)
    m.connect(bars["b"].right, joints["j3"], bars["c"].right)
    m.connect(m.world.at(ground), joints["j4"], bars["c"].left)
    if cut:
        m.cut(joints[cut])
    return m


def positions(system):
    """Positions of all joints by name, also of those that are cut."""
    rows = (*system.coordinates, *system.cut_coordinates)
    at_cut = np.array(cut_positions(system)(system.configuration, [])).ravel()
    values = (*system.configuration, *at_cut)
    return {row.name: float(x) for row, x in zip(rows, values, strict=True)}


def wrapped(angle):
    return (angle + np.pi) % (2 * np.pi) - np.pi


def reach(joint, a, b, c, ground):
    """Least and largest absolute position of a joint by the law of cosines.

    The diagonal of the quadrilateral opposite to the joint is bounded by both pairs of bars.
    """
    bars = [ground, a, b, c]
    k = JOINTS.index(joint)
    (u, v), (x, y) = (bars[k], bars[(k + 1) % 4]), (bars[(k + 2) % 4], bars[(k + 3) % 4])
    shortest, longest = max(abs(u - v), abs(x - y)), min(u + v, x + y)
    cosines = ((u * u + v * v - e * e) / (2 * u * v) for e in (shortest, longest))
    angles = [np.arccos(np.clip(cosine, -1, 1)) for cosine in cosines]
    if joint in ("j2", "j4"):  # these positions are the angles outside
        angles = [np.pi - angle for angle in reversed(angles)]
    return angles


def distance(guess, least, largest):
    """Distance of an angle from the reachable ones, [least, largest] and their negatives."""
    if least <= abs(guess) <= largest:
        return 0.0
    return min(abs(wrapped(guess - s * end)) for s in (-1, 1) for end in (least, largest))


def random_bars(rng):
    """Bars that form a quadrilateral, none of which has more than 90 % of its greatest length."""
    while True:
        bars = rng.uniform(0.2, 1.2, 4)
        pairs = [abs(bars @ signs) for signs in ([1, 1, -1, -1], [1, -1, 1, -1], [1, -1, -1, 1])]
        if 2 * max(bars) < 0.95 * sum(bars) and min(pairs) > 0.05:
            return tuple(float(x) for x in bars)


@pytest.mark.parametrize("seed", range(4))
def test_four_bars_are_nearest_to_a_guess_of_any_joint(seed):
    rng = np.random.default_rng(seed)
    unreachable = 0
    while unreachable < examples(10):
        bars, joint, cut = random_bars(rng), *rng.choice(JOINTS, 2)
        least, largest = reach(joint, *bars)
        guess = float(rng.uniform(-np.pi, np.pi))
        expected = distance(guess, least, largest)
        if expected > 0 or unreachable % 4 == 0:
            unreachable += expected > 0
            at = positions(four_bar(*bars, cut=cut).assemble(guess={joint: guess}))
            found = abs(wrapped(at[joint] - guess))
            assert found == pytest.approx(expected, abs=1e-9), (bars, joint, cut, guess)


def slider_crank(crank, rod, offset, cut=None):
    m = mbs.Mechanism("slider_crank", gravity=(0, 0, 0))
    bars = [m.add(Box(n, length=x, mass=1.0)) for n, x in (("crank", crank), ("rod", rod))]
    slider = m.add(Body("slider", 1.0, inertia=(1, 1, 1)))
    joints = {name: Revolute(name) for name in ("main", "big", "small")}
    joints["slide"] = Prismatic("slide", axis="x")
    m.connect(m.world, joints["main"], bars[0].left)
    m.connect(bars[0].right, joints["big"], bars[1].left)
    m.connect(bars[1].right, joints["small"], slider)
    m.connect(m.world.at(0, offset), joints["slide"], slider)
    if cut:
        m.cut(joints[cut])
    return m


@pytest.mark.parametrize("seed", range(3))
def test_slider_cranks_are_nearest_to_a_guess(seed):
    """The slide is between both distances at which the bars lie in one line."""
    rng = np.random.default_rng(seed)
    for _ in range(examples(10)):
        crank, rod = (float(x) for x in rng.uniform(0.2, 1.0, 2))
        offset = float(rng.uniform(0.1, 0.9) * abs(crank - rod))
        cut = str(rng.choice(["main", "big", "small", "slide"]))
        ends = [np.sqrt(x * x - offset * offset) for x in (abs(crank - rod), crank + rod)]
        guess = float(rng.choice((-1, 1)) * rng.choice((0.1, 0.5)) * ends[0])
        guess = guess if rng.random() < 0.5 else guess + float(np.sign(guess) * (ends[1] + 0.1))
        at = positions(slider_crank(crank, rod, offset, cut).assemble(guess={"slide": guess}))
        expected = min((s * end for s in (-1, 1) for end in ends), key=lambda x: abs(x - guess))
        if ends[0] <= abs(guess) <= ends[1]:
            expected = guess
        assert at["slide"] == pytest.approx(expected, abs=1e-9), (crank, rod, offset, cut, guess)


@pytest.mark.parametrize("cut", [None, *JOINTS[1:]])
def test_a_guess_beyond_the_range_is_at_its_end(cut):
    """Crank and coupler lie in one line at the end of the range of the rocker."""
    system = four_bar(0.4, 1.0, 0.9, 0.8, cut, motor=True).assemble(guess={"j4": 2.8})
    at = positions(system)
    assert at["j4"] == pytest.approx(2.4294208659, abs=1e-9)
    assert at["j1"] == pytest.approx(-1.7700284137, abs=1e-9)
    assert abs(at["j2"]) == pytest.approx(np.pi, abs=1e-9)
    assert "Guesses that are not met: j4 = 2.8." in system.report()


@pytest.mark.parametrize("cut", [None, *JOINTS])
@pytest.mark.parametrize(
    ("motor", "guess", "kept"),
    [
        (True, {"j1": 2.0, "j3": 1.0}, "j1"),
        (False, {"j1": 2.0, "j3": 1.0}, "j1"),
        (True, {"j1": 1.0, "j2": -0.5}, "j1"),
        (False, {"j1": 1.0, "j2": -0.5}, "j2"),
        (False, {"j4": 2.8, "j2": 0.3}, "j2"),
    ],
)
def test_guesses_that_exclude_each_other_do_not_depend_on_the_cut(motor, guess, kept, cut):
    """A motor keeps its guess; without a guessed motor the other guesses are kept."""
    cut = None if motor and cut == "j1" else cut  # a joint with a motor stays in the tree
    bars = (0.4, 1.0, 0.9, 0.8)
    expected = positions(four_bar(*bars, motor=motor).assemble(guess=guess))
    found = positions(four_bar(*bars, cut, motor=motor).assemble(guess=guess))
    assert found[kept] == pytest.approx(guess[kept], abs=1e-10)
    for name, value in expected.items():
        assert wrapped(found[name] - value) == pytest.approx(0, abs=1e-9), name


def first(system, result):
    return [result[f"{c.name}.q"][0] for c in system.coordinates]


STARTS = {
    "solve": lambda system, **given: mbs.loops.solve(system, given["q0"], guess=given["guess"]),
    "run": lambda system, **given: first(
        system, mbs.simulate.run(system, 1e-3, quiet=True, **given)
    ),
    "simulator": lambda system, **given: first(
        system, mbs.simulate.Simulator(system)(1e-3, **given)
    ),
    "dae": lambda system, **given: mbs.models.dae(system, "index1", **given).x0[: system.nq],
}


@pytest.mark.parametrize("start", STARTS)
@pytest.mark.parametrize("guess", [0.6, -0.6, 0.8])
def test_a_guess_of_a_cut_joint_chooses_the_branch(start, guess):
    system = four_bar(0.4, 1.0, 0.9, 0.8, "j3", motor=True).assemble()
    q = STARTS[start](system, q0={"j1": 1.0}, guess={"j3": guess})
    assert q[0] == 1.0
    at_cut = float(cut_positions(system)(q, []))
    assert np.sign(at_cut) == np.sign(guess)
    other = four_bar(0.4, 1.0, 0.9, 0.8, "j2", motor=True).assemble()
    expected = mbs.loops.solve(other, {"j1": 1.0}, guess={"j3": guess})
    names = [c.name for c in other.coordinates]
    assert at_cut == pytest.approx(expected[names.index("j3")], abs=1e-9)


@pytest.mark.parametrize("value", [float("nan"), "far", [0.1, 0.2]])
def test_a_guess_of_a_cut_joint_is_a_finite_number(value):
    system = four_bar(0.4, 1.0, 0.9, 0.8, "j3", motor=True).assemble()
    with pytest.raises(mbs.errors.ModelError, match="position of j3"):
        mbs.loops.solve(system, {"j1": 1.0}, guess={"j3": value})


def test_a_guess_of_a_cut_joint_that_looks_like_degrees_has_a_note():
    system = four_bar(0.4, 1.0, 0.9, 0.8, "j3", motor=True)
    note = "j3 = 30 rad may be degrees; give radians"
    assert note in system.assemble(guess={"j3": 30}).report()
    result = mbs.simulate.run(system.assemble(), 1e-3, guess={"j3": 30}, quiet=True)
    assert note in result.info["note"]
    with pytest.raises(mbs.errors.Unclosable, match=note):
        four_bar(0.4, 1.0, 0.9, 5.8, "j3").assemble(guess={"j3": 30})


def test_names_of_cut_joints_in_other_arguments():
    system = four_bar(0.4, 1.0, 0.9, 0.8, "j3", motor=True).assemble()
    with pytest.raises(mbs.errors.ModelError, match=r"j3\.q', which is no state, since its joint"):
        mbs.simulate.run(system, 1e-3, tolerance={"j3.q": 1e-6}, quiet=True)
    with pytest.raises(mbs.errors.ModelError, match="or give it as a guess"):
        mbs.simulate.run(system, 1e-3, q0={"j3": 0.7}, quiet=True)
    with pytest.raises(mbs.errors.ModelError, match=r"no coordinate 'j5'; use one of .*j3"):
        mbs.loops.solve(system, guess={"j5": 0.7})
