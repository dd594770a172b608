"""An SR400 carries a load over a wall: its parallelogram is solved inside the equations.

Run it with `python examples/09_sr400_pick_and_place.py [folder]`; the picture goes to `build/sr400`
if no folder is named. It needs matplotlib (`pip install "casadi-mbs[plot]"`).
"""

# %% Six motors, nine joints, one loop
import sys
import time
from pathlib import Path

import casadi
import numpy as np
from matplotlib.figure import Figure

import mbs
from mbs.bridges import Grid, collocation, step

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "build/sr400")
folder.mkdir(parents=True, exist_ok=True)
system = mbs.load("sr400").assemble()


# %% Configurations with the hand downwards, on the left and on the right of a wall
def reached(x, y, z):
    """Positions of all joints, on one branch of the arm and of its loop."""
    T = [[1, 0, 0, x], [0, -1, 0, y], [0, 0, -1, z], [0, 0, 0, 1]]
    ways = mbs.models.inverse_geometry.solve(system, np.array(T), frame=6)
    return next(way.q for way in ways if way.branch == BRANCH)


BRANCH = "q1:- q2:+ q5:+; q8:parallel"  # the arm stretched forward, its elbow up
PICK, PLACE = reached(0.9, -0.9, 0.1), reached(0.9, 0.9, 0.1)
names = [coordinate.name for coordinate in system.coordinates]
dae = mbs.models.dae(system, q0=dict(zip(names, PICK, strict=True)))
print(f"States: {', '.join(name for name, _ in dae.elements['x'])}")

# %% Everything else is a Function of the six motors' angles, the loop solved inside
configuration = casadi.Function("configuration", [dae.x], [dae.q], {"cse": True})
place = casadi.Function("place", [dae.x], [mbs.models.transform(system, 6)(dae.q)], {"cse": True})


def pins(q):
    """The ends of the rod and of the beam, which a joint holds together."""
    rod, beam = (np.array(mbs.models.transform(system, k)(q)) for k in (8, 3))
    return rod[:3, 3] + 0.8 * rod[:3, 0], beam[:3, 3] - 0.3 * beam[:3, 1]


# %% The least effort in 1.5 s, above the wall in the middle
STAGES, DURATION, WALL = 20, 1.5, 0.8
TORQUE = np.array([2500, 2500, 400, 200, 100, 2500.0])
active = list(system.independent)
ends = [np.concatenate([q[active], np.zeros(6)]) for q in (PICK, PLACE)]

clock = time.perf_counter()
opti = casadi.Opti()
way = collocation(opti, dae, Grid(stages=STAGES, duration=DURATION), points=2)
for knot, end in zip((0, -1), ends, strict=True):
    opti.subject_to(way.x[:, knot] == end)
middle = place(way.x[:, STAGES // 2])
opti.subject_to(middle[1, 3] == 0)
opti.subject_to(middle[2, 3] >= WALL)
load = way.u / casadi.repmat(TORQUE, 1, STAGES)
opti.subject_to(opti.bounded(-1, casadi.vec(load), 1))
opti.minimize(way.step * casadi.sumsqr(load))
way.guess(np.linspace(*ends, STAGES + 1).T)
opti.solver("ipopt", {"print_time": False}, {"print_level": 0, "sb": "yes"})
print(f"Problem ready after {time.perf_counter() - clock:.1f} s")

clock = time.perf_counter()
found = opti.solve()
x, u, cost = (found.value(value) for value in (way.x, load, opti.f))
print(f"{found.stats()['iter_count']} iterations in {time.perf_counter() - clock:.1f} s")
fine = step(dae, 10).mapaccum(STAGES)  # Runge and Kutta's method instead of collocation
again = np.array(fine(x[:, 0], u * TORQUE[:, None], [], DURATION / STAGES))
print(f"Least effort: {cost:.5f} s")
beside = np.abs(again - x[:, 1:])[:6].max()
print(f"Simulated with these torques, largest error of a motor: {beside:.1e} rad")
q = np.array(configuration.map(STAGES + 1)(x))
gap = max(np.abs(np.subtract(*pins(q[:, k]))).max() for k in range(STAGES + 1))
print(f"Largest gap of the loop: {gap:.1e} m")
print(f"Largest torque / limit: {np.abs(u).max():.3f}")

# %% Draw it
figure = Figure(figsize=(10, 4.6), layout="constrained")
grid = figure.add_gridspec(2, 2, width_ratios=(1.2, 1))
arm = figure.add_subplot(grid[:, 0], projection="3d")
frames = {k: mbs.models.transform(system, k) for k in range(len(system.tree.links) + 1)}
path = np.array([np.array(frames[6](q[:, k]))[:3, 3] for k in range(STAGES + 1)])
for k in range(0, STAGES + 1, 5):
    shade = str(0.75 - 0.75 * k / STAGES)
    origin = {n: np.array(frame(q[:, k]))[:3, 3] for n, frame in frames.items()}
    hinge = pins(q[:, k])[1]
    arm.plot(*np.array([origin[n] for n in (0, 2, 3, 4, 6)]).T, color=shade, linewidth=2.5)
    arm.plot(*np.array([origin[7], origin[8], hinge, origin[3]]).T, color=shade, linewidth=1)
arm.plot(*path.T, color="tab:red")
arm.plot_surface(
    *(np.array(c) for c in ([[0.6, 1.6]] * 2, [[0, 0]] * 2, [[-0.6] * 2, [WALL] * 2])), alpha=0.3
)
arm.set(xlabel="x [m]", ylabel="y [m]", zlabel="z [m]", title="over the wall")
arm.tick_params(labelsize="x-small")
arm.set_aspect("equal")
arm.view_init(elev=22, azim=-25)
times = np.linspace(0, DURATION, STAGES + 1)
angle, torque = (figure.add_subplot(grid[row, 1]) for row in (0, 1))
for k, number in enumerate(active):
    angle.plot(times, x[k], label=names[number])
    torque.stairs(u[k], times, baseline=None)
angle.set(ylabel="motor [rad]", title=f"least effort: {cost:.4f} s")
angle.legend(ncols=3, fontsize="x-small")
torque.set(ylabel="torque / limit", xlabel="time [s]")
figure.savefig(folder / "sr400.png", dpi=90)
print(f"\nFiles in {folder}: {', '.join(sorted(p.name for p in folder.iterdir()))}")
