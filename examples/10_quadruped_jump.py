"""A quadruped jumps: stance, flight, an impact and stance again, with feet that may not slip.

Run it with `python examples/10_quadruped_jump.py [folder]`; the picture goes to `build/quadruped`
if no folder is named. It needs matplotlib (`pip install "mbs[plot]"`).
"""

# %% Seen from the side: a trunk, and the four legs in pairs that move alike
import sys
import time
from pathlib import Path

import casadi
import numpy as np
from matplotlib.figure import Figure

import mbs
from mbs.components import Body, Prismatic, Revolute

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "build/quadruped")
folder.mkdir(parents=True, exist_ok=True)
LEGS, LEG = {"front": 0.2, "hind": -0.2}, 0.2

m = mbs.Mechanism("quadruped", gravity=(0, 0, -9.81))
sled, carriage = m.add(Body("sled")), m.add(Body("carriage"))
trunk = m.add(Body("trunk", mass=6, inertia=(0.03, 0.1, 0.1)))
m.connect(m.world, Prismatic("x", axis="x", actuated=False), sled)
m.connect(sled, Prismatic("z", axis="z", actuated=False), carriage)
m.connect(carriage, Revolute("pitch", axis="y", actuated=False), trunk)
for leg, hip in LEGS.items():
    upper, lower = (
        m.add(Body(f"{leg}_{part}", mass=mass, com=(0, 0, -LEG / 2), inertia=(i, i, 0)))
        for part, mass, i in (("upper", 1.2, 0.004), ("lower", 0.4, 0.0014))
    )
    m.connect(trunk.at(hip), Revolute(f"{leg}_hip", axis="y"), upper)
    m.connect(upper.at(0, 0, -LEG), Revolute(f"{leg}_knee", axis="y"), lower)
    m.add_frame(f"{leg}_foot", lower.at(0, 0, -LEG))
system = m.assemble()
names = [speed.name for speed in system.speeds]
motors = [k for k, speed in enumerate(system.speeds) if speed.actuated]

# %% One set of feet; each phase holds some of them, with the same inputs and outputs
clock = time.perf_counter()
feet = [mbs.models.ContactPoint(leg, f"{leg}_foot", friction=0.6) for leg in LEGS]
phases = mbs.models.contact_phases(system, feet)
stance, flight = (
    mbs.native.compiled(phases.residuals(touching), derivatives=2) for touching in (tuple(LEGS), ())
)
points = mbs.native.compiled(phases.motion(), derivatives=2)
impact = phases.impact(tuple(LEGS))
print(f"Phases ready after {time.perf_counter() - clock:.1f} s")

# %% The problem: 0.4 m forward, the feet at least 0.1 m above the ground in the middle
WAY, CLEARANCE, TORQUE, TURN = 0.4, 0.1, 60.0, {"hip": 0.7, "knee": -1.4}
standing = np.array([TURN.get(name.rpartition("_")[2], 0.0) for name in names])
standing[names.index("z")] = 2 * LEG * np.cos(0.7)
landed = standing.copy()
landed[names.index("x")] = WAY
PLAN = ((stance, 14, 0.35), (flight, 10, 0.3), (stance, 14, 0.35))
opti, size, pieces, cost = casadi.Opti(), len(names), [], 0

for number, (residual, count, seconds) in enumerate(PLAN):
    q, v = opti.variable(size, count + 1), opti.variable(size, count + 1)
    a, u, f = (opti.variable(rows, count) for rows in (size, len(motors), 2 * len(LEGS)))
    total = opti.variable()
    opti.subject_to(opti.bounded(0.1, total, 1.0))
    h = total / count
    opti.subject_to(casadi.vec(q[:, 1:] - q[:, :-1] - h * v[:, :-1] - h**2 / 2 * a) == 0)
    opti.subject_to(casadi.vec(v[:, 1:] - v[:, :-1] - h * a) == 0)
    middle = q[:, :-1] + h / 2 * v[:, :-1] + h**2 / 8 * a, v[:, :-1] + h / 2 * a
    tau = casadi.MX(size, count)
    tau[motors, :] = u
    along, up = f[: len(LEGS), :], f[len(LEGS) :, :]
    force = casadi.vertcat(
        casadi.reshape(along, 1, -1), casadi.MX(1, len(LEGS) * count), casadi.reshape(up, 1, -1)
    )
    motion, contact = residual.map(count)(*middle, a, tau, force)
    opti.subject_to(casadi.vec(motion) == 0)
    held = points.map(count)(q[:, 1:], v[:, 1:])[1] if residual is stance else contact
    opti.subject_to(casadi.vec(held[[0, 2], :]) == 0)  # nothing moves across the plane
    if residual is stance:
        opti.subject_to(casadi.vec(up) >= 0)
        opti.subject_to(casadi.vec(0.6 * up - along) >= 0)
        opti.subject_to(casadi.vec(0.6 * up + along) >= 0)
    opti.subject_to(opti.bounded(-TORQUE, casadi.vec(u), TORQUE))
    cost += h * casadi.sumsqr(u / TORQUE)
    goal = standing + (landed - standing) * np.linspace(number, number + 1, count + 1)[:, None] / 3
    opti.set_initial(q, goal.T)
    opti.set_initial(total, seconds)
    opti.set_initial(up, 40 if residual is stance else 0)
    pieces.append((q, v, u, up, total))

