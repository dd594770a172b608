"""Optimal control: instructions of a seven-joint arm, and problems beside other generators.

python benchmarks/ocp.py [--peer PYTHON] [--kin-dyn PYTHON] [--repeat N]

The first PYTHON has adam-robotics, the second cmeel-casadi-kin-dyn; without them their rows are
left out. Efforts of all are compared with ours first. Times of one run compare with each other
alone. The cache of compiled libraries is a new folder, so that the first build is really the first.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import casadi
import numpy as np
from casadi import SX, Function

sys.path.insert(0, str(Path(__file__).parent))
from ocp_peer import adam_inverse_dynamics, kin_dyn_inverse_dynamics
from ocp_problems import (
    Solved,
    StageDerivatives,
    acrobot_swing_up,
    panda_by_stages,
    panda_point_to_point,
)
from robots import panda_like, urdf

import mbs
from mbs import Mechanism
from mbs.components import Body, Revolute
from mbs.native import compiled


def instructions(idm: Function) -> tuple[int, int, int, int]:
    """Of tau, its Jacobian (n, 3n), the Hessian of y'tau (3n, 3n), and a product with it."""
    n = idm.size1_in(0)
    x, y, w = SX.sym("x", 3 * n), SX.sym("y", n), SX.sym("w", 3 * n)
    tau = idm(x[:n], x[n : 2 * n], x[2 * n :])
    H, gradient = casadi.hessian(casadi.dot(y, tau), x)
    product = casadi.jtimes(gradient, x, w)
    counts = []
    for inputs, output in (
        ([x], tau),
        ([x], casadi.jacobian(tau, x)),
        ([x, y], H),
        ([x, y, w], product),
    ):
        counts.append(Function("f", inputs, [output]).n_instructions())
    return tuple(counts)


def acrobot() -> Function:
    """(x, u) -> dx/dt of two rods, the motor at the elbow."""
    m = Mechanism("acrobot", gravity=(0, -9.81, 0))
    before = m.world
    for name in ("shoulder", "elbow"):
        rod = m.add(Body(f"{name}_rod", mass=1, com=(0.5, 0, 0), inertia=(1e-9, 1 / 12, 1 / 12)))
        m.connect(before, Revolute(name, actuated=name == "elbow"), rod)
        before = rod.at(1.0)
    d = mbs.models.dae(m.assemble())
    return Function("rates", [d.x, d.u], [d.ode])


def arm(folder: Path) -> tuple[Function, Path, list[str]]:
    """The inverse dynamic model of the arm, its URDF file and the names of its joints."""
    file = folder / "panda_like.urdf"
    file.write_text(urdf("panda_like", panda_like()), encoding="utf-8")
    system = mbs.load(str(file)).assemble()
    return (
        mbs.models.inverse_dynamics(system),
        file,
        [row.joint for row in system.velocity_coordinates],
    )


def print_counts(contenders: dict[str, Function]) -> None:
    """The table of instructions."""
    found = {name: instructions(idm) for name, idm in contenders.items()}
    print("| instructions | tau | Jacobian | Hessian of y'tau | product with it |")
    print("|---|---|---|---|---|")
    for name, row in found.items():
        print(f"| {name} | " + " | ".join(f"{value:,}" for value in row) + " |")
    for peer in [name for name in found if name != "mbs"]:
        ratios = (b / a for a, b in zip(found["mbs"], found[peer], strict=True))
        print(f"| {peer} / mbs | " + " | ".join(f"{ratio:.1f}" for ratio in ratios) + " |")


def require_same(contenders: dict[str, Function]) -> None:
    """Refuse contenders whose efforts are not those of mbs, at three random states."""
    rng, ours = np.random.default_rng(0), contenders["mbs"]
    for state in rng.uniform(-1, 1, (3, 3, ours.size1_in(0))):
        expected = np.array(ours(*state))
        for name, idm in contenders.items():
            if not np.allclose(np.array(idm(*state)), expected, rtol=1e-9, atol=1e-9):
                raise ValueError(f"{name} gives other efforts")


def print_problem(name: str, stage: float, solved: Solved) -> None:
    """A row of the table of problems."""
    cells = [f"{stage:.2f}", f"{solved.build:.2f}", f"{solved.optimum:.4f}", solved.iterations]
    cells += [f"{solved.solve:.3f}", f"{solved.functions:.3f}"]
    print(f"| {name} | " + " | ".join(map(str, cells)) + " |", flush=True)


def timed(make: Any, *arguments: Any, **options: Any) -> tuple[Any, float]:
    """What is made, and the seconds that it took."""
    begin = time.perf_counter()
    made = make(*arguments, **options)
    return made, time.perf_counter() - begin


def print_problems(contenders: dict[str, Function], repeat: int, longest: int) -> None:
    """The table of problems; longest is the number of iterations of the arm."""
    idm = contenders["mbs"]
    code, first = timed(compiled, idm, derivatives=2)
    _, later = timed(compiled, idm, derivatives=2)
    stages = {"interpreted": (idm, 0.0), "compiled": (code, first), "cached": (code, later)}
    for peer in [name for name in contenders if name != "mbs"]:
        stages[f"{peer}, interpreted"] = contenders[peer], 0.0
    print("\n| problem | stage s | solver s | optimum | iterations | solve s | functions s |")
    print("|---|---|---|---|---|---|---|")
    rates = acrobot()
    for evaluation, evaluate in (
        ("interpreted", Function),
        ("compiled", lambda f: compiled(f, derivatives=2)),
    ):
        print_problem(f"acrobot, {evaluation}", 0.0, acrobot_swing_up(rates, evaluate))
    for _ in range(repeat):
        for evaluation, (model, stage) in stages.items():
            print_problem(f"arm, {evaluation}", stage, panda_point_to_point(model, longest))
        for evaluation, evaluate in (
            ("interpreted", lambda f: f),
            ("compiled", lambda f: compiled(f, derivatives=0)),
        ):
            parts, stage = timed(StageDerivatives.of, idm, evaluate)
            print_problem(f"arm by stages, {evaluation}", stage, panda_by_stages(parts, longest))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--peer", help="a Python that has adam-robotics")
    parser.add_argument("--kin-dyn", help="a Python that has cmeel-casadi-kin-dyn")
    parser.add_argument("--counts", action="store_true", help="no problems, instructions alone")
    parser.add_argument("--repeat", type=int, default=1)
    parser.add_argument("--longest", type=int, default=1000, help="iterations of the arm")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        os.environ["MBS_CACHE_DIR"] = name
        (idm, file, joints), seconds = timed(arm, Path(name))
        print(f"description to inverse dynamic model: {seconds:.2f} s\n")
        contenders = {"mbs": idm}
        if given.peer:
            contenders["adam"] = adam_inverse_dynamics(given.peer, file, joints)
        if given.kin_dyn:
            contenders["casadi-kin-dyn"] = kin_dyn_inverse_dynamics(given.kin_dyn, file, joints)
        require_same(contenders)
        print_counts(contenders)
        if not given.counts:
            print_problems(contenders, given.repeat, given.longest)


if __name__ == "__main__":
    main()
