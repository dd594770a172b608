"""Names of generated text."""

import re

import casadi
import pytest
from casadi import SX, Function
from export.code_text import idm, lines, vector
from support.catalogue_systems import catalogue_system

import mbs
import mbs.models


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
    assert names[:5] == ["S1_12", "S1_m2", "S1_m2_m3", "S2_3", "S2off"]
    assert names[5].startswith("y")


@pytest.mark.parametrize(
    ("joints", "expected"),
    [
        (9, {"S12": "sin(q1 + q2)", "S9": "sin(q9)", "S1m2m3": "sin(q1 - q2 - q3)"}),
        (12, {"S1_2": "sin(q1 + q2)", "S12": "sin(q12)", "S1_m2_m3": "sin(q1 - q2 - q3)"}),
    ],
)
def test_sum_of_two_joints_is_not_mistaken_for_the_twelfth(joints, expected):
    q = SX.sym("q", joints)
    sines = casadi.sin(casadi.vertcat(q[0] + q[1], q[joints - 1], q[0] - q[1] - q[2]))
    function = Function("f", [q], [sines], ["q"], ["y"])
    named = {k: v for k, v in lines(mbs.export.code(function, "c")).items() if k[0] == "S"}
    assert named == expected


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
    text = mbs.export.code(mbs.models.inertia_matrix(catalogue_system("puma560")), "c")
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


def test_underscores_become_capitals_in_mathematica():
    """An underscore marks a pattern there; between digits it becomes x, as in A1_12."""
    names = ["mass_of_tool", "A1_12", "a_", "k_2x", "plain"]
    symbols = [SX.sym(name) for name in names]
    function = Function("sum_of_all", symbols, [casadi.sin(casadi.vertcat(*symbols))], names, ["y"])
    text = mbs.export.code(function, "mathematica")
    head = re.search(r"\w+\[.*\] := ", text)[0]
    assert head == "sumOfAll[massOfTool_, A1x12_, a_, k2x_, plain_] := "
    for name in ("massOfTool", "A1x12", "a", "k2x", "plain"):
        assert f"Sin[{name}]" in text


def test_fortran_knows_no_case():
    s, S = SX.sym("s"), SX.sym("S")
    text = mbs.export.code(Function("f", [s, S], [s - 2 * S], ["s", "S"], ["y"]), "fortran")
    assert "y = s - 2.0d0*S_" in text


def test_long_names_of_fortran_are_cut_and_stay_apart():
    x = SX.sym("x", 2)
    text = mbs.export.code(Function("f" * 80, [x], [x**2], ["a" * 70], ["a" * 70 + "b"]), "fortran")
    assert max(map(len, re.findall(r"[a-z]\w+", text.partition("subroutine")[2]))) == 31
    assert max(map(len, text.splitlines())) <= 132
