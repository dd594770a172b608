"""Rods between two balls as bodies of their own, which may spin about their line."""

import numpy as np
import pytest
from support.configurations import same
from support.ring_loops import ring_loop

import mbs
from mbs import Mechanism
from mbs.assembly.tree import quaternion_slices
from mbs.components import Body, Revolute, Spherical
from mbs.errors import ModelError, NoClosedForm, Unclosable
from mbs.loops import assembly_modes, function, solve
from mbs.loops.closing import Closing
from mbs.loops.plan import plan
from mbs.models import direct_geometry

CASES = [("RSSR", None), ("RSSR", 1), ("RSSR", 3), ("RSSP", None), ("PSSR", 3), ("RWSR", 2)]


def turn_of(system, q, body):
    """The orientation of a body."""
    return np.array(mbs.models.transform(system, body)(q))[:3, :3]


@pytest.mark.parametrize(("kinds", "cut"), CASES)
def test_both_ways_close(kinds, cut):
    system = ring_loop(1, kinds, cut=cut).assemble()
    listed = assembly_modes(system)
    assert len(listed) == 2
    assert max(mode.residual for mode in listed) < 1e-12
    assert any(same(system, mode.q, system.configuration) for mode in listed)
    assert len(plan(system)) == (2 if cut in (None, 1) else 3)


@pytest.mark.parametrize("cut", [1, 2, 3])
def test_the_spin_turns_the_rod_about_its_line(cut):
    system = ring_loop(1, "RSSR", cut=cut).assemble()
    spins = [
        system.velocity_coordinates[k].name
        for k in system.chosen_coordinates
        if system.velocity_coordinates[k].name != "j0"
    ]
    assert len(spins) == 1
    frames = {}
    for angle in (0.0, 0.4, -2.0):
        q = solve(system, {"j0": 0.1, spins[0]: angle}, branch=[])
        assert np.abs(np.array(mbs.loops.closure_residual(system)(q))).max() < 1e-12
        frames[angle] = turn_of(system, q, "body2")
    for angle in (0.4, -2.0):
        R = frames[angle] @ frames[0.0].T
        assert abs((np.trace(R) - 1) / 2 - np.cos(angle)) < 1e-12
    first, second = (frames[a] @ frames[0.0].T for a in (0.4, -2.0))
    np.testing.assert_allclose(first @ second, second @ first, atol=1e-12)  # about one line


def test_the_rest_does_not_depend_on_the_spin():
    system = ring_loop(1, "RSSR", cut=2).assemble()
    (part,) = quaternion_slices(system.tree)
    others = [k for k in range(system.nq) if not part.start <= k < part.stop]
    f = function(system)
    values = [np.array(f([0.1, angle])).ravel()[others] for angle in (0.0, 1.0)]
    np.testing.assert_array_equal(*values)
    assert all(is_searched(system, mode) for mode in assembly_modes(system, [0.1, 0.0]))


def is_searched(system, mode):
    """Whether a search for any configuration with the same crank finds that follower."""
    names = [coordinate.name for coordinate in system.coordinates]
    place = names.index("j3")
    rng = np.random.default_rng(0)
    closing = Closing(system, np.zeros(0), (names.index("j0"),))
    for _ in range(60):
        q = np.array(mode.q) + rng.uniform(-2, 2, system.nq)
        q[names.index("j0")] = 0.1
        found = closing.nearest(q)
        if found.is_closed and abs(np.sin((found.q[place] - mode.q[place]) / 2)) < 1e-6:
            return True
    return False


def test_the_range_leaves_the_spin_out():
    system = ring_loop(1, "RSSR").assemble()
    lost = [x for x in np.linspace(-3, 3, 60) if not assembly_modes(system, [x, 0.0])]
    with pytest.raises(Unclosable, match=r"j0 can be [^;]* rad, the other positions as they are$"):
        solve(system, {"j0": lost[0]}, branch=[])


def test_a_spin_that_is_no_number():
    system = ring_loop(1, "RSSR").assemble()
    spin = next(
        system.velocity_coordinates[k].name
        for k in system.chosen_coordinates
        if system.velocity_coordinates[k].name != "j0"
    )
    with pytest.raises(ModelError, match="give a finite number"):
        assembly_modes(system, {spin: np.nan})


def test_the_spin_is_named_among_the_inputs():
    system = ring_loop(1, "RSSR").assemble()
    names = [system.velocity_coordinates[k].name for k in system.chosen_coordinates]
    pose = direct_geometry(system)
    assert pose.elements("q_a") == [(name, "rad") for name in names]
    with pytest.raises(ModelError, match=f"3 values, it needs 2: {', '.join(names)}$"):
        pose([0.1, 0.2, 0.3])


def test_a_ball_that_turns_freely_is_refused():
    m = Mechanism("pendulum")
    bar, crank, arm = (m.add(Body(n, mass=1.0, inertia=(0.1, 0.1, 0.1))) for n in "abc")
    m.connect(m.world, Spherical("s"), bar)
    m.connect(bar.at(0.5, 0.3), Revolute("r"), crank)
    m.connect(crank.at(0.5), Revolute("k"), arm)
    m.connect(arm.at(0.5), Revolute("x"), bar.at(0.3, 0.1))
    with pytest.raises(NoClosedForm, match="the quaternion of s rotates freely"):
        assembly_modes(m.assemble(guess={"r": 0.5, "k": 1.0}))
