"""Oddities of URDF files: each is read, with a note of what was made of it, equal to pinocchio."""

import numpy as np
import pytest

import mbs
from mbs.errors import DescriptionError
from mbs.expressions import to_float
from mbs.formats import read_urdf


def inertial(mass=2, moments=(0.3, 0.4, 0.35)):
    ixx, iyy, izz = moments
    return (
        f'<inertial><origin xyz=".1 .2 .3" rpy=".1 .2 .3"/><mass value="{mass}"/>'
        f'<inertia ixx="{ixx}" iyy="{iyy}" izz="{izz}" ixy=".01" ixz=".02" iyz=".03"/></inertial>'
    )


def link(name, content=None):
    return f'<link name="{name}">{inertial() if content is None else content}</link>'


LIMIT = '<limit lower="-1" upper="2" effort="3" velocity="4"/>'


def joint(name, parent, child, kind="revolute", content=LIMIT, origin=True):
    place = '<origin xyz="0 .1 .3" rpy=".3 0 .2"/>' if origin else ""
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'{place}<axis xyz="0 1 0"/>{content}</joint>'
    )


def robot(*parts):
    return '<robot name="r">\n' + "\n".join(parts) + "\n</robot>\n"


PAIR = (link("b"), link("a"))
"""Two links; what is put behind them starts in line 4."""


def limited(content):
    return robot(*PAIR, joint("j", "b", "a", content=content))


