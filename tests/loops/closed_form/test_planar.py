"""Plane loops anywhere in space: every mode is found, closes, and has the right derivative."""

import casadi
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from support.catalogue_systems import catalogue_system
from support.configurations import active, same, searched
from support.flat_loops import flat_loop
from support.random_trees import random_body

from mbs import Mechanism
from mbs.components import (
    ConstantVelocity,
    Cylindrical,
    Planar,
    PointOnLine,
    Revolute,
    Spherical,
    Universal,
)
from mbs.errors import NoClosedForm
from mbs.loops import assembly_modes, function, reduction_matrix, solve
from mbs.loops.plan import plan

LOOPS = [
    ("RRRR", (0,)),
    ("RRRR", (1,)),
    ("RRRR", (3,)),
    ("RRRP", (0,)),
    ("RRRP", (3,)),
    ("PRRR", (2,)),
    ("RRPR", (0,)),
    ("RPRR", (3,)),
    ("RRPP", (0,)),
    ("RPRP", (2,)),
    ("PRPR", (0,)),
    ("RPPR", (3,)),
    ("RRRRR", (0, 2)),
    ("RRRRR", (0, 1)),
    ("RRPRR", (0, 4)),
    ("PRRRP", (0, 4)),
    ("RPRPR", (1, 4)),
    ("RRRRPR", (0, 2, 4)),
]
IDS = [f"{kinds}-{''.join(map(str, driven))}" for kinds, driven in LOOPS]


@pytest.fixture(params=list(enumerate(LOOPS)), ids=IDS)
def system(request):
    seed, (kinds, driven) = request.param
    return flat_loop(seed, kinds, driven).assemble()


@pytest.mark.sweep
def test_the_modes_are_those_that_a_search_finds(system):
    q_a = active(system)
    listed, found = assembly_modes(system, q_a), searched(system, q_a, starts=80)
    assert len(listed) == len(found) > 0
    for mode in listed:
        assert mode.residual < 1e-12
        assert any(same(system, mode.q, q) for q in found)
    assert len({mode.branch for mode in listed}) == len(listed)


@pytest.mark.sweep
def test_the_function_gives_every_mode(system):
    q_a = active(system)
    for mode in assembly_modes(system, q_a):
        q = np.array(function(system, mode.branch)(q_a)).ravel()
        np.testing.assert_allclose(q, mode.q, atol=1e-12)
        np.testing.assert_allclose(solve(system, q_a, branch=mode.branch), mode.q, atol=1e-12)


@pytest.mark.sweep
def test_the_assembled_branch_is_followed(system):
    rng = np.random.default_rng(1)
    assert same(system, np.array(function(system)(active(system))).ravel(), system.configuration)
    for _ in range(3):
        q_a = active(system) + rng.uniform(-0.03, 0.03, len(system.independent))
        q = np.array(function(system)(q_a)).ravel()
        assert same(system, q, solve(system, list(q_a)), 1e-8)


@pytest.mark.sweep
def test_the_first_and_second_derivatives(system):
    q_a = active(system)
    x = casadi.SX.sym("x", len(q_a))
    G_of = reduction_matrix(system)
    for mode in assembly_modes(system, q_a):
        q = function(system, mode.branch)(x)
        slope = casadi.jacobian(q, x)
        G = np.array(casadi.Function("G", [x], [slope])(q_a))
        np.testing.assert_allclose(G, np.array(G_of(list(mode.q))), rtol=1e-8, atol=1e-8)
        along = casadi.jtimes(slope, x, casadi.DM.ones(len(q_a)))
        second = np.array(casadi.Function("H", [x], [along])(q_a))
        h = 1e-6
        ahead, behind = (
            np.array(G_of(function(system, mode.branch)(q_a + s * h))) for s in (1, -1)
        )
        scale = max(1.0, np.abs(second).max())
        np.testing.assert_allclose(second, (ahead - behind) / (2 * h), atol=1e-6 * scale**2)


@pytest.mark.parametrize("closing", [Spherical, Cylindrical])
@pytest.mark.parametrize(
    ("kinds", "driven"), [("RRRR", (0,)), ("PRRR", (1,)), ("RPRR", (0,)), ("RRPR", (0,))]
)
def test_a_joint_with_more_freedom_closes_a_plane_loop(kinds, driven, closing):
    system = flat_loop(5, kinds, driven, closing).assemble()
    found = searched(system, active(system), starts=60)
    listed = assembly_modes(system, active(system))
    assert len(listed) == len(found) == 2
    assert all(any(same(system, mode.q, q) for q in found) for mode in listed)


