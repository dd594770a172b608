"""The sheet of a closed form: its equations hold, its expressions are what the steps compute."""

import math
import re

import casadi
import numpy as np
import pytest
from casadi import SX, Function
from support.catalogue_systems import catalogue_system

import mbs
from mbs.errors import ModelError
from mbs.models.inverse_geometry import function, text
from mbs.models.inverse_geometry.listing import expression_lines
from mbs.operations.graph import graph_of


def sheet(name, method="auto"):
    return text(catalogue_system(name), method)


def values(lines, known):
    """What lines `name = expression` give, in Python's numbers."""
    space = dict(known)
    for line in lines:
        name, expression = line.split(" = ", 1)
        space[name] = eval(expression.replace("^", "**"), {"__builtins__": {}}, space)
    return space


def test_puma_line_by_line():
    assert "\n".join(sheet("puma560", "pieper").splitlines()[:22]) == (
        """\
Inverse geometric model of puma560: q1, q2, q3, q4, q5, q6 from the pose T of
frame 6 in the base; units are SI and radians
steps: 6, branches: 8

1. q3: type 2
   X3 cos(q3) + Y3 sin(q3) = Z3
   sign q3: + the root at a positive angle from the direction (X, Y), - the other
   X3 = 0.00876554
   Y3 = -0.18701258
   Z3 = -(T14^2 + T24^2 + T34^2 - 0.44245475)/2 - 0.0227429

2. q2: type 2
   X2 cos(q2) + Y2 sin(q2) = Z2
   sign q2: + the root at a positive angle from the direction (X, Y), - the other
   X2 = 0.4331*C3 + 0.0203*S3
   Y2 = -0.4331*S3 + 0.0203*C3 - 0.4318
   Z2 = T34

3. q1: type 3
   X1 cos(q1) - Y1 sin(q1) = U1, Y1 cos(q1) + X1 sin(q1) = V1
   X1 = 0.4318*C2 - 0.0203*C23 + 0.4331*S23
   Y1 = 0.1501"""
    )


@pytest.mark.parametrize("name", ["puma560", "stanford", "scara"])
def test_equations_hold_at_every_branch(name):
    """Read back, the coefficients fulfil the equations as they are written."""
    system = catalogue_system(name)
    igm, rng = function(system), np.random.default_rng(2)
    slides = np.array([row.unit == "m" for row in system.coordinates])
    q = np.where(slides, rng.uniform(0.2, 0.5, system.nq), rng.uniform(-3, 3, system.nq))
    T = np.array(mbs.models.direct_geometry(system)(q))
    blocks = [block.splitlines() for block in joined(text(system)).split("\n\n")[1:-1]]
    assert len(blocks) == len(igm.steps)
    checked = 0
    for b in range(igm.branches):
        found, valid = igm(T, b)
        if float(valid) == 1:
            known = surroundings(system, np.array(found).ravel(), T)
            for block in blocks:
                checked += hold(block, known)
    assert checked >= igm.branches * len(igm.steps) // 2


def joined(sheet_text):
    """A line a quantity."""
    return sheet_text.replace("\n       ", " ")


def surroundings(system, q, T):
    """Numbers by the names of the sheet."""
    known = {"sin": math.sin, "cos": math.cos, "sqrt": math.sqrt, "atan2": math.atan2}
    known |= {f"T{r + 1}{c + 1}": T[r, c] for r in range(3) for c in range(4)}
    n = len(q)
    for k in range(n):
        total = 0.0
        known[f"q{k + 1}"] = q[k]
        for m in range(k, n):
            total += q[m]
            digits = "".join(str(j + 1) for j in range(k, m + 1))
            known[f"S{digits}"], known[f"C{digits}"] = math.sin(total), math.cos(total)
    return known


def hold(block, known):
    """Check the equations of a step; 1 where they could be read."""
    lines = [line.strip() for line in block]
    space = values([line for line in lines[2:] if not line.startswith("sign ")], known)
    if lines[0].endswith(": sum"):
        return 0
    for equation in lines[1].split(", "):
        left, right = (
            eval(re.sub(r"(?<=\w|\)) (?=[\w(])", "*", side).replace("^", "**"), {}, dict(space))
            for side in equation.split(" = ")
        )
        assert left == pytest.approx(right, abs=1e-9)
    return 1


def test_printed_expressions_are_the_graph():
    x = SX.sym("x", 4)
    a, b, c, d = casadi.vertsplit(x)
    shared = casadi.sin(a + b) * (c - d) ** 2 - 3 * a
    results = [
        -(a - b) * c - (-d),
        2 * (shared + 1) / (c * d),
        a - (b - (c - d)) - (b + c),
        -shared * -2.5 + casadi.sqrt(c * c + 4) / -d,
        casadi.atan2(shared, -c) - casadi.cos(-a) * (-b),
        1 / (a * a + 2) - (a / b) / (c / d) + (-(a + b)) ** 2,
        SX(0.1) * (a + a) * 3 + 2 - 5,
    ]
    function_ = Function("f", [x], [casadi.vertcat(*results)], ["x"], ["y"])
    names = [f"y{k}" for k in range(len(results))]
    lines = expression_lines(graph_of(function_), {"x": ["a", "b", "c", "d"]}, names, "W")
    point = dict(a=0.7, b=-1.3, c=2.1, d=0.9)
    tools = {"sin": math.sin, "cos": math.cos, "sqrt": math.sqrt, "atan2": math.atan2}
    space = values(lines, point | tools)
    want = np.array(function_(list(point.values()))).ravel()
    assert np.allclose([space[name] for name in names], want, rtol=1e-11)
    assert any(line.startswith("W1 = ") for line in lines)


def test_parameters_locked_joints_and_branches_are_told():
    rows = [{"antecedent": 0, "joint": "revolute"}, {"antecedent": 1, "joint": "revolute"}]
    rows[1] |= {"d": "L"}
    rows.append({"antecedent": 2, "joint": "revolute", "d": "2*L"})
    system = mbs.load({"name": "three", "parameters": {"L": 0.4}, "frame": rows}).assemble()
    written = text(system, locked={"q2": 0.5})
    assert "locked: q2 = 0.5" in written
    assert "parameters: L" in written
    assert re.search(r"= .*\bL\b", written)
    assert "branch 7: " in sheet("puma560")
    assert "There is one branch." in sheet("planar_2r")
    assert max(map(len, sheet("ur5").splitlines())) <= 100


def test_wrong_method():
    with pytest.raises(ModelError, match="method is 'general', which is not known here"):
        sheet("puma560", "general")
