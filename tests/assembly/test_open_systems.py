"""From components to links: placements, merged bodies, numbering, reversed joints, tables."""

import numpy as np
import pytest
from casadi import DM
from support.messages import refused
from support.random_trees import (
    ALL_KINDS,
    KINDS,
    random_body,
    random_rotation,
    random_state,
    random_tree,
)

import mbs
import mbs.models
from mbs.components import (
    Body,
    Coupling,
    Cylindrical,
    Fixed,
    Free,
    Planar,
    PointMass,
    Prismatic,
    Revolute,
    Spherical,
    Universal,
)
from mbs.components.joints import Motion
from mbs.errors import AssemblyError, ModelError
from mbs.expressions import Parameter


def solid(name):
    return Body(name, 2.0, (0.1, 0.2, 0.3), (0.1, 0.12, 0.15))


def rotation(axis, angle):
    K = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


def of_quaternion(x):
    w, e = x[0], x[1:]
    K = np.array([[0, -e[2], e[1]], [e[2], 0, -e[0]], [-e[1], e[0], 0]])
    return np.eye(3) + 2 * w * K + 2 * K @ K


def moved(joint, values):
    """Frame_b of a joint seen from its frame_a, by the words of its description."""
    T, values = np.eye(4), list(values)
    for freedom in joint.freedoms:
        step, axis = np.eye(4), np.array(freedom.axis)
        if freedom.motion is Motion.REVOLUTE:
            step[:3, :3] = rotation(axis, values.pop(0))
        elif freedom.motion is Motion.PRISMATIC:
            step[:3, 3] = values.pop(0) * axis
        else:
            if freedom.motion is Motion.FREE:
                step[:3, 3] = [values.pop(0) for _ in range(3)]
            step[:3, :3] = of_quaternion(np.array([values.pop(0) for _ in range(4)]))
        T = T @ step
    return T


def placed(point):
    return DM(point.placement.pose({}).matrix).full()


def pose_of(system, name, q, p=None):
    T = mbs.models.transform(system, name)
    return np.array(T(q) if p is None else T(q, p))


def names(system):
    return [c.name for c in system.coordinates]


@pytest.mark.sweep
@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("aligned", [False, True])
def test_frames_reproduce_the_poses_of_the_components(seed, aligned):
    mechanism = random_tree(seed, n=6, kinds=ALL_KINDS, aligned=aligned).mechanism
    system = mechanism.assemble()
    q, _, _ = random_state(system, np.random.default_rng(seed))
    of_joint = {c.joint: [] for c in system.coordinates}
    for coordinate, value in zip(system.coordinates, q, strict=True):
        of_joint[coordinate.joint].append(value)
    poses = {"world": np.eye(4)}
    for (a, _), (_, b) in zip(mechanism.connections[::2], mechanism.connections[1::2], strict=True):
        joint = mechanism.components[f"j{b.owner.name.removeprefix('body')}"]
        poses[b.owner.name] = poses[a.owner.name] @ placed(a) @ moved(joint, of_joint[joint.name])
    for name, wanted in poses.items():
        np.testing.assert_allclose(pose_of(system, name, q), wanted, atol=1e-12)


REVERSED = [Revolute, Prismatic, Cylindrical, Planar]


@pytest.mark.parametrize("kind", [*REVERSED, Universal])
@pytest.mark.parametrize("seed", range(3))
def test_a_reversed_joint_moves_the_other_way_round(kind, seed):
    rng = np.random.default_rng(seed)
    R = random_rotation(rng)
    options = {"axes": (R[:, 0], R[:, 1])} if kind is Universal else {"axis": R[:, 0]}
    joint = kind("j", **options)
    m = mbs.Mechanism("m")
    body = m.add(solid("b"))
    on_body = body.at(*rng.uniform(-1, 1, 3), rotation=random_rotation(rng))
    ground = m.world.at(*rng.uniform(-1, 1, 3), rotation=random_rotation(rng))
    m.connect(on_body, joint, ground)
    system = m.assemble()
    values = dict(
        zip([f.suffix for f in joint.freedoms], rng.uniform(-1, 1, joint.nv), strict=True)
    )
    q = [values[c.name.removeprefix("j").removeprefix(".")] for c in system.coordinates]
    inverse = np.linalg.inv(placed(on_body) @ moved(joint, values.values()))
    np.testing.assert_allclose(pose_of(system, "b", q), placed(ground) @ inverse, atol=1e-13)


