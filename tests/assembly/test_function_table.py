"""What printing a model shows: named elements, units, defaults."""

import mbs
from mbs.components import Body, Revolute
from mbs.models import direct_dynamics, inverse_dynamics, jacobian

PENDULUM = {
    "name": "pendulum",
    "parameters": {"L": 0.5, "m": 2.0},
    "frame": [{"antecedent": 0, "joint": "revolute"}],
    "body": [{"frame": 1, "YY": "m*L^2", "ZZ": "m*L^2", "MX": "m*L", "M": "m"}],
}


def test_every_input_is_named_with_its_unit() -> None:
    idm = inverse_dynamics(mbs.load("puma560").assemble())
    lines = str(idm).splitlines()
    assert lines[0] == "idm of puma560"
    assert lines[lines.index("input v (6, 1)") + 3].split() == ["2", "q3", "velocity", "[rad/s]"]
    assert lines[-1].split() == ["5", "q6", "effort", "[N.m]"]
    assert len(lines) == 1 + 4 * 7
    assert repr(idm) == "Function(idm:(q[6],v[6],a[6])->(tau[6]) SXFunction)"


def test_parameters_come_with_their_defaults() -> None:
    ddm = direct_dynamics(mbs.load(PENDULUM).assemble())
    lines = [line.split() for line in ddm.describe().splitlines()]
    assert ["1", "L", "parameter", "[1]", "=", "0.5"] in lines
    assert ["0", "m", "parameter", "[1]", "=", "2"] in lines


def test_a_closed_system_names_its_independent_joints_alone() -> None:
    four_bar = mbs.load("four_bar").assemble()
    lines = [line.split() for line in direct_dynamics(four_bar).describe().splitlines()]
    assert lines[5:] == [
        ["input", "v_a", "(1,", "1)"],
        ["0", "j1", "velocity", "[rad/s]"],
        ["input", "tau_a", "(1,", "1)"],
        ["0", "j1", "effort", "[N.m]"],
        ["output", "a_a", "(1,", "1)"],
        ["0", "j1", "acceleration", "[rad/s2]"],
    ]
    assert str(jacobian(four_bar, 2)).splitlines()[-1] == "output J (6, 1)"


def test_limits_of_joints_stand_beside_the_units() -> None:
    m = mbs.Mechanism("arm")
    bar = m.add(Body("bar", mass=1.0, com=(0.1, 0, 0), inertia=(1, 1, 1)))
    joint = Revolute("q1", axis="y", limits=(-1.5, 1.0), velocity=3.0, effort=(-4.0, 5.0))
    m.connect(m.world, joint, bar)
    lines = inverse_dynamics(m.assemble()).describe().splitlines()
    assert [line.split(maxsplit=2)[-1] for line in lines if line.startswith("    0")] == [
        "position [rad] -1.5 .. 1",
        "velocity [rad/s] -3 .. 3",
        "acceleration [rad/s2]",
        "effort [N.m] -4 .. 5",
    ]
