"""Derivatives of compiled Functions are made when they are asked for, by whoever asks."""

import os
import pickle
import subprocess
import sys

import casadi as ca
import numpy as np
import pytest

import mbs
from mbs.native import compiled, compiler_found, find_compiler

pytestmark = pytest.mark.skipif(not compiler_found(), reason="there is no compiler")

POINT = np.array([0.3, -0.7])


@pytest.fixture
def cache(monkeypatch, tmp_path):
    monkeypatch.setenv("MBS_CACHE_DIR", str(tmp_path / "cache"))
    return tmp_path / "cache"


def example(factor=2.0, name="f"):
    x, p = ca.SX.sym("x", 2), ca.SX.sym("p")
    y = ca.vertcat(factor * ca.sin(x[0]) * x[1], p * x[1] ** 3)
    return ca.Function(name, [x, p], [y, x[0] * p], ["x", "p"], ["y", "e"])


def made(cache):
    """How many Functions have been written as C."""
    return len(list(cache.glob("*.library")))


def graph(f):
    x = ca.MX.sym("x", 2)
    y, e = f(x, 1.5)
    return ca.Function("g", [x], [ca.sumsqr(y) + e], ["x"], ["r"])


@pytest.mark.parametrize("fast", [False, True])
@pytest.mark.parametrize("order", [1, 2])
def test_nothing_is_made_before_it_is_asked_for(cache, fast, order):
    f = compiled(example(), derivatives=order, fast=fast)
    f(POINT, 1.0)
    g = graph(f)
    g(POINT)
    f.map(4)(np.ones((2, 4)), 1.0)
    compiled(example(), derivatives=order, fast=fast)
    assert made(cache) == 1
    exact = example().jacobian()(POINT, 1.0, 0, 0)
    for found, expected in zip(f.jacobian()(POINT, 1.0, 0, 0), exact, strict=True):
        assert found.sparsity() == expected.sparsity()
        assert np.allclose(found.full(), expected.full(), rtol=1e-14, atol=0)
    assert made(cache) == 3  # the sparsity, and the code


def test_each_derivative_is_made_alone(cache):
    f = compiled(example(), derivatives=2)
    x, s = ca.MX.sym("x", 2), ca.MX.sym("s", 2)
    forward = ca.Function("d", [x, s], [ca.jtimes(f(x, 1.5)[0], x, s)])
    assert made(cache) == 2
    exact = ca.Function("d", [x, s], [ca.jtimes(example()(x, 1.5)[0], x, s)])
    assert np.array_equal(forward(POINT, [1, 2]).full(), exact(POINT, [1, 2]).full())
    again = compiled(example(), derivatives=2)
    again.forward(1)
    assert made(cache) == 2
    again.reverse(1)
    assert made(cache) == 3


def test_a_solver_finds_second_derivatives(cache):
    x = ca.MX.sym("x", 2)
    options = {"print_time": False, "ipopt.print_level": 0, "ipopt.sb": "yes"}
    found = []
    for f in (example(), compiled(example(), derivatives=2)):
        y, e = f(x, 1.5)
        problem = {"x": x, "f": ca.sumsqr(y - 1) + e**2, "g": x[0] + x[1]}
        solver = ca.nlpsol("solver", "ipopt", problem, options)
        found.append(solver(x0=POINT, lbg=0.1, ubg=3))
        steps = solver.stats()["iter_count"]
        assert steps < 30
    assert np.allclose(found[0]["x"].full(), found[1]["x"].full(), rtol=1e-9)


def test_an_integrator_finds_its_jacobian(cache):
    x = ca.MX.sym("x", 2)
    ends = []
    for f in (example(), compiled(example())):
        dae = {"x": x, "ode": -f(x, 1.5)[0]}
        step = ca.integrator("step", "cvodes", dae, 0, [1.0])
        ends.append(step(x0=[0.4, 0.5])["xf"].full())
    assert np.allclose(*ends, rtol=1e-9)


