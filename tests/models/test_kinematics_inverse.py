"""Inverse, determinant and singular factors of Jacobians against numpy."""

import casadi
import numpy as np
import pytest
from casadi import SX
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from support.catalogue_systems import catalogue_system
from support.closed_mechanisms import closed_chain, planar_loop
from support.messages import refused
from support.random_trees import ALL_KINDS, random_state, random_tree
from symbolic_robots import symbolic_robot

import mbs
import mbs.loops
from mbs.errors import ModelError
from mbs.models import (
    inverse_differential_kinematics,
    inverse_jacobian,
    jacobian,
    jacobian_determinant,
    singularities,
)
from mbs.operations import count
from mbs.recursions.jacobian import VelocityTarget
from mbs.recursions.square_jacobian import square_jacobian

COMMON = dict(deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
ARMS = ("puma560", "rx90", "stanford")


@pytest.mark.sweep
@pytest.mark.parametrize("axes", ["base", 3, 6])
@pytest.mark.parametrize("name", ARMS)
def test_arm(name, axes):
    system = catalogue_system(name)
    rng = np.random.default_rng(1)
    for _ in range(4):
        q, v = rng.uniform(-2, 2, (2, 6))
        J = np.array(jacobian(system, 6, expressed_in=axes)(q))
        inverse = np.array(inverse_jacobian(system, 6, expressed_in=axes)(q))
        np.testing.assert_allclose(inverse @ J, np.eye(6), rtol=0, atol=1e-11)
        det = float(jacobian_determinant(system, 6, expressed_in=axes)(q))
        assert det == pytest.approx(np.linalg.det(J), rel=1e-11, abs=1e-13)
        back = inverse_differential_kinematics(system, 6, expressed_in=axes)(q, J @ v)
        np.testing.assert_allclose(np.array(back).ravel(), v, rtol=0, atol=1e-11)


@pytest.mark.parametrize(
    ("name", "sizes"),
    [
        ("puma560", [1, 1, 1, 1, 2]),
        ("rx90", [1] * 6),
        ("stanford", [1] * 6),
        ("general_6r", [1, 5]),
    ],
)
def test_blocks_of_an_arm_with_symbols(name, sizes):
    system = symbolic_robot(name, "none").assemble()
    target = VelocityTarget(
        system.tree, SX.sym("q", 6), system.p, system.frame(6), system.frame("base")
    )
    square = square_jacobian(target, range(6), range(6))
    assert sorted(block.size for block in square.blocks) == sizes


def test_operations_stay_few():
    most = {"puma560": (74, 34), "rx90": (59, 25), "stanford": (50, 17)}
    for name, (mul, add) in most.items():
        found = count(inverse_jacobian(symbolic_robot(name, "none").assemble(), 6))
        assert found.mul + found.div <= mul
        assert found.add <= add


@pytest.mark.parametrize(
    ("name", "constant", "factors"),
    [
        ("puma560", "-D3", {"D4*C23 + RL4*S23 + D3*C2", "D4*S3 - RL4*C3", "S5"}),
        ("rx90", "-D3*RL4", {"RL4*S23 - D3*C2", "C3", "S5"}),
        ("stanford", "1", {"S2", "q3^2", "S5"}),
    ],
)
def test_factors_of_an_arm_with_symbols(name, constant, factors):
    found = singularities(symbolic_robot(name, "none").assemble(), 6)
    assert found.constant == constant
    assert {str(factor) for factor in found.factors} == factors
    assert str(found).startswith(f"({constant}) * (")


@pytest.mark.parametrize(
    ("name", "configuration", "vanish"),
    [
        ("rx90", {"q3": np.pi / 2}, {"C3", "S23 - C2"}),
        ("rx90", {"q5": 0.0}, {"S5"}),
        ("rx90", {"q2": 1.0, "q3": np.arcsin(np.cos(1.0)) - 1.0}, {"S23 - C2"}),
        ("stanford", {"q2": 0.0}, {"S2"}),
        ("stanford", {"q3": 0.0}, {"q3"}),
        ("puma560", {"q3": np.arctan2(-0.4331, 0.0203)}, {"0.0203*S3 + 0.4331*C3"}),
    ],
)
def test_singular_configuration_is_where_a_factor_vanishes(name, configuration, vanish):
    system = catalogue_system(name)
    q = np.array(system.position({f"q{k}": 0.3 + 0.2 * k for k in range(1, 7)} | configuration))
    factors = singularities(system, 6).factors
    assert {f.text for f in factors if abs(float(f.function(q))) < 1e-12} == vanish
    singular = np.linalg.svd(np.array(jacobian(system, 6)(q)), compute_uv=False)
    assert singular[-1] < 1e-12


def test_inverse_at_a_singular_configuration_is_refused():
    system = catalogue_system("rx90")
    with pytest.raises(ModelError, match="the configuration is singular"):
        inverse_jacobian(system, 6)([0.1, 0.2, 0.3, 0.4, 0.0, 0.6])


@pytest.mark.parametrize("name", [*ARMS, "scara"])
def test_product_of_factors_is_the_determinant(name):
    system = catalogue_system(name)
    n = system.nv
    rows = None if n == 6 else [0, 1, 2, 5]
    found = singularities(system, n, rows=rows)
    rng = np.random.default_rng(2)
    for _ in range(5):
        q = rng.uniform(-2, 2, n)
        J = np.array(jacobian(system, n)(q))[rows or range(6)]
        values = [float(factor.function(q)) ** factor.power for factor in found.factors]
        expected = float(found.constant) * np.prod(values)
        assert np.linalg.det(J) == pytest.approx(expected, rel=1e-9, abs=1e-14)
        assert float(found.determinant(q)) == pytest.approx(expected, rel=1e-9, abs=1e-14)


def test_arm_without_structure_has_one_factor():
    found = singularities(symbolic_robot("general_6r", "none").assemble(), 6)
    (factor,) = found.factors
    assert factor.text == "determinant of the 5 x 5 block of q1, q2, q3, q5, q6"
    q = np.linspace(-1, 2, 6)
    ratio = float(found.determinant(q)) / float(factor.function(q))
    assert ratio == pytest.approx(float(found.constant), rel=1e-12)


@settings(max_examples=8, **COMMON)
@given(st.integers(0, 10**6), st.integers(1, 6), st.booleans())
def test_any_part_of_a_random_tree(seed, size, aligned):
    kinds = (*ALL_KINDS, "revolute", "prismatic")
    system = random_tree(seed, n=5, kinds=kinds, aligned=aligned).mechanism.assemble()
    rng = np.random.default_rng(seed)
    q, _, _ = random_state(system, rng)
    names = [row.name for row in system.bodies]
    name, axes = names[-1], rng.choice(["base", *names])
    path = system.tree.path(system.frame(name)[0])
    moving = [k for j in path for k in range(system.nv)[system.tree.links[j].v]]
    size = min(size, len(moving), 6)
    rows = rng.choice(6, size, replace=False).tolist()
    columns = rng.choice(moving, size, replace=False).tolist()
    part = np.array(jacobian(system, name, expressed_in=axes)(q))[np.ix_(rows, columns)]
    det = float(jacobian_determinant(system, name, rows, columns, expressed_in=axes)(q))
    scale = max(1.0, np.abs(part).max()) ** size
    assert det == pytest.approx(np.linalg.det(part), rel=1e-9, abs=1e-12 * scale)
    found = singularities(system, name, rows, columns, expressed_in=axes)
    if found.constant == "0":
        assert abs(det) < 1e-11 * scale
        with pytest.raises(ModelError, match="are singular in every configuration"):
            inverse_jacobian(system, name, rows, columns, expressed_in=axes)
        return
    values = [float(factor.function(q)) ** factor.power for factor in found.factors]
    product = float(found.constant) * np.prod(values)
    assert det == pytest.approx(product, rel=1e-6, abs=1e-9 * scale)
    condition = np.linalg.cond(part)
    if condition < 1e6:
        inverse = np.array(inverse_jacobian(system, name, rows, columns, expressed_in=axes)(q))
        np.testing.assert_allclose(inverse @ part, np.eye(size), rtol=0, atol=1e-13 * condition**2)


def test_part_of_a_closed_system():
    mechanism, guess = closed_chain(3, "universal")
    system = mechanism.assemble(guess=guess)
    q, m = np.array(system.configuration), len(system.independent)
    name, rows = system.bodies[3].name, [1, 3, 5, 0][:m]
    J = np.array(jacobian(system, name)(q))[rows]
    det = float(jacobian_determinant(system, name, rows)(q))
    assert det == pytest.approx(np.linalg.det(J), rel=1e-9, abs=1e-12)
    inverse = np.array(inverse_jacobian(system, name, rows)(q))
    np.testing.assert_allclose(inverse @ J, np.eye(m), rtol=0, atol=1e-8)
    columns = list(range(m))
    tree = np.array(jacobian(system, name, coordinates="tree")(q))[np.ix_(rows, columns)]
    det = jacobian_determinant(system, name, rows, columns, coordinates="tree")(q)
    assert float(det) == pytest.approx(np.linalg.det(tree), rel=1e-9, abs=1e-12)


def test_wrist_of_a_robot_with_a_parallelogram_separates():
    system = catalogue_system("sr400")
    motors = {"q1": 0.3, "q2": -1.2, "q4": 0.2, "q5": 0.7, "q6": 0.4, "q7": 0.3}
    q = np.array(mbs.loops.solve(system, motors)).ravel()
    J = np.array(jacobian(system, 6)(q))
    found = singularities(system, 6)
    assert "S5" in {factor.text for factor in found.factors}
    values = [float(factor.function(q)) for factor in found.factors]
    assert np.linalg.det(J) == pytest.approx(float(found.constant) * np.prod(values), rel=1e-10)
    inverse = np.array(inverse_jacobian(system, 6)(q))
    np.testing.assert_allclose(inverse @ J, np.eye(6), rtol=0, atol=1e-11)


def test_planar_loop():
    mechanism, guess = planar_loop(1)
    system = mechanism.assemble(guess=guess)
    q = np.array(system.configuration)
    name = system.bodies[1].name
    J = np.array(jacobian(system, name)(q))[[0, 5]]
    inverse = np.array(inverse_jacobian(system, name, rows=["Vx", "wz"])(q))
    np.testing.assert_allclose(inverse, np.linalg.inv(J), rtol=1e-9, atol=1e-11)
    refused(
        ModelError,
        "rows 2, 5 and columns",
        "singular in every configuration; name other rows or columns",
        by=lambda: inverse_jacobian(system, name, rows=["Vz", "wz"]),
    )


def test_functions_are_named_cached_and_differentiable():
    system = catalogue_system("rx90")
    f = inverse_jacobian(system, 6)
    assert (f.name(), f.name_in(), f.name_out()) == ("inverse_jacobian", ["q"], ["J_inv"])
    assert inverse_jacobian(system, 6, rows=range(6)) is f
    ikm = inverse_differential_kinematics(system, 6)
    assert (ikm.name(), ikm.name_in()) == ("ikm", ["q", "twist"])
    det = jacobian_determinant(system, 6)
    assert (det.name(), det.name_out()) == ("determinant", ["det"])
    assert singularities(system, 6).determinant is det
    x = SX.sym("x", 6)
    slope = casadi.Function("g", [x], [casadi.gradient(det(x), x)])(np.ones(6))
    assert np.all(np.isfinite(np.array(slope)))


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        ({"rows": [0, 1]}, ["has 2 rows and 6 columns", "name as many rows=[...] of 0 to 5"]),
        ({"rows": [0, 1, 2, 3, 4, 6]}, ["there is no row 6", "rows are numbers 0 to 5"]),
        ({"rows": [-1], "columns": [0]}, ["there is no row -1"]),
        ({"rows": [0.5], "columns": [0]}, ["there is no row 0.5"]),
        ({"rows": [True], "columns": [0]}, ["there is no row True"]),
        ({"rows": ["Vq"], "columns": [0]}, ["there is no row 'Vq'", "Vx"]),
        ({"rows": [0, 0], "columns": [0, 1]}, ["row Vx was named twice"]),
        ({"rows": [0, 1], "columns": [0, 9]}, ["there is no column 9", "numbers 0 to 5"]),
        ({"rows": [0], "columns": ["q9"]}, ["there is no column 'q9'"]),
        ({"rows": [], "columns": []}, ["no rows were named"]),
        ({"frame": "tol"}, ["there is no frame 'tol'"]),
        ({"expressed_in": 12}, ["there is no link 12"]),
        ({"coordinates": "all"}, ["coordinates is 'all'"]),
        ({"frame": "base"}, ["has 6 rows and 0 columns"]),
    ],
)
@pytest.mark.parametrize(
    "model",
    [inverse_jacobian, inverse_differential_kinematics, jacobian_determinant, singularities],
)
def test_wrong_arguments_are_refused(model, arguments, parts):
    system = catalogue_system("rx90")
    refused(ModelError, *parts, by=lambda: model(system, **{"frame": 6, **arguments}))


def test_rows_and_columns_by_name():
    system = catalogue_system("rx90")
    named = jacobian_determinant(system, 6, rows=["Vx", "wz"], columns=["q2", "q1"])
    assert named is jacobian_determinant(system, 6, rows=[0, 5], columns=[1, 0])
    q = np.linspace(0, 1, 6)
    J = np.array(jacobian(system, 6)(q))[np.ix_([0, 5], [1, 0])]
    assert float(named(q)) == pytest.approx(np.linalg.det(J), rel=1e-12)
