"""A crab moves a chain of N links and leaves it at rest: the least effort, for growing N.

Run it with `python examples/11_chain.py [folder]`; the picture goes to `build/chain` if no folder
is named. It needs matplotlib (`pip install "casadi-mbs[plot]"`).
"""

# %% N passive links hang from a crab on a rail; its motor is the only one
import sys
import time
from pathlib import Path

import casadi
import numpy as np
from matplotlib.figure import Figure

import mbs
from mbs.bridges import Grid, collocation, multiple_shooting
from mbs.components import Body, Prismatic, Revolute

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "build/chain")
folder.mkdir(parents=True, exist_ok=True)
LENGTH, MASS = 2.0, 2.0


def chain(count):
    """A crab of 2 kg with rods of 2 m and 2 kg in all."""
    m = mbs.Mechanism(f"chain{count}", gravity=(0, -9.81, 0))
    crab = m.add(Body("crab", mass=2))
    m.connect(m.world, Prismatic("rail", axis="x", actuated=True), crab)
    x, mass, above = LENGTH / count, MASS / count, crab
    for k in range(1, count + 1):
        inertia = mass * x**2 / 12
        rod = m.add(Body(f"rod{k}", mass=mass, com=(0, -x / 2, 0), inertia=(inertia, 0, inertia)))
        m.connect(above, Revolute(f"j{k}", axis="z", actuated=False), rod)
        above = rod.at(0, -x, 0)
    m.add_frame("end", above)
    return m.assemble()


# %% 3 m to the side in 2.5 s, all at rest at both ends
STAGES, DURATION, WAY = 40, 2.5, 3.0


def least_effort(system, transcription, **options):
    """States, efforts and cost."""
    clock = time.perf_counter()
    dae = mbs.models.dae(system)
    opti = casadi.Opti()
    way = transcription(opti, dae, Grid(stages=STAGES, duration=DURATION), **options)
    there = np.zeros(dae.x.numel())
    there[0] = WAY
    opti.subject_to(way.x[:, 0] == 0)
    opti.subject_to(way.x[:, -1] == there)
    opti.minimize(way.integral(way.u**2))
    way.guess(np.linspace(0 * there, there, STAGES + 1).T)
    opti.solver("ipopt", {"print_time": False}, {"print_level": 0, "sb": "yes"})
    ready, clock = time.perf_counter() - clock, time.perf_counter()
    found = opti.solve()
    seconds, count = time.perf_counter() - clock, found.stats()["iter_count"]
    cost = found.value(opti.f)
    name = transcription.__name__
    print(f"{name}: ready in {ready:.1f} s, {count} iterations in {seconds:.2f} s")
    return found.value(way.x), found.value(way.u), cost


results = {}
for count in (1, 2, 4):
    system = chain(count)
    results[count] = least_effort(system, multiple_shooting, substeps=4)
    cost = results[count][2]
    links = "1 link" if count == 1 else f"{count} links"
    print(f"{links}: cost {cost:.3f} N2 s")
    *_, other = least_effort(system, collocation, points=3, scheme="legendre")
    print(f"{links}: shooting - collocation: {cost - other:.5f} N2 s")
largest, *_ = results[max(results)]

# %% Draw it
figure = Figure(figsize=(10, 4.2), layout="constrained")
drawing, forces = figure.subplots(1, 2, width_ratios=(1.6, 1))
count = max(results)
for k in range(0, STAGES + 1, 4):
    angles = np.cumsum(largest[1 : count + 1, k])
    x = np.concatenate(
        [[largest[0, k]], largest[0, k] + np.cumsum(np.sin(angles)) * LENGTH / count]
    )
    y = np.concatenate([[0], -np.cumsum(np.cos(angles)) * LENGTH / count])
    drawing.plot(x, y, "o-", markersize=3, color=str(0.8 - 0.8 * k / STAGES))
drawing.plot([-0.3, WAY + 0.3], [0, 0], color="0.7", linewidth=4, zorder=0)
drawing.set(aspect="equal", xlabel="x [m]", ylabel="y [m]", title=f"{count} links, grey to black")
times = np.linspace(0, DURATION, STAGES + 1)
for number, (_, u, _) in results.items():
    forces.stairs(u, times, baseline=None, label="1 link" if number == 1 else f"{number} links")
forces.set(xlabel="time [s]", title="force on the crab [N]")
forces.legend()
figure.savefig(folder / "chain.png", dpi=90)
print(f"\nFiles in {folder}: {', '.join(sorted(p.name for p in folder.iterdir()))}")
