"""Loops are closed to a part of the size of the mechanism: the same for 100 um and 1 km."""

import casadi
import numpy as np
import pytest
from casadi import DM, Function
from support.catalogue_systems import catalogue_system

import mbs
from mbs.components import Body, Prismatic, Revolute, Spherical
from mbs.errors import LoopError, ModelError
from mbs.loops import assembly_modes, configuration_report, solve
from mbs.loops._function import follow_active
from mbs.loops.closing import Closing, closure_parameters, mechanism_size, row_sizes
from mbs.loops.pose import goal
from mbs.loops.velocity import constraint_jacobian, scales
from mbs.models import transform
from mbs.models.state.tree import full_state
from mbs.robots import four_bar as catalogue_four_bar

SCALES = (1e-4, 1.0, 1e3)
"""Size of the largest link [m]: 100 um, 1 m, 1 km."""
OPEN_BY = 0.01
"""By which a joint is turned away from where the loop closes [rad]."""


def bar(mechanism, name, length, mass):
    """A slender homogeneous bar along x."""
    across = mass * length**2 / 12
    com = (length / 2, 0, 0)
    return mechanism.add(Body(name, mass=mass, com=com, inertia=(across / 100, across, across)))


def four_bar(size):
    """Links of 0.4, 1, 0.9 on a base of 0.8; gravity grows with the size, so that times do not."""
    m = mbs.Mechanism("scaled", gravity=(0, -9.81 * size, 0))
    lengths = [size * part for part in (0.4, 1.0, 0.9)]
    a, b, c = (bar(m, name, x, 1.0) for name, x in zip("abc", lengths, strict=True))
    m.connect(m.world, Revolute("j1", axis="z", actuated=True), a)
    m.connect(a.at(lengths[0]), Revolute("j2", axis="z"), b)
    m.connect(b.at(lengths[1]), Revolute("j3", axis="z"), c.at(lengths[2]))
    m.connect(m.world.at(0.8 * size), Revolute("j4", axis="z"), c)
    return m.assemble(guess={"j2": 1.0})


@pytest.fixture(scope="module", params=SCALES)
def scaled(request):
    """The size, and the four-bar of this size."""
    return request.param, four_bar(request.param)


def test_a_loop_that_is_open_by_a_hundredth_is_refused(scaled):
    size, system = scaled
    q = np.array(system.configuration)
    assert configuration_report(system, q).is_closed
    q[1] += OPEN_BY
    state = configuration_report(system, q)
    assert not state.is_closed
    assert state.residual == pytest.approx(OPEN_BY * size, rel=0.01)
    assert state.opening == pytest.approx(OPEN_BY / 1.7, rel=0.01)
    with pytest.raises(LoopError, match="leaves the loops open by"):
        mbs.models.direct_dynamics(system)(q, 0.0, 0.0)
    with pytest.raises(LoopError, match="leaves the loops open by"):
        mbs.simulate.run(system, 0.1, q0=list(q), quiet=True)


@pytest.mark.parametrize("size", [1e-6, 1e5, 1e7])
@pytest.mark.parametrize("driven", ["crank", "slide"])
def test_a_slider_crank_of_any_size_follows_its_branch(size, driven):
    m = mbs.Mechanism("slider_crank")
    a, b = (bar(m, name, size * x, 1.0) for name, x in (("a", 0.1), ("b", 0.4)))
    slider = m.add(Body("slider", mass=1))
    m.connect(m.world, Revolute("crank", axis="z", actuated=driven == "crank"), a)
    m.connect(a.at(0.1 * size), Revolute("knee", axis="z", actuated=False), b)
    m.connect(b.at(0.4 * size), Revolute("pin", axis="z", actuated=False), slider)
    m.connect(m.world, Prismatic("slide", axis="x", actuated=driven == "slide"), slider)
    system = m.assemble(guess={"crank": 0.4, "slide": 0.45 * size})
    slide = 0.1 * np.cos(0.7) + np.sqrt(0.4**2 - (0.1 * np.sin(0.7)) ** 2)
    target = {"crank": 0.7} if driven == "crank" else {"slide": slide * size}
    found = dict(zip((c.name for c in system.coordinates), solve(system, target), strict=True))
    assert found["crank"] == pytest.approx(0.7, abs=1e-11)
    assert found["slide"] / size == pytest.approx(slide, abs=1e-11)