@pytest.mark.parametrize("kind", [Spherical, Free])
@pytest.mark.parametrize("seed", range(3))
def test_a_reversed_quaternion_still_orients_frame_b(kind, seed):
    rng = np.random.default_rng(seed)
    m = mbs.Mechanism("m")
    body = m.add(solid("b"))
    on_body = body.at(*rng.uniform(-1, 1, 3), rotation=random_rotation(rng))
    ground = m.world.at(*rng.uniform(-1, 1, 3), rotation=random_rotation(rng))
    m.connect(on_body, kind("j"), ground)
    system = m.assemble()
    q, _, _ = random_state(system, rng)
    inverse = np.linalg.inv(placed(on_body) @ moved(kind("j"), q))
    np.testing.assert_allclose(pose_of(system, "b", q), placed(ground) @ inverse, atol=1e-13)


@pytest.mark.parametrize("seed", range(5))
def test_the_first_child_of_a_joint_with_an_axis_has_no_gamma_and_b(seed):
    system = random_tree(
        seed, n=7, kinds=("revolute", "prismatic"), serial=seed % 2 == 0
    ).mechanism.assemble()
    seen = set()
    for link in system.tree.links:
        if link.antecedent >= 0 and link.antecedent not in seen:
            assert link.placement.gamma.is_zero()
            assert link.placement.b.is_zero()
        seen.add(link.antecedent)


def test_parameters_of_a_table_are_kept_verbatim():
    rows = [(0, 0, 0.3, 0.1, 0.2, 0.4), (0.5, 0.6, -1, 0.2, 0.3, -0.4), (-0.5, 0.1, 2, 0, 0.1, 0)]
    m = mbs.Mechanism("m")
    before = m.world
    for k, row in enumerate(rows):
        link = m.add(solid(f"b{k}"))
        m.connect(
            before.at_khalil(
                **dict(zip(["gamma", "b", "alpha", "d", "theta", "r"], row, strict=True))
            ),
            Revolute(f"q{k}"),
            link,
        )
        before = link
    m.connect(before.at(0.3, 0.2, 0.1, rotation=("x", 0.4)), Revolute("last"), m.add(solid("end")))
    links = m.assemble().tree.links
    for link, row in zip(links, rows, strict=False):
        assert [float(x) for x in link.placement.parameters] == list(map(float, row))


@pytest.mark.parametrize("seed", range(3))
def test_welded_bodies_are_one_link(seed):
    rng = np.random.default_rng(seed)
    apart, whole = mbs.Mechanism("apart"), mbs.Mechanism("whole")
    parts = [random_body(rng, f"p{k}") for k in range(3)]
    at = [(rng.uniform(-1, 1, 3), random_rotation(rng)) for _ in range(2)]
    for part in parts:
        apart.add(part)
    apart.connect(apart.world.at(0.1, rotation=("x", 1)), Revolute("j", axis="y"), parts[0])
    apart.connect(parts[0].at(*at[0][0], rotation=at[0][1]), parts[1])
    apart.connect(parts[1].at(*at[1][0], rotation=at[1][1]), Fixed("glue"), parts[2])
    mass, com, J = 0.0, np.zeros(3), np.zeros((3, 3))
    T, poses = np.eye(4), [np.eye(4)]
    for p, R in at:
        step = np.eye(4)
        step[:3, :3], step[:3, 3] = R, p
        T = T @ step
        poses.append(T)
    for part, T in zip(parts, poses, strict=True):
        m_k, c = float(str(part.mass)), T[:3, :3] @ [float(str(x)) for x in part.com] + T[:3, 3]
        six = [float(str(x)) for x in part.inertia]
        central = np.array(
            [[six[0], six[1], six[2]], [six[1], six[3], six[4]], [six[2], six[4], six[5]]]
        )
        J += T[:3, :3] @ central @ T[:3, :3].T + m_k * (c @ c * np.eye(3) - np.outer(c, c))
        mass, com = mass + m_k, com + m_k * c
    com /= mass
    central = J - mass * (com @ com * np.eye(3) - np.outer(com, com))
    body = whole.add(Body("w", mass, tuple(com), (central + central.T) / 2))
    whole.connect(whole.world.at(0.1, rotation=("x", 1)), Revolute("j", axis="y"), body)
    one, other = apart.assemble(), whole.assemble()
    q, v, a = [0.4], [1.2], [-0.7]
    np.testing.assert_allclose(
        np.array(mbs.models.inverse_dynamics(one)(q, v, a)),
        np.array(mbs.models.inverse_dynamics(other)(q, v, a)),
        rtol=1e-11,
    )
    first = pose_of(one, "p0", q)
    for k in (1, 2):
        np.testing.assert_allclose(pose_of(one, f"p{k}", q), first @ poses[k], atol=1e-13)


