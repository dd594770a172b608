import numpy as np
import pytest
from support.measured_arm import arm, noisy_record

import mbs
from mbs.components import Body, Revolute
from mbs.identification import columns_of, identify, numeric_parameters
from mbs.identification.bodies import bodies_table, body_values

CENTRE = (0.1, -0.2, 0.3)
INERTIA = (0.3, 0.4, 0.5)


def turned_arm():
    """Two bodies behind joints about x and y."""
    m = mbs.Mechanism("turned")
    first = m.add(Body("first", mass=2, com=CENTRE, inertia=INERTIA))
    second = m.add(Body("second", mass=3, com=CENTRE, inertia=INERTIA))
    m.connect(m.world, Revolute("j1", axis="x"), first)
    m.connect(first.at(0.5, 0.1), Revolute("j2", axis="y"), second)
    return m


def test_bodies_are_told_in_their_own_frames():
    system = turned_arm().assemble()
    columns = columns_of(system)
    rows = body_values(system, columns, numeric_parameters(system, columns))
    assert [row.name for row in rows] == ["first", "second"]
    for row, mass in zip(rows, (2, 3), strict=True):
        assert row.mass == pytest.approx(mass)
        assert row.centre == pytest.approx(np.array(CENTRE))
        assert row.inertia == pytest.approx(np.diag(INERTIA))
    lines = bodies_table(system, columns, numeric_parameters(system, columns)).splitlines()
    assert lines[2].split()[:5] == ["first", "2", "0.1", "-0.2", "0.3"]


def test_each_column_of_the_table_has_its_element():
    """Three moments and three products of inertia that all differ, with their signs."""
    m = mbs.Mechanism("skew")
    inertia = [[0.3, 0.01, -0.02], [0.01, 0.4, 0.03], [-0.02, 0.03, 0.5]]
    body = m.add(Body("body", mass=2, com=CENTRE, inertia=inertia))
    m.connect(m.world, Revolute("j1", axis="x"), body)
    system = m.assemble()
    columns = columns_of(system)
    lines = bodies_table(system, columns, numeric_parameters(system, columns)).splitlines()
    heads, (name, *values) = lines[1].split(), lines[2].split()
    assert heads == ["body", "mass", "x", "y", "z", "Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz"]
    assert name == "body"
    assert values == ["2", "0.1", "-0.2", "0.3", "0.3", "0.4", "0.5", "0.01", "-0.02", "0.03"]


def test_an_identification_has_the_table():
    found = identify(arm(), noisy_record(), 8.0, quiet=True)
    table = found.bodies_table()
    assert [line.split()[0] for line in table.splitlines()[2:]] == ["link1", "link2", "link3"]
    assert table in found.text()
