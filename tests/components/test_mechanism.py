"""Mechanisms: adding, connecting, nesting, and what they refuse."""

import numpy as np
import pytest
from support.messages import refused

import mbs
import mbs.models
from mbs.components import Body, Box, Coupling, Fixed, PointMass, Revolute
from mbs.errors import AssemblyError, DescriptionError, ModelError
from mbs.expressions import Parameter
from mbs.models.geometry import terminal_frame


@pytest.fixture
def m():
    mechanism = mbs.Mechanism("m")
    body = mechanism.add(Body("b", 1, (0.1, 0, 0), (0.1, 0.1, 0.1)))
    mechanism.connect(mechanism.world, Revolute("j"), body)
    return mechanism


def body(m):
    return m.components["b"]


@pytest.mark.parametrize(
    ("call", "parts"),
    [
        (
            lambda m: m.add(Body("b", mass=0)),
            ["m: two components are named 'b' (Body and Body)", "rename one"],
        ),
        (
            lambda m: m.add(Revolute("b")),
            ["m: two components are named 'b' (Body and Revolute)", "rename"],
        ),
        (lambda m: m.add("b"), ["m: 'b' is no component", "add a body"]),
        (lambda m: m.add(None), ["m: None is no component", "add a body"]),
        (lambda m: m.add(m), ["m: a mechanism cannot be added to itself", "add it to another one"]),
        (
            lambda m: m.connect(m.world, Revolute("j"), body(m)),
            ["two components are named 'j'", "rename one"],
        ),
        (
            lambda m: m.connect(m.world, m.components["j"], body(m)),
            ["frame_a of joint 'j' is connected twice", "use one joint"],
        ),
        (
            lambda m: m.connect(m.components["j"].frame_b, body(m)),
            ["frame_b of joint 'j' is connected twice", "use one joint"],
        ),
        (
            lambda m: m.connect(m.world, Revolute("k")),
            ["m: joint 'k' has nothing on its other side", "write connect"],
        ),
        (
            lambda m: m.connect(m.world, Revolute("k"), "b"),
            ["m: 'b' is not a point", "give a body"],
        ),
        (
            lambda m: m.connect(None, Revolute("k"), body(m)),
            ["m: None is not a point", "give a body"],
        ),
        (
            lambda m: m.connect(m.world, Revolute("k"), m.components["j"]),
            ["m: Revolute 'j' is not a point", "joint.frame_a"],
        ),
        (
            lambda m: m.connect(m.world, body(m), body(m)),
            ["m: Body 'b' stands where a joint belongs", "write connect"],
        ),
        (
            lambda m: m.connect(m.world, Revolute("k"), Body("c", mass=0)),
            ["m: 'c' is connected but is not part", "call add(c) first"],
        ),
        (
            lambda m: m.connect(m.world, Revolute("k"), Body("b", mass=0)),
            ["m: 'b' is connected but is not part", "call add(b) first"],
        ),
        (
            lambda m: m.add_frame("b", body(m)),
            ["m: the frame name 'b' is taken", "choose another name"],
        ),
        (
            lambda m: m.add_frame("base", body(m)),
            ["m: the frame name 'base' is taken", "choose another name"],
        ),
        (
            lambda m: m.add_frame("my tool", body(m)),
            ["'my tool': ", "no blanks", "choose another name"],
        ),
        (
            lambda m: m.add_frame("tool", Body("c", mass=0)),
            ["m: 'c' is connected but is not part", "call add(c) first"],
        ),
        (lambda m: m.cut(Revolute("k")), ["m: joint 'k' is not connected", "connect it before"]),
        (lambda m: m.cut("j"), ["m: 'j' is not a joint", "give the joint itself"]),
    ],
)
def test_refused(m, call, parts):
    refused(DescriptionError, *parts, by=lambda: call(m))


def test_a_frame_name_is_taken_for_frames_and_components(m):
    m.add_frame("tool", body(m).at(1))
    refused(
        DescriptionError,
        "m: the frame name 'tool' is taken",
        by=lambda: m.add_frame("tool", body(m)),
    )
    refused(
        DescriptionError,
        "m: 'tool' is the name of a frame",
        "rename",
        by=lambda: m.add(Body("tool", mass=0)),
    )


def test_names_of_mechanisms_and_parameters():
    refused(
        DescriptionError,
        "'two words'",
        "choose another name",
        by=lambda: mbs.Mechanism("two words"),
    )
    refused(
        DescriptionError,
        "parameter 'two words'",
        "choose",
        by=lambda: mbs.Mechanism("m", parameters={"two words": 1}),
    )


