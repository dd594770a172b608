import pytest

import mbs
from mbs.errors import DescriptionError
from mbs.expressions import expression
from mbs.formats import from_dict, read_par, to_dict, to_mechanism, write_par
from mbs.robots import catalogue

SR400 = """\
(**********************)
(* Robotname = 'SR 400' *)
NL = 8
NJ = 9  (* joints *)
NF = 10
Type = 2
is_mobile = 0

Ant = {0,1,2,3,4,5,1,7,8,3}
Sigma = {0,0,0,0,0,0,0,0,0,2}
B = {0,0,0,0,0,0,0,0,0,0}
d = {0,d2,d3,d4,0,0,d2,d8,
     d3,-d8}
R = {0,0,0,-RL4**2,0,0,0,0,0,0}
gamma = {0,0,0,0,0,0,0,0,0,Pi/2}
Alpha = {0,-Pi/2,0,-Pi/2,Pi/2,-Pi/2,-Pi/2,0,0,0}
Mu = {1,1,0,1,1,1,1,0,0,0}
Theta = {th1,t2-Pi/2,Pi/2+th3-a*(b-c),th4,th5,th6,th7,th8,th9,0}
ZZ = {ZZ1,0,0,0,0,0,0,0.5,}
FX = {0,0,0,0,0,FX6,0,0}
QP = {QP1,QP2,QP3,QP4,QP5,QP6,QP7,QP8,QP9}
eta = {0,0,0,0,0,0,0,0,0}
W0 = {0,0,0}
G = {0,0,G3}
Z = {1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1}
Unheard = {1,2}
(* ZZ = {broken *)
"""
SR400 = SR400.replace("0.5,}", "0.5}")
SMALL = """\
(* Robotname = 'small' *)
NL = 2
NJ = 2
ant = {0,1}
sigma = {0,1}
theta = {th1,atan2(0,1)}
r = {RL1,r2}
"""


@pytest.fixture
def par(tmp_path):
    def write(text, name="robot.par"):
        path = tmp_path / name
        path.write_text(text, encoding="latin-1")
        return path

    return write


def test_old_file_with_a_loop(par):
    table = read_par(par(SR400), {"G3": -9.81, "d2": 0.4})
    assert table.name == "SR 400"
    assert len(table.frames) == 10
    assert table.loops[0].cut == (9, 10)
    assert table.frames[1].theta == expression("-pi/2")
    assert table.frames[2].theta == expression("pi/2-a*(b-c)")
    assert table.frames[3].r == expression("-RL4^2")
    assert table.frames[8].d == expression("d3")
    assert table.frames[9].sigma == 2
    assert table.frames[2].actuated is False
    assert expression("ZZ1") == table.bodies[0].ZZ
    assert expression("XX5") == table.bodies[4].XX
    assert table.gravity[2] == expression("G3")
    assert table.parameters == {"G3": -9.81, "d2": 0.4}
    assert table.extras["FX"][5] == "FX6"
    assert len(table.extras["Z"]) == 16
    m = to_mechanism(table)
    assert m.name == "SR_400"
    assert m.cuts == ["q9"]
    assert next(p for p in m.parameters() if p.name == "d2").default == 0.4


def test_defaults_of_missing_vectors(par):
    table = read_par(par(SMALL))
    assert [row.actuated for row in table.frames] == [True, True]
    assert table.frames[0].r == expression("RL1")
    assert table.frames[1].r == expression(0)
    assert table.bodies[1].Ia == expression("IA2")
    assert table.gravity[2] == expression("GZ")


@pytest.mark.parametrize("text", [SR400, SMALL], ids=["sr400", "small"])
def test_round_trip(par, tmp_path, text):
    table = read_par(par(text), {"RL1": 0.3} if text is SMALL else {"RL4": 1.25, "a": 1e-9})
    write_par(table, tmp_path / "again.par")
    assert read_par(tmp_path / "again.par") == table


TABLES = (
    "puma560",
    "stanford",
    "rx90",
    "scara",
    "planar_2r",
    "cart_pole",
    "two_branch_tree",
    "sr400",
    "five_bar",
    "akr3000",
)