def test_numbering_depth_first_or_as_given():
    for keep_order, wanted in ((False, ["a", "c", "b"]), (True, ["a", "b", "c"])):
        m = mbs.Mechanism("m", keep_order=keep_order)
        one, two, three = (m.add(solid(n)) for n in ("one", "two", "three"))
        m.connect(m.world, Revolute("a"), one)
        m.connect(m.world.at(1), Revolute("b"), two)
        m.connect(one.at(1), Revolute("c"), three)
        system = m.assemble()
        assert names(system) == wanted
        assert [row.name for row in system.bodies] == [
            "one",
            *{"c": ["three", "two"], "b": ["two", "three"]}[wanted[1]],
        ]


def test_massless_bodies_between_joints():
    m = mbs.Mechanism("m")
    frame, end = m.add(Body("frame", mass=0)), m.add(solid("end"))
    m.connect(m.world, Revolute("j1"), frame)
    m.connect(frame, Revolute("j2", axis="x"), end)
    other = mbs.Mechanism("m")
    end = other.add(solid("end"))
    other.connect(other.world, Universal("u", axes=("z", "x")), end)
    q, v, tau = [0.3, 0.7], [1, -2], [0.4, 0.5]
    one, two = (np.array(mbs.models.direct_dynamics(x.assemble())(q, v, tau)) for x in (m, other))
    np.testing.assert_allclose(one, two, rtol=1e-12)


def test_tables():
    m = mbs.Mechanism("m")
    a, b, c = (m.add(solid(n)) for n in "abc")
    m.connect(m.world, Free("base_joint"), a)
    m.connect(a, Cylindrical("cyl", limits={"s": (0, 1)}), b)
    m.connect(b, Revolute("rev", limits=(-1, 2), actuated=False), c)
    system = m.assemble()
    assert (system.nq, system.nv) == (10, 9)
    assert names(system) == [
        *(f"base_joint.{k}" for k in ("x", "y", "z", "qw", "qx", "qy", "qz")),
        "cyl.s",
        "cyl.phi",
        "rev",
    ]
    assert [c.unit for c in system.velocity_coordinates] == ["m/s"] * 3 + ["rad/s"] * 3 + [
        "m/s",
        "rad/s",
        "rad/s",
    ]
    limits = {c.name: c.limits for c in system.coordinates if c.limits}
    assert limits == {"cyl.s": (0.0, 1.0), "rev": (-1.0, 2.0)}
    assert {c.name: c.actuated for c in system.coordinates[7:]} == {
        "cyl.s": True,
        "cyl.phi": True,
        "rev": False,
    }
    assert system.configuration == (0, 0, 0, 1, 0, 0, 0, 0, 0, 0)
    assert system.closure is None
    text = system.report()
    assert "m: 4 moving links in a tree, 10 positions q and 9 velocities v." in text
    assert "link 3: revolute cyl.phi from link 2 carries b" in text
    assert "carries a frame without a body" in text
    assert "No loop: every coordinate is independent." in text


