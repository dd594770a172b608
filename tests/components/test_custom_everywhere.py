"""A component of one's own on every kind of mechanism, beside the package's own."""

import casadi
import numpy as np
import pytest
from support.bennett import bennett

import mbs
from mbs.components import (
    Body,
    Box,
    Custom,
    Damper,
    Free,
    Prismatic,
    Revolute,
    Spherical,
    Spring,
    custom,
)

STIFFNESS, LENGTH, DAMPING = 40.0, 0.3, 1.5


class OwnSpring(Custom):
    """A spring by its potential alone."""

    a = custom.frame()
    b = custom.frame()

    def energy(self, at):
        """Half the stiffness times the square of the stretch."""
        return 0.5 * STIFFNESS * (casadi.norm_2(at.b.p - at.a.p) - LENGTH) ** 2


class OwnDamper(Custom):
    """A damper by its tension, with the heat that it has taken as a state."""

    a = custom.frame()
    b = custom.frame()
    heat = custom.state("J")

    def rate(self, at):
        """How fast the points part."""
        line = at.b.p - at.a.p
        return casadi.dot(line, at.b.v - at.a.v) / casadi.norm_2(line)

    def loads(self, at):
        """The tension on both points."""
        return custom.pull(at.a, at.b, DAMPING * self.rate(at))

    def dissipation(self, at):
        """All its power."""
        return DAMPING * self.rate(at) ** 2

    def rates(self, at):
        """The heat grows by what it takes."""
        return {"heat": self.dissipation(at)}


def own(m, a, b):
    """The spring and the damper of one's own between two points."""
    m.add(OwnSpring("spring", a=a, b=b))
    m.add(OwnDamper("damper", a=a, b=b))


def built_in(m, a, b):
    """Those of the package."""
    m.add(Spring("spring", a, b, stiffness=STIFFNESS, length=LENGTH))
    m.add(Damper("damper", a, b, damping=DAMPING))


def prismatic(add):
    """A bar on a slide."""
    m = mbs.Mechanism("slide", gravity=(0, 0, -9.81))
    slide, bar = m.add(Body("slide", mass=2.0)), m.add(Box("bar", length=0.6, mass=1.0))
    m.connect(m.world, Prismatic("x", axis=(0.6, 0, 0.8)), slide.at())
    m.connect(slide.at(0, 0.1, 0), Revolute("j", axis="y"), bar.left)
    add(m, m.world.at(0.2, -0.5, 0.3), bar.right)
    return m.assemble()


def two_roots(add):
    """Two pendulums on the ground, coupled at their ends."""
    m = mbs.Mechanism("two_roots", gravity=(0, 0, -9.81))
    a, b = (m.add(Box(name, length=0.5, mass=mass)) for name, mass in (("a", 1.0), ("b", 2.0)))
    m.connect(m.world, Revolute("j1", axis="y"), a.left)
    m.connect(m.world.at(0.4, 0.2, 0), Revolute("j2", axis=(0, 0.8, 0.6)), b.left)
    add(m, a.right, b.right)
    return m.assemble()


def loop(add):
    """A four-bar with the coupler's middle tied to the ground."""
    m = mbs.Mechanism("four_bar", gravity=(0, -9.81, 0))
    a, b, c = (m.add(Box(n, length=L, mass=1.0)) for n, L in (("a", 0.3), ("b", 0.8), ("c", 0.7)))
    m.connect(m.world, Revolute("j1", axis="z"), a.left)
    m.connect(a.right, Revolute("j2", axis="z", actuated=False), b.left)
    m.connect(b.right, Revolute("j3", axis="z", actuated=False), c.right)
    m.connect(m.world.at(0.9, 0, 0), Revolute("j4", axis="z", actuated=False), c.left)
    add(m, m.world.at(0.3, -0.4, 0), b.at(0.1, 0.2, 0))
    return m.assemble(guess={"j1": 1.0, "j2": -0.5})


def over_constrained(add):
    """Bennett's loop, which closes by a relation between its lengths alone."""
    return bennett(add=lambda m, bodies: add(m, bodies[1].at(0.1, 0, 0.2), bodies[3].at()))


