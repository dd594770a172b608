"""SDFormat files: the same mechanism as composed of components, or as a URDF file has it."""

import math

import numpy as np
import pytest

import mbs
from mbs import Mechanism
from mbs.components import (
    Body,
    Revolute,
    Spherical,
    Universal,
)
from mbs.errors import DescriptionError
from mbs.expressions import to_float
from mbs.formats import read_sdf

CLOSE = 1e-12
"""Of the largest value: rotations are products of matrices here, and of angles there."""

INERTIAL = """<inertial><pose>.1 .2 .3 .1 0 .3</pose><mass>2</mass><inertia><ixx>.3</ixx>
<iyy>.4</iyy><izz>.35</izz><ixy>.01</ixy><ixz>.02</ixz><iyz>.03</iyz></inertia></inertial>"""
PLAIN = """<inertial><mass>2</mass><inertia><ixx>.3</ixx><iyy>.3</iyy><izz>.3</izz></inertia>
</inertial>"""


@pytest.fixture
def read(tmp_path):
    def loaded(model, version="1.9", around="{}", suffix=".sdf", **options):
        path = tmp_path / f"robot{suffix}"
        content = f'<model name="m">{model}</model>' if not model.startswith("<model") else model
        path.write_text(f'<sdf version="{version}">{around.format(content)}</sdf>')
        return mbs.load(path, **options)

    return loaded


@pytest.fixture
def refused(read):
    def check(model, message, **options):
        with pytest.raises(DescriptionError) as error:
            read(model, **options)
        assert message in str(error.value)
        assert "\n" not in str(error.value)

    return check


def link(name, inner=PLAIN, pose=""):
    return f'<link name="{name}">{pose and f"<pose>{pose}</pose>"}{inner}</link>'


def joint(name, kind, parent, child, inner="<axis><xyz>0 0 1</xyz></axis>"):
    return (
        f'<joint name="{name}" type="{kind}"><parent>{parent}</parent><child>{child}</child>'
        f"{inner}</joint>"
    )


def same(one, other, seed=0, frames=None):
    """The same inertia matrix, inverse dynamics and poses at a random state."""
    one, other = (s.assemble() if isinstance(s, Mechanism) else s for s in (one, other))
    names = [c.name for c in one.coordinates]
    assert [c.name for c in other.coordinates] == names
    rng = np.random.default_rng(seed)
    q, (v, a) = rng.uniform(-1, 1, one.nq), rng.uniform(-1, 1, (2, len(one.independent)))
    for k, name in enumerate(names):
        if name.endswith("qw"):
            q[k : k + 4] /= np.linalg.norm(q[k : k + 4])
    if one.cuts or one.couplings:
        q = np.array(one.configuration)
        assert other.configuration == pytest.approx(q, abs=1e-10)  # closed by Newton's method
    M, N = (np.array(mbs.models.inertia_matrix(s)(q)) for s in (one, other))
    assert pytest.approx(M, abs=CLOSE * abs(M).max()) == N
    x, y = (np.array(mbs.models.inverse_dynamics(s)(q, v, a)) for s in (one, other))
    assert y == pytest.approx(x, abs=CLOSE * max(1, abs(x).max()))
    for name in frames or one.frames:
        T, U = (np.array(mbs.models.transform(s, name)(q)) for s in (one, other))
        assert pytest.approx(T, abs=CLOSE * max(1, abs(T).max())) == U, name


