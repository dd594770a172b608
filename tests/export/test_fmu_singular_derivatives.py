"""Derivatives of FMUs near singular configurations: right, or an error with one message."""

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Model, FMU2Slave
from fmpy.fmi3 import FMU3Model, FMU3Slave
from fmu_instances import Fmu, Fmu3

import mbs
from mbs import Mechanism
from mbs.components import Body, Revolute

SIZES = {"mm": 1e-3, "m": 1.0, "km": 1e3}
ANGLES = (0.3, 0.1, 0.03, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9)
"""Angles of the crank; the parallelogram is flat at zero."""
SPEEDS = (0.1, 3.0, 100.0)
RULE = "so near a singular one"
STARTS = "it starts at time 0 in a singular configuration"
REMEDY = "choose other independent joints"


def parallelogram(size):
    """Three slender rods of 1 kg in a square, gravity 9.81 sizes/s2: a = -11.772 cos(angle)."""
    m = Mechanism("parallelogram", gravity=(0, -9.81 * size, 0))
    inertia = (0, size**2 / 12, size**2 / 12)
    rods = [m.add(Body(n, mass=1, com=(size / 2, 0, 0), inertia=inertia)) for n in "lrc"]
    hinges = {n: Revolute(n, axis="z", actuated=False) for n in ("a0", "a1", "b0", "c0")}
    m.connect(m.world, hinges["a0"], rods[0])
    m.connect(m.world.at(size), hinges["a1"], rods[1])
    m.connect(rods[0].at(size), hinges["b0"], rods[2])
    m.connect(rods[2].at(size), hinges["c0"], rods[1].at(size))
    m.cut(hinges["c0"])
    m.guess.update({"a0": np.pi / 2, "a1": np.pi / 2, "b0": -np.pi / 2})
    return m.assemble(active=["a0"])


def slope(angle):
    """How fast the accelerations of a0 and a1 rise with the angle; that of b0 falls."""
    return 11.772 * np.sin(angle)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("derivatives")
    found = {}
    for unit, size in SIZES.items():
        for fmi, kind in (("2.0", Fmu), ("3.0", Fmu3)):
            path = mbs.export.fmu(parallelogram(size), folder / f"{unit}{fmi[0]}.fmu", fmi=fmi)
            found[unit, fmi] = kind(path, folder / f"{unit}{fmi[0]}")
    return found


class Derivatives:
    """Derivatives of one instance in a state."""

    def __init__(self, unpacked, kind, angle, speed, upto="run"):
        self.unpacked, self.reals = unpacked, unpacked.references
        start = {"a0.q": angle, "a0.v": speed}
        if kind in (FMU2Model, FMU2Slave):
            self.instance = unpacked.open(kind, upto=upto, start=start, tolerance=1e-9)
            return
        self.instance = instance = unpacked.open(kind)
        for name, value in start.items():
            instance.setFloat64([self.reals[name]], [value])
        instance.enterInitializationMode(tolerance=1e-9)
        if upto == "initialization":
            return
        instance.exitInitializationMode()
        if kind is FMU3Model:
            instance.updateDiscreteStates()
            instance.enterContinuousTimeMode()

    def along(self, unknowns, known):
        """Derivatives of outputs along a state; divided by how fast it turns the crank."""
        references, by = [self.reals[name] for name in unknowns], [self.reals[known]]
        arguments = (references, by, [1.0])
        if isinstance(self.unpacked, Fmu3):
            return np.array(self.instance.getDirectionalDerivative(*arguments, len(references)))
        return np.array(self.instance.getDirectionalDerivative(*arguments))

    def back(self, unknown, known):
        """The same by an adjoint derivative."""
        unknowns, knowns = [self.reals[unknown]], [self.reals[known]]
        return self.instance.getAdjointDerivative(unknowns, knowns, [1.0], 1)[0]


