"""Complete configurations are accepted as they are; others are followed on the manifold."""

import numpy as np
import pytest
from support.catalogue_systems import catalogue_system

from mbs import Mechanism
from mbs.components import Box, Prismatic, Revolute
from mbs.errors import LoopError, Unclosable
from mbs.loops import closing, solve
from mbs.loops.configuration import start_position
from mbs.simulate import run

CLOSED = (
    "akr3000",
    "andrews_squeezer",
    "bricard",
    "delta",
    "five_bar",
    "four_bar",
    "modelica_four_bar",
    "stewart_platform",
)


def by_name(system, q):
    return dict(zip((c.name for c in system.coordinates), map(float, q), strict=True))


@pytest.mark.parametrize("name", CLOSED)
def test_a_complete_closed_configuration_is_accepted_as_it_is(name):
    system = catalogue_system(name)
    motion = run(
        system,
        0.6,
        step=0.1,
        v0={system.velocity_coordinates[system.independent[0]].name: 0.3},
        quiet=True,
    )
    for row in range(len(motion)):
        q = np.array([motion[f"{c.name}.q"][row] for c in system.coordinates])
        for given in (by_name(system, q), list(q), q):
            assert (start_position(system, given, None) == q).all()
        assert (solve(system, by_name(system, q)) == q).all()


def test_a_complete_open_configuration_is_an_error():
    system = catalogue_system("four_bar")
    q = by_name(system, system.configuration) | {"j2": 0.5}
    for given in (q, list(q.values())):
        with pytest.raises(LoopError, match=r"leaves the loops open by 0\.\d+"):
            start_position(system, given, None)


def test_dependent_positions_in_addition_to_the_independent_ones():
    system = catalogue_system("four_bar")
    q = solve(system, {"j1": 0.5})
    assert solve(system, {"j1": 0.5, "j4": q[2]}) == pytest.approx(q, abs=1e-9)
    with pytest.raises(Unclosable, match=r"do not close with j4 = 1\.3, the nearest is j4"):
        solve(system, {"j1": 0.5, "j4": 1.3})


def test_the_branch_of_a_five_bar_is_kept_near_a_singular_configuration():
    """Coarse steps jumped over the singular configuration in some of these cases."""
    system = catalogue_system("five_bar")
    rng, kept = np.random.default_rng(3), 0
    first = np.array(system.configuration)
    for q1, q3 in rng.uniform(-1.5, 1.5, (15, 2)) + first[[0, 2]]:
        try:
            q = solve(system, {"q1": q1, "q3": q3})
        except Unclosable:
            continue
        fine = first
        for part in np.linspace(0, 1, 100)[1:]:
            target = first + part * (q - first)
            fine = solve(
                system,
                {"q1": target[0], "q3": target[2]},
                guess=by_name(system, fine),
            )
        assert fine == pytest.approx(q, abs=1e-8)
        kept += 1
    assert kept > 6


def test_where_a_branch_ends_the_other_configurations_are_listed():
    system = catalogue_system("akr3000")
    q = {"q1": 0.011, "q5": -0.2308, "q6": 0.1956, "q8": 0.3466, "q9": -0.2035, "q10": -0.059}
    with pytest.raises(
        Unclosable, match=r"whose branch ends near .*; configurations with these pos.*: \(q2 = "
    ):
        solve(system, q)


def test_candidates_are_configurations_with_the_locked_positions():
    system = catalogue_system("four_bar")
    found = closing.candidates(
        closing.Closing(system, np.zeros(0), (0,)), solve(system, {"j1": 0.3})
    )
    assert len(found) == 2
    assert {round(float(q[1]), 4) for q in found} == {0.5441, -1.6954}


def test_a_complete_guess_is_the_start_of_the_branch():
    system = catalogue_system("four_bar")
    other = solve(system, {"j1": 0.3}, guess={"j2": -1.7, "j4": -1.8})
    q = solve(system, {"j1": 2.5}, guess=by_name(system, other))
    back = solve(system, {"j1": 0.3}, guess=by_name(system, q))
    assert back == pytest.approx(other, abs=1e-9)


@pytest.mark.parametrize("size", [1e-6, 1e-3, 1.0, 1e3, 1e5, 1e6])
def test_lengths_of_any_size(size):
    m = Mechanism("slider_crank", gravity=(0, -9.81, 0))
    a, b = (
        m.add(Box(n, length=x * size, width=0.01 * size, mass=1))
        for n, x in (("a", 0.1), ("b", 0.4))
    )
    c = m.add(Box("c", length=0.1 * size, width=0.1 * size, mass=1))
    m.connect(m.world, Revolute("j1", actuated=True), a.left)
    m.connect(a.right, Revolute("j2"), b.left)
    m.connect(b.right, Revolute("j3"), c)
    m.connect(m.world, Prismatic("s", axis="x"), c)
    system = m.assemble(guess={"j1": 0.3, "j2": -0.4})
    for angle in (0.7, -2.0, 5.0):
        q = by_name(system, solve(system, {"j1": angle}))
        rod = np.arcsin(0.25 * np.sin(angle))
        assert q["s"] == pytest.approx(size * (0.1 * np.cos(angle) + 0.4 * np.cos(rod)), rel=1e-9)
