"""Points that rods hold: delta robots, and their plane counterpart."""

import casadi
import numpy as np
import pytest
from support.configurations import active, same, searched

from mbs import Mechanism, Parameter
from mbs.components import (
    Body,
    Prismatic,
    Revolute,
    Rod,
    Universal,
)
from mbs.errors import Unclosable
from mbs.loops import assembly_modes, function, reduction_matrix, solve
from mbs.loops.plan import plan

GUESS = {"x": 0.05, "y": -0.02, "z": -0.7, "a0": 0.3, "a1": 0.3, "a2": 0.3}


def bar(m, name):
    return m.add(Body(name, mass=1.0, inertia=(0.1, 0.1, 0.1)))


def platform(m, axes, driven):
    """A body on slides along some axes of the world."""
    before = m.world
    for axis in axes:
        after = bar(m, f"on_{axis}")
        m.connect(before, Prismatic(axis, axis=axis, actuated=driven or None), after)
        before = after
    return before


def delta(forearms, driven="arms", length=0.9):
    """A delta robot whose platform three slides keep upright.

    Args:
        forearms: "rod", "rods" (two side by side), or "bodies" between universal joints.
        driven: "arms", else the platform.
        length: of the forearms.
    """
    m = Mechanism("delta", gravity=(0, 0, -9.81), guess=GUESS)
    moved = platform(m, "xyz", driven != "arms")
    for k in range(3):
        c, s = np.cos(2 * np.pi * k / 3), np.sin(2 * np.pi * k / 3)
        R = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        shoulder = Revolute(f"a{k}", axis="y", actuated=driven == "arms" or None)
        arm = bar(m, f"arm{k}")
        m.connect(m.world.at(*(R @ [0.3, 0, 0]), rotation=R), shoulder, arm)
        if forearms == "bodies":
            fore = bar(m, f"fore{k}")
            m.connect(arm.at(0.4), Universal(f"e{k}", axes=("y", "x")), fore)
            wrist = moved.at(*(R @ [0.1, 0, 0]), rotation=R)
            m.connect(fore.at(0, 0, -length), Universal(f"w{k}", axes=("x", "y")), wrist)
            continue
        for side in (0.05, -0.05) if forearms == "rods" else (0.0,):
            rod = Rod(f"rod{k}{'r' if side < 0 else 'l'}", length=length)
            m.connect(arm.at(0.4, side), rod, moved.at(*(R @ [0.1, side, 0])))
    return m.assemble()


@pytest.mark.parametrize("forearms", ["rod", "rods"])
def test_the_platform_of_a_delta_robot_has_two_places(forearms):
    system = delta(forearms)
    listed, found = assembly_modes(system), searched(system, active(system), starts=60)
    assert len(listed) == len(found) == 2
    assert all(any(same(system, mode.q, q) for q in found) for mode in listed)
    assert max(mode.residual for mode in listed) < 1e-12
    heights = {mode.branch[0][-1]: mode.q[2] for mode in listed}
    assert heights["+"] > heights["-"]  # of the elbows, counterclockwise seen from above


def test_the_platform_is_where_three_spheres_meet():
    system = delta("rod")
    q = np.array(function(system)([0.1, 0.3, -0.2])).ravel()
    for k, angle in enumerate((0.1, 0.3, -0.2)):
        c, s = np.cos(2 * np.pi * k / 3), np.sin(2 * np.pi * k / 3)
        elbow = 0.3 + 0.4 * np.cos(angle) - 0.1  # less the radius of the platform
        centre = np.array([c * elbow, s * elbow, -0.4 * np.sin(angle)])
        assert abs(np.linalg.norm(q[:3] - centre) - 0.9) < 1e-13


def test_the_arms_of_a_delta_robot_have_eight_configurations():
    system = delta("rod", driven="platform")
    listed = assembly_modes(system)
    assert len(listed) == len(searched(system, active(system), starts=200)) == 8
    assert [stage.labels for stage in plan(system)] == [(f"a{k}:+", f"a{k}:-") for k in range(3)]


def test_forearms_that_are_bodies():
    system = delta("bodies")
    listed = assembly_modes(system)
    assert len(listed) == 16  # two places, and each elbow in either of two ways
    assert max(mode.residual for mode in listed) < 1e-12
    assert any(same(system, mode.q, system.configuration) for mode in listed)
    check_slope(system, listed[0])


def check_slope(system, mode):
    x = casadi.SX.sym("x", len(system.chosen_coordinates))
    slope = casadi.jacobian(function(system, mode.branch)(x), x)
    G = np.array(casadi.Function("G", [x], [slope])(active(system)))
    np.testing.assert_allclose(G, np.array(reduction_matrix(system)(list(mode.q))), atol=1e-9)


@pytest.mark.parametrize("forearms", ["rod", "rods"])
def test_derivatives(forearms):
    system = delta(forearms)
    for mode in assembly_modes(system):
        check_slope(system, mode)


def test_the_length_stays_a_symbol():
    system = delta("rod", length=Parameter("L", 0.9))
    short = delta("rod", length=0.8)
    q = function(system, "rod2l:-")([0.1, 0.2, 0.3], [0.8])
    np.testing.assert_allclose(
        np.array(q), np.array(function(short, "rod2l:-")([0.1, 0.2, 0.3])), atol=1e-12
    )


def test_out_of_reach_the_range_is_named():
    system = delta("rod", length=0.59)
    assert assembly_modes(system, [0.0, 0.0, 0.0]) == []  # the elbows are 0.6 m from the middle
    with pytest.raises(Unclosable, match=r"a0 can be .* rad; a1 can be .* as they are$"):
        solve(system, [0.0, 0.0, 0.0], branch=[])


def held_in_a_plane(rods):
    """A point on two slides and rods from two cranks."""
    m = Mechanism("plotter", guess={"x": 0.4, "y": 0.6})
    moved = platform(m, "xy", driven=False)
    for k in range(rods):
        crank = bar(m, f"crank{k}")
        m.connect(m.world.at(k), Revolute(f"c{k}", actuated=True), crank)
        m.connect(crank.at(0.3, 0, 0.1 * k), Rod(f"r{k}", length=0.8), moved.at(0.0, 0.0, 0.02))
    return m.assemble(guess={"c0": 1.2, "c1": 1.9} if rods == 2 else {"c0": 1.2})


def test_two_rods_hold_a_point_in_a_plane():
    system = held_in_a_plane(2)
    listed, found = assembly_modes(system), searched(system, active(system), starts=60)
    assert len(listed) == len(found) == 2
    assert max(mode.residual for mode in listed) < 1e-12
    heights = {mode.branch[0]: mode.q[1] for mode in listed}
    assert heights["r1:+"] > heights["r1:-"]  # to the left of the line from crank to crank


def test_one_rod_for_two_slides_leaves_one_of_them_independent():
    system = held_in_a_plane(1)
    assert len(system.chosen_coordinates) == 2
    assert len(assembly_modes(system)) == 2
