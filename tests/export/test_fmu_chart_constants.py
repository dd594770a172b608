"""Constants of Model Exchange through singular configurations, each moved tenfold."""

import re
from ctypes import POINTER, c_double

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Model
from fmu_instances import Fmu
from support.change_points import linkage, slider_crank

import mbs
from mbs.errors import SolverError
from mbs.export.fmu import pack
from mbs.simulate import fmu

SYSTEMS = {
    "parallelogram": lambda: mbs.robots.n_four_bar().assemble(active=["a0"]),
    "slider-crank": slider_crank,
    "kite": lambda: linkage((0.5, 1.1, 1.1, 0.5), (1.0, 0.5, 2.0)),
}
FLAT = {"a0.q": np.pi - 0.03, "a0.v": 0.7}
"""Near where a parallelogram is flat: its states are tangent coordinates."""


@pytest.fixture(scope="module")
def systems():
    return {name: build() for name, build in SYSTEMS.items()}


@pytest.fixture(scope="module")
def written(systems, tmp_path_factory):
    """FMUs whose constants have other values, each made once."""
    folder, made, compiled = tmp_path_factory.mktemp("constants"), {}, pack.cached_library

    def write(name, file="", constant="", factor=1.0):
        key = (name, file, constant, factor)
        if key in made:
            return made[key]

        def other(texts, *args, **kwargs):
            changed = dict(texts)
            if file:
                changed[file], count = re.subn(
                    rf"(#define {constant}) (?:REAL\()?([-+.\de]+)\)?",
                    lambda m: f"{m[1]} {float(m[2]) * factor!r}",
                    texts[file],
                )
                assert count == 1
            return compiled(changed, *args, **kwargs)

        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(pack, "cached_library", other)
            path = mbs.export.fmu(systems[name], folder / f"{len(made)}.fmu", outputs=["energy"])
        made[key] = Fmu(path, folder / str(len(made)))
        return made[key]

    return write


def states(instance):
    x = np.zeros(2)
    instance.getContinuousStates(x.ctypes.data_as(POINTER(c_double)), 2)
    return x


def answers(model, start, move, speed):
    """Whether states beside the last ones have derivatives.

    The joint is `move` further than at the start, and as fast as `speed`.
    """
    instance = model.open(FMU2Model, start=start)
    x, unit = states(instance), 1.0
    v = start["a0.v"]
    if v:
        unit = x[1] / v
    else:
        other = model.open(FMU2Model, start=start | {"a0.v": 1.0})
        unit = states(other)[1]
        other.freeInstance()
    ahead, rate = np.array([unit * move, unit * speed]), np.zeros(2)
    instance.setTime(1e-6)
    instance.setContinuousStates(ahead.ctypes.data_as(POINTER(c_double)), 2)
    try:
        instance.getDerivatives(rate.ctypes.data_as(POINTER(c_double)), 2)
    except FMICallException:
        return False
    finally:
        instance.freeInstance()
    return True


def by_joints(model, position):
    """Whether the states at a start are those of the independent joint."""
    instance = model.open(FMU2Model, start={"slide.q": position})
    found = states(instance)[0] == position
    instance.freeInstance()
    return found


def motion(model, tolerance=1e-8):
    """Energy error in tolerances and number of events; infinite where the motion stops."""
    try:
        result = fmu(
            model.path,
            3.0,
            start={"a0.v": -1.0},
            kind="ModelExchange",
            tolerance=tolerance,
            step=0.02,
            quiet=True,
        )
    except SolverError:
        return np.inf, 0
    total = result["energy.kinetic"] + result["energy.potential"]
    events = int(np.sum(np.diff(result.time) == 0))
    return np.ptp(total) / result["energy.kinetic"].max() / tolerance, events


def switches(model, beside):
    """Whether an event changes the states at a part of the way before it would anyway."""
    low, high = 1.05, 1.09
    while high - low > 1e-13:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if by_joints(model, middle) else (low, middle)
    instance = model.open(FMU2Model, start={"slide.q": low - beside * (1.1 - low)})
    instance.enterEventMode()
    changed = instance.newDiscreteStates()[3]
    instance.freeInstance()
    return bool(changed)


