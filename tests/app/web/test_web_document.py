import pickle
from math import pi

import casadi
import numpy as np
import pytest

import mbs
from mbs import MbsError
from mbs.app.web.document.document import Document
from mbs.app.web.document.tables import COLUMNS, Cell, scalar, written
from mbs.app.web.server import robot_document
from mbs.errors import DescriptionError
from mbs.formats import from_dict
from mbs.robots import catalogue

TABLES = ("puma560", "rx90", "panda", "sr400", "cart_pole", "two_branch_tree", "akr3000")


def changed(document, sheet, row, column, text):
    return document.changed(Cell(sheet, row, column), text)


def efforts(system, seed=3):
    rng = np.random.default_rng(seed)
    return np.array(mbs.models.inverse_dynamics(system)(*(rng.uniform(-1, 1, (3, system.nv)))))


@pytest.mark.parametrize("name", TABLES)
def test_catalogue_robots_of_frames_are_tables_that_say_the_same_components(name):
    document = Document.of_name(name)
    assert document.is_table
    assert document.problems == ()
    again, first = document.mechanism(), catalogue()[name]()
    assert again.components == first.components
    assert again.connections == first.connections
    assert again.guess == first.guess


@pytest.mark.parametrize("name", TABLES)
def test_a_table_is_the_same_after_toml(name):
    document = Document.of_name(name)
    assert Document.of_upload(document.toml().encode(), ".toml") == document


def test_a_par_file_keeps_the_equations():
    document = Document.of_name("rx90")
    again = Document.of_upload(document.par().encode(), ".par")
    np.testing.assert_allclose(efforts(again.system()), efforts(document.system()), rtol=1e-12)


def test_of_a_dict_of_the_toml_schema():
    frame = {"antecedent": 0, "alpha": "pi/2", "d": "L2", "limits": [-pi, 2]}
    table = from_dict({"name": "arm", "frame": [frame], "parameters": {"L2": 0.3}})
    document = Document.of(table)
    row = dict(zip(COLUMNS["geometry"], document.tables.geometry[0], strict=True))
    assert (row["alpha"], row["d"], row["limits"]) == ("pi/2", "L2", "-pi, 2")
    assert document.symbols == ("L2",)
    assert document.tables.rows("symbols") == (("0.3",),)
    assert document.table() == table


@pytest.mark.parametrize(
    "value", [pi / 2, -pi / 2, pi, -2 * pi, 3 * pi / 4, 2 * pi / 3, 0.1, 1e-17]
)
def test_a_written_number_reads_as_exactly_the_same(value):
    assert scalar(written(value), "value").value == value


def test_a_changed_cell_changes_the_mechanism_and_nothing_else():
    first = Document.of_name("rx90")
    second = changed(first, "geometry", 2, "d", "0.5")
    assert first.tables.text(Cell("geometry", 2, "d")) == "0.45"
    poses = [mbs.models.transform(d.system(), 6)(np.zeros(6)) for d in (first, second)]
    assert float(poses[1][0, 3] - poses[0][0, 3]) == pytest.approx(0.05, abs=1e-15)
    assert changed(second, "geometry", 2, "d", "0.45") == first


def test_equal_documents_share_one_system():
    first = Document.of_name("rx90")
    assert pickle.loads(pickle.dumps(first)).system() is first.system()


def test_symbols_appear_when_they_are_used_and_keep_their_values():
    document = changed(Document.of_name("panda"), "geometry", 2, "r", "L3 + A")
    assert document.symbols == ("L3", "A")
    document = changed(document, "symbols", 0, "value", "0.3")
    document = changed(document, "symbols", 1, "value", "pi/100")
    values = {p.name: p.default for p in document.system().parameters}
    assert values == {"L3": 0.3, "A": pytest.approx(pi / 100)}
    without = changed(document, "geometry", 2, "r", "0.316")
    assert without.symbols == ()
    again = changed(without, "geometry", 2, "r", "A")
    assert again.tables.rows("symbols") == (("pi/100",),)


MISTAKES = [
    ("geometry", 2, "d", "abc+", "frame 3, d: cannot read 'abc+'"),
    ("geometry", 2, "antecedent", "5", "antecedent 5 must be 0"),
    ("geometry", 2, "antecedent", "two", "'two' is not the number of a frame"),
    ("geometry", 1, "joint", "revolut", "did you mean 'revolute'?"),
    ("geometry", 1, "actuated", "maybe", "'maybe' is unknown"),
    ("geometry", 1, "actuated", "yes", "a fixed frame has a motor or limits"),
    ("geometry", 2, "limits", "3, 1", "are not [lower, upper]"),
    ("geometry", 2, "limits", "3", "is not lower, upper"),
    ("geometry", 1, "guess", "L7", "'L7' is not a number"),
    ("geometry", 1, "name", "q3", "two components are named 'q3'"),
    ("geometry", 1, "name", "my joint", "a name has no blanks"),
    ("inertia", 2, "M", "-1", "mass is -1 kg"),
    ("inertia", 2, "XX", "import os", "cannot read 'import os'"),
    ("inertia", 1, "Fv", "-2", "Fv is -2"),
    ("general", 1, "value", "down", None),
    ("general", 3, "value", "1/0", "is not a finite number"),
    ("geometry", 2, "r", "1" * 3000, "write at most 2000"),
]


