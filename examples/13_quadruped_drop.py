"""A quadruped falls on its feet, bounces and stands: contact with friction that holds.

Run it with `python examples/13_quadruped_drop.py [folder]`; the picture goes to `build/drop` if no
folder is named. It needs matplotlib (`pip install "casadi-mbs[plot]"`).
"""

# %% A trunk that moves freely, four legs of two joints with springs, and feet that are spheres
import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import mbs
from mbs.components import Body, Box, Free, Revolute, SpherePlaneContact

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "build/drop")
folder.mkdir(parents=True, exist_ok=True)
LEG, FOOT, SLOPE = 0.2, 0.02, 0.1
HIPS = {"front left": (0.4, 0.1), "front right": (0.4, -0.1), "hind left": (0, 0.1)}
HIPS["hind right"] = (0, -0.1)
BENT = {"hip": 0.6, "knee": -1.2}
CONTACT = {
    "radius": FOOT,
    "stiffness": 3e5,  # 1.7 mm deep under a quarter of the weight
    "restitution": 0.3,
    "impact_speed": 1.0,
    "friction": 0.6,
    "friction_law": "bristle",
}

m = mbs.Mechanism("quadruped", gravity=(0, 0, -9.81))
trunk = m.add(Box("trunk", length=0.4, width=0.2, height=0.1, mass=6))
m.connect(m.world, Free("free"), trunk)
ground = m.world.at(rotation=("y", SLOPE))
for leg, (x, y) in HIPS.items():
    above, name = trunk.at(x, y), leg.replace(" ", "_")
    for part, joint, mass in (("upper", "hip", 0.5), ("lower", "knee", 0.2)):
        i = mass * LEG**2 / 12
        bone = Body(f"{name}_{part}", mass=mass, com=(0, 0, -LEG / 2), inertia=(i, i, i / 20))
        spring = {"stiffness": 120, "rest": BENT[joint], "Fv": 3}
        m.connect(above, Revolute(f"{name}_{joint}", axis="y", **spring), m.add(bone))
        above = bone.at(0, 0, -LEG)
    m.add(SpherePlaneContact(f"{name}_foot", above, ground, **CONTACT))
system = m.assemble()
print(system.report())

# %% The fall, by the method for stiff equations
start = {f"{leg.replace(' ', '_')}_{joint}": angle for leg in HIPS for joint, angle in BENT.items()}
motion = mbs.simulate.run(
    system, 3.0, q0={"free.z": 0.5, **start}, method="rodas", tolerance=1e-6, step=0.005, quiet=True
)
feet = [f"{leg.replace(' ', '_')}_foot" for leg in HIPS]
forces = np.array([motion[f"{foot}.normal_force"] for foot in feet])
friction = np.array([motion[f"{foot}.friction_force"] for foot in feet])

# %% What holds by the physics alone
weight = 9.81 * (6 + 4 * 0.7)
carried = float(forces[:, -1].sum())
print(f"Normal forces at the end / weight - cos(slope): {carried / weight - np.cos(SLOPE):.1e}")
print(f"Largest friction / normal force: {(friction / np.maximum(forces, 1e-9)).max():.4f} of 0.6")
slip = max(motion[f"{foot}.slip"][-1] for foot in feet)
print(f"Fastest slip of a foot at the end: {slip:.1e} m/s")
second = motion.time > 2
creep = np.ptp(motion["free.x.q"][second])
print(f"Trunk moves in the last second by: {creep:.1e} m")
energy = motion["kinetic_energy"] + motion["potential_energy"]
print(f"Energy that is gained: {max(0, np.diff(energy).max()):.1e} J")

# %% Draw it
figure = Figure(figsize=(8, 4.5), layout="constrained")
height, force = figure.subplots(2, sharex=True)
height.plot(motion.time, motion["free.z.q"])
height.set(ylabel="height of the trunk [m]")
for leg, values in list(zip(HIPS, forces, strict=True))[::2]:  # the right ones have the same
    force.plot(motion.time, values, label=leg, linewidth=0.9)
force.axhline(weight / 4, color="0.6", linewidth=0.8)
force.set(xlabel="time [s]", ylabel="normal force [N]", xlim=(0, 1.5))
force.legend(fontsize="small")
figure.savefig(folder / "quadruped_drop.png", dpi=90)
print(f"\nFiles in {folder}: {', '.join(sorted(p.name for p in folder.iterdir()))}")
