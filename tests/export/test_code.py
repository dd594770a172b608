"""Layout and refusals of readable source text."""

import math
import os
import subprocess
import sys

import casadi
import pytest
from casadi import MX, SX, Function
from export.code_text import PROPER, idm, vector

import mbs
import mbs.models
from mbs.errors import ExportError, ModelError
from mbs.export.languages.plan import LONGEST
from mbs.operations import count


@pytest.mark.parametrize("language", PROPER)
def test_header(language):
    function = idm()
    text = mbs.export.code(function, language)
    numbers = count(function)
    assert "idm(q, v, a) -> tau of puma560" in text
    assert "Armstrong" in text
    assert "QP1 [rad/s]" in text
    assert "GAM6 [N.m]" in text
    assert f"{numbers.mul} multiplications, {numbers.add} additions" in " ".join(text.split())
    assert f"mbs {mbs.__version__}" in text


@pytest.mark.parametrize("language", [name for name in PROPER if name != "latex"])
def test_lines_are_short(language):
    text = mbs.export.code(idm("sr400"), language)
    assert max(map(len, text.splitlines())) <= 110
    assert max(len(s.split("=")[-1]) for s in text.splitlines()) < LONGEST + 40


def test_text_is_the_same_every_time():
    """Also in another process, whose hashes differ."""
    script = (
        "import mbs, mbs.models; f = mbs.models.inverse_dynamics(mbs.load('scara').assemble());"
    )
    script += "print(mbs.export.code(f, 'python'), end='')"
    texts = {
        subprocess.run(
            [sys.executable, "-c", script],
            env={**os.environ, "PYTHONHASHSEED": seed},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for seed in ("1", "2")
    }
    assert texts == {mbs.export.code(idm("scara"), "python")}


def test_loading_the_package_does_not_load_sympy():
    script = "import sys, mbs; mbs.export.code, mbs.export.par; print('sympy' in sys.modules)"
    answer = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    assert answer.stdout.strip() == "False"


def test_single_use_expressions_stand_inside_others():
    x = SX.sym("x", 3)
    text = mbs.export.code(vector([(x[0] + x[1]) * casadi.tanh(x[2]) - x[0] / x[1]], x), "python")
    assert "y = (x1 + x2)*np.tanh(x3) - x1/x2" in text


def test_common_parts_are_written_once():
    """Also where the Function computes them twice."""
    x = SX.sym("x", 2)
    function = vector([casadi.tanh(x[0] * x[1]) + 1, 2 - casadi.tanh(x[1] * x[0])], x)
    assert mbs.export.code(function, "python").count("np.tanh") == 1


def test_chains_become_lines_of_readable_length():
    x = SX.sym("x", 2)
    value = x[0]
    for k in range(300):
        value = casadi.tanh(value) * x[1] + 0.5 * k
    text = mbs.export.code(vector([value], x), "c")
    assert max(map(len, text.splitlines())) <= 100
    assert text.count("tanh(") == 300


def test_path_holds_the_text(tmp_path):
    text = mbs.export.code(idm(), "c", path=tmp_path / "idm.c", name="effort")
    assert (tmp_path / "idm.c").read_text() == text
    assert "void effort(const double *q" in text


def test_octave_is_matlab():
    assert mbs.export.code(idm(), "octave") == mbs.export.code(idm(), "Matlab")


def test_mx_functions_are_expanded():
    x = MX.sym("x", 2)
    function = Function("f", [x], [casadi.mtimes(casadi.DM([[1, 2], [3, 4]]), x)], ["x"], ["y"])
    assert "y2 = 3*x1 + 4*x2" in mbs.export.code(function, "python")


def test_comments_of_c_stay_closed():
    m = mbs.Mechanism("arm", source="sources/*.txt */ int x; /* and 'more'")
    body = m.add(mbs.components.Body("b", mass=1, com=(0.1, 0, 0), inertia=(1, 1, 1)))
    m.connect(m.world, mbs.components.Revolute("q1", axis="y"), body)
    text = mbs.export.code(mbs.models.inverse_dynamics(m.assemble()), "c")
    assert text.count("*/") == text.count("/*")
    assert text.index("*/") > text.index("Units are SI")


def test_classic_text_has_tables_and_ends():
    text = mbs.export.code(idm("scara"), "symoro")
    tables, equations = text.split("\nEquations:\n")
    assert "Geometric parameters" in tables
    rows = tables.partition("ant")[2].splitlines()[1:]
    assert [row.split()[:3] for row in rows if row] == [
        [str(j), str(j - 1), "1" if j == 4 else "0"] for j in (1, 2, 3, 4)
    ]
    assert equations.endswith("*=*\n")


def test_conditions_stand_as_they_are():
    """No condition is simplified, none loses its brackets, and NaN is not below 1 nor above."""
    x = SX.sym("x", 2)
    a, b = x[0], x[1]
    never = casadi.logic_and(a < 1, casadi.logic_not(a < 1))
    mixed = casadi.logic_or(casadi.logic_and(a < 1, b < 1), never)
    function = vector([casadi.if_else(mixed, a, b)], x)
    assert "(((x1 < 1.0) && (x2 < 1.0)) || ((x1 < 1.0) && (!(x1 < 1.0))))" in mbs.export.code(
        function, "c"
    )
    assert "not (x1 < 1)" in mbs.export.code(function, "maple")
    assert "&&" in mbs.export.code(function, "matlab")


def test_the_smaller_of_a_number_and_nan_is_the_number():
    x = SX.sym("x", 2)
    function = vector([casadi.fmin(x[0], x[1])], x)
    assert "ifelse(x1 <= x2 || isnan(x2), x1, x2)" in mbs.export.code(function, "julia")


# ---- refusals ----


def test_unknown_language():
    with pytest.raises(ModelError, match="no language 'fortan'; did you mean 'fortran'"):
        mbs.export.code(idm(), "fortan")
    with pytest.raises(ModelError, match="no language 3; use one of c, fortran"):
        mbs.export.code(idm(), 3)


def test_not_a_function():
    with pytest.raises(ModelError, match="'idm' is not a Function"):
        mbs.export.code("idm", "c")


def test_no_scalar_operations():
    x = SX.sym("x")
    function = casadi.integrator("F", "cvodes", {"x": x, "ode": -x})
    with pytest.raises(ModelError, match="F: it is not made of scalar operations"):
        mbs.export.code(function, "c")


def test_operations_without_text():
    x = SX.sym("x")
    with pytest.raises(ModelError, match="f: it has the operation erfinv"):
        mbs.export.code(vector([casadi.erfinv(x)], x), "c")
    with pytest.raises(ModelError, match="Rust has no function erf"):
        mbs.export.code(vector([casadi.erf(x)], x), "rust")


@pytest.mark.parametrize("value", [math.inf, math.nan])
def test_constants_that_no_text_can_hold(value):
    x = SX.sym("x")
    with pytest.raises(ModelError, match=f"the constant {value}, which source text cannot hold"):
        mbs.export.code(vector([casadi.fmin(x, 2) + x, SX(value)], x), "c")


def test_nothing_to_write():
    with pytest.raises(ModelError, match="f: it has no output"):
        mbs.export.code(Function("f", [SX.sym("x")], []), "c")


def test_names_and_paths_that_cannot_be(tmp_path):
    with pytest.raises(ModelError, match="'a b' is no name of a function"):
        mbs.export.code(idm(), "c", name="a b")
    with pytest.raises(ExportError, match="is a folder"):
        mbs.export.code(idm(), "c", tmp_path)
