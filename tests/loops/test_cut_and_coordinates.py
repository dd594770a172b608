"""Coordinates and wrenches of joints do not depend on which joint of a loop is cut.

The cut decides how the tree runs through the joints. What `connect(a, joint, b)` describes is the
motion of b relative to a in any case.
"""

import numpy as np
import pytest
from support.ring_loops import ring_loop

import mbs
from mbs import models
from mbs.assembly.tables import ANGULAR, QUATERNION
from mbs.components import Body, JointSensor, Revolute, Spherical, WrenchSensor
from mbs.errors import AssemblyError
from mbs.loops.cut_positions import cut_positions

LOOPS = ["RSUR", "RRSRR", "RCSR", "RSRU", "RRSC"]
"""Loops of mobility one whose first joint has a motor."""


def observed(kinds, seed, cut):
    """A loop with a sensor for every coordinate and every wrench."""
    m = ring_loop(seed, kinds, cut=cut)
    for joint in list(m.joints()):
        m.add(WrenchSensor(f"wrench_{joint.name}", joint.name))
        for freedom in joint.freedoms:
            name = freedom.coordinate_of(joint.name)
            own = [name]
            if freedom.motion.nq == 4:
                own = [f"{name}.{element}" for element in QUATERNION + ANGULAR]
            for coordinate in own:
                m.add(JointSensor(f"read_{coordinate.replace('.', '_')}", coordinate))
    return m.assemble()


def readings(system):
    """What the sensors read where the motor moves at 0.7 rad/s and 0.3 rad/s2."""
    f = models.measurements(system)
    values = f.call([np.array(system.configuration), [0.7], [0.3]])
    return dict(zip(f.name_out(), (value.full().ravel() for value in values), strict=True))


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("kinds", LOOPS)
def test_every_cut_gives_the_same_numbers(kinds, seed):
    systems = [observed(kinds, seed, cut) for cut in range(1, len(kinds))]
    expected, *others = map(readings, systems)
    assert len(expected) >= 3 * len(kinds)
    size = max(np.max(np.abs(value)) for value in expected.values())
    for found in others:
        for name, value in expected.items():
            np.testing.assert_allclose(found[name], value, atol=1e-8 * size, err_msg=name)


@pytest.mark.parametrize(
    ("kinds", "seed", "guess"),
    [
        *((kinds, 2, {"j0": 0.4}) for kinds in LOOPS),
        ("RSUR", 1, {"j0": 0.2}),
        ("RSUR", 3, {"j0": 0.2}),
        ("RRSRR", 1, {"j0": 0.2}),
        ("RRSRR", 2, {"j3": -0.1}),
        ("RRSRR", 2, {"j3": -0.3}),
    ],
)
def test_every_cut_is_assembled_in_the_same_configuration(kinds, seed, guess):
    """Also where another branch is near, and where the guess is of the joint that is cut."""
    positions = {}
    for cut in range(1, len(kinds)):
        system = ring_loop(seed, kinds, cut=cut).assemble(guess)
        at_cut = np.array(cut_positions(system)(system.configuration, [])).ravel()
        names = [row.name for row in (*system.coordinates, *system.cut_coordinates)]
        values = [*system.configuration, *at_cut]
        for name, value in zip(names, values, strict=True):
            positions.setdefault(name, []).append(value)
    for name, values in positions.items():
        np.testing.assert_allclose(values, values[0], atol=1e-9, err_msg=name)
        assert abs(values[0]) <= np.pi
    for name, value in guess.items():
        assert positions[name][0] == pytest.approx(value, abs=1e-9)


