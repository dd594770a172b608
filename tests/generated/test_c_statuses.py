"""Calls of generated C that have no meaning return a status and NaN, where Python raises."""

import casadi
import numpy as np
import pytest
from support.bare_library import called, loaded
from support.catalogue_systems import catalogue_system

import mbs
from mbs import MbsError
from mbs.components import Body, Spherical
from mbs.errors import SingularPosture, Unclosable

OK, NOT_FINITE, QUATERNION, PARAMETER, OPEN, UNDETERMINED, NO_RESULT = range(7)
TARGETS = pytest.mark.parametrize("target", ["hosted", "bare"])


def ball():
    m = mbs.Mechanism("ball", gravity=(0, 0, -9.81))
    body = m.add(Body("b", mass=mbs.Parameter("M", 2.0), com=(0.1, 0.2, 0.3), inertia=(1, 2, 3)))
    m.connect(m.world, Spherical("s"), body)
    return m.assemble()


class Written:
    """A model, its library, and calls of both."""

    def __init__(self, folder, model, **options):
        self.model, self.folder = model, mbs.export.c_library(model, folder, **options)
        self.library = loaded(self.folder)

    def status(self, *values):
        """The status; outputs are those of Python, or NaN."""
        status, outputs = called(self.folder, self.library, self.model, values)
        if status == OK:
            every = casadi.Function.call(self.model, [casadi.DM(np.array(v)) for v in values])
            for ours, python in zip(outputs, every, strict=True):
                np.testing.assert_array_equal(ours, np.array(python).ravel(order="F"))
        else:
            assert all(np.isnan(output).all() for output in outputs)
        return status


@TARGETS
def test_loops(target, tmp_path):
    system = catalogue_system("four_bar")
    ddm = Written(tmp_path / "lib", mbs.models.direct_dynamics(system), target=target)
    q = np.array(system.configuration)
    assert ddm.status(q, [0.1], [0.2]) == OK
    assert ddm.status(q + 0.1, [0.1], [0.2]) == OPEN
    assert ddm.status([np.nan, 0, 0], [0.1], [0.2]) == NOT_FINITE
    assert ddm.status(q + 0.1, [np.inf], [0.2]) == NOT_FINITE
    assert ddm.status(q, [0.1], [-np.inf]) == NOT_FINITE
    assert ddm.status(q, [1e200], [0.2]) == NO_RESULT  # its square is infinite


@TARGETS
def test_the_bound_of_open_loops_is_that_of_python(target, tmp_path):
    """A crank turned by ever more, the others left: one step opens the loop too far for both."""
    system = catalogue_system("five_bar")
    ddm = Written(tmp_path / "lib", mbs.models.direct_dynamics(system), target=target)
    q, seen = np.array(system.configuration), set()
    for angle in np.geomspace(1e-7, 1e-5, 41):
        turned = q + angle * np.eye(len(q))[0]
        try:
            ddm.model(turned, [0.1, 0.2], [0.3, 0.4])
            wanted = OK
        except Unclosable:
            wanted = OPEN
        assert ddm.status(turned, [0.1, 0.2], [0.3, 0.4]) == wanted
        seen.add(wanted)
    assert seen == {OK, OPEN}


@TARGETS
def test_joints_that_do_not_determine_the_others(target, tmp_path):
    """The four-bar that its rocker drives, in the configuration where crank and rod align."""
    system = mbs.load("four_bar").assemble(active=["j4"])
    dead = mbs.loops.solve(system, {"j2": 0.0}, guess={"j1": 0.5, "j4": 1.5})
    ddm = Written(tmp_path / "lib", mbs.models.direct_dynamics(system), target=target)
    with pytest.raises(SingularPosture):
        ddm.model(dead, [0.1], [0.2])
    assert ddm.status(dead, [0.1], [0.2]) == UNDETERMINED
    assert ddm.status(system.configuration, [0.1], [0.2]) == OK


@TARGETS
def test_quaternions_and_parameters(target, tmp_path):
    ddm = Written(tmp_path / "lib", mbs.models.direct_dynamics(ball()), target=target)
    v, tau = [0.1, 0.2, 0.3], [1.0, 2.0, 3.0]
    turned = np.array([0.5, 0.5, -0.5, 0.5])
    assert ddm.status(turned, v, tau, [2.0]) == OK
    assert ddm.status((1 + 9e-6) * turned, v, tau, [2.0]) == OK
    assert ddm.status((1 + 2e-5) * turned, v, tau, [2.0]) == QUATERNION
    assert ddm.status(0 * turned, v, tau, [2.0]) == QUATERNION
    assert ddm.status(turned, v, tau, [-2.0]) == PARAMETER
    assert ddm.status(2 * turned, v, tau, [-2.0]) == QUATERNION  # the first that is wrong
    assert ddm.status(turned, v, tau, [np.nan]) == NOT_FINITE


