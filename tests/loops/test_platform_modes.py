"""Modes of loops that must be solved together, against Gauss-Newton from many random starts."""

import numpy as np
import pytest
from support.configurations import active, same, searched
from support.flat_loops import flat_loop
from support.messages import refused
from support.platforms import hexapod, planar_linkage, planar_platform
from support.ring_loops import line_symmetric_loop, ring_loop
from support.sweeps import slow

import mbs
import mbs.simulate
from mbs import Mechanism, Parameter
from mbs.components import (
    Body,
    Prismatic,
    Revolute,
    Rod,
    WrenchSensor,
)
from mbs.errors import LoopError, ModelError, NoClosedForm, Unclosable
from mbs.export import fmu
from mbs.loops import assembly_modes, function, solve

PLATFORMS = {
    "3-RRR": (("RRR", "RRR", "RRR"), (0, 0, 0), "Dixon's determinant of degree 6"),
    "3-RPR": (("RPR", "RPR", "RPR"), (1, 1, 1), "Dixon's determinant of degree 6"),
    "Stephenson III": (("RRR", "RR", "RR"), (0, None, None), "Dixon's determinant of degree 6"),
    "RPR, PRR, RRP": (("RPR", "PRR", "RRP"), (0, 0, 1), "the polynomial of a triad, of degree 6"),
    "3-PRP": (("RRP", "RP", "RP"), (0, None, None), "the polynomial of a triad, of degree 2"),
}


def check(system, starts):
    """None of what a search finds is missing; every mode closes the loops."""
    q_a = active(system)
    found = assembly_modes(system, q_a)
    assert found.complete
    for q in searched(system, q_a, starts=starts):
        assert any(same(system, q, mode.q) for mode in found)
    for mode in found:
        assert mode.branch == ()
        assert mode.residual < 1e-12
        np.testing.assert_allclose(active(system, mode.q), q_a, atol=1e-12)
    return found


@pytest.mark.parametrize("kind", PLATFORMS)
@pytest.mark.parametrize("seed", range(5))
def test_plane_platforms(kind, seed):
    legs, driven, method = PLATFORMS[kind]
    found = check(planar_platform(seed, legs, driven).assemble(), starts=60)
    assert found.proof == method
    assert len(found) in range(2, 7)


LINKAGES = {
    "two ternary links": (("OA", "OB", "AC", "CB", "AD", "DB"), (), 6),
    "platform behind a four-bar": (
        ("OA", "AP", "OB", "BP", "PC", "CQ", "OD", "DQ", "OE", "EQ"),
        ("OA",),
        6,
    ),
    # coupler curves of degree six meet in 36 points, 18 of them at infinity
    "two four-bars with a common coupler point": (
        ("OA", "AP", "OB", "BP", "PQ", "QC", "OC", "QD", "OD"),
        (),
        18,
    ),
}


@pytest.mark.parametrize("kind", LINKAGES)
@pytest.mark.parametrize("seed", range(3))
def test_plane_linkages(kind, seed):
    joints, driven, degree = LINKAGES[kind]
    found = check(planar_linkage(seed, joints, driven).assemble(), starts=60)
    assert found.proof == f"Dixon's determinant of degree {degree}"
    assert len(found) in range(1, 2 * degree + 1)  # the four-bar has two modes


def test_three_plane_loops_with_slides():
    joints, _, _ = LINKAGES["two four-bars with a common coupler point"]
    found = check(planar_linkage(1, joints, sliding=("OA", "QD")).assemble(), starts=60)
    assert found.proof == "homotopy, certified: 18 of 18 paths"


def test_a_loop_behind_a_platform_follows():
    """A rocker that a rod ties to the platform: two positions of it for each of the platform."""
    m = planar_platform(1, ("RRR",) * 3, (0, 0, 0))
    alone = assembly_modes(m.assemble())
    platform = next(body for body in m.bodies() if body.name == "platform")
    rocker = m.add(Body("rocker", mass=1, inertia=(1, 1, 1)))
    m.connect(m.world.at(0.3, 0.2, 2.0, rotation=("x", 1.0)), Revolute("rocker.j"), rocker)
    m.connect(rocker.at(1.0, 0.2), Rod("tie", length=2.5), platform.at(0.2, 0.1, 0.3))
    system = m.assemble()
    found = check(system, starts=60)
    assert len(alone) <= len(found) <= 2 * len(alone)


