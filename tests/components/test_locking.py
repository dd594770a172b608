"""Joints welded at positions: the rest moves as it does when they are held there."""

import numpy as np
import pytest

import mbs
from mbs import Mechanism
from mbs.components import (
    Body,
    Coupling,
    Cylindrical,
    Fixed,
    FixedTendon,
    Free,
    JointSensor,
    JointStop,
    Planar,
    Prismatic,
    Revolute,
    Spherical,
)
from mbs.errors import DescriptionError

INERTIAL = {"mass": 2.0, "com": (0.1, 0.2, 0.3), "inertia": (0.3, 0.4, 0.35)}


def chain(*joints):
    mechanism = Mechanism("chain")
    at = mechanism.world.at(0.1, 0.2, 0.3, rotation=("x", 0.4))
    for number, joint in enumerate(joints):
        body = mechanism.add(Body(f"b{number}", **INERTIAL))
        mechanism.connect(at, joint, body)
        at = body.at(0.2, -0.1, 0.3, rotation=[("y", 0.3), ("z", 0.7)])
    mechanism.add_frame("tool", at)
    return mechanism


LOCKED = {
    "revolute": (Revolute("x", axis=(0.6, 0, 0.8)), 0.7, [0.7]),
    "revolute about an axis": (Revolute("x", axis="-y"), -0.4, [-0.4]),
    "prismatic": (Prismatic("x", axis=(0.6, 0, 0.8)), 0.7, [0.7]),
    "cylindrical": (Cylindrical("x", axis="y"), (0.3, 0.8), [0.3, 0.8]),
    "planar": (Planar("x", axis=(0, 0.6, 0.8)), (0.3, -0.2, 0.8), [0.3, -0.2, 0.8]),
    "spherical": (Spherical("x"), (0.5, 0.5, -0.5, 0.5), [0.5, 0.5, -0.5, 0.5]),
    "free": (Free("x"), (1, 2, 3, 0.6, 0.8, 0, 0), [1, 2, 3, 0.6, 0.8, 0, 0]),
}


@pytest.mark.parametrize("case", LOCKED)
def test_a_locked_joint_is_one_that_is_held(case):
    """Efforts of the other joints, and poses, are those of the unlocked chain at rest there."""
    joint, position, q_x = LOCKED[case]
    moving = chain(Revolute("a", axis="y"), joint, Prismatic("b", axis="x")).assemble()
    mechanism = chain(Revolute("a", axis="y"), joint, Prismatic("b", axis="x"))
    mechanism.lock({"x": position})
    locked = mechanism.assemble()
    assert [c.name for c in locked.coordinates] == ["a", "b"]
    assert isinstance(mechanism.components["x"], Fixed)
    q, v, a = np.array([[0.3, -0.5], [1.1, 0.7], [-0.4, 0.9]])
    zero = np.zeros(moving.nv - 2)
    full = [np.concatenate([one[:1], z, one[1:]]) for one, z in ((v, zero), (a, zero))]
    tau = np.array(mbs.models.inverse_dynamics(moving)([q[0], *q_x, q[1]], *full)).ravel()
    ours = np.array(mbs.models.inverse_dynamics(locked)(q, v, a)).ravel()
    assert ours == pytest.approx(tau[[0, -1]], rel=1e-12)
    T, T_locked = (
        np.array(mbs.models.transform(s, "tool")(p))
        for s, p in ((moving, [q[0], *q_x, q[1]]), (locked, q))
    )
    assert T_locked == pytest.approx(T, abs=1e-13)


def test_a_symbol_as_position():
    mechanism = chain(Revolute("a", axis="y"), Revolute("x", axis=(0.6, 0, 0.8)), Revolute("b"))
    mechanism.lock({"x": mbs.Parameter("angle", 0.7)})
    plain = chain(Revolute("a", axis="y"), Revolute("x", axis=(0.6, 0, 0.8)), Revolute("b"))
    plain.lock({"x": -1.2})
    state = ([0.3, -0.5], [1.1, 0.7], [-0.4, 0.9])
    symbolic = mbs.models.inverse_dynamics(mechanism.assemble())(*state, [-1.2])
    numeric = mbs.models.inverse_dynamics(plain.assemble())(*state)
    assert np.array(symbolic) == pytest.approx(np.array(numeric), rel=1e-12)


def coupled():
    mechanism = chain(
        *(Revolute(name, axis=axis) for name, axis in zip("abcd", "yzxy", strict=True))
    )
    mechanism.add(Coupling("ab", driven="b", driver="a", coefficients=(0.1, 2.0)))
    mechanism.add(Coupling("bc", driven="c", driver="b", coefficients=(0.0, 0.0, 1.0)))
    return mechanism