(q1, v1, *_), (q2, v2, *_), (q3, v3, *_) = pieces
trunk_only = [names.index(name) for name in ("x", "z", "pitch")]  # the feet hold the legs
opti.subject_to(q1[:, 0] == standing)
opti.subject_to(v1[:, 0] == 0)
opti.subject_to(q3[trunk_only, -1] == landed[trunk_only])
opti.subject_to(v3[trunk_only, -1] == 0)
opti.subject_to(q2[:, 0] == q1[:, -1])
opti.subject_to(v2[:, 0] == v1[:, -1])
opti.subject_to(q3[:, 0] == q2[:, -1])
v_plus, P = impact(q2[:, -1], v2[:, -1])
opti.subject_to(v3[:, 0] == v_plus)
opti.subject_to(P[2, :].T >= 0)
place = points(q2[:, -1], v2[:, -1])[0] - points(landed, np.zeros(size))[0]
opti.subject_to(casadi.vec(place[[0, 2], :]) == 0)
for k in range(1, q2.shape[1] - 1):
    height = points(q2[:, k], v2[:, k])[0][2, :].T
    opti.subject_to(height >= CLEARANCE * (k == 5))
opti.minimize(cost)
opti.solver("ipopt", {"print_time": False}, {"print_level": 0, "sb": "yes", "max_iter": 300})
clock = time.perf_counter()
found = opti.solve()
print(f"{found.stats()['iter_count']} iterations in {time.perf_counter() - clock:.1f} s")
print(f"Least effort - 0.01351: {found.value(cost) - 0.01351:.5f} s")
times = [found.value(total) for *_, total in pieces]
print(f"Stance {times[0]:.3f} s, flight {times[1]:.3f} s, stance {times[2]:.3f} s")

# %% What holds by the physics alone
q, v = ([found.value(x) for x in every] for every in ((q1, q2, q3), (v1, v2, v3)))
ways = [np.array(points.map(x.shape[1])(x, y)[0]) for x, y in zip(q, v, strict=True)]
drift = max(np.abs(way - np.tile(way[:, :2], way.shape[1] // 2)).max() for way in ways[::2])
print(f"Feet in stance move by: {drift:.1e} m")
A = mbs.models.inertia_matrix(system)
ends = (q[1][:, -1], v[1][:, -1]), (q[2][:, 0], v[2][:, 0])
before, after = (float(y @ np.array(A(x)) @ y) / 2 for x, y in ends)
print(f"Energy lost in the impact: {before - after:.2f} J of {before:.2f} J")
top = max(way[2].max() for way in ways)
print(f"Feet rise to: {top:.3f} m")

# %% Draw it
figure = Figure(figsize=(10, 4.6), layout="constrained")
drawing, force = figure.subplots(1, 2, width_ratios=(1.7, 1))
every = np.hstack([x[:, ::4] for x in q])
for k, posture in enumerate(every.T):
    shade = str(0.85 - 0.85 * k / (every.shape[1] - 1))
    for leg in LEGS:
        parts = (f"{leg}_upper", f"{leg}_lower", f"{leg}_foot")
        bones = [np.array(mbs.models.transform(system, part)(posture))[[0, 2], 3] for part in parts]
        drawing.plot(*np.transpose(bones), "o-", color=shade, markersize=2, linewidth=1.2)
    hips = [
        np.array(mbs.models.transform(system, f"{leg}_upper")(posture))[[0, 2], 3] for leg in LEGS
    ]
    drawing.plot(*np.transpose(hips), color=shade, linewidth=3)
for leg, row in zip(LEGS, (0, 1), strict=True):
    drawing.plot(
        *np.hstack([way[[0, 2], row::2] for way in ways]), linewidth=0.8, label=f"{leg} feet"
    )
drawing.axhline(0, color="0.6")
drawing.set(aspect="equal", xlabel="x [m]", ylabel="z [m]", title="A jump, grey to black in time")
drawing.legend(fontsize="small")
starts = np.concatenate([[0], np.cumsum(times)])
for number, (*_, up, _) in enumerate(pieces):
    rows, color = found.value(up), ("tab:blue", "tab:orange")
    knots = np.linspace(starts[number], starts[number + 1], rows.shape[1] + 1)
    for leg, row, shade in zip(LEGS, rows, color, strict=True):
        force.stairs(
            row, knots, color=shade, baseline=None, label=None if number else f"{leg} feet"
        )
force.set(xlabel="time [s]", title="force of the ground, vertical [N]")
force.legend()
figure.savefig(folder / "quadruped.png", dpi=90)
print(f"\nFiles in {folder}: {', '.join(sorted(p.name for p in folder.iterdir()))}")
