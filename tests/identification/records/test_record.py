import numpy as np
import pytest
from support.catalogue_systems import catalogue_system
from support.measured_arm import arm, motion, noisy_record, true_efforts

import mbs
from mbs import Result
from mbs.errors import ModelError
from mbs.identification import Record, motor_to_joint, smoothed

TIME, Q, V, A = motion()
TAU = true_efforts(Q, V, A)


def test_a_record_takes_names_units_and_efforts_of_its_system():
    record = Record.of(arm(), TIME, Q, TAU, V)
    assert record.names == record.efforts == ("q1", "q2", "q3")
    assert record.units == ("rad",) * 3
    assert record.effort_units == ("N.m",) * 3
    assert len(record.between(1, 2).time) == 401
    assert "3 rows" not in repr(record)
    with pytest.raises(ValueError, match="read-only"):
        record.q[0, 0] = 1


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda t, q, v, tau: (t[::-1], q, v, tau), r"time goes from .* row 2; sort the rows"),
        (lambda t, q, v, tau: (np.repeat(t[::2], 2), q, v, tau), "one for each instant"),
        (lambda t, q, v, tau: (np.where(t > 3, t + 1, t), q, v, tau), "nothing was measured from"),
        (lambda t, q, v, tau: (t, hit(q, np.nan), v, tau), "q of q2 is nan at 0.0125 s"),
        (lambda t, q, v, tau: (t, q, v, hit(tau, np.inf)), "tau of q2 is inf at"),
        (lambda t, q, v, tau: (hit(t, np.nan), q, v, tau), "time of row 6 is nan"),
        (lambda t, q, v, tau: (t, np.degrees(q), v, tau), "more than two turns .* numpy.radians"),
        (lambda t, q, v, tau: (t, 100 * q, 100 * v, tau), "positions of motors by joint_side"),
        (lambda t, q, v, tau: (t, q, np.degrees(v), tau), r"57\.\d+ times the rate of its q"),
        (lambda t, q, v, tau: (t, q, 8 * v, tau), "is 8 times the rate .* the motor's side"),
        (lambda t, q, v, tau: (t, q, v[:, ::-1], tau), "is not the rate of its q"),
        (lambda t, q, v, tau: (t, q, -v, tau), r"correlation -\d.*signs"),
        (lambda t, q, v, tau: (t[:30], q[:30], v[:30], tau[:30]), "30 rows, which is too short"),
        (lambda t, q, v, tau: (t, q[:-1], v, tau), r"q has the shape \(3999, 3\) for 4000"),
        (lambda t, q, v, tau: (t, q, v[:, :2], tau), "give the velocity of every position"),
        (lambda t, q, v, tau: (t, q, v, tau[:, :2]), r"tau has 2 columns, .* 3 independent joints"),
        (lambda t, q, v, tau: (t, "here", v, tau), "q is 'here'; give numbers"),
        (lambda t, q, v, tau: (t[:, None], q, v, tau), r"time has the shape \(4000, 1\)"),
    ],
)
def test_what_is_no_record_is_refused_in_a_sentence(change, message):
    t, q, v, tau = change(TIME, Q, V, TAU)
    with pytest.raises(ModelError, match=message) as caught:
        Record.of(arm(), t, q, tau, v)
    assert "\n" not in str(caught.value)


def hit(values, number):
    changed = values.copy()
    changed[(5, 1)[: values.ndim] if values.ndim == 2 else 5] = number
    return changed


def test_positions_far_beyond_the_range_of_a_joint_are_refused():
    with pytest.raises(ModelError, match=r"q1 goes from .* far beyond its range -0.1 .. 0.1 rad"):
        Record(TIME, Q, TAU, limits=((-0.1, 0.1), None, None))
    with pytest.raises(ModelError, match="q1 is in 'deg'"):
        Record(TIME, Q, TAU, units=("deg", "rad", "rad"))


def test_a_gap_may_be_allowed():
    time = np.where(TIME > 3, TIME + 1, TIME)
    assert Record(time, Q, TAU, longest_gap=2.0).time[-1] == pytest.approx(TIME[-1] + 1)


def test_records_from_results_dicts_and_files(tmp_path):
    columns = {"time": TIME}
    for k in range(3):
        columns |= {f"j{k}.q": Q[:, k], f"j{k}.tau": TAU[:, k]}
    q, tau = ([f"j{k}.{x}" for k in range(3)] for x in ("q", "tau"))
    table = np.column_stack(list(columns.values())[1:])
    result = Result(TIME, table, {name: "1" for name in columns if name != "time"})
    result.to_csv(tmp_path / "run.csv")
    for record in (
        Record.from_table(columns, q, tau, system=arm()),
        Record.from_table(result, q, tau),
        Record.from_csv(tmp_path / "run.csv", q, tau),
    ):
        assert np.array_equal(record.time, TIME)
        assert np.array_equal(record.q, Q)
        assert np.array_equal(record.tau, TAU)
    with pytest.raises(ModelError, match=r"no column 'j9\.q'; did you mean"):
        Record.from_csv(tmp_path / "run.csv", ["j9.q"], tau)
    for names in ([], "j0.q"):
        with pytest.raises(ModelError, match=r"columns of q are .*; give a list of one name"):
            Record.from_csv(tmp_path / "run.csv", names, tau)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("time,a\n", "has no rows"),
        ("time,a\n0,1\n1\n", "row 3 of .* has 1 fields, the header has 2"),
        ("time,a\n0,x\n", "row 2 of .* write numbers alone"),
    ],
)
def test_files_that_are_no_tables_are_refused(tmp_path, text, message):
    (tmp_path / "r.csv").write_text(text)
    with pytest.raises(ModelError, match=message):
        Record.from_csv(tmp_path / "r.csv", ["a"], ["a"])
    with pytest.raises(ModelError, match="cannot be read"):
        Record.from_csv(tmp_path / "none.csv", ["a"], ["a"])


