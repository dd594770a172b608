"""Over-constrained loops all the way round: their rows are chosen anew, or all of them are used."""

import numpy as np
import pytest
from support.bennett import bennett
from support.catalogue_systems import catalogue_system

import mbs
from mbs.components import Body, Revolute
from mbs.errors import SolverError
from mbs.loops import assembly_modes, configuration_report

CASES = [((0.9, 1.7), 1, 3), ((0.3, 1.2), 0, 3), ((1.4, 0.5), 2, 0), ((2.5, 0.8), 0, 3)]


@pytest.mark.parametrize(("twists", "driven", "cut"), CASES)
def test_bennetts_loop_keeps_its_energy_over_several_turns(twists, driven, cut):
    """With rows that were chosen once, the energy of the first one jumped by 8 J, unsaid."""
    system = bennett(driven, cut, twists)
    assert system.closure.varies
    name = f"j{driven}"
    result = mbs.simulate.run(system, 3.0, v0={name: 6.0}, tolerance=1e-9, quiet=True)
    assert len(result.time) == 301
    assert np.ptp(result[f"{name}.q"]) > 4 * np.pi
    energy = result["kinetic_energy"] + result["potential_energy"]
    assert np.ptp(result["kinetic_energy"]) > 10
    assert np.ptp(energy) < 1e-6
    assert result["closure_residual"].max() < 1e-12


def test_the_motion_does_not_depend_on_which_joint_is_cut():
    motions = []
    for cut in (2, 3):
        system = bennett(1, cut, (0.9, 1.7))
        start = assembly_modes(system, [0.5])[0].q
        result = mbs.simulate.run(
            system, 2.0, q0=list(start), v0={"j1": 6.0}, tolerance=1e-10, quiet=True
        )
        motions.append(result["j1.q"])
    assert motions[0] == pytest.approx(motions[1], abs=1e-8)


@pytest.mark.parametrize(("twists", "driven", "cut"), CASES)
def test_models_hold_where_the_kept_rows_are_dependent(twists, driven, cut):
    """All the way round, ddm undoes idm, and v = G v_a satisfies every row."""
    system = bennett(driven, cut, twists)
    idm, ddm = mbs.models.inverse_dynamics(system), mbs.models.direct_dynamics(system)
    G, J = mbs.loops.reduction_matrix(system), mbs.loops.closure_jacobian(system)
    weakest = 1.0
    for x in np.linspace(-3.0, 3.0, 61):
        (mode,) = assembly_modes(system, [x])
        weakest = min(weakest, configuration_report(system, mode.q).leads)
        tau = idm(mode.q, [1.5], [0.7])
        assert float(ddm(mode.q, [1.5], tau)) == pytest.approx(0.7, rel=1e-8)
        assert np.abs(np.array(J(mode.q)) @ np.array(G(mode.q))).max() < 1e-9
    assert weakest > 1e-8


def test_energy_is_exchanged_as_the_models_say():
    """Power of gravity along v = G v_a, by the rate of the energy between close configurations."""
    system = bennett(1, 3, (0.9, 1.7))
    energy = mbs.models.energy(system)
    gravity = mbs.models.gravity_effort(system)
    for x in (-2.0, 0.0, 1.0):
        h = 1e-6
        low, high = (assembly_modes(system, [x + sign * h])[0].q for sign in (-1, 1))
        slope = (float(energy(high, [0])[1]) - float(energy(low, [0])[1])) / (2 * h)
        assert float(gravity(assembly_modes(system, [x])[0].q)) == pytest.approx(slope, abs=1e-6)


def test_planar_loops_keep_their_rows():
    for name in ("four_bar", "five_bar", "sr400", "slider_crank"):
        assert not catalogue_system(name).closure.varies
    assert catalogue_system("bricard").closure.varies


def test_wrenches_stay_of_one_size_all_the_way_round():
    """With the rows of one configuration a joint seemed to carry forty times as much in another."""
    system = bennett(1, 3, (0.9, 1.7))
    free = mbs.models.joint_wrenches(system)
    tree = mbs.models.joint_wrenches(system, "tree")
    idm, G = mbs.models.inverse_dynamics(system), mbs.loops.reduction_matrix(system)
    rates = mbs.models.acceleration_closure(system)
    largest = []
    for x in np.linspace(-3.0, 3.0, 41):
        (mode,) = assembly_modes(system, [x])
        v = np.array(G(mode.q)) @ [1.0]
        a = np.array(rates(mode.q, [1.0])[2]).ravel()
        tau = np.zeros(system.nv)
        tau[list(system.independent)] = float(idm(mode.q, [1.0], [0.0]))
        F, same = np.array(free(mode.q, [1.0], [0.0])), np.array(tree(mode.q, v, a, tau))
        assert same == pytest.approx(F, rel=1e-6, abs=1e-6)
        largest.append(np.abs(F).max())
    assert max(largest) < 5 * np.median(largest)


