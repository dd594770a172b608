"""Contacts: where they touch, how hard, and the balance of their power, by other formulas."""

import casadi
import numpy as np
import pytest
from casadi import SX, Function
from support.messages import refused

import mbs
from mbs.components import (
    Body,
    BoxPlaneContact,
    CapsuleCapsuleContact,
    CapsulePlaneContact,
    Custom,
    Fixed,
    Free,
    HeightFieldContact,
    Prismatic,
    SphereBoxContact,
    SphereCapsuleContact,
    SpherePlaneContact,
    SphereSphereContact,
    WheelPlaneContact,
    custom,
)
from mbs.components.contact import damping_for
from mbs.errors import AssemblyError, DescriptionError
from mbs.recursions.part_checks import check_part
from mbs.recursions.parts import PartsAt

K, C, MU = 1e3, 0.3, 0.6
LAW = {"stiffness": K, "damping": C, "friction": MU}
SIZE = (0.5, 1.0, 2.0)


def waves(x, y):
    return 0.3 * casadi.sin(2 * x) * casadi.cos(y)


SHAPES = {
    "sphere": lambda a, b, **law: SpherePlaneContact("c", a, b, radius=1.0, **law),
    "point": lambda a, b, **law: SpherePlaneContact("c", a, b, **law),
    "capsule": lambda a, b, **law: CapsulePlaneContact("c", a, b, radius=0.5, length=1.0, **law),
    "wheel": lambda a, b, **law: WheelPlaneContact("c", a, b, radius=0.8, rim=0.1, **law),
    "disc": lambda a, b, **law: WheelPlaneContact("c", a, b, radius=0.9, **law),
    "box": lambda a, b, **law: BoxPlaneContact("c", a, b, size=SIZE, **law),
    "spheres": lambda a, b, **law: SphereSphereContact(
        "c", a, b, radius_a=1.0, radius_b=0.5, **law
    ),
    "sphere on capsule": lambda a, b, **law: SphereCapsuleContact(
        "c", a, b, radius=0.6, capsule_radius=0.4, length=1.2, **law
    ),
    "capsules": lambda a, b, **law: CapsuleCapsuleContact(
        "c", a, b, radius_a=0.5, length_a=1.0, radius_b=0.4, length_b=1.4, **law
    ),
    "sphere on box": lambda a, b, **law: SphereBoxContact("c", a, b, radius=1.0, size=SIZE, **law),
    "field": lambda a, b, **law: HeightFieldContact("c", a, b, radius=0.6, height=waves, **law),
}


def pair(shape, **law):
    """Two bodies that move freely, and a contact between points of them."""
    m = mbs.Mechanism("pair", gravity=(0, 0, -9.81))
    for name, inertia in (("a", (1e-3, 2e-3, 3e-3)), ("b", (1e-3, 1e-3, 1e-3))):
        body = m.add(Body(name, mass=0.5, inertia=inertia))
        m.connect(m.world, Free(f"free_{name}"), body)
    a, b = m.components["a"].at(0.1, 0.2, 0.3), m.components["b"].at(0.2, -0.3, 0.1)
    m.add(SHAPES[shape](a, b, **{**LAW, **law}))
    return m.assemble()


def seen(system, *methods):
    """(q, v, z, p) -> what methods of the contact give, as vectors."""
    q, v = SX.sym("q", system.nq), SX.sym("v", system.nv)
    at = PartsAt(system, q, v)
    (part,) = system.parts
    values = []
    for name in methods:
        found = getattr(part.element, name)(at.at(part))
        values.append(casadi.vertcat(*found.values()) if isinstance(found, dict) else found)
    return Function("seen", [q, v, system.component_states, system.p], values)