URDF_INERTIAL = """<inertial><origin xyz=".1 .2 .3" rpy=".1 0 .3"/><mass value="2"/>
<inertia ixx=".3" iyy=".4" izz=".35" ixy=".01" ixz=".02" iyz=".03"/></inertial>"""
URDF = f"""<robot name="m"><link name="world"/><link name="a">{URDF_INERTIAL}</link>
<link name="b">{URDF_INERTIAL}</link><link name="c">{URDF_INERTIAL}</link><link name="tool"/>
<joint name="j" type="revolute"><parent link="world"/><child link="a"/>
<origin xyz=".1 .2 .3" rpy=".4 .5 .6"/><axis xyz="0 .6 .8"/>
<limit lower="-1" upper="2" effort="3" velocity="4"/><dynamics damping=".5" friction=".2"/></joint>
<joint name="k" type="continuous"><parent link="a"/><child link="b"/>
<origin xyz="1 0 0" rpy="0 1 0"/><axis xyz="1 0 0"/></joint>
<joint name="s" type="prismatic"><parent link="b"/><child link="c"/>
<origin xyz="0 1 0" rpy="0 0 -.7"/><axis xyz="0 1 1"/><limit lower="-1" upper="1" effort="5"
velocity="0"/><mimic joint="j" multiplier="2" offset=".1"/></joint>
<joint name="f" type="fixed"><parent link="c"/><child link="tool"/>
<origin xyz=".3 .2 .1" rpy=".1 .2 .3"/></joint></robot>"""
SDF = (
    f"""<link name="a"><pose relative_to="j"/>{INERTIAL}</link>
<link name="b"><pose relative_to="k"/>{INERTIAL}</link>
<link name="c"><pose relative_to="s"/>{INERTIAL}</link>"""
    + joint(
        "j",
        "revolute",
        "world",
        "a",
        """<pose relative_to="__model__">.1 .2 .3 .4 .5 .6</pose><axis><xyz>0 .6 .8</xyz><limit>
<lower>-1</lower><upper>2</upper><effort>3</effort><velocity>4</velocity></limit><dynamics>
<damping>.5</damping><friction>.2</friction></dynamics></axis>""",
    )
    + joint(
        "k",
        "continuous",
        "a",
        "b",
        """<pose relative_to="a">1 0 0 0 1 0</pose><axis><xyz>1 0 0</xyz>
<limit><effort>inf</effort></limit></axis>""",
    )
    + joint(
        "s",
        "prismatic",
        "b",
        "c",
        """<pose relative_to="b">0 1 0 0 0 -.7</pose><axis><xyz>0 1 1</xyz><limit><lower>-1</lower>
<upper>1</upper><effort>5</effort></limit><mimic joint="j"><multiplier>2</multiplier>
<offset>.3</offset><reference>.1</reference></mimic></axis>""",
    )
    + '<frame name="tool" attached_to="c"><pose>.3 .2 .1 .1 .2 .3</pose></frame>'
)


def test_the_same_as_a_urdf_file(read, tmp_path):
    path = tmp_path / "m.urdf"
    path.write_text(URDF)
    one, other = mbs.load(path), read(SDF, "1.11")
    assert other.notes == []
    same(one, other, frames=["a", "b", "c", "tool"])
    for x, y in zip(one.joints(), other.joints(), strict=True):
        for name in ("name", "limits", "velocity", "effort", "actuated", "Fv", "Fs"):
            assert getattr(x, name) == getattr(y, name), name


