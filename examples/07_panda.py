"""A Panda from point to point: with the least effort, then in the least time its torques allow.

Run it with `python examples/07_panda.py [folder]`; the picture goes to `build/panda` if no folder
is named. It needs matplotlib (`pip install "casadi-mbs[plot]"`).
"""

# %% The inverse model, compiled with its first and second derivatives
import sys
import time
from pathlib import Path

import casadi
import numpy as np
from matplotlib.figure import Figure

import mbs

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "build/panda")
folder.mkdir(parents=True, exist_ok=True)

system = mbs.load("panda").assemble()
clock = time.perf_counter()
idm = mbs.native.compiled(mbs.models.inverse_dynamics(system), derivatives=2)
print(f"Inverse dynamics ready after {time.perf_counter() - clock:.1f} s")

# %% Ends and limits
FROM = np.array([0, -0.6, 0, -2.2, 0, 1.6, 0.8])
TO = np.array([1.4, 0.5, -0.4, -1.3, 0.4, 2.2, -0.5])
TORQUE = np.array([87, 87, 87, 87, 12, 12, 12.0])
SPEED = np.array([2.175, 2.175, 2.175, 2.175, 2.61, 2.61, 2.61])
LOWER, UPPER = np.array([coordinate.limits for coordinate in system.coordinates]).T
STAGES = 40


# %% Accelerations are constant on a stage; torques are limited in its middle
def motion(duration=None, stages=STAGES):
    """The seconds it takes, positions, torques and cost; in the least time if none are given."""
    opti = casadi.Opti()
    q, v = (opti.variable(7, stages + 1) for _ in range(2))
    a = opti.variable(7, stages)
    total = casadi.MX(duration) if duration else opti.variable()
    h = total / stages
    opti.subject_to(casadi.vec(q[:, 1:] - q[:, :-1] - h * v[:, :-1] - h**2 / 2 * a) == 0)
    opti.subject_to(casadi.vec(v[:, 1:] - v[:, :-1] - h * a) == 0)
    middle = q[:, :-1] + h / 2 * v[:, :-1] + h**2 / 8 * a, v[:, :-1] + h / 2 * a
    load = idm.map(stages)(*middle, a) / casadi.repmat(TORQUE, 1, stages)
    opti.subject_to(opti.bounded(-1, casadi.vec(load), 1))
    for k in range(7):
        opti.subject_to(opti.bounded(LOWER[k], q[k, 1:-1], UPPER[k]))
        opti.subject_to(opti.bounded(-SPEED[k], v[k, 1:-1], SPEED[k]))
    for knot, configuration in ((0, FROM), (-1, TO)):
        opti.subject_to(q[:, knot] == configuration)
        opti.subject_to(v[:, knot] == 0)
    opti.set_initial(q, np.linspace(FROM, TO, stages + 1).T)
    effort = h * casadi.sumsqr(load)
    if duration:
        opti.minimize(effort)
    else:
        opti.subject_to(total >= 0.1)
        opti.set_initial(total, 1.5)
        opti.minimize(total + 1e-4 * effort)
    opti.solver("ipopt", {"print_time": False}, {"print_level": 0, "sb": "yes"})
    clock = time.perf_counter()
    found = opti.solve()
    seconds, count = time.perf_counter() - clock, found.stats()["iter_count"]
    print(f"{stages} stages: {count} iterations in {seconds:.2f} s")
    return [found.value(x) for x in (total, q, load, effort, v)]


calm = motion(1.5)
fast = motion()
print(f"Least effort in 1.5 s: {calm[3]:.5f} s")
print(f"Least effort, change with twice the stages: {motion(1.5, 2 * STAGES)[3] - calm[3]:.5f} s")
print(f"Least time: {fast[0]:.5f} s")
print(f"Least time, change with twice the stages: {motion(None, 2 * STAGES)[0] - fast[0]:.5f} s")
print(f"Largest torque / limit: {np.abs(calm[2]).max():.3f} and {np.abs(fast[2]).max():.3f}")
fastest = (np.abs(fast[4]) / SPEED[:, None]).max(axis=0)
bound = np.maximum(np.abs(fast[2]).max(axis=0), np.maximum(fastest[1:], fastest[:-1]))
print(f"Stages of the fast motion with a torque or speed at its limit: {(bound > 0.99).mean():.0%}")

# %% Draw it
figure = Figure(figsize=(10, 6), layout="constrained")
grid = figure.add_gridspec(2, 3)
hand = figure.add_subplot(grid[:, 0], projection="3d")
names = [coordinate.name for coordinate in system.coordinates]
frames = [mbs.models.transform(system, number) for number in range(len(system.tree.links) + 1)]
for (seconds, q, load, *_), row, title in ((calm, 0, "least effort"), (fast, 1, "least time")):
    tip = np.array([np.array(frames[-1](q[:, k]))[:3, 3] for k in range(STAGES + 1)])
    hand.plot(*tip.T, label=title)
    knots = np.linspace(0, seconds, STAGES + 1)
    angle, torque = (figure.add_subplot(grid[row, column]) for column in (1, 2))
    angle.plot(knots, q.T)
    angle.set(title=f"{title}: {seconds:.2f} s", ylabel="joint [rad]", xlabel="time [s]")
    for k, name in enumerate(names):
        torque.stairs(load[k], knots, baseline=None, label=name)
    torque.set(title="torque / limit", ylim=(-1.1, 1.1), xlabel="time [s]")
    torque.legend(ncols=2, fontsize="x-small") if row == 0 else None
for configuration, shade in ((FROM, "0.7"), (TO, "0.2")):
    hand.plot(
        *np.array([np.array(frame(configuration))[:3, 3] for frame in frames]).T, "o-", color=shade
    )
hand.set(title="paths of the flange", xlim=(-0.2, 0.8), ylim=(-0.3, 0.7), zlim=(0, 1))
hand.set_box_aspect((1, 1, 1))
hand.legend(fontsize="small")
figure.savefig(folder / "panda.png", dpi=90)
print(f"\nFiles in {folder}: {', '.join(sorted(p.name for p in folder.iterdir()))}")