# name: (text, [(kind, line, part of the note)])
NOTED = {
    "base beside base_link": (
        robot(link("base_link"), link("base", ""), joint("f", "base_link", "base", "fixed"),
              link("a"), joint("j", "base_link", "a")),
        [("renamed", 3, "link 'base': it is 'base_link_2' here")],
    ),
    "base at the root is kept": (
        robot(link("base"), link("base_link"), joint("f", "base", "base_link", "fixed"),
              link("a"), joint("j", "base_link", "a")),
        [],
    ),
    "base where the root is": (
        robot(link("base_link"), link("base"), link("a"), joint("j", "base", "a"),
              joint("f", "base_link", "base", "fixed", origin=False)),
        [],
    ),
    "a link named as a joint": (
        robot(link("b"), link("j"), link("j_link"), joint("j", "b", "j"),
              joint("k", "j", "j_link", "fixed")),
        [("renamed", 3, "link 'j': it is 'j_link_2' here")],
    ),
    "a link named world": (
        robot(link("b"), link("world"), joint("j", "b", "world")),
        [("renamed", 3, "link 'world': it is 'world_link' here")],
    ),
    "blanks and dots in names": (
        robot(link("b"), link("a 1"), link("a_1"), joint("j.1", "b", "a 1"),
              joint("j 1", "a 1", "a_1")),
        [
            ("renamed", 5, "joint 'j.1': it is 'j_1' here"),
            ("renamed", 6, "joint 'j 1': it is 'j_1_joint' here"),
            ("renamed", 3, "link 'a 1': it is 'a_1' here"),
            ("renamed", 4, "link 'a_1': it is 'a_1_link' here"),
        ],
    ),
    "triangle inequality": (
        robot(link("b"), link("a", inertial(moments=(1, 1, 3))), joint("j", "b", "a")),
        [("doubted", 3, "link 'a': the principal moments")],
    ),
    "negative moment": (
        robot(link("b"), link("a", inertial(moments=(-1, 1, 3))), joint("j", "b", "a")),
        [("doubted", 3, "negative principal moment")],
    ),
    "negative mass": (
        robot(link("b"), link("a", inertial(mass=-2)), link("c"), joint("j", "b", "a"),
              joint("k", "a", "c")),
        [("doubted", 3, "mass is -2 kg, which no body has; taken as it is")],
    ),
    "massless tip": (
        robot(*PAIR, link("t", ""), joint("j", "b", "a"), joint("k", "a", "t")),
        [("doubted", 6, "joint 'k': it moves nothing that has inertia")],
    ),
    "limits of (0, 0)": (
        limited('<limit effort="3" velocity="4"/>'),
        [("doubted", 4, "its limits (0, 0) leave it no range; taken as unlimited")],
    ),
    "limits of (1, 1)": (
        limited('<limit lower="1" upper="1" effort="3" velocity="4"/>'),
        [("doubted", 4, "its limits (1, 1) leave it no range")],
    ),
    "limits in the wrong order": (
        limited('<limit lower="2" upper="1" effort="3" velocity="4"/>'),
        [("doubted", 4, "its limits (2, 1) leave it no range")],
    ),
    "infinite limits": (
        limited('<limit lower="-inf" upper="inf" effort="inf" velocity="inf"/>'),
        [],
    ),
    "one infinite limit": (
        limited('<limit lower="-inf" upper="1" effort="3" velocity="4"/>'),
        [("doubted", 4, "its limits (-inf, 1) have one end")],
    ),
    "limits that are not numbers": (
        limited('<limit lower="nan" upper="1" effort="3" velocity="4"/>'),
        [("doubted", 4, "its limits (nan, 1) leave it no range")],
    ),
    "negative velocity": (
        limited('<limit lower="-1" upper="1" effort="-3" velocity="-1"/>'),
        [
            ("ignored", 4, "its largest velocity is -1; taken as unlimited"),
            ("ignored", 4, "its largest effort is -3; taken as unlimited"),
        ],
    ),
    "commas between numbers": (
        limited(LIMIT).replace('rpy=".3 0 .2"', 'rpy=".3, 0 .2"'),
        [("doubted", 4, "rpy is '.3, 0 .2', with commas between its numbers")],
    ),
    "no limit": (limited(""), [("completed", 4, "it has no <limit>; taken as unlimited")]),
    "negative friction": (
        limited(LIMIT + '<dynamics damping="-1" friction=".2"/>'),
        [("ignored", 4, "damping is -1, less than zero; taken as 0")],
    ),
    "a mimic of a fixed joint": (
        robot(*PAIR, link("c"), joint("j", "b", "a"),
              joint("k", "a", "c", "fixed", '<mimic joint="j"/>')),
        [("ignored", 6, "it mimics 'j', but is fixed and has not one position; left out")],
    ),
    "a mimic of itself": (
        limited(LIMIT + '<mimic joint="j"/>'),
        [("ignored", 4, "it mimics 'j', which follows it; left out")],
    ),
    "a mimic of nothing": (
        limited(LIMIT + '<mimic joint="k"/>'),
        [("ignored", 4, "it mimics 'k', which does not exist; left out")],
    ),
    "mimics in a circle": (
        robot(*PAIR, link("c"), joint("j", "b", "a", content=LIMIT + '<mimic joint="k"/>'),
              joint("k", "a", "c", content=LIMIT + '<mimic joint="j"/>')),
        [("ignored", 6, "it mimics 'j', which follows it; left out")],
    ),
    "undeclared prefixes": (
        robot(*PAIR, '<drake:frame drake:x="1"/>', joint("j", "b", "a")),
        [("ignored", 4, "<drake:frame>: it is not known in a <robot> and was left out")],
    ),
    "what xacro left": (
        robot('<xacro:property name="p" value="1"/>', *PAIR, joint("j", "b", "a")),
        [("ignored", 2, "<xacro:property>: it was left by xacro")],
    ),
    "a late declaration": (
        '\n<!-- a -- b -->\n<?xml version="1.0"?>\n' + limited(LIMIT),
        [("ignored", 3, "the XML declaration: left out")],
    ),
    "a bare &": (
        limited(LIMIT + '<unknown text="a & b"/>'),
        [("ignored", 4, "a bare &: read as &amp;"), ("ignored", 4, "<unknown>")],
    ),
    "text behind the root": (
        limited(LIMIT) + "<more/>",
        [("ignored", 6, "the text behind the root element: left out")],
    ),
    "a byte-order mark": ("\ufeff" + limited(LIMIT), []),
    "UTF-16": (
        ('<?xml version="1.0" encoding="UTF-16"?>' + robot(
            link("b"), link("ä"), joint("ö", "b", "ä"))).encode("utf-16"),
        [],
    ),
    "Latin-1 that is declared": (
        ('<?xml version="1.0" encoding="ISO-8859-1"?>' + robot(
            link("b"), link("ä"), joint("ö", "b", "ä"))).encode("latin-1"),
        [],
    ),
    "Latin-1 that is not declared": (
        robot(link("b"), link("ä"), joint("ö", "b", "ä")).encode("latin-1"),
        [("doubted", 3, "the text: not all is utf-8; read as Latin-1")],
    ),
    "the same twice": (
        robot(*PAIR, link("a"), joint("j", "b", "a"), joint("j", "b", "a")),
        [("ignored", 4, "link 'a': it stands twice"), ("ignored", 6, "joint 'j': it stands twice")],
    ),
    "two joints of one name": (
        robot(*PAIR, link("c"), joint("j", "b", "a"), joint("j", "a", "c")),
        [("renamed", 6, "joint 'j': a joint before it has this name; named 'j_2'")],
    ),
    "missing names": (
        robot(*PAIR, "<link/>", joint("", "b", "a")).replace(' name="r"', ""),
        [
            ("ignored", 4, "a <link>: it has no name"),
            ("completed", 5, "a <joint>: it has no name; named 'b_to_a'"),
            ("completed", 1, "<robot>: it has no name; named 'robot'"),
        ],
    ),
    "unknown elements": (
        robot(*PAIR, "<foo/>", "<foo/>", joint("j", "b", "a")),
        [("ignored", 4, "<foo>: it is not known in a <robot> and was left out (2 of them)")],
    ),
    "a loop": (
        robot(*PAIR, joint("j", "b", "a"), '<loop_joint name="l"/>'),
        [("ignored", 5, "<loop_joint>: the loop that it closes stays open")],
    ),
    "springs of Gazebo": (
        robot(*PAIR, joint("j", "b", "a"), '<gazebo reference="j">',
              "<springStiffness>5</springStiffness><mu1>1</mu1></gazebo>"),
        [("ignored", 6, "<gazebo> of 'j': <springStiffness> would change the motion")],
    ),
    "a reduction": (
        robot(*PAIR, joint("j", "b", "a"), '<transmission name="t"><joint name="j"/>',
              "<mechanicalReduction>50</mechanicalReduction></transmission>"),
        [("ignored", 5, "transmission 't': a reduction of 50 without the inertia of a rotor")],
    ),
    "an inertial without mass": (
        robot(link("b"), link("a"), link("c", "<inertial/>"), joint("j", "b", "a"),
              joint("k", "a", "c", "fixed")),
        [("ignored", 4, "link 'c': its inertial has no mass")],
    ),
    "an inertia that is not complete": (
        robot(link("b"), link("a", '<inertial><mass value="1"/><inertia ixx="1" iyy="1"/>'
                              "</inertial>"), joint("j", "b", "a")),
        [("completed", 3, "its inertia has no ixy, ixz, iyz, izz; taken as 0")],
    ),
}  # fmt: skip