def test_a_root_finder_takes_it_as_it_is(cache):
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    rows = ca.Function("rows", [x, y], [x**3 + x - y], ["x", "p"], ["g"])
    for f in (rows, compiled(rows)):
        solve = ca.rootfinder("solve", "newton", f)
        assert float(solve(1.0, 2.0)) == pytest.approx(1.0, rel=1e-12)


PROGRAM = """
import sys, casadi as ca
g = ca.Function.load(sys.argv[1])
print(float(g([0.3, -0.7])), *g.jacobian()([0.3, -0.7], 0).full().ravel().tolist())
"""


@pytest.mark.parametrize("asked", [False, True])
def test_a_graph_finds_them_in_another_process(cache, tmp_path, asked):
    g = graph(compiled(example()))
    if asked:
        g.jacobian()
    file = tmp_path / "g.casadi"
    g.save(str(file))
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    answer = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(file)], env=environment, capture_output=True, text=True
    )
    assert answer.returncode == 0, answer.stderr
    exact = graph(example())
    expected = [float(exact(POINT)), *exact.jacobian()(POINT, 0).full().ravel().tolist()]
    assert [float(x) for x in answer.stdout.split()] == pytest.approx(expected, rel=1e-14)


def test_a_pickle_is_differentiated_too(cache):
    f = pickle.loads(pickle.dumps(compiled(example())))
    assert made(cache) == 1
    exact = example().jacobian()(POINT, 1.0, 0, 0)
    assert np.array_equal(f.jacobian()(POINT, 1.0, 0, 0)[0].full(), exact[0].full())


def test_a_record_that_has_gone_is_an_error(cache, capfd):
    f = compiled(example())
    (record,) = cache.glob("*.function")
    record.unlink()
    with pytest.raises(RuntimeError):
        f.jacobian()
    assert "has gone or is damaged; compile the Function again" in capfd.readouterr().err
    again = compiled(example())  # which writes it again
    assert again.jacobian()(POINT, 1.0, 0, 0)[0].full() == pytest.approx(
        example().jacobian()(POINT, 1.0, 0, 0)[0].full()
    )


@pytest.mark.parametrize("flipped", [False, True])
def test_a_record_that_is_damaged_is_an_error(flipped, cache, capfd):
    f = compiled(example())
    (record,) = cache.glob("*.function")
    content = record.read_bytes()
    at = len(content) - 60  # a digit within the graph
    damaged = content[:at] + bytes([content[at] ^ 1]) + content[at + 1 :]
    record.write_bytes(damaged if flipped else content[:40])
    with pytest.raises(RuntimeError):
        f.jacobian()
    assert "has gone or is damaged" in capfd.readouterr().err
    compiled(example())
    assert record.read_bytes() == content


def test_without_a_disk_everything_is_made_at_once(cache, monkeypatch):
    module = sys.modules["mbs.native._compiled"]
    monkeypatch.setattr(module, "write_record", lambda *_: None)
    f = compiled(example(), derivatives=2)
    assert not list(cache.glob("*.function"))
    assert np.array_equal(
        f.jacobian()(POINT, 1.0, 0, 0)[0].full(), example().jacobian()(POINT, 1.0, 0, 0)[0].full()
    )


def test_a_folder_with_marks_in_its_name(monkeypatch, tmp_path):
    if "ziglang" in find_compiler().command:
        pytest.skip("ziglang finds no files in folders with such names")
    monkeypatch.setenv("MBS_CACHE_DIR", str(tmp_path / 'Zoë "??/" 100%s'))
    f = compiled(example())
    assert f.jacobian()(POINT, 1.0, 0, 0)[0].shape == (2, 2)


def test_derivatives_of_a_model_are_its_own(cache):
    system = mbs.load("puma560").assemble()
    model = mbs.models.direct_dynamics(system)
    f = compiled(model)
    assert made(cache) == 1
    q = np.linspace(0.1, 0.6, 6)
    x = ca.MX.sym("x", 6)
    first, second = (
        ca.Function("J", [x], [ca.jacobian(h(x, x, x), x)])(q).full() for h in (model, f)
    )
    assert first == pytest.approx(second, rel=1e-12)
    assert made(cache) == 3  # where the Jacobian has elements, and what it is computed by
