"""FMUs that start where the independent joints do not determine the others."""

import numpy as np
import pytest
from fmpy.fmi2 import FMU2Model, FMU2Slave
from fmpy.fmi3 import FMU3Slave
from fmu_instances import Fmu, Fmu3
from support.change_points import linkage, slider_crank

import mbs
from mbs.components import RigidStop
from mbs.errors import SolverError
from mbs.simulate import fmu

KINDS = pytest.mark.parametrize("kind", ["CoSimulation", "ModelExchange"])
MECHANISMS = {
    "parallelogram": (lambda: mbs.robots.n_four_bar().assemble(active=["a0"]), "2.0"),
    "antiparallelogram": (lambda: linkage((0.4, 1.0, 0.4, 1.0), (1.0, -1.8, -1.5)), "3.0"),
    "kite": (lambda: linkage((0.5, 1.1, 1.1, 0.5), (1.0, 0.5, 2.0)), "2.0"),
    "slider-crank": (slider_crank, "3.0"),
}
STARTS = {  # mechanism, positions of the independent joint and of all, velocities, how many are set
    "parallelogram": ("parallelogram", 0.0, [0, 0, 0], [3, -3, 3], 2),
    "parallelogram folded": ("parallelogram", np.pi, [np.pi, -np.pi, np.pi], [-2, 2, -2], 3),
    "parallelogram by its branch": ("antiparallelogram", 0.0, [0, 0, 0], [2, -2, 2], 3),
    "antiparallelogram": ("antiparallelogram", 0.0, [0, 0, 0], [-6 / 7, 2, 2], 2),
    "slow": ("antiparallelogram", 0.0, [0, 0, 0], [-3e-3, 7e-3, 7e-3], 2),
    "kite on its long bars": ("kite", 0.0, [0, 0, 0], [0, 2, 2], 2),
    "kite": ("kite", 0.0, [0, 0, 0], [1.1, -0.8, 0.8], 2),
    "dead centre": ("slider-crank", 1.1, [0, 0, 1.1], [2, -2 * 1.1 / 0.8, 0], 1),
    "dead centre at rest": ("slider-crank", 1.1, [0, 0, 1.1], [0, 0, 0], 0),
}


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("starts")
    found = {}
    for name, (build, fmi) in MECHANISMS.items():
        system = build()
        path = folder / f"{name}.fmu"
        found[name] = system, mbs.export.fmu(system, path, fmi=fmi, outputs=["energy", "closure"])
    return found


def given(system, position, v, count):
    """Starts of the FMU: of the independent joint, and of as many velocities as are set."""
    (k,) = system.independent
    first = {
        f"{system.velocity_coordinates[k].name}.q": position,
        f"{system.velocity_coordinates[k].name}.v": v[k],
    }
    named = [f"{speed.name}.v" for speed in system.velocity_coordinates][:count]
    return first | dict(zip(named, v, strict=False))


@pytest.mark.sweep
@KINDS
@pytest.mark.parametrize("case", STARTS)
def test_a_start_with_velocities_of_one_branch_moves_as_a_simulation(made, case, kind):
    name, position, q, v, count = STARTS[case]
    system, path = made[name]
    shown = mbs.simulate.run(system, 1.0, q0=q, v0=v, tolerance=1e-11, step=0.02, quiet=True)
    start = given(system, position, v, count)
    result = fmu(path, 1.0, start=start, tolerance=1e-9, step=0.02, kind=kind, quiet=True)
    rows = np.searchsorted(result.time, shown.time - 1e-9)
    for speed, velocity in zip(system.velocity_coordinates, v, strict=True):
        got = result[f"{speed.name}.q"][rows]
        assert got == pytest.approx(shown[f"{speed.name}.q"], abs=1e-6)
        assert result[f"{speed.name}.v"][0] == pytest.approx(velocity, abs=3e-6)
    energy = result["energy.kinetic"] + result["energy.potential"]
    assert np.ptp(energy) < 1e-6 * result["energy.kinetic"].max()
    assert result["closure"].max() < 1e-9


@KINDS
@pytest.mark.parametrize("case", ["kite", "antiparallelogram", "kite on its long bars"])
def test_accelerations_of_a_start_are_those_of_the_branch(made, case, kind):
    """Those that the rows allow there are other ones."""
    name, position, _, v, count = STARTS[case]
    system, path = made[name]
    start = given(system, position, v, count)
    result = fmu(path, 1e-2, start=start, tolerance=1e-11, step=1e-3, kind=kind, quiet=True)
    for speed in system.velocity_coordinates:
        fit = np.polynomial.Polynomial.fit(result.time, result[f"{speed.name}.v"], 4)
        assert result[f"{speed.name}.a"][0] == pytest.approx(fit.deriv()(0.0), abs=2e-2)