@pytest.mark.parametrize("friction_law", ["regularised", "bristle"])
@pytest.mark.parametrize("shape", SHAPES)
def test_forces_have_the_power_of_energy_and_heat(shape, friction_law):
    system = pair(shape, friction_law=friction_law)
    at = PartsAt(system, SX.sym("q", system.nq), SX.sym("v", system.nv))
    (part,) = system.parts
    check_part(system, part, at)  # refuses what differs by 1e-8, where it touches or not
    rng = np.random.default_rng(3)
    pressed = seen(system, "outputs")
    states = [rng.uniform(-0.3, 0.3, system.nq) for _ in range(20)]
    rest = np.zeros(system.component_states.numel())
    forces = [pressed(q, np.zeros(system.nv), rest, []).full().ravel()[::4] for q in states]
    assert np.max(forces) > 10  # it was asked where it touches


def test_a_wrong_energy_is_refused():
    class Half(SpherePlaneContact):
        def energy(self, at):
            return SpherePlaneContact.energy(self, at) / 2

    m = mbs.Mechanism("half")
    body = m.add(Body("b", mass=1))
    m.connect(m.world, Prismatic("z", axis="z"), body)
    m.add(Half("c", body, m.world, radius=2.0, stiffness=K))
    refused(AssemblyError, "c (Half): its loads have the power", by=m.assemble)


def falling(contact, ground=None):
    """A body that moves freely, above a ground of the world, and a contact of both."""
    m = mbs.Mechanism("one", gravity=(0, 0, -9.81))
    body = m.add(Body("b", mass=0.5, inertia=(1e-3, 1e-3, 1e-3)))
    m.connect(m.world, Free("f"), body)
    m.add(contact(body, m.world if ground is None else ground(m.world)))
    return m.assemble()


def of(system, position, velocity=(0, 0, 0), angular=(0, 0, 0), turn=(1, 0, 0, 0), z=None):
    """Outputs and the wrench on the body, at its place and velocity."""
    names = [c.name for c in system.coordinates]
    q = dict(zip(names, [*position, *turn], strict=True))
    v = np.array([*velocity, *angular])
    z = np.zeros(system.component_states.numel()) if z is None else z
    values = seen(system, "outputs")(list(q.values()), v, z, []).full().ravel()
    own = system.parts[0].element.output_names
    extra = [z] if system.component_states.numel() else []
    rest = mbs.models.inverse_dynamics(system)(list(q.values()), v, np.zeros(6), *extra)
    m = mbs.Mechanism("free", gravity=(0, 0, -9.81))
    body = m.add(Body("b", mass=0.5, inertia=(1e-3, 1e-3, 1e-3)))
    m.connect(m.world, Free("f"), body)
    alone = mbs.models.inverse_dynamics(m.assemble())(list(q.values()), v, np.zeros(6))
    return dict(zip(own, values, strict=True)), (alone - rest).full().ravel()


def test_sphere_on_a_plane():
    system = falling(lambda a, b: SpherePlaneContact("c", a, b, radius=0.5, **LAW))
    found, wrench = of(system, (1, 2, 0.4), (0.3, 0, -2), (0, 1, 0))
    normal = K * 0.1**1.5 * (1 + C * 2)
    slip = 0.3 - 0.45  # the force acts in the middle of the overlap
    assert found["normal_force"] == pytest.approx(normal, rel=1e-13)
    assert found["depth"] == pytest.approx(0.1, rel=1e-13)
    assert found["slip"] == pytest.approx(0.15, rel=1e-12)
    friction = -MU * normal * slip / np.hypot(slip, 1e-3)
    np.testing.assert_allclose(wrench[[0, 2]], [friction, normal], rtol=1e-12)
    np.testing.assert_allclose(wrench[3:], [0, -0.45 * friction, 0], rtol=1e-12, atol=1e-12)


def test_a_contact_never_pulls():
    system = falling(lambda a, b: SpherePlaneContact("c", a, b, radius=0.5, **LAW))
    assert of(system, (0, 0, 0.4), (0, 0, 10))[0]["normal_force"] == 0
    found, wrench = of(system, (0, 0, 0.6), (1, 0, -10))
    assert found["depth"] == pytest.approx(-0.1, rel=1e-13)
    assert not wrench.any()


