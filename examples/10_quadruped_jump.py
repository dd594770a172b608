"""A quadruped jumps forward and turns: stance, flight, impact and stance, with feet that grip.

Run it with `python examples/10_quadruped_jump.py [folder]`; the picture goes to `build/quadruped`
if no folder is named. It needs matplotlib (`pip install "casadi-mbs[plot]"`).
"""

# %% A trunk that moves freely, and four legs of three motors each
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
LEG = 0.2
HIPS = {
    f"{end}_{side}": (x, y)
    for end, x in (("front", 0.2), ("hind", -0.2))
    for side, y in (("left", 0.1), ("right", -0.1))
}

m = mbs.Mechanism("quadruped", gravity=(0, 0, -9.81))
under = m.world
slides = [Prismatic(axis, axis=axis, actuated=False) for axis in "xyz"]
turns = [Revolute(name, axis=axis, actuated=False) for name, axis in (("yaw", "z"), ("pitch", "y"))]
for number, joint in enumerate([*slides, *turns]):
    carriage = m.add(Body(f"carriage{number}", mass=0))
    m.connect(under, joint, carriage)
    under = carriage
trunk = m.add(Body("trunk", mass=6, inertia=(0.03, 0.1, 0.11)))
m.connect(under, Revolute("roll", axis="x", actuated=False), trunk)
for leg, (x, y) in HIPS.items():
    bracket, upper, lower = (
        m.add(Body(f"{leg}_{part}", mass=mass, com=(0, 0, z), inertia=(i, i, 0)))
        for part, mass, z, i in (
            *(("bracket", 0.2, 0, 2e-4), ("upper", 0.5, -LEG / 2, 1.7e-3)),
            ("lower", 0.2, -LEG / 2, 7e-4),
        )
    )
    m.connect(trunk.at(x, y), Revolute(f"{leg}_side", axis="x"), bracket)
    m.connect(bracket, Revolute(f"{leg}_hip", axis="y"), upper)
    m.connect(upper.at(0, 0, -LEG), Revolute(f"{leg}_knee", axis="y"), lower)
    m.add_frame(f"{leg}_foot", lower.at(0, 0, -LEG))
system = m.assemble()
names = [speed.name for speed in system.velocity_coordinates]
motors = [k for k, speed in enumerate(system.velocity_coordinates) if speed.actuated]
size, legs = len(names), len(HIPS)

# %% One set of feet; each phase holds some of them, with the same inputs and outputs
feet = [mbs.models.ContactPoint(leg, f"{leg}_foot", friction=0.6) for leg in HIPS]
phases = mbs.models.contact_phases(system, feet)
points, cone, impact = phases.motion(), phases.friction(sides=4), phases.impact(tuple(HIPS))

# %% The problem: 0.25 m forward and 0.4 rad to the left, the feet 0.05 m above the ground
WAY, TURN, CLEARANCE, TORQUE, FLIGHT = 0.25, 0.4, 0.05, 30.0, 0.24
PLAN = ((tuple(HIPS), 8, 0.3), ((), 6, FLIGHT), (tuple(HIPS), 8, 0.3))
BENT = {"hip": 0.7, "knee": -1.4}
standing = np.array([BENT.get(name.rpartition("_")[2], 0.0) for name in names])
standing[names.index("z")] = 2 * LEG * np.cos(BENT["hip"])
landed = standing.copy()
landed[[names.index("x"), names.index("yaw")]] = WAY, TURN
rest = np.zeros(size)
before, after = (np.array(points(configuration, rest)[0]) for configuration in (standing, landed))


def guess(number, count):
    """Positions and velocities: at rest, a free fall that begins upwards, and at rest again."""
    s, up = np.linspace(0, 1, count + 1), 9.81 * FLIGHT / 2
    q, v = (
        np.tile((standing, standing, landed)[number], (count + 1, 1)),
        np.zeros((count + 1, size)),
    )
    z = names.index("z")
    if number == 0:
        v[:, z] = up * s**4
    elif number == 1:
        q += s[:, None] * (landed - standing)
        q[:, z] += up * FLIGHT * (s - s**2)
        v += (landed - standing) / FLIGHT
        v[:, z] = up * (1 - 2 * s)
    return q.T, v.T