@pytest.mark.parametrize("kinds", ["RRRRRRR", "RRPRRPR", "RPRRRRP"])
@pytest.mark.parametrize("seed", range(3))
def test_one_loop_of_six_unknown_joints(kinds, seed):
    system = ring_loop(seed, kinds).assemble()
    found = check(system, starts=30)
    count = 16 if kinds == "RRRRRRR" else 8
    assert found.proof.endswith(f"certified: {count} of {count} roots")
    assert len(found) in range(1, 17)
    # elsewhere the arm is the same one and its target another
    q_a = np.array(found[0].q)[list(system.chosen_coordinates)] + 0.05
    found = assembly_modes(system, q_a)
    for q in searched(system, q_a, starts=15):
        assert any(same(system, q, mode.q) for mode in found)


@pytest.mark.parametrize("moved", [0.0, 0.5])
def test_bricards_loop(moved):
    """Five unknown joints in a loop that closes although six rows bind them."""
    system = mbs.load("bricard").assemble()
    q_a = active(system) + moved
    found = assembly_modes(system, q_a)
    assert (len(found), found.complete) == (2, True)
    assert found.proof.endswith("certified: 6 of 6 roots")
    for q in searched(system, q_a, starts=20):
        assert any(same(system, q, mode.q) for mode in found)


def test_a_line_symmetric_loop():
    """It moves although its six joints are in no special place."""
    system = line_symmetric_loop(1).assemble()
    found = check(system, starts=20)
    assert found.proof.endswith("certified: 16 of 16 roots")
    assert len(found) == 2


@pytest.mark.parametrize("q_a", [(0.0, 0.0), (0.3, -0.8), (300.0, 1.0)])
def test_a_differential(q_a):
    """roll = mesh1 = -mesh2, pitch + mesh1 = q1 and pitch + mesh2 = q2 up to whole turns."""
    system = mbs.robots.differential_wrist().assemble()
    found = assembly_modes(system, q_a)
    assert (found.complete, found.proof) == (True, "linear equations of angles")
    names = [c.name for c in system.coordinates]
    pitch, roll = (np.array([mode.q[names.index(name)] for mode in found]) for name in names[:2])
    first = (q_a[0] + q_a[1]) / 2
    expected = np.exp(1j * np.array([first, first + np.pi]))
    np.testing.assert_allclose(np.sort_complex(np.exp(1j * pitch)), np.sort_complex(expected))
    np.testing.assert_allclose(np.exp(1j * (pitch + roll)), np.exp(1j * q_a[0]), atol=1e-12)
    assert max(mode.residual for mode in found) < 1e-12


def test_a_gear_of_no_whole_ratio_may_stand_elsewhere_after_a_turn():
    found = assembly_modes(mbs.robots.differential_wrist(0.5).assemble(), (0.3, -0.8))
    assert not found.complete
    assert "those of loops within half a turn; a search from random starts" in found.proof


def test_a_mode_is_followed_by_a_guess():
    system = planar_platform(2, ("RPR",) * 3, (1, 1, 1)).assemble()
    names = [c.name for c in system.coordinates]
    for mode in assembly_modes(system):
        guess = dict(zip(names, mode.q, strict=True))
        assert same(system, solve(system, guess=guess), mode.q)
    with pytest.raises(NoClosedForm):
        solve(system, branch=[])
    with pytest.raises(NoClosedForm):
        function(system)


@pytest.mark.parametrize("legs", [("RR", "RR", "RR"), ("RR", "PR", "RP"), ("PR", "PR", "PR")])
def test_a_triad_without_motors(legs):
    system = planar_platform(1, legs).assemble()
    assert system.closure.mobility == 0
    found = check(system, starts=60)
    assert len(found) >= 1
    np.testing.assert_array_equal(solve(system), system.configuration)
    names = [c.name for c in system.coordinates]
    for mode in found:
        guess = dict(zip(names, np.add(mode.q, 0.01), strict=True))
        assert same(system, solve(system, guess=guess), mode.q)
    refused(
        ModelError,
        "is given, but the loops leave no motion (mobility 0); leave q_active out",
        by=lambda: assembly_modes(system, {system.coordinates[0].name: 0.0}),
    )


def test_structures_list_their_modes():
    triangle = flat_loop(1, "RRR", ()).assemble()
    assert [mode.branch for mode in assembly_modes(triangle)] == [("j0:+",), ("j0:-",)]
    for kinds in ("SSR", "SSP", "UPS"):
        system = ring_loop(3, kinds, active=()).assemble()
        expected = len(assembly_modes(system))
        assert expected >= 2, kinds


