"""Every configuration of a PUMA 560 for one pose, the path of a straight line, and the equations.

Run it with `python examples/03_inverse_geometry.py [folder]`; files go to
`build/inverse_geometry` if no folder is named. It needs matplotlib
(`pip install "casadi-mbs[plot]"`).
"""

# %% A pose, and every configuration that takes it
import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import mbs

igm = mbs.models.inverse_geometry
system = mbs.load("puma560").assemble()
folder = Path(sys.argv[1] if len(sys.argv) > 1 else "build/inverse_geometry")
folder.mkdir(parents=True, exist_ok=True)

q = np.array([0.2, -0.2, 2.2, 0.3, 0.8, 0.4])
pose = mbs.models.direct_geometry(system)
T = np.array(pose(q))
solutions = igm.solve(system, T, seed=q)
print(solutions)
worst = max(np.abs(np.array(pose(solution.q)) - T).max() for solution in solutions)
print(f"\nLargest pose(q) - T: {worst:.1e}")
print(f"Nearest solution - q: {np.abs(solutions[0].q - q).max():.1e} rad")

# %% The same as a Function without iteration, exported, and as equations to read
function = igm.function(system)
back = min(np.abs(np.array(function(T, b)[0]).ravel() - q).max() for b in range(function.branches))
print(f"Function igm(T, branch) - q: {back:.1e} rad")
(folder / "igm.c").write_text(mbs.export.code(function, "c"), encoding="utf-8")
(folder / "equations.txt").write_text(igm.text(system), encoding="utf-8")


# %% A straight line of the hand, followed on one branch
def line(s):
    """The pose at a part s of the way, 0.2 m along y."""
    way = T.copy()
    way[1, 3] -= 0.2 * s
    return way


path = igm.follow(system, line, q, samples=41)
print(f"Line of 0.2 m: {path.reached + 1} of 41 poses; {path.reason or 'followed to its end'}")
print(f"Largest residual on the line: {path.residual.max():.1e}")

# %% Draw the configurations and the line
frames = [mbs.models.transform(system, number) for number in range(len(system.tree.links) + 1)]
figure = Figure(figsize=(10.5, 7.2))
grid = figure.add_gridspec(3, 4, height_ratios=(1, 1, 0.8), hspace=0.25, wspace=0.05)
figure.subplots_adjust(left=0.07, right=0.9, bottom=0.08, top=0.93)
for k, solution in enumerate(solutions):
    axes = figure.add_subplot(grid[k // 4, k % 4], projection="3d")
    origins = [np.array(frame(solution.q))[:3, 3] for frame in frames]
    hand = T[:3, 3] + 0.15 * T[:3, 2]
    x, y, z = np.array([*origins, hand]).T
    axes.plot(x, y, z, "o-", linewidth=3, markersize=4)
    axes.plot([0, 0], [0, 0], [-0.5, 0], color="0.7", linewidth=6)
    for axis, color in zip(T[:3, :3].T, ("tab:red", "tab:green", "tab:blue"), strict=True):
        ends = np.array([T[:3, 3], T[:3, 3] + 0.2 * axis]).T
        axes.plot(*ends, color=color, linewidth=1)
    axes.set(xlim=(-0.2, 0.8), ylim=(-0.5, 0.5), zlim=(-0.5, 0.5))
    axes.set(xticklabels=[], yticklabels=[], zticklabels=[])
    axes.set_title(solution.branch.replace(", ", "\n", 1), fontsize="small")
    axes.set_box_aspect((1, 1, 1), zoom=1.3)
    axes.view_init(elev=15, azim=-110)
joints = figure.add_subplot(grid[2, :])
for k, name in enumerate(coordinate.name for coordinate in system.coordinates):
    joints.plot(np.linspace(0, 0.2, 41)[: len(path.q)], path.q[:, k], label=name)
joints.set(xlabel="way of the hand along -y [m]", ylabel="joint [rad]", title="straight line")
joints.grid(alpha=0.3)
joints.legend(loc="center left", bbox_to_anchor=(1, 0.5), fontsize="small")
figure.savefig(folder / "configurations.png", dpi=90)
print(f"\nFiles in {folder}: {', '.join(sorted(p.name for p in folder.iterdir()))}")