def test_a_parameter_has_one_value(m):
    L = Parameter("L", 1.0)
    m.connect(body(m).at(L), m.add(PointMass("p", Parameter("L", 2.0))))
    refused(
        AssemblyError, "m: parameter L has the values", "1", "2", "give it one", by=m.parameters
    )


def test_a_parameter_is_used():
    m = mbs.Mechanism("m", parameters={"L": 1.0})
    m.connect(m.world.at("d"), Revolute("j", Fv="c"), m.add(Body("b", "mass")))
    refused(
        AssemblyError, "m: parameter 'L' is used by no component", "mass, c, d", by=m.parameters
    )


def test_values_of_parameters():
    m = mbs.Mechanism("m", parameters={"L": 0.3})
    b = m.add(Body("b", Parameter("m", 2.0, "kg")))
    m.connect(m.world.at("L"), Revolute("j"), b)
    m.add_frame("tool", b.at("2*L", "h"))
    assert [(p.name, p.default) for p in m.parameters()] == [("m", 2.0), ("L", 0.3), ("h", None)]
    assert m.parameters()[0].unit == "kg"
    late = mbs.Mechanism("m")
    b = late.add(Body("b", "m"))
    late.connect(late.world.at(Parameter("m", 5.0)), Revolute("j"), b)
    assert [(p.name, p.default) for p in late.parameters()] == [("m", 5.0)]


def arm(name="arm", **options):
    inner = mbs.Mechanism(name, **options)
    upper, fore = (
        inner.add(Body(n, Parameter("m", 1.5), ("L/2", 0, 0), (0, 0.1, 0.1)))
        for n in ("upper", "fore")
    )
    inner.connect(inner.world, Revolute("shoulder"), upper)
    inner.connect(upper.at("L"), Revolute("elbow"), fore)
    inner.add_frame("hand", fore.at("L"))
    return inner


def test_two_of_one_kind():
    m = mbs.Mechanism("pair", gravity=(0, -9.81, 0))
    left = m.add(arm(parameters={"L": 0.4}), name="left")
    right = m.add(arm(parameters={"L": 0.6}), name="right")
    m.connect(m.world, left.base)
    m.connect(m.world.at(2, rotation=("z", np.pi / 2)), right.base)
    m.add(Coupling("gear", "left.elbow", "right.elbow"))
    system = m.assemble()
    assert [p.name for p in system.parameters] == ["left.m", "left.L", "right.m", "right.L"]
    assert system.p_default == [1.5, 0.4, 1.5, 0.6]
    assert [c.name for c in system.coordinates] == [
        "left.shoulder",
        "left.elbow",
        "right.shoulder",
        "right.elbow",
    ]
    hand = mbs.models.transform(system, "right.hand")
    T = np.array(hand([0, 0, 0, 0], system.p_default))
    np.testing.assert_allclose(T[:3, 3], [2, 1.2, 0], atol=1e-15)
    assert left["elbow"].name == "left.elbow"
    assert left.body("fore").name == "left.fore"
    assert right.point("hand").owner.name == "right.fore"
    assert [row.name for row in system.bodies] == [
        "left.upper",
        "left.fore",
        "right.upper",
        "right.fore",
    ]


def test_nesting_twice():
    middle = mbs.Mechanism("middle")
    middle.connect(middle.world.at(0, 0, 1), middle.add(arm()).base)
    m = mbs.Mechanism("outer")
    placed = m.add(middle)
    m.connect(m.world, placed.base)
    system = m.assemble()
    assert [c.name for c in system.coordinates] == ["middle.arm.shoulder", "middle.arm.elbow"]
    assert [p.name for p in system.parameters] == ["middle.arm.m", "middle.arm.L"]
    T = np.array(mbs.models.transform(system, "middle.arm.hand")([0, 0], [1, 0.5]))
    np.testing.assert_allclose(T[:3, 3], [1, 0, 1])


def test_nested_cuts_and_guesses():
    loop = mbs.load("four_bar")
    loop.cut(loop.components["j2"])
    loop.guess = {"j3": -1.8}
    m = mbs.Mechanism("m", gravity=(0, -9.81, 0))
    placed = m.add(loop, name="loop")
    m.connect(m.world, placed.base)
    system = m.assemble()
    assert [cut.edge.joint.name for cut in system.cuts] == ["loop.j2"]
    alone = loop.assemble()
    np.testing.assert_allclose(sorted(system.configuration), sorted(alone.configuration), atol=1e-9)


