"""What a second run of a system takes from the first one, and what it must not."""

import cProfile
import importlib
import os
import subprocess
import sys
import time

import casadi
import numpy as np
import pytest

import mbs
from mbs.components import (
    Box,
    Custom,
    JointSensor,
    PointMass,
    Prismatic,
    Revolute,
    SampleHold,
    SpherePlaneContact,
    custom,
)

simulator = importlib.import_module("mbs.simulate.simulator")
segments = importlib.import_module("mbs.simulate.segments")


def swing(system, **options):
    return mbs.simulate.run(system, 0.5, quiet=True, **options)


@pytest.mark.parametrize(
    ("name", "method"),
    [
        ("four_bar", "dopri5"),
        ("four_bar", "rodas"),
        ("planar_2r", "dopri5"),
        ("planar_2r", "rodas"),
        ("whipple_bicycle", "dopri5"),
    ],
)
def test_a_second_run_is_the_first_to_the_last_bit(name, method):
    prepared, fresh = mbs.load(name).assemble(), mbs.load(name).assemble()
    first = swing(prepared, method=method)
    again, alone = swing(prepared, method=method), swing(fresh, method=method)
    for one in (again, alone):
        assert np.array_equal(one.values, first.values)
        assert one.units == first.units


@pytest.mark.parametrize("limit", [0, 5e4])
def test_what_is_observed_often_is_compiled_to_the_same_bits(limit, monkeypatch):
    made, build = [], segments.compiled
    monkeypatch.setattr(segments, "compiled", lambda *a, **k: made.append(a) or build(*a, **k))
    system = mbs.load("four_bar").assemble()
    first = swing(system)
    assert not made
    monkeypatch.setattr(segments, "_INTERPRETED", limit)
    again = [swing(system) for _ in range(4)]
    assert len(made) == 1
    for one in again:
        assert np.array_equal(one.values, first.values)
    shorter = mbs.simulate.run(system, 0.3, quiet=True)
    assert np.allclose(shorter.values, first.values[:31], rtol=1e-6, atol=1e-6)


@pytest.fixture
def made(monkeypatch):
    """Names of the systems whose state equations were derived."""
    found, derive = [], simulator.full_state
    count = lambda system, *laws: found.append(system.name) or derive(system, *laws)  # noqa: E731
    monkeypatch.setattr(simulator, "full_state", count)
    return found


def test_equations_are_kept_by_what_drives_them(made):
    system = mbs.load("planar_2r").assemble()
    motor = system.velocity_coordinates[0].name
    taus = (None, {motor: 1.0}, {motor: 1.0}, {motor: 2.0}, None)
    ends = [swing(system, tau=tau)[f"{motor}.q"][-1] for tau in taus]
    assert len(made) == 3
    assert ends[1] == ends[2] != ends[3]
    assert ends[0] == ends[4] != ends[1]


def test_few_equations_are_kept(made):
    system = mbs.load("planar_2r").assemble()
    motor = system.velocity_coordinates[0].name
    for tau in (*range(9), 8, 1, 0):
        swing(system, tau={motor: float(tau)})
    assert len(made) == 10  # the first one was forgotten, no other


def test_starts_and_parameters_need_no_new_equations(made):
    system = mbs.load("planar_2r").assemble()
    names = [c.name for c in system.coordinates]
    before = swing(system, q0={names[0]: 0.1})
    after = swing(system, q0={names[0]: 0.4}, v0={names[1]: 1.0}, tolerance=1e-10)
    assert len(made) == 1
    assert not np.array_equal(before.values, after.values)


@pytest.fixture
def disk(monkeypatch, tmp_path):
    """A folder in which equations are kept."""
    monkeypatch.setenv("MBS_KEEP_EQUATIONS", "1")
    monkeypatch.setenv("MBS_CACHE_DIR", str(tmp_path))
    return tmp_path


@pytest.mark.parametrize("name", ["four_bar", "whipple_bicycle"])
def test_another_process_reads_what_this_one_derived(name, made, disk):
    first, again = mbs.load(name).assemble(), mbs.load(name).assemble()
    result = swing(first)
    assert np.array_equal(swing(again).values, result.values)
    assert len(made) == 1
    program = (
        "import sys, mbs; run = __import__('mbs.simulate.simulator', fromlist=['run'])\n"
        "def derived(*a): raise SystemExit('derived')\n"
        "run.full_state = derived\n"
        f"r = run.run(mbs.load({name!r}).assemble(), 0.5, quiet=True)\n"
        "print(r.values.tobytes().hex())"
    )
    for seed in ("1", "2"):
        environment = {**os.environ, "PYTHONHASHSEED": seed}
        done = subprocess.run(
            [sys.executable, "-c", program], env=environment, capture_output=True, check=True
        )
        assert bytes.fromhex(done.stdout.decode().strip()) == result.values.tobytes()


