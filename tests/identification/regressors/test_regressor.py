"""The dynamic identification model against inverse dynamics, and its operations."""

import casadi
import numpy as np
import pytest
from support.catalogue_systems import catalogue_system
from support.regressor_states import CLOSED, OPEN, ROTORS, TREES, moving, state_of, system_of
from symbolic_robots import ROBOTS, symbolic_robot

import mbs
import mbs.export
import mbs.models
from mbs import Mechanism
from mbs.components import (
    Body,
    ElasticGear,
    Force,
    IdealGear,
    Revolute,
    ShaftInertia,
)
from mbs.errors import ModelError
from mbs.identification import (
    Column,
    base_parameters,
    columns_of,
    energy_regressor,
    filtered_regressor,
    known_efforts,
    numeric_parameters,
    power_regressor,
    regressor,
)
from mbs.operations import count, simplify

BOUNDS = {
    "general_6r": "904/690",
    "puma560": "411/330",
    "rx90": "365/293",
    "iiwa": "656/511",
    "stanford": "341/271",
    "sr400_tree": "459/373",
}
"""Multiplications and additions for the ten parameters of every link; lengths are symbols."""


def error(system, coordinates="independent", seed=0):
    D = regressor(system, coordinates=coordinates)
    state = state_of(system, seed)
    K = numeric_parameters(system, D.columns)
    tau = np.array(mbs.models.inverse_dynamics(system, coordinates)(*state)).ravel()
    known = np.array(known_efforts(system, coordinates)(*state[:2])).ravel()
    found = np.array(D(*state)) @ K + known
    return np.abs(found - tau).max() / np.abs(tau).max()


@pytest.mark.sweep
@pytest.mark.parametrize("name", [*OPEN, *CLOSED, *TREES, *ROTORS])
def test_efforts_of_inverse_dynamics(name):
    assert error(system_of(name)) < 1e-12


@pytest.mark.parametrize("name", ["sr400", "five_bar"])
def test_tree_coordinates_of_a_closed_system(name):
    system = system_of(name)
    rng = np.random.default_rng(3)
    v, a = rng.normal(size=(2, system.nv))
    D = regressor(system, coordinates="tree")
    tau = np.array(mbs.models.inverse_dynamics(system, "tree")(system.configuration, v, a)).ravel()
    found = np.array(D(system.configuration, v, a)) @ numeric_parameters(system, D.columns)
    assert np.abs(found - tau).max() < 1e-12 * np.abs(tau).max()


def test_reduced_columns_are_those_of_the_tree():
    system = system_of("sr400")
    q, v, a = state_of(system)
    G = np.array(mbs.loops.reduction_matrix(system)(q))
    D, tree = regressor(system), regressor(system, coordinates="tree")
    rest = np.array(D(q, 0 * v, a))
    assert np.allclose(rest, G.T @ np.array(tree(q, 0 * (G @ v), G @ a)), atol=1e-12)


def driven_pair():
    """Joints driven through a rigid and an elastic gear, with springs and a force."""
    m = Mechanism("driven_pair", gravity=(0, -9.81, 1))
    one, two = m.add(Body("one", mass=1, com=(1, 0, 0))), m.add(Body("two", mass=2, com=(0, 1, 1)))
    first, second = Revolute("j1", stiffness=3, Fv=0.1), Revolute("j2", axis="x", Fs=0.4)
    m.connect(m.world, first, one)
    m.connect(one.at(1, 0, 0), second, two)
    stiff, soft = IdealGear("stiff", ratio=20), ElasticGear("soft", 50.0, 0.5, ratio=10)
    m.connect(stiff.flange_b, first.flange)
    m.connect(ShaftInertia("fast", 1e-2).flange_a, stiff.flange_a)
    m.connect(soft.flange_b, second.flange)
    m.connect(ShaftInertia("loose", 1e-2).flange_a, soft.flange_a)
    m.add(Force("push", two.at(0, 1, 0), force=(1, 2, 3)))
    return m.assemble()


def test_drive_lines_springs_and_forces_are_known_efforts():
    system = driven_pair()
    assert error(system) < 1e-12
    still = np.array(known_efforts(system)(*state_of(system)[:2])).ravel()
    assert np.abs(still).max() > 0.1


def test_offset_columns_are_ones():
    system = system_of("puma560")
    D = regressor(system, offsets=True)
    matrix = np.array(D(*state_of(system)))
    offsets = [k for k, name in enumerate(D.names) if name.startswith("offset")]
    assert np.array_equal(matrix[:, offsets], np.eye(6))


def test_a_coupled_motor_turns_with_both_joints():
    system = system_of("puma560")
    D = regressor(system, couplings=[("q6", "q5")])
    q, v, a = state_of(system)
    matrix = np.array(D(q, v, a))[:, -3:]
    width = float(system.tree.links[5].Fs_width)
    row = [a[4] + a[5], v[4] + v[5], np.tanh((v[4] + v[5]) / width)]
    assert np.allclose(matrix[4:], [row, row], rtol=0, atol=1e-14)
    assert not matrix[:4].any()


def test_columns_without_effect_are_zero_by_structure():
    D = regressor(system_of("puma560"), rotors=False, friction=False)
    silent = [name for name, acts in zip(D.names, D.effective, strict=True) if not acts]
    assert silent == ["XX1", "XY1", "XZ1", "YY1", "YZ1", "MX1", "MY1", "MZ1", "M1"]