def test_each_end_of_a_capsule_has_its_pressure():
    system = falling(lambda a, b: CapsulePlaneContact("c", a, b, radius=0.1, length=1.0, **LAW))
    lying = (np.cos(0.8), 0, np.sin(0.8), 0)  # its z at 1.6 rad from the vertical
    found, wrench = of(system, (0, 0, 0.09), turn=lying)
    drop = np.cos(1.6) / 2
    depths = 0.01 + drop, 0.01 - drop
    assert found["depth_a"] == pytest.approx(depths[0], rel=1e-12)
    assert found["depth_b"] == pytest.approx(depths[1], rel=1e-12)
    forces = [K * max(d, 0) ** 1.5 for d in depths]
    assert found["normal_force_b"] == pytest.approx(forces[1], rel=1e-12)
    assert found["normal_force_a"] == pytest.approx(forces[0], abs=1e-12)
    # the moment of both about the middle, in the axes of the body
    assert wrench[4] == pytest.approx(0.5 * np.sin(1.6) * (forces[0] - forces[1]), rel=1e-10)


def test_corners_of_a_box():
    system = falling(lambda a, b: BoxPlaneContact("c", a, b, size=(1.0, 0.6, 0.4), **LAW))
    found, wrench = of(system, (0, 0, 0.15), turn=(np.cos(0.05), np.sin(0.05), 0, 0))
    s, c = np.sin(0.1), np.cos(0.1)
    for number in range(8):
        x, y, z = (1 if number >> k & 1 else -1 for k in range(3))
        height = 0.15 + s * 0.3 * y + c * 0.2 * z
        assert found[f"depth_{number + 1}"] == pytest.approx(-height, rel=1e-12), (x, y, z)
    assert sum(found[f"normal_force_{n}"] for n in range(1, 9)) == pytest.approx(
        np.linalg.norm(wrench[:3]), rel=1e-12
    )


def test_two_spheres():
    m = mbs.Mechanism("two", gravity=(0, 0, 0))
    bodies = [m.add(Body(name, mass=1, inertia=(1, 1, 1))) for name in "ab"]
    for body in bodies:
        m.connect(m.world, Free(f"f{body.name}"), body)
    m.add(SphereSphereContact("c", *bodies, radius_a=1.0, radius_b=0.5, stiffness=K, exponent=2))
    system = m.assemble()
    names = [coordinate.name for coordinate in system.coordinates]
    start = {"fa.qw": 1.0, "fb.qw": 1.0, "fb.x": 0.6, "fb.y": 0.8, "fb.z": 0.0}
    q = [start.get(name, 0.0) for name in names]
    a = mbs.models.direct_dynamics(system)(q, np.zeros(12), np.zeros(12)).full().ravel()
    np.testing.assert_allclose(a[:3], [-K * 0.25 * 0.6, -K * 0.25 * 0.8, 0], rtol=1e-9)
    np.testing.assert_allclose(a[6:9], -a[:3], rtol=1e-12)


@pytest.mark.parametrize(
    ("centre", "depth", "normal"),
    [
        ((0.3, 0.4, 0.2), 0.1, (0.6, 0.8, 0)),  # beside the axis
        ((0.3, 0.0, -0.9), 0.1, (0.6, 0, -0.8)),  # beyond an end
        ((0.0, 0.0, 1.0), 0.1, (0, 0, 1)),
    ],
)
def test_sphere_on_a_capsule(centre, depth, normal):
    law = {"radius": 0.2, "capsule_radius": 0.4, "length": 1.0, "stiffness": K}
    system = falling(lambda a, b: SphereCapsuleContact("c", a, b, **law))
    found, wrench = of(system, centre)
    assert found["depth"] == pytest.approx(depth, rel=1e-9)
    np.testing.assert_allclose(wrench[:3], K * depth**1.5 * np.array(normal), rtol=1e-9, atol=1e-9)