def triangle():
    """Two bars of 1 kg on the ground that meet at 60 degrees."""
    m = Mechanism("triangle", gravity=(0, -10, 0), guess={"a": 0.9, "b": 2.2})
    left, right = (m.add(Body(n, mass=1, com=(0.5, 0, 0), inertia=(1, 1, 1))) for n in ("l", "r"))
    m.connect(m.world, Revolute("a"), left)
    m.connect(m.world.at(1.0), Revolute("b"), right)
    m.connect(left.at(1.0), Revolute("c"), right.at(1.0))
    return m


def test_a_triangle_carries_its_weight():
    """Bars of 1 kg at 60 degrees: each foot carries 10 N, and pushes 10 N / 4 / sin 60 out."""
    system = triangle().assemble()
    wrenches = mbs.models.joint_wrenches(system)
    q = np.array(system.configuration)
    values = wrenches.call([q, *[np.zeros(wrenches.size_in(k)) for k in range(1, wrenches.n_in())]])
    forces = np.array(values[0])
    names = [row.name for row in system.joints]
    for name in ("a", "b"):
        force = np.linalg.norm(forces[:3, names.index(name)])
        assert force == pytest.approx(np.hypot(10, 2.5 / np.sin(np.pi / 3)), rel=1e-9)


@pytest.mark.parametrize("method", ["dopri5", "rodas"])
def test_a_structure_shows_its_cut_forces_in_a_simulation(method):
    """Each foot of the triangle carries 10 N; both push outwards with 10 N / 4 / sin 60."""
    m = triangle()
    m.add(WrenchSensor("at_a", "a", axes="world"))
    m.add(WrenchSensor("at_c", "c", axes="world"))
    system = m.assemble()
    result = mbs.simulate.run(system, 0.05, method=method)
    push = 2.5 / np.sin(np.pi / 3)
    np.testing.assert_allclose(result["at_a.f.x"], push, rtol=1e-9)
    np.testing.assert_allclose(result["at_a.f.y"], 10, rtol=1e-9)
    np.testing.assert_allclose(np.abs(result["at_c.f.x"]), push, rtol=1e-9)
    np.testing.assert_allclose(result["a.q"], np.pi / 3, rtol=1e-12)
    np.testing.assert_allclose([result["a.v"], result["b.a"]], 0, atol=1e-12)
    again = mbs.simulate.Simulator(system, outputs=["at_a.f.x"])(0.05, q0=result.state())
    np.testing.assert_allclose(again["at_a.f.x"], push, rtol=1e-9)
    refused(
        ModelError,
        "triangle: the loops allow no motion with the velocities a = 1.2; leave them out",
        by=lambda: mbs.simulate.run(system, 0.05, v0={"a": 1.2}),
    )
    refused(
        Unclosable,
        "triangle: the loops do not close with a = 1.2",
        by=lambda: mbs.simulate.run(system, 0.05, q0={"a": 1.2}),
    )


@pytest.mark.parametrize("version", [slow("2.0"), "3.0"])
def test_an_fmu_of_a_structure_shows_its_cut_forces(version, tmp_path):
    m = triangle()
    m.add(WrenchSensor("at_a", "a", axes="world"))
    fmu(m.assemble(), tmp_path / "m.fmu", version=version, outputs=["sensors"])
    for kind in ("CoSimulation", "ModelExchange"):
        result = mbs.simulate.fmu(tmp_path / "m.fmu", 0.05, kind=kind)
        push = 2.5 / np.sin(np.pi / 3)
        np.testing.assert_allclose(result["at_a.f.x"], push, rtol=1e-9)
        np.testing.assert_allclose(result["at_a.f.y"], 10, rtol=1e-9)


def congruent(width=1.0):
    """A platform congruent to the ground, but for its width, on three telescopic legs."""
    m = Mechanism("congruent", guess={"foot0": 0.4, "leg1": 0.1})
    platform = m.add(Body("platform", mass=1, inertia=(1, 1, 1)))
    for k, (x, y) in enumerate([(0.0, 0.0), (width, 0.1), (0.3, 0.8)]):
        low, high = (m.add(Body(f"{n}{k}", mass=1, inertia=(1, 1, 1))) for n in ("low", "high"))
        m.connect(m.world.at(x, y), Revolute(f"foot{k}"), low)
        m.connect(low, Prismatic(f"leg{k}", axis="x", actuated=True), high)
        end = platform.at(1.0 if k == 1 else x, y)
        m.connect(high.at(0.7), Revolute(f"head{k}"), end)
    return m.assemble()


