"""Events of components beside contacts, discs, and segments of over-constrained loops."""

import sys
from dataclasses import replace

import numpy as np
import pytest
from support.messages import refused

import mbs
from mbs.components import (
    Body,
    Custom,
    Free,
    PointMass,
    Prismatic,
    RigidStop,
    RollingDisc,
    SpherePlaneContact,
    custom,
)
from mbs.errors import AssemblyError, SolverError


class Clock(Custom):
    """Counts tenths of a second."""

    left = custom.state("s", start=0.1)
    ticks = custom.mode()

    def rates(self, at):
        return {"left": -1.0}

    def events(self, at):
        return {"tick": custom.Event(at.left, {"left": 0.1, "ticks": at.ticks + 1})}


def mass(*parts):
    m = mbs.Mechanism("m", gravity=(0, 0, -9.81))
    stone = m.add(PointMass("stone", mass=1.0))
    m.connect(m.world, Prismatic("z", axis="z", actuated=False), stone)
    for part in parts:
        m.add(part(m, stone) if callable(part) else part)
    return m.assemble()


def ground(m, stone):
    law = {"stiffness": 1e5, "restitution": 0.7, "impact_speed": 2.0}
    return SpherePlaneContact("ground", stone, m.world, radius=0.05, **law)


def ticks(result):
    times = [time for time, name, _ in result.events if name == "clock"]
    assert result["clock.ticks"][-1] == len(times)
    assert times == pytest.approx(0.1 * np.arange(1, len(times) + 1), abs=1e-12)  # rounding
    return len(times)


def test_beside_contacts():
    """A ball that bounces, which ended in an error."""
    with_clock, alone = (
        mbs.simulate.run(system, 0.95, q0={"z": 0.3}, tolerance=1e-9, quiet=True)
        for system in (mass(ground, Clock("clock")), mass(ground))
    )
    assert ticks(with_clock) == 9
    assert alone.events == ()
    # tolerance of 1e-9, times what five bounces magnify
    assert with_clock["z.q"] == pytest.approx(alone["z.q"], abs=1e-6)


def test_beside_rigid_stops():
    system = mass(RigidStop("stop", "z", lower=-0.5, restitution=0.5), Clock("clock"))
    assert ticks(mbs.simulate.run(system, 0.95, quiet=True)) == 9


def test_beside_a_rolling_disc():
    """No event happened, unsaid."""
    m = mbs.Mechanism("m", gravity=(0, 0, -9.81))
    wheel = m.add(Body("wheel", mass=1.0, inertia=(0.01, 0.02, 0.01)))
    m.connect(m.world, Free("free"), wheel)
    m.connect(m.world, RollingDisc("disc", radius=0.3, normal="z", axis="y"), wheel)
    m.add(Clock("clock"))
    system = m.assemble(guess={"free.z": 0.3})
    assert ticks(mbs.simulate.run(system, 0.95, quiet=True)) == 9


def test_in_segments_of_over_constrained_loops(monkeypatch):
    """Rows are chosen again if no passage is possible: each segment has its events."""
    m = mbs.load("bricard")
    m.add(Clock("clock"))
    system = m.assemble()
    assert system.closure.varies
    whole = mbs.simulate.run(system, 0.95, tolerance=1e-9, quiet=True)
    module = sys.modules["mbs.simulate.simulator"]
    full = module.full_state

    def without_passage(*args, **options):
        return replace(full(*args, **options), passage=None)

    monkeypatch.setattr(module, "full_state", without_passage)
    segments = mbs.simulate.run(system, 0.95, tolerance=1e-9, quiet=True)
    assert ticks(whole) == ticks(segments) == 9
    name = system.coordinates[0].name
    assert segments[f"{name}.q"] == pytest.approx(whole[f"{name}.q"], abs=1e-6)  # tolerance of 1e-9


def test_what_does_not_settle_is_named():
    class Stuck(Custom):
        x = custom.state(start=-1.0)

        def rates(self, at):
            return {"x": -1.0}

        def events(self, at):
            return {"again": custom.Event(at.x, {"x": at.x - 1})}

    told = ("do not settle", "it concerns stuck, again")
    refused(SolverError, *told, by=lambda: mbs.simulate.run(mass(Stuck("stuck")), 1.0, quiet=True))


def test_an_event_that_sets_no_dict():
    class Empty(Custom):
        x = custom.state()

        def rates(self, at):
            return {"x": 1.0}

        def events(self, at):
            return {"none": custom.Event(1 - at.x, None)}

    refused(AssemblyError, "e (Empty)", "'none'", "give a dict", by=lambda: mass(Empty("e")))
