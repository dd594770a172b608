"""Functions that are written in every language, and states to compare them at."""

import functools

import casadi
import numpy as np
from casadi import SX, Function
from support.catalogue_systems import catalogue_system

import mbs
import mbs.models
from mbs import Mechanism
from mbs.components import (
    Body,
    Free,
    Prismatic,
    Revolute,
)


@functools.cache
def system(name):
    """A robot of the catalogue."""
    return catalogue_system(name)


BUILDERS = {
    "puma_idm": lambda: mbs.models.inverse_dynamics(system("puma560")),
    "puma_T": lambda: mbs.models.direct_geometry(system("puma560")),
    "stanford_A": lambda: mbs.models.inertia_matrix(system("stanford")),
    "stanford_energy": lambda: mbs.models.energy(system("stanford")),
    "four_bar_ddm": lambda: mbs.models.direct_dynamics(system("four_bar")),
    "sr400_idm": lambda: mbs.models.inverse_dynamics(system("sr400")),
    "slider_idm": lambda: mbs.models.inverse_dynamics(parametric_slider()),
    "slider_lagrange": lambda: mbs.models.lagrange(parametric_slider()),
    "floating_idm": lambda: mbs.models.inverse_dynamics(floating_body()),
    "operations": lambda: every_operation(),
    "choices": lambda: choices(),
    "awkward": lambda: awkward_names(),
    "sparse": lambda: sparse(),
    "long_names": lambda: long_names(),
}
NAMES = tuple(BUILDERS)


@functools.cache
def example(name):
    """The Function that has this name in the texts."""
    return BUILDERS[name]()


@functools.cache
def parametric_slider():
    """A revolute and a prismatic joint with symbols, Coulomb friction smooth and as a step."""
    m = Mechanism("slider", gravity=(0, -9.81, 0), parameters={"L2": 0.7, "M1": 2.0, "FS1": 0.3})
    arm = m.add(Body("arm", mass="M1", com=("L2/2", 0, 0), inertia=(0.05, 0.06, "M1*L2^2/12")))
    block = m.add(Body("block", mass=1.5, com=(0.1, 0, 0), inertia=(0.01, 0.02, 0.03)))
    m.connect(m.world, Revolute("q1", axis="z", Fs="FS1", Fs_width=0.1, Fv=0.2), arm)
    m.connect(arm.at("L2", 0, 0), Prismatic("q2", axis="x", Fs=0.5, Fs_width=0.0), block)
    return m.assemble()


def floating_body():
    """A body that flies, with a quaternion, and an arm on it."""
    m = Mechanism("floating")
    base = m.add(Body("hull", mass=3.0, com=(0.1, 0, 0.2), inertia=(0.3, 0.4, 0.5)))
    arm = m.add(Body("arm", mass=1.0, com=(0, 0.2, 0), inertia=(0.02, 0.03, 0.04)))
    m.connect(m.world, Free("float"), base)
    m.connect(base.at(0.2, 0, 0), Revolute("elbow", axis="y"), arm)
    return m.assemble()


