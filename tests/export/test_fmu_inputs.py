"""What drives an FMU beside motors: prescribed motions, wrenches, and other FMUs at flanges."""

import fmpy
import numpy as np
import pytest
from fmpy.fmi2 import FMU2Slave

import mbs
from mbs.components import Body, Bushing, Force, Free, Revolute, Torque, WrenchSensor
from mbs.errors import ModelError
from mbs.export.fmu.options import FmuOptions
from mbs.export.fmu.system_fmu import fmu_model

TENSOR = ((0.02, 0.001, 0), (0.001, 0.03, 0.002), (0, 0.002, 0.04))
FORCE, MOMENT = (3.0, -2.0, 1.0), (0.4, 0.3, -0.6)


def arm(*, pushed=False):
    """Two skew axes; a wrench of the surroundings acts on its tip where it is pushed."""
    m = mbs.Mechanism("arm", gravity=(0, -9.81, 0))
    a, b = (m.add(Body(n, mass=1.0, com=(0.2, 0.1, 0), inertia=TENSOR)) for n in "ab")
    m.connect(m.world, Revolute("j1", axis="z"), a)
    m.connect(a.at(0.4), Revolute("j2", axis="x"), b)
    tip = b.at(0.3, 0.2, 0.1, rotation=("z", 0.5))
    m.add_frame("tip", tip)
    if pushed:
        m.add(Force("push", tip, force=FORCE))
        m.add(Torque("turn", tip, torque=MOMENT))
    return m.assemble(guess={"j1": 0.2, "j2": -0.3})


def run(path, duration=0.4, **options):
    return mbs.simulate.fmu(path, duration, step=0.05, tolerance=1e-10, quiet=True, **options)


def agree(fmu, own, names, tolerance=1e-7) -> None:
    for name in names:
        size = 1 + np.abs(own[name]).max()
        assert np.abs(fmu[name] - own[name]).max() < tolerance * size, name


def test_a_wrench_moves_the_arm_as_a_force_and_a_torque(tmp_path) -> None:
    path = mbs.export.fmu(
        arm(), tmp_path / "arm.fmu", inputs=["tip.wrench"], outputs=["cut_forces"]
    )
    names = [f"tip.{kind}{axis}" for kind in "fm" for axis in "xyz"]
    fmu = run(path, inputs=dict(zip(names, (*FORCE, *MOMENT), strict=True)))
    pushed = arm(pushed=True)
    own = mbs.simulate.run(pushed, 0.4, step=0.05, tolerance=1e-10, quiet=True)
    agree(fmu, own, ["j1.q", "j2.q", "j1.v", "j2.v", "j2.a"])
    rows = [[own[f"{j}.{kind}"][-1] for j in ("j1", "j2")] for kind in ("q", "v", "a")]
    wrench = np.array(mbs.models.joint_wrenches(pushed)(*rows))[:, 1]
    told = [fmu[f"j2.{kind}.{axis}"][-1] for kind in "fm" for axis in "xyz"]
    assert np.abs(told - wrench).max() < 1e-6 * np.abs(wrench).max()


def _bar(*, pushed=False):
    m = mbs.Mechanism("bar", gravity=(0, -9.81, 0))
    a, b, c = (m.add(Body(n, mass=1.0, com=(0.3, 0, 0), inertia=TENSOR)) for n in "abc")
    m.connect(m.world, Revolute("j1", axis="z", actuated=True), a)
    m.connect(a.at(0.4), Revolute("j2", axis="z"), b)
    m.connect(b.at(1.0), Revolute("j3", axis="z"), c.at(0.9))
    m.connect(m.world.at(0.8), Revolute("j4", axis="z"), c)
    m.add(WrenchSensor("pin", "j3"))
    tip = b.at(0.3, 0.2, 0.1, rotation=("z", 0.5))
    m.add_frame("tip", tip)
    if pushed:
        m.add(Force("push", tip, force=FORCE))
        m.add(Torque("turn", tip, torque=MOMENT))
    return m.assemble(guess={"j1": 0.4, "j2": 0.7, "j4": 1.3})