@pytest.fixture
def urdf(tmp_path):
    def write(text, name="robot.urdf"):
        path = tmp_path / name
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return path

    return write


@pytest.mark.parametrize("case", NOTED)
def test_notes(urdf, case):
    text, expected = NOTED[case]
    mechanism = read_urdf(urdf(text))
    found = [(note.kind, note.line, str(note)) for note in mechanism.notes]
    assert len(found) == len(expected), found
    for (kind, line, text), (a_kind, a_line, part) in zip(found, expected, strict=True):
        assert (kind, line) == (a_kind, a_line), text
        assert part in text
    # Whatever was noted, the inverse dynamics is defined.
    system = mechanism.assemble()
    n = len(system.independent)
    tau = np.array(mbs.models.inverse_dynamics(system)([0.1] * system.nq, [0.2] * n, [1] * n))
    assert np.all(np.isfinite(tau))
    assert np.any(tau)


@pytest.mark.parametrize("case", [case for case in NOTED if NOTED[case][1]])
def test_strict_reading_refuses_what_would_be_noted(urdf, case):
    text, expected = NOTED[case]
    path = urdf(text)
    with pytest.raises(DescriptionError) as error:
        mbs.load(path, strict=True)
    assert f"line {expected[0][1]}: " in str(error.value)
    assert expected[0][2] in str(error.value)


# What pinocchio refuses (and we complete), or reads as something else: of a negative mass it takes
# 1e-16 kg to divide by, and no part of an inertia that is not complete.
ALONE = {
    *("infinite limits", "one infinite limit", "negative velocity", "a late declaration"),
    *("negative mass", "commas between numbers"),
    *("limits that are not numbers", "no limit", "a bare &", "UTF-16", "the same twice"),
    *("two joints of one name", "missing names", "an inertia that is not complete"),
    *("Latin-1 that is not declared", "Latin-1 that is declared"),  # names differ there
}


@pytest.mark.sweep
@pytest.mark.parametrize("free", [False, True])
@pytest.mark.parametrize("case", [case for case in NOTED if case not in ALONE])
def test_equal_to_pinocchio(urdf, case, free):
    pytest.importorskip("pinocchio")
    from robot_files import compared

    outcome = compared(urdf(NOTED[case][0]), free, 20)
    assert (outcome.kind, outcome.text) == ("equal", "")


def test_the_comparison_sees_a_difference(urdf, monkeypatch):
    pytest.importorskip("pinocchio")
    import robot_files

    path = urdf(limited(LIMIT))
    other = urdf(limited(LIMIT).replace('mass value="2"', 'mass value="2.0001"'), "other.urdf")
    theirs = robot_files._pinocchio(other, False)
    monkeypatch.setattr(robot_files, "_pinocchio", lambda path, free: theirs)
    outcome = robot_files.compared(path, False, 20)
    assert outcome.kind == "different"
    assert "inertia matrix" in outcome.text
    assert "inverse dynamics" in outcome.text


