"""A four-bar linkage moved with the least effort, with its loop solved and with its loop kept.

Run it with `python examples/08_four_bar_motion.py [folder]`; the picture goes to
`build/four_bar_motion` if no folder is named. It needs matplotlib
(`pip install "casadi-mbs[plot]"`).
"""

# %% A crank-rocker in gravity: thin rods
import sys
from pathlib import Path

import casadi
import numpy as np
from matplotlib.figure import Figure

import mbs
from mbs.bridges import Grid, collocation, constraint_residuals
from mbs.components import Body, Revolute

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "build/four_bar_motion")
folder.mkdir(parents=True, exist_ok=True)

m = mbs.Mechanism("four_bar", gravity=(0, -9.81, 0))
crank, coupler, rocker = (
    m.add(Body(name, mass=mass, com=(x / 2, 0, 0), inertia=(0, mass * x**2 / 12, mass * x**2 / 12)))
    for name, x, mass in (("crank", 0.25, 1), ("coupler", 0.8, 3), ("rocker", 0.7, 2))
)
m.connect(m.world, Revolute("j1", actuated=True), crank)
m.connect(crank.at(0.25), Revolute("j2"), coupler)
m.connect(coupler.at(0.8), Revolute("j3"), rocker.at(0.7))
m.connect(m.world.at(1.0), Revolute("j4"), rocker)
m.add_frame("pin", crank.at(0.25))
m.add_frame("end", coupler.at(0.8))
m.add_frame("tracer", coupler.at(0.4, 0.3))
system = m.assemble(guess={"j1": 0.3, "j2": 0.8, "j4": 1.5})

# %% The crank turns by 4 rad in 1 s, from rest to rest
STAGES, FROM, TO = 40, 0.3, 4.3


def least_effort(form):
    """The problem in a form of the equations of motion, solved."""
    angles = np.linspace(FROM, TO, STAGES + 1)
    starts = [mbs.models.dae(system, form, q0={"j1": q}, v0={"j1": TO - FROM}) for q in angles]
    dae = starts[0]
    opti = casadi.Opti()
    way = collocation(opti, dae, Grid(stages=STAGES, duration=1.0))
    names = [name for name, _ in dae.elements["x"]]
    moved = [names.index("j1.q"), names.index("j1.v")]
    closed = constraint_residuals(dae, way.x[:, 0], way.p)
    if closed.numel():
        opti.subject_to(closed == 0)
    opti.subject_to(way.x[moved, 0] == [FROM, 0])
    opti.subject_to(way.x[moved, -1] == [TO, 0])
    opti.subject_to(opti.bounded(-200, way.u, 200))
    opti.minimize(way.integral(way.u_points**2))
    way.guess(np.transpose([start.x0 for start in starts]))
    opti.solver("ipopt", {"print_time": False}, {"print_level": 0, "sb": "yes"})
    found = opti.solve()
    configuration = casadi.Function("configuration", [dae.x, dae.p], [dae.q, dae.v])
    q, _ = configuration.map(STAGES + 1)(found.value(way.x), casadi.repmat(dae.p0, 1, STAGES + 1))
    return found.value(opti.f), found.stats()["iter_count"], np.array(q), found.value(way.u)


results = {form: least_effort(form) for form in ("reduced", "index2", "ggl")}
for form, (cost, iterations, *_) in results.items():
    print(f"{form}: least integral of the torque squared - 28.1827: {cost - 28.1827:.5f}")
    print(f"{form}: {iterations} iterations")
q, u = results["reduced"][2:]
gap = np.abs(np.exp(1j * results["ggl"][2]) - np.exp(1j * q)).max()  # whole turns do not count
print(f"Largest difference of positions between reduced and ggl: {gap:.1e} rad")

# %% Draw it
figure = Figure(figsize=(10, 4.2), layout="constrained")
drawing, torque = figure.subplots(1, 2)
frames = [mbs.models.transform(system, name) for name in ("pin", "end", "tracer")]
points = np.array(
    [[np.array(frame(q[:, k]))[:2, 3] for frame in frames] for k in range(STAGES + 1)]
)
for k in range(0, STAGES + 1, 8):
    shade = str(0.8 - 0.8 * k / STAGES)
    line = np.array([(0, 0), points[k, 0], points[k, 1], (1, 0)])
    drawing.plot(*line.T, "o-", color=shade, markersize=3)
    drawing.plot(*points[k][[0, 2, 1]].T, color=shade, linewidth=0.7)
drawing.plot(*points[:, 2].T, color="tab:blue", label="point of the coupler")
drawing.set(aspect="equal", xlabel="x [m]", ylabel="y [m]", title="Four-bar, grey to black in time")
drawing.legend(loc="lower right")
torque.stairs(u, np.linspace(0, 1, STAGES + 1), label="torque of the crank [N m]", baseline=None)
torque.axhline(0, color="0.8", linewidth=0.7)
torque.set(xlabel="time [s]", title=f"Least effort: {results['reduced'][0]:.4f} N2 m2 s")
torque.legend()
figure.savefig(folder / "four_bar_motion.png", dpi=90)
print(f"\nFiles in {folder}: {', '.join(sorted(p.name for p in folder.iterdir()))}")