def test_all_sizes_close_alike(scaled):
    _, system = scaled
    like = four_bar(1.0)
    assert system.closure.independent == like.closure.independent
    assert system.closure.mobility == 1
    np.testing.assert_allclose(system.configuration, like.configuration, atol=1e-11)
    np.testing.assert_allclose(solve(system, [0.7]), solve(like, [0.7]), atol=1e-11)
    found, wanted = assembly_modes(system, [0.7]), assembly_modes(like, [0.7])
    assert [mode.branch for mode in found] == [mode.branch for mode in wanted]
    followed = follow_active(system)
    np.testing.assert_allclose(np.array(followed(0.7, [])).ravel(), solve(like, [0.7]), atol=1e-9)


def test_all_sizes_move_alike(scaled):
    size, system = scaled
    result, like = (
        mbs.simulate.run(one, 1.0, q0={"j1": 0.4}, quiet=True) for one in (system, four_bar(1.0))
    )
    np.testing.assert_allclose(result["j1.q"][-1], like["j1.q"][-1], atol=1e-6)
    assert result["closure_residual"].max() < 1e-12 * size
    energy = result["kinetic_energy"] + result["potential_energy"]
    assert np.ptp(energy) < 1e-6 * np.ptp(result["kinetic_energy"])


def test_one_step_of_projection_measures_by_the_size(scaled):
    """What is left is told in parts of the size, for velocities too."""
    _, system = scaled
    q, v = np.array(system.configuration), np.ones(system.nv)
    x = np.concatenate([q + np.array([0, OPEN_BY, 0]), 0 * v])
    state = full_state(system)
    assert float(state.project(0.0, x, [])[1]) == pytest.approx(OPEN_BY / 1.7, rel=0.05)


def test_the_size_follows_parameters():
    """A symbol that scales every length scales the size."""
    m = mbs.Mechanism("lengths", parameters={"L": 1.0})
    a, b = m.add(Body("a", mass=1)), m.add(Body("b", mass=1))
    m.connect(m.world, Revolute("j1", axis="z"), a)
    m.connect(a.at("L"), Revolute("j2", axis="z"), b)
    m.connect(b.at("2*L"), Revolute("j3", axis="z"), (c := m.add(Body("c", mass=1))))
    m.connect(m.world.at("1.5*L"), Revolute("j4", axis="z"), c.at("1.2*L"))
    system = m.assemble(guess={"j2": 1.0, "j3": 1.0})
    size = Function("size", [system.p], [mechanism_size(system)])
    assert float(size(1e3)) == pytest.approx(1e3 * float(size(1.0)))
    q = solve(system, parameters={"L": 1e-4})
    closing = Closing(system, closure_parameters(system, {"L": 1e-4}))
    assert closing.openness(q) < 1e-12
    turned = q + np.array([OPEN_BY, 0, 0])
    assert closing.openness(turned) > 1e-3
    assert np.abs(closing.rows(turned)[0]).max() < 1e-5


def test_rows_that_are_cosines_are_measured_as_they_are():
    system = four_bar(1e-4)
    labels = [label for loop in system.loops for label in loop.rows]
    sizes = np.array(DM(casadi.evalf(row_sizes(system)))).ravel()
    np.testing.assert_allclose(
        sizes, [1.7e-4 if label.startswith("force") else 1.0 for label in labels]
    )


def test_the_catalogue_has_sizes_of_its_links():
    assert float(mechanism_size(catalogue_four_bar().assemble())) == pytest.approx(1.7)


def test_a_loop_without_levers_is_measured_by_its_gap():
    """Three slides around a triangle of 20 um; where they meet at zero, nothing tells the size."""
    for offset, expected in ((2e-5, 2e-5), (0.0, 1.0)):
        m = mbs.Mechanism("slides")
        a, b = m.add(Body("a", mass=1)), m.add(Body("b", mass=1))
        m.connect(m.world, Prismatic("x", axis="x"), a)
        m.connect(a, Prismatic("y", axis="y"), b)
        m.connect(m.world.at(offset, 0, 0), Prismatic("d", axis=(1, 1, 0)), b)
        assert float(mechanism_size(m.assemble())) == pytest.approx(expected, rel=0.5)