def test_a_motion_of_its_own_is_told():
    """With equal legs the platform may be carried in a circle while the motors stay."""
    system = congruent()
    check(system, starts=60)
    refused(
        LoopError,
        "congruent: foot0, head0, foot1, foot2 can move while the independent joints stay; modes",
        by=lambda: assembly_modes(system, [0.1, 0.1, 0.1]),
    )


def test_parameters():
    """The modes of a symbol's value are those of the number."""
    wide, symbolic = congruent(1.2), congruent(Parameter("width", 1.0))
    legs = [0.3, 0.5, 0.4]
    found = assembly_modes(symbolic, legs, parameters={"width": 1.2})
    expected = assembly_modes(wide, legs)
    assert len(found) == len(expected) >= 2
    for mode in expected:
        assert any(same(wide, mode.q, other.q) for other in found)
    # with equal widths the equation is another one
    assert not any(same(wide, expected[0].q, other.q) for other in assembly_modes(symbolic, legs))


@pytest.mark.parametrize("leg", ["UPS", "RUS", "R rod", "SPS"])
@pytest.mark.parametrize("seed", range(3))
def test_platforms_on_six_legs(leg, seed):
    """A search may end with universal joints on the other side: poses of the platform count."""
    system = hexapod(seed, leg).assemble()
    q_a = active(system)
    found = assembly_modes(system, q_a)
    assert found.complete
    assert found.proof == "homotopy, certified: 40 of 40 paths"
    assert len(found) % 2 == 0
    pose = mbs.models.transform(system, "platform")
    places = [np.array(pose(mode.q)) for mode in found]
    assert any(same(system, mode.q, system.configuration) for mode in found)
    assert max(mode.residual for mode in found) < 1e-12
    for q in searched(system, q_a, starts=8, seed=seed):
        T = np.array(pose(q))
        assert min(np.abs(T - place).max() for place in places) < 1e-5
    apart = [np.abs(T - S).max() for k, T in enumerate(places) for S in places[:k]]
    assert min(apart) > 1e-3


def test_the_catalogues_platform():
    """Semi-regular hexagons: 28 complex poses, eight of them real here."""
    system = mbs.load("stewart_platform").assemble()
    found = assembly_modes(system)
    assert (len(found), found.complete) == (8, True)
    assert found.proof == "homotopy, certified: 28 of 28 paths"
    assert any(same(system, mode.q, system.configuration) for mode in found)


def test_a_platform_on_similar_hexagons_has_other_independent_joints():
    rng = np.random.default_rng(3)
    angles = rng.uniform(0, 6, 6)
    a = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(6)])
    # five legs are independent, so that a joint of the sixth one stands for its motor
    system = hexapod(1, "UPS", (a, 0.5 * a)).assemble()
    assert (
        len(
            [k for k in system.independent if system.velocity_coordinates[k].name.startswith("leg")]
        )
        == 5
    )
    refused(
        NoClosedForm,
        "hexapod1: the ends of its six legs lie so that they hold the platform at no pose, as on"
        " similar hexagons, and the length of one leg follows from the others",
        by=lambda: assembly_modes(system),
    )


@pytest.mark.parametrize("moved", [0.0, 0.06])
def test_the_catalogues_delta(moved):
    """Six rods: beside the upright platform, above and below, fourteen that are rotated."""
    system = mbs.load("delta").assemble()
    q_a = active(system) + moved * np.array([1, -0.5, 1.4])
    found = assembly_modes(system, q_a)
    assert (len(found), found.complete) == (16, True)
    for q in searched(system, q_a, starts=20):
        assert any(same(system, q, mode.q) for mode in found)


def test_a_platform_that_moves_on_locked_legs_is_refused():
    """Ends that are congruent and legs that are equal: every leg may be carried along a sphere."""
    rng = np.random.default_rng(0)
    a = rng.uniform(-1, 1, (6, 3))
    system = hexapod(1, "UPS", (a, a)).assemble()
    free = np.array([np.linalg.norm(x) for x in _leg_vectors(system, a)])
    refused(
        LoopError,
        "can move while the independent joints stay; modes cannot be counted there",
        by=lambda: assembly_modes(system, 1.4 - free),
    )


def _leg_vectors(system, a):
    """From the ends on the ground to those on the platform, where the system was assembled."""
    T = np.array(mbs.models.transform(system, "platform")(system.configuration))
    return T[:3, 3] + a @ T[:3, :3].T - a
