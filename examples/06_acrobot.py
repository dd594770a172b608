"""Swing-up of an acrobot with the least effort, by multiple shooting.

Run it with `python examples/06_acrobot.py [folder]`; the picture goes to `build/acrobot` if no
folder is named. It needs matplotlib (`pip install "casadi-mbs[plot]"`).
"""

# %% Two unit rods of 1 kg, a motor at the elbow alone
import sys
import time
from pathlib import Path

import casadi
import numpy as np
from matplotlib.figure import Figure

import mbs
from mbs.bridges import Grid, multiple_shooting, step
from mbs.components import Body, Revolute

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "build/acrobot")
folder.mkdir(parents=True, exist_ok=True)

m = mbs.Mechanism("acrobot", gravity=(0, -9.81, 0))
upper, lower = (
    m.add(Body(name, mass=1, com=(0.5, 0, 0), inertia=(0, 1 / 12, 1 / 12)))
    for name in ("upper", "lower")
)
m.connect(m.world, Revolute("shoulder", actuated=False), upper)
m.connect(upper.at(1.0), Revolute("elbow", actuated=True), lower)
system = m.assemble()

# %% The problem: from hanging to upright in 4 s, both at rest
STAGES, DURATION, LIMIT = 60, 4.0, 30.0
hanging, upright = np.array([-np.pi / 2, 0, 0, 0]), np.array([np.pi / 2, 0, 0, 0])


def swing_up(code):
    """States, torques and cost."""
    opti = casadi.Opti()
    grid = Grid(stages=STAGES, duration=DURATION, code=code)
    way = multiple_shooting(opti, mbs.models.dae(system), grid)
    opti.subject_to(way.x[:, 0] == hanging)
    opti.subject_to(way.x[:, -1] == upright)
    opti.subject_to(opti.bounded(-LIMIT, way.u, LIMIT))
    opti.minimize(way.integral(way.u**2))
    way.guess(np.linspace(hanging, upright, STAGES + 1).T)
    options = {"print_time": False, "detect_simple_bounds": True}
    opti.solver("ipopt", options, {"print_level": 0, "sb": "yes"})
    start = time.perf_counter()
    found = opti.solve()
    seconds, count = time.perf_counter() - start, found.stats()["iter_count"]
    print(f"{code}: {count} iterations in {seconds:.2f} s")
    return (found.value(value) for value in (way.x, way.u, opti.f))


x, u, cost = swing_up("compiled")
*_, again = swing_up("interpreted")
print(f"Least integral of the torque squared - 53.527: {cost - 53.527:.4f} N2 m2 s")
print(f"Compiled - interpreted: {cost - again:.1e} N2 m2 s")

# %% A step a stage is coarse: where a hundred would lead from the same knots
fine = step(mbs.models.dae(system), 100).map(STAGES)
ends = np.array(fine(x[:, :-1], u.reshape(1, -1), [], DURATION / STAGES))
print(f"Largest error of an angle in a stage: {np.abs(ends - x[:, 1:])[:2].max():.3f} rad")

# %% Draw it
figure = Figure(figsize=(10, 4.2), layout="constrained")
drawing, torque = figure.subplots(1, 2)
for k in range(0, STAGES + 1, 3):
    first = x[0, k]
    joints = np.cumsum(
        [(0, 0), *((np.cos(a), np.sin(a)) for a in (first, first + x[1, k]))], axis=0
    )
    drawing.plot(*joints.T, "o-", color=str(0.85 - 0.85 * k / STAGES), markersize=3)
drawing.set(aspect="equal", xlabel="x [m]", ylabel="y [m]", title="Acrobot, grey to black in time")
times = np.linspace(0, DURATION, STAGES + 1)
torque.stairs(u, times, baseline=None, label="torque of the elbow [N m]")
for name, row in zip(("shoulder", "elbow"), x, strict=False):
    torque.plot(times, row, label=f"{name} [rad]")
torque.set(xlabel="time [s]", title=f"Cost {cost:.3f} N2 m2 s")
torque.legend()
figure.savefig(folder / "acrobot.png", dpi=90)
print(f"\nFiles in {folder}: {', '.join(sorted(p.name for p in folder.iterdir()))}")