def test_handles_refuse_unknown_names():
    m = mbs.Mechanism("m")
    placed = m.add(arm())
    refused(
        DescriptionError,
        "'arm.wrist' does not exist; the components are",
        "arm.elbow",
        by=lambda: placed["wrist"],
    )
    refused(
        DescriptionError,
        "arm.elbow is a Revolute, not a body; name a body",
        by=lambda: placed.body("elbow"),
    )
    refused(
        DescriptionError,
        "'arm.foot' is not a frame; the frames are ['arm.hand']",
        by=lambda: placed.point("foot"),
    )
    refused(
        DescriptionError, "m: two components are named 'arm'; rename one", by=lambda: m.add(arm())
    )


def test_scopes_of_parameters_are_names():
    m = mbs.Mechanism("m")
    refused(
        DescriptionError,
        "m: 'my-arm' cannot stand before",
        "write add(mechanism, name=...)",
        by=lambda: m.add(arm("my-arm")),
    )
    assert m.add(arm("my-arm"), name="my_arm").scope == "my_arm"


def test_a_nested_mechanism_is_to_be_connected():
    m = mbs.Mechanism("m")
    m.add(arm())
    refused(
        AssemblyError,
        "m: no chain of joints leads from the world to 'arm.",
        "connect it",
        by=m.assemble,
    )


def test_welds_keep_the_bodies_apart_in_the_description(m):
    m.connect(body(m).at(1), m.add(PointMass("load", 2)))
    m.connect(body(m).at(0, 1), Fixed("glue"), m.add(PointMass("lamp", 3)))
    system = m.assemble()
    assert [(row.name, row.link, row.mass) for row in system.bodies] == [
        ("b", 1, 1.0),
        ("load", 1, 2.0),
        ("lamp", 1, 3.0),
    ]
    assert float(system.tree.links[0].inertia.m) == 6
    assert [j.name for j in m.joints()] == ["j", "glue"]
    assert [b.name for b in m.bodies()] == ["b", "load", "lamp"]


# Attributes and gravity.


def test_unknown_attributes_are_refused():
    m = mbs.Mechanism("arm")
    with pytest.raises(DescriptionError, match=r"arm: gravity cannot be set; give gravity="):
        m.gravity = (0, 0, 0)
    with pytest.raises(DescriptionError, match=r"no attribute 'note'; did you mean 'notes'"):
        m.note = []
    m.guess = {"j": 0.1}
    assert m.guess == {"j": 0.1}


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: mbs.Mechanism("m", parameters=5), "m: parameters is 5; give a dict such as"),
        (lambda: mbs.Mechanism("m", parameters=["M"]), "m: parameters is ['M']; give a dict"),
        (lambda: mbs.Mechanism("m", guess=5), "m: guess is 5; give a dict such as"),
        (lambda: mbs.Mechanism("m", source=5), "m: source is 5; give a str"),
        (lambda: setattr(mbs.Mechanism("m"), "guess", 5), "m: guess is 5; give a dict"),
        (lambda: setattr(mbs.Mechanism("m"), "world", "w"), "m: world is 'w'; give a World"),
        (lambda: setattr(mbs.Mechanism("m"), "cuts", "j"), "m: cuts is 'j'; give a list"),
    ],
)
def test_attributes_of_another_kind_are_refused(call, message):
    refused(DescriptionError, message, by=call)


def test_derived_classes_have_attributes_of_their_own():
    class Arm(mbs.Mechanism):
        def __init__(self):
            super().__init__("arm", gravity=(0, 0, -1))
            self.hand = self.add(Body("hand", mass=1))
            self.connect(self.world, Revolute("j", axis="y"), self.hand)

    arm = Arm()
    assert arm.assemble().nv == 1
    assert arm.hand.name == "hand"
    with pytest.raises(DescriptionError, match="arm: gravity cannot be set"):
        arm.gravity = (0, 0, 0)


@pytest.mark.parametrize(
    "make",
    [
        lambda: Body("b"),
        lambda: Body("b", com=(1, 0, 0)),
        lambda: mbs.components.PointMass("b"),
        lambda: Box("b", length=1),
        lambda: mbs.components.Cylinder("b", length=1),
    ],
)
def test_bodies_without_mass_say_so(make):
    with pytest.raises(DescriptionError, match=r"b: this \w+ has no mass; give mass="):
        make()


def weight_efforts(mechanism, q):
    system = mechanism.assemble()
    idm = mbs.models.inverse_dynamics(system)
    return idm(q, *(np.zeros(idm.size1_in(k)) for k in (1, 2))).full().ravel()


