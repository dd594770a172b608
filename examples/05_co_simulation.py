"""A hatch with a stop and its controller as FMUs: events, a coupled system, a parameter study.

Run it with `python examples/05_co_simulation.py [folder]`; files go to `build/co_simulation` if no
folder is named. It needs a C compiler (`pip install "casadi-mbs[cross]"` brings one) and matplotlib
(`pip install "casadi-mbs[plot]"`).
"""

# %% A hatch that falls on its frame, bounces and rests; a motor lifts it again
import sys
from pathlib import Path

import casadi as ca
import fmpy
import numpy as np
from fmpy.fmi2 import FMU2Slave
from matplotlib.figure import Figure

import mbs
from mbs.components import Box, CoulombFriction, Revolute, RigidStop
from mbs.export.fmu.description import FmuModel, FmuVariable
from mbs.export.fmu.pack import write_fmu

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "build/co_simulation")
folder.mkdir(parents=True, exist_ok=True)

m = mbs.Mechanism("hatch")
lid = m.add(Box("lid", length=0.8, width=0.03, height=0.6, mass=mbs.Parameter("m", 5.0)))
m.connect(m.world, Revolute("hinge", axis="-y", actuated=True), lid.left)
m.add(RigidStop("frame", joint="hinge", lower=0, restitution=0.4))
m.add(CoulombFriction("seal", joint="hinge", sliding=1.5, sticking=2))
hatch = m.assemble()

# %% As FMUs: the motor's torque is an input that grows; events are found by the importer's solver
fmus = {
    fmi: mbs.export.fmu(hatch, folder / f"hatch{fmi[0]}.fmu", fmi=fmi) for fmi in ("2.0", "3.0")
}
DURATION, START = 5.0, {"hinge.q": 0.5}
growing = ([0.0, 10.0], [0.0, 50.0])
options = {"tolerance": 1e-10, "quiet": True}
reference = mbs.simulate.run(
    hatch, DURATION, q0={"hinge": 0.5}, tau=lambda t, q, v: 5 * t, step=0.01, **options
)
print(f"Events of mbs.simulate.run: {len({time for time, *_ in reference.events}) - 1} instants")
runs = {}
for fmi, kind in (("2.0", "CoSimulation"), ("2.0", "ModelExchange"), ("3.0", "ModelExchange")):
    run = mbs.simulate.fmu(
        fmus[fmi], DURATION, kind=kind, start=START, inputs={"hinge.tau": growing}, **options
    )
    rows = np.searchsorted(run.time, reference.time, side="right") - 1  # after events
    error = np.max(np.abs(run["hinge.q"][rows] - reference["hinge.q"]))
    print(f"FMI {fmi} {kind}: largest difference of the angle: {error:.1e} rad")
    runs[fmi, kind] = run
lifted = runs["3.0", "ModelExchange"].events[-1]
print(f"{lifted[1]} {lifted[2]} at {lifted[0]:.6f} s")
print(f"Time at which the hatch lifts - expected: {lifted[0] - (5 * 9.81 * 0.4 + 2) / 5:.1e} s")

# %% A controller as an FMU: a spring and a damper towards a goal
q, v, p = ca.SX.sym("q"), ca.SX.sym("v"), ca.SX.sym("p", 3)
none = ca.SX.sym("none", 0)
torque = p[0] * (p[2] - q) - p[1] * v
law = ca.Function("law", [ca.SX.sym("t"), none, none, ca.vertcat(q, v), p], [none, torque])
controller = write_fmu(
    FmuModel(
        name="controller",
        rhs=law,
        inputs=(FmuVariable(name="q", unit="rad"), FmuVariable(name="v", unit="rad/s")),
        outputs=(FmuVariable(name="tau", unit="N.m"),),
        parameters=(
            FmuVariable(name="stiffness", unit="N.m/rad", start=60.0),
            FmuVariable(name="damping", unit="N.m.s/rad", start=12.0),
            FmuVariable(name="goal", unit="rad", start=1.0),
        ),
    ),
    folder / "controller.fmu",
)

