"""What a second run of a system takes from the first one, and what it must not."""

import numpy as np
import pytest

import mbs
from mbs.components import JointSensor, PointMass, Prismatic, SampleHold, SpherePlaneContact
from mbs.models.state.signals import effort_function
from mbs.simulate.run import state_equation


def swing(system, **options):
    return mbs.simulate.run(system, 0.5, quiet=True, **options)


@pytest.mark.parametrize("method", ["dopri5", "rodas"])
@pytest.mark.parametrize("name", ["four_bar", "planar_2r", "whipple_bicycle"])
def test_a_second_run_is_the_first_to_the_last_bit(name, method):
    prepared, fresh = mbs.load(name).assemble(), mbs.load(name).assemble()
    first = swing(prepared, method=method)
    again, alone = swing(prepared, method=method), swing(fresh, method=method)
    for one in (again, alone):
        assert np.array_equal(one.values, first.values)
        assert one.units == first.units


def test_equations_are_kept_by_what_drives_them():
    system = mbs.load("planar_2r").assemble()
    motor = system.speeds[0].name
    laws = [
        effort_function(system, tau) for tau in (None, {motor: 1.0}, {motor: 1.0}, {motor: 2.0})
    ]
    none, one, same, two = (state_equation(system, law, None, []) for law in laws)
    assert one is same
    assert len({id(x) for x in (none, one, two)}) == 3
    assert state_equation(system, None, None, []) is none
    results = [swing(system, tau={motor: tau})[f"{motor}.q"][-1] for tau in (1.0, 2.0, 1.0)]
    assert results[0] == results[2] != results[1]


def test_few_equations_are_kept():
    system = mbs.load("planar_2r").assemble()
    motor = system.speeds[0].name
    for tau in range(12):
        state_equation(system, effort_function(system, {motor: float(tau)}), None, [])
    assert len(system.cached("state equations", dict)) == 8


def test_starts_and_parameters_need_no_new_equations():
    m = mbs.load("planar_2r")
    system = m.assemble()
    names = [c.name for c in system.coordinates]
    before = swing(system, q0={names[0]: 0.1})
    kept = dict(system.cached("state equations", dict))
    after = swing(system, q0={names[0]: 0.4}, v0={names[1]: 1.0}, tolerance=1e-10)
    assert dict(system.cached("state equations", dict)).keys() == kept.keys()
    assert not np.array_equal(before.values, after.values)


def test_laws_of_time_are_told_apart():
    system = mbs.load("planar_2r").assemble()
    motor = system.speeds[0].name
    ends = [
        swing(system, tau=lambda t, q, v, k=k: {motor: k * t})[f"{motor}.q"][-1]
        for k in (1.0, 3.0, 1.0)
    ]
    assert ends[0] == ends[2] != ends[1]


def test_prescribed_motions_are_not_kept():
    system = mbs.load("planar_2r").assemble()
    name = system.speeds[0].name
    ends = [
        swing(system, motion={f"{name}.q": lambda t, k=k: k * t})[f"{name}.q"][-1]
        for k in (0.2, 0.6)
    ]
    assert ends == pytest.approx([0.1, 0.3], abs=1e-12)


def test_contacts_and_events_of_components_run_again_alike():
    """A ball that bounces on a ground beside a sampled block: crossings and events together."""
    m = mbs.Mechanism("ball", gravity=(0, 0, -9.81))
    ball = m.add(PointMass("ball", mass=0.5))
    m.connect(m.world, Prismatic("z", axis="z"), ball)
    m.add(SpherePlaneContact("ground", ball, m.world, radius=0.1, stiffness=1e5))
    hold = m.add(SampleHold("hold", 0.05))
    m.add(JointSensor("height", "z"))
    m.wire("height.q", hold.u)
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
