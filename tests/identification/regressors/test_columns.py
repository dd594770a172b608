"""Names, units and values of dynamic parameters."""

import pytest
from support.regressor_states import system_of

import mbs
from mbs import Mechanism
from mbs.components import Body, Prismatic, Revolute
from mbs.errors import ModelError
from mbs.identification import (
    Column,
    base_parameters,
    columns_of,
    numeric_parameters,
    regressor,
    symbolic_parameters,
)


def names(system, **options):
    return [column.name for column in columns_of(system, **options)]


def cart():
    m = Mechanism("cart", gravity=(0, -9.81, 0))
    car = m.add(Body("car", mass=3))
    pole = m.add(Body("pole", mass=2, com=(0, 0.5, 0)))
    m.connect(m.world, Prismatic("x", axis="x", Ia=0.5, Fv=0.1, Fs=0.2, actuated=True), car)
    m.connect(car, Revolute("theta", actuated=False), pole)
    return m.assemble()


def test_ten_parameters_then_rotor_friction_offset():
    ten = ["XX1", "XY1", "XZ1", "YY1", "YZ1", "ZZ1", "MX1", "MY1", "MZ1", "M1"]
    first = names(system_of("puma560"), offsets=True)[:14]
    assert first == [*ten, "Ia1", "Fv1", "Fs1", "offset1"]


def test_passive_joints_have_no_rotor():
    found = names(cart())
    assert "Ia1" in found
    assert "Ia2" not in found
    assert "Fv2" in found


def test_groups_can_be_left_out():
    puma = system_of("puma560")
    assert len(names(puma)) == 6 * 13
    assert len(names(puma, rotors=False)) == 6 * 12
    assert len(names(puma, friction=False)) == 6 * 11
    assert len(names(puma, rotors=False, friction=False)) == 60


def test_units_follow_the_joint():
    units = {column.name: column.unit for column in columns_of(cart(), offsets=True)}
    assert [units[name] for name in ("XX1", "MX1", "M1")] == ["kg.m2", "kg.m", "kg"]
    assert [units[f"{kind}1"] for kind in ("Ia", "Fv", "Fs", "offset")] == ["kg", "N.s/m", "N", "N"]
    assert [units[f"{kind}2"] for kind in ("Fv", "Fs")] == ["N.m.s/rad", "N.m"]


def test_values_are_those_of_the_system():
    system = cart()
    columns = columns_of(system, offsets=True)
    found = dict(zip((c.name for c in columns), numeric_parameters(system, columns), strict=True))
    assert [found[name] for name in ("M1", "Ia1", "Fv1", "Fs1")] == [3, 0.5, 0.1, 0.2]
    assert found["M2"] == 2
    assert found["MX2"] ** 2 + found["MY2"] ** 2 == pytest.approx(1.0)
    assert found["offset1"] == found["offset2"] == 0


def test_values_keep_symbols():
    m = Mechanism("pendulum")
    m.connect(m.world, Revolute("j"), m.add(Body("b", mass="m_b", com=(1, 0, 0))))
    system = m.assemble()
    columns = columns_of(system, rotors=False, friction=False)
    assert str(symbolic_parameters(system, columns)[9]) == "m_b"


def test_rotor_that_spins_with_a_joint_has_a_column():
    found = names(system_of("free_base"))
    assert "Jm2" in found
    assert "Ia2" in found  # given beside the rotor
    assert "Ia3" not in found
    assert "Fv1" not in found  # a free joint without friction


def test_coupling_is_a_pair_of_joints():
    puma = system_of("puma560")
    last = columns_of(puma, couplings=[("q6", "q5")])[-3:]
    assert [column.name for column in last] == ["Iam6", "Fvm6", "Fsm6"]
    assert last[0] == Column("Iam6", "Iam", 6, "kg.m2", 5)
    assert columns_of(puma, couplings=[(6, 5)])[-3:] == last


@pytest.mark.parametrize(
    ("pair", "message"),
    [
        (("q6", "q7"), "puma560: the coupling names 'q7', which is no joint"),
        (("q6", "q6"), "name two joints that are both revolute or both prismatic"),
        (("q6",), "does not name two joints"),
        (("q6", 0), "the coupling names 0"),
    ],
)
def test_coupling_must_name_two_joints(pair, message):
    with pytest.raises(ModelError, match=message):
        columns_of(system_of("puma560"), couplings=[pair])


def test_a_mechanism_is_no_system():
    with pytest.raises(ModelError, match="is not a System"):
        columns_of(mbs.robots.puma560())


@pytest.mark.parametrize("columns", [["XX1"], "XX1", ("q1",)])
def test_names_in_place_of_columns_are_refused(columns):
    with pytest.raises(ModelError, match=r"columns holds '\w+', which is no Column; give those"):
        regressor(cart(), columns=columns)
    with pytest.raises(ModelError, match="no Column"):
        base_parameters(cart(), columns=columns)
