"""A start or a guess that looks like degrees gets a note in reports, results and errors."""

import numpy as np
import pytest

import mbs
from mbs.assembly.variable_names import like_degrees
from mbs.components import PointMass, Prismatic, Revolute
from mbs.errors import Unclosable

NOTE = "rad may be degrees; give radians"


def pendulum(limits=None):
    m = mbs.Mechanism("pendulum", gravity=(0, 0, -9.81))
    slide = m.add(PointMass("cart", mass=1.0))
    m.connect(m.world, Prismatic("x", axis="x"), slide)
    m.connect(slide, Revolute("j", axis="y", limits=limits), m.add(PointMass("b", mass=1)).at(1))
    return m


@pytest.mark.parametrize(
    ("limits", "angle", "noted"),
    [
        (None, 19.0, False),
        (None, 45.0, True),
        (None, -90.0, True),
        ((-3.0, 3.0), 6.2, False),
        ((-3.0, 3.0), 6.4, True),
        ((-9.0, 9.0), 8.0, False),
        ((-90.0, 90.0), 45.0, False),
    ],
)
def test_note_of_an_angle(limits, angle, noted):
    mechanism = pendulum(limits)
    system = mechanism.assemble()
    expected = f"j = {angle:g} {NOTE}" if noted else ""
    assert like_degrees(system.coordinates, {"j": angle}) == expected
    for q0 in ({"j": angle}, {"j.q": angle, "x": 50.0}, [50.0, angle], np.array([50.0, angle])):
        assert mbs.simulate.run(system, 0.1, q0=q0).info.get("note", "") == expected
    guessed = mechanism.assemble(guess={"j": angle, "x": 50.0})
    assert (f"Note: {expected}." in guessed.report()) == noted
    assert "Note" not in system.report()


def test_a_motion_that_goes_on_after_many_revolutions_has_no_note():
    system = pendulum().assemble()
    first = mbs.simulate.run(system, 1.0, v0={"j": 60.0})
    assert first["j.q"][-1] > 20
    assert "note" not in mbs.simulate.run(system, 0.1, q0=first).info


def test_notes_of_a_closed_system():
    report = mbs.robots.four_bar().assemble(guess={"j2": 45.0}).report()
    assert f"Note: j2 = 45 {NOTE}." in report
    system = mbs.robots.four_bar().assemble()
    result = mbs.simulate.run(system, 0.1, q0={"j1": 0.3}, guess={"j2": 45.0})
    assert result.info["note"] == f"j2 = 45 {NOTE}"


def test_errors_have_the_note():
    system = mbs.robots.four_bar().assemble()
    with pytest.raises(Unclosable, match=f"j4 = 45 {NOTE}"):
        mbs.loops.solve(system, {"j4": 45.0})
