"""Model Exchange of closed loops: states that change their meaning where joints do not serve."""

from ctypes import POINTER, c_double

import fmpy
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Model
from fmpy.fmi3 import FMU3Model
from fmu_instances import Fmu, Fmu3

import mbs
from mbs.simulate import fmu

MECHANISMS = {
    "n_four_bar": (
        lambda: mbs.robots.n_four_bar().assemble(active=["a0"]),
        {"a0.v": -1.0},
        "dopri5",
    ),
    "five_bar": (lambda: mbs.robots.five_bar().assemble(), {}, "rodas"),
    "sr400": (lambda: mbs.robots.sr400().assemble(), {}, "rk4"),
}
CHARTS = {"joints": 1.0, "tangents": np.pi - 0.03}
"""Angles of the crank of a parallelogram: far from where it is flat, and near."""


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("charts")
    return {
        (name, fmi): mbs.export.fmu(
            build(), folder / f"{name}{fmi[0]}.fmu", fmi=fmi, outputs=["energy"], solver=solver
        )
        for (name, (build, _, solver)), versions in zip(
            MECHANISMS.items(), (("2.0", "3.0"), ("2.0",), ("3.0",)), strict=True
        )
        for fmi in versions
    }


def begun(unpacked, start):
    """An instance of FMI 3.0 that a host integrates."""
    instance = unpacked.open(FMU3Model)
    for name, value in start.items():
        instance.setFloat64([unpacked.references[name]], [value])
    instance.enterInitializationMode(tolerance=1e-9)
    instance.exitInitializationMode()
    instance.updateDiscreteStates()
    instance.enterContinuousTimeMode()
    return instance


def drift(result):
    total = result["energy.kinetic"] + result["energy.potential"]
    return np.ptp(total) / result["energy.kinetic"].max()


@pytest.mark.parametrize(
    "case", [("n_four_bar", "2.0"), ("n_four_bar", "3.0"), ("five_bar", "2.0")]
)
def test_energy_falls_with_the_tolerance_of_the_host(made, case):
    start = MECHANISMS[case[0]][1]
    for tolerance in (1e-4, 1e-6, 1e-8, 1e-10):
        result = fmu(
            made[case], 5.0, start=start, kind="ModelExchange", tolerance=tolerance, step=0.02
        )
        assert drift(result) < 2000 * tolerance


@pytest.mark.parametrize("name", MECHANISMS)
def test_the_motion_is_that_of_a_simulation(made, name):
    build, start, _ = MECHANISMS[name]
    system, path = build(), next(p for (n, _), p in made.items() if n == name)
    v0 = {key.removesuffix(".v"): value for key, value in start.items()}
    shown = mbs.simulate.run(system, 1.5, v0=v0, tolerance=1e-10, step=0.02, quiet=True)
    result = fmu(path, 1.5, start=start, kind="ModelExchange", tolerance=1e-11, step=0.02)
    rows = np.searchsorted(result.time, shown.time - 1e-9)  # events have rows of their own
    for speed in system.velocity_coordinates:
        for end, size in (("q", 1e-4), ("v", 1e-2)):
            name = f"{speed.name}.{end}"
            assert result[name][rows] == pytest.approx(shown[name], abs=size)


def test_the_importer_of_fmpy_passes_too(made):
    result = fmpy.simulate_fmu(
        str(made["n_four_bar", "2.0"]),
        stop_time=3.0,
        fmi_type="ModelExchange",
        relative_tolerance=1e-7,
        output_interval=0.1,
        start_values={"a0.v": -1.0},
        output=["energy.kinetic", "energy.potential"],
    )
    assert drift(result) < 1e-4


@pytest.mark.parametrize("seed", range(6))
def test_random_starts(made, seed):
    rng = np.random.default_rng([18, seed])
    start = {"a0.v": rng.uniform(-4, 4)}
    tolerance, step = 10 ** rng.uniform(-9, -4), rng.choice([0.005, 0.05, 0.2])
    result = fmu(
        made["n_four_bar", "3.0"],
        3.0,
        start=start,
        kind="ModelExchange",
        tolerance=tolerance,
        step=step,
    )
    assert drift(result) < 3000 * tolerance


def test_joints_are_outputs_and_start_the_motion(made):
    description = fmpy.read_model_description(str(made["n_four_bar", "3.0"]))
    states = [unknown.variable.derivative for unknown in description.derivatives]
    assert [state.name for state in states] == ["state[1]", "state[2]"]
    variables = {v.name: v for v in description.modelVariables}
    assert variables["a0.q"].causality == "output"
    assert variables["a0.q"].initial == "exact"
    assert float(states[0].start) == float(variables["a0.q"].start)
    assert len(description.eventIndicators) == 1


@pytest.mark.parametrize("name", ["a0.q", "state[1]"])
def test_a_start_may_be_given_by_either_name(made, tmp_path, name):
    unpacked = Fmu(made["n_four_bar", "2.0"], tmp_path)
    start = {"a0.q": 1.2, "state[1]": np.pi / 2} if name == "a0.q" else {"state[1]": 1.2}
    instance = unpacked.open(FMU2Model, start=start)
    assert unpacked.get(instance, "a0.q", "state[1]", "a1.q") == pytest.approx([1.2, 1.2, 1.2])
    instance.freeInstance()


