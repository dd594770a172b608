"""Gears, racks and screws: against plain couplings, and against equations by hand."""

import numpy as np
import pytest

import mbs
import mbs.models
import mbs.simulate
from mbs.components import (
    Body,
    Box,
    Coupling,
    Cylindrical,
    Gear,
    PointMass,
    Prismatic,
    RackAndPinion,
    Revolute,
    Rod,
    Screw,
)
from mbs.errors import DescriptionError
from mbs.loops import closure_residual, reduction_matrix, solve

J, M, GRAVITY = 0.3, 2.0, 9.81


def drive(coupling, load, pinion="pinion"):
    """A driven pinion and a load that slides along, or turns about, the vertical z."""
    m = mbs.Mechanism("drive", gravity=(0, 0, -GRAVITY))
    wheel = m.add(Body("wheel", 1.0, inertia=(0.2, 0.2, J)))
    m.connect(m.world, Revolute(pinion, actuated=True), wheel)
    body = m.add(Body("load", M, inertia=(0.5, 0.5, 0.7)))
    m.connect(m.world.at(1.0), load, body)
    m.add(coupling)
    return m.assemble()


def models(system):
    """Efforts, inertia and accelerations at a state that closes the system."""
    q = solve(system, [0.8])
    tau = mbs.models.inverse_dynamics(system)(q, 1.2, -0.7)
    a = mbs.models.direct_dynamics(system)(q, 1.2, tau)
    A = mbs.models.inertia_matrix(system)(q)
    return np.array([*q, float(tau), float(a), float(A)])


@pytest.mark.parametrize(
    ("named", "factor", "load"),
    [
        (Gear("k", "load_axis", "pinion", ratio=-0.4), -0.4, Revolute("load_axis")),
        (RackAndPinion("k", "load_axis", "pinion", radius=0.05), 0.05, Prismatic("load_axis")),
        (
            Screw("k", "load_axis", "pinion", pitch=0.02, offset=0.3),
            0.02 / (2 * np.pi),
            Prismatic("load_axis"),
        ),
    ],
)
def test_a_transmission_is_the_coupling_of_its_factor(named, factor, load):
    offset = 0.3 if isinstance(named, Screw) else 0.0
    plain = Coupling("k", "load_axis", "pinion", (offset, factor))
    a, b = drive(named, load), drive(plain, load)
    np.testing.assert_array_equal(models(a), models(b))
    assert a.closure.mobility == 1
    assert a.report() == b.report()
    assert "Coupling k: load_axis follows pinion." in a.report()
    q, tau, back, inertia = np.split(models(a), [2, 3, 4])
    assert q[1] == pytest.approx(offset + factor * q[0], abs=1e-13)
    assert back[0] == pytest.approx(-0.7, abs=1e-12)
    slides = isinstance(load, Prismatic)
    total = J + factor**2 * (M if slides else 0.7)
    assert inertia[0] == pytest.approx(total, abs=1e-12)
    weight = factor * M * GRAVITY if slides else 0.0
    assert tau[0] == pytest.approx(total * -0.7 + weight, abs=1e-12)


def test_a_screw_joint_sinks_and_turns():
    m = mbs.Mechanism("screw", gravity=(0, 0, -GRAVITY))
    nut = m.add(Body("nut", M, inertia=(0.2, 0.2, 0.001)))
    m.connect(m.world, Cylindrical("c"), nut)
    m.add(Screw("thread", driven="c.s", driver="c.phi", pitch="h"))
    m.values["h"] = mbs.Parameter("h", -0.1, "m")
    system = m.assemble()
    assert system.closure.mobility == 1
    run = mbs.simulate.run(system, 1.0, tolerance=1e-11, quiet=True)
    lead = -0.1 / (2 * np.pi)
    fall = -GRAVITY * M * lead**2 / (M * lead**2 + 0.001) / 2
    np.testing.assert_allclose(run["c.s.q"], fall * run.time**2, rtol=0, atol=1e-9)
    np.testing.assert_allclose(run["c.phi.q"], run["c.s.q"] / lead, rtol=0, atol=1e-9)
    total = run["kinetic_energy"] + run["potential_energy"]
    assert np.ptp(total) < 1e-8