def test_wrenches_of_the_joints_of_a_loop_feel_the_wrench_on_its_coupler() -> None:
    shown = ["cut_forces", "sensors", "motion:tip"]
    model = fmu_model(_bar(), FmuOptions(inputs=["tip.wrench"], outputs=shown))
    pushed, plain = (
        fmu_model(system, FmuOptions(outputs=shown)) for system in (_bar(pushed=True), _bar())
    )
    q = _bar().configuration
    point = 0, [q[0], 1.2], q[1:]
    values = [
        [np.array(part).ravel() for part in m.rhs(*point, u, [])]
        for m, u in (
            (model, [0.5, *FORCE, *MOMENT]),
            (pushed, [0.5]),
            (model, [0.5, *([0] * 6)]),
            (plain, [0.5]),
        )
    ]
    for one, other in (values[:2], values[2:]):
        for x, y in zip(one, other, strict=True):
            assert np.abs(x - y).max() < 1e-9 * (1 + np.abs(y).max())
    assert np.abs(values[0][1] - values[2][1]).max() > 1


def test_an_acceleration_that_is_an_input_needs_the_effort_that_is_shown(tmp_path) -> None:
    path = mbs.export.fmu(arm(), tmp_path / "arm.fmu", inputs=["j1.a"], fmi="3.0")
    fmu = run(path, inputs={"j1.a": 2.0, "j2.tau": 0.5})
    own = mbs.simulate.run(
        arm(), 0.4, motion={"j1.a": 2.0}, tau={"j2": 0.5}, step=0.05, tolerance=1e-10, quiet=True
    )
    agree(fmu, own, ["j1.q", "j1.v", "j2.q", "j2.v", "j2.a", "j1.tau"])


def test_a_position_that_is_an_input_leaves_no_state() -> None:
    model = fmu_model(arm(), FmuOptions(inputs=["j1.q", "tool.wrench"]))
    assert [x.name for x in model.states] == ["j2.q", "j2.v"]
    names = [u.name for u in model.inputs]
    assert names[0] == "j2.tau"
    assert names[-3:] == ["j1.q", "j1.v", "j1.a"]
    assert model.inputs[-3].start == 0.2
    rng = np.random.default_rng(5)
    q, v, a1, push = rng.normal(size=2), rng.normal(size=2), 0.7, 0.3
    u = [push, *([0] * 6), q[0], v[0], a1]
    xdot, y = model.rhs(0, [q[1], v[1]], [], u, [])
    a, tau = mbs.models.hybrid_dynamics(arm(), ["j1"])(q, v, [0, push], [a1])
    told = dict(zip([v.name for v in model.outputs], np.array(y).ravel(), strict=True))
    assert np.abs(np.array(xdot).ravel() - [v[1], float(a[1])]).max() < 1e-12
    assert abs(told["j1.tau"] - float(tau)) < 1e-11


@pytest.mark.parametrize(
    ("wished", "message"),
    [
        ({"inputs": ["j1.v"]}, r"the FMU has no input 'j1.v'; did you mean .*'j1.a'"),
        ({"inputs": ["tipp.wrench"]}, r"there is no frame 'tipp'; did you mean 'tip'"),
        ({"inputs": ["base.wrench"]}, r"the frame base does not move"),
        ({"inputs": ["j1.a", "j1.q"]}, r"motions in inputs name 'j1' twice"),
        ({"inputs": ["j1.a", "j1.a"]}, r"inputs name 'j1.a' twice"),
        ({"inputs": ["tip.wrench"], "flanges": ["tip"]}, r"inputs and flanges name 'tip' twice"),
        ({"inputs": 3}, r"inputs is 3; give a list"),
        ({"inputs": [3]}, r"inputs name 3; give texts"),
        ({"flanges": ["no"]}, r"there is no frame 'no'"),
    ],
)
def test_bad_inputs_are_refused(wished, message) -> None:
    with pytest.raises(ModelError, match=rf"arm: .*{message}|arm: {message}"):
        fmu_model(arm(), FmuOptions(**wished))


def test_terminals_hold_the_variables_of_joints_and_flanges() -> None:
    model = fmu_model(arm(), FmuOptions(flanges=["tip"]))
    joint, _, flange = model.terminals
    told = [(member.name, member.variable, member.kind) for member in joint.members]
    assert (joint.name, joint.kind) == ("j1", "mbs.revolute")
    assert told == [
        ("angle", "j1.q", "signal"),
        ("velocity", "j1.v", "signal"),
        ("acceleration", "j1.a", "signal"),
        ("torque", "j1.tau", "inflow"),
    ]
    known = {entry.variable.name for entry in model.entries}
    assert {member.variable for member in flange.members} <= known
    flows = [member.name for member in flange.members if member.kind == "inflow"]
    assert flows == ["fx", "fy", "fz", "mx", "my", "mz"]