@KINDS
@pytest.mark.parametrize(
    ("name", "start", "joint"),
    [
        ("parallelogram", {"a0.q": 0.0}, "b0.v"),
        ("parallelogram", {"a0.q": 0.0, "a0.v": 1.0, "b0.v": -1.5}, "b0.v"),
        ("parallelogram", {"a0.q": 0.0, "a0.v": 1.0, "b0.v": -1.0001}, "b0.v"),
        ("antiparallelogram", {"j1.q": 0.0, "j1.v": -6 / 7}, "j4.v"),
    ],
)
def test_a_start_that_chooses_no_branch_is_refused(made, name, start, joint, kind):
    """The error names the configuration, the joint, and what would decide."""
    where = ", ".join(rf"{k} = {start.get(k, 0):g}" for k in list(start)[:1])
    message = rf"time 0 in a singular configuration \({where}.*no branch.*hold {joint}.*set veloc"
    with pytest.raises(SolverError, match=message):
        fmu(made[name][1], 1.0, start=start, kind=kind, quiet=True)


@KINDS
def test_velocities_that_the_loops_do_not_allow_are_refused(made, kind):
    start = {"slide.q": 1.1, "slide.v": 1.0}
    with pytest.raises(SolverError, match=r"slide.q = 1.1, slide.v = 1\) in which the loops allow"):
        fmu(made["slider-crank"][1], 1.0, start=start, kind=kind, quiet=True)


@KINDS
def test_a_branch_that_ends_before_a_start_is_refused(made, kind):
    for beyond in (1e-5, 0.3):
        with pytest.raises(SolverError, match=r"unclosable configuration at time 0"):
            fmu(made["slider-crank"][1], 1.0, start={"slide.q": 1.1 + beyond}, kind=kind)


def test_a_start_of_a_dependent_velocity_says_nothing_elsewhere(made):
    _, path = made["kite"]
    rows = [
        fmu(path, 0.1, start={"j1.v": 1.0, **more}, quiet=True)["j4.v"]
        for more in ({}, {"j4.v": 77.0})
    ]
    assert np.array_equal(*rows)


@pytest.mark.parametrize("kind", [FMU2Slave, FMU2Model])
def test_a_start_is_saved_and_goes_on_bit_for_bit(made, tmp_path, kind):
    model = Fmu(made["kite"][1], tmp_path)
    start = {"j1.q": 0.0, "j1.v": 1.1, "j2.v": -0.8}
    instance = model.open(kind, start=start, tolerance=1e-8)
    names = ["j1.q", "j2.q", "j4.q", "j1.a", "j2.a", "j4.a"]
    blob = instance.serializeFMUstate(instance.getFMUstate())
    other = model.open(kind, upto="instantiated")
    other.setFMUstate(other.deSerializeFMUstate(blob))
    assert np.array_equal(model.get(instance, *names), model.get(other, *names))
    if kind is FMU2Slave:
        first, second = (model.step(each, 20) for each in (instance, other))
        assert np.array_equal(first, second)
        assert np.ptp(first[:, 0]) > 0.1


def test_an_input_that_is_set_at_the_start_changes_its_accelerations(made, tmp_path):
    """They are looked for again, on the same branch."""
    model = Fmu3(made["antiparallelogram"][1], tmp_path)
    instance = model.open(FMU3Slave)
    for name, value in {"j1.q": 0.0, "j1.v": -6 / 7, "j2.v": 2.0}.items():
        instance.setFloat64([model.references[name]], [value])
    instance.enterInitializationMode(tolerance=1e-9)
    pushed, free = {}, model.get(instance, ["j1.a", "j4.a"])
    instance.exitInitializationMode()
    assert model.get(instance, ["j1.a", "j4.a"]) == pytest.approx(free, abs=1e-9)
    instance.setFloat64([model.references["j1.tau"]], [5.0])
    pushed = model.get(instance, ["j1.a", "j4.a"])
    assert (pushed - free)[1] == pytest.approx(-7 / 3 * (pushed - free)[0], abs=1e-2)
    assert abs((pushed - free)[0]) > 1
    instance.freeInstance()


def test_a_start_with_a_stop_bounces_as_a_simulation(tmp_path):
    stop = RigidStop("stop", joint="j1", lower=-5.0, upper=0.02, restitution=1.0)
    system = linkage((0.5, 1.1, 1.1, 0.5), (0.4, 1.0, 1.3), (stop,))
    path = mbs.export.fmu(system, tmp_path / "bounce.fmu")
    shown = mbs.simulate.run(
        system, 1.0, q0=[0, 0, 0], v0=[1.1, -0.8, 0.8], tolerance=1e-10, step=0.02, quiet=True
    )
    assert shown.events
    start = {"j1.q": 0.0, "j1.v": 1.1, "j2.v": -0.8}
    result = fmu(path, 1.0, start=start, tolerance=1e-10, step=0.02, quiet=True)
    assert result["j4.q"][-1] == pytest.approx(shown["j4.q"][-1], abs=1e-6)


def test_arrays_have_starts_of_dependent_velocities(tmp_path):
    system = MECHANISMS["kite"][0]()
    path = mbs.export.fmu(system, tmp_path / "kite.fmu", fmi="3.0", arrays=True)
    start = {"q[1]": 0.0, "v[1]": 1.1, "v_dependent[1]": -0.8}
    result = fmu(path, 0.1, start=start, quiet=True)
    assert result["v_dependent[2]"][0] == pytest.approx(0.8, abs=1e-9)
