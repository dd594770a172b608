"""Frames that stand on the end frame of a loop, as SYMORO's files with several loops have them."""

import numpy as np
import pytest

import mbs
from mbs import Mechanism
from mbs.components import KhalilBody, Revolute
from mbs.errors import DescriptionError
from mbs.formats import read_par, to_mechanism, write_par

TWO_LOOPS = """\
(* Robotname = 'two loops' *)
(* Guess q1 = 0.9 *)
(* Guess q3 = 1.5 *)
(* Guess q4 = 2.2 *)
(* Guess q5 = -1.0 *)
NL = 5
NJ = 7
NF = 9
Type = 2
ant = {0,1,0,0,4,2,5,3,8}
sigma = {0,0,0,0,0,0,0,2,2}
mu = {1,0,0,0,0,0,0,0,0}
d = {0,0.3,1,2,0.6,0.9,1,0.7,0.2}
r = {0,0,0,0,0,0,0,0,0}
b = {0,0,0,0,0,0,0,0,0}
alpha = {0,0,0,0,0,0,0,0,0}
gamma = {0,0,0,0,0,0,0,0,0.3}
theta = {th1,th2,th3,th4,th5,th6,th7,0.2,0.1}
XX = {0.2,0.5,0.3,0.3,0.6}
XY = {0,0,0,0,0}
XZ = {0,0,0,0,0}
YY = {0.2,0.5,0.3,0.3,0.6}
YZ = {0,0,0,0,0}
ZZ = {0.2,0.5,0.3,0.3,0.6}
MX = {0.15,0.4,0.3,0.3,0.4}
MY = {0,0.1,0,0,0.2}
MZ = {0,0,0,0,0}
M = {1,1.1,1.2,1.3,1.4}
IA = {0,0,0,0,0}
FV = {0.1,0,0,0,0.2}
FS = {0,0,0,0,0}
G = {0,-9.81,0}
"""


def composed():
    """The same two loops of components, each end given by its place on the link itself."""
    m = Mechanism("two_loops", gravity=(0, -9.81, 0), guess={"q1": 0.9, "q3": 1.5, "q4": 2.2})
    m.guess["q5"] = -1.0
    rows = [
        (0.2, 0.15, 0, 1, 0.1),
        (0.5, 0.4, 0.1, 1.1, 0),
        (0.3, 0.3, 0, 1.2, 0),
        (0.3, 0.3, 0, 1.3, 0),
        (0.6, 0.4, 0.2, 1.4, 0.2),
    ]
    links = [
        m.add(KhalilBody(f"link{j}", XX=J, YY=J, ZZ=J, MX=x, MY=y, M=M))
        for j, (J, x, y, M, _) in enumerate(rows, 1)
    ]
    one, two, three, four, five = links
    points = (m.world, one.at(0.3), m.world.at(1), m.world.at(2), four.at(0.6))
    for j, (point, link) in enumerate(zip(points, links, strict=True), 1):
        joint = Revolute(f"q{j}", Fv=rows[j - 1][4], actuated=j == 1)
        m.connect(point, joint, link)
    end = three.at(0.7, rotation=("z", 0.2))
    second = three.at(0.7, rotation=("z", 0.5)).at(0.2, rotation=("z", 0.1))
    for name, moving, fixed in (("q6", two.at(0.9), end), ("q7", five.at(1), second)):
        joint = Revolute(name, actuated=False)
        m.connect(moving, joint, fixed)
        m.cut(joint)
    return m


def of(mechanism):
    """Configuration, inertia and inverse dynamics, acceleration and a pose, at a closed state."""
    system = mechanism.assemble()
    q = np.array(system.configuration)
    assert system.closure.mobility == 1
    v, a = [0.7], [-0.4]
    tau = mbs.models.inverse_dynamics(system)(q, v, a)
    acceleration = mbs.models.direct_dynamics(system)(q, v, [1.5])
    T = mbs.models.transform(system, "link5")(q)
    return [np.array(x if not isinstance(x, tuple) else x[0]) for x in (q, tau, acceleration, T)]


def test_two_loops_are_those_of_the_components(tmp_path):
    path = tmp_path / "two.par"
    path.write_text(TWO_LOOPS)
    found, wanted = of(mbs.load(path)), of(composed())
    assert abs(found[0]).max() > 0.5
    for one, other in zip(found, wanted, strict=True):
        # 1e-10: Newton's method closes the loops to some 1e-12, the models amplify it
        assert one.ravel() == pytest.approx(other.ravel(), abs=1e-10)
    # moved away from the end frame the second loop closes elsewhere
    path.write_text(TWO_LOOPS.replace("0.7,0.2}", "0.7,0.25}"))
    assert abs(of(mbs.load(path))[0] - wanted[0]).max() > 1e-2


def test_round_trip(tmp_path):
    path = tmp_path / "two.par"
    path.write_text(TWO_LOOPS)
    table = read_par(path)
    assert [row.antecedent for row in table.frames][-2:] == [3, 8]
    write_par(table, path)
    assert read_par(path) == table


def test_many_loops_in_a_row(tmp_path):
    """Each end frame on the one before it: no recursion, however many there are."""
    B = 700
    ends = [1, *range(B + 2, 2 * B + 1)]
    rows = {
        "ant": [0] + [1] * B + ends,
        "sigma": [0] * (B + 1) + [2] * B,
        "theta": [f"th{j}" for j in range(1, B + 2)] + [0] * B,
        "d": [0] * (B + 1) + [0.1] * B,
    }
    vectors = (f"{key} = {{{','.join(map(str, row))}}}" for key, row in rows.items())
    path = tmp_path / "many.par"
    path.write_text("\n".join((f"NL = 1\nNJ = {B + 1}", *vectors)))
    mechanism = to_mechanism(read_par(path))
    last = mechanism.connections[-1][1]
    assert len(last.placement.steps) == B


def test_the_moving_end_frame_carries_nothing(tmp_path):
    path = tmp_path / "two.par"
    path.write_text(TWO_LOOPS.replace("3,8}", "3,6}"))
    with pytest.raises(DescriptionError) as error:
        mbs.load(path)
    assert "antecedent 6 moves with a cut joint" in str(error.value)
    assert "on the other frame of the cut, 8" in str(error.value)