@pytest.mark.parametrize("robot", ["puma560", "panda", "five_bar"])
def test_a_mounted_robot_has_its_gravity_rotated(robot):
    """A robot on a wall has the weight of a robot in the gravity of its own axes."""
    q = mbs.load(robot).assemble().configuration
    rotation = (("x", "pi/2"), ("z", "pi/2"))  # the same as a matrix
    turned = mbs.load(robot, gravity=(1, 2, -9), mount=rotation)
    by_matrix = mbs.load(robot, gravity=(1, 2, -9), mount=_matrix(rotation))
    plain = mbs.load(robot, gravity=_matrix(rotation).T @ (1, 2, -9))
    expected = weight_efforts(plain, q)
    assert np.abs(expected).max() > 0.1
    np.testing.assert_allclose(weight_efforts(turned, q), expected, rtol=0, atol=1e-11)
    np.testing.assert_allclose(weight_efforts(by_matrix, q), expected, rtol=0, atol=1e-11)


def _matrix(rotation):
    total = np.eye(3)
    for axis, _ in rotation:
        k = "xyz".index(axis)
        quarter = np.zeros((3, 3))
        i, j = (k + 1) % 3, (k + 2) % 3
        quarter[k, k], quarter[j, i], quarter[i, j] = 1, 1, -1
        total = total @ quarter
    return total


def test_a_symbolic_mount():
    m = mbs.Mechanism("m", gravity=(0, 0, "-G"), mount=("x", "A"))
    assert [str(g) for g in m.gravity] == ["0", "sin(A)*-G", "cos(A)*-G"]


HUNG = {"position": (0.1, 0.2, 2.5), "rotation": [("x", "pi"), ("z", 0.3)]}


def hung():
    """The pose (4, 4) of the base in the world."""
    c, s = np.cos(0.3), np.sin(0.3)
    T = np.eye(4)
    T[:3, :3] = np.diag([1.0, -1.0, -1.0]) @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    T[:3, 3] = HUNG["position"]
    return T


def pose(system, q, *frames):
    return mbs.models.transform(system, *frames)(q).full()


@pytest.mark.parametrize("robot", ["puma560", "five_bar"])
def test_a_mount_has_a_position(robot):
    system = mbs.load(robot, mount=HUNG).assemble()
    q = np.array(system.configuration)
    tool = terminal_frame(system)
    plain = mbs.load(robot, mount=HUNG["rotation"]).assemble()
    assert terminal_frame(plain) == tool
    in_base = pose(plain, q, tool)
    np.testing.assert_allclose(pose(system, q, tool), in_base, atol=1e-15)
    np.testing.assert_allclose(pose(system, q, tool, "outer_world"), hung() @ in_base, atol=1e-14)
    np.testing.assert_allclose(pose(system, q, "base", "outer_world"), hung(), atol=1e-15)
    expected = weight_efforts(mbs.load(robot, mount=HUNG["rotation"]), q)
    np.testing.assert_allclose(weight_efforts(mbs.load(robot, mount=HUNG), q), expected)
    again = mbs.load(robot)
    again.change_gravity(mount={"position": HUNG["position"]})
    again.change_gravity(mount=HUNG["rotation"])
    twice = again.assemble()
    np.testing.assert_allclose(pose(twice, q, "base", "outer_world"), hung(), atol=1e-15)
    matrix = mbs.load(robot, mount={**HUNG, "rotation": hung()[:3, :3]}).assemble()
    np.testing.assert_allclose(pose(matrix, q, "base", "outer_world"), hung(), atol=1e-15)


def test_the_position_of_a_mount_may_have_symbols():
    m = mbs.load("planar_2r", mount={"position": (0, 0, "H")}, parameters={"H": 1.5})
    T = mbs.models.transform(m.assemble(), "base", "outer_world")
    assert T([0, 0], 2.5).full()[2, 3] == 2.5


@pytest.mark.parametrize(
    ("mount", "message"),
    [
        ({}, r"planar_2r, mount is {}; give a rotation, or a dict with 'position'"),
        ({"place": (0, 0, 1)}, "planar_2r, mount is .*; give a rotation, or a dict"),
        ({"position": 3}, "planar_2r, mount, position: 3 has not three values"),
        ({"position": (0, 0, np.inf)}, "planar_2r, mount, position, z: inf is not a finite number"),
        ({"rotation": ("w", 1)}, "planar_2r, mount: rotation axis 'w' is not"),
    ],
)
def test_impossible_mounts(mount, message):
    with pytest.raises(DescriptionError, match=message):
        mbs.load("planar_2r", mount=mount)


