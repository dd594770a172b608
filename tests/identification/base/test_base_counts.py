"""Numbers of base parameters of robots, against ranks that are known."""

import numpy as np
import pytest
from support.base_counts import CATALOGUE, ELBOW, OBLIQUE, OPEN, TWO_ROOTS, under
from support.base_robots import system
from support.catalogue_systems import catalogue_system

import mbs
from mbs.identification import base_parameters, columns_of

CHOICES = ({"rotors": False, "friction": False}, {"friction": False}, {})


def counts(robot):
    """By rules, each the rank of the regressor; the last one by the numeric method too."""
    choices = [columns_of(robot, **only) for only in CHOICES]
    found = [base_parameters(robot, columns=columns) for columns in choices]
    assert all(base.check.agrees and base.check.rank == base.count for base in found)
    ranked = base_parameters(robot, "numeric", columns=choices[-1])
    assert ranked.kept == found[-1].kept
    assert ranked.matrix == pytest.approx(found[-1].matrix, abs=1e-9)
    return tuple(base.count for base in found)


@pytest.mark.sweep
@pytest.mark.parametrize("name", OPEN)
def test_counts_of_inertial_parameters_then_rotors_then_friction(name):
    frames, gravity, expected = OPEN[name]
    assert counts(system(name, frames, gravity)) == expected


@pytest.mark.sweep
@pytest.mark.parametrize("name", CATALOGUE)
def test_counts_of_the_catalogue(name):
    gravity, expected = CATALOGUE[name]
    robot = mbs.load(name.split("_")[0]).assemble()
    assert counts(robot if gravity is None else under(robot, gravity)) == expected


def test_a_tree_of_two_roots_has_the_sum_of_both():
    robot = system("two_roots", TWO_ROOTS, OBLIQUE)
    alone = [system("arm", rows, OBLIQUE) for rows in (TWO_ROOTS[:2], [TWO_ROOTS[2], ELBOW])]
    assert counts(robot) == tuple(np.sum([counts(arm) for arm in alone], axis=0))


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
    base = base_parameters(catalogue_system(name), moving_base=True)
    assert base.count == base.check.rank == expected
    assert base.check.error < 1e-12