def two_capsules():
    law = {"radius_a": 0.3, "length_a": 2.0, "radius_b": 0.2, "length_b": 1.0, "stiffness": K}
    return falling(lambda b, a: CapsuleCapsuleContact("c", a, b, **law))


def test_capsules_overlap_where_their_axes_are_nearest():
    """Against a search among points of both axes."""
    system, random = two_capsules(), np.random.default_rng(5)
    s, t = np.meshgrid(np.linspace(-1, 1, 1601), np.linspace(-0.5, 0.5, 801), indexing="ij")
    for _ in range(12):
        turn = random.normal(size=4)
        turn /= np.linalg.norm(turn)
        w, x, y, z = turn
        axis = np.array([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)])
        place = random.uniform(-1, 1, 3) * [1, 1, 1.5]
        off = [place[k] + t * axis[k] - s * (k == 2) for k in range(3)]
        nearest = np.sqrt(off[0] ** 2 + off[1] ** 2 + off[2] ** 2).min()
        found, _ = of(system, place, turn=turn)
        assert found["depth"] == pytest.approx(0.5 - nearest, abs=2e-5)


def test_parallel_capsules_press_on_their_middle():
    """No moment where they are parallel, and that of an end from some 1e-3 rad on."""
    system = two_capsules()
    for angle, arm in ((0.0, 0.0), (2e-2, -0.5), (-2e-2, 0.5)):
        turn = np.array([np.cos(angle / 2), 0, np.sin(angle / 2), 0])
        found, wrench = of(system, (0.45 + abs(np.sin(angle)) / 2, 0, 0), turn=turn)
        assert found["depth"] == pytest.approx(0.05, abs=1e-5)
        assert wrench[4] == pytest.approx(arm * wrench[0], abs=0.03 * abs(wrench[0]))
        assert np.linalg.norm(wrench[:3]) == pytest.approx(K * 0.05**1.5, rel=1e-3)


def test_a_capsule_comes_to_rest_across_another_one():
    """It falls a little tilted on a fixed one and rocks until damping and friction hold it."""
    m = mbs.Mechanism("logs", gravity=(0, 0, -9.81))
    log = m.add(Body("log", mass=1.0, inertia=(0.09, 0.09, 0.02)))
    m.connect(m.world, Free("f"), log.at(rotation=("y", -np.pi / 2)))
    law = {"radius_a": 0.1, "length_a": 1.0, "radius_b": 0.1, "length_b": 1.0}
    force = {"stiffness": 1e5, "restitution": 0.3, "impact_speed": 0.5, "friction": 0.8}
    fixed = m.world.at(rotation=("x", np.pi / 2))
    m.add(CapsuleCapsuleContact("c", fixed, log, **law, **force, friction_law="bristle"))
    result = mbs.simulate.run(m.assemble(), 2.0, q0={"f.z": 0.21}, quiet=True)
    assert result["f.z.q"][-1] == pytest.approx(0.2 - (9.81 / 1e5) ** (2 / 3), abs=1e-4)
    assert result["c.normal_force"][-1] == pytest.approx(9.81, rel=0.05)


@pytest.mark.parametrize(
    ("centre", "depth", "normal"),
    [
        ((0.1, 0.2, 0.35), 0.05, (0, 0, 1)),  # above a face
        ((-0.1, 0.1, -0.35), 0.05, (0, 0, -1)),
        ((0.1, 0.46, 0.28), 0.1, (0, 0.6, 0.8)),  # beside an edge
        ((0.52, 0.41, 0.22), 0.17, (2, 1, 2)),  # beyond a corner
        ((0.45, 0.1, 0.05), 0.25, (1, 0, 0)),  # inside
        ((0.5, 0.1, 0.05), 0.2, (1, 0, 0)),  # on a face
    ],
)
def test_sphere_on_a_box(centre, depth, normal):
    system = falling(
        lambda a, b: SphereBoxContact("c", a, b, radius=0.2, size=(1.0, 0.8, 0.4), stiffness=K)
    )
    found, wrench = of(system, centre)
    assert found["depth"] == pytest.approx(depth, rel=1e-9)
    unit = np.array(normal) / np.linalg.norm(normal)
    np.testing.assert_allclose(wrench[:3], K * depth**1.5 * unit, rtol=1e-9, atol=1e-9)