def test_the_same_in_every_way_of_placing(read):
    """Links in the model, axes in the model (1.4) or in another frame, degrees, quaternions."""
    turn = "0 0 0.3"
    old = link("a", INERTIAL, f"0 0 1 {turn}") + link("b", INERTIAL, f"1 0 1 {turn}")
    world = joint("w", "fixed", "world", "a", "")
    axis = "<axis><xyz>0 1 0</xyz>{}</axis>"
    one = read(old + world + joint("j", "revolute", "a", "b", axis.format("")), "1.6")
    flag = "<use_parent_model_frame>{}</use_parent_model_frame>"
    in_model = axis.format(flag.format("true"))
    by_model = read(old + world + joint("j", "revolute", "a", "b", in_model), "1.6")
    plain = axis.format("")
    oldest = read(old + world + joint("j", "revolute", "a", "b", plain), "1.4")
    new = axis.replace("<xyz>", '<xyz expressed_in="__model__">').format("")
    newest = read(old + world + joint("j", "revolute", "a", "b", new), "1.12")
    same(by_model, oldest)
    same(by_model, newest)
    # in the model y is another direction than in the joint, which is turned with the link
    tip = [
        np.array(mbs.models.transform(m.assemble(), "b")([0.5]))[:3, :3] for m in (one, by_model)
    ]
    c, s = math.cos(0.3), math.sin(0.3)
    Z = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    c, s = math.cos(0.5), math.sin(0.5)
    Y = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    assert tip[0] == pytest.approx(Z @ Y, abs=CLOSE)
    assert tip[1] == pytest.approx(Y @ Z, abs=CLOSE)
    half = 0.15
    for pose in (
        f'<pose rotation_format="quat_xyzw">1 0 1 0 0 {math.sin(half)} {math.cos(half)}</pose>',
        f'<pose degrees="true">1 0 1 0 0 {math.degrees(0.3)}</pose>',
        '<pose relative_to="a">1 0 0 0 0 0</pose>',
        '<pose relative_to="f">0 0 0 0 0 0.3</pose>',
    ):
        where = "1 0 1 0 0 0" if 'relative_to="a"' not in pose else "0 0 0 0 0 0"
        frame = f'<frame name="f"><pose>{where}</pose></frame>'
        other = link("a", INERTIAL, f"0 0 1 {turn}") + f'<link name="b">{pose}{INERTIAL}</link>'
        found = read(frame + other + world + joint("j", "revolute", "a", "b", plain))
        if 'relative_to="a"' not in pose:
            same(one, found, frames=["a", "b"])
        else:
            T = np.array(mbs.models.transform(found.assemble(), "b")([0.0]))
            assert T[:3, 3] == pytest.approx([math.cos(0.3), math.sin(0.3), 1], abs=CLOSE)


FOUR_BAR = (
    link("crank", INERTIAL, "0 0 0 0 0 1")
    + link("rocker", INERTIAL, "1 0 0 0 0 1.2")
    + link("coupler", INERTIAL, "{x} {y} 0 0 0 {turn}")
    + joint("a", "revolute", "world", "crank")
    + joint("b", "revolute", "world", "rocker")
    + joint("c", "revolute", "crank", "coupler")
    + joint("d", "revolute", "coupler", "rocker", "<pose>.8 0 0 0 0 0</pose><axis/>")
)


def four_bar():
    """Drawn closed: the coupler leads from the end of the crank to that of the rocker."""
    start = np.array([0.4 * math.cos(1), 0.4 * math.sin(1)])
    end = np.array([1 + 0.8 * math.cos(1.2), 0.8 * math.sin(1.2)])
    along = end - start
    turn = math.atan2(along[1], along[0])
    return FOUR_BAR.format(x=start[0], y=start[1], turn=turn), np.linalg.norm(along), turn


def test_a_link_with_two_parents_closes_a_loop(read):
    text, length, turn = four_bar()
    numbers = {"mass": 2, "com": (0.1, 0.2, 0.3)}
    R = np.array(
        [
            [math.cos(0.3), -math.sin(0.3), 0],
            [math.sin(0.3), math.cos(0.3), 0],
            [0, 0, 1],
        ]
    ) @ np.array([[1, 0, 0], [0, math.cos(0.1), -math.sin(0.1)], [0, math.sin(0.1), math.cos(0.1)]])
    J = R @ np.array([[0.3, 0.01, 0.02], [0.01, 0.4, 0.03], [0.02, 0.03, 0.35]]) @ R.T
    m = Mechanism("m")
    crank, rocker, coupler = (
        m.add(Body(n, inertia=((J + J.T) / 2).tolist(), **numbers))
        for n in ("crank", "rocker", "coupler")
    )
    m.connect(m.world.at(rotation=("z", 1)), Revolute("a"), crank)
    m.connect(m.world.at(1, rotation=("z", 1.2)), Revolute("b"), rocker)
    m.connect(crank.at(0.4, rotation=("z", turn - 1)), Revolute("c"), coupler)
    d = Revolute("d")
    m.connect(coupler.at(float(length), rotation=("z", 1.2 - turn)), d, rocker.at(0.8))
    one, other = m.assemble(active=["a"]), read(text).assemble(active=["a"])
    assert other.closure.mobility == 1
    assert len(other.cuts) == 1
    assert max(map(abs, other.configuration)) < 1e-10  # drawn closed
    same(one, other, frames=["crank", "rocker", "coupler"])
    cut = text.replace(
        "<axis/>",
        "<axis/><physics><simbody><must_be_loop_joint>1</must_be_loop_joint></simbody></physics>",
    )
    assert read(cut).assemble().cuts[0].edge.joint.name == "d"
    cut = cut.replace('"d" type="revolute"', '"d" type="ball"').replace("<axis/>", "")
    assert read(cut).assemble().closure.mobility == 1