@pytest.mark.parametrize("name", TABLES)
def test_catalogue_tables_survive(par, tmp_path, name, monkeypatch):
    tables = []

    def seen(table):
        tables.append(table)
        return to_mechanism(table)

    monkeypatch.setattr("mbs.robots.rows.to_mechanism", seen)
    catalogue()[name]()
    write_par(tables[0], tmp_path / "one.par")
    one = read_par(tmp_path / "one.par")
    write_par(one, tmp_path / "two.par")
    assert read_par(tmp_path / "two.par") == one
    assert one.bodies[0].ZZ == tables[0].bodies[0].ZZ
    assert [row.geometry for row in one.frames] == [row.geometry for row in tables[0].frames]
    assert one.source == tables[0].source


def test_links_that_are_fixed_have_no_drive(par):
    table = read_par(par("NL = 1\nNJ = 1\nant = {0}\nsigma = {2}\nFV = {FV1}\n"))
    assert table.bodies[0].Fv == 0 or str(table.bodies[0].Fv) == "0"
    assert list(to_mechanism(table).joints()) == []


BAD = {
    "broken": (("theta = {th1", "theta : {th1"), "robot.par:6: 'theta : {th1,atan2(0,1)}' is not"),
    "open": (("r = {RL1,r2}", "r = {RL1,r2"), "robot.par:7: 'r = {RL1,r2' is not an assignment"),
    "code": (("RL1", "__import__('os')"), "robot.par:7: r of frame 1: cannot read"),
    "call": (("RL1", "exp(2)"), "'exp' is not a function here"),
    "length": (("{0,1}", "{0,1,2}"), "robot.par:4: ant has 3 value(s); give 2, one for each frame"),
    "count": (("NL = 2", "NL = two"), "robot.par:2: NL: 'two' is not a whole number"),
    "no NJ": (("NJ = 2\n", ""), "NJ is missing"),
    "fewer": (("NJ = 2", "NJ = 1"), "NJ is 1, below NL = 2"),
    "type": (("NJ = 2", "NJ = 2\nType = 2"), "robot.par:4: Type is 2 with NL = 2 and NJ = 2"),
    "twice": (("NJ = 2", "NJ = 2\nNL = 2"), "robot.par:4: NL was given on line 2"),
    "sigma": (("sigma = {0,1}", "sigma = {0,3}"), "small/frame 2: sigma is 3"),
    "sigma text": (
        ("sigma = {0,1}", "sigma = {0,s}"),
        "robot.par:5: sigma: 's' is not a whole number",
    ),
    "cyclic": (("ant = {0,1}", "ant = {2,1}"), "small/frame 1: antecedent 2 must be 0"),
    "flexible": (("NJ = 2", "NJ = 2\neta = {0,2}"), "robot.par:4: eta of joint 2 is 2; use 0"),
    "flexible text": (
        ("NJ = 2", "NJ = 2\neta = {0,e}"),
        "robot.par:4: eta: 'e' is not a whole number",
    ),
    "flexible weld": (
        ("sigma = {0,1}", "sigma = {0,2}\neta = {0,1}"),
        "eta of joint 2 is 1; use 0 for a rigid or fixed joint",
    ),
    "rest": (("NL =", "(* rest 3 = 1 *)\nNL ="), "robot.par:2: rest 3: there is no such joint"),
    "floating": (("NJ = 2", "NJ = 2\nis_floating = True"), "robot.par:4: is_floating is True"),
    "no variable": (("th1,", "0,"), "theta of frame 1 is 0"),
    "which": (("th1,", "A+B,"), "does not show the variable of this revolute joint; name it th1"),
    "scaled": (("th1,", "2*th1,"), "write the joint variable th1 plus a constant"),
    "negative": (("th1,", "-th1,"), "write the joint variable th1 plus a constant"),
    "shared": (("RL1,r2", "0,th1"), "frames 1 and 2 have the same joint variable th1"),
    "dependent": (("RL1,", "2*th1,"), "r of frame 1 depends on th1, the joint variable of frame 1"),
    "no ant": (("ant = {0,1}", ""), "ant is missing"),
    "NF": (("NJ = 2", "NJ = 2\nNF = 3"), "robot.par:4: NF is 3 with NL = 2 and NJ = 2; give 2 NJ"),
    "misspelt": (
        ("r = {", "Alpa = {0,0}\nr = {"),
        "robot.par:7: key 'Alpa' is unknown; did you mean 'Alpha'",
    ),
    "case": (
        ("r = {", "THETA = {0,0}\nr = {"),
        "robot.par:7: key 'THETA' is unknown; did you mean 'Theta'",
    ),
    "value": (
        ("NL =", "(* Value RL1 = 2*x *)\nNL ="),
        "robot.par:2: Value RL1: '2*x' is not a number",
    ),
    "value text": (
        ("NL =", "(* Value RL1 = 1- *)\nNL ="),
        "robot.par:2: Value RL1: cannot read '1-'",
    ),
    "value twice": (
        ("NL =", "(* Value RL1 = 1 *)\n(* Value RL1 = 2 *)\nNL ="),
        "robot.par:3: Value RL1 was given on line 2; give it once",
    ),
    "guess": (("NL =", "(* Guess q1 = a *)\nNL ="), "robot.par:2: Guess q1: 'a' is not a number"),
    "no joint": (
        ("NL =", "(* Guess q7 = 1 *)\nNL ="),
        "small, guess: there is no joint 'q7'; use one of q1, q2",
    ),
    "width": (("NL =", "(* Fs_width 3 = 1 *)\nNL ="), "robot.par:2: Fs_width 3: there is no such"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_file_is_refused_with_file_and_line(par, case):
    (old, new), message = BAD[case]
    assert old in SMALL
    with pytest.raises(DescriptionError) as error:
        read_par(par(SMALL.replace(old, new)))
    assert message in str(error.value)


def test_no_variable_is_said(par):
    with pytest.raises(DescriptionError, match="theta of frame 1 is 0"):
        read_par(par(SMALL.replace("{th1,", "{0,")))


def test_unknown_parameter_and_missing_file(par, tmp_path):
    with pytest.raises(DescriptionError, match="'RL' is used by no row; did you mean 'RL1'"):
        read_par(par(SMALL), {"RL": 1})
    with pytest.raises(DescriptionError, match="cannot be read"):
        read_par(tmp_path / "none.par")


def test_what_the_format_cannot_say(tmp_path):
    data = {
        "name": "x",
        "frame": [{"antecedent": 0}, {"antecedent": 0, "sigma": 2}, {"antecedent": 1, "sigma": 2}],
        "loop": [{"cut": [2, 3], "joint": "spherical"}],
    }
    with pytest.raises(DescriptionError, match="no spherical cut joint"):
        write_par(from_dict(data), tmp_path / "x.par")
    data = {"name": "x", "frame": [{"antecedent": 0, "d": "th1"}]}
    with pytest.raises(DescriptionError, match="parameter th1 has the name of a joint variable"):
        write_par(from_dict(data), tmp_path / "x.par")
    assert list(tmp_path.iterdir()) == []
    data = {"name": "x", "frame": LOOP_FRAMES, "loop": [{"cut": [4, 5]}]}
    for drive in ("Ia", "Fv", "Fs"):
        table = from_dict({**data, "body": [{"frame": 4, drive: "Fs4"}]})
        with pytest.raises(
            DescriptionError, match=f"x/body 4: a .par file has no {drive} of a cut"
        ):
            write_par(table, tmp_path / "x.par")
    assert list(tmp_path.iterdir()) == []


LOOP_FRAMES = [
    {"antecedent": 0, "actuated": True, "name": "crank"},
    {"antecedent": 1, "d": 1, "name": "coupler"},
    {"antecedent": 2, "d": 1},
    {"antecedent": 3, "d": 2},
    {"antecedent": 0, "joint": "fixed", "d": 1},
]


def motors(table):
    return [row.actuated for row in table.frames]


def test_value_is_an_expression(par):
    text = SMALL.replace("NL =", "(* Value RL1 = 1-2*pi/pi *)\nNL =")
    assert read_par(par(text)).parameters == {"RL1": -1.0}


def test_unheard_keys_are_ignored(par):
    text = SMALL.replace("NL =", "Unheard = {1}\nQ = 3\nColour = {1,2}\nNL =")
    assert read_par(par(text)) == read_par(par(SMALL, "robot2.par"))


def test_motors_are_written_as_the_assembly_chooses_them(tmp_path):
    open_chain = from_dict({"name": "x", "frame": [{"antecedent": 0}, {"antecedent": 1, "mu": 0}]})
    write_par(open_chain, tmp_path / "x.par")
    assert motors(read_par(tmp_path / "x.par")) == [True, False]
    branch = {"antecedent": 0, "alpha": 1}  # frame 1, outside of the loop
    on_loop = [
        {**row, "antecedent": row["antecedent"] and row["antecedent"] + 1} for row in LOOP_FRAMES
    ]
    table = from_dict({"name": "x", "frame": [branch, *on_loop], "loop": [{"cut": [5, 6]}]})
    write_par(table, tmp_path / "x.par")
    again = read_par(tmp_path / "x.par")
    assert motors(again) == [True, True, False, False, False, None]
    systems = [to_mechanism(t).assemble() for t in (table, again)]
    chosen, written = ([c.actuated for c in system.coordinates] for system in systems)
    assert written == chosen


def test_guess_and_width_survive_as_comments(tmp_path):
    data = {
        "name": "x",
        "frame": LOOP_FRAMES,
        "loop": [{"cut": [4, 5]}],
        "body": [
            {"frame": 1, "M": 1, "Fs": 2, "Fs_width": 0},
            {"frame": 2, "Fs": 2, "Fs_width": "w"},
            {"frame": 3, "Fs": 2},
        ],
        "guess": {"crank": 1.5, "coupler": -0.5, "q3": 1e-9},
        "parameters": {"w": 0.01},
    }
    table = from_dict(data)
    write_par(table, tmp_path / "x.par")
    again = read_par(tmp_path / "x.par")
    assert again.guess == {"q1": 1.5, "q2": -0.5, "q3": 1e-9}
    assert again.parameters == {"w": 0.01}
    assert [str(row.Fs_width) for row in again.bodies] == ["0", "w", "0.001"]


def test_flexible_joints(par, tmp_path):
    table = read_par(par(SMALL.replace("NJ = 2", "NJ = 2\neta = {1,0}\nk = {KS,5}\nmu = {0,1}")))
    assert [str(row.stiffness) for row in table.bodies] == ["KS", "0"]
    assert [row.actuated for row in table.frames] == [False, True]
    unnamed = read_par(par(SMALL.replace("NJ = 2", "NJ = 2\neta = {0,1}"), "unnamed.par"))
    assert str(unnamed.bodies[1].stiffness) == "k2"
    write_par(table, tmp_path / "again.par")
    assert read_par(tmp_path / "again.par") == table


def test_springs_survive_and_rotors_are_refused(tmp_path):
    data = {
        "name": "x",
        "frame": LOOP_FRAMES,
        "loop": [{"cut": [4, 5]}],
        "body": [
            {"frame": 2, "M": 1, "stiffness": "K2", "rest": 0.5},
            {"frame": 4, "stiffness": 3, "rest": "x4"},
        ],
    }
    table = from_dict(data)
    write_par(table, tmp_path / "x.par")
    assert "eta = {0,1,0,1}\nk = {0,K2,0,3}" in (tmp_path / "x.par").read_text()
    springs = [
        (row.frame, str(row.stiffness), str(row.rest))
        for row in read_par(tmp_path / "x.par").bodies
        if "stiffness" in row.drive
    ]
    assert springs == [(2, "K2", "0.5"), (4, "3", "x4")]
    rotor = from_dict({**data, "body": [{"frame": 1, "rotor": {"inertia": 1}}]})
    with pytest.raises(DescriptionError, match=r"x/body 1: a \.par file has no rotor; give Ia"):
        write_par(rotor, tmp_path / "y.par")


@pytest.mark.parametrize("write", [lambda x: write_par(x, "x.par"), to_dict, to_mechanism])
def test_other_things_than_tables_are_refused(write):
    m = mbs.load("planar_2r")
    for thing, kind in ((m, "Mechanism"), (m.assemble(), "System"), (None, "NoneType")):
        with pytest.raises(DescriptionError, match=f"it is a {kind}; give a RobotTable"):
            write(thing)
