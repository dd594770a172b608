import os
import subprocess
import sys

import casadi as ca
import numpy as np
import pytest

import mbs
import mbs.models
from mbs.errors import CompilerError, ModelError
from mbs.native import cached_library, compiled
from mbs.native._compiled import exact_source


def example():
    x, p = ca.SX.sym("x", 3), ca.SX.sym("p")
    root = ca.sqrt(x[2] ** 2 + 2) / (1 + x[0] ** 2)
    y = ca.vertcat(ca.sin(x[0]) * x[1] + x[2], p * x[1] ** 2, root)
    options = {"default_in": [0.5, 3.0]}
    return ca.Function("example", [x, p], [y, x[0] * p], ["x", "p"], ["y", "e"], options)


def test_the_bits_are_those_of_the_interpreter():
    f = example()
    g = compiled(f)
    assert g.is_a("External")
    rng = np.random.default_rng(0)
    for _ in range(100):
        x, p = rng.standard_normal(3), rng.standard_normal()
        for a, b in zip(f(x, p), g(x, p), strict=True):
            assert np.array_equal(a.full().ravel(), b)


def test_names_and_defaults_are_kept():
    f, g = example(), compiled(example())
    assert (g.name(), g.name_in(), g.name_out()) == (f.name(), f.name_in(), f.name_out())
    assert [g.default_in(k) for k in range(2)] == [0.5, 3.0]
    assert g(x=[1, 2, 3])["e"] == 3.0


def test_first_derivatives_are_exact_and_sparse():
    f, g = example(), compiled(example())
    x = ca.MX.sym("x", 3)
    jacobians = [ca.jacobian(h(x, 2.0)[0], x) for h in (f, g)]
    assert jacobians[0].nnz() == jacobians[1].nnz() < 9
    a, b = (ca.Function("J", [x], [j])([0.3, 1.0, 2.0]).full() for j in jacobians)
    assert np.array_equal(a, b)
    seed = ca.MX.sym("s", 3)
    products = [ca.jtimes(h(x, 2.0)[0], x, seed, True) for h in (f, g)]
    a, b = (ca.Function("a", [x, seed], [v])([1, 2, 3], [1, 0, 2]).full() for v in products)
    assert a == pytest.approx(b, rel=1e-15)


def test_it_maps():
    x = np.random.default_rng(0).standard_normal((3, 5))
    a, b = (f.map(5)(x, 1.0)[0].full() for f in (compiled(example()), example()))
    assert np.array_equal(a, b)


def test_without_a_compiler_the_function_stays_interpreted(monkeypatch):
    monkeypatch.setitem(compiled.__globals__, "compiler_found", lambda: False)
    f, g = example(), compiled(example())
    assert g.is_a("SXFunction")
    assert np.array_equal(f([1, 2, 3], 2)[0].full().ravel(), g([1, 2, 3], 2)[0])


def test_a_compiler_that_does_not_start_is_an_error(monkeypatch):
    monkeypatch.setenv("CC", "no-such-compiler")
    with pytest.raises(CompilerError, match="CC is 'no-such-compiler' and does not start"):
        compiled(example())


def test_a_model_keeps_its_checks_and_defaults():
    system = mbs.load("puma560").assemble()
    model = mbs.models.inverse_dynamics(system)
    fast = compiled(model)
    q = np.linspace(0.1, 0.6, 6)
    assert np.array_equal(fast(q, q, q), np.array(model(q, q, q)).ravel())
    with pytest.raises(ModelError, match="q has 2 values, it needs 6"):
        fast([1, 2], q, q)
    m = mbs.Mechanism("m", gravity=(0, 0, -9.81))
    body = m.add(mbs.components.Body("b", mass=mbs.Parameter("mass", 2.0)))
    m.connect(m.world, mbs.components.Prismatic("j", axis="z"), body)
    lift = compiled(mbs.models.inverse_dynamics(m.assemble()))
    assert lift(0, 0, 0)[0] == pytest.approx(19.62)
    assert lift(0, 0, 0, 1)[0] == pytest.approx(9.81)


@pytest.mark.parametrize("order", [0, 1, 2])
def test_derivatives_of_an_order(order):
    f, g = example(), compiled(example(), derivatives=order)
    x = ca.MX.sym("x", 3)

    def derivative(h, k):
        y = ca.sumsqr(h(x, 2.0)[0])
        return [lambda: y, lambda: ca.jacobian(y, x), lambda: ca.hessian(y, x)[0]][k]()

    for k in range(order + 1):
        a, b = (ca.Function("d", [x], [derivative(h, k)])([0.3, 1.0, 2.0]).full() for h in (f, g))
        assert a == pytest.approx(b, rel=1e-14)


def test_second_derivatives_are_as_sparse_as_those_of_the_interpreter():
    x, y = ca.MX.sym("x", 3), ca.MX.sym("y", 3)
    exact, found = (
        ca.hessian(ca.dot(y, h(x, 2.0)[0]), x)[0]
        for h in (example(), compiled(example(), derivatives=2))
    )
    assert found.sparsity() == exact.sparsity()
    assert found.nnz() < 9
    a, b = (ca.Function("H", [x, y], [H])([0.3, 1, 2], [1, 2, 3]).full() for H in (exact, found))
    assert a == pytest.approx(b, rel=1e-15)