def test_what_differs_is_derived_anew(made, disk):
    def arm(mass, law=None):
        m = mbs.Mechanism("arm", gravity=(0, -9.81, 0))
        bar = m.add(Box("bar", length=1.0, mass=mass))
        m.connect(m.world, Revolute("j", axis="z"), bar.left)
        return swing(m.assemble(), tau=law)["j.q"][-1]

    arm(1.0), arm(1.0)
    assert len(made) == 1
    arm(1.0 + 1e-15)
    assert len(made) == 2
    arm(1.0, {"j": 1e-3})
    assert len(made) == 3


def test_a_class_in_a_function_is_simulated_and_not_kept(made, disk):
    class Push(Custom):
        joint = custom.coordinate()

        def loads(self, at):
            return {"joint": 3.0}

    def pushed():
        m = mbs.Mechanism("m", gravity=(0, 0, 0))
        m.connect(m.world, Prismatic("z", axis="z", actuated=False), m.add(PointMass("a", 1.0)))
        m.add(Push("push", "z"))
        return m.assemble()

    ends = [swing(pushed())["z.v"][-1] for _ in range(2)]
    assert ends == pytest.approx([1.5, 1.5], abs=1e-12)
    assert len(made) == 2
    assert not list(disk.glob("*.pickle"))


def flipped(content):
    """The content with another digit in the middle of an expression."""
    return content[:-2000] + bytes([content[-2000] ^ 1]) + content[-1999:]


@pytest.mark.parametrize(
    "damage",
    [lambda content: b"", lambda content: b"nonsense", lambda content: content[:-9], flipped],
)
def test_damaged_equations_are_derived_anew(damage, made, disk):
    result = swing(mbs.load("four_bar").assemble())
    (file,) = disk.glob("equations-*.pickle")
    whole = file.read_bytes()
    file.write_bytes(damage(whole))
    assert np.array_equal(swing(mbs.load("four_bar").assemble()).values, result.values)
    assert len(made) == 2
    assert file.read_bytes() == whole


def test_laws_of_time_are_told_apart():
    system = mbs.load("planar_2r").assemble()
    motor = system.velocity_coordinates[0].name
    ends = [
        swing(system, tau=lambda t, q, v, k=k: {motor: k * t})[f"{motor}.q"][-1]
        for k in (1.0, 3.0, 1.0)
    ]
    assert ends[0] == ends[2] != ends[1]


def test_laws_of_prescribed_motions_are_told_apart(made):
    system = mbs.load("planar_2r").assemble()
    name = system.velocity_coordinates[0].name
    ends = [
        swing(system, motion={f"{name}.q": lambda t, k=k: k * t})[f"{name}.q"][-1]
        for k in (0.2, 0.6, 0.2)
    ]
    assert ends == pytest.approx([0.1, 0.3, 0.1], abs=1e-12)
    assert len(made) == 2


def test_contacts_and_events_of_components_run_again_alike():
    """A ball that bounces on a ground beside a sampled block: crossings and events together."""
    m = mbs.Mechanism("ball", gravity=(0, 0, -9.81))
    ball = m.add(PointMass("ball", mass=0.5))
    m.connect(m.world, Prismatic("z", axis="z"), ball)
    m.add(SpherePlaneContact("ground", ball, m.world, radius=0.1, stiffness=1e5))
    hold = m.add(SampleHold("hold", 0.05))
    m.add(JointSensor("height", "z"))
    m.connect_signal("height.q", hold.u)
    system = m.assemble()
    first, again = (swing(system, q0={"z": 0.6}) for _ in range(2))
    assert np.array_equal(first.values, again.values)
    assert first.events == again.events
    assert [what for _, name, what in first.events if name == "hold"].count("samples") == 10
    fall = np.sqrt(2 * 0.5 / 9.81)
    held, look = first["hold.y"], 0.05 * np.floor(first.time / 0.05 + 1e-9)
    before = (look < fall) & (np.abs(first.time - look) > 1e-3)
    np.testing.assert_allclose(held[before], 0.6 - 9.81 / 2 * look[before] ** 2, atol=1e-8)
    assert first["z.v"].max() > 2.5  # it has bounced
    lower = swing(system, q0={"z": 0.3})
    assert lower["z.q"].max() < first["z.q"].max()


PROGRAM = """
import sys
import mbs
from mbs.components import Custom, HeightFieldContact, Mechanism, PointMass, Prismatic, custom

drag, slope = float(sys.argv[1]), float(sys.argv[2])

class Drag(Custom):
    point = custom.frame()
    def loads(self, at):
        return {"point": custom.force(-drag * at.point.v)}

def height(x, y):
    return slope * x

def local_class():
    class Local(Drag):
        pass
    return Local

def fall(cls):
    m = Mechanism("fall", gravity=(0, 0, -9.81))
    stone = m.add(PointMass("stone", mass=0.3))
    m.connect(m.world, Prismatic("z", axis="z", actuated=False), stone)
    m.add(cls("drag", stone))
    m.add(HeightFieldContact("field", stone.at(1), m.world, height=height, stiffness=1e3))
    return m.assemble()

for cls in (Drag, local_class()):
    end = mbs.simulate.run(fall(cls), 0.5, q0={"z": 0.3}, quiet=True)["z.v"][-1]
    options = {"folder": sys.argv[3] + cls.__name__, "quiet": True}
    try:
        mbs.simulate.sweep(fall(cls), {"z.q": [0.3]}, 0.5, **options)
        print(end)
    except mbs.errors.ModelError as error:
        print(end, "another study" in str(error))
"""


