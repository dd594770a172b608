"""Names, layout and refusals of readable source text."""

import functools
import math
import os
import re
import subprocess
import sys

import casadi
import pytest
from casadi import MX, SX, Function

import mbs
import mbs.models
from mbs.errors import ExportError, ModelError
from mbs.export.languages import LANGUAGES
from mbs.export.languages.plan import LONGEST
from mbs.operations import count

PROPER = [name for name in LANGUAGES if name != "octave"]


@functools.cache
def idm(name="puma560"):
    return mbs.models.inverse_dynamics(mbs.load(name).assemble())


def lines(text):
    """Left and right side of every assignment of a C text."""
    return dict(re.findall(r"const double (\w+) = (.*?);", " ".join(text.split())))


def vector(results, x, name="f"):
    return Function(name, [x], [casadi.vertcat(*results)], ["x"], ["y"])


# ---- names ----


def test_names_of_the_classic_notation():
    assigned = lines(mbs.export.code(idm(), "c"))
    assert assigned["S2"] == "sin(q2)"
    assert assigned["C5"] == "cos(q5)"
    assert assigned["QP3"] == "v[2]"
    assert assigned["QDP6"] == "a[5]"
    angle = next(name for name, value in assigned.items() if value == "q2 + q3")
    assert assigned["S23"] == f"sin({angle})"
    assert {"W24", "WP16"} <= set(assigned)


def test_names_of_nodes_are_those_of_the_annotated_function():
    """W32 of the text is the number that the model calls so."""
    function = idm()
    annotated = function.annotated()
    names = annotated.name_out()[function.n_out() :]
    text = mbs.export.code(function, "python").replace("return tau", "return locals()")
    space = {}
    exec(text, space)
    rng = casadi.np.random.default_rng(2)
    q, v, a = rng.uniform(-1, 1, (3, 6))
    ours = space["idm"](q, v, a)
    theirs = Function.call(annotated, [q, v, a])[function.n_out() :]
    shared = [(name, float(x)) for name, x in zip(names, theirs, strict=True) if name in ours]
    assert len(shared) > 40
    for name, value in shared:
        assert ours[name] == pytest.approx(value, rel=1e-11, abs=1e-12)


class Annotated(Function):
    """x -> y = (x1 x2 + x2)^2 with the sum named W1."""

    def __init__(self):
        self.x = SX.sym("x", 3)
        self.inner = self.x[0] * self.x[1] + self.x[1]
        Function.__init__(self, "f", [self.x], [self.inner**2], ["x"], ["y"])

    def annotated(self):
        unused = casadi.sin(self.x[2])
        outputs = [self.inner**2, self.inner, unused, self.x[0], -self.x[1] * 0]
        return Function("f", [self.x], outputs, ["x"], ["y", "W1", "W2", "W3", "W4"])


def test_only_named_scalars_that_the_outputs_need_are_written():
    assigned = lines(mbs.export.code(Annotated(), "c"))
    assert assigned["W1"] == "x2 + x1*x2"
    assert assigned["y1_"] == "W1*W1"
    assert set(assigned) == {"x1", "x2", "W1", "y1_"}


def test_sums_of_angles():
    q = SX.sym("q", 12)
    sines = [q[1] + q[2], q[0] - q[1], q[1] + 0.3, q[0] + q[11], -(q[2] + q[1]) + q[0], q[0] * 2]
    function = Function("f", [q], [casadi.vertcat(*map(casadi.sin, sines))], ["q"], ["y"])
    names = [
        name for name, value in lines(mbs.export.code(function, "c")).items() if "sin" in value
    ]
    assert names[:5] == ["S23", "S1_12", "S1m2", "S1m2m3", "S2off"]
    assert names[5].startswith("y")


def test_sines_and_cosines_stand_joint_by_joint():
    text = mbs.export.code(idm("rx90"), "c")
    names = re.findall(r"const double (\w+) = (?:sin|cos)\(", text)
    assert names[:4] == ["S2", "C2", "S3", "C3"]
    assert names[-1] == "C23"


def test_two_angles_of_one_name_stay_apart():
    q = SX.sym("q", 2)
    function = vector([casadi.sin(q[0] + 0.1), casadi.sin(q[0] + 0.2)], q)
    assigned = lines(mbs.export.code(function, "c"))
    assert {"Sx1off", "Sx1off_"} <= set(assigned)


def test_symmetric_matrix_has_one_name_for_two_elements():
    text = mbs.export.code(mbs.models.inertia_matrix(mbs.load("puma560").assemble()), "c")
    assert "A[1] = A12;" in text
    assert "A[6] = A12;" in text
    assert "A21" not in text


def test_parameters_come_first_and_keep_their_names():
    m = mbs.Mechanism("arm", parameters={"L": 0.4, "end": 2.0})
    body = m.add(mbs.components.Body("b", mass="end", com=("L", 0, 0), inertia=(1, 1, 1)))
    m.connect(m.world, mbs.components.Revolute("q1", axis="y"), body)
    text = mbs.export.code(mbs.models.inverse_dynamics(m.assemble()), "matlab")
    once, model = text.split("% The model.")
    assert re.search(r"L = p\(\d\);", once)
    assert re.search(r"end_ = p\(\d\);", once)
    assert re.search(r"Z1 = .*end_", once)
    assert "QDP1" not in once.partition("Parameters only")[2]
    assert "end_" not in model


@pytest.mark.parametrize(
    ("language", "word"),
    [
        ("c", "int"),
        ("fortran", "Do"),
        ("matlab", "end"),
        ("maple", "D"),
        ("mathematica", "E"),
        ("python", "lambda"),
        ("julia", "end"),
        ("rust", "fn"),
    ],
)
def test_words_of_the_language_are_renamed(language, word):
    x = SX.sym(word)
    text = mbs.export.code(Function("f", [x], [casadi.sin(x) * x], [word], ["y"]), language)
    body = "\n".join(
        s for s in text.splitlines() if "y = " in s or "y1 = " in s or "sin" in s.lower()
    )
    assert not re.search(rf"\b{word}\b", body)
    assert re.search(rf"\b{word}(_|x|1)", body)


def test_fortran_knows_no_case():
    s, S = SX.sym("s"), SX.sym("S")
    text = mbs.export.code(Function("f", [s, S], [s - 2 * S], ["s", "S"], ["y"]), "fortran")
    assert "y = s - 2.0d0*S_" in text


def test_long_names_of_fortran_are_cut_and_stay_apart():
    x = SX.sym("x", 2)
    text = mbs.export.code(Function("f" * 80, [x], [x**2], ["a" * 70], ["a" * 70 + "b"]), "fortran")
    assert max(map(len, re.findall(r"[a-z]\w+", text.partition("subroutine")[2]))) == 31
    assert max(map(len, text.splitlines())) <= 132


# ---- layout ----


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