@pytest.mark.parametrize("lock", [{"a": 0.3}, {"b": 0.7}, {"a": 0.3, "c": 0.49}])
def test_what_couplings_tie_is_locked_too(lock):
    mechanism = coupled()
    mechanism.lock(lock)
    other = chain(*(Revolute(name, axis=axis) for name, axis in zip("abcd", "yzxy", strict=True)))
    other.lock({"a": 0.3, "b": 0.7, "c": 0.49})
    system = mechanism.assemble()
    assert [c.name for c in system.coordinates] == ["d"]
    assert not system.is_closed
    T, T_other = (
        np.array(mbs.models.transform(m.assemble(), "tool")([0.2])) for m in (mechanism, other)
    )
    assert pytest.approx(T_other, abs=1e-13) == T


def test_a_locked_joint_in_a_loop():
    """A five-bar with one motor held is a four-bar; it closes and its other motor drives it."""
    free = mbs.load("five_bar")
    system = free.assemble()
    name = system.coordinates[0].name
    position = system.configuration[0]
    locked = mbs.load("five_bar", lock={name: position}).assemble(
        guess={
            c.name: x for c, x in zip(system.coordinates[1:], system.configuration[1:], strict=True)
        }
    )
    assert (len(system.independent), len(locked.independent)) == (2, 1)
    held = dict(zip([c.name for c in system.coordinates], system.configuration, strict=True))
    now = dict(zip([c.name for c in locked.coordinates], locked.configuration, strict=True))
    for coordinate, value in now.items():
        if coordinate in held:
            assert value == pytest.approx(held[coordinate], abs=1e-9)


def test_what_acts_along_a_locked_coordinate_goes_with_it():
    mechanism = chain(Revolute("a"), Revolute("b", axis="y"))
    mechanism.add(JointStop("stop", "a", upper=1.0, stiffness=10.0, width=0.01))
    mechanism.guess = {"a": 0.2, "b": 0.3}
    mechanism.lock({"a": 0.1})
    assert "stop" not in mechanism.components
    assert mechanism.guess == {"b": 0.3}
    mechanism.assemble()


def test_impossible_locks_are_refused():
    def refused(message, positions, mechanism=None):
        with pytest.raises(DescriptionError) as error:
            (mechanism or coupled()).lock(positions)
        assert message in str(error.value)

    refused("'e' is no joint that could be locked; use one of a, b, c, d", {"e": 1})
    refused("(1, 2) is not its position; give 1 number(s)", {"a": (1, 2)})
    refused("bc does not tell where b is when c is locked; lock b", {"c": 0.49})
    refused("ab puts b at 0.7, but it is locked at 0.5; lock one of the two", {"a": 0.3, "b": 0.5})
    refused("is not numbers of unit length", {"x": (1, 1, 0, 0)}, chain(Spherical("x")))
    read = chain(Revolute("a"), Revolute("b"))
    read.add(JointSensor("angle", "a"))
    refused("angle reads the joint a, which is to be locked", {"a": 1}, read)


def planetary(**locked):
    """Sliders, a = 0.1 + 2 b - 0.5 c + 3 d, and one that is free of them."""
    m = Mechanism("planetary")
    for name in "abcde":
        m.connect(m.world, m.add(Prismatic(name, axis="x")), m.add(Body(f"body_{name}", mass=1)))
    m.add(Coupling("sum", "a", "b", (0.1, 2.0), others=(("c", -0.5), ("d", 3.0))))
    m.lock(locked)
    return m


@pytest.mark.parametrize(
    "locked",
    [
        {"c": 0.4},
        {"b": 0.3},
        {"a": -0.2},
        {"b": 0.3, "c": 0.4},
        {"c": 0.4, "d": -0.1},
        {"a": -0.2, "d": 0.5},
        {"a": -0.2, "b": 0.3},
        {"b": 0.3, "c": 0.4, "d": -0.1},
        {"a": -0.2, "c": 0.4, "d": -0.1},
    ],
)
def test_couplings_of_many_coordinates_hold_among_those_that_are_left(locked):
    system = planetary(**locked).assemble()
    assert len(system.chosen_coordinates) == 1 + max(3 - len(locked), 0)
    x = [0.7, -0.9, 0.35, 0.1][: len(system.chosen_coordinates)]
    q = mbs.loops.solve(system, x) if system.is_closed else x
    at = {b: float(mbs.models.transform(system, f"body_{b}")(q)[0, 3]) for b in "abcd"}
    assert all(at[name] == pytest.approx(value) for name, value in locked.items())
    total = 0.1 + 2 * at["b"] - 0.5 * at["c"] + 3 * at["d"]
    assert at["a"] == pytest.approx(total, abs=1e-12)


def test_a_tendon_along_a_joint_that_stays_free_is_not_lost():
    m = planetary()
    m.add(FixedTendon("tendon", levers=(("b", 1.0), ("c", 1.0)), stiffness=10.0))
    with pytest.raises(DescriptionError, match="tendon acts along b, c together; lock all of them"):
        m.lock({"b": 0.0})