def test_a_height_field_that_is_a_slope_is_a_plane():
    angle = 0.4
    field = falling(
        lambda a, b: HeightFieldContact(
            "c", a, b, radius=0.3, height=lambda x, y: -np.tan(angle) * x, **LAW
        )
    )
    plane = falling(
        lambda a, b: SpherePlaneContact("c", a, b, radius=0.3, **LAW),
        lambda world: world.at(rotation=("y", angle)),
    )
    states = (0.5, 0.2, 0.05), (0.7, 0.3, -1), (1, 2, 3)
    for one, other in zip(of(field, *states), of(plane, *states), strict=True):
        values = (list(x.values()) if isinstance(x, dict) else x for x in (one, other))
        np.testing.assert_allclose(*values, rtol=1e-11, atol=1e-12)


def test_a_height_field_as_a_casadi_function():
    x, y = SX.sym("x"), SX.sym("y")
    given = Function("h", [x, y], [waves(x, y)])
    systems = [
        falling(lambda a, b, h=h: HeightFieldContact("c", a, b, height=h, **LAW))
        for h in (given, waves)
    ]
    (one, _), (other, _) = (of(system, (0.4, 0.3, 0.1)) for system in systems)
    assert one == other
    assert one["normal_force"] > 0


def test_bristles_stay_within_the_friction_cone():
    system = falling(
        lambda a, b: SpherePlaneContact(
            "c", a, b, radius=0.5, friction_law="bristle", bristle=2e-4, **LAW
        )
    )
    rng = np.random.default_rng(5)
    for _ in range(50):
        angle, size = rng.uniform(0, 6.3), 2e-4 * rng.uniform(0, 1)
        z = size * np.array([np.cos(angle), np.sin(angle)])
        v = 10 ** rng.uniform(-6, 1) * rng.normal(size=3)
        found, _ = of(system, (0, 0, 0.4), v, z=z)
        assert found["friction_force"] <= MU * found["normal_force"] * (1 + 1e-12)
        rate = seen(system, "rates")([0, 0, 0.4, 1, 0, 0, 0], [*v, 0, 0, 0], z, []).full()
        if size < 1e-4:  # below half the limit nothing slips
            np.testing.assert_allclose(rate.ravel(), v[:2], rtol=1e-12)
    # at the limit they do not bend further, whichever way it slides
    for angle in np.linspace(0, 3, 7):
        z = 2e-4 * np.array([np.cos(angle), np.sin(angle)])
        rate = seen(system, "rates")([0, 0, 0.4, 1, 0, 0, 0], [2, 0, 0, 0, 0, 0], z, []).full()
        assert float(z @ rate.ravel()) <= 1e-9
    # where they are at the limit and it slides on, all of it resists
    found, wrench = of(system, (0, 0, 0.4), (2, 0, 0), z=[2e-4, 0])
    assert wrench[0] == pytest.approx(-MU * found["normal_force"], rel=1e-12)
    # without contact they relax
    rate = seen(system, "rates")([0, 0, 0.6, 1, 0, 0, 0], np.ones(6), [1e-4, 0], []).full()
    np.testing.assert_allclose(rate.ravel(), [-1e-4 / 5e-3, 0], rtol=1e-12)