def test_what_no_joint_holds_is_free(read):
    text = link("a", INERTIAL, "0 0 1 0 0 0.6") + link("b", INERTIAL, "1 0 1 0 0 0")
    text += joint("j", "revolute", "a", "b")
    m = read(text)
    system = m.assemble()
    assert [c.name for c in system.coordinates][-2:] == ["root_joint.qz", "j"]
    assert m.guess["root_joint.z"] == 1
    T = np.array(mbs.models.transform(system, "b")(system.configuration))
    assert T[:3, 3] == pytest.approx([1, 0, 1], abs=CLOSE)
    fixed = read(text, base="fixed").assemble()
    assert (fixed.nq, system.nv) == (1, 7)
    T = np.array(mbs.models.transform(fixed, "b")([0.0]))
    assert T[:3, 3] == pytest.approx([1, 0, 1], abs=CLOSE)
    held = text + joint("w", "fixed", "world", "a", "")
    assert read(held).assemble().nv == 1
    assert read(held, base="free").assemble().nv == 7
    two = read(text + link("c", INERTIAL, "5 0 0 0 0 0")).assemble()
    assert two.nv == 13
    assert "root_joint2.x" in [c.name for c in two.coordinates]
    static = read("<static>true</static>" + text)
    assert "it is static; its links are welded to the world" in str(static.notes[0])
    assert list(static.joints()) == []
    assert read("<static>1</static>" + text, base="free").assemble().nv == 7


def bodies_for(m):
    return [m.add(Body(n, mass=2, inertia=(0.3, 0.3, 0.3))) for n in "abc"]


CHAIN = link("a") + link("b", PLAIN, "1 0 0 0 0 0") + joint("j", "revolute", "world", "a")


def test_ball_and_universal_joints(read):
    m = Mechanism("m")
    a, b, c = bodies_for(m)
    m.connect(m.world, Revolute("j"), a)
    m.connect(a.at(1), Spherical("s"), b)
    m.connect(b.at(1), Universal("u", axes=("y", "z"), Fv=0.3, limits={"phi_b": (-1, 1)}), c)
    axes = """<axis><xyz>0 1 0</xyz><dynamics><damping>.3</damping></dynamics></axis><axis2>
<xyz>0 0 1</xyz><limit><lower>-1</lower><upper>1</upper></limit><dynamics><damping>.3</damping>
</dynamics></axis2>"""
    text = CHAIN + link("c", PLAIN, "2 0 0 0 0 0") + joint("s", "ball", "a", "b", "")
    found = read(text + joint("u", "universal", "b", "c", axes))
    same(m, found)
    assert found.components["u"].limits == (("phi_b", (-1.0, 1.0)),)


def test_two_revolute_joints_in_one(read):
    """Axes that are not orthogonal, and dynamics that differ, need two joints in a row."""
    for kind, second in (("revolute2", "0 .6 .8"), ("universal", "0 0 1")):
        m = Mechanism("m")
        a, b, _ = bodies_for(m)
        cross = m.add(Body("k_between", mass=0))
        m.connect(m.world, Revolute("j"), a)
        axis = tuple(map(float, second.split()))
        m.connect(a.at(1), Revolute("k_1", axis="y", stiffness=4, rest=0.2), cross)
        m.connect(cross, Revolute("k_2", axis=axis, Fv=0.3), b)
        del m.components["c"]
        axes = f"""<axis><xyz>0 1 0</xyz><dynamics><spring_stiffness>4</spring_stiffness>
<spring_reference>.2</spring_reference></dynamics></axis><axis2><xyz>{second}</xyz><dynamics>
<damping>.3</damping></dynamics></axis2>"""
        same(m, read(CHAIN + joint("k", kind, "a", "b", axes)), frames=["a", "b"])


