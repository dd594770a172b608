"""CasADi's own C code of problems with compiled Functions is linked with their libraries.

Each case runs in a process of its own: a missing symbol ends the process.
"""

import shutil
import subprocess
import sys

import casadi as ca
import pytest

import mbs
from mbs.errors import ModelError
from mbs.native import compiled, link_flags

pytestmark = pytest.mark.skipif(
    not shutil.which("gcc"), reason="jit and the compilation of problems call gcc"
)

HEAD = """
import subprocess
import sys
import casadi as ca
import numpy as np
import mbs

dynamics = mbs.models.inverse_dynamics(mbs.load("planar_2r").assemble())
idm = mbs.native.compiled(dynamics, derivatives=2, fast={fast}) if {machine} else dynamics
q, v, a = (ca.MX.sym(name, 2, 3) for name in "qva")
cost = ca.sumsqr(idm.map(3)(q, v, a))
point = [np.linspace(0.1, 0.9, 6).reshape(2, 3) * k for k in (1, 2, 3)]


def built(function):
    function.generate(function.name() + ".c")
    command = ["gcc", "-w", "-O0", "-fPIC", "-shared", function.name() + ".c", "-o", "built.so"]
    subprocess.run([*command, *mbs.native.link_flags(function)], check=True)
    return ca.external(function.name(), "./built.so")


def same(found, expected):
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_allclose(one.full(), other.full(), rtol=1e-12, atol=1e-12)
"""

PROBLEM = """
problem = ca.Function("problem", [q, v, a], [cost, ca.gradient(cost, q), ca.hessian(cost, a)[0]])
same(built(problem)(*point), problem(*point))
"""

JIT = """
options = {"jit": True, "compiler": "shell"}
flags = mbs.native.link_flags(idm)
options["jit_options"] = {"flags": ["-O0"], **({"linker_flags": flags} if flags else {})}
outputs = [cost, ca.gradient(cost, q)]
problem = ca.Function("problem", [q, v, a], outputs, options)
same(problem(*point), ca.Function("plain", [q, v, a], outputs)(*point))
"""

SOLVER = """
x = ca.veccat(q, v, a)
quiet = {"print_iter": False, "print_header": False, "error_on_fail": False}
options = {"qpsol": "qrqp", "qpsol_options": quiet, "max_iter": 3, "error_on_fail": False}
options |= dict.fromkeys(("print_time", "print_header", "print_iteration", "print_status"), False)
nlp = {"x": x, "f": cost + ca.sumsqr(x - 1)}
solver = ca.nlpsol("solver", "sqpmethod", nlp, {**options, "no_nlp_grad": True})
start = np.full(18, 0.1)
same([built(solver)(x0=start)["x"]], [solver(x0=start)["x"]])
"""


@pytest.mark.parametrize("body", [PROBLEM, JIT, SOLVER], ids=["generate", "jit", "solver"])
@pytest.mark.parametrize("kind", ["exact", "fast", "interpreted"])
def test_generated_code_of_a_problem_runs(tmp_path, body, kind):
    machine, fast = kind != "interpreted", kind == "fast"
    text = HEAD.replace("{fast}", str(fast)).replace("{machine}", str(machine)) + body
    command = [sys.executable, "-c", text]
    ran = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stderr


def example(name="f", factor=2.0):
    x = ca.SX.sym("x")
    return ca.Function(name, [x], [factor * ca.sin(x)])


def test_link_flags_of_functions_that_call_compiled_ones():
    f = compiled(example("linked_once", 3.0))
    x = ca.MX.sym("x")
    outer = ca.Function("outer", [x], [ca.gradient(f(x), x)])
    assert link_flags(f) == link_flags(outer) == link_flags(outer, f) == [str(f._library)]
    assert link_flags() == link_flags(example()) == []


def test_two_compiled_functions_of_one_name_raise():
    one, other = compiled(example("twice", 2.0)), compiled(example("twice", 3.0))
    x = ca.MX.sym("x")
    outer = ca.Function("outer", [x], [one(x)])
    with pytest.raises(ModelError, match="2 compiled Functions with the name twice; give the one"):
        link_flags(outer)
    assert link_flags(outer, one) == [str(one._library)]
    with pytest.raises(ModelError, match="or compile Functions with different names"):
        link_flags(one, other)


def test_anything_else_raises():
    with pytest.raises(ModelError, match="link_flags: 3 is no Function; give Functions"):
        mbs.native.link_flags(3)