@pytest.mark.parametrize("kinds", ["RSRR", "RRSR", "SRRR"])
@pytest.mark.parametrize("angle", [-2.9, -0.8, 1.0, 2.0, 2.5])
def test_every_cut_of_an_over_constrained_loop_is_assembled_in_the_same_configuration(kinds, angle):
    """Two configurations are equally far from the guess by the largest difference."""
    found = []
    for cut in range(4):
        system = flat(kinds, cut, (), {f"j{kinds.index('R')}": angle})
        at_cut = np.array(cut_positions(system)(system.configuration, [])).ravel()
        names = [row.name for row in (*system.coordinates, *system.cut_coordinates)]
        values = dict(zip(names, [*system.configuration, *at_cut], strict=True))
        found.append([values[f"j{k}"] for k, kind in enumerate(kinds) if kind == "R"])
    np.testing.assert_allclose(found, [found[0]] * 4, atol=1e-7)


def test_the_tree_passes_spherical_joints_both_ways():
    directions = {
        link.backward
        for cut in range(1, 5)
        for link in observed("RRSRR", 1, cut).tree.links
        if link.motion.nq == 4
    }
    assert directions == {True, False}


FLAT = 0.3, 0.6, 0.5, 0.7
"""Lengths of crank, coupler, rocker and ground of a plane loop [m]."""


def flat(kinds, cut, turned, start=None):
    """A four-bar in a plane with a spherical joint: it holds one direction twice.

    Args:
        kinds: "R" or "S" for each of the four joints.
        cut: number of the joint that closes the loop.
        turned: numbers of the joints that connect b to a.
        start: guess of positions by name.
    """
    m = mbs.Mechanism("flat", gravity=(0, -9.81, 0))
    links = [
        m.add(Body(n, mass=1.0 + k, com=(x / 2, 0.02 * k, 0), inertia=(0.03, 0.05, 0.06)))
        for k, (n, x) in enumerate(zip(("crank", "coupler", "rocker"), FLAT, strict=False))
    ]
    ends = [m.world.at(0, 0, 0), *(link.at(x, 0, 0) for link, x in zip(links, FLAT, strict=False))]
    starts = [*(link.at(0, 0, 0) for link in links), m.world.at(FLAT[3], 0, 0)]
    for k, (kind, a, b) in enumerate(zip(kinds, ends, starts, strict=True)):
        joint = Spherical(f"j{k}")
        if kind == "R":
            joint = Revolute(f"j{k}", axis="z", actuated=k == 0)
        m.connect(*((b, joint, a) if k in turned else (a, joint, b)))
        m.add(WrenchSensor(f"w{k}", f"j{k}", axes="world"))
        if k == cut:
            m.cut(joint)
    if start is None:
        start = {"j0": 1.0, "j3": -0.7106 if 3 not in turned else 0.7106}
    return m.assemble(guess=start)


@pytest.mark.parametrize("turned", [(), (2,), (1, 2, 3)])
@pytest.mark.parametrize("kinds", ["RRSR", "RSRR"])
def test_an_over_constrained_loop_has_the_same_wrenches_for_every_cut(kinds, turned):
    """Gravity and inertia act in the plane, and so do the wrenches that the loop determines."""
    found, directions = [], set()
    for cut in (1, 2, 3):
        system = flat(kinds, cut, turned)
        (loop,) = system.loops
        assert loop.dropped
        directions |= {link.backward for link in system.tree.links if link.motion.nq == 4}
        f = models.measurements(system)
        q = mbs.loops.solve(system, {"j0": 1.0})
        values = f.call([q, [0.7], [0.3]])
        found.append(np.concatenate([value.full().ravel() for value in values]))
    assert len(directions) == (2 if kinds == "RRSR" else 1)  # both ways, or one way
    assert np.abs(found[0]).max() > 10
    for other in found[1:]:
        np.testing.assert_allclose(other, found[0], atol=1e-10)


@pytest.mark.parametrize("cut", [1, 2])
def test_suggested_names_of_readings_do_not_depend_on_the_cut(cut):
    m = ring_loop(1, "RSUR", cut=cut)
    m.add(JointSensor("s", "j1.w"))
    with pytest.raises(AssemblyError, match=r"did you mean 'j1.wz' or 'j1.wy' or 'j1.wx'"):
        m.assemble()