def test_motors_that_drive_two_joints():
    N = np.array([[50.0, 0], [20, 40]])
    q, tau = motor_to_joint(N, Q[:, :2] @ N.T, TAU[:, :2])
    assert q == pytest.approx(Q[:, :2])
    assert np.sum(tau * q) == pytest.approx(np.sum(TAU[:, :2] * (Q[:, :2] @ N.T)))
    with pytest.raises(ModelError, match="N has no inverse"):
        motor_to_joint([50.0, 0.0], Q[:, :2], TAU[:, :2])
    with pytest.raises(ModelError, match=r"N has the shape \(3, 3\)"):
        motor_to_joint(np.eye(3), Q[:, :2], TAU[:, :2])


def test_records_are_of_joints_of_one_degree_of_freedom():
    from mbs.components import Body, Spherical

    m = mbs.Mechanism("ball")
    body = m.add(Body("b", mass=1, inertia=(1, 1, 1)))
    m.connect(m.world, Spherical("j"), body)
    with pytest.raises(ModelError, match="is a quaternion; records are of revolute"):
        Record.of(m.assemble(), TIME, Q, TAU)
    assert noisy_record().v is None


def test_columns_that_are_not_the_joints_of_the_system_are_refused():
    with pytest.raises(ModelError, match=r"q has 2 columns, .* 3 joints: q1, q2, q3; give one"):
        Record.of(arm(), TIME, Q[:, :2], TAU)
    with pytest.raises(ModelError, match="2 effort_units are given for 3 columns"):
        Record(TIME, Q, TAU, effort_units=("N", "N"))
    with pytest.raises(ModelError, match="the effort q2 is in 'Nm'; convert it"):
        Record(TIME, Q, TAU, effort_units=("N.m", "Nm", "N.m"))
    with pytest.raises(ModelError, match="two positions are called 'a'"):
        Record(TIME, Q, TAU, names=("a", "b", "a"))


def test_columns_named_in_another_order_than_the_joints_are_refused():
    names = ("q1", "q2", "q3")
    table = {"time": TIME}
    table |= {f"{n}.q": Q[:, k] for k, n in enumerate(names)}
    table |= {f"{n}.tau": TAU[:, k] for k, n in enumerate(names)}
    q, tau = [f"{n}.q" for n in names], [f"{n}.tau" for n in names]
    assert Record.from_table(table, q, tau, system=arm()).names == names
    with pytest.raises(ModelError, match=r"'q3.q' is given as q of joint q1; .* q1, q2, q3"):
        Record.from_table(table, q[::-1], tau, system=arm())
    with pytest.raises(ModelError, match=r"'q2.tau' is given as tau of joint q1"):
        Record.from_table(table, q, [tau[1], tau[0], tau[2]], system=arm())


def test_a_closed_robot_is_recorded_at_its_independent_joints():
    system = catalogue_system("delta")
    record = Record.of(system, TIME, 0.1 * Q, TAU)
    assert record.names == record.efforts == ("q1", "q2", "q3")
    whole = np.zeros((len(TIME), system.nq))
    with pytest.raises(ModelError, match=r"is a \w+; records .* or give the independent joints"):
        Record.of(system, TIME, whole, TAU)


def test_unequal_steps_give_the_same_parameters():
    rng = np.random.default_rng(6)
    steps = rng.uniform(0.3, 1.7, len(TIME)) / 400
    time = np.cumsum(steps)
    time = time[time < TIME[-1]]
    bent = [np.column_stack([np.interp(time, TIME, x) for x in values.T]) for values in (Q, TAU)]
    even, uneven = (
        smoothed(record, 8.0)
        for record in (Record.of(arm(), TIME, Q, TAU), Record.of(arm(), time, *bent))
    )
    inside = (uneven.time > even.time[0]) & (uneven.time < even.time[-1])
    for name in ("q", "v", "tau"):
        expected = np.column_stack(
            [np.interp(uneven.time[inside], even.time, x) for x in getattr(even, name).T]
        )
        assert getattr(uneven, name)[inside] == pytest.approx(expected, abs=0.1)


@pytest.mark.parametrize("name", ["names", "units", "efforts", "effort_units"])
def test_a_text_is_no_list_of_names(name):
    with pytest.raises(ModelError, match=f"{name} is the text 'rad'; give a list with one for"):
        Record(TIME, Q, TAU, **{name: "rad"})


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("time;q1;tau1\n0;1;2\n", "has ';' between its columns; write commas"),
        ("0,1,2\n1,2,3\n", r"the first row of .* which are numbers; write the names"),
    ],
)
def test_files_of_another_form_are_named_as_such(text, message, tmp_path):
    path = tmp_path / "record.csv"
    path.write_text(text)
    with pytest.raises(ModelError, match=message):
        Record.from_csv(path, q=["q1"], tau=["tau1"])


def test_time_in_milliseconds_is_guessed():
    slow = Record.of(arm(), 1000 * TIME, Q, TAU)
    with pytest.raises(ModelError, match="time is in s, is that of the record in ms"):
        smoothed(slow, 5.0)


def test_pieces_of_too_few_rows_are_left_out():
    time = np.where(TIME > 5, TIME + 1, TIME) + np.where(TIME > 5.05, 1, 0)
    record = Record.of(arm(), time, Q, TAU, longest_gap=2.0)
    assert [len(piece.time) for piece in record.pieces()] == [2001, 1979]
    assert len(record.pieces(1.5)[0].time) == 4000
    with pytest.raises(ModelError, match="has less than 50 rows"):
        record.pieces(1e-3)