def test_a_wheel_rolls_down_a_slope():
    """A disc on a carriage: the rack is the ground."""
    slope, r = 0.3, 0.25
    m = mbs.Mechanism("wheel", gravity=(GRAVITY * np.sin(slope), 0, -GRAVITY * np.cos(slope)))
    hub = m.add(PointMass("hub", 0.5))
    disc = m.add(Body("disc", M, inertia=(M * r**2 / 4, M * r**2 / 2, M * r**2 / 4)))
    m.connect(m.world, Prismatic("along", axis="x"), hub)
    m.connect(hub, Revolute("turn", axis="y"), disc)
    m.add(RackAndPinion("ground", driven="along", driver="turn", radius=r))
    system = m.assemble()
    run = mbs.simulate.run(system, 1.0, tolerance=1e-11, quiet=True)
    a = GRAVITY * np.sin(slope) * (M + 0.5) / (1.5 * M + 0.5)
    np.testing.assert_allclose(run["along.q"], a * run.time**2 / 2, rtol=0, atol=1e-9)


def press():
    """A pinion drives a rack, whose rod turns a rocker."""
    m = mbs.Mechanism("press", gravity=(0, -GRAVITY, 0))
    wheel = m.add(Body("wheel", 1.0, inertia=(0.02, 0.02, 0.03)))
    rack, rocker = m.add(PointMass("rack", M)), m.add(Box("rocker", length=0.5, mass=1.0))
    m.connect(m.world.at(0, -0.1), Revolute("pinion", actuated=True), wheel)
    m.connect(m.world, Prismatic("slide", axis="x"), rack)
    m.connect(m.world.at(0.9), Revolute("rocker_axis"), rocker.left)
    m.connect(rack, Rod("rod", length=mbs.Parameter("rod_length", 0.8, "m")), rocker.right)
    m.add(RackAndPinion("mesh", driven="slide", driver="pinion", radius=0.1))
    return m


def test_rod_and_rack_in_one_mechanism():
    system = press().assemble(guess={"rocker_axis": 1.8})
    assert system.closure.mobility == 1
    assert [row.closing for row in system.loops] == ["rod", "coupling"]
    q = solve(system, {"pinion": 0.5})
    names = [c.name for c in system.coordinates]
    slide, rocker = q[names.index("slide")], q[names.index("rocker_axis")]
    assert slide == pytest.approx(0.05, abs=1e-13)
    gap = [0.9 + 0.5 * np.cos(rocker) - slide, 0.5 * np.sin(rocker)]
    assert np.hypot(*gap) == pytest.approx(0.8, abs=1e-12)
    G = np.array(reduction_matrix(system)(q)).ravel()
    rate = gap[0] * (-0.5 * np.sin(rocker)) + gap[1] * 0.5 * np.cos(rocker)
    assert G[names.index("rocker_axis")] == pytest.approx(gap[0] * 0.1 / rate, abs=1e-10)


def test_inside_another_mechanism():
    outer = mbs.Mechanism("pair", gravity=(0, -GRAVITY, 0))
    for side, x in (("left", -1.0), ("right", 1.0)):
        placed = outer.add(press(), side)
        outer.connect(outer.world.at(x), placed.base)
    system = outer.assemble(guess={"left.rocker_axis": 1.8, "right.rocker_axis": 1.8})
    assert system.closure.mobility == 2
    assert [p.name for p in system.parameters] == ["left.rod_length", "right.rod_length"]
    phi = closure_residual(system)(system.configuration, [0.8, 0.8])
    assert np.abs(np.array(phi)).max() < 1e-12