@pytest.mark.parametrize("seed", range(4))
def test_rate_of_positions(seed):
    system = random_tree(
        seed, n=4, kinds=("spherical", "free", "revolute"), serial=False
    ).mechanism.assemble()
    q, v, _ = random_state(system, np.random.default_rng(seed))
    rate, h = np.array(system.qdot(q, v)).ravel(), 1e-6
    for row in system.bodies:
        now, plus, minus = (pose_of(system, row.name, x) for x in (q, q + h * rate, q - h * rate))
        twist = np.array(mbs.models.jacobian(system, row.name)(q)) @ v
        dT = (plus - minus) / (2 * h)
        W = dT[:3, :3] @ now[:3, :3].T
        np.testing.assert_allclose(dT[:3, 3], twist[:3], atol=1e-7)
        np.testing.assert_allclose([W[2, 1], W[0, 2], W[1, 0]], twist[3:], atol=1e-7)


def test_symbols_in_the_geometry():
    def double(L, angle):
        m = mbs.Mechanism("m")
        a, b = m.add(solid("a")), m.add(solid("b"))
        m.connect(m.world.at(0, 0, L), Revolute("j1"), a)
        m.connect(a.at(L, rotation=("x", angle)), Revolute("j2", axis="x"), b)
        return m.assemble()

    symbolic, number = double("L", "A"), double(0.7, 0.3)
    assert [p.name for p in symbolic.parameters] == ["L", "A"]
    q, v, a = [0.1, 0.2], [1, 2], [3, 4]
    np.testing.assert_allclose(
        np.array(mbs.models.inverse_dynamics(symbolic)(q, v, a, [0.7, 0.3])),
        np.array(mbs.models.inverse_dynamics(number)(q, v, a)),
        rtol=1e-12,
    )
    np.testing.assert_allclose(
        pose_of(symbolic, "b", q, [0.7, 0.3]), pose_of(number, "b", q), atol=1e-14
    )
    refused(
        ModelError,
        "m: parameters 'L' and 'A' have no value",
        "give them defaults",
        by=symbolic.parameter_values,
    )
    refused(
        ModelError,
        "m: there is no parameter 'LL'; did you mean 'L'?",
        by=lambda: symbolic.parameter_values({"LL": 1}),
    )
    assert symbolic.parameter_values({"L": 1, "A": 2}) == [1, 2]


def test_values_by_name():
    m = mbs.Mechanism("m")
    a, b = m.add(solid("a")), m.add(solid("b"))
    m.connect(m.world, Revolute("hip"), a)
    m.connect(a, Revolute("knee"), b)
    system = m.assemble(guess={"knee": 0.5})
    assert system.configuration == (0, 0.5)
    assert system.position({"hip": 1}) == [1, 0.5]
    assert system.position(None) == [0, 0.5]
    assert system.velocity({"knee": 2}) == [0, 2]
    assert system.position(np.array([3, 4])) == [3, 4]
    for call, parts in (
        (
            lambda: system.position([1]),
            ["m: the position has 1 values, the system has 2: hip, knee"],
        ),
        (lambda: system.velocity([1, 2, 3]), ["m: the velocity has 3 values, the system has 2"]),
        (
            lambda: system.position({"kne": 1}),
            ["m: there is no coordinate 'kne'; did you mean 'knee'?"],
        ),
        (
            lambda: system.position({"hip": "a"}),
            ["m: the position of hip is 'a'", "give numbers"],
        ),
        (lambda: system.velocity("ab"), ["m: the velocity is 'ab'", "give numbers"]),
        (lambda: system.frame("c"), ["m: there is no frame 'c'"]),
        (lambda: system.frame(3), ["m: there is no link 3; the links are 1 to 2"]),
    ):
        refused(ModelError, *parts, by=call)


def test_given_frames_on_joints():
    m = mbs.Mechanism("m")
    joint, b = Revolute("j"), m.add(solid("b"))
    m.connect(m.world, joint, b)
    m.add_frame("hub", joint.frame_b.at(1, 2, 3))
    m.add_frame("stator", joint.frame_a.at(1))
    system = m.assemble()
    T = pose_of(system, "hub", [np.pi / 2])
    np.testing.assert_allclose(T[:3, 3], [-2, 1, 3], atol=1e-15)
    np.testing.assert_allclose(pose_of(system, "stator", [1.0])[:3, 3], [1, 0, 0])


