"""Model files of MuJoCo: what is written is read by MuJoCo and by us, and moves the same."""

import numpy as np
import pytest
from support.catalogue_systems import catalogue_system

import mbs
from mbs import Mechanism
from mbs.components import (
    Body,
    Box,
    Coupling,
    Cylindrical,
    Fixed,
    FixedTendon,
    Force,
    Free,
    JointStop,
    KhalilBody,
    PointMass,
    Prismatic,
    Revolute,
    Rotor,
    Spherical,
    Spring,
    Universal,
)
from mbs.components.joints import Motion
from mbs.errors import ExportError, ModelError
from mbs.export.robot_tables import child_positions
from mbs.models import direct_dynamics, energy, inertia_matrix, inverse_dynamics, transform

mujoco = pytest.importorskip("mujoco")
twins = pytest.importorskip("formats.test_mujoco_spec")


def tree():
    """Every kind of joint, two bodies on a link, springs, named frames, a static body."""
    m = Mechanism("every_joint", gravity=(0.3, -0.2, -9.7))
    flyer = m.add(Body("flyer", mass=2, com=(0.1, 0, 0.2), inertia=(0.3, 0.2, 0.25)))
    m.connect(m.world, Free("free"), flyer)
    box = m.add(Box("box", length=0.4, width=0.1, density=500))
    tool = m.add(Body("tool", mass=0.3, com=(0, 0.1, 0), inertia=(0.01, 0.02, 0.015)))
    turn = Revolute("turn", axis=(1, 2, 3), Fv=0.3, Ia=0.02, stiffness=4, rest=0.3, limits=(-1, 2))
    m.connect(flyer.at(0.2, 0.1, 0, rotation=("x", 0.4)), turn, box.left)
    m.connect(box.right.at(rotation=("z", 0.7)), tool)
    slider = m.add(Body("slider", mass=1, inertia=(0.1, 0.1, 0.1)))
    m.connect(box.right, Prismatic("slide", axis="y", actuated=True, effort=(-3, 5)), slider)
    ball = m.add(Body("ball", mass=1, com=(0.2, 0, 0), inertia=(0.1, 0.1, 0.15)))
    m.connect(slider.at(0, 0, 0.3), Spherical("socket"), ball.at(0.1, 0, 0, rotation=("y", 1.0)))
    cross = m.add(Body("cross", mass=1, com=(0, 0.2, 0), inertia=(0.1, 0.1, 0.15)))
    m.connect(m.world.at(0, 1, 0), Universal("cardan"), cross)
    nut = m.add(PointMass("nut", mass=0.4))
    m.connect(cross.at(0, 0.4, 0), Cylindrical("screw", axis="x"), nut)
    post = m.add(Body("post", mass=7, inertia=(1, 1, 1)))
    m.connect(m.world.at(3, 0, 0), post)
    m.add(Spring("coil", post, ball, stiffness=30, length=0.5, damping=2))
    m.add(
        FixedTendon(
            "cord",
            levers=(("turn", 0.5), ("slide", -2)),
            stiffness=9,
            length=(-0.1, 0.2),
            damping=1,
        )
    )
    m.add_frame("tip", tool.at(0.1, 0.2, 0.3, rotation=("y", 0.5)))
    return m


def state(system, seed=0):
    rng = np.random.default_rng(seed)
    q, v, a = (rng.normal(size=n) for n in (system.nq, system.nv, system.nv))
    for link in system.tree.links:
        if link.motion in (Motion.SPHERICAL, Motion.FREE):
            q[link.q][-4:] /= np.linalg.norm(q[link.q][-4:])
    return q, v, a


def values(model, *inputs):
    found = model(*inputs)
    return np.array(found[0] if isinstance(found, tuple) else found)


def close(one, other):
    """Whether they agree within 1e-12 of the largest, rounding of principal axes and back."""
    return np.max(np.abs(one - other)) <= 1e-12 * np.max(np.abs(one))