PATHS = {
    "exchange 2.0": ("2.0", FMU2Model, "run"),
    "initialization 2.0": ("2.0", FMU2Model, "initialization"),
    "co-simulation 2.0": ("2.0", FMU2Slave, "run"),
    "exchange 3.0": ("3.0", FMU3Model, "run"),
    "initialization 3.0": ("3.0", FMU3Model, "initialization"),
    "co-simulation 3.0": ("3.0", FMU3Slave, "run"),
}


@pytest.mark.parametrize("unit", SIZES)
@pytest.mark.parametrize("path", PATHS)
def test_derivatives_are_right_or_refused(made, capfd, path, unit):
    fmi, kind, upto = PATHS[path]
    answered, statuses = set(), set()
    for speed in SPEEDS:
        for angle in ANGLES:
            try:
                at = Derivatives(made[unit, fmi], kind, angle, speed, upto)
            except FMICallException:  # no start there
                capfd.readouterr()
                continue
            names = ("a0.q", "a0.a", "a1.a", "b0.a")
            try:
                q, *slopes = at.along(names, "state[1]")
            except FMICallException as error:
                told = capfd.readouterr().out
                statuses.add(str(error).partition("status ")[2])
                assert told.count("\n") == 1
                assert (RULE in told and REMEDY in told) or STARTS in told
            else:
                answered.add((speed, angle))
                bound = 5e-5 * slope(angle) + 1e-9 * speed**2
                expected = slope(angle) * np.array([1, 1, -1])
                assert np.abs(slopes / q - expected) == pytest.approx(0, abs=bound), (speed, angle)
                if fmi == "3.0":
                    assert at.back("a0.a", "state[1]") / q == pytest.approx(slope(angle), abs=bound)
            at.instance.freeInstance()
    assert statuses == {"3 (error)."}
    # refused where they cannot be right, and nowhere else
    assert {angle for _, angle in answered} == {0.3, 0.1, 0.03, 0.01}
    assert {(speed, angle) for speed in SPEEDS for angle in (0.3, 0.1)} < answered
    assert {(0.1, 0.03), (3.0, 0.03), (0.1, 0.01)} < answered
    assert (100.0, 0.01) not in answered


@pytest.mark.parametrize("angle", [1e-3, 1e-6])
def test_adjoint_derivatives_are_refused_too(made, capfd, angle):
    for kind in (FMU3Model, FMU3Slave):
        at = Derivatives(made["m", "3.0"], kind, angle, 3.0)
        with pytest.raises(FMICallException):
            at.back("a0.a", "state[1]")
        assert RULE in capfd.readouterr().out
        at.instance.freeInstance()


@pytest.mark.parametrize("angle", [1e-4, 1e-7])
def test_output_derivatives_are_refused_too(made, capfd, angle):
    at = Derivatives(made["m", "2.0"], FMU2Slave, angle, 3.0)
    with pytest.raises(FMICallException):
        at.instance.getRealOutputDerivatives([at.reals["a0.a"]], [1])
    assert RULE in capfd.readouterr().out
    at.instance.freeInstance()


def test_values_and_steps_stay_possible_after_a_refused_derivative(made):
    at = Derivatives(made["m", "2.0"], FMU2Slave, 1e-4, 3.0)
    with pytest.raises(FMICallException):
        at.along(["a0.a"], "state[1]")
    at.instance.doStep(0.0, 0.1)
    assert at.unpacked.get(at.instance, "a0.q")[0] == pytest.approx(0.24, abs=0.01)
    assert at.along(["a0.a"], "state[1]")[0] == pytest.approx(
        slope(at.unpacked.get(at.instance, "a0.q")[0]), rel=1e-6
    )
    at.instance.freeInstance()


@pytest.mark.parametrize("unit", SIZES)
def test_velocities_and_inputs_near_a_flat_parallelogram(made, unit):
    """Accelerations do not depend on the velocity."""
    for kind in (FMU2Model, FMU2Slave):
        at = Derivatives(made[unit, "2.0"], kind, 0.01, 3.0)
        v, a = at.along(("a0.v", "a0.a"), "state[2]")
        assert a / v == pytest.approx(0, abs=1e-7)
        at.instance.freeInstance()
