"""Rigid stops and Coulomb friction in closed loops, against impulses and equilibria by plain
numpy."""

import numpy as np
import pytest
from support.contact_mechanisms import DENSITY, FOUR, FOUR_GUESS, WIDTH, bars

import mbs
from mbs.components import (
    CoulombFriction,
    JointFriction,
    RigidStop,
    WrenchSensor,
)


def run(system, duration, **options):
    return mbs.simulate.run(system, duration, quiet=True, tolerance=1e-10, **options)


def arm(q, lengths, x):
    """Mass centres with angles (k, 3) and the end (2,) of an arm whose first pivot is (x, 0)."""
    at, angle, poses = np.array([x, 0.0]), 0.0, []
    for turn, length in zip(q, lengths, strict=True):
        angle += turn
        along = length * np.array([np.cos(angle), np.sin(angle)])
        poses.append([*(at + along / 2), angle])
        at = at + along
    return np.array(poses), at


def numbers(q, lengths, base):
    """Every body's pose, and how far the pin is open."""
    n = len(lengths["a"])
    a, end_a = arm(q[:n], lengths["a"], 0.0)
    b, end_b = arm(q[n:], lengths["b"], base)
    return np.vstack([a, b]).ravel(), end_a - end_b


def derivative(f, q):
    columns = []
    for k in range(len(q)):
        step = 1e-6 * np.eye(len(q))[k]
        columns.append((f(q + step) - f(q - step)) / 2e-6)
    return np.column_stack(columns)


def inertia(q, lengths, base):
    """Inertia matrix and rows of the loop, of homogeneous boxes, by central differences."""
    every = [*lengths["a"], *lengths["b"]]
    mass = np.array([DENSITY * WIDTH**2 * length for length in every])
    turn = mass * (np.array(every) ** 2 + WIDTH**2) / 12
    weights = np.column_stack([mass, mass, turn]).ravel()
    X = derivative(lambda x: numbers(x, lengths, base)[0], q)
    return X.T @ (weights[:, None] * X), derivative(lambda x: numbers(x, lengths, base)[1], q)


def after_impact(A, J, v, row, restitution):
    """Velocities after an impulse that turns one of them round, the loop kept closed."""
    n, m = len(v), len(J)
    rows = np.vstack([J, np.eye(n)[row]])
    K = np.block([[A, -rows.T], [rows, np.zeros((m + 1, m + 1))]])
    right = np.concatenate([np.zeros(n + m), [-(1 + restitution) * v[row]]])
    return v + np.linalg.solve(K, right)[:n]


FIVE = {"a": (0.5, 0.6), "b": (0.5, 0.6)}
FIVE_GUESS = {"a1": 2.0, "a2": -1.2, "b1": 1.1, "b2": 1.2}


def at_event(system, result, k):
    """Time and row after the first event."""
    time = result.events[k][0]
    return time, int(np.searchsorted(result.time, time, side="right"))


def test_the_rocker_of_a_four_bar_hits_a_stop():
    end = RigidStop("end", joint="b1", upper=2.2, restitution=0.6)
    system = bars(FOUR, 0.8, 0.0, end, guess=FOUR_GUESS)
    result = run(system, 1.2, v0={"b1": 1.0}, step=0.001)
    assert {what for *_, what in result.events} == {"bounces off upper"}
    energy = result["kinetic_energy"]
    levels = np.unique(np.round(energy / energy[0], 8))
    bounces = len(result.events)
    assert bounces >= 1
    np.testing.assert_allclose(levels[::-1], 0.36 ** np.arange(bounces + 1), rtol=1e-7)
    assert np.max(result["b1.q"]) <= 2.2 + 1e-12
    assert np.max(result["closure_residual"]) < 1e-11


def test_an_impact_in_a_five_bar_equals_the_impulse_by_hand():
    end = RigidStop("end", joint="a1", lower=1.4, restitution=0.5)
    system = bars(FIVE, 0.6, 0.0, end, guess=FIVE_GUESS)
    result = run(system, 0.6, v0={"a1": -1.5, "b1": 0.7}, step=2.5e-5)
    time, row = at_event(system, result, 0)
    names = ("a1", "a2", "b1", "b2")

    def state(k, to):
        """q and v at a time near a row, by its accelerations."""
        q, v, a = (np.array([result[f"{n}.{x}"][k] for n in names]) for x in "qva")
        since = to - result.time[k]
        return q + since * v + since**2 / 2 * a, v + since * a

    q, before = state(row - 1, time)
    expected = after_impact(*inertia(q, FIVE, 0.6), before, 0, 0.5)
    _, after = state(row, time)
    assert before[0] < -0.5
    assert abs(expected[2] - before[2]) > 0.01
    np.testing.assert_allclose(after, expected, atol=1e-6)
    assert result["kinetic_energy"][row] < result["kinetic_energy"][row - 1]


