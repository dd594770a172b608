"""What calculated values of an FMU depend on, and by what kind of factor."""

import casadi as ca
import numpy as np
import pytest
from fmu_models import pendulum, slider_crank
from fmu_structures import ball, two_cranks
from support.catalogue_systems import catalogue_system

from mbs.export.fmu.dependencies import dependencies, linearity, structure
from mbs.export.fmu.options import FmuOptions
from mbs.export.fmu.system_fmu import fmu_model

SEED = 20261122


def names_of(model, known):
    return {
        (model.entries[k].variable.name if k < len(model.entries) else "time"): kind
        for k, kind in known.items()
    }


def known_of(model, name):
    reference = [entry.variable.name for entry in model.entries].index(name)
    return names_of(model, dependencies(model).running[reference])


def test_factors_are_as_constant_as_what_they_are_made_of():
    x, u, p, f, d = (ca.SX.sym(n) for n in "xupfd")
    rows = ca.vertcat(
        3 * x - u / 2,
        p * x + f * u + d * p,
        ca.sin(p) * u + x / (1 + f),
        x * u,
        p * p + ca.sin(x) - f,
        ca.if_else(d > 0, x, 2 * x),
        u / d,
        (x + u) ** 2 - x,
    )
    levels = ["dependent", "dependent", "tunable", "fixed", "discrete"]
    (found,) = linearity(ca.Function("f", [x, u, p, f, d], [rows]), levels)
    named = [{"xupfd"[k]: kind for k, kind in row.items()} for row in found]
    assert named == [
        {"x": "constant", "u": "constant"},
        {"x": "tunable", "u": "fixed", "p": "dependent", "f": "dependent", "d": "tunable"},
        {"x": "fixed", "u": "tunable", "p": "dependent", "f": "dependent"},
        {"x": "dependent", "u": "dependent"},
        {"x": "dependent", "p": "dependent", "f": "constant"},
        {"x": "discrete", "d": "dependent"},
        {"u": "discrete", "d": "dependent"},
        {"x": "dependent", "u": "dependent"},
    ]


def test_a_function_of_matrices_tells_what_its_sparsity_shows():
    x = ca.MX.sym("x", 3)
    f = ca.Function("f", [x], [ca.vertcat(2 * x[1], x[0] * x[2])])
    assert linearity(f, ["dependent"] * 3) == [
        [{1: "dependent"}, {0: "dependent", 2: "dependent"}],
    ]


@pytest.mark.parametrize("make", [pendulum, slider_crank])
def test_what_is_not_listed_has_no_effect_and_constant_factors_are_constant(make):
    model, rng = make(), np.random.default_rng(SEED)
    x, u = ca.MX.sym("x", len(model.states)), ca.MX.sym("u", len(model.inputs))
    t, p = ca.MX.sym("t"), ca.MX.sym("p", len(model.parameters))
    z0 = ca.MX(ca.DM([v.start for v in model.dependents]))
    z = z0
    for _ in range(8 if model.dependents else 0):
        z = model.closure(x, z, p)[0]
    every = ca.vertcat(x, u, p, t)
    J = ca.Function("J", [t, x, u, p], [ca.jacobian(ca.vertcat(*model.rhs(t, x, z, u, p)), every)])
    references = [
        *range(len(model.states)),
        *range(model.first("input"), model.first("input") + len(model.inputs)),
        *range(model.first("parameter"), model.first("mode")),
        len(model.entries),
    ]
    start = np.array([v.start for v in model.parameters])
    slopes = []
    for _ in range(4):
        at = [rng.uniform(0, 2), rng.uniform(-0.4, 0.4, x.numel()), rng.normal(size=u.numel())]
        slopes.append(np.array(J(*at, start * rng.uniform(0.9, 1.1, len(start)))))
    slopes = np.array(slopes)
    rows = list(dependencies(model).running.values())
    assert len(rows) == slopes.shape[1]
    for row, known in enumerate(rows):
        for column, reference in enumerate(references):
            values = slopes[:, row, column]
            if reference not in known:
                assert np.all(values == 0)
            else:
                assert np.abs(values).max() > 0
                assert known[reference] != "constant" or np.ptp(values) < 1e-12


def test_loops_that_stand_apart_are_kept_apart():
    model = two_cranks(coupled=False)
    assert known_of(model, "s1") == {"a": "dependent", "l1": "dependent"}
    assert known_of(model, "s2") == {"b": "dependent", "l2": "dependent"}


def test_a_loop_on_another_one_depends_on_both():
    model = two_cranks(coupled=True)
    assert set(known_of(model, "s1")) == {"a", "l1"}
    assert set(known_of(model, "s2")) == {"a", "b", "l1", "l2"}


def test_kinds_with_modes_and_fixed_parameters():
    model = ball()
    assert known_of(model, "der(v)") == {
        "v": "discrete",
        "push": "constant",
        "g": "constant",
        "drag": "dependent",
        "count": "dependent",
    }
    assert known_of(model, "scaled") == {"h": "discrete", "count": "dependent"}
    assert known_of(model, "weighted") == {"h": "fixed", "v": "constant", "e": "dependent"}
    assert known_of(model, "indicator.floor") == {"h": "constant"}


def test_outputs_of_a_loop_depend_on_all_states_of_the_host_or_on_none():
    """Near singular configurations the states are tangent coordinates, which move all joints."""
    model = fmu_model(catalogue_system("slider_crank"), FmuOptions(outputs=["energy"]))
    names = [entry.variable.name for entry in model.entries]
    running = structure(model).running

    def known(name):
        return names_of(model, running[names.index(name)])

    states = {"state[1]": "dependent", "state[2]": "dependent"}
    for name in ("crank.q", "slide.q", "rod.v", "tool.x", "energy.kinetic", "der(crank.q)"):
        assert known(name) == states
    for name in ("slide.a", "der(crank.v)", "der(state[1])", "indicator.coordinates"):
        assert known(name) == states | {"crank.tau": "dependent"}
    for name in ("tool.y", "energy.potential"):  # it slides along x, without gravity
        assert known(name) == {}