STIFFNESS, DAMPING = 4000.0, 40.0


def _pendulum(m):
    rod = m.add(Body("rod", mass=1.0, com=(0.25, 0, 0), inertia=TENSOR))
    m.connect(m.world, Revolute("j1", axis="z", actuated=False), rod)
    m.add_frame("eye", rod.at(0.5))
    return rod.at(0.5)


def _load(m):
    load = m.add(Body("load", mass=2.0, com=(0, -0.1, 0), inertia=TENSOR))
    m.connect(m.world, Free("free"), load)
    m.add_frame("hook", load.at(0, 0, 0))
    return load.at(0, 0, 0)


def _system(name, *parts):
    m = mbs.Mechanism(name, gravity=(0, -9.81, 0))
    ends = [part(m) for part in parts]
    if len(ends) == 2:
        m.add(Bushing("joint", *ends, stiffness=STIFFNESS, damping=DAMPING))
    place = {"free.x": 0.5} if _load in parts else {}
    return m.assemble(guess=place)


class _Part:
    """An FMU with one flange, stepped from outside."""

    def __init__(self, path, flange, folder) -> None:
        description = fmpy.read_model_description(path)
        self.refs = {v.name: v.valueReference for v in description.modelVariables}
        self.slave = FMU2Slave(
            guid=description.guid,
            unzipDirectory=fmpy.extract(str(path), str(folder)),
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName=flange,
        )
        self.slave.instantiate()
        self.slave.setupExperiment(startTime=0.0)
        self.slave.enterInitializationMode()
        self.slave.exitInitializationMode()
        self.inputs = [self.refs[f"{flange}.{kind}{axis}"] for kind in "fm" for axis in "xyz"]
        kinds = ("", "v", "w")
        self.point = [self.refs[f"{flange}.{kind}{axis}"] for kind in kinds for axis in "xyz"]

    def motion(self):
        return np.array(self.slave.getReal(self.point)).reshape(3, 3)

    def step(self, time, size, wrench) -> None:
        self.slave.setReal(self.inputs, list(wrench))
        self.slave.doStep(currentCommunicationPoint=time, communicationStepSize=size)

    def end(self) -> None:
        self.slave.terminate()
        self.slave.freeInstance()


def _pull(eye, hook):
    """The wrenches of the bushing on both flanges; its force acts at the hook."""
    (p, v, w), (p_load, v_load, _) = eye, hook
    away = p_load - p
    force = STIFFNESS * away + DAMPING * (v_load - v - np.cross(w, away))
    return np.array([[*force, *np.cross(away, force)], [*(-force), 0, 0, 0]])


def test_two_halves_coupled_at_flanges_move_as_the_whole(tmp_path) -> None:
    parts = []
    for make, flange in ((_pendulum, "eye"), (_load, "hook")):
        system = _system(flange, make)
        path = mbs.export.fmu(system, tmp_path / f"{flange}.fmu", flanges=[flange])
        parts.append(_Part(path, flange, tmp_path / flange))
    step, count, last = 2e-4, 1500, None
    for time in step * np.arange(count):
        now = _pull(*(part.motion() for part in parts))
        middle = now if last is None else 1.5 * now - 0.5 * last  # of the step, of second order
        last = now
        for part, wrench in zip(parts, middle, strict=True):
            part.step(time, step, wrench)
    (p, *_), (p_load, *_) = (part.motion() for part in parts)
    for part in parts:
        part.end()
    whole = _system("whole", _pendulum, _load)
    own = mbs.simulate.run(whole, step * count, step=step * count, tolerance=1e-9, quiet=True)
    angle = own["j1.q"][-1]
    assert angle < -0.3
    assert np.abs(p - 0.5 * np.array([np.cos(angle), np.sin(angle), 0])).max() < 1e-7
    ends = [own[f"free.{axis}.q"][-1] for axis in "xyz"]
    assert np.abs(p_load - ends).max() < 1e-7
    assert np.linalg.norm(p_load - p) < 0.02