clock = time.perf_counter()
opti, pieces, cost = casadi.Opti(), [], 0
for number, (touching, count, seconds) in enumerate(PLAN):
    q, v = opti.variable(size, count + 1), opti.variable(size, count + 1)
    a, u = (opti.variable(rows, count) for rows in (size, len(motors)))
    h = seconds / count
    opti.subject_to(casadi.vec(q[:, 1:] - q[:, :-1] - h * v[:, :-1] - h**2 / 2 * a) == 0)
    opti.subject_to(casadi.vec(v[:, 1:] - v[:, :-1] - h * a) == 0)
    middle = q[:, :-1] + h / 2 * v[:, :-1] + h**2 / 8 * a, v[:, :-1] + h / 2 * a
    tau = casadi.MX(size, count)
    tau[motors, :] = u
    f = opti.variable(3, legs * count) if touching else casadi.MX(3, legs * count)
    motion, _ = phases.residuals(touching).map(count)(*middle, a, tau, f)
    opti.subject_to(casadi.vec(motion) == 0)
    place, speed = points.map(count)(q[:, 1:], v[:, 1:])
    if touching:  # velocities of the feet, and a pull that takes back what has drifted
        home = np.tile(after if number else before, (1, count))
        opti.subject_to(casadi.vec(speed + (place - home) / 0.05) == 0)
        opti.subject_to(casadi.vec(cone.map(count)(f)) >= 0)
        opti.set_initial(f[2, :], 24)
    else:
        heights = casadi.reshape(place[2, :], legs, count)
        opti.subject_to(casadi.vec(heights[:, :-1]) >= 0)
        opti.subject_to(heights[:, count // 2 - 1] >= CLEARANCE)
    opti.subject_to(opti.bounded(-TORQUE, casadi.vec(u), TORQUE))
    cost += h * (casadi.sumsqr(u / TORQUE) + 1e-5 * casadi.sumsqr(a))
    for variable, value in zip((q, v), guess(number, count), strict=True):
        opti.set_initial(variable, value)
    pieces.append((q, v, u, f, h))

(q1, v1, *_), (q2, v2, *_), (q3, v3, *_) = pieces
trunk_only = [names.index(name) for name in ("x", "y", "z", "yaw", "pitch", "roll")]
opti.subject_to(q1[:, 0] == standing)
opti.subject_to(v1[:, 0] == 0)
opti.subject_to(q3[trunk_only, -1] == landed[trunk_only])  # the feet hold the legs
opti.subject_to(v3[trunk_only, -1] == 0)
opti.subject_to(q2[:, 0] == q1[:, -1])
opti.subject_to(v2[:, 0] == v1[:, -1])
opti.subject_to(q3[:, 0] == q2[:, -1])
v_plus, impulses = impact(q2[:, -1], v2[:, -1])
opti.subject_to(v3[:, 0] == v_plus)
opti.subject_to(cone(impulses) >= 0)
opti.subject_to(casadi.vec(points(q2[:, -1], v2[:, -1])[0] - after) == 0)
opti.minimize(cost)
opti.solver("ipopt", {"print_time": False}, {"print_level": 0, "sb": "yes", "max_iter": 300})
print(f"Problem ready after {time.perf_counter() - clock:.1f} s")
clock = time.perf_counter()
found = opti.solve()
print(f"{found.stats()['iter_count']} iterations in {time.perf_counter() - clock:.1f} s")
q, v, u, f = ([found.value(casadi.densify(row[k])) for row in pieces] for k in range(4))

# %% What holds by the physics alone
ways = [np.array(points.map(x.shape[1])(x, y)[0]) for x, y in zip(q, v, strict=True)]
stood = zip(ways[::2], (before, after), strict=True)
drift = max(np.abs(way - np.tile(home, (1, way.shape[1] // legs))).max() for way, home in stood)
print(f"Feet in stance move by: {drift:.1e} m")
A = mbs.models.inertia_matrix(system)
states = (q[1][:, -1], v[1][:, -1]), (q[2][:, 0], v[2][:, 0])
came, left = (float(y @ np.array(A(x)) @ y) / 2 for x, y in states)
print(f"Energy lost in the impact: {came - left:.2f} J of {came:.2f} J")
pressed = np.hstack([f[0], f[2], np.array(found.value(impulses))])
slope = (np.hypot(*pressed[:2]) / pressed[2])[pressed[2] > 1e-3].max()
print(f"Largest slope of a force or impulse: {slope:.3f} of 0.6")
print(f"Largest torque / limit: {max(np.abs(x).max() for x in u) / TORQUE:.3f}")

# %% The flight again: the same torques, direct dynamics and Runge and Kutta's method
x, w, tau = casadi.SX.sym("x", 2 * size), casadi.SX.sym("w", len(motors)), casadi.SX(size, 1)
tau[motors] = w
rate = casadi.vertcat(x[size:], phases.accelerations(())(x[:size], x[size:], tau)[0])
fly = mbs.bridges.step(casadi.Function("ode", [x, w], [rate], {"cse": True}), 5)
state = np.concatenate([q[1][:, 0], v[1][:, 0]])
for effort in u[1].T:
    state = fly(state, effort, [], pieces[1][4])
missed = np.abs(np.array(state).ravel()[:size] - q[1][:, -1])
print(
    f"Flight, simulated with these torques: {missed[:3].max():.1e} m and {missed[3:].max():.1e} rad"
)

# %% Draw it
figure = Figure(figsize=(10, 4.6), layout="constrained")
grid = figure.add_gridspec(2, 2, width_ratios=(1.5, 1))
drawing = figure.add_subplot(grid[:, 0], projection="3d")
joints = {
    part: mbs.models.transform(system, part)
    for leg in HIPS
    for part in (f"{leg}_bracket", f"{leg}_lower", f"{leg}_foot")
}
shown = (q[0][:, 0], "0.75"), (q[1][:, 3], "tab:blue"), (q[2][:, -1], "0.0")
for configuration, shade in shown:
    where = {part: np.array(frame(configuration))[:3, 3] for part, frame in joints.items()}
    for leg in HIPS:
        bones = [where[f"{leg}_{part}"] for part in ("bracket", "lower", "foot")]
        drawing.plot(*np.transpose(bones), color=shade, linewidth=1.2)
    corners = [
        where[f"{leg}_bracket"]
        for leg in ("front_left", "front_right", "hind_right", "hind_left", "front_left")
    ]
    drawing.plot(*np.transpose(corners), color=shade, linewidth=2.5)
for number in range(legs):
    drawing.plot(*np.hstack([way[:, number::legs] for way in ways]), color="tab:red", linewidth=0.8)
drawing.set(xlabel="x [m]", ylabel="y [m]", zlabel="z [m]", yticks=(-0.2, 0, 0.2))
drawing.set(title="before, in the middle of the flight, and after")
drawing.set_aspect("equal")
drawing.view_init(elev=24, azim=-70)
drawing.tick_params(labelsize="x-small")
force, torque = (figure.add_subplot(grid[row, 1]) for row in (0, 1))
start = 0.0
for values, effort, (_, count, seconds) in zip(f, u, PLAN, strict=True):
    knots = np.linspace(start, start + seconds, count + 1)
    for number, leg in enumerate(HIPS):
        rows = np.reshape(values[2], (count, legs))[:, number]
        label = leg.replace("_", " ") if start == 0 else None
        force.stairs(rows, knots, color=f"C{number}", baseline=None, label=label)
    for row in effort / TORQUE:
        torque.stairs(row, knots, color="0.5", baseline=None, linewidth=0.8)
    start += seconds
force.set(title="force of the ground, vertical [N]")
force.legend(fontsize="x-small")
torque.set(title="torque / limit", xlabel="time [s]")
figure.savefig(folder / "quadruped.png", dpi=90)
print(f"\nFiles in {folder}: {', '.join(sorted(p.name for p in folder.iterdir()))}")