def test_a_four_bar_rests_on_its_stop_under_gravity():
    end = RigidStop("end", joint="b1", upper=2.2)
    cells = WrenchSensor("cell_a", "a1"), WrenchSensor("cell_b", "b1")
    system = bars(FOUR, 0.8, -9.81, end, *cells, guess=FOUR_GUESS)
    result = run(system, 3.0, tau=lambda t, q, v: np.array([8.0, 0.0, 0.0]))
    assert result.events[-1][1:] == ("end", "rests at upper")
    q = np.array([result[f"{name}.q"][-1] for name in ("a1", "a2", "b1")])
    J = derivative(lambda x: numbers(x, FOUR, 0.8)[1], q)
    (motion,) = np.linalg.svd(J)[2][2:]
    masses = DENSITY * WIDTH**2 * np.array([0.4, 1.0, 0.9])

    def height(x):
        return np.array([masses @ numbers(x, FOUR, 0.8)[0].reshape(3, 3)[:, 1]])

    power = 8.0 * motion[0] - 9.81 * (derivative(height, q) @ motion)[0]
    assert result["end.effort"][-1] == pytest.approx(-power / motion[2], rel=1e-7)
    assert result["end.effort"][-1] < 0
    assert result["cell_a.m.z"][-1] == pytest.approx(8.0, abs=1e-7)
    assert result["cell_b.m.z"][-1] == pytest.approx(result["end.effort"][-1], abs=1e-7)
    assert abs(result["b1.q"][-1] - 2.2) < 1e-12
    assert np.max(result["closure_residual"]) < 1e-11


@pytest.mark.parametrize("part", [0.98, 1.02])
def test_friction_of_two_pivots_of_a_loop_holds_what_both_can(part):
    """One degree of freedom, of which two elements stick at once."""
    first = CoulombFriction("first", joint="a1", sliding=2.0)
    other = CoulombFriction("other", joint="b1", sliding=3.0)
    system = bars(FOUR, 0.8, 0.0, first, other, guess=FOUR_GUESS)
    q = np.array(system.configuration)
    J = derivative(lambda x: numbers(x, FOUR, 0.8)[1], q)
    (motion,) = np.linalg.svd(J)[2][2:]
    most = 2.0 + 3.0 * abs(motion[2] / motion[0])
    result = run(system, 1.0, tau={"a1": part * most})
    moves = np.max(np.abs(result["a1.q"] - q[0]))
    assert moves < 1e-12 if part < 1 else moves > 1e-2
    if part < 1:
        held = [result[f"{name}.effort"] for name in ("first", "other")]
        assert np.max(np.abs(held[0])) < 2 + 1e-6
        assert np.max(np.abs(held[1])) < 3 + 1e-6
        power = (part * most + held[0]) * motion[0] + held[1] * motion[2]
        assert np.max(np.abs(power)) < 1e-5


def test_more_contacts_than_freedoms_come_to_rest_and_gain_no_energy():
    strengths = {"q3": 0.013, "q2": 0.19, "q4": 0.17}
    m = mbs.load("five_bar")
    configuration = dict(zip(("q1", "q2", "q3", "q4"), m.assemble().position(None), strict=True))
    for name, strength in strengths.items():
        m.add(CoulombFriction(f"dry_{name}", joint=name, sliding=strength))
    for name in ("q1", "q4"):
        limits = {"lower": configuration[name] - 0.1, "upper": configuration[name] + 0.1}
        m.add(RigidStop(f"end_{name}", joint=name, restitution=0.6566, **limits))
    result = run(m.assemble(), 1.0, v0={"q1": 0.3, "q3": -0.2})
    energy = result["kinetic_energy"] + result["potential_energy"]
    assert np.max(np.diff(energy)) < 1e-9
    assert len(result.events) > 10
    for name in ("q1", "q4"):
        assert np.max(np.abs(result[f"{name}.q"] - configuration[name])) < 0.1 + 1e-10
    assert result["kinetic_energy"][-1] < 1e-12
    assert np.max(result["closure_residual"]) < 1e-12


def test_dry_friction_turns_round_at_the_dead_centres_of_its_pivot():
    """Where the rocker turns back, its friction cannot hold it: the crank moves on."""
    strengths = {"a1": 2.0, "b1": 3.0}
    dry = [CoulombFriction(f"dry_{n}", joint=n, sliding=s) for n, s in strengths.items()]
    rigid = run(bars(FOUR, 0.8, -9.81, *dry, guess=FOUR_GUESS), 2.0, v0={"a1": 3.0})
    width = 1e-4
    smooth = [
        JointFriction(f"dry_{n}", joint=n, coulomb=s, width=width) for n, s in strengths.items()
    ]
    near = bars(FOUR, 0.8, -9.81, *smooth, guess=FOUR_GUESS)
    other = mbs.simulate.run(near, 2.0, v0={"a1": 3.0}, method="rodas", quiet=True)
    assert np.max(np.abs(rigid["a1.q"] - other["a1.q"])) < width
    crank = np.array([time for time, name, _ in rigid.events if name == "dry_a1"])
    turns = [(time, what) for time, name, what in rigid.events if name == "dry_b1"]
    dead = [what for time, what in turns if np.min(np.abs(crank - time)) > 1e-3]
    assert len(dead) >= 2
    assert set(dead) == {"slides"}
