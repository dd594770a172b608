"""States of results, from which motions, models and FMUs go on."""

import pickle

import casadi
import numpy as np
import pytest
from support.catalogue_systems import catalogue_system

import mbs
from mbs.components import Pulse, RigidStop, ShaftInertia, TorqueSource
from mbs.errors import ModelError, Unclosable
from mbs.robots import catalogue

CLOSED = [name for name in catalogue() if catalogue_system(name).is_closed]
TOLERANCE = 1e-8


def first_speed(system):
    return (
        {system.velocity_coordinates[system.independent[0]].name: 0.7}
        if system.independent
        else None
    )


def pieces(system, count, duration, v0, **more):
    """The motion in pieces, each from the last state of the one before."""
    part = duration / count
    result = mbs.simulate.run(system, part, v0=v0, step=part / 4, quiet=True, **more)
    for _ in range(count - 1):
        result = mbs.simulate.run(
            system, part, q0=result.state(), step=part / 4, quiet=True, **more
        )
    return result


def at_once(system, duration, v0, **more):
    return mbs.simulate.run(system, duration, v0=v0, step=duration / 40, quiet=True, **more)


def require_same_end(parts, whole, system, atol):
    assert parts.time[-1] == pytest.approx(whole.time[-1], rel=1e-12)
    for end, rows in (("q", system.coordinates), ("v", system.velocity_coordinates)):
        for row in rows:
            name = f"{row.name}.{end}"
            expected = whole[name][-1]
            assert abs(parts[name][-1] - expected) < atol * max(1.0, abs(expected)), name


@pytest.mark.parametrize("name", CLOSED)
def test_ten_pieces_are_the_whole_motion(name):
    system = catalogue_system(name)
    v0 = first_speed(system)
    parts = pieces(system, 10, 0.2, v0, tolerance=TOLERANCE)
    whole = at_once(system, 0.2, v0, tolerance=TOLERANCE)
    require_same_end(parts, whole, system, 10 * TOLERANCE)


def test_pieces_have_the_time_of_laws_the_modes_of_stops_and_pending_events():
    four_bar = mbs.load("four_bar")
    four_bar.add(RigidStop("stop", joint="j1", lower=-0.4, upper=0.5, restitution=0.5))
    four_bar.add(Pulse("pulse", 1.0, 0.31, 0.1))
    system = four_bar.assemble()
    law = {
        "tau": lambda t, q, v: {
            "j1": 3 * casadi.sin(9 * t) + casadi.if_else(casadi.fmod(t, 0.37) < 0.05, 9, 0)
        }
    }
    parts = pieces(system, 10, 2.0, None, tolerance=1e-9, **law)
    whole = at_once(system, 2.0, None, tolerance=1e-9, **law)
    assert len([one for one in whole.events if one[1] == "stop"]) > 3
    assert parts["pulse.y"][-1] == whole["pulse.y"][-1]
    assert parts["pulse.left"][-1] == pytest.approx(whole["pulse.left"][-1], abs=1e-12)
    require_same_end(parts, whole, system, 1e-6)


def rows_of(result, count):
    return np.linspace(0, len(result.time) - 1, count).astype(int)


@pytest.mark.parametrize("name", ["four_bar", "five_bar", "slider_crank", "sr400", "delta"])
def test_every_state_of_a_motion_is_a_start_by_name_as_list_and_as_state(name):
    system = catalogue_system(name)
    result = at_once(system, 2.0, first_speed(system))
    for row in rows_of(result, 11):
        state = result.state(result.time[row])
        q = [state.q[c.name] for c in system.coordinates]
        v = [state.v[s.name] for s in system.velocity_coordinates]
        for q0, v0 in ((dict(state.q), dict(state.v)), (q, v), (state, None)):
            again = mbs.simulate.run(system, 0.01, q0=q0, v0=v0, quiet=True)
            found = [again[f"{c.name}.q"][0] for c in system.coordinates]
            np.testing.assert_allclose(found, q, atol=1e-9)
        np.testing.assert_allclose(mbs.loops.solve(system, state), q, atol=1e-9)
        np.testing.assert_allclose(mbs.loops.solve(system, dict(state.q)), q, atol=1e-9)