def test_fmu_follows_the_simulation(tmp_path):
    system = press().assemble(guess={"rocker_axis": 1.8})
    mbs.export.fmu(system, tmp_path / "press.fmu")
    for length in (0.8, 0.75):
        run = mbs.simulate.run(system, 0.5, parameters={"rod_length": length}, tolerance=1e-10)
        fmu = mbs.simulate.fmu(
            tmp_path / "press.fmu",
            0.5,
            parameters={"rod_length": length},
            tolerance=1e-10,
            quiet=True,
        )
        assert np.ptp(run["rocker_axis.q"]) > 0.01
        for name in ("pinion.q", "slide.q", "rocker_axis.q", "rocker_axis.v"):
            np.testing.assert_allclose(fmu[name], run[name], rtol=0, atol=1e-6)


# Couplings of more than two coordinates.


def planetary(**options):
    """Sun, carrier and ring about one axis; carrier = 0.1 + 0.25 sun + 0.75 ring."""
    m = mbs.Mechanism("planetary", gravity=(0, 0, 0))
    for name, inertia in (("sun", 0.02), ("ring", 0.3), ("carrier", 0.1)):
        body = m.add(Body(name, 1.0, inertia=(inertia, inertia, inertia)))
        m.connect(m.world, Revolute(f"{name}_axis", actuated=name != "carrier"), body)
    others = (("ring_axis", options.pop("ring", 0.75)),)
    m.add(Coupling("mesh", "carrier_axis", "sun_axis", (0.1, 0.25), others=others))
    return m


def test_a_planetary_gear_adds_two_coordinates():
    """The inertia matrix is J_s + k_s^2 J_c and so on, with k_s k_r J_c beside the diagonal."""
    system = planetary().assemble()
    assert system.closure.mobility == 2
    q = solve(system, {"sun_axis": 0.4, "ring_axis": -0.2})
    names = [c.name for c in system.coordinates]
    assert q[names.index("carrier_axis")] == pytest.approx(0.1 + 0.25 * 0.4 - 0.75 * 0.2, abs=1e-14)
    active = [system.velocity_coordinates[k].name for k in system.independent]
    factors = np.array([{"sun_axis": 0.25, "ring_axis": 0.75}[name] for name in active])
    own = np.array([{"sun_axis": 0.02, "ring_axis": 0.3}[name] for name in active])
    A = np.array(mbs.models.inertia_matrix(system)(q))
    np.testing.assert_allclose(A, np.diag(own) + 0.1 * np.outer(factors, factors), atol=1e-15)
    assert "Coupling mesh: carrier_axis follows sun_axis and ring_axis." in system.report()


@pytest.mark.parametrize("given", [("sun_axis", "ring_axis"), ("carrier_axis", "sun_axis")])
def test_the_third_coordinate_follows_in_closed_form(given):
    m = planetary()
    system = m.assemble(active=given)
    wanted = dict(zip(given, (0.4, -0.3), strict=True))
    (mode,) = mbs.loops.assembly_modes(system, wanted)
    assert mode.branch == ()
    q = solve(system, wanted, branch=())
    np.testing.assert_allclose(q, solve(system, wanted), atol=1e-12)


def test_couplings_of_a_placed_mechanism_keep_their_others():
    outer = mbs.Mechanism("outer", gravity=(0, 0, 0))
    outer.connect(outer.world, outer.add(planetary(), name="gear").base)
    (coupling,) = outer.couplings()
    assert coupling.coordinates == ("gear.carrier_axis", "gear.sun_axis", "gear.ring_axis")
    assert outer.assemble().closure.mobility == 2


@pytest.mark.parametrize(
    ("others", "message"),
    [
        ((("j1", 1.0),), "'j2' follows a coordinate of .* twice"),
        ((("j2", 1.0),), "the coordinate 'j2' cannot follow itself"),
        (("j3",), "others .* are not pairs of a coordinate and a factor"),
        (3, "others 3 are not pairs"),
    ],
)
def test_others_that_are_none_are_refused(others, message):
    with pytest.raises(DescriptionError, match=message):
        Coupling("c", "j2", "j1", others=others)
