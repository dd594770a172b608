import math

import numpy as np
import pytest

from mbs import MbsError, Mechanism
from mbs.app.web.document.document import Document
from mbs.app.web.document.tables import Cell
from mbs.app.web.session import Session, carried, handles, listed_modes, mode_of, moved
from mbs.components import Free, PointMass
from mbs.errors import Unclosable
from mbs.loops import configuration_report
from mbs.loops.configuration import require_closed


def edited(document, text):
    return document.changed(Cell("geometry", 1, "d"), text)


def test_undo_and_redo_walk_through_the_history():
    first = Document.of_name("planar_2r")
    second, third = edited(first, "0.7"), edited(first, "0.8")
    session = Session(first)
    assert not session.undo()
    session.change(second)
    session.change(second)  # no change
    session.change(third)
    assert session.undo()
    assert session.document == second
    assert session.undo()
    assert session.document == first
    assert not session.undo()
    assert session.redo()
    assert session.document == second
    session.change(first)
    assert not session.redo()


def test_a_doubled_session_goes_its_own_way():
    first = Document.of_name("planar_2r")
    session = Session(first, past=[(edited(first, "0.7"), 0)], notes={"options idm": {"frame": 1}})
    double = session.doubled()
    assert double == session
    double.undo()
    double.shown["axis"] = False
    double.notes["options idm"]["frame"] = 2
    assert session.document == first
    assert session.future == []
    assert session.shown == {}
    assert session.notes == {"options idm": {"frame": 1}}


def test_a_robot_that_is_opened_has_nothing_of_the_former_one():
    first = Document.of_name("planar_2r")
    session = Session(first)
    session.settle(first, (0.3, -0.6))
    session.change(edited(first, "0.7"))
    assert session.q == (0.3, -0.6)
    session.open(Document.of_name("scara"))
    assert (session.good, session.system, session.tables, session.q) == (None, None, None, ())
    session.settle(session.document, (0.1, 0.2, 0.3, 0.4))
    assert session.undo()
    assert (session.robot, session.document, session.q) == (0, edited(first, "0.7"), ())
    assert session.redo()
    assert (session.robot, session.document.name, session.system) == (1, "scara", None)
    session.undo()
    session.open(Document.of_name("rx90"))
    assert session.robot == 1
    session.open(Document.of_name("rx90"))
    assert session.robot == 2


def test_the_history_has_an_end():
    session = Session(Document.of_name("planar_2r"))
    for k in range(250):
        session.change(edited(session.document, str(k)))
    assert len(session.past) == 200


def test_the_system_is_that_of_the_document_as_typed_or_its_sentence():
    session = Session(Document.of_name("planar_2r"))
    with pytest.raises(MbsError, match="still being assembled"):
        session.require_system()
    system = session.document.system()
    session.settle(session.document, system.configuration)
    assert session.require_system() is system
    session.change(edited(session.document, "("))
    with pytest.raises(MbsError, match="frame 2, d: cannot read"):
        session.require_system()
    assert session.system is system


def test_sliders_of_an_open_chain_are_all_joints_and_of_loops_the_independent_ones():
    panda = Document.of_name("panda").system()
    assert [h.name for h in handles(panda)] == [f"q{j}" for j in range(1, 8)]
    assert (handles(panda)[3].low, handles(panda)[3].high) == (-3.0718, -0.0698)
    sr400 = Document.of_name("sr400").system()
    assert [h.name for h in handles(sr400)] == ["q1", "q2", "q4", "q5", "q6", "q7"]
    assert (handles(sr400)[0].low, handles(sr400)[0].high) == (-math.pi, math.pi)


def test_the_other_joints_follow():
    system = Document.of_name("sr400").system()
    q = system.configuration
    for angle in np.linspace(-1.5, -0.8, 8):
        q = moved(system, q, 1, float(angle))
        require_closed(system, np.array(q))
        assert q[1] == pytest.approx(angle)
        assert q[2] == pytest.approx(math.pi / 2 - q[1] + q[6], abs=1e-9)


def test_a_large_move_stays_on_its_branch():
    system = Document.of_name("four_bar").system()
    first = mode_of(listed_modes(system, system.configuration), system.configuration)
    q = moved(system, system.configuration, 0, 2.5)
    found = listed_modes(system, q)
    assert len(found) == 2
    assert (
        found[mode_of(found, q)].branch == listed_modes(system, system.configuration)[first].branch
    )


def test_what_cannot_be_reached_is_told_with_the_end_of_the_branch():
    system = Document.of_name("stewart_platform").system()
    with pytest.raises(Unclosable, match=r"cannot be closed with leg1 = 9; .* ends near 0\.3"):
        moved(system, system.configuration, handles(system)[0].index, 9.0)


def test_assembly_modes_are_listed_or_a_sentence_says_why_not():
    system = Document.of_name("andrews_squeezer").system()
    found = listed_modes(system, system.configuration)
    assert len(found) == 4
    for mode in found:
        assert configuration_report(system, mode.q).residual < 1e-9
    delta = Document.of_name("delta").system()
    assert len(listed_modes(delta, delta.configuration)) == 16
    bicycle = Document.of_name("whipple_bicycle").system()
    assert "by iteration" in listed_modes(bicycle, bicycle.configuration)
    assert listed_modes(Document.of_name("rx90").system(), [0.0] * 6) == ()


def test_quaternions_keep_unit_length_and_the_part_that_is_moved():
    m = Mechanism("stone")
    m.connect(m.world, Free("free"), m.add(PointMass("mass", 1.0)))
    system = m.assemble()
    q = system.configuration
    for place, value in ((4, 0.6), (5, -0.5), (3, 0.0), (6, 1.0), (4, 0.25)):
        q = moved(system, q, place, value)
        assert q[place] == pytest.approx(value)
        assert np.linalg.norm(q[3:7]) == pytest.approx(1.0)
    assert moved(system, q, 0, 2.0)[0] == 2.0


def test_a_configuration_is_carried_to_the_changed_mechanism():
    document = Document.of_name("sr400")
    old = document.system()
    q = moved(old, old.configuration, 1, -1.0)
    new = document.changed(Cell("geometry", 2, "d"), "0.85").changed(
        Cell("geometry", 8, "d"), "0.85"
    )
    there = carried(old, q, new.system())
    require_closed(new.system(), np.array(there))
    assert there[1] == pytest.approx(-1.0)
    other = Document.of_name("rx90").system()
    assert carried(old, q, other) == other.configuration
    assert carried(None, (), other) == other.configuration