def offset_loop(closing, links=2):
    """A four-bar, or one without its rocker, with offsets along its normal."""
    rng = np.random.default_rng(3)
    m = Mechanism("offset", guess={"j1": 1.0, "j2": -0.8, "j4": 1.2})
    crank, coupler, rocker = (m.add(random_body(rng, name)) for name in ("a", "b", "c"))
    m.connect(m.world, Revolute("j1", actuated=True), crank)
    m.connect(crank.at(0.4, 0, 0.1), Revolute("j2"), coupler)
    m.connect(m.world.at(0.9, 0, 0.3), Revolute("j4", actuated=links == 1 or None), rocker)
    m.connect(rocker.at(0.8, 0, -0.15), closing, coupler.at(1.0, 0, 0.05))
    m.cut(closing)
    return m.assemble()


@pytest.mark.parametrize(
    ("closing", "labels"),
    [
        (Universal("x", axes=("z", "x")), ("x.phi_a:+", "x.phi_a:-")),
        (Universal("x", axes=("y", "z")), ("x.phi_b:+", "x.phi_b:-")),
        (Cylindrical("x"), ("x.phi:+", "x.phi:-")),
        (Cylindrical("x", axis="x"), ("x.s:+", "x.s:-")),
        (Planar("x", axis="y"), ("x.s_y:+", "x.s_y:-")),
    ],
    ids=["universal", "universal backwards", "cylinder across", "cylinder along", "planar"],
)
def test_what_a_closing_joint_does_not_use_is_left_out(closing, labels):
    system = offset_loop(closing)
    found = searched(system, active(system))
    listed = assembly_modes(system)
    assert [mode.branch[0] for mode in listed] == list(labels)
    assert len(found) == 2
    assert all(any(same(system, mode.q, q) for q in found) for mode in listed)


def test_a_point_on_a_line():
    system = offset_loop(PointOnLine("x", axis="x"), links=1)
    found, listed = searched(system, active(system)), assembly_modes(system)
    assert [mode.branch for mode in listed] == [("x:+",), ("x:-",)]
    assert len(found) == 2
    assert all(any(same(system, mode.q, q) for q in found) for mode in listed)


def test_a_joint_without_kernel_is_named():
    rng = np.random.default_rng(1)
    m = Mechanism("shafts")
    first, second = (m.add(random_body(rng, name)) for name in ("a", "b"))
    m.connect(m.world, Revolute("j1", actuated=True), first)
    m.connect(m.world, Revolute("j2", axis="x"), second)
    m.connect(first, ConstantVelocity("cv", axis=(0.6, 0.0, 0.8)), second)
    with pytest.raises(NoClosedForm, match="a ConstantVelocity closes it"):
        assembly_modes(m.assemble())


def test_the_sign_is_that_of_the_elbow():
    system = catalogue_system("four_bar")
    for mode in assembly_modes(system, {"j1": 0.3}):
        j1, j2, j4 = mode.q
        angle = j4 - (j1 + j2) - np.pi  # of j3, counted from where coupler and rocker are in line
        assert mode.branch == ("j3:+" if np.sin(angle) > 0 else "j3:-",)


def test_the_sign_is_that_of_the_stroke():
    system = flat_loop(3, "RRRP", (0,)).assemble()
    (stage,) = plan(system)
    assert stage.labels == ("j3:+", "j3:-")
    system = flat_loop(6, "RRPR", (0,)).assemble()
    strokes = {mode.branch[0]: mode.q[2] for mode in assembly_modes(system)}
    assert strokes["j2:+"] > strokes["j2:-"]


@settings(max_examples=25, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
@given(st.sampled_from(LOOPS), st.integers(0, 10**6))
def test_any_plane_loop(loop, seed):
    system = flat_loop(seed, *loop).assemble()
    listed = assembly_modes(system)
    assert 1 <= len(listed) <= 2
    assert any(same(system, mode.q, system.configuration, 1e-6) for mode in listed)
    assert max(mode.residual for mode in listed) < 1e-10
