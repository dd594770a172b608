import casadi
import numpy as np
import pytest
from casadi import SX, Function
from operations.expressions import function, require_equal

from mbs.errors import ModelError
from mbs.operations import count, split


def test_work_on_parameters_is_done_in_setup():
    f = function("x p3", lambda x, p: (x * (p[0] * p[1]) + casadi.sin(p[2]), p[0] + 1.0, x + p[0]))
    parts = split(f)
    assert parts.setup.name_in() == ["p"]
    assert parts.main.name_in() == ["x", "c"]
    assert parts.main.name_out() == f.name_out()
    assert str(count(parts.main, ())) == "1/2"
    assert count(parts.main, ()).trig == 0
    c = parts.setup([2.0, 3.0, 0.5])
    np.testing.assert_allclose(sorted(c.nonzeros()), [np.sin(0.5), 2.0, 3.0, 6.0])
    assert [float(o) for o in parts.main(10.0, c)] == pytest.approx([60.0 + np.sin(0.5), 3.0, 12.0])
    require_equal(f, parts.joined())


def test_inputs_keep_their_order_and_sparsity():
    p, x = SX.sym("p", casadi.Sparsity.lower(2)), SX.sym("x", 2)
    f = Function("f", [p, x], [p @ x, p], ["p", "x"], ["y", "copy"])
    joined = split(f).joined()
    assert joined.name_in() == ["p", "x"]
    assert joined.sparsity_in(0) == f.sparsity_in(0)
    require_equal(f, joined)


def test_any_inputs_can_be_the_parameters():
    f = function("a b d", lambda a, b, d: a * b + d)
    parts = split(f, ("a", "b"))
    assert parts.setup.name_in() == ["a", "b"]
    assert parts.main.size_in("c") == (1, 1)
    require_equal(f, parts.joined())
    require_equal(f, split(f, ("a", "b", "d")).joined())


def test_without_parameters_setup_gives_nothing():
    f = function("x", lambda x: x + 1)
    parts = split(f)
    assert parts.setup.n_in() == 0
    assert parts.setup.size_out("c") == (0, 1)
    require_equal(f, parts.joined())


def test_an_input_called_c_is_refused():
    with pytest.raises(ModelError, match="f: its input c has the name"):
        split(function("c p", lambda c, p: c * p))