def test_mimics_that_are_left_out_leave_a_motor(urdf):
    (j,) = read_urdf(urdf(NOTED["a mimic of nothing"][0])).joints()
    assert j.actuated is True


def test_a_chain_of_mimics(urdf):
    """c follows j2, which follows j1: the efforts are those of pinocchio at the driving joint."""
    pinocchio = pytest.importorskip("pinocchio")
    text = robot(
        *(link(name) for name in "abcd"),
        joint("j1", "a", "b"),
        joint("j2", "b", "c", content=LIMIT + '<mimic joint="j1" multiplier="2" offset=".1"/>'),
        joint("j3", "c", "d", content=LIMIT + '<mimic joint="j2" multiplier="-.5"/>'),
    )
    path = urdf(text)
    system = mbs.load(path).assemble()
    model = pinocchio.buildModelFromUrdf(str(path))
    factors = np.array([1, 2, -1.0])
    q = factors * 0.3 + [0, 0.1, -0.05]
    v, a = factors * 0.7, factors * -1.1
    tau = pinocchio.rnea(model, model.createData(), q, v, a) @ factors
    ours = mbs.models.inverse_dynamics(system)(q, [0.7], [-1.1])
    assert float(ours) == pytest.approx(tau, rel=1e-12)


def test_rotors_of_transmissions(urdf):
    text = robot(
        link("b"), link("a"), link("c"), joint("j", "b", "a"), joint("k", "a", "c"),
        '<transmission name="t"><joint name="j"/><actuator name="m">',
        "<mechanicalReduction>-50</mechanicalReduction><motorInertia>1e-4</motorInertia>",
        '</actuator></transmission><transmission name="u"><joint name="k"/><actuator name="n">',
        '<drake:rotor_inertia value="2e-5"/><drake:gear_ratio value="100"/>',
        "</actuator></transmission>",
    )  # fmt: skip
    mechanism = read_urdf(urdf(text))
    assert mechanism.notes == []
    assert [to_float(j.Ia) for j in mechanism.joints()] == pytest.approx([0.25, 0.2])


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ('<link name="a"/><link name="a"><inertial/></link>', "two links are named 'a' and differ"),
        (link("b") + link("a") + joint("j", "b", "a", content='<limit lower="${x}" upper="2"/>'),
         "lower is '${x}', which xacro has not expanded"),
        (link("b") + link("a") + joint("j", "b", "a").replace("0 .1 .3", "0,1 .1"),
         "xyz: '0,1 .1' is not 3 finite number(s)"),
        ('<xacro:include filename="x"/>', "no <link> but macros of xacro; load it with xacro={}"),
        (f'<link name="{"n" * 1000}"/><link name="b"/>', "the links have the roots 'nnn"),
    ],
)  # fmt: skip
def test_what_has_no_meaning_is_refused(urdf, content, message):
    with pytest.raises(DescriptionError) as error:
        read_urdf(urdf(robot(content)))
    assert message in str(error.value)
    assert len(str(error.value)) < 400


def test_commas_between_numbers(urdf):
    plain = mbs.load(urdf(limited(LIMIT))).assemble()
    commas = limited(LIMIT).replace('rpy=".3 0 .2"', 'rpy=".3, 0 .2"').replace("0 .1 .3", "0,.1,.3")
    other = mbs.load(urdf(commas, "other.urdf")).assemble()
    poses = [np.array(mbs.models.transform(s, "a")([0.4])) for s in (plain, other)]
    assert np.array_equal(*poses)


def test_long_names_are_shortened(urdf):
    mechanism = read_urdf(urdf(robot(link("b"), link("n" * 500), joint("j", "b", "n" * 500))))
    assert [body.name for body in mechanism.bodies()] == ["b", "n" * 80]
    assert [note.kind for note in mechanism.notes] == ["renamed"]


def test_files_have_limits(urdf, monkeypatch):
    def refused(text, message):
        with pytest.raises(DescriptionError) as error:
            read_urdf(urdf(text))
        assert message in str(error.value)
        assert len(str(error.value)) < 300

    refused("<a>" * 300, "the file has elements in elements, 200 deep")
    entities = "".join(
        f'<!ENTITY e{k + 1} "{f"&e{k};" * 10}">' for k in range(9)
    )  # a billion letters
    text = f'<!DOCTYPE r [<!ENTITY e0 "{"x" * 50}">{entities}]><robot name="&e9;"/>'
    refused(text, "the file is not XML: limit on input amplification")
    monkeypatch.setattr("mbs.formats.xml._MOST_ELEMENTS", 100)
    refused(robot("<link/>" * 101), "the file has more than 100 elements")
    monkeypatch.setattr("mbs.formats.files.LARGEST_FILE", 1000)
    refused(robot(" " * 1000), "the file has more than 1000 bytes")