def refusing(build):
    def call():
        m = mbs.Mechanism("m")
        build(m, m.add(solid("b")))
        m.assemble()

    return call


def contradictory(m, b):
    m.connect(m.world, Revolute("j"), b)
    c = m.add(PointMass("c", 1))
    m.connect(b.at(1), c)
    m.connect(b.at(1, 0.003, 0.004, rotation=("z", np.pi)), c)


def island(m, b):
    c = m.add(solid("c"))
    m.connect(m.world, Revolute("j"), b)
    m.connect(c, Revolute("k"), m.add(solid("d")))


def half(m, b):
    m.connect(m.world, b)
    m.connect(m.world, m.add(Revolute("j")).frame_a)


def cut_bridge(joint):
    def build(m, b):
        m.connect(m.world, joint, b)
        m.connect(b.at(1), Revolute("k"), m.add(solid("c")))
        m.cut(joint)

    return build


def base_body(m, b):
    m.connect(m.world, Revolute("j"), b)
    m.connect(b, Revolute("k"), m.add(solid("base")))


def lone_gear(m, b):
    m.connect(m.world, Revolute("j"), b)
    m.add(Coupling("gear", "k", "j"))


@pytest.mark.parametrize(
    ("build", "parts"),
    [
        (lambda m, b: None, ["m: there is no joint that moves", "connect bodies by joints"]),
        (
            lambda m, b: m.connect(m.world, Fixed("f"), b),
            ["m: there is no joint that moves", "connect"],
        ),
        (
            lambda m, b: m.connect(m.world, Revolute("j"), m.add(solid("c"))),
            ["m: 'b' is connected to nothing", "leave it out"],
        ),
        (
            lambda m, b: m.connect(b, Revolute("j"), b.at(1)),
            ["m: joint 'j' connects 'b' to itself", "connect it to two"],
        ),
        (half, ["m: frame_b of joint 'j' is connected to nothing", "connect it"]),
        (island, ["m: no chain of joints leads from the world to 'c'", "Free joint"]),
        (
            contradictory,
            ["'c' is welded at two places that differ by 0.005 m and 3.14 rad", "take one"],
        ),
        (cut_bridge(Revolute("j")), ["m: joint 'j' cannot be cut", "take this cut away"]),
        (cut_bridge(Fixed("f")), ["m: joint 'f' cannot be cut", "take this cut away"]),
        (base_body, ["m: the body 'base' is not the frame of the world", "rename the body"]),
        (lone_gear, ["gear: there is no coordinate 'k' in the tree", "the coordinates are j"]),
    ],
    ids=range(11),
)
def test_refused(build, parts):
    refused(AssemblyError, *parts, by=refusing(build))


def test_a_body_named_base_may_stand_on_the_base():
    m = mbs.Mechanism("m")
    base, b = m.add(solid("base")), m.add(solid("b"))
    m.connect(m.world, base)
    m.connect(base.at(1), Revolute("j"), b)
    assert [row.name for row in m.assemble().bodies] == ["b"]


def test_a_guess_names_a_coordinate():
    m = mbs.Mechanism("m")
    m.connect(m.world, Revolute("knee"), m.add(solid("b")))
    refused(
        AssemblyError,
        "m: the guess names 'kne'",
        "did you mean 'knee'?",
        by=lambda: m.assemble(guess={"kne": 1}),
    )


def test_two_values_of_a_parameter_are_refused_at_assembly():
    m = mbs.Mechanism("m")
    b = m.add(Body("b", Parameter("x", 1.0)))
    m.connect(m.world.at(Parameter("x", 2.0)), Revolute("j"), b)
    refused(AssemblyError, "m: parameter x has the values 1 and 2; give it one", by=m.assemble)


def test_kinds_of_random_trees_cover_every_joint():
    assert set(ALL_KINDS) - set(KINDS) == {"free"}
    assert len(ALL_KINDS) == 7