def miss(model):
    """Largest error of derivatives by the states, part of the largest one."""
    instance = model.open(FMU2Model, start=FLAT)
    slots = [model.references[f"state[{k}]"] for k in (1, 2)]
    rates = [model.references[f"der(state[{k}])"] for k in (1, 2)]
    x = states(instance)

    def slope(at):
        found = np.zeros(2)
        instance.setContinuousStates(at.ctypes.data_as(POINTER(c_double)), 2)
        instance.getDerivatives(found.ctypes.data_as(POINTER(c_double)), 2)
        return found

    def difference(e):
        return (slope(x + e) - slope(x - e)) / (2 * np.max(e))

    columns = []
    for e in 1e-3 * np.eye(2):  # extrapolated twice: to the sixth power of the step
        a, b, c = difference(e), difference(e / 2), difference(e / 4)
        columns.append((64 * c - 20 * b + a) / 45)
    slope(x)
    J = [instance.getDirectionalDerivative(rates, [slot], [1.0]) for slot in slots]
    instance.freeInstance()
    return np.abs(np.array(J) - np.array(columns)).max() / np.abs(J).max()


BESIDE = [  # start, move, speed, what moves the bound, and where it lies
    ("GUIDE_DISTANCE", FLAT, -0.05, 0.7, 0.1),
    ("GUIDE_DISTANCE", FLAT, -0.15, 0.7, 10.0),
    ("GUIDE_VELOCITY", FLAT, 0.0, 0.7 * 1.05, 0.1),
    ("GUIDE_VELOCITY", FLAT, 0.0, 0.7 * 1.3, 10.0),
    ("GUIDE_REST", FLAT | {"a0.v": 0.0}, 0.0, 5e-5, 0.1),
    ("GUIDE_REST", FLAT | {"a0.v": 0.0}, 0.0, 5e-4, 10.0),
]


@pytest.mark.parametrize(("constant", "start", "move", "speed", "factor"), BESIDE)
def test_states_beside_the_motion_are_refused(written, constant, start, move, speed, factor):
    near = factor < 1
    assert answers(written("parallelogram"), start, move, speed) == near
    other = written("parallelogram", "passage_chart.c", constant, factor)
    assert answers(other, start, move, speed) != near


@pytest.mark.parametrize(("factor", "position"), [(10.0, 1.0), (0.1, 1.0995)])
def test_joints_are_states_up_to_where_they_hold_a_tenth(written, factor, position):
    ours = by_joints(written("slider-crank"), position)
    assert ours == (factor > 1)
    assert by_joints(written("slider-crank", "chart_choice.c", "HOLD", factor), position) != ours


@pytest.mark.parametrize(("factor", "beside"), [(10.0, 4e-6), (0.1, 4e-7)])
def test_an_event_at_the_limit_changes_the_states(written, factor, beside):
    ours = switches(written("slider-crank"), beside)
    assert ours == (factor < 1)
    assert switches(written("slider-crank", "chart_choice.c", "NEAR", factor), beside) != ours


def test_charts_are_left_and_made_anew_in_time(written):
    error, events = motion(written("parallelogram"))
    assert error < 100
    assert events == 6
    assert motion(written("parallelogram", "chart_choice.c", "LEAVE", 10.0))[1] < 3
    assert motion(written("parallelogram", "chart_choice.c", "LEAVE", 0.1))[0] == np.inf
    assert motion(written("parallelogram", "chart_choice.c", "TURNED", 10.0))[1] > 12


def test_differences_are_between_truncation_and_rounding(written):
    ours, short = (written("parallelogram", *other) for other in ((), _SHORT))
    assert miss(ours) < 2e-10 < miss(short)


_SHORT = ("charts.c", "DIFFERENCE", 0.01)
"""Differences of sixth order allow steps of any length between a tenth and ten times ours."""


@pytest.mark.parametrize(
    ("constant", "name", "start"),
    [
        ("START_CLOSED", "slider-crank", {"slide.q": 1.1 + 1e-12}),
        ("DEPENDENT_VELOCITIES", "kite", {"j1.q": 1e-5, "j1.v": 1.1}),
    ],
)
def test_starts_beside_singular_configurations_are_refused(written, constant, name, start):
    def begun(model):
        try:
            fmu(model.path, 1e-3, start=start, step=1e-3, quiet=True)
        except SolverError:
            return False
        return True

    assert not begun(written(name))
    assert begun(written(name, "passage_start.c", constant, 10.0))