def test_models_ask_for_what_they_use(tmp_path):
    """On the tree loops may be open; every column of a map is asked."""
    system = catalogue_system("four_bar")
    tree = mbs.models.inverse_dynamics(system, coordinates="tree")
    q = np.array(system.configuration)
    assert Written(tmp_path / "tree", tree).status(q + 0.1, q, q) == OK
    many = mbs.models.inverse_dynamics(system).map(3)
    three = Written(tmp_path / "many", many)
    qs = np.column_stack([q, q, q])
    rows = [[0.1, 0.2, 0.3]], [[1.0, 2.0, 3.0]]
    assert three.status(qs, *rows) == OK
    qs[0, 2] += 0.1
    assert three.status(qs, *rows) == OPEN
    qs[0, 2] = np.inf
    assert three.status(qs, *rows) == NOT_FINITE


@TARGETS
def test_many_states_agree_with_python(target, tmp_path):
    """Whatever Python takes is OK, whatever it refuses has a status."""
    rng, system = np.random.default_rng(5), ball()
    ddm = Written(tmp_path / "lib", mbs.models.direct_dynamics(system), target=target)
    found = set()
    for _ in range(300):
        q = rng.normal(size=4)
        q *= (1 + rng.choice([0.0, 5e-6, 1e-3])) / np.linalg.norm(q)
        p = rng.choice([1.0, 0.0, -1e-300])
        values = [q, rng.normal(size=3), rng.normal(size=3), [p]]
        if rng.random() < 0.2:
            values[rng.integers(3)][rng.integers(3)] = rng.choice([np.nan, np.inf, -np.inf])
        try:
            ddm.model(*values)
            taken = True
        except MbsError:
            taken = False
        status = ddm.status(*values)
        assert (status == OK) == taken
        found.add(status)
    assert found == {OK, NOT_FINITE, QUATERNION, PARAMETER}


def test_plain_functions_are_asked_for_numbers_alone(tmp_path):
    x = casadi.SX.sym("x", 2)
    f = Written(tmp_path / "lib", casadi.Function("f", [x], [casadi.log(x)]))
    assert f.status([1.0, 2.0]) == OK
    assert f.status([1.0, np.nan]) == NOT_FINITE
    assert f.status([1.0, -1.0]) == NO_RESULT
    assert f.status([0.0, 1.0]) == NO_RESULT  # minus infinity


def test_numbers_whose_sum_overflows_are_numbers(tmp_path):
    x, y = casadi.SX.sym("x", 2), casadi.SX.sym("y", 100)
    f = casadi.Function("f", [x, y], [x / 4, y[::2]])
    f = Written(tmp_path / "lib", f)
    many = np.full(100, -1.7e308)
    assert f.status([1.7e308, 1.7e308], np.zeros(100)) == OK
    assert f.status([1.0, 1.0], many) == OK
    many[1] = np.inf  # opposite infinities, and one that no output needs
    assert f.status([1.0, -np.inf], many) == NOT_FINITE
    assert f.status([1.0, 1.0], many) == NOT_FINITE


@TARGETS
def test_unchecked(target, tmp_path):
    system = catalogue_system("four_bar")
    model = mbs.models.inverse_dynamics(system)
    folder = mbs.export.c_library(model, tmp_path / "lib", checked=False, target=target)
    q = np.array(system.configuration) + 0.1
    status, (tau,) = called(folder, loaded(folder), model, [q, [0.1], [0.2]])
    assert status == OK
    assert np.isfinite(tau).all()
    assert "Returns MBS_OK: nothing is checked." in (folder / "lib.h").read_text()
    status, (tau,) = called(folder, loaded(folder), model, [q, [np.nan], [0.2]])
    assert (status, np.isnan(tau).all()) == (OK, True)


def test_the_header_names_what_a_call_returns(tmp_path):
    system = catalogue_system("four_bar")
    models = [mbs.models.inverse_dynamics(system)]
    text = (mbs.export.c_library(models, tmp_path / "lib") / "lib.h").read_text()
    assert "Returns MBS_OK, MBS_NOT_FINITE, MBS_OPEN, MBS_UNDETERMINED or MBS_NO_RESULT." in text
    for k, name in enumerate(
        ("OK", "NOT_FINITE", "QUATERNION", "PARAMETER", "OPEN", "UNDETERMINED", "NO_RESULT")
    ):
        assert f"MBS_{name} = {k}" in text


def test_two_libraries_meet_in_one_program(tmp_path):
    """The statuses are defined once; no name of one library stands in the other."""
    system = catalogue_system("four_bar")
    left = mbs.export.c_library({"one": mbs.models.inverse_dynamics(system)}, tmp_path / "left")
    mbs.export.c_library({"two": mbs.models.direct_dynamics(system)}, left.parent / "right")
    both = tmp_path / "both"
    both.mkdir()
    for name in ("left", "right"):
        for end in ("c", "h"):
            (both / f"{name}.{end}").write_text((tmp_path / name / f"{name}.{end}").read_text())
    (both / "main.c").write_text('#include "left.h"\n#include "right.h"\nint x = MBS_OPEN;\n')
    assert loaded(both).two_eval
