"""The PUMA 560 arm from the catalogue: its models, what they cost, a fall, C code and an FMU.

Run it with `python examples/02_puma560.py [folder]`; files go to `build/puma560` if no folder is
named. It needs matplotlib (`pip install "casadi-mbs[plot]"`), and a C compiler for the FMU
(`pip install "casadi-mbs[cross]"` brings one).
"""

# %% Load: a name of the catalogue; a .toml, .par, .urdf or MJCF file is loaded the same way
import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import mbs

system = mbs.load("puma560").assemble()
print(system.report())
print(f"Data: {system.source}.")

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "build/puma560")
folder.mkdir(parents=True, exist_ok=True)

# %% Models and how many instructions CasADi evaluates for each
idm = mbs.models.inverse_dynamics(system)
ddm = mbs.models.direct_dynamics(system)
inertia = mbs.models.inertia_matrix(system)
bias = mbs.models.bias(system)
gravity = mbs.models.gravity_effort(system)
lagrange = mbs.models.lagrange(system)
energy = mbs.models.energy(system)
geometry = mbs.models.direct_geometry(system)
jacobian = mbs.models.jacobian(system, 6)
functions = [idm, ddm, inertia, bias, gravity, lagrange, energy, geometry, jacobian]
print("\nInstructions")
for function in functions:
    signature = str(function).removesuffix(" SXFunction")
    print(f"  {function.n_instructions():5d}  {signature}")

# %% Check them against each other at a random state
random = np.random.default_rng(560)
q, v, tau = random.uniform(-1, 1, 6), random.uniform(-1, 1, 6), random.uniform(-20, 20, 6)
a = ddm(q, v, tau)
A, B, Q = lagrange(q, v)
ahead, behind = (np.array(geometry(q + sign * 1e-6 * v))[:3, 3] for sign in (1, -1))
velocity = np.array(jacobian(q) @ v)[:3, 0]
print("\nLargest differences at a random state")
print(f"  idm(ddm(tau)) - tau: {np.abs(np.array(idm(q, v, a)).ravel() - tau).max():.1e} N.m")
print(f"  A a + B v + Q - tau: {np.abs(np.array(A @ a + B @ v + Q).ravel() - tau).max():.1e} N.m")
print(f"  bias(q, 0) - gravity(q): {np.abs(np.array(bias(q, v * 0) - gravity(q))).max():.1e} N.m")
print(f"  J v - d(dgm)/dt: {np.abs(velocity - (ahead - behind) / 2e-6).max():.1e} m/s")

# %% Let it fall from the stretched configuration: nothing brakes it, so its energy does not change
DURATION, TOLERANCE = 2.0, 1e-11
start = {"q2": -np.pi / 4, "q3": np.pi / 2}
motion = mbs.simulate.run(system, DURATION, q0=start, tolerance=TOLERANCE, quiet=True)
total = motion["kinetic_energy"] + motion["potential_energy"]
motion.to_csv(folder / "fall.csv")
print(f"\nSimulated {DURATION:g} s, {len(motion)} rows")
moved = motion["kinetic_energy"].max()
print(f"  change of energy: {np.ptp(total):.1e} J; up to {moved:.0f} J are kinetic")

# %% Draw the fall: the origins of the frames, joined; and what moves
poses = [mbs.models.transform(system, number) for number in range(len(system.tree.links) + 1)]
names = [coordinate.name for coordinate in system.coordinates]
figure = Figure(figsize=(9.5, 4.4), layout="constrained")
grid = figure.add_gridspec(2, 2, width_ratios=(1.15, 1))
arm = figure.add_subplot(grid[:, 0])
angles, energies = figure.add_subplot(grid[0, 1]), figure.add_subplot(grid[1, 1])
for instant in (0.0, 0.3, 0.5, 0.7, 0.9):
    row = int(np.argmin(np.abs(motion.time - instant)))
    configuration = [motion[f"{name}.q"][row] for name in names]
    origins = np.array([np.array(pose(configuration))[:3, 3] for pose in poses]).T
    arm.plot(origins[0], origins[2], "o-", linewidth=2, markersize=4, label=f"{instant:g} s")
arm.set(title="falling arm, seen along y", xlabel="x [m]", ylabel="z [m]", aspect="equal")
arm.grid(alpha=0.3)
arm.legend(fontsize="small")
for name in names:
    angles.plot(motion.time, motion[f"{name}.q"], label=name)
angles.set(title="no torque at any joint", ylabel="angle [rad]", xticklabels=[])
energies.plot(motion.time, motion["kinetic_energy"], label="kinetic")
energies.plot(motion.time, motion["potential_energy"], label="potential")
energies.plot(motion.time, total, "k--", label="sum")
energies.set(xlabel="time [s]", ylabel="energy [J]")
for axes in (angles, energies):
    axes.grid(alpha=0.3)
    axes.legend(loc="center left", bbox_to_anchor=(1, 0.5), fontsize="small")
figure.savefig(folder / "puma560.png", dpi=90)

# %% C and FMU, the FMU run by fmpy through both interfaces
library = mbs.export.c_library(functions, folder / "models")
print(f"\nC library: {', '.join(sorted(path.name for path in library.iterdir()))}")
try:
    path = mbs.export.fmu(system, folder / "puma560.fmu", tolerance=TOLERANCE)
except mbs.errors.CompilerError as error:
    sys.exit(f"The FMU is left out: {error}")
print(f"FMU: {path.stat().st_size / 1024:.0f} kB")
for kind in ("CoSimulation", "ModelExchange"):
    other = mbs.simulate.fmu(
        path,
        DURATION,
        start={f"{name}.q": value for name, value in start.items()},
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