@pytest.mark.parametrize(
    ("text", "pitch"),
    [
        ("<screw_thread_pitch>.4</screw_thread_pitch>", 0.4),
        ("<thread_pitch>-20</thread_pitch>", 2 * math.pi / 20),
        ("", 1.0),
    ],
)
def test_a_screw_advances_by_its_pitch(read, text, pitch):
    inner = text + "<axis><xyz>1 0 0</xyz><dynamics><damping>.2</damping></dynamics></axis>"
    system = read(CHAIN + joint("k", "screw", "a", "b", inner)).assemble(active=["j", "k"])
    assert system.closure.mobility == 2
    q = [0.0] * 3
    names = [c.name for c in system.coordinates]
    q[names.index("k")], q[names.index("k_slide")] = 0.7, 0.7 * pitch / (2 * math.pi)
    T = np.array(mbs.models.transform(system, "b")(q))
    assert T[0, 3] == pytest.approx(1 + 0.7 * pitch / (2 * math.pi), abs=CLOSE)
    assert T[2, 1] == pytest.approx(math.sin(0.7), abs=CLOSE)
    # kinetic energy of one degree of freedom: 0.3 of the turn and 2 kg along the thread
    M = np.array(mbs.models.inertia_matrix(system, coordinates="independent")(q))
    lead = pitch / (2 * math.pi)
    k = [system.velocity_coordinates[i].name for i in system.independent].index("k")
    assert M[k, k] == pytest.approx(0.3 + 2 * lead**2, rel=CLOSE)


def test_gears_turn_against_each_other(read):
    """theta_2 = -ratio theta_1, whichever way the joints of the two wheels are written."""
    wheels = link("a") + link("b", PLAIN, "1 0 0 0 0 0") + link("frame")
    wheels += joint("w", "fixed", "world", "frame", "")
    gears = """<gearbox_ratio>3</gearbox_ratio><gearbox_reference_body>frame
</gearbox_reference_body><axis><xyz>0 0 1</xyz></axis><axis2><xyz>0 0 1</xyz></axis2>"""
    for first, second, factor in (
        (("frame", "a", "0 0 1"), ("frame", "b", "0 0 1"), -3),
        (("frame", "a", "0 0 -1"), ("frame", "b", "0 0 1"), 3),
        (("a", "frame", "0 0 1"), ("frame", "b", "0 0 1"), 3),
        (("a", "frame", "0 0 1"), ("frame", "b", "0 0 -1"), -3),
    ):
        text = wheels
        for name, (parent, child, axis) in (("j", first), ("k", second)):
            text += joint(name, "revolute", parent, child, f"<axis><xyz>{axis}</xyz></axis>")
        m = read(text + joint("g", "gearbox", "a", "b", gears))
        (coupling,) = m.couplings()
        assert (coupling.driven, coupling.driver) == ("k", "j")
        assert [to_float(c) for c in coupling.coefficients] == [0, factor]


def test_models_in_models(read):
    inner = (
        link("hand")
        + link("thumb", PLAIN, ".1 0 0 0 0 0")
        + joint("t", "revolute", "hand", "thumb")
    )
    text = (
        link("arm")
        + joint("w", "fixed", "world", "arm", "")
        + '<model name="grip" placement_frame="thumb"><pose relative_to="arm">0 0 1 0 0 0</pose>'
        f"{inner}</model>"
        + joint("j", "prismatic", "arm", "grip::hand")
        + '<frame name="tip" attached_to="grip"><pose relative_to="grip::thumb">0 1 0 0 0 0</pose>'
        "</frame>"
    )
    system = read(text).assemble()
    assert [c.name for c in system.coordinates] == ["j", "grip::t"]
    T = np.array(mbs.models.transform(system, "grip::thumb")([0, 0]))
    assert T[:3, 3] == pytest.approx([0, 0, 1], abs=CLOSE)
    T = np.array(mbs.models.transform(system, "tip")([0.5, 1]))  # on the hand, not on the thumb
    assert T[:3, 3] == pytest.approx([0, 1, 1.5], abs=CLOSE)


