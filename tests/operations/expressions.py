"""Functions made by hand, and whether two are equal."""

from string import ascii_letters

import casadi
import numpy as np
from casadi import SX, Function

from mbs.operations import count
from mbs.operations.graph import function_of, graph_of


def function(names, outputs):
    """A Function of scalars, or of columns for names such as p3, as outputs(*inputs) gives it."""
    sizes = {
        name.rstrip("0123456789"): int(name.lstrip(ascii_letters) or 1) for name in names.split()
    }
    symbols = [SX.sym(name, size) for name, size in sizes.items()]
    results = outputs(*symbols)
    results = results if isinstance(results, tuple) else (results,)
    labels = [f"o{k}" for k in range(len(results))]
    return Function("f", symbols, list(results), list(sizes), labels, {"cse": True})


def passed(one, f, parameters=("p",)):
    """A Function after one pass, checked to be the same."""
    made = function_of(one(graph_of(f), parameters))
    require_equal(f, made)
    return made


def counted(f, parameters=("p",)):
    """Multiplications/additions, and sines and cosines."""
    numbers = count(f, parameters)
    return str(numbers), numbers.trig


def require_equal(f, g, low=-2.0, high=2.0):
    random = np.random.default_rng(3)
    assert f.name_in() == g.name_in()
    assert f.name_out() == g.name_out()
    for _ in range(4):
        point = [random.uniform(low, high, f.size_in(k)) for k in range(f.n_in())]
        for k, (one, other) in enumerate(
            zip(Function.call(f, point), Function.call(g, point), strict=True)
        ):
            assert f.sparsity_out(k) == g.sparsity_out(k)
            np.testing.assert_allclose(other, one, rtol=1e-9, atol=1e-11)


def sincos(x):
    return casadi.sin(x), casadi.cos(x)