def test_a_motion_that_is_prescribed_goes_all_the_way_round():
    """The law goes on where one leg ends and the next begins."""
    system = bennett(1, 3, (0.9, 1.7))
    start = assembly_modes(system, [0.5])[0].q[system.independent[0]]
    result = mbs.simulate.run(
        system, 2.5, motion={"j1.q": lambda t: start + 3 * t}, tolerance=1e-9, quiet=True
    )
    assert result["j1.q"] == pytest.approx(start + 3 * result.time, abs=1e-10)
    work = np.trapezoid(result["j1.tau"] * result["j1.v"], result.time)
    energy = result["kinetic_energy"] + result["potential_energy"]
    assert work == pytest.approx(energy[-1] - energy[0], abs=5e-3)


def sarrus():
    """Two chains of three hinges, in planes at right angles, lift a plate straight up."""
    m = mbs.Mechanism("sarrus", gravity=(0, 0, -9.81))
    top = m.add(Body("top", mass=1, inertia=(0.1, 0.1, 0.1)))
    for name, axis, end in (("x", "y", (1, 0, 0)), ("y", "x", (0, 1, 0))):
        back = tuple(-c for c in end)
        low, up = (m.add(Body(f"{side}_{name}", mass=1)) for side in ("low", "up"))
        m.connect(m.world, Revolute(f"{name}1", axis=axis, actuated=name == "x"), low)
        m.connect(low.at(*end), Revolute(f"{name}2", axis=axis), up)
        m.connect(up.at(*back), closing := Revolute(f"{name}3", axis=axis), top)
    m.cut(closing)
    return m.assemble(guess={"x1": -0.5, "x2": 1.0, "x3": -0.5, "y1": 0.5, "y2": -1.0})


LIFT = [-1.0, 2.0, -1.0, 1.0, -2.0]


@pytest.mark.parametrize(
    "v0",
    [None, {"x1": -1.0}, {"x1": -1.0, "y1": 1.0}, [1.0, 0.0, -1.0, 0.0, 0.0]],
    ids=["rest", "crank", "cranks", "spin"],
)
def test_a_sarrus_linkage_that_starts_flat_and_does_not_lift_is_refused(v0):
    """Either chain may turn about its hinges there instead of lifting, without end or energy."""
    message = r"sarrus.*velocities of one branch.*x1 = 0, x2 = 0.*hold \w1 there"
    with pytest.raises(SolverError, match=message):
        mbs.simulate.run(sarrus(), 1.0, q0=[0.0] * 5, v0=v0, quiet=True)


@pytest.mark.parametrize("speed", [1.0, -1e-3])
def test_a_flat_sarrus_linkage_lifts_with_the_velocities_that_it_is_given(speed):
    """Its energy moved by 1e-4 J, whatever the tolerance, as long as rows were chosen."""
    system = sarrus()
    for tolerance in (1e-4, 1e-7, 1e-10):
        v0 = [speed * x for x in LIFT]
        result = mbs.simulate.run(system, 1.0, q0=[0.0] * 5, v0=v0, tolerance=tolerance, quiet=True)
        energy = result["kinetic_energy"] + result["potential_energy"]
        assert np.ptp(energy) < tolerance * result["kinetic_energy"].max()
        assert result["x2.q"] == pytest.approx(-2 * result["x1.q"], abs=1e-9)
        assert result["y1.q"] == pytest.approx(-result["x1.q"], abs=1e-9)


def test_a_sarrus_linkage_falls_through_its_flat_configuration():
    system = sarrus()
    for tolerance in (1e-5, 1e-9):
        result = mbs.simulate.run(system, 2.0, v0={"x1": -5.0}, tolerance=tolerance, quiet=True)
        energy = result["kinetic_energy"] + result["potential_energy"]
        assert np.ptp(result["x1.q"]) > 3 * np.pi  # flat at every half of a turn
        assert np.ptp(energy) < tolerance * result["kinetic_energy"].max()


def test_legs_end_where_all_rows_are_dependent():
    """A velocity that is prescribed has no position for coordinates along the motion."""
    message = r"sarrus.*singular configuration is not passed.*configuration is x1 = "
    with pytest.raises(SolverError, match=message):
        mbs.simulate.run(sarrus(), 1.0, motion={"x1.v": 2.0}, quiet=True)
    message = r"sarrus.*singular configuration is not passed.*configuration is x1 = 0"
    with pytest.raises(SolverError, match=message):
        mbs.simulate.run(
            sarrus(), 1.0, q0=dict.fromkeys(("x1", "x2"), 0.0), motion={"x1.v": 2.0}, quiet=True
        )
