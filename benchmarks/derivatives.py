"""Operations of the derivatives of inverse dynamics: recursions beside differentiation.

python benchmarks/derivatives.py

Three ways to dtau/dq, dtau/dv, dtau/da and tau: CasADi's Jacobian of the model, method "ad", whose
inertia matrix comes from composite bodies, and method "analytical". Multiplications (divisions
among them) + additions, numbers for all parameters, sines and cosines not counted. Seconds of
processor time are those to build the last two.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import casadi
from casadi import SX, Function

import mbs
from mbs import Mechanism
from mbs.assembly import System
from mbs.components import Body, Revolute
from mbs.models import inverse_dynamics, inverse_dynamics_derivatives
from mbs.operations import count

sys.path.insert(0, str(Path(__file__).parent))
from robots import chain, iiwa, panda_like, quadruped, urdf

NAMES = {
    "panda": "Panda, catalogue",
    "puma560": "PUMA 560, catalogue",
    "rx90": "RX90, catalogue",
    "iiwa": "7R, iiwa",
    "panda_like": "7R, Panda geometry",
    "chain": "chain of 12",
    "quadruped": "quadruped, free base + 4 x 3",
    "fingers": "four planar fingers of two joints",
}


def fingers() -> System:
    """Four planar chains of two links side by side."""
    m = Mechanism("fingers", gravity=(0, -9.81, 0))
    for number in range(4):
        before = m.world.at(0, 0, 0.1 * number)
        for k in (1, 2):
            name = f"{number}_{k}"
            body = m.add(Body(f"b{name}", mass=1, com=(0.3, 0.05, 0), inertia=(0.01, 0.02, 0.03)))
            m.connect(before, Revolute(f"j{name}", axis="z"), body)
            before = body.at(0.7)
    return m.assemble()


def from_urdf(links: list, folder: Path, name: str) -> System:  # type: ignore[type-arg]
    """The system of a list of links."""
    file = folder / f"{name}.urdf"
    file.write_text(urdf(name, links), encoding="utf-8")
    return mbs.load(str(file)).assemble()


def jacobian(system: System) -> Function:
    """CasADi's own Jacobian of the model, element by element of q, and the model."""
    sizes = (("q", system.nq), ("v", system.nv), ("a", system.nv))
    inputs = [SX.sym(name, size) for name, size in sizes]
    tau = inverse_dynamics(system)(*inputs)
    slopes = [casadi.densify(casadi.jacobian(tau, x)) for x in inputs]
    return Function("jacobian", inputs, [*slopes, tau], {"cse": True})


def row(title: str, system: System) -> str:
    """A row of the table."""
    cells, seconds, prices = [_text(inverse_dynamics(system)), _text(jacobian(system))], 0.0, {}
    for method in ("ad", "analytical"):
        begin = time.process_time()
        model = inverse_dynamics_derivatives(system, method)
        seconds += time.process_time() - begin
        prices[method] = count(model).price
        cells.append(_text(model))
    taken = count(inverse_dynamics_derivatives(system)).price
    chosen = [method for method, price in prices.items() if price == taken]
    cells += [" or ".join(chosen), f"{seconds:.1f}"]
    return f"| {title} | {system.nv} | " + " | ".join(cells) + " |"


def _text(model: Function) -> str:
    found = count(model)
    return f"{found.mul + found.div} + {found.add}"


def main() -> None:
    """Print the table."""
    print('| robot | velocities | tau | CasADi\'s Jacobian | "ad" | "analytical" | "auto" | s |')
    print("|---" * 8 + "|")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        systems: dict[str, Callable[[], System]] = {
            "puma560": lambda: mbs.load("puma560").assemble(),
            "rx90": lambda: mbs.load("rx90").assemble(),
            "panda": lambda: mbs.load("panda").assemble(),
            "iiwa": lambda: from_urdf(iiwa(), folder, "iiwa"),
            "panda_like": lambda: from_urdf(panda_like(), folder, "panda_like"),
            "chain": lambda: from_urdf(chain(12), folder, "chain"),
            "quadruped": lambda: from_urdf(quadruped(), folder, "quadruped"),
            "fingers": fingers,
        }
        for key, make in systems.items():
            print(row(NAMES[key], make()), flush=True)


if __name__ == "__main__":
    main()