def test_a_link_moves_no_joint_behind_it():
    system = system_of("two_branch_tree")
    D = regressor(system)
    matrix = np.array(D(*state_of(system)))
    for j in range(len(system.tree.links)):
        mine = [k for k, c in enumerate(D.columns) if c.link == j + 1]
        others = [row for row in range(system.nv) if row not in system.tree.path(j)]
        assert not matrix[np.ix_(others, mine)].any()


@pytest.mark.parametrize("name", ROBOTS)
def test_it_takes_no_more_operations(name):
    found = count(regressor(symbolic_robot(name).assemble(), rotors=False, friction=False))
    mul, add = (int(part) for part in BOUNDS[name].split("/"))
    assert (found.mul + found.div <= mul, found.add <= add) == (True, True), str(found)


def test_simplified_it_keeps_its_columns():
    system = system_of("scara")
    D = regressor(system)
    shorter = simplify(D)
    assert shorter.names == D.names
    state = state_of(system)
    assert np.allclose(np.array(shorter(*state)), np.array(D(*state)), atol=1e-12)


def test_it_maps_over_samples():
    system = system_of("scara")
    D = regressor(system)
    states = [state_of(system, seed) for seed in range(5)]
    q, v, a = (np.column_stack(part) for part in zip(*states, strict=True))
    many = np.array(D.map(5)(q, v, a))
    each = np.hstack([np.array(D(*state)) for state in states])
    assert np.allclose(many, each, rtol=0, atol=1e-14)


def test_exported_elements_are_named_by_their_columns():
    text = mbs.export.code(regressor(system_of("scara")), "c")
    assert "D1_ZZ2 = " in text
    assert "D2_MX3 = " in text


def test_derivatives_go_through_it():
    system = system_of("scara")
    D = regressor(system)
    q, v, a = (casadi.SX.sym(name, system.nv) for name in "qva")
    slope = casadi.Function("slope", [q, v, a], [casadi.jacobian(casadi.vec(D(q, v, a)), a)])
    K = numeric_parameters(system, D.columns)
    state = state_of(system)
    A = np.array(mbs.models.inertia_matrix(system)(state[0]))
    found = np.array(slope(*state)).reshape(len(K), system.nv, -1).transpose(1, 0, 2)
    assert np.allclose(np.einsum("ikj,k->ij", found, K), A, atol=1e-12)


def test_coordinates_must_be_known():
    with pytest.raises(ModelError, match="use 'independent' or 'tree'"):
        regressor(system_of("sr400"), coordinates="joint")


def test_columns_follow_the_options():
    system = system_of("puma560")
    assert regressor(system, friction=False).columns == columns_of(system, friction=False)


MOVING = ("puma560", "two_branch_tree", "four_bar", "ball_base", "turret")


@pytest.mark.parametrize("name", MOVING)
def test_efforts_on_a_base_that_moves(name):
    system, base = moving(name)
    state = state_of(system)
    D = regressor(system, moving_base=True)
    tau = np.array(mbs.models.inverse_dynamics(system, moving_base=True)(*state, *base)).ravel()
    found = np.array(D(*state, *base)) @ numeric_parameters(system, D.columns)
    still = np.array(regressor(system)(*state)) @ numeric_parameters(system, D.columns)
    assert np.abs(found - tau).max() < 1e-12 * np.abs(tau).max()
    assert np.abs(still - tau).max() > 1e-2 * np.abs(tau).max()


def test_base_parameters_have_columns_of_their_own():
    system = system_of("puma560")
    base = base_parameters(system)
    D = regressor(system, base.columns_in_base)
    assert D.names == base.names
    assert "ZZ1R" in D.names
    state = state_of(system)
    tau = np.array(regressor(system)(*state)) @ numeric_parameters(system, base.columns)
    found = np.array(D(*state)) @ (base.matrix @ numeric_parameters(system, base.columns))
    assert np.abs(found - tau).max() < 1e-11 * np.abs(tau).max()
    assert count(D).total < count(regressor(system)).total


def test_columns_in_any_order_and_number():
    system = system_of("scara")
    every = regressor(system)
    few = [every.columns[k] for k in (20, 3, 12)]
    state = state_of(system)
    found = np.array(regressor(system, few)(*state))
    assert np.array_equal(found, np.array(every(*state))[:, [20, 3, 12]])


@pytest.mark.parametrize(
    ("columns", "options", "told"),
    [
        ([Column("M7", "M", 7, "kg")], {}, "'M7' is no parameter of the system; use one of"),
        ([Column("Jm1", "Jm", 1, "kg.m2")], {}, "'Jm1' is no parameter of the system"),
        ([Column("M1", "M", 1, "kg")] * 2, {}, "'M1' is given twice"),
        ([Column("M1", "M", 1, "kg")], {"friction": False}, "columns were given and 'friction'"),
    ],
)
def test_columns_must_be_those_of_the_system(columns, options, told):
    with pytest.raises(ModelError, match=told):
        regressor(system_of("puma560"), columns, **options)


@pytest.mark.parametrize(
    "build", [regressor, filtered_regressor, energy_regressor, power_regressor]
)
def test_the_same_call_gives_the_same_function(build):
    system = system_of("planar_2r")
    made = build(system)
    assert build(system) is made
    assert build(system, columns_of(system)) is made
    assert build(system, friction=False) is not made
    assert build(catalogue_system("planar_2r")) is not made