@pytest.mark.parametrize(("sheet", "row", "column", "text", "sentence"), MISTAKES)
def test_a_mistake_is_told_in_its_cell(sheet, row, column, text, sentence):
    document = changed(Document.of_name("panda"), sheet, row, column, text)
    if text == "yes":
        document = changed(document, "geometry", 1, "joint", "fixed")
    if sentence is None:  # a symbol is no mistake
        assert document.problems == ()
        return
    (problem,) = document.problems
    assert problem[:3] == (sheet, row, column)
    assert sentence in problem.sentence
    with pytest.raises(MbsError):
        document.system()


def test_every_unreadable_cell_is_told_at_once():
    document = changed(Document.of_name("panda"), "geometry", 1, "d", "*")
    document = changed(document, "inertia", 4, "XY", "?")
    assert [p[:3] for p in document.problems] == [("geometry", 1, "d"), ("inertia", 4, "XY")]


def test_loops_that_contradict_the_frames_are_told_in_their_row():
    document = changed(Document.of_name("sr400"), "loops", 0, "joint", "prismatic")
    (problem,) = document.problems
    assert problem[:2] == ("loops", 0)
    assert "have sigma 0 and 2" in problem.sentence


def test_a_loop_that_cannot_be_closed_is_refused_by_the_system():
    document = Document.of_name("sr400")
    far = changed(document, "geometry", 8, "d", "9")
    assert far.problems == ()
    with pytest.raises(MbsError, match="cannot be closed"):
        far.system()


def test_a_frame_that_goes_leaves_the_others_on_their_antecedents():
    document = Document.of_name("sr400")
    less = document.without_frame(5)  # the last wrist axis, frame 6
    assert [row[0] for row in less.tables.geometry] == ["0", "1", "2", "3", "4", "1", "6", "7", "3"]
    assert less.tables.loops == (("8", "9", "revolute"),)
    assert less.problems == ()
    assert less.system().nq == document.system().nq - 1


def test_a_frame_below_others_hands_them_to_its_antecedent():
    less = Document.of_name("panda").without_frame(2)
    assert [row[0] for row in less.tables.geometry] == ["0", "1", "2", "3", "4", "5"]
    assert less.system().nq == 6


def test_rows_added_make_robots():
    document = Document.blank().with_frame().with_frame()
    assert [row[0] for row in document.tables.geometry] == ["0", "1", "2"]
    assert document.system().nq == 3
    looped = document.with_loop()
    assert looped.problems[0].sheet == "loops"
    assert looped.without_loop(0) == document


def test_the_last_frame_and_rows_that_are_not_there_stay():
    with pytest.raises(DescriptionError, match="at least one frame"):
        Document.blank().without_frame(0)
    with pytest.raises(DescriptionError, match="no frame 9"):
        Document.of_name("rx90").without_frame(8)
    with pytest.raises(DescriptionError, match="no cell"):
        changed(Document.of_name("rx90"), "geometry", 6, "d", "1")
    with pytest.raises(DescriptionError, match="no cell"):
        changed(Document.of_name("rx90"), "geometry", 0, "__class__", "1")


def test_a_composed_mechanism_is_shown_and_says_why_it_is_no_table():
    document = Document.of_name("four_bar")
    assert not document.is_table
    assert "Box 'a'" in document.origin.reason
    shown = document.shown()
    assert [row[:3] for row in shown.geometry] == [
        ("0", "revolute", "yes"),
        ("1", "revolute", "no"),
        ("0", "revolute", "no"),
    ]
    assert shown.inertia[0][COLUMNS["inertia"].index("M")] == "2.7"
    assert shown.loops == (("j3", "", "revolute"),)
    for edit in (
        lambda: changed(document, "geometry", 0, "d", "1"),
        lambda: document.without_frame(0),
        document.table,
    ):
        with pytest.raises(DescriptionError, match="Box 'a'"):
            edit()


def test_a_composed_mechanism_becomes_a_table_of_the_same_motion():
    document = Document.of_name("four_bar")
    table = document.as_table()
    assert table.is_table
    assert table.problems == ()
    one, other = (
        mbs.models.direct_dynamics(d.system())(d.system().configuration, [0.3], [0.1])
        for d in (document, table)
    )
    np.testing.assert_allclose(np.array(one), np.array(other), rtol=1e-9)


def test_symbols_of_a_composed_mechanism_can_be_given_values():
    urdf = b"""<robot name="arm"><link name="world"/><link name="a"><inertial><mass value="2"/>
      <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
      <joint name="j" type="continuous"><parent link="world"/><child link="a"/></joint></robot>"""
    document = Document.of_upload(urdf, ".urdf")
    assert not document.is_table
    assert document.symbols == ()
    assert document.system().nq == 1
    assert pickle.loads(pickle.dumps(document)).system().nq == 1
    table = document.as_table()
    assert table.tables.inertia[0][COLUMNS["inertia"].index("M")] == "2"


