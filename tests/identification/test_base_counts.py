"""Numbers of base parameters of robots, against ranks that are known."""

import pytest
from support.base_counts import OPEN
from support.base_robots import system

import mbs
from mbs.identification.base_parameters import base_parameters
from mbs.identification.columns import columns_of

CHOICES = ({"rotors": False, "friction": False}, {"friction": False}, {})


@pytest.mark.parametrize("name", OPEN)
def test_counts_of_inertial_parameters_then_rotors_then_friction(name):
    frames, gravity, expected = OPEN[name]
    robot = system(name, frames, gravity)
    found = [base_parameters(robot, columns=columns_of(robot, **only)) for only in CHOICES]
    assert tuple(base.count for base in found) == expected
    assert all(base.check.agrees and base.check.rank == base.count for base in found)


@pytest.mark.parametrize(
    ("name", "expected"),
    [("puma560", 52), ("rx90", 52), ("stanford", 49), ("scara", 19), ("panda", 62)],
)
def test_counts_of_the_catalogue(name, expected):
    robot = mbs.load(name).assemble()
    base, ranked = base_parameters(robot), base_parameters(robot, "numeric")
    assert base.count == ranked.count == base.check.rank == expected
    assert base.names == tuple(
        f"{c.name}R" if n.endswith("R") else c.name
        for c, n in zip(ranked.kept, ranked.names, strict=True)
    )


def test_a_floating_base_keeps_its_own_ten_parameters():
    robot = mbs.Mechanism("floating", gravity=(0, 0, -9.81))
    hull = robot.add(
        mbs.components.Body("hull", mass=3, com=(0.1, 0, 0), inertia=(1, 0, 0, 1, 0, 1))
    )
    arm = robot.add(mbs.components.Body("arm", mass=1, com=(0.2, 0, 0), inertia=(1, 0, 0, 1, 0, 1)))
    robot.connect(robot.world, mbs.components.Free("free"), hull)
    robot.connect(hull.at(0.3, 0, 0), mbs.components.Revolute("joint", axis="y"), arm)
    base = base_parameters(robot.assemble())
    own = [column.kind for column in base.kept if column.link == 1]
    assert set(own) >= {"XX", "XY", "XZ", "YY", "YZ", "ZZ", "MX", "MY", "MZ", "M"}
    assert base.count == base.check.rank == 20


@pytest.mark.parametrize(("name", "expected"), [("scara", 37), ("puma560", 60)])
def test_a_base_that_moves_does_not_inherit_the_set_of_a_resting_one(name, expected):
    base = base_parameters(mbs.load(name).assemble(), moving_base=True)
    assert base.count == base.check.rank == expected
    assert base.check.error < 1e-12