def test_second_derivatives_must_be_asked_for(capfd):
    x = ca.MX.sym("x", 3)
    y = ca.sumsqr(compiled(example())(x, 2.0)[0])
    with pytest.raises(RuntimeError):
        ca.Function("h", [x], [ca.hessian(y, x)[0]])
    capfd.readouterr()


@pytest.mark.parametrize(
    ("function", "options", "message"),
    [
        (None, {}, "None is not a Function; give a casadi.Function"),
        ("idm", {}, "'idm' is not a Function"),
        (ca.Function(), {}, "an empty Function is not a Function"),
        (example(), {"derivatives": 3}, "derivatives is 3; use 0, 1 or 2"),
        (
            ca.Function("f", [], [ca.SX.sym("loose")], {"allow_free": True}),
            {},
            "f: symbols loose are free; make them inputs",
        ),
    ],
)
def test_what_is_refused(function, options, message):
    with pytest.raises(ModelError, match=message):
        compiled(function, **options)


def test_what_casadi_cannot_write_stays_interpreted(capfd):
    z, p = ca.SX.sym("z"), ca.SX.sym("p")
    root = ca.rootfinder("root", "newton", {"x": z, "p": p, "g": z * z - p})
    q = ca.MX.sym("q")
    f = ca.Function("f", [q], [root(x0=1, p=q)["x"]])
    g = compiled(f)
    assert g.is_a("MXFunction")
    assert g(9)[0] == float(f(9)) == pytest.approx(3)
    capfd.readouterr()


@pytest.mark.parametrize("level", ["-O0", "-O1"])
def test_every_level_of_optimization_gives_the_same_bits(level, monkeypatch):
    flags = ("-ffp-contract=off", "-fPIC", "-shared")
    monkeypatch.setitem(compiled.__globals__, "flags_for", lambda _: (level, *flags))
    x = [0.1, 2.0, -3.0]
    assert all(
        np.array_equal(a.full().ravel(), b)
        for a, b in zip(example()(x, 1.7), compiled(example())(x, 1.7), strict=True)
    )


def test_machine_code_is_not_compiled_again():
    g = compiled(example(), derivatives=0)
    with pytest.raises(ModelError, match="example is machine code already"):
        compiled(g)
    with pytest.raises(ModelError, match="example is machine code already"):
        mbs.export.code(g, "c")


@pytest.mark.parametrize("write", [mbs.native.c_source, mbs.export.c_library])
def test_machine_code_is_not_written_as_c(tmp_path, monkeypatch, write):
    """Its C text lacks symbols; a library of it ends the process that loads it."""
    monkeypatch.chdir(tmp_path)
    g = compiled(example(), derivatives=0)
    x, p = ca.MX.sym("x", 3), ca.MX.sym("p")
    problem = ca.Function("problem", [x, p], [ca.sumsqr(g(x, p)[0])])
    arguments = () if write is mbs.native.c_source else (tmp_path / "library",)
    with pytest.raises(
        ModelError, match=r"problem: it calls example, .* make it from the Function that was given"
    ):
        write(problem, *arguments)
    plain = ca.Function("problem", [x, p], [ca.sumsqr(example()(x, p)[0])])
    assert "int example(" not in mbs.native.c_source(plain)
    # C of an external function that the user made may be linked by the user
    monkeypatch.setitem(compiled.__globals__, "_libraries", {})
    assert "int example(" in mbs.native.c_source(problem)


def test_scalar_functions_are_written_without_casadi():
    text = mbs.native.c_source(example(), derivatives=1)
    assert "casadi_real" not in text
    assert all(f"EXPORT int {name}(" in text for name in ("example", "jac_example", "fwd1_example"))


def test_functions_of_both_writers_share_a_file():
    f = example()
    x, A = ca.MX.sym("x", 3), ca.MX.sym("A", 3, 3)
    solved = ca.Function("solved", [x, A], [ca.solve(A, f(x, 1.3)[0], "lsqr")])
    text = exact_source([f, solved])
    assert text.count("casadi_real casadi_sq") == 1
    library = cached_library({"both.c": text})
    at, matrix = [0.1, 2.0, -3.0], np.eye(3) + 0.1
    for made, given in ((f, (at, 1.3)), (solved, (at, matrix))):
        code = ca.external(made.name(), str(library))
        for found, wanted in zip(code.call(given), made.call(given), strict=True):
            assert np.array_equal(found.full(), wanted.full())


def test_two_processes_may_build_at_once(tmp_path):
    program = (
        "import casadi as ca\n"
        "from mbs.native import compiled\n"
        "x = ca.SX.sym('x')\n"
        "f = ca.Function('f', [x], [ca.sin(x) * x])\n"
        "print(compiled(f, derivatives=2)(0.5)[0] == float(f(0.5)))\n"
    )
    environment = {**os.environ, "MBS_CACHE_DIR": str(tmp_path)}
    command = [sys.executable, "-c", program]
    running = [
        subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True)
        for _ in range(2)
    ]
    assert [process.communicate()[0].strip() for process in running] == ["True", "True"]
    libraries = set(tmp_path.iterdir())
    assert not list(tmp_path.glob("build-*"))
    assert subprocess.run(command, env=environment, capture_output=True).returncode == 0
    assert set(tmp_path.iterdir()) == libraries
