import gc
import importlib
import weakref

import casadi as ca
import numpy as np
import pytest
from support.counted import counted

from mbs.errors import CompilerError, ModelError, SolverError
from mbs.native import compiler_found
from mbs.solvers import integrate, integrate_events
from mbs.solvers.problem import equations

INTEGRATE = importlib.import_module("mbs.solvers._integrate")
T, X, P = ca.SX.sym("t"), ca.SX.sym("x", 2), ca.SX.sym("p")
OSCILLATOR = ca.Function("oscillator", [T, X, P], [ca.vertcat(X[1], -(P**2) * X[0])])
PENDULUM = ca.Function("pendulum", [T, X, P], [ca.vertcat(X[1], -P * ca.sin(X[0]))])
BOTH = pytest.mark.parametrize("compiled", [True, False], ids=["compiled", "interpreted"])


def point_on_a_circle():
    """A heavy point on a circle in Cartesian coordinates, and its projection."""
    x = ca.SX.sym("x", 4)
    place, velocity = x[:2], x[2:]
    pull = (ca.dot(velocity, velocity) - 9.81 * place[1]) / ca.dot(place, place)
    rhs = ca.Function("circle", [T, x], [ca.vertcat(velocity, -pull * place - ca.DM([0, 9.81]))])
    rows = ca.vertcat(ca.dot(place, place) - 1, ca.dot(place, velocity))
    J = ca.jacobian(rows, x)
    step = x - J.T @ ca.solve(J @ J.T, rows)
    return rhs, ca.Function("project", [T, x], [step, ca.norm_inf(rows)])


@BOTH
def test_harmonic_oscillator(compiled):
    times = np.linspace(0, 10, 201)
    x = integrate(OSCILLATOR, [1.0, 0.0], times, p=2.0, rtol=1e-10, atol=1e-10, compiled=compiled)
    assert np.max(np.abs(x[:, 0] - np.cos(2 * times))) < 2e-8
    assert np.max(np.abs(x[:, 1] + 2 * np.sin(2 * times))) < 4e-8


@BOTH
def test_time_dependent_right_hand_side(compiled):
    f = ca.Function("f", [T, X], [ca.vertcat(ca.cos(T), 5 * T**4)])
    times = np.array([1.0, 1.5, 4.0])
    x = integrate(f, [np.sin(1.0), 1.0], times, compiled=compiled)
    assert np.allclose(x, np.column_stack([np.sin(times), times**5]), rtol=1e-7)


def test_interpreted_functions_give_the_same_bits():
    times = np.linspace(0, 20, 301)
    a, b = (integrate(PENDULUM, [2.0, 0.5], times, p=9.81, compiled=c) for c in (True, False))
    assert a.tobytes() == b.tobytes()


def test_interpreted_projections_give_the_same_bits():
    rhs, project = point_on_a_circle()
    times = np.linspace(0, 5, 101)
    a, b = (integrate(rhs, [1, 0, 0, 0], times, project=project, compiled=c) for c in (True, False))
    assert a.tobytes() == b.tobytes()


def test_order_five_in_the_number_of_steps():
    calls, turning = counted(ca.Function("turning", [X], [ca.vertcat(X[1], -X[0])]))
    t, x = ca.MX.sym("t"), ca.MX.sym("x", 2)
    rhs = ca.Function("rhs", [t, x], [turning(x)])
    work, steps_error, dense_error = [], [], []
    for tolerance in 10.0 ** -np.arange(5, 11):
        options = {"rtol": tolerance, "atol": tolerance, "compiled": False}
        calls.clear()
        last = integrate(rhs, [1, 0], [0, 20], **options)[-1, 0]
        steps_error.append(abs(last - np.cos(20.0)))
        work.append(len(calls))
        times = np.linspace(0, 20, 2001)
        rows = integrate(rhs, [1, 0], times, **options)
        dense_error.append(np.max(np.abs(rows[:, 0] - np.cos(times))))
    order = -np.polyfit(np.log(work), np.log(steps_error), 1)[0]
    dense_order = -np.polyfit(np.log(work), np.log(dense_error), 1)[0]
    assert 4.5 < order < 6.0
    assert 4.0 < dense_order < 6.0