def test_levers_of_rounding_are_none():
    """Four axes through one point: the rows of positions are zero wherever the links are."""
    m = mbs.Mechanism("sphere", gravity=(0, 0, 0))
    bodies, before = [m.add(Body(f"b{k}", mass=1)) for k in range(3)], m.world.at(0.3, 0.1, 0.2)
    for k, body in enumerate(bodies):
        centre = body.at(0.1, 0.7, 0.3 * k)
        m.connect(before, Revolute(f"j{k}", axis="z"), centre)
        before = body.at(0.1, 0.7, 0.3 * k, rotation=("x", 1.0 + 0.2 * k))
    m.connect(before, Revolute("j3", axis="z"), m.world.at(0.3, 0.1, 0.2, rotation=("x", 0.8)))
    assert float(mechanism_size(m.assemble())) == 1.0


@pytest.mark.parametrize("size", SCALES)
def test_a_spatial_loop_of_any_size_has_its_mobility(size):
    """Two revolute and two spherical joints: the coupler spins, so that two motions are free."""
    m = mbs.Mechanism("rssr", gravity=(0, 0, -9.81))
    a, b, c = (bar(m, name, size * x, 1.0) for name, x in zip("abc", (0.3, 1.0, 0.7), strict=True))
    m.connect(m.world, Revolute("r1", axis="z"), a)
    m.connect(a.at(0.3 * size), Spherical("s1"), b)
    m.connect(b.at(size), Spherical("s2"), c.at(0.7 * size))
    m.connect(m.world.at(0.2 * size, 0.8 * size, 0.3 * size), Revolute("r2", axis="x"), c)
    system = m.assemble()
    assert system.closure.mobility == 2
    assert configuration_report(system, system.configuration).opening < 1e-12


@pytest.mark.parametrize("size", [1e-6, *SCALES])
def test_ranks_do_not_depend_on_the_unit_of_length(size):
    """Bricard's loop of six hinges: rows of micrometres stand beside rows of cosines."""
    m = mbs.Mechanism("bricard", gravity=(0, 0, 0))
    rods = [bar(m, f"rod{k}", size, 1.0) for k in range(5)]
    turns = [("x", 0), ("z", np.pi / 2), ("y", np.pi / 2), ("z", -np.pi), ("z", -np.pi / 2)]
    before = m.world.at()
    for rod, hinge, upright in zip(rods, "yzxyz", turns, strict=True):
        m.connect(before, Revolute(f"on_{rod.name}", axis=hinge), rod.at(rotation=upright))
        before = rod.at(size, rotation=upright)
    m.connect(before, closing := Revolute("last", axis="x"), m.world.at(0, 0, size))
    m.cut(closing)
    assert m.assemble().closure.mobility == 1


def test_other_errors_stand():
    with pytest.raises(ModelError, match="an open chain has no loops"):
        configuration_report(catalogue_system("planar_2r"), [0.0, 0.0])


def test_rows_of_velocities_are_of_unit_length(scaled):
    size, system = scaled
    J = np.array(constraint_jacobian(system)(list(system.configuration), system.p_default))
    found = scales(system)
    lengths = np.linalg.norm(found.rows[:, None] * J, axis=1)
    vanish = np.linalg.norm(J, axis=1) < 1e-9 * size
    assert 0 < np.count_nonzero(vanish) < len(vanish)
    np.testing.assert_allclose(lengths, np.where(vanish, 0, 1), atol=1e-9)
    assert 0.1 * size < found.length < 3 * size


def test_a_goal_is_as_open_as_its_loops(scaled):
    _, system = scaled
    q = np.add(system.configuration, [0.1, -0.2, 0.3])
    wanted = goal(system, "c", np.array(transform(system, "c")(q)), None, None)
    assert wanted.openness(q) == pytest.approx(wanted.closing.openness(q), rel=1e-12)
    assert wanted.openness(q) > 0.01
