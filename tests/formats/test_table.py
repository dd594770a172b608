import copy
import math
from dataclasses import replace

import casadi
import numpy as np
import pytest

import mbs
from mbs import Parameter
from mbs.components import KhalilBody, Prismatic, Revolute, Rotor, Spherical
from mbs.errors import DescriptionError, ExportError, ModelError
from mbs.expressions import expression, to_float
from mbs.formats import (
    InertiaRow,
    from_dict,
    read_mjcf,
    read_par,
    read_toml,
    read_urdf,
    to_dict,
    to_mechanism,
    write_toml,
)

ARM = {
    "name": "arm",
    "gravity": [0, 0, -9.81],
    "parameters": {"RL4": 0.45},
    "frame": [
        {"antecedent": 0, "joint": "revolute", "limits": [-2.8, "pi"]},
        {"antecedent": 1, "joint": "prismatic", "alpha": "pi/2", "r": "RL4 - 0.1", "mu": 0},
        {"antecedent": 2, "sigma": 2, "gamma": 0.3, "b": "2*A"},
        {"antecedent": 1, "sigma": 0, "name": "wrist", "d": -1e-7},
    ],
    "body": [
        {"frame": 1, "ZZ": 1.2, "Ia": 0.1, "Fv": "Fv1"},
        {"frame": 4, "XX": 1, "YY": 1, "ZZ": 1, "M": 2, "name": "hand"},
    ],
}
LOOP = {
    "name": "loop",
    "frame": [
        {"antecedent": 0, "actuated": True},
        {"antecedent": 1, "d": 1},
        {"antecedent": 2, "d": 1},
        {"antecedent": 3, "d": 2},
        {"antecedent": 0, "joint": "fixed", "d": 1},
    ],
    "loop": [{"cut": [4, 5]}],
}


def changed(data, **path_values):
    data = copy.deepcopy(data)
    for path, value in path_values.items():
        *parents, last = path.split("__")
        place = data
        for key in parents:
            place = place[int(key) if key.isdigit() else key]
        place[last] = value
    return data


def test_rows_become_components():
    m = to_mechanism(from_dict(ARM))
    joints = {joint.name: joint for joint in m.joints()}
    bodies = {body.name: body for body in m.bodies()}
    assert list(joints) == ["q1", "q2", "wrist"]
    assert list(bodies) == ["link1", "link2", "link3", "hand"]
    assert isinstance(joints["q1"], Revolute)
    assert isinstance(joints["q2"], Prismatic)
    assert joints["q1"].actuated is True
    assert joints["q2"].actuated is False
    assert dict(joints["q1"].limits)[""] == (-2.8, math.pi)
    assert to_float(joints["q1"].Ia) == 0.1
    assert isinstance(bodies["link1"], KhalilBody)
    assert to_float(bodies["link1"].ZZ) == 1.2
    assert m.keep_order
    assert {p.name: p.default for p in m.parameters()} == {"RL4": 0.45, "Fv1": None, "A": None}


def test_loop_is_one_passive_joint_that_is_cut():
    m = to_mechanism(from_dict(LOOP))
    assert [joint.name for joint in m.joints()] == ["q1", "q2", "q3", "q4"]
    assert [body.name for body in m.bodies()] == ["link1", "link2", "link3"]
    assert m.cuts == ["q4"]
    assert m.components["q4"].actuated is False
    assert m.components["q2"].actuated is None


def test_loop_joint_of_another_type():
    data = changed(LOOP, loop=[{"cut": [4, 5], "joint": "spherical"}])
    data["frame"][3]["joint"] = "fixed"
    assert isinstance(to_mechanism(from_dict(data)).components["q4"], Spherical)


@pytest.mark.parametrize("data", [ARM, LOOP], ids=["arm", "loop"])
def test_dict_and_toml_round_trips(data, tmp_path):
    table = from_dict(data)
    assert from_dict(to_dict(table)) == table
    path = tmp_path / "robot.toml"
    write_toml(table, path)
    assert read_toml(path) == table
    assert list(tmp_path.iterdir()) == [path]