@BOTH
def test_pendulum_keeps_its_energy(compiled):
    x = integrate(PENDULUM, [3.0, 0.0], np.linspace(0, 10, 101), p=9.81, compiled=compiled)
    energy = x[:, 1] ** 2 / 2 - 9.81 * np.cos(x[:, 0])
    assert np.ptp(energy) < 1e-5


@BOTH
def test_projection_keeps_the_constraints_at_every_row(compiled):
    rhs, project = point_on_a_circle()
    times = np.linspace(0, 10, 333)
    options = {"rtol": 1e-5, "atol": 1e-5, "compiled": compiled}
    free = integrate(rhs, [1, 0, 0, 0], times, **options)
    kept = integrate(rhs, [1, 0, 0, 0], times, project=project, **options)

    def violation(x):
        return np.max(np.abs(np.sum(x[:, :2] ** 2, 1) - 1))

    assert violation(free) > 1e-7
    assert violation(kept) < 1e-12
    assert np.max(np.abs(np.sum(kept[:, :2] * kept[:, 2:], 1))) < 1e-12
    angle = integrate(PENDULUM, [np.pi / 2, 0], times, p=9.81, rtol=1e-10, atol=1e-10)[:, 0]
    assert np.max(np.abs(kept[:, 0] - np.sin(angle))) < 0.02


@BOTH
def test_the_first_state_is_projected(compiled):
    rhs, project = point_on_a_circle()
    x = integrate(rhs, [1.001, 0, 0, 0], [0.0], project=project, compiled=compiled)
    assert abs(x[0, 0] - 1) < 1e-12


@BOTH
def test_rows_do_not_depend_on_where_other_rows_are(compiled):
    options = {"p": 9.81, "compiled": compiled}
    fine = integrate(PENDULUM, [1.0, 0.0], np.linspace(0, 3, 31), **options)
    coarse = integrate(PENDULUM, [1.0, 0.0], [0.0, 1.5, 3.0], **options)
    assert np.array_equal(fine[[0, 15, 30]], coarse)


@BOTH
def test_repeated_and_single_times(compiled):
    x = integrate(PENDULUM, [1, 0], [0, 0, 1, 1], p=1, compiled=compiled)
    assert np.array_equal(x[0], x[1])
    assert np.array_equal(x[2], x[3])
    assert np.array_equal(integrate(PENDULUM, [1, 2], [5.0], p=1, compiled=compiled), [[1, 2]])


@BOTH
def test_blow_up_says_when(compiled):
    f = ca.Function("f", [T, X], [ca.vertcat(X[0] ** 2, 0)])
    with pytest.raises(SolverError, match=r"stopped at t = (1|0\.9999\d+) s with step .* s: "):
        integrate(f, [1.0, 0.0], [0.0, 2.0], compiled=compiled)


@BOTH
def test_not_a_number_is_never_returned(compiled):
    f = ca.Function("f", [T, X], [ca.vertcat(-1, ca.sqrt(X[0]))])
    with pytest.raises(SolverError, match="not finite"):
        integrate(f, [1.0, 0.0], [0.0, 2.0], compiled=compiled)


@BOTH
def test_a_projection_that_fails_is_reported(compiled):
    rhs, _ = point_on_a_circle()
    x = ca.SX.sym("x", 4)
    bad = ca.Function("bad", [T, x], [x, 1.0])
    with pytest.raises(SolverError, match="projection onto the constraints does not converge"):
        integrate(rhs, [1, 0, 0, 0], [0, 1], project=bad, compiled=compiled)


@BOTH
def test_a_wall_is_not_stepped_over(compiled):
    rhs = ca.Function("f", [T, X], [ca.vertcat(1, 0)])
    wall = ca.Function("wall", [T, X], [X, ca.if_else(X[0] > 1, 1.0, 0.0)])
    with pytest.raises(SolverError, match=r"t = (1|0\.9999\d+) s"):
        integrate(rhs, [0, 0], [0, 3], project=wall, compiled=compiled)