# %% Both as one system for tools of co-simulation
wires = [
    ("controller.tau", "hatch.hinge.tau"),
    ("hatch.hinge.q", "controller.q"),
    ("hatch.hinge.v", "controller.v"),
]
parts = {"hatch": fmus["2.0"], "controller": controller}
system = mbs.export.ssp(
    folder / "cell.ssp", parts, wires, start={"controller.goal": 1.2}, stop_time=2.0
)


# %% What such a tool does: all make a step, then outputs go to inputs
def coupled(step: float, duration: float) -> float:
    """The angle at the end [rad]."""
    units, names = {}, {}
    for name, file in parts.items():
        described = fmpy.read_model_description(str(file))
        names[name] = {x.name: x.valueReference for x in described.modelVariables}
        units[name] = FMU2Slave(
            guid=described.guid,
            unzipDirectory=fmpy.extract(str(file), str(folder / name)),
            modelIdentifier=described.coSimulation.modelIdentifier,
            instanceName=name,
        )
        units[name].instantiate()
        units[name].setupExperiment(tolerance=1e-10, startTime=0.0)
        if name == "controller":
            units[name].setReal([names[name]["goal"]], [1.2])
        units[name].enterInitializationMode()
        units[name].exitInitializationMode()

    def exchange() -> None:
        for given, taken in wires:
            (a, x), (b, y) = (end.split(".", 1) for end in (given, taken))
            units[b].setReal([names[b][y]], units[a].getReal([names[a][x]]))

    for k in range(round(duration / step)):
        exchange()
        for unit in units.values():
            unit.doStep(currentCommunicationPoint=k * step, communicationStepSize=step)
    (angle,) = units["hatch"].getReal([names["hatch"]["hinge.q"]])
    for unit in units.values():
        unit.terminate()
        unit.freeInstance()
    return float(angle)


closed = mbs.simulate.run(
    hatch, 0.5, tau=lambda t, q, v: 60 * (1.2 - q) - 12 * v, step=0.01, **options
)
errors = [coupled(step, 0.5) - closed["hinge.q"][-1] for step in (0.002, 0.001, 0.0005)]
print(f"\nCoupled - closed loop: {errors[0]:.1e}, {errors[1]:.1e}, {errors[2]:.1e} rad")
print(f"Steps of 0.5 ms: difference {errors[2]:.1e} rad")
print(f"Half the step, ratio - 2: {errors[1] / errors[2] - 2:.3f}")

# %% A study: how long the hatch bounces, by its mass and the height from which it falls
grid = {"m": [2.0, 5.0, 10.0], "hinge.q": [0.2, 0.4, 0.6, 0.8, 1.0]}
study = mbs.simulate.sweep(
    fmus["3.0"], grid, 2.0, folder=folder / "study", kind="ModelExchange", **options
)


def rest(result: mbs.Result) -> float:
    """When the hatch comes to rest [s]."""
    return next(time for time, name, words in result.events if words == "0 -> -1")


times = study.summary({"rest": rest})["rest"].reshape(3, 5)
print(f"\n{study}")
print(f"At rest after {times.min():.3f} to {times.max():.3f} s")

# %% Draw it
figure = Figure(figsize=(9, 6), layout="constrained")
angle, after = figure.subplots(2, 1)
shown = runs["3.0", "ModelExchange"]
angle.plot(shown.time, shown["hinge.q"], label="angle [rad]")
for time, *_ in shown.events:
    angle.axvline(time, color="0.8", linewidth=0.7, zorder=0)
angle.set(xlabel="time [s]", title="The hatch falls, bounces, rests and is lifted; events in grey")
angle.legend()
for mass, row in zip(grid["m"], times, strict=True):
    after.plot(grid["hinge.q"], row, "o-", label=f"{mass:g} kg")
after.set(xlabel="angle at the start [rad]", ylabel="at rest after [s]", title="Parameter study")
after.legend()
figure.savefig(folder / "co_simulation.png", dpi=90)
print(f"\nFiles in {folder}: {', '.join(sorted(p.name for p in folder.iterdir()))}")