@pytest.mark.parametrize(
    ("content", "suffix", "sentence"),
    [
        (b"NL = 2\nnonsense", ".par", "robot.par:2: 'nonsense' is not an assignment"),
        (b"name = ", ".toml", "robot.toml: the file is not TOML"),
        (b"\xff\xfe\x00", ".urdf", "robot.urdf: the file is not XML"),
        (b"<robot/>", ".xml", "not <mujoco>"),
        (b"{}", ".json", "files '.json' are not read"),
        (b"", "", "files '' are not read"),
        (b" " * 5_000_001, ".par", "at most 5000000"),
    ],
)
def test_files_are_refused_with_the_sentence_of_their_reader(content, suffix, sentence):
    with pytest.raises(DescriptionError, match=r".") as caught:
        Document.of_upload(content, suffix)
    assert sentence in str(caught.value)
    assert "/tmp" not in str(caught.value)


def test_functions_of_a_document_have_the_symbols_as_inputs():
    document = changed(Document.of_name("planar_2r"), "geometry", 1, "d", "L1")
    function = mbs.models.transform(changed(document, "symbols", 0, "value", "0.7").system(), 2)
    assert isinstance(function, casadi.Function)
    assert function.name_in() == ["q", "p"]
    assert float(function([0, 0], [0.7])[0, 3]) == pytest.approx(0.7)


def gravity_of(document):
    tree = document.system().tree
    return [float(tree.gravity[k]) for k in range(3)]


@pytest.mark.parametrize("name", ["panda", "stewart_platform"])
def test_gravity_and_the_mount_are_cells(name):
    """Also of a mechanism that no table of frames says."""
    document = changed(Document.of_name(name), "general", 3, "value", "-1.62")
    assert gravity_of(document) == pytest.approx([0, 0, -1.62])
    document = changed(document, "general", 5, "value", "x=pi/2; position=0,0,2.5")
    assert document.problems == ()
    assert gravity_of(document) == pytest.approx([0, -1.62, 0], abs=1e-15)
    T = mbs.models.transform(document.system(), "base", "outer_world")
    assert T(document.system().configuration).full()[2] == pytest.approx([0, 1, 0, 2.5])
    if document.is_table:
        saved = Document.of_upload(document.toml().encode(), ".toml")
        assert gravity_of(saved) == pytest.approx([0, -1.62, 0], abs=1e-15)
    (problem,) = changed(document, "general", 5, "value", "x").problems
    assert problem[:3] == ("general", 5, "value")
    assert "mount: 'x' is no step of a mount" in problem.sentence
    plain = changed(document, "general", 5, "value", "")
    assert gravity_of(plain) == pytest.approx([0, 0, -1.62])


def test_symbols_of_a_mount_have_rows():
    document = changed(Document.of_name("panda"), "general", 5, "value", "y=tilt")
    assert "tilt" in document.symbols


def test_the_first_robot_of_the_page_has_gravity_and_mount():
    document = robot_document("panda", "0,0,-1.62", ["x=pi/2", "z=pi"])
    texts = document.tables.general
    assert (*texts[1:4], texts[5]) == ("0", "0", "-1.62", "x=pi/2; z=pi")
    assert gravity_of(document) == pytest.approx([0, 1.62, 0], abs=1e-15)
    with pytest.raises(MbsError, match="--mount: 'x' is no step"):
        robot_document("panda", mount=["x"])


@pytest.mark.parametrize("suffix", [".toml", ".par"])
@pytest.mark.parametrize(
    "mount",
    ["position=0.1,0,2.5", "x=pi; position=0,0,2.5", "z=0.3; y=-0.4; x=1.1; position=0,1,0"],
)
def test_saved_tables_keep_the_mount(suffix, mount):
    """Opened again, the robot has the same pose, gravity and cells."""
    document = changed(Document.of_name("panda"), "general", 5, "value", mount)
    text = document.toml() if suffix == ".toml" else document.par()
    again = Document.of_upload(text.encode(), suffix)
    q = document.system().configuration
    poses = [mbs.models.transform(d.system(), 7, "outer_world")(q) for d in (document, again)]
    np.testing.assert_allclose(poses[0], poses[1], atol=1e-15)
    assert gravity_of(again) == pytest.approx(gravity_of(document), abs=1e-14)
    texts = again.tables.general
    assert [float(g) for g in texts[1:4]] == pytest.approx([0, 0, -9.81], abs=1e-14)
    assert texts[5] == mount or "0.3" in mount  # angles of a general rotation are rounded


def test_the_position_of_a_mount_has_symbols():
    document = changed(Document.of_name("panda"), "general", 5, "value", "position=0,0,H")
    (row,) = [k for k, name in enumerate(document.tables.symbols) if name == "H"]
    document = changed(document, "symbols", row, "value", "1.5")
    assert document.problems == ()
    system = document.system()
    T = mbs.models.transform(system, "base", "outer_world")(system.configuration, system.p_default)
    assert float(T[2, 3]) == 1.5
    saved = Document.of_upload(document.toml().encode(), ".toml")
    assert saved.tables.general[5] == "position=0,0,1.5"