def test_toml_keeps_odd_texts(tmp_path):
    table = from_dict(
        changed(
            ARM,
            source='a "quoted" line\nand ü \\ another',
            parameters={"RL4": 1e-300},
            extras={"FX": ["0", "FX 6"]},
        )
    )
    write_toml(table, tmp_path / "robot.toml")
    assert read_toml(tmp_path / "robot.toml") == table


def test_default_of_a_parameter_becomes_a_value():
    table = from_dict(changed(ARM, frame__0__b=Parameter("B1", 0.7)))
    assert table.parameters == {"RL4": 0.45, "B1": 0.7}
    assert from_dict(to_dict(table)) == table


def test_failed_write_leaves_the_old_file(tmp_path, monkeypatch):
    path = tmp_path / "robot.toml"
    path.write_text("old")
    with pytest.raises(ExportError, match="cannot be written"):
        write_toml(from_dict(ARM), tmp_path / "missing" / "robot.toml")
    with monkeypatch.context() as patched:
        patched.setattr("os.replace", _fail)
        with pytest.raises(ExportError):
            write_toml(from_dict(ARM), path)
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def _fail(*_):
    raise PermissionError(13, "denied")


BAD = {
    "sigma": (dict(frame__3__sigma=3), "arm/frame 4: sigma is 3; use 0 (revolute), 1 (prismatic)"),
    "sigma_bool": (dict(frame__3__sigma=True), "frame 4: sigma is True"),
    "later": (dict(frame__2__antecedent=4), "frame 3: antecedent 4 must be 0 (base) or an earlier"),
    "itself": (dict(frame__2__antecedent=3), "frame 3: antecedent 3 must be 0 (base)"),
    "negative": (dict(frame__2__antecedent=-1), "antecedent -1 must be"),
    "text_antecedent": (dict(frame__2__antecedent="2"), "antecedent '2' must be"),
    "joint": (dict(frame__0__joint="revolut"), "did you mean 'revolute'"),
    "both": (dict(frame__1__sigma=0), "contradicts joint 'prismatic'"),
    "frame_key": (dict(frame__0__alhpa=0), "arm/frame 1: key 'alhpa' is unknown; did you mean 'a"),
    "body_key": (dict(body__0__XXX=0), "arm/body 1: key 'XXX' is unknown; did you mean 'XX'"),
    "top_key": (dict(frames=[]), "arm: key 'frames' is unknown; did you mean 'frame'"),
    "code": (dict(frame__0__d="__import__('os')"), "arm/frame 1, d: cannot read"),
    "list": (dict(frame__0__d=[1]), "arm/frame 1, d: [1] is not a finite number"),
    "nan": (dict(frame__0__d=math.nan), "is not a finite number"),
    "limits": (dict(frame__0__limits=[1, -1]), "frame 1: limits"),
    "limits_one": (dict(frame__0__limits=[1]), "frame 1: limits"),
    "limits_symbol": (dict(frame__0__limits=[0, "A"]), "frame 1: limits"),
    "mu": (dict(frame__0__mu=2), "actuated (mu) is [2]"),
    "fixed_motor": (dict(frame__2__actuated=True), "frame 3: a fixed frame has a motor"),
    "gravity": (dict(gravity=[0, 9.81]), "gravity [0, 9.81] has not three values"),
    "no_name": (dict(name=""), "the name is missing"),
    "name_type": (dict(name=3), "name is 3; give a text"),
    "parameter": (
        dict(parameters={"RL": 1}),
        "'RL' is used by no row; did you mean 'RL4",
    ),
    "parameter_text": (dict(parameters={"RL4": "A"}), "parameter RL4: 'A' is not a number"),
    "two_bodies": (dict(body__1__frame=1), "body 1: two bodies are on this frame"),
    "no_frame": (dict(body__1__frame=9), "body 9: there is no such frame; use 1 to 4"),
    "frame_table": (dict(frame={"antecedent": 0}), "give a list of tables [[frame]]"),
    "no_frames": (dict(frame=[]), "there is no frame"),
    "guess": (
        dict(guess={"q3": 1}),
        "arm, guess: there is no joint 'q3'; use one of q1, q2, wrist",
    ),
    "guess text": (dict(guess={"q2": "A"}), "arm, guess of q2: 'A' is not a number"),
    "grouped": (dict(body__0__grouped=1), "grouped is 1; give true or false"),
    "extras": (dict(extras={"FX": [0]}), "not a list of texts"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_table_is_refused_with_its_place(case):
    changes, message = BAD[case]
    data = changed({**ARM, "parameters": {}}, **changes)
    with pytest.raises(DescriptionError) as error:
        from_dict(data)
    assert message in str(error.value)


BAD_LOOPS = {
    "range": (dict(loop=[{"cut": [4, 6]}]), "cut [4, 6] does not name two frames"),
    "moving": (dict(loop=[{"cut": [5, 4]}]), "have sigma 2 and 0; they must be 0 and 2"),
    "type": (dict(loop=[{"cut": [4, 5], "joint": "ball"}]), "joint 'ball' is unknown"),
    "sigma": (dict(loop=[{"cut": [4, 5], "joint": "prismatic"}]), "they must be 1 and 2"),
    "cut": (dict(loop=[{"cut": 4}]), "cut is 4; give the two frames"),
    "body": (dict(body=[{"frame": 5, "M": 1}]), "the frame belongs to a cut joint"),
    "twice": (dict(loop=[{"cut": [4, 5]}] * 2), "in another loop too"),
    "antecedent": (
        dict(frame__4=None, frame=[*LOOP["frame"], {"antecedent": 4}]),
        "frame 6: antecedent 4 moves with a cut joint; place the frame on a link, or on the other"
        " frame of the cut, 5",
    ),
}


@pytest.mark.parametrize("case", BAD_LOOPS)
def test_bad_loop_is_refused(case):
    changes, message = BAD_LOOPS[case]
    data = {**LOOP, **{k: v for k, v in changes.items() if "__" not in k}}
    with pytest.raises(DescriptionError) as error:
        from_dict(data)
    assert message in str(error.value)


BAD_BODIES = {
    "negative mass": (dict(body__1__M=-2), "hand: mass is -2 kg"),
    "negative moment": (dict(body__1__ZZ=-3), "hand: the inertia about the centre of mass has"),
    "negative width": (dict(body__0__Fs_width=-1), "q1: Fs_width is -1"),
    "negative friction": (dict(body__0__Fv=-1), "q1: Fv is -1"),
    "same joint name": (dict(frame__3__name="q1"), "two components are named 'q1'"),
    "joint as body": (dict(frame__3__name="link1"), "two components are named 'link1'"),
    "moving base": (dict(extras={"W0": ["0", "0", "w"]}), "arm: W0 is ['0', '0', 'w'], but"),
}


@pytest.mark.parametrize("case", BAD_BODIES)
def test_bad_component_is_refused(case):
    changes, message = BAD_BODIES[case]
    with pytest.raises(DescriptionError) as error:
        to_mechanism(from_dict(changed(ARM, **changes)))
    assert message in str(error.value)


def test_grouped_bodies_are_not_checked():
    to_mechanism(from_dict(changed(ARM, body__1__ZZ=30, body__1__grouped=True)))


def test_missing_and_broken_files(tmp_path):
    with pytest.raises(DescriptionError, match=r"none.toml: the file cannot be read"):
        read_toml(tmp_path / "none.toml")
    path = tmp_path / "bad.toml"
    path.write_text("name = [")
    with pytest.raises(DescriptionError, match=r"bad.toml: the file is not TOML"):
        read_toml(path)
    with pytest.raises(DescriptionError, match="give a dict"):
        from_dict([])


def test_a_folder_is_refused_in_one_sentence(tmp_path):
    (tmp_path / "arm.toml").mkdir()
    with pytest.raises(DescriptionError) as refused:
        read_toml(tmp_path / "arm.toml")
    said = str(refused.value)
    assert said.startswith(f"{tmp_path / 'arm.toml'}: the file cannot be read (")
    assert said.endswith("); give the path of a readable file")
    assert said.count("arm.toml") == 1


@pytest.mark.parametrize("read", [read_toml, read_par, read_urdf, read_mjcf])
@pytest.mark.parametrize("path", [None, 3.5, "a\0b"])
def test_what_is_no_path_is_said(read, path):
    with pytest.raises(DescriptionError, match="it is not a path; give the path"):
        read(path)


def test_numbers_of_numpy_are_taken(tmp_path):
    data = changed(
        {**ARM, "loop": []},
        frame__1__antecedent=np.int64(1),
        frame__2__sigma=np.int8(2),
        frame__0__limits=np.array([-2.8, math.pi]),
        frame__1__mu=np.bool_(False),
        body__0__frame=np.uint8(1),
        gravity=np.array([0, 0, -9.81]),
        parameters={"RL4": np.float64(0.45)},
    )
    table = from_dict(data)
    assert table == from_dict(ARM)
    write_toml(table, tmp_path / "arm.toml")
    assert read_toml(tmp_path / "arm.toml") == table
    loop = from_dict(changed(LOOP, loop=[{"cut": [np.int64(4), np.int32(5)]}]))
    assert loop == from_dict(LOOP)
    assert type(loop.loops[0].cut[0]) is int


def test_width_of_dry_friction():
    default = Revolute("q").Fs_width
    assert expression(InertiaRow(1).Fs_width) == default
    table = from_dict(changed(ARM, body__0__Fs_width=0, body__1__Fs_width="w"))
    widths = [row.get("Fs_width") for row in to_dict(table)["body"]]
    assert widths == [0, "w"]
    assert "Fs_width" not in to_dict(from_dict(ARM))["body"][0]
    joints = to_mechanism(table).components
    assert to_float(joints["q1"].Fs_width) == 0
    assert joints["wrist"].Fs_width == expression("w")
    assert joints["q2"].Fs_width == default


DRIVEN = changed(
    ARM,
    body__0__stiffness="K1",
    body__0__rest=0.3,
    body__1__rotor={"inertia": "J4", "ratio": -120, "axis": "-x"},
)


def test_springs_and_rotors(tmp_path):
    table = from_dict(DRIVEN)
    assert table.bodies[1].rotor == Rotor(inertia="J4", ratio=-120, axis=(-1, 0, 0))
    assert to_dict(table)["body"][1]["rotor"] == {
        "inertia": "J4",
        "ratio": -120,
        "axis": [-1, 0, 0],
    }
    assert to_dict(table)["body"][0]["rest"] == 0.3
    write_toml(table, tmp_path / "arm.toml")
    assert read_toml(tmp_path / "arm.toml") == table
    joints = to_mechanism(table).components
    assert (joints["q1"].stiffness, to_float(joints["q1"].rest)) == (expression("K1"), 0.3)
    assert joints["wrist"].rotor == table.bodies[1].rotor
    mechanism = to_mechanism(from_dict({**DRIVEN, "parameters": {"RL4": 0.45, "J4": 1e-4}}))
    values = {p.name: p.default for p in mechanism.parameters()}
    assert (values["J4"], values["K1"]) == (1e-4, None)


def test_axis_of_a_rotor_is_in_the_frame_at_zero(tmp_path):
    frames = [{"antecedent": 0}, {"antecedent": 1, "alpha": "pi/2", "theta": 0.3}]
    rotor = {"inertia": 1e-3, "axis": [1, 0, 0]}
    data = {"name": "x", "frame": frames, "body": [{"frame": 2, "M": 1, "rotor": rotor}]}
    carried = to_mechanism(from_dict(data)).assemble().tree.links[1].rotor
    assert carried.carrier == 0
    axis = np.array(casadi.evalf(carried.axis)).ravel()
    np.testing.assert_allclose(axis, [math.cos(0.3), 0, math.sin(0.3)], atol=1e-15)


BAD_DRIVES = {
    "text": (dict(body__0__rotor=3), "arm/body 1, rotor is 3; give a table"),
    "no inertia": (dict(body__0__rotor={"ratio": 3}), "arm/body 1, rotor is {'ratio': 3}; give"),
    "key": (
        dict(body__0__rotor={"inertia": 1, "ration": 3}),
        "arm/body 1, rotor: key 'ration' is unknown; did you mean 'ratio'",
    ),
    "value": (dict(body__0__rotor={"inertia": "1+"}), "arm/body 1, rotor, inertia: "),
    "axis": (dict(body__0__rotor={"inertia": 1, "axis": "u"}), "body 1, rotor: axis 'u' is unkn"),
    "weld": (
        dict(body__0__frame=3, body__0__Ia=0, body__0__Fv=0, body__0__stiffness=1),
        "arm/body 3: the frame is fixed but stiffness is given; take it out",
    ),
    "negative": (dict(body__0__stiffness=-1), "q1: stiffness is -1; give zero or more"),
    "rotor": (dict(body__0__rotor={"inertia": -1}), "q1: inertia of the rotor is -1; give zero"),
}


@pytest.mark.parametrize("case", BAD_DRIVES)
def test_bad_drive_is_refused(case):
    changes, message = BAD_DRIVES[case]
    with pytest.raises(DescriptionError) as error:
        to_mechanism(from_dict(changed(ARM, **changes)))
    assert message in str(error.value)


def test_a_guess_of_a_joint_with_a_dot_in_its_name_is_kept():
    table = from_dict({**ARM, "frame": [{**ARM["frame"][0], "name": "arm.q1"}, *ARM["frame"][1:]]})
    made = replace(table, guess={"arm.q1": 0.2})
    assert made.guess == {"arm.q1": 0.2}
    with pytest.raises(DescriptionError, match=r"there is no joint 'arm\.q2'"):
        replace(table, guess={"arm.q2": 0.2})


def test_numbers_of_frames_are_those_of_the_table():
    """Behind a fixed frame, and of a tool at the end, they are not the numbers of the links."""
    table = from_dict(
        {
            "name": "arm",
            "frame": [
                {"antecedent": 0, "joint": "revolute"},
                {"antecedent": 1, "joint": "fixed", "d": 0.5},
                {"antecedent": 2, "joint": "revolute", "alpha": 0.3},
                {"antecedent": 3, "joint": "fixed", "d": 0.25, "name": "tip"},
            ],
            "body": [{"frame": 1, "ZZ": 1.0}, {"frame": 3, "ZZ": 1.0}],
        }
    )
    system = to_mechanism(table).assemble()
    assert system.numbered == {1: "link1", 2: "link2", 3: "link3", 4: "link4"}
    q = [0.3, 0.4]
    for number, name in system.numbered.items():
        one, other = (np.array(mbs.models.transform(system, f)(q)) for f in (number, name))
        assert np.array_equal(one, other)
    T = np.array(mbs.models.transform(system, 3)(q))
    assert T[:2, 3] == pytest.approx([0.5 * np.cos(0.3), 0.5 * np.sin(0.3)], abs=1e-15)
    T = np.array(mbs.models.transform(system, 4, relative_to=3)(q))
    assert pytest.approx(np.array([[1, 0, 0, 0.25], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])) == T
    assert np.array_equal(np.array(mbs.models.transform(system, 0)(q)), np.eye(4))
    assert np.array_equal(
        np.array(mbs.models.direct_geometry(system)(q)),
        np.array(mbs.models.transform(system, "link3")(q)),
    )
    with pytest.raises(ModelError, match="no body has the frame 5 of the table; the frames are 1"):
        mbs.models.transform(system, 5)
    # A lock takes links away, but no frames.
    locked = to_mechanism(table)
    locked.lock({"q1": 0.3})
    T_locked = np.array(mbs.models.transform(locked.assemble(), 3)([0.4]))
    assert T_locked == pytest.approx(np.array(mbs.models.transform(system, 3)(q)), abs=1e-15)


def test_without_fixed_frames_numbers_are_those_of_the_links():
    system = mbs.load("puma560").assemble()
    assert system.numbered == {}
    for number in range(1, 7):
        assert system.frame(number)[0] == number - 1