def test_bristles_along_a_normal_relax():
    m = mbs.Mechanism("two", gravity=(0, 0, 0))
    bodies = [m.add(Body(name, mass=1, inertia=(1, 1, 1))) for name in "ab"]
    for body in bodies:
        m.connect(m.world, Prismatic(f"x{body.name}", axis="x"), body)
    law = {**LAW, "friction_law": "bristle", "bristle_time": 0.1}
    m.add(SphereSphereContact("c", *bodies, radius_a=1.0, radius_b=1.0, **law))
    system = m.assemble()
    # the normal is x: what is left along it from an earlier normal relaxes, the rest stays
    rate = seen(system, "rates")([0, 1.9], [0, 0], [2e-5, 1e-5, 0], []).full().ravel()
    np.testing.assert_allclose(rate, [-2e-4, 0, 0], rtol=1e-9, atol=1e-15)
    outputs = seen(system, "outputs")([0, 1.9], [0, 0], [2e-5, 0, 0], []).full().ravel()
    assert outputs[0] > 1
    assert outputs[1] < 1e-9  # it makes no friction


def test_derivatives_are_finite_without_contact_and_at_rest():
    for shape in SHAPES:
        for law in ("regularised", "bristle"):
            system = pair(shape, friction_law=law)
            f = mbs.models.direct_dynamics(system)
            symbols = [SX.sym(f.name_in(k), f.numel_in(k)) for k in range(f.n_in())]
            a = f(*symbols)
            every = casadi.vertcat(*symbols)
            H = casadi.hessian(casadi.sum1(a), every)[0]
            J = Function("J", symbols, [casadi.jacobian(a, every), H])
            q = np.array(system.configuration)
            for height in (0.0, 50.0):
                q[[c.name for c in system.coordinates].index("free_a.z")] = height
                rest = [np.zeros(s.numel()) for s in symbols[1:]]
                for value in J(q, *rest):
                    assert value.is_regular(), (shape, law, height)


@pytest.mark.parametrize("e", [0.05, 0.3, 0.7, 0.99, 1 - 1e-9])
def test_damping_of_a_restitution(e):
    x = 3.0 * damping_for(e, 3.0)
    # the integral of the law over an impact, from speed 1 to -e
    assert x * (1 + e) == pytest.approx(np.log1p(x) - np.log1p(-e * x), rel=1e-7)
    assert damping_for(0.01, 1.0) == pytest.approx(100)  # the highest, 1 / e, to rounding
    if e > 0.98:  # the limit that Hunt and Crossley give
        assert x == pytest.approx(1.5 * (1 - e), rel=0.02)
    assert damping_for(1.0, 3.0) == 0


def test_symbols_and_placed_mechanisms():
    inner = mbs.Mechanism("ball")
    body = inner.add(Body("b", mass=1))
    inner.connect(inner.world, Prismatic("z", axis="z"), body)
    k = mbs.Parameter("k", 1e4)
    inner.add(
        SpherePlaneContact(
            "c", body, inner.world, radius="R", stiffness=k, friction=0.5, friction_law="bristle"
        )
    )
    m = mbs.Mechanism("outer", gravity=(0, 0, -9.81))
    placed = m.add(inner, name="left")
    m.connect(m.world.at(1, 0, 0), Fixed("mount"), placed.base)
    system = m.assemble()
    assert [name for name, _ in system.states] == ["left.c.bristle_x", "left.c.bristle_y"]
    assert {p.name for p in system.parameters} == {"left.k", "left.R"}


def test_unused_states_are_left_out():
    law = {**LAW, "friction_law": "bristle"}
    assert len(falling(lambda a, b: BoxPlaneContact("c", a, b, size=SIZE, **law)).states) == 16
    law["friction"] = 0
    assert falling(lambda a, b: BoxPlaneContact("c", a, b, size=SIZE, **law)).states == ()


