"""The closed mechanisms of the multibody benchmark library, and mbs's runs of them."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from math import pi
from typing import Any

import loops_references as references
import numpy as np
from plain_mechanism import PlainMechanism, plain

from mbs import Mechanism
from mbs.assembly import System
from mbs.loops.configuration import start
from mbs.models import transform
from mbs.models.state.signals import effort_function
from mbs.models.state.tree import FullState, full_state
from mbs.native import compiler_found
from mbs.robots import andrews_squeezer, bricard, flyball_governor, n_four_bar, simple_pendulum
from mbs.simulate.segments import integrate_segments
from mbs.simulate.tolerances import step_tolerances

Array = np.ndarray[Any, Any]


@dataclass(frozen=True, slots=True)
class Steps:
    """Two step sizes of each peer [s], the coarse one first."""

    exudyn: tuple[float, float]
    mujoco: tuple[float, float]


@dataclass(frozen=True, slots=True)
class Case:
    """A benchmark: mechanism, motion, outputs, and the steps that the peers take.

    Attributes:
        output: frame, or link, whose origin is compared.
        axes: which of its coordinates, in the base.
        reference: times -> (m, len(axes)).
        rows: times compared, beside the first.
        method: of mbs's integration.
    """

    name: str
    build: Callable[[], Mechanism]
    seconds: float
    output: str
    axes: slice
    reference: Callable[[Array], Array]
    steps: Steps
    v0: Mapping[str, float] = field(default_factory=dict)
    tau: Mapping[str, float] = field(default_factory=dict)
    rows: int = 100
    method: str = "dopri5"

    @property
    def times(self) -> Array:
        """(rows + 1,) [s]."""
        return np.linspace(0.0, self.seconds, self.rows + 1)


def four_bars(loops: int, exudyn: tuple[float, float], mujoco: tuple[float, float]) -> Case:
    """N windows, from upright with their tops at 1 m/s."""
    return Case(
        f"four-bar, N = {loops}",
        partial(n_four_bar, loops),
        10.0,
        "b0",
        slice(0, 2),
        references.windows(loops),
        Steps(exudyn, mujoco),
        v0={"a0": -1.0},
    )


XY = slice(0, 2)
CASES = {
    "pendulum": Case(
        "simple pendulum",
        simple_pendulum,
        10.0,
        "mass",
        XY,
        references.pendulum,
        Steps((2.5e-3, 1e-3), (5e-2, 2e-2)),
    ),
    "n1": four_bars(1, (4e-3, 1e-3), (2.5e-3, 1e-3)),
    "n2": four_bars(2, (2e-3, 1e-3), (2.5e-3, 1e-3)),
    "n10": four_bars(10, (5e-3, 2e-3), (4e-3, 2e-3)),
    "n40": four_bars(40, (1e-2, 5e-3), (4e-3, 2e-3)),
    "andrews": Case(
        "Andrews squeezer",
        andrews_squeezer,
        0.05,
        "theta",
        XY,
        references.squeezer,
        Steps((5e-5, 2e-5), (1e-4, 5e-5)),
        tau={"beta": 0.033},
    ),
    "bricard": Case(
        "Bricard",
        bricard,
        10.0,
        "P3",
        slice(0, 3),
        references.bricard,
        Steps((1e-2, 5e-3), (2e-2, 1e-2)),
    ),
    "governor": Case(
        "flyball governor",
        flyball_governor,
        10.0,
        "s",
        slice(2, 3),
        references.governor,
        Steps((5e-3, 2.5e-3), (2.5e-4, 1e-4)),
        method="rodas",
        v0={"spin": 2 * pi},
    ),
}


@dataclass
class Made:
    """What mbs makes of a case, and the seconds that each part took."""

    system: System
    state: FullState
    x0: Array
    seconds: dict[str, float]


def made(case: Case) -> Made:
    """Assemble, find the start, write the state equation, compile."""
    seconds: dict[str, float] = {}
    system = _timed(seconds, "assemble", lambda: case.build().assemble())
    x0 = _timed(seconds, "start", lambda: np.concatenate(start(system, None, case.v0, None)))
    state = _timed(
        seconds, "equation", lambda: full_state(system, effort_function(system, case.tau))
    )
    if not compiler_found():
        raise SystemExit("there is no C compiler; mbs is measured compiled")
    own = Made(system, state, x0, seconds)
    _timed(seconds, "compile", run(case, own, 1e-3, np.array([0.0, 1e-9])))
    return own


def run(case: Case, of: Made, tolerance: float, times: Array) -> Callable[[], Array]:
    """The integration that `mbs.simulate.run` makes, (m, nq + nv) states at times."""
    rtol, atol = step_tolerances(tolerance)
    options: dict[str, Any] = {"method": case.method, "rtol": rtol, "atol": atol}

    def states() -> Array:
        segments, stop = integrate_segments(
            of.system, lambda _: of.state, of.x0, times, np.zeros(0), **options
        )
        if stop is not None:
            raise stop
        return np.concatenate([segment.x for segment in segments])

    return states


def outputs(case: Case, system: System, states: Array) -> Array:
    """(m, len(axes)) what is compared with the reference."""
    names = [link.name for link in system.tree.links]
    frame = names.index(case.output) + 1 if case.output in names else case.output
    T = transform(system, frame).map(len(states))(states[:, : system.nq].T)
    places = np.array(T).reshape(4, len(states), 4)[:3, :, 3].T
    return places[:, case.axes]


def plain_of(case: Case, of: Made) -> PlainMechanism:
    """The mechanism at its start as numbers for twins."""
    nq = of.system.nq
    return plain(of.system, of.x0[:nq], of.x0[nq:], case.tau, case.output)


def _timed(seconds: dict[str, float], name: str, call: Callable[[], Any]) -> Any:
    start_time = time.perf_counter()
    result = call()
    seconds[name] = time.perf_counter() - start_time
    return result