def test_a_frame_with_the_name_of_the_outer_world_raises():
    m = mbs.load("planar_2r", mount={"position": (0, 0, 1)})
    m.add_frame("outer_world", next(iter(m.bodies())))
    with pytest.raises(AssemblyError, match=r"outer_world.*rename it"):
        m.assemble()


def test_a_mounted_mechanism_in_another_one_keeps_its_mount():
    """Robots that hang in a cell have the weight and poses of the same robots loaded alone."""
    cell = mbs.Mechanism("cell")
    arm = cell.add(mbs.load("puma560", mount=HUNG), "arm")
    cell.connect(cell.world, arm.point("outer_world"))
    outer = mbs.Mechanism("plant")
    inner = outer.add(cell, "cell")
    outer.connect(outer.world, inner.base)
    alone = mbs.load("puma560", mount=HUNG).assemble()
    tool = "link6"
    q = 0.1 * np.arange(1, 7)
    expected = pose(alone, q, tool, "outer_world")
    np.testing.assert_allclose(pose(cell.assemble(), q, f"arm.{tool}"), expected, atol=1e-14)
    system = outer.assemble()
    np.testing.assert_allclose(pose(system, q, f"cell.arm.{tool}"), expected, atol=1e-14)
    np.testing.assert_allclose(pose(system, q, "cell.arm.outer_world"), np.eye(4), atol=1e-15)
    weights = weight_efforts(outer, q), weight_efforts(mbs.load("puma560", mount=HUNG), q)
    np.testing.assert_allclose(*weights, atol=1e-12)


def test_the_mount_of_a_mechanism_in_another_one_has_its_own_symbols():
    cell = mbs.Mechanism("cell")
    arm = mbs.load("planar_2r", mount={"position": (0, 0, "H")}, parameters={"H": 1.5})
    placed = cell.add(arm, "arm")
    cell.connect(cell.world, placed.point("outer_world"))
    system = cell.assemble()
    H = [p.name for p in system.parameters].index("arm.H")
    p = np.array(system.p_default)
    assert p[H] == 1.5
    assert mbs.models.transform(system, "arm.world")([0, 0], p).full()[2, 3] == 1.5


def test_a_frame_with_the_name_of_the_outer_world_is_refused_in_another_mechanism():
    arm = mbs.load("planar_2r", mount={"position": (0, 0, 1)})
    arm.add_frame("outer_world", next(iter(arm.bodies())))
    with pytest.raises(DescriptionError, match=r"planar_2r: the frame 'outer_world'.*rename it"):
        mbs.Mechanism("cell").add(arm)


@pytest.mark.parametrize("mount", [("x", 180), {"rotation": [("z", 0.1), ("x", 180)]}])
def test_a_mount_in_degrees_has_a_note(mount):
    notes = mbs.load("planar_2r", mount=mount).notes
    assert list(map(str, notes)) == ["mount: x = 180 rad may be degrees; give radians"]
    assert mbs.load("planar_2r", mount=("x", "2*pi")).notes == []


def test_gravity_of_a_file_that_compensates_it_stays(tmp_path):
    path = tmp_path / "arm.xml"
    path.write_text(
        '<mujoco><worldbody><body name="b" gravcomp="1"><joint name="j" axis="0 1 0"/>'
        '<geom size="0.1" pos="0.2 0 0"/></body></worldbody></mujoco>'
    )
    with pytest.raises(DescriptionError, match=r"b_gravcomp.*compensates the gravity of the file"):
        mbs.load(path, gravity=(0, 0, -1.6))


# Values of symbols.


def test_values_keep_their_units_and_bounds():
    m = mbs.Mechanism("m")
    b = m.add(Body("b", mass=Parameter("M", unit="kg", description="load"), com=("L", 0, 0)))
    m.connect(m.world, Revolute("j", axis="y"), b)
    m.values["M"] = Parameter("M", 2.0, min=1.5, max=3.0)
    m.values["L"] = 0.5
    assert m.parameters() == (
        Parameter("M", 2.0, unit="kg", description="load", min=1.5, max=3.0),
        Parameter("L", 0.5),
    )
    system = m.assemble()
    refused(ModelError, "m: parameter M is 1", by=lambda: system.parameter_values({"M": 1.0}))
    outer = mbs.Mechanism("outer")
    outer.add(m)
    assert {p.name: (p.default, p.min) for p in outer.parameters()} == {
        "m.M": (2.0, 1.5),
        "m.L": (0.5, None),
    }
    m.values["M"] = Parameter("mass", 2.0)
    refused(DescriptionError, "m: values['M'] is the parameter 'mass'", by=m.parameters)
    m.values["M"] = "heavy"
    refused(DescriptionError, "parameter M", "'heavy'", by=m.parameters)