BODY = Body("b", mass=1)


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ({"stiffness": 0}, "c: stiffness is 0; give more than zero"),
        ({"exponent": 0.5}, "c: exponent is 0.5;"),
        ({"damping": -1}, "c: damping is -1; give zero or more"),
        ({"friction": -0.1}, "c: friction is -0.1; give zero or more"),
        ({"friction_law": "bristles"}, "did you mean 'bristle'?"),
        ({"restitution": 0.5}, "c: restitution is given alone; give restitution and impact_speed"),
        (
            {"restitution": 0.5, "impact_speed": 1, "damping": 1},
            "c: restitution and impact_speed are given beside damping;",
        ),
        (
            {"restitution": 1.2, "impact_speed": 1},
            "c: restitution is 1.2; give a number above zero, at most 1",
        ),
        (
            {"restitution": 0.5, "impact_speed": 0},
            "c: impact_speed is 0; give a number above zero",
        ),
        ({"radius": -1}, "c: radius is -1 m;"),
    ],
)
def test_wrong_numbers_are_refused(given, sentence):
    refused(
        DescriptionError,
        sentence,
        by=lambda: SpherePlaneContact("c", BODY, BODY.at(1), **{"stiffness": K, **given}),
    )


@pytest.mark.parametrize(
    ("height", "sentence"),
    [
        (lambda x, y: np.floor(float(x)), "c: height is nan for symbols x and y"),
        (
            lambda x, y: np.interp(x, [0, 1], [0, 1]),
            "c: height cannot be written with CasADi symbols",
        ),
        (
            lambda x, y: casadi.interpolant("h", "linear", [[0, 1]], [0, 1])(x),
            "c: height calls another Function, such as an interpolant",
        ),
        (lambda x, y: casadi.vertcat(x, y), "c: height has the shape (2, 1); give one value"),
        (lambda x, y: x * SX.sym("s"), "c: height holds the symbols s; make it of x, y"),
    ],
)
def test_wrong_fields_are_refused(height, sentence):
    refused(
        DescriptionError,
        sentence,
        by=lambda: HeightFieldContact("c", BODY, BODY.at(1), stiffness=K, height=height),
    )


def test_sizes_of_boxes_are_checked():
    refused(
        DescriptionError,
        "c: size has the side -1 m; give more than zero",
        by=lambda: BoxPlaneContact("c", BODY, BODY.at(1), stiffness=K, size=(1, -1, 1)),
    )
    refused(
        DescriptionError,
        "c, size: 2 has not three values",
        by=lambda: SphereBoxContact("c", BODY, BODY.at(1), stiffness=K, radius=1, size=2),
    )


def test_a_crossing_of_inputs_is_refused():
    class Push(Custom):
        point = custom.frame()
        force = custom.input("N")

        def loads(self, at):
            return {"point": custom.force(casadi.vertcat(at.force, 0, 0))}

        def crossings(self, at):
            return {"push": at.force - 1}

    m = mbs.Mechanism("m")
    body = m.add(Body("b", mass=1))
    m.connect(m.world, Prismatic("x", axis="x"), body)
    m.add(Push("s", body))
    refused(AssemblyError, "s (Push): the crossing 'push' depends on inputs", by=m.assemble)


def test_a_crossing_may_follow_from_velocities():
    class Gas(Custom):
        """Resists with 2 N while the body moves forwards, not while it returns."""

        point = custom.frame()

        def loads(self, at):
            force = casadi.if_else(at.point.v[0] > 0, -2.0, 0.0)
            return {"point": custom.force(casadi.vertcat(force, 0, 0))}

        def crossings(self, at):
            return {"turn": at.point.v[0]}

    m = mbs.Mechanism("m", gravity=(-1.0, 0, 0))
    body = m.add(Body("b", mass=1))
    m.connect(m.world, Prismatic("x", axis="x"), body)
    m.add(Gas("s", body))
    result = mbs.simulate.run(m.assemble(), 3.0, v0={"x": 3.0}, step=3.0, quiet=True)
    # it stops after 1 s at 1.5 m and falls for 2 s
    assert result["x.q"][-1] == pytest.approx(1.5 - 2.0, abs=1e-9)