def test_a_tree_comes_back(tmp_path):
    system = tree().assemble()
    mbs.export.mjcf(system, tmp_path / "m.xml")
    back = mbs.load(tmp_path / "m.xml").assemble()
    names = [c.name.replace(".s", "_s").replace(".phi", "_phi") for c in system.coordinates]
    assert [c.name for c in back.coordinates] == names
    assert [c.limits for c in back.coordinates] == [c.limits for c in system.coordinates]
    assert [s.effort for s in back.velocity_coordinates] == [
        s.effort for s in system.velocity_coordinates
    ]
    q, v, a = state(system)
    assert close(values(inertia_matrix(system), q), values(inertia_matrix(back), q))
    assert close(values(inverse_dynamics(system), q, v, a), values(inverse_dynamics(back), q, v, a))
    for name in ("flyer", "box", "tool", "slider", "ball", "cross", "nut", "tip"):
        assert close(values(transform(system, name), q), values(transform(back, name), q))
    twins.assert_equal_motion(
        twins.Twin(back, mujoco.MjModel.from_xml_path(str(tmp_path / "m.xml")))
    )


@pytest.mark.parametrize("robot", ["puma560", "stanford", "ur5", "cart_pole", "flyball_governor"])
def test_robots_come_back(tmp_path, robot):
    system = catalogue_system(robot)
    mbs.export.mjcf(system, tmp_path / "m.xml")
    back = mbs.load(tmp_path / "m.xml").assemble()
    driven = [s.actuated for s in system.velocity_coordinates]
    # a file without actuators does not say which joints are driven
    assert [s.actuated for s in back.velocity_coordinates] == (
        driven if any(driven) else [True] * len(driven)
    )
    q, v, a = state(system)
    assert close(values(inertia_matrix(system), q), values(inertia_matrix(back), q))
    assert close(values(inverse_dynamics(system), q, v, a), values(inverse_dynamics(back), q, v, a))


@pytest.mark.sweep
@pytest.mark.parametrize("robot", ["four_bar", "sr400", "stewart_platform", "delta", "bricard"])
def test_loops_come_back(tmp_path, robot):
    """Revolute joints as two connects, spherical ones as one, rods as tendons that keep length."""
    system = catalogue_system(robot)
    mbs.export.mjcf(system, tmp_path / "m.xml")
    back = mbs.load(tmp_path / "m.xml").assemble()
    assert back.closure.mobility == system.closure.mobility
    np.testing.assert_allclose(back.configuration, system.configuration, atol=1e-10)
    q, _, tau = state(system)
    q = np.array(system.configuration)
    one, two = (direct_dynamics(s, coordinates="tree") for s in (system, back))
    # the closure of some of them is conditioned by 1e3
    a, b = (values(f, q, 0 * tau, tau) for f in (one, two))
    assert np.max(np.abs(a - b)) <= 1e-10 * np.max(np.abs(a))
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "m.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    rows = data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY
    assert rows.any()
    np.testing.assert_allclose(data.efc_pos[rows], 0, atol=1e-9)


def coupled(**options):
    m = Mechanism("coupled")
    before = m.world
    for k in range(3):
        body = m.add(Body(f"b{k}", mass=1, com=(0.2, 0, 0), inertia=(0.1, 0.1, 0.1)))
        m.connect(before.at(0.3 * bool(k), 0, 0), Revolute(f"j{k}", axis="y"), body)
        before = body
    m.add(Coupling("gear", "j2", "j0", **options))
    return m


@pytest.mark.parametrize(
    "options",
    [
        {"coefficients": (0.1, -2.0)},
        {"coefficients": (0.1, -2.0, 0.3, 0.2, 0.1)},
        {"coefficients": (0.1, -2.0), "others": (("j1", 0.7),)},
    ],
)
def test_couplings_come_back(tmp_path, options):
    system = coupled(**options).assemble()
    mbs.export.mjcf(system, tmp_path / "m.xml")
    back = mbs.load(tmp_path / "m.xml").assemble()
    for q1 in (0.0, 0.3):
        q, r = (mbs.loops.solve(s, {"j0": 0.2, "j1": q1}) for s in (system, back))
        np.testing.assert_allclose(q, r, atol=1e-12)
    q, _, tau = state(system)
    q = np.array(system.configuration)
    one, two = (direct_dynamics(s, coordinates="tree") for s in (system, back))
    assert close(values(one, q, 0 * tau, tau), values(two, q, 0 * tau, tau))


