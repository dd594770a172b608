"""A quadruped that is dropped on its feet: time, error and final pose, beside MuJoCo.

`python benchmarks/contact.py` needs mujoco. Both simulate the same bodies, joints and springs for
two seconds. MuJoCo's contacts are constraints with a softness of their own, which is chosen so
that the feet stand equally deep; between touch-down and rest the laws differ, so that each is
compared with its own motion at much smaller steps.
"""

from __future__ import annotations

import math
import sys
import time
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from mbs.loops.configuration import start as configuration
from mbs.models.state.tree import full_state
from mbs.simulate.crossings import with_crossings
from mbs.simulate.tolerances import step_tolerances
from mbs.solvers._integrate import IntegrationCode, run_problem
from mbs.solvers.problem import equations, problem

sys.path.append(str(Path(__file__).parents[1] / "tests"))
from support.contact_quadruped import (
    BENT,
    DAMPED,
    FOOT,
    HIPS,
    INERTIAS,
    LAW,
    LEG,
    MASSES,
    STRONG,
    quadruped,
    start,
)

Array = np.ndarray[Any, Any]
DURATION, ROWS, HEIGHT = 2.0, 100, 0.5
REPEATS = 7


def best(call: Any) -> tuple[Any, float]:
    """What a call gives, and the shortest of its times [s]."""
    times = []
    for _ in range(REPEATS):
        clock = time.perf_counter()
        found = call()
        times.append(time.perf_counter() - clock)
    return found, min(times)


# mbs: the heights of the trunk over time, and how deep the feet stand.


class Ours:
    """A system and its compiled state equation.

    Args:
        system: that falls.
        method: "dopri5" or "rodas".
    """

    def __init__(self, system: Any, method: str) -> None:
        state = full_state(system)
        self.x0 = np.concatenate(
            [*configuration(system, start(HEIGHT), None, None), system.component_start]
        )
        self.events, (rhs, project, _) = with_crossings(state, self.x0, (0.0, DURATION), (), ())
        self.functions = equations(rhs, project, method, self.events)
        self.code = IntegrationCode(self.functions, may_compile=True)
        if not self.code.compile():
            raise SystemExit("there is no C compiler; mbs is measured compiled")

    def run(self, tolerance: float) -> Array:
        """(m, nx) states, the integration alone."""
        times, control = np.linspace(0, DURATION, ROWS + 1), step_tolerances(tolerance)
        given = problem(self.functions, self.x0, times, None, self.events.modes, control, np.inf)
        motion = run_problem(given, self.code, None)
        if motion.stop is not None:
            raise motion.stop
        return motion.x

    def depths(self, x: Array) -> Array:
        """(4,) depths of the feet."""
        return np.array(self.events.indicators(0, x, np.ones(len(HIPS)))).ravel()


# MuJoCo: the same in its format.


def twin(stiffness: float, ratio: float = 1.0) -> Any:
    """The model; its contacts have a stiffness [1/s^2] and a ratio of critical damping."""
    solref = f"{-stiffness!r} {-2 * ratio * math.sqrt(stiffness)!r}"
    contact = f'solref="{solref}" solimp="0.9 0.9 0.001 0.5 2" friction="{LAW["friction"]} 0 0"'
    legs = []
    for leg, (x, y) in HIPS.items():
        upper, lower = (
            f'<inertial pos="0 0 {-LEG / 2}" mass="{MASSES[part]}"'
            f' diaginertia="{" ".join(map(str, INERTIAS[part]))}"/>'
            f'<joint type="hinge" axis="0 1 0" stiffness="{STRONG}" springref="{BENT[joint]}"'
            f' damping="{DAMPED}"/>'
            for part, joint in (("upper", "hip"), ("lower", "knee"))
        )
        legs.append(
            f'<body pos="{x} {y} 0">{upper}<body pos="0 0 {-LEG}">{lower}'
            f'<geom name="{leg}" type="sphere" size="{FOOT}" pos="0 0 {-LEG}" contype="1"'
            f' conaffinity="0" condim="3" {contact}/></body></body>'
        )
    return mujoco.MjModel.from_xml_string(
        '<mujoco><compiler angle="radian" autolimits="false"/>'
        '<option gravity="0 0 -9.81" integrator="implicitfast" cone="elliptic"/><worldbody>'
        f'<geom type="plane" size="1 1 1" contype="0" conaffinity="1" {contact}/>'
        f'<body><freejoint/><inertial pos="0 0 0" mass="{MASSES["trunk"]}"'
        f' diaginertia="{" ".join(map(str, INERTIAS["trunk"]))}"/>{"".join(legs)}</body>'
        "</worldbody></mujoco>"
    )


def theirs(model: Any, step: float, duration: float = DURATION) -> tuple[Array, Array]:
    """(m, 3) places of the trunk, and (4,) depths at the end."""
    data = mujoco.MjData(model)
    model.opt.timestep = step
    data.qpos[:] = [0, 0, HEIGHT, 1, 0, 0, 0, *([BENT["hip"], BENT["knee"]] * len(HIPS))]
    places = [data.qpos[:3].copy()]
    for _ in range(ROWS):
        mujoco.mj_step(model, data, round(duration / ROWS / step))
        places.append(data.qpos[:3].copy())
    feet = [data.geom(leg).xpos[2] for leg in HIPS]
    return np.array(places), FOOT - np.array(feet)


def as_soft(depth: float) -> Any:
    """The model whose feet stand at a mean depth [m]."""
    stiffness = 1e3
    for _ in range(8):
        _, depths = theirs(twin(stiffness), 1e-3, 4.0)
        stiffness *= float(depths.mean()) / depth
    return twin(stiffness)


def main() -> None:
    """Print a table of both."""
    row = "| {:34} | {:>9.1f} | {:>9.1e} | {:>8.5f} | {:>9.5f} | {:>8.3f} |".format
    print("| | real time | error [m] | z [m] | x [m] | depth [mm] |\n|---|---|---|---|---|---|")
    soft = 0.0
    for law in ("bristle", "regularised"):
        system = quadruped(friction_law=law)
        made = {method: Ours(system, method) for method in ("dopri5", "rodas")}
        exact = made["dopri5"].run(1e-10)[:, :3]
        for method, tolerance in (("dopri5", 1e-3), ("dopri5", 1e-6), ("rodas", 1e-3)):
            mine = made[method]
            x, seconds = best(lambda m=mine, tol=tolerance: m.run(tol))
            error, end, depth = np.abs(x[:, :3] - exact).max(), x[-1], mine.depths(x[-1]).mean()
            soft = soft or float(depth)
            name = f"mbs, {law}, {method}, {tolerance:g}"
            print(row(name, DURATION / seconds, error, end[2], end[0], 1e3 * depth), flush=True)
    model = as_soft(soft)
    exact, _ = theirs(model, 1e-5)
    for step in (2e-3, 1e-3, 1e-4):
        (places, depths), seconds = best(lambda h=step: theirs(model, h))
        error, end = np.abs(places - exact).max(), places[-1]
        name = f"MuJoCo {mujoco.__version__}, step {step:g} s"
        print(row(name, DURATION / seconds, error, end[2], end[0], 1e3 * depths.mean()))


if __name__ == "__main__":
    main()