def test_code_of_a_user_is_never_taken_from_an_earlier_process(disk, tmp_path):
    ends = []
    for numbers in (("0.1", "0.05"), ("0.1", "0.05"), ("2.0", "0.05"), ("0.1", "0.15")):
        folder = str(tmp_path / "study")
        command = [sys.executable, "-c", PROGRAM, *numbers, folder]
        done = subprocess.run(command, capture_output=True, check=True, text=True)
        ends.append(done.stdout.split("\n")[:2])
    assert ends[0][0] == ends[0][1]  # the class of a module and that of a function
    assert ends[1] == ends[0]  # the study is resumed
    for other in ends[2:]:
        assert [line.split()[1] for line in other] == ["True", "True"]
    assert len({float(end.split()[0]) for pair in ends for end in pair}) == 3


def test_a_run_keeps_what_it_prepared_for_numbers_not_for_functions(monkeypatch):
    made, build = [], simulator.Simulator
    monkeypatch.setattr(simulator, "Simulator", lambda *a, **k: made.append(a) or build(*a, **k))
    system = mbs.load("planar_2r").assemble()
    results = [swing(system, tau=tau) for tau in (None, {"q1": 1.0}, {"q1": 1.0}, None)]
    assert len(made) == 2
    assert np.array_equal(results[0].values, results[3].values)
    assert np.array_equal(results[1].values, results[2].values)
    assert not np.array_equal(results[0].values, results[1].values)
    swing(system, tau={"q1": 1.0 + 1e-15})
    swing(system, tau={"q1": 1.0}, method="rodas")
    assert len(made) == 4
    # a function may say something else in the next call
    torque = [1.0]
    pushed = [swing(system, tau=lambda t, q, v: [torque[0], 0]) for torque[0] in (1.0, 2.0)]
    assert len(made) == 6
    assert np.array_equal(pushed[0].values, results[1].values)
    assert not np.array_equal(pushed[1].values, results[1].values)


def test_motions_that_differ_in_velocities_close_the_loops_once(monkeypatch):
    closed, close = [], simulator.start_position
    count = lambda *a: closed.append(a) or close(*a)  # noqa: E731
    monkeypatch.setattr(simulator, "start_position", count)
    system, other = (mbs.load("four_bar").assemble() for _ in range(2))
    name = system.velocity_coordinates[system.independent[0]].name
    starts = [dict(v0={name: 1.0}), dict(v0={name: 2.0}), dict(q0={name: 0.3}, v0={name: 2.0})]
    found = [swing(system, **one) for one in starts]
    assert len(closed) == 2
    for one, result in zip(reversed(starts), reversed(found), strict=True):
        assert np.array_equal(swing(other, **one).values, result.values)


class Push(casadi.Callback):
    """A law that no graph shows."""

    def __init__(self, strength):
        casadi.Callback.__init__(self)
        self.strength = strength
        self.construct("push", {"enable_fd": True})

    def get_n_in(self):
        return 3

    def get_sparsity_in(self, k):
        return casadi.Sparsity.dense(2 if k else 1, 1)

    def get_sparsity_out(self, k):
        return casadi.Sparsity.dense(2, 1)

    def eval(self, arguments):
        return [casadi.DM([self.strength, 0])]


def test_callbacks_of_one_name_are_told_apart():
    system = mbs.load("planar_2r").assemble()
    laws = [Push(1.0), Push(2.0)]
    ends = [swing(system, tau=law)["q1.q"][-1] for law in laws]
    expected = [swing(system, tau={"q1": law.strength})["q1.q"][-1] for law in laws]
    np.testing.assert_allclose(ends, expected, 1e-6)
    assert abs(ends[0] - ends[1]) > 0.01


def test_a_short_compiled_run_costs_few_function_calls():
    # 402 calls; counts do not depend on the load of the computer, unlike times
    simulator = mbs.simulate.Simulator(mbs.load("puma560").assemble())
    begin = time.monotonic()
    while not compiled(simulator) and time.monotonic() < begin + 60:
        simulator(0.1)
    if not compiled(simulator):
        pytest.skip("no C compiler")
    profile = cProfile.Profile()
    profile.runcall(simulator, 0.1)
    assert sum(row.callcount for row in profile.getstats()) < 480


def compiled(simulator):
    codes = simulator._equations(simulator.system).prepared.values()
    return any(getattr(code, "library", None) is not None for code in codes)