def test_a_guess_chooses_the_branch_of_a_start():
    system = catalogue_system("five_bar")
    result = at_once(system, 2.0, first_speed(system))
    independent = [system.velocity_coordinates[k].name for k in system.independent]
    for row in rows_of(result, 11):
        state = result.state(result.time[row])
        q0 = {name: state.q[name] for name in independent}
        near = {name: x + 0.02 for name, x in state.q.items() if name not in independent}
        again = mbs.simulate.run(system, 0.01, q0=q0, guess=near, quiet=True)
        for name, x in state.q.items():
            assert again[f"{name}.q"][0] == pytest.approx(x, abs=1e-8)
        model = mbs.models.dae(system, "index1", q0=q0, guess=near)
        np.testing.assert_allclose(model.x0[: system.nq], list(state.q.values()), atol=1e-8)


def test_positions_beside_the_independent_ones_are_checked():
    system = catalogue_system("four_bar")
    state = at_once(system, 1.0, first_speed(system)).state()
    names = list(state.q)
    independent = [system.velocity_coordinates[k].name for k in system.independent]
    other = next(name for name in names if name not in independent)
    known = {name: state.q[name] for name in (*independent, other)}
    again = mbs.simulate.run(system, 0.01, q0=known, quiet=True)
    found = [again[f"{n}.q"][0] for n in names]
    np.testing.assert_allclose(found, list(state.q.values()), atol=1e-8)
    with pytest.raises(Unclosable, match=f"do not close with {other} = .*, the nearest is"):
        mbs.simulate.run(system, 0.01, q0={**known, other: known[other] + 0.3}, quiet=True)


def test_models_start_from_a_state():
    system = catalogue_system("slider_crank")
    result = at_once(system, 1.0, first_speed(system))
    state = result.state(result.time[17])
    model = mbs.models.dae(system, "index1", q0=state)
    given = [*state.q.values(), *state.v.values()]
    np.testing.assert_allclose(model.x0, given, atol=1e-9)
    linear = mbs.models.linearise(system)
    by_state, by_name = linear.at(q0=state), linear.at(q0=dict(state.q), v0=dict(state.v))
    np.testing.assert_allclose(by_state.A, by_name.A, atol=1e-12)


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
@pytest.mark.parametrize("kind", ["CoSimulation", "ModelExchange"])
def test_an_fmu_starts_from_a_state(tmp_path_factory, fmi, kind):
    system = catalogue_system("slider_crank")
    path = tmp_path_factory.mktemp("fmu") / "crank.fmu"
    mbs.export.fmu(system, path, fmi=fmi)
    whole = at_once(system, 1.0, first_speed(system), tolerance=1e-9)
    state = whole.state(whole.time[20])
    options = {"step": 0.025, "kind": kind, "tolerance": 1e-9, "quiet": True}
    moved = mbs.simulate.fmu(path, 0.5, start=state, **options)
    name = system.velocity_coordinates[system.independent[0]].name
    np.testing.assert_allclose(moved[f"{name}.q"], whole[f"{name}.q"][20:], atol=1e-6)


def test_a_study_starts_from_a_state():
    m = mbs.Mechanism("shaft")
    inertia, torque = ShaftInertia("i", 1.0), TorqueSource("t")
    m.connect(torque.flange, inertia.flange_a)
    system = m.assemble()
    state = mbs.simulate.run(system, 1.0, u={"t": 2.0}, quiet=True).state()
    study = mbs.simulate.sweep(system, {"t.tau": [0.0, 1.0]}, 1.0, q0=state, quiet=True)
    assert [result["i.v"][-1] for _, result in study] == pytest.approx([2.0, 3.0], abs=1e-8)
    assert [result.time[-1] for _, result in study] == [2.0, 2.0]


def test_states_are_kept_in_pickles_and_not_in_files(tmp_path):
    result = at_once(catalogue_system("four_bar"), 0.1, None)
    state = result.state()
    assert pickle.loads(pickle.dumps(state)) == state
    assert pickle.loads(pickle.dumps(result)).state() == state
    assert repr(state).startswith("<State four_bar at 0.1 s: j1 = ")
    result.save(tmp_path / "motion.npz")
    with pytest.raises(ModelError, match="it keeps no states; take the state from the result"):
        mbs.Result.load(tmp_path / "motion.npz").state()


def test_a_state_is_of_a_row_and_of_the_same_mechanism():
    result = at_once(catalogue_system("four_bar"), 0.1, None)
    assert result.state(0.1 * 17 / 40).time == pytest.approx(0.0425)
    with pytest.raises(ModelError, match=r"no row at 0\.0431 s, the nearest is at 0\.0425"):
        result.state(0.0431)
    with pytest.raises(ModelError, match="the state is of four_bar and has the positions"):
        mbs.simulate.run(catalogue_system("five_bar"), 0.1, q0=result.state(), quiet=True)