def test_worlds(read, refused):
    ground = '<model name="ground"><static>1</static><link name="l"/></model>'
    world = '<world name="w"><gravity>0 0 -1.6</gravity><light name="sun"/>' + ground + "{}</world>"
    m = read(CHAIN + joint("k", "revolute", "a", "b"), around=world, suffix=".world")
    assert [to_float(g) for g in m.world.gravity] == [0, 0, -1.6]
    assert [str(n).partition(": ")[2] for n in m.notes] == [
        "model 'ground': it is static, and left out"
    ]
    default = read(CHAIN + joint("k", "revolute", "a", "b"), around="<world>{}</world>")
    assert [to_float(g) for g in default.world.gravity] == [0, 0, -9.8]
    placed = '<frame name="f"><pose>0 0 2 0 0 0</pose></frame>{}'
    model = f'<model name="m"><pose relative_to="f">1 0 0 0 0 0</pose>{link("a")}</model>'
    m = read(model, around=f"<world>{placed}</world>")
    assert (m.guess["root_joint.x"], m.guess["root_joint.z"]) == (1, 2)
    refused(model + model.replace('"m"', '"n"'), "there are 2 models ('m', 'n')")


def test_links_without_gravity_and_rotors(read):
    text = CHAIN.replace('<link name="b">', '<link name="b"><gravity>false</gravity>')
    text += joint(
        "k",
        "revolute",
        "a",
        "b",
        "<axis><xyz>0 1 0</xyz></axis><drake:rotor_inertia>.01</drake:rotor_inertia>"
        "<drake:gear_ratio>10</drake:gear_ratio>",
    )
    text = text.replace("<mass>2</mass>", "<pose>.5 0 0 0 0 0</pose><mass>2</mass>")
    m = read(text)
    assert m.notes == []
    assert to_float(m.components["k"].Ia) == pytest.approx(1.0)
    system = m.assemble()
    tau = mbs.models.inverse_dynamics(system)([0.3, 0.4], [0, 0], [0, 0])
    assert np.array(tau).ravel() == pytest.approx([0, 0], abs=CLOSE)
    system = read(text.replace("<gravity>false</gravity>", "")).assemble()
    tau = mbs.models.inverse_dynamics(system)([0.3, 0.4], [0, 0], [0, 0])
    assert float(np.array(tau)[1].item()) == pytest.approx(-2 * 9.81 * 0.5 * math.cos(0.4))


NOTED = {
    "inertial": (link("a", ""), "link 'a': it has no <inertial>; of 1 kg and 1 kg m^2"),
    "mass": (link("a", "<inertial/>"), "its inertial has no ixx, iyy, izz, mass; taken as 1"),
    "plugin": (link("a") + "<plugin/>", "a <plugin> is not read"),
    "unknown": (link("a", PLAIN + "<colour/>"), "<colour> is not read"),
    "axis": (link("a") + joint("j", "revolute", "world", "a", ""), "it has no <axis>"),
    "limits": (
        link("a")
        + joint(
            "j",
            "revolute",
            "world",
            "a",
            "<axis><limit><lower>2</lower><upper>1</upper></limit></axis>",
        ),
        "its limits (2, 1) leave it no range; taken as unlimited",
    ),
    "name": (link("world arm"), "link 'world arm': it is 'world_arm' here"),
    "base": (link("base"), "link 'base': it is 'base_link' here"),
    "visuals": (
        link("a", INERTIAL + '<visual name="v"/><visual name="w"/>') + link("b", INERTIAL),
        "<visual>: the 2 visuals of 'a' are not read, nor drawn",
    ),
    "tensor": (
        link("a", PLAIN.replace("<izz>.3", "<izz>3")),
        "which no body has; taken as it is",
    ),
}


@pytest.mark.parametrize("case", NOTED)
def test_notes(read, refused, case):
    text, message = NOTED[case]
    assert message in " ".join(map(str, read(text).notes))
    refused(text, message, strict=True)