@pytest.mark.parametrize("chart", CHARTS)
def test_directional_derivatives_agree_with_differences(made, tmp_path, chart):
    unpacked = Fmu3(made["n_four_bar", "3.0"], tmp_path)
    instance = begun(unpacked, {"a0.q": CHARTS[chart], "a0.v": 0.7})
    d = unpacked.description
    names = [u.variable.derivative.name for u in d.derivatives]
    rates = [u.variable.valueReference for u in d.derivatives]
    known = [unpacked.references[name] for name in names]
    n = len(names)
    J = np.array([instance.getDirectionalDerivative(rates, [k], [1.0], n) for k in known]).T
    x, h = np.zeros(n), 1e-6
    instance.getContinuousStates(x.ctypes.data_as(POINTER(c_double)), n)
    assert (x[0] == CHARTS[chart]) == (chart == "joints")

    def slope(at):
        found = np.zeros(n)
        instance.setContinuousStates(at.ctypes.data_as(POINTER(c_double)), n)
        instance.getContinuousStateDerivatives(found.ctypes.data_as(POINTER(c_double)), n)
        return found

    steps = [h * row for row in np.eye(n)]
    columns = [(slope(x + e) - slope(x - e)) / (2 * h) for e in steps]
    assert pytest.approx(np.array(columns).T, rel=1e-4, abs=1e-4 * np.abs(J).max()) == J
    slope(x)
    w = np.arange(1.0, n + 1)
    assert instance.getAdjointDerivative(rates, known, list(w), n) == pytest.approx(w @ J, rel=1e-6)
    instance.freeInstance()


@pytest.mark.parametrize("chart", CHARTS)
def test_a_saved_state_has_the_same_slopes(made, tmp_path, chart):
    unpacked = Fmu3(made["n_four_bar", "3.0"], tmp_path)
    start = {"a0.q": CHARTS[chart], "a0.v": 0.7}
    one, other = (begun(unpacked, start) for _ in range(2))
    state = one.serializeFMUState(one.getFMUState())
    moved = {"a0.q": CHARTS[chart] - 0.1, "a0.v": 0.2}
    third = begun(unpacked, moved)
    third.setFMUState(third.deserializeFMUState(state))
    rates = [u.variable.valueReference for u in unpacked.description.derivatives]
    wanted = other.getFloat64(rates)
    assert third.getFloat64(rates) == wanted
    for each in (one, other, third):
        each.freeInstance()


def test_a_leap_to_the_other_branch_is_told(made, tmp_path):
    """A host that steps over the flat parallelogram at once is refused, or led along."""
    unpacked = Fmu(made["n_four_bar", "2.0"], tmp_path)
    instance = unpacked.open(FMU2Model, start={"a0.q": np.pi - 0.5, "a0.v": 1.0})
    instance.setTime(1.0)
    instance.setContinuousStates(np.array([np.pi + 0.5, 1.0]).ctypes.data_as(POINTER(c_double)), 2)
    try:
        instance.completedIntegratorStep()
    except FMICallException:
        return
    finally:
        instance.freeInstance()
    pytest.fail("a step across a singular configuration in the coordinates of the joints passed")


@pytest.mark.parametrize(("angle", "change"), [(CHARTS["joints"], 0.2), (CHARTS["tangents"], 0.01)])
def test_joints_set_in_event_mode_are_the_states_again(made, tmp_path, angle, change):
    unpacked = Fmu(made["n_four_bar", "2.0"], tmp_path)
    instance = unpacked.open(FMU2Model, start={"a0.q": angle, "a0.v": 1.0})
    instance.enterEventMode()
    unpacked.set(instance, {"a0.q": angle - change, "a0.v": 0.5})
    assert instance.newDiscreteStates()[3]  # the states have changed
    instance.enterContinuousTimeMode()
    names = ("a0.q", "a1.q", "a1.v", "a0.v")
    wanted = [angle - change, angle - change, 0.5, 0.5]
    assert unpacked.get(instance, *names) == pytest.approx(wanted, abs=1e-12)
    instance.freeInstance()


def test_tuned_lengths_move_the_dependent_joints_in_event_mode(tmp_path):
    system = mbs.robots.four_bar().assemble()
    path = mbs.export.fmu(
        system, tmp_path / "tuned.fmu", parameters=["lengths"], outputs=["closure"]
    )
    unpacked = Fmu(path, tmp_path)
    instance = unpacked.open(FMU2Model)
    length = next(
        v
        for v in unpacked.description.modelVariables
        if v.causality == "parameter" and v.unit == "m" and float(v.start) > 0
    )
    instance.enterEventMode()
    instance.setReal([length.valueReference], [1.01 * float(length.start)])
    instance.newDiscreteStates()
    instance.enterContinuousTimeMode()
    assert abs(unpacked.get(instance, "closure")[0]) < 1e-10
    instance.completedIntegratorStep()
    instance.freeInstance()
