"""A four-bar mechanism, from its parts to C code, an FMU, a simulation and a picture.

Run it with `python examples/01_four_bar.py [folder]`; files go to `build/four_bar` if no folder is
named. It needs matplotlib (`pip install "casadi-mbs[plot]"`), and a C compiler for the C program
and the FMU (`pip install "casadi-mbs[cross]"` brings one).
"""

# %% Compose: joints connect points of bodies; the loop is found, never declared
import subprocess
import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import mbs
from mbs.components import Box, Revolute

LENGTHS = {"a": 0.4, "b": 1.0, "c": 0.9}

m = mbs.Mechanism("four_bar", gravity=(0, -9.81, 0))
a, b, c = (m.add(Box(name, length=x, width=0.05, density=2700)) for name, x in LENGTHS.items())
m.connect(m.world, Revolute("j1", axis="z", actuated=True), a.left)
m.connect(a.right, Revolute("j2", axis="z"), b.left)
m.connect(b.right, Revolute("j3", axis="z"), c.right)
m.connect(m.world.at(0.8, 0, 0), Revolute("j4", axis="z"), c.left)
system = m.assemble(guess={"j2": 1.0})
print(system.report())

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "build/four_bar")
folder.mkdir(parents=True, exist_ok=True)

# %% Models: casadi Functions of q, whose elements close the loop, and of the independent velocity
idm = mbs.models.inverse_dynamics(system)
ddm = mbs.models.direct_dynamics(system)
lagrange = mbs.models.lagrange(system)
energy = mbs.models.energy(system)
print(f"\nModels\n  {idm!r}\n  {ddm!r}\n  {lagrange!r}\n  {energy!r}")

# %% Check them against each other at a configuration that closes the loop
q = mbs.loops.solve(system, {"j1": 0.3})
speed, torque = 2.0, 5.0
acceleration = ddm(q, speed, torque)
A, B, Q = lagrange(q, speed)
E, U = energy(q, speed)
names = [coordinate.name for coordinate in system.coordinates]
print("\nAt", ", ".join(f"{name} = {x:.6f}" for name, x in zip(names, q, strict=True)), "rad")
print(f"  acceleration of j1: {float(acceleration):.6f} rad/s2")
print(f"  idm(ddm(tau)) - tau: {abs(float(idm(q, speed, acceleration)) - torque):.1e} N.m")
print(f"  A a + B v + Q - tau: {abs(float(A * acceleration + B * speed + Q) - torque):.1e} N.m")
print(f"  v' A v / 2 - E: {abs(float(A) * speed**2 / 2 - float(E)):.1e} J")

# %% Simulate: two seconds under a constant torque; the work of the motor is the gain of energy
DURATION, TOLERANCE = 2.0, 1e-11
motion = mbs.simulate.run(
    system, DURATION, q0={"j1": 0.3}, tau={"j1": torque}, tolerance=TOLERANCE, quiet=True
)
total = motion["kinetic_energy"] + motion["potential_energy"]
work = torque * (motion["j1.q"] - motion["j1.q"][0])
motion.to_csv(folder / "motion.csv")
print(f"\nSimulated {DURATION:g} s, {len(motion)} rows")
print(f"  largest closure residual: {motion['closure_residual'].max():.1e}")
print(f"  energy gained - work done: {np.abs(total - total[0] - work).max():.1e} J")

# %% Draw: configurations of one turn of the crank, the path of the middle of the coupler, the
# motion
poses = {name: mbs.models.transform(system, name) for name in LENGTHS}


def bar(name: str, configuration: np.ndarray, *along: float) -> np.ndarray:
    """Points (2, n) of a body in the base frame, given their distances [m] from its left end."""
    points = np.array([[x, 0.0, 0.0, 1.0] for x in along]).T
    return (np.array(poses[name](configuration)) @ points)[:2]


turn, near = [], {}
for angle in np.linspace(0.0, 2 * np.pi, 91):
    turn.append(mbs.loops.solve(system, {"j1": angle}, guess=near))
    near = dict(zip(names, turn[-1], strict=True))

COLOURS = {"a": "tab:red", "b": "tab:blue", "c": "tab:green"}
figure = Figure(figsize=(8.8, 4.0), layout="constrained")
grid = figure.add_gridspec(2, 2, width_ratios=(1.15, 1))
drawing, angles, energies = (
    figure.add_subplot(place) for place in (grid[:, 0], grid[0, 1], grid[1, 1])
)
for k in range(0, 90, 10):
    for name, length in LENGTHS.items():
        strong = {"linewidth": 4.0} if k == 20 else {"linewidth": 1.3, "alpha": 0.3}
        label = f"{name}, {length:g} m" if k == 20 else None
        drawing.plot(*bar(name, turn[k], 0, length), color=COLOURS[name], label=label, **strong)
middle = np.hstack([bar("b", configuration, LENGTHS["b"] / 2) for configuration in turn])
drawing.plot(*middle, "k--", linewidth=1, label="middle of b")
drawing.plot([0, 0.8], [0, 0], "k^", markersize=9)
drawing.set(title="one turn of the crank", xlabel="x [m]", ylabel="y [m]", aspect="equal")
drawing.legend(loc="lower right", fontsize="small")
for name in names:
    angles.plot(motion.time, motion[f"{name}.q"], label=name)
angles.set(title=f"motion under {torque:g} N.m at j1", ylabel="angle [rad]", xticklabels=[])
energies.plot(motion.time, motion["kinetic_energy"], label="kinetic")
energies.plot(motion.time, motion["potential_energy"], label="potential")
energies.plot(motion.time, total - work, "k--", label="sum - work")
energies.set(xlabel="time [s]", ylabel="energy [J]")
for axes in (angles, energies):
    axes.grid(alpha=0.3)
    axes.legend(loc="center left", bbox_to_anchor=(1, 0.5), fontsize="small")
figure.savefig(folder / "four_bar.png", dpi=90)

# %% C: a folder that compiles anywhere, with a program that calls every function once
library = mbs.export.c_library([idm, ddm, lagrange], folder / "models")
print(f"\nC library: {', '.join(sorted(path.name for path in library.iterdir()))}")
try:
    compiler = mbs.native.find_compiler()
except mbs.errors.CompilerError as error:
    sys.exit(f"The C program and the FMU are left out: {error}")
sources = [str(library / "example.c"), str(library / "models.c")]
program = folder / "example"
subprocess.run([*compiler.command, "-O2", *sources, "-o", str(program), "-lm"], check=True)
answer = subprocess.run([str(program.resolve())], check=True, capture_output=True, text=True)
print("  the example program prints")
print("\n".join(f"    {line}" for line in answer.stdout.splitlines()))

# %% FMU: written, then run by fmpy through both interfaces, and compared with the simulation
path = mbs.export.fmu(system, folder / "four_bar.fmu", tolerance=TOLERANCE)
print(f"\nFMU: {path.stat().st_size / 1024:.0f} kB")
for kind in ("CoSimulation", "ModelExchange"):
    other = mbs.simulate.fmu(
        path,
        DURATION,
        start={"j1.q": 0.3},
        inputs={"j1.tau": torque},
        kind=kind,
        tolerance=TOLERANCE,
        quiet=True,
    )
    shared = [f"{name}.{quantity}" for name in names for quantity in "qv"]
    largest = max(np.abs(other[name] - motion[name]).max() for name in shared)
    print(f"  {kind}: largest difference of positions and velocities {largest:.1e}")

# %% Where everything is
print(f"\nFiles in {folder}")
for path in sorted(p for p in folder.rglob("*") if p.is_file()):
    print(f"  {path.relative_to(folder)}")