REFUSED = {
    "no link": ("<pose/>", "model 'm' has no <link>"),
    "include": (link("a") + "<include><uri>model://x</uri></include>", "it includes 'model://x'"),
    "kinematic": (link("a", PLAIN + "<kinematic>1</kinematic>"), "it is kinematic"),
    "auto": (link("a", '<inertial auto="true"/>'), "computed from its collisions"),
    "decay": (
        link("a", PLAIN + "<velocity_decay><linear>.1</linear></velocity_decay>"),
        "its velocity_decay is not read",
    ),
    "fluid": (link("a", "<inertial><fluid_added_mass/></inertial>"), "fluid_added_mass"),
    "drake": (link("a") + "<drake:joint/>", "<drake:joint> would change the motion"),
    "type": (link("a") + joint("j", "floating", "world", "a"), "type 'floating' is unknown"),
    "child": (link("a") + joint("j", "revolute", "world", "b"), "child is 'b', which does not"),
    "self": (link("a") + joint("j", "revolute", "a", "a"), "its parent and its child are one"),
    "axis": (
        link("a") + joint("j", "revolute", "world", "a", "<axis><xyz>0 0 0</xyz></axis>"),
        "its axis has zero length",
    ),
    "twice": (link("a") + link("a"), "another part of the model has this name"),
    "cycle": (
        '<frame name="f"><pose relative_to="g"/></frame><frame name="g"><pose relative_to="f"/>'
        "</frame>" + link("a"),
        "is placed in itself through others",
    ),
    "carried": (
        '<frame name="f" attached_to="g"/><frame name="g" attached_to="f"/>' + link("a"),
        "is attached to itself through others",
    ),
    "quaternion": (
        f'<link name="a"><pose rotation_format="quat_xyzw">0 0 0 0 0 0 2</pose>{PLAIN}</link>',
        "has not length 1",
    ),
    "number": (link("a", PLAIN, "1 2 x 0 0 0"), "is not 6 finite number(s)"),
    "flag": ("<static>maybe</static>" + link("a"), "static is 'maybe'; write true or false"),
    "mimic": (
        link("a") + joint("j", "revolute", "world", "a", '<axis><mimic joint="x"/></axis>'),
        "it mimics 'x', axis; give another joint with this axis",
    ),
    "gears": (
        link("a")
        + link("b")
        + joint(
            "g",
            "gearbox",
            "a",
            "b",
            "<gearbox_reference_body>world</gearbox_reference_body><axis/><axis2/>",
        ),
        "no revolute joint about its axis connects",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_refused(refused, case):
    text, message = REFUSED[case]
    refused(text, message)


def test_roots_and_versions(tmp_path):
    path = tmp_path / "m.sdf"
    for text, message in (
        ("<robot/>", "the root element is <robot>, not <sdf>"),
        ("<sdf version='x'/>", "version 'x' is none of SDF"),
        ("<sdf version='1.9'/>", "there is no <model> in it"),
        ("<sdf version='1.9'><include/></sdf>", "there is no <model> but <include>"),
        ("<sdf version='1.9'><world/><world/></sdf>", "there are 2 worlds"),
    ):
        path.write_text(text)
        with pytest.raises(DescriptionError) as error:
            read_sdf(path)
        assert message in str(error.value)
    path.write_text(f"<sdf version='1.99'><model>{link('a')}</model></sdf>")
    notes = [str(note) for note in read_sdf(path).notes]
    assert notes == [
        "line 1: <sdf>: its version is 1.99; read as 1.12",
        "line 1: <model>: it has no name; named 'm'",
    ]


def test_a_link_and_a_joint_of_one_name_before_1_7(read, refused):
    text = link("a") + joint("a", "revolute", "world", "a")
    assert [c.name for c in read(text, "1.6").assemble().coordinates] == ["a"]
    refused(text, "another part of the model has this name")


def test_initial_positions_and_efforts_of_zero(read):
    inner = "<axis><initial_position>.4</initial_position><limit><effort>0</effort></limit></axis>"
    m = read(link("a") + joint("j", "revolute", "world", "a", inner), "1.6")
    assert m.guess == {"j": 0.4}
    assert m.components["j"].actuated is False