@BOTH
def test_progress_ends_at_the_last_time(compiled):
    seen = []
    integrate(PENDULUM, [1, 0], [0, 5], p=1, progress=seen.append, compiled=compiled)
    assert seen == sorted(seen)
    assert seen[-1] == 5.0


@BOTH
def test_an_interrupt_in_progress_stops(compiled):
    def stop(_):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        integrate(PENDULUM, [1, 0], [0, 5], p=1, progress=stop, compiled=compiled)


def test_no_compiler_falls_back(monkeypatch):
    expected = integrate(PENDULUM, [1, 0], [0, 1], p=1, compiled=False)
    monkeypatch.setitem(integrate.__globals__, "compiler_found", lambda: False)
    assert np.array_equal(integrate(PENDULUM, [1, 0], [0, 1], p=1), expected)


@pytest.mark.skipif(not compiler_found(), reason="there is no C compiler")
@pytest.mark.parametrize("method", ["dopri5", "rodas"])
def test_functions_that_are_compiled_during_a_run_give_the_same_bits(method, monkeypatch):
    options = {"p": 9.81, "method": method}
    times = np.linspace(0, 20, 301)
    kept, made = {}, []
    source = INTEGRATE._source
    monkeypatch.setattr(INTEGRATE, "_source", lambda made_of: made.append(1) or source(made_of))
    interpreted = integrate(PENDULUM, [2.0, 0.5], times, compiled=False, **options)
    assert not made
    monkeypatch.setattr(INTEGRATE, "_WRITING", (0.0, 0.0))
    monkeypatch.setattr(INTEGRATE, "_COMPILING", (0.0, 0.0))
    both = integrate_events(PENDULUM, [2.0, 0.5], times, None, prepared=kept, **options).x
    assert len(made) == 1
    assert all(code.library is not None for code in kept.values())
    compiled = integrate_events(PENDULUM, [2.0, 0.5], times, None, prepared=kept, **options).x
    assert len(made) == 1
    assert interpreted.tobytes() == both.tobytes() == compiled.tobytes()


def wrapped(kind):
    """Pendulum with an operation that is not a scalar one."""
    t, x, p = ca.MX.sym("t"), ca.MX.sym("x", 2), ca.MX.sym("p")
    slope = PENDULUM(t, x, p)
    if kind == "assertion":
        slope = slope.attachAssert(x[0] < 10, "x is large")
    elif kind == "switch":
        slope = ca.conditional(x[0] > 0, [slope], 2 * slope, True)
    elif kind == "map":
        slope = PENDULUM.map(3)(t, ca.repmat(x, 1, 3), p)[:, 1]
    elif kind == "solver":
        slope = ca.solve(2 * ca.DM.eye(2) + x @ x.T, slope, "lsqr")
    return ca.Function("pendulum", [t, x, p], [slope])


@pytest.mark.skipif(not compiler_found(), reason="there is no C compiler")
@pytest.mark.parametrize("kind", ["", "assertion", "switch", "map", "solver"])
def test_what_is_not_scalar_is_compiled_with_the_same_bits(kind, monkeypatch):
    monkeypatch.setattr(INTEGRATE, "_WRITING", (0.0, 0.0))
    monkeypatch.setattr(INTEGRATE, "_COMPILING", (0.0, 0.0))
    rhs, kept, times = wrapped(kind), {}, np.linspace(0, 5, 101)
    assert equations(rhs, None, "dopri5", None).rhs.is_a("MXFunction" if kind else "SXFunction")
    interpreted = integrate(rhs, [1.0, 0.5], times, p=9.81, compiled=False)
    motion = integrate_events(rhs, [1.0, 0.5], times, None, p=9.81, prepared=kept)
    assert all(code.library is not None for code in kept.values())
    assert interpreted.tobytes() == motion.x.tobytes()


