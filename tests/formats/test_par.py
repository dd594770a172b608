import pytest

from mbs.errors import DescriptionError
from mbs.expressions import expression
from mbs.formats import from_dict, read_par, to_mechanism, write_par
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


@pytest.mark.parametrize("name", [n for n in catalogue() if n != "four_bar"])
def test_catalogue_tables_survive(par, tmp_path, name, monkeypatch):
    tables = []
    monkeypatch.setattr("mbs.robots.rows.to_mechanism", tables.append)
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
    "count": (("NL = 2", "NL = two"), "robot.par:2: NL is 'two'; give a whole number"),
    "no NJ": (("NJ = 2\n", ""), "NJ is missing"),
    "fewer": (("NJ = 2", "NJ = 1"), "NJ is 1, below NL = 2"),
    "type": (("NJ = 2", "NJ = 2\nType = 2"), "robot.par:4: Type is 2 with NL = 2 and NJ = 2"),
    "twice": (("NJ = 2", "NJ = 2\nNL = 2"), "robot.par:4: NL was given on line 2"),
    "sigma": (("sigma = {0,1}", "sigma = {0,3}"), "small/frame 2: sigma is 3"),
    "sigma text": (("sigma = {0,1}", "sigma = {0,s}"), "robot.par:5: sigma is 's'"),
    "cyclic": (("ant = {0,1}", "ant = {2,1}"), "small/frame 1: antecedent 2 must be 0"),
    "flexible": (("NJ = 2", "NJ = 2\neta = {0,1}"), "robot.par:4: eta makes joints flexible"),
    "floating": (("NJ = 2", "NJ = 2\nis_floating = True"), "robot.par:4: is_floating is True"),
    "no variable": (("th1,", "0,"), "theta of frame 1 is 0"),
    "which": (("th1,", "A+B,"), "does not show the variable of this revolute joint; name it th1"),
    "scaled": (("th1,", "2*th1,"), "write the joint variable th1 plus a constant"),
    "negative": (("th1,", "-th1,"), "write the joint variable th1 plus a constant"),
    "shared": (("RL1,r2", "0,th1"), "frames 1 and 2 have the same joint variable th1"),
    "dependent": (("RL1,", "2*th1,"), "r of frame 1 depends on th1, the joint variable of frame 1"),
    "no ant": (("ant = {0,1}", ""), "ant is missing"),
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