def every_operation():
    """Elementary functions that every language has."""
    x, y = SX.sym("x", 3), SX.sym("y")
    a, b, c = x[0], x[1], x[2]
    inside = casadi.tanh(a) * 0.9
    results = [
        casadi.tan(a) + casadi.atan(b) + casadi.atan2(a, -b - 2),
        casadi.asin(inside) * casadi.acos(inside * 0.5),
        casadi.sinh(a) - casadi.cosh(b) / casadi.tanh(c + 3),
        casadi.asinh(a) + casadi.acosh(2 + b * b) - casadi.atanh(inside),
        casadi.exp(-a) * casadi.log(3 + a * a) + casadi.log1p(b * b) + casadi.expm1(c),
        casadi.sqrt(2 + c) / (1 / (a + 5)) - 1 / (2 * y),
        casadi.fabs(a - b) + casadi.sign(b - a) + casadi.sign(0 * a + (y - y)),
        casadi.fmin(a, b) - casadi.fmax(b, -c),
        casadi.floor(7.3 * a) - casadi.ceil(-4.1 * b) * 2,
        (a + 4) ** 3 - (b + 5) ** 1.5 + (c + 3) ** -2 + (a + 3) ** (b + 1),
        -(a - (b - c)) * -(a / (b / (c + 4))) - (-a) ** 2 / ((a + b) ** 2 * -3.25),
        2**a + casadi.if_else(a > 0, 1 / 3.0, 1e-7 * a) + 1e20 * b / 3e21,
        casadi.hypot(a, b) + casadi.atan(casadi.sign(a + b)),
        casadi.fmin(2, a) * casadi.fmax(-0.1, b) + casadi.atan2(-3, c) * casadi.fmod(7, a + 2),
    ]
    return Function("operations", [x, y], [casadi.vertcat(*results)], ["x", "y"], ["r"])


def choices():
    """Conditions in choices, in sums, of numbers, joined and denied."""
    x = SX.sym("x", 2)
    a, b = x[0], x[1]
    both = casadi.logic_and(a > 0, b <= 0.5)
    either = casadi.logic_or(a < b, casadi.logic_not(both))
    three = casadi.logic_and(casadi.logic_and(a < 0.5, b < 0.5), a + b > 0)
    results = [
        casadi.if_else(both, casadi.sin(a), casadi.cos(b) * a),
        casadi.if_else(either, a + 1, 0),
        casadi.if_else(three, b, casadi.if_else(casadi.logic_not(either), a, 7)),
        (a >= b) + 2 * (b != 0),
        casadi.if_else(a - b, casadi.if_else(a == 0, 3, a), b) * (both + 0.25),
    ]
    return Function("choices", [x], [casadi.vertcat(*results)], ["x"], ["r"])


def awkward_names():
    """Names that are words of languages, or differ in case only."""
    q, Q, D, end, fn = SX.sym("q", 2), SX.sym("Q", 2), SX.sym("D"), SX.sym("end"), SX.sym("fn")
    return Function(
        "lambda",
        [q, Q, D, end, fn],
        [q[0] * Q[1] + D * casadi.sin(end), casadi.sin(q[1]) * fn, q + Q * D, end],
        ["q", "Q", "D", "end", "fn"],
        ["in", "E", "Pi", "I"],
    )


def long_names():
    """Arguments whose names are longer than Fortran and Matlab take."""
    x = SX.sym("x", 2)
    return Function("f", [x], [casadi.sin(x[0]) * x], ["a" * 70], ["a" * 69 + "b"])


def sparse():
    """Matrices with zeros, constants and copies of inputs, in and out."""
    M = SX.sym("M", casadi.Sparsity.lower(3))
    v = SX.sym("v", 12)
    out = SX(4, 12)
    out[0, 0], out[3, 11], out[1, 2], out[2, 1] = v[0] * M[1, 0], 2.5, v[11], -v[3]
    outputs = [out, casadi.mtimes(M, M.T), SX(2, 0), SX.zeros(1, 1)]
    return Function("sparse", [M, v], outputs, ["M", "v"], ["out", "P", "none", "zero"])


def states(function, count=3):
    """Random inputs of a Function, dense: for each state a list of arrays."""
    rng = np.random.default_rng(5)
    return [
        [rng.uniform(-0.9, 0.9, function.size_in(k)) for k in range(function.n_in())]
        for _ in range(count)
    ]


def expected(function, values):
    """Its outputs there, dense."""
    given = [casadi.DM(value) for value in values]
    return [np.array(out.full()) for out in Function.call(function, given)]


def assert_close(ours, theirs):
    """Equal to 1e-12 of the largest element."""
    size = max(1.0, float(np.max(np.abs(theirs), initial=0.0)))
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-12 * size)