def quaternions(add):
    """A body on a spherical joint, and a free one."""
    m = mbs.Mechanism("quaternions", gravity=(0, 0, -9.81))
    inertia = ((0.2, 0.01, 0.02), (0.01, 0.3, 0.03), (0.02, 0.03, 0.4))
    a, b = (m.add(Body(n, mass=1.5, com=(0.1, 0.2, -0.3), inertia=inertia)) for n in ("a", "b"))
    m.connect(m.world, Spherical("ball"), a.at())
    m.connect(m.world, Free("free"), b.at())
    add(m, a.at(0.1, -0.4, 0.5), b.at(0.9, 0.2, 0.1))
    return m.assemble()


def massless(add):
    """A cross without mass between two revolute joints, to which the spring is fastened."""
    m = mbs.Mechanism("massless", gravity=(0, 0, -9.81))
    cross, bar = m.add(Body("cross", mass=0)), m.add(Box("bar", length=0.5, width=0.1, mass=1.0))
    m.connect(m.world, Revolute("j1", axis="x"), cross.at())
    m.connect(cross.at(), Revolute("j2", axis="y"), bar.left)
    add(m, m.world.at(0.2, 0.3, -0.6), cross.at(0.1, 0.4, 0.2))
    return m.assemble()


KINDS = (prismatic, two_roots, loop, over_constrained, quaternions, massless)


@pytest.fixture(params=KINDS, ids=lambda kind: kind.__name__, scope="module")
def pair(request):
    """The mechanism with parts of one's own, and with those of the package."""
    return request.param(own), request.param(built_in)


def points(system, count=5):
    """Configurations that close the loops, with random velocities and accelerations."""
    rng = np.random.default_rng(3)
    n = len(system.independent)
    for _ in range(count):
        q = np.array(mbs.loops.configuration.start(system, None, None, None)[0])
        if not system.is_closed:
            q = q + rng.uniform(-0.4, 0.4, system.nq)
        for part in mbs.assembly.tree.quaternion_slices(system.tree):
            q[part] /= np.linalg.norm(q[part])
        yield (
            q,
            rng.uniform(-1, 1, n),
            rng.uniform(-1, 1, n),
            rng.uniform(0, 2, system.component_states.numel()),
        )


@pytest.mark.parametrize("name", ["inverse_dynamics", "direct_dynamics"])
def test_models_are_those_of_the_package(pair, name):
    """Values as with the built-in spring and damper; a state of its own moves nothing."""
    mine, theirs = (getattr(mbs.models, name)(system) for system in pair)
    for q, v, a, z in points(pair[0]):
        given = {"q": q, "v": v, "v_a": v, "a": a, "a_a": a, "tau": a, "tau_a": a, "z": z}
        first = np.array(mine(*(given[one] for one in mine.name_in())))
        other = np.array(theirs(*(given[one] for one in theirs.name_in())))
        assert first == pytest.approx(other, rel=1e-12, abs=1e-12 * np.abs(other).max())


def test_energy_is_that_of_the_package(pair):
    """Kinetic and potential energy as with the built-in spring."""
    mine, theirs = (mbs.models.energy(system) for system in pair)
    for q, v, _, z in points(pair[0]):
        given = {"q": q, "v": v, "v_a": v, "z": z}
        first = np.array(mine(*(given[one] for one in mine.name_in()))).ravel()
        other = np.array(theirs(*(given[one] for one in theirs.name_in()))).ravel()
        assert first == pytest.approx(other, rel=1e-12)


def test_energy_and_heat_stay_together(pair):
    """Along a motion the energy falls by what the damper has taken."""
    system = pair[0]
    speed = {system.velocity_coordinates[k].name: 0.7 for k in system.independent[:1]}
    result = mbs.simulate.run(system, 1.0, v0=speed, tolerance=1e-10, quiet=True)
    heat = result["damper.heat"]
    total = result["kinetic_energy"] + result["potential_energy"] + heat
    assert heat[-1] > 1e-3  # J
    assert np.ptp(total) < 1e-8  # J