def test_symbols_have_their_values(tmp_path):
    m = Mechanism("pendulum", parameters={"m": 2.0, "L": 0.5})
    body = m.add(Body("bob", mass="m", com=("L", 0, 0), inertia=(0, 0, 0)))
    m.connect(m.world, Revolute("j", axis="y"), body)
    for given, expected in (({}, 0.5), ({"L": 0.25, "m": 4}, 0.25)):
        mbs.export.mjcf(m, tmp_path / "m.xml", given)
        back = mbs.load(tmp_path / "m.xml").assemble()
        assert float(inertia_matrix(back)(0)) == pytest.approx(expected, rel=1e-14)


def pendulum(joint=None, body=None):
    m = Mechanism("p")
    link = m.add(body or Body("b", mass=1, com=(1, 0, 0), inertia=(1, 1, 1)))
    m.connect(m.world, joint or Revolute("j"), link)
    return m


def with_force(force):
    m = pendulum()
    m.add(force(m))
    return m


REFUSED = {
    "not a system": (lambda: "puma560", "'puma560' is a str; give a System or a Mechanism"),
    "rotor": (
        lambda: pendulum(Revolute("j", rotor=Rotor(inertia=1, ratio=3))),
        "p/j: an MJCF file has no rotor about an axis of its own",
    ),
    "stop": (
        lambda: with_force(lambda m: JointStop("s", "j", upper=1, stiffness=9, width=0.1)),
        "p/s: an MJCF file has no JointStop; take it out",
    ),
    "force": (
        lambda: with_force(lambda m: Force("f", m.components["b"], force=(1, 0, 0))),
        "p/f: an MJCF file has no Force",
    ),
    "no body": (
        lambda: pendulum(body=KhalilBody("b", XX=-1.0, M=1.0, grouped=True), joint=Prismatic("j")),
        "p/b: mass 1 kg and principal moments -1, 0, 0 kg m.2 are of no body",
    ),
    "no mass": (
        lambda: pendulum(body=KhalilBody("b", MX=1.0, ZZ=1.0, grouped=True)),
        "p/b: it has first moments and no mass",
    ),
    "long polynomial": (
        lambda: coupled(coefficients=(0, 1, 0, 0, 0, 1)),
        "coupled/gear: an equality of an MJCF file is a polynomial of degree 4",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_the_format_cannot_say_is_refused(tmp_path, case):
    build, message = REFUSED[case]
    with pytest.raises(ModelError, match=message):
        mbs.export.mjcf(build(), tmp_path / "m.xml")
    assert not (tmp_path / "m.xml").exists()


def test_a_loop_of_another_kind_is_refused(tmp_path):
    m = Mechanism("press")
    crank = m.add(Box("crank", length=0.3, width=0.05, density=1000))
    rod = m.add(Box("rod", length=0.8, width=0.05, density=1000))
    m.connect(m.world, Revolute("j1", axis="y"), crank.left)
    m.connect(crank.right, Revolute("j2", axis="y"), rod.left)
    block = m.add(Body("block", mass=1, inertia=(0.1, 0.1, 0.1)))
    m.connect(rod.right, Revolute("j3", axis="y"), block)
    closing = Prismatic("guide", axis="x")
    m.connect(m.world, closing, block)
    m.cut(closing)
    with pytest.raises(ModelError, match=r"press/guide: in an MJCF file a loop .* a Prismatic"):
        mbs.export.mjcf(m, tmp_path / "m.xml")


def test_a_free_joint_on_a_link_is_refused(tmp_path):
    m = pendulum()
    m.connect(m.components["b"], Free("f"), m.add(Body("c", mass=1, inertia=(1, 1, 1))))
    with pytest.raises(ModelError, match=r"p/f: in an MJCF file a free joint is on the world"):
        mbs.export.mjcf(m, tmp_path / "m.xml")


def test_a_file_that_cannot_be_written_is_said(tmp_path):
    with pytest.raises(ExportError, match=r"m\.xml"):
        mbs.export.mjcf(pendulum(), tmp_path / "nowhere" / "m.xml")


def test_a_weld_that_closes_a_loop_comes_back(tmp_path):
    m = Mechanism("ring")
    a = m.add(Box("a", length=0.3, width=0.05, density=1000))
    b = m.add(Box("b", length=0.3, width=0.05, density=1000))
    m.connect(m.world, Revolute("j1", axis="y"), a.left)
    m.connect(m.world.at(0.3, 0, 0), Revolute("j2", axis="y"), b.left)
    bar = m.add(Box("bar", length=0.3, width=0.05, density=1000))
    m.connect(a.right, Revolute("j3", axis="y"), bar.left)
    fixed = Fixed("weld")
    last = m.add(Body("pin", mass=0.1, inertia=(0.1, 0.1, 0.1)))
    m.connect(bar.right, Revolute("j4", axis="y"), last)
    m.connect(last, fixed, b.right)
    m.cut(fixed)
    system = m.assemble(guess={"j1": 1.0, "j2": 1.0, "j3": -1.0})
    mbs.export.mjcf(system, tmp_path / "m.xml")
    assert "<weld" in (tmp_path / "m.xml").read_text()
    back = mbs.load(tmp_path / "m.xml").assemble()
    q, _, tau = state(system)
    q = np.array(system.configuration)
    one, two = (direct_dynamics(s, coordinates="tree") for s in (system, back))
    assert close(values(one, q, 0 * tau, tau), values(two, q, 0 * tau, tau))


def outer_first(**drive):
    """A free body and an arm on a ball, both connected from the outer body to the inner one."""
    m = Mechanism("outer")
    flyer = m.add(Body("flyer", mass=1, com=(0.1, 0, 0), inertia=(0.1, 0.2, 0.25)))
    m.connect(flyer, Free("free", **drive), m.world)
    ball = m.add(Body("ball", mass=2, com=(0, 0.1, 0.2), inertia=(0.1, 0.12, 0.15)))
    m.connect(ball, Spherical("socket", Fv=0.3), m.world.at(0, 0, 0.3, rotation=("y", 1.0)))
    hand = m.add(Body("hand", mass=1, com=(0.1, 0.1, 0), inertia=(0.1, 0.1, 0.15)))
    m.connect(ball.at(0.2, 0, 0), Revolute("j", axis="y"), hand)
    return m


def test_joints_from_the_outer_body_have_the_qpos_of_the_outer_body(tmp_path):
    system = outer_first().assemble()
    mbs.export.mjcf(system, tmp_path / "m.xml")
    back = mbs.load(tmp_path / "m.xml").assemble()
    q, _, _ = state(system)
    qpos = child_positions(system, q)
    assert not np.allclose(q, qpos)
    for name in ("flyer", "ball", "hand"):
        assert close(values(transform(system, name), q), values(transform(back, name), qpos))
    one, other = (float(energy(s)(x, np.zeros(s.nv))[1]) for s, x in ((system, q), (back, qpos)))
    assert one == pytest.approx(other, abs=1e-12)
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "m.xml"))
    np.testing.assert_allclose(
        model.key_qpos[0], child_positions(system, system.configuration), atol=1e-15
    )


def test_friction_between_other_velocities_than_those_of_the_file_is_refused(tmp_path):
    m = outer_first(Ia=0.1)
    m.lock({"socket": (1, 0, 0, 0)})
    for write, file in ((mbs.export.mjcf, "MJCF"), (mbs.export.urdf, "URDF")):
        with pytest.raises(ModelError) as error:
            write(m, tmp_path / "m.xml")
        assert "outer/free: its friction or rotor inertia acts on velocities" in str(error.value)
        assert f"which {file} files do not have; connect the inner body first" in str(error.value)