@pytest.mark.skipif(not compiler_found(), reason="there is no C compiler")
def test_code_is_written_then_looked_up_then_compiled(monkeypatch, tmp_path):
    monkeypatch.setenv("MBS_CACHE_DIR", str(tmp_path))
    made = equations(PENDULUM, None, "dopri5", None)

    def code():
        return INTEGRATE.IntegrationCode(made, may_compile=True)

    first = code()
    assert first.instructions >= PENDULUM.n_instructions()
    times = [a + b * first.instructions for a, b in (INTEGRATE._WRITING, INTEGRATE._COMPILING)]
    assert not first.compile(0.9 * times[0])
    assert first.source is None
    assert not first.compile(1.1 * times[0])
    assert first.source is not None
    assert not first.compile(0.9 * times[1])
    assert first.compile(1.1 * times[1])
    other = code()
    assert other.compile(1.1 * times[0])  # from the cache


def test_short_runs_do_not_need_the_compiler(monkeypatch):
    def write(*_):
        raise AssertionError("no C text is written")

    monkeypatch.setattr(INTEGRATE, "_source", write)
    x = integrate(PENDULUM, [1, 0], [0, 1], p=1)
    assert x[1, 0] == pytest.approx(0.60008536, abs=1e-7)


def test_a_compiler_that_does_not_start_is_an_error(monkeypatch):
    monkeypatch.setenv("CC", "no-such-compiler")
    with pytest.raises(CompilerError, match="CC is 'no-such-compiler' and does not start"):
        integrate(PENDULUM, [1, 0], [0, 1], p=1)
    integrate(PENDULUM, [1, 0], [0, 1], p=1, compiled=False)


def test_functions_are_not_kept_alive():
    def one():
        f = ca.Function("f", [T, X], [-X])
        integrate(f, [1, 0], [0, 1])
        return weakref.ref(f)

    refs = [one() for _ in range(3)]
    gc.collect()
    assert [ref() for ref in refs] == [None] * 3


def test_the_initial_state_is_not_changed():
    x0 = np.array([1.0, 0.0])
    integrate(PENDULUM, x0, [0.0, 1.0], p=9.81)
    assert np.array_equal(x0, [1.0, 0.0])


def test_sparse_outputs_and_interpreted_nodes(capfd):
    f = ca.Function("f", [T, X], [ca.vertcat(ca.SX(1, 1), -X[1])])
    assert np.allclose(integrate(f, [3, 1], [0, 1])[1], [3, np.exp(-1)])
    z, q = ca.SX.sym("z"), ca.SX.sym("q")
    root = ca.rootfinder("root", "newton", {"x": z, "p": q, "g": z**3 + z - q})
    t, x = ca.MX.sym("t"), ca.MX.sym("x")
    g = ca.Function("g", [t, x], [-root(x0=0, p=x)["x"]])
    assert 0 < integrate(g, [1.0], [0, 1])[1, 0] < 1
    capfd.readouterr()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"x0": [1.0]}, "1 initial states and 1 parameters were given"),
        ({"p": None}, "has 2 states and 1 parameters"),
        ({"x0": [np.nan, 0]}, "not finite"),
        ({"times": [1.0, 0.0]}, "increasing order"),
        ({"times": []}, "one or more"),
        ({"rtol": 0.0}, "must be positive"),
        ({"atol": np.inf}, "must be positive"),
        ({"rtol": "small"}, "tolerances 'small' and 1e-08 must be positive numbers"),
        ({"x0": "ab"}, "'ab' are not numbers"),
        ({"rhs": ca.Function("f", [X], [X])}, r"rhs\(t, x, p\) -> xdot"),
        ({"rhs": ca.Function("f", [T, X, P], [X[0]])}, "1 slopes for 2 states"),
        ({"project": ca.Function("g", [X], [X])}, r"project\(t, x, p\) -> \(x, residual\)"),
    ],
)
def test_arguments_that_do_not_fit(arguments, message):
    call = {"rhs": PENDULUM, "x0": [1.0, 0.0], "times": [0.0, 1.0], "p": 1.0, **arguments}
    rhs, x0, times = call.pop("rhs"), call.pop("x0"), call.pop("times")
    with pytest.raises(ModelError, match=message):
        integrate(rhs, x0, times, **call)
