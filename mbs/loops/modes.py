"""Every posture that closes the loops for given positions of the independent joints."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from mbs.assembly import System
from mbs.errors import LoopError
from mbs.loops.closed_form.places import extent, independent_places
from mbs.loops.closed_form.plan import plan
from mbs.loops.closed_form.stage import every_posture
from mbs.loops.closing import CLOSED, Closing, Vector, closure_parameters
from mbs.loops.independent import Given, independent_positions

_SAME = 1e-9
_MOST = 4096


@dataclass(frozen=True, slots=True)
class Mode:
    """One way to assemble a mechanism.

    Attributes:
        q: (nq) the posture [rad or m], angles that a loop gives are within half a turn
            of zero.
        branch: what tells it from the others, such as ("j3:+",); one label for each loop that
            closes in two ways.
        residual: largest closure row there.
    """

    q: tuple[float, ...]
    branch: tuple[str, ...]
    residual: float


def modes(
    system: System,
    q_active: Given = None,
    *,
    parameters: Mapping[str, float] | None = None,
) -> list[Mode]:
    """All postures with these positions of the independent joints, by closed forms.

    Each is checked with every closure row and for joints that face the right way. The list is
    empty where the mechanism cannot be assembled; two modes that meet are listed once.

    Args:
        system: the assembled mechanism.
        q_active: positions of the independent joints, by name or in the order of
            `system.free`; those left out stay as in the assembled posture.
        parameters: values of symbols, the others at their defaults.

    Raises:
        NoClosedForm: a loop is solved by iteration only.
        LoopError: there are more than 4096 branches.
        ModelError: a joint is unknown or not independent, or a value is not finite.
    """
    stages = plan(system)
    count = math.prod(len(stage.labels) for stage in stages)
    if count > _MOST:
        raise LoopError(
            f"{system.name}: {count} branches are too many to list; name one in mbs.loops.solve"
        )
    p = closure_parameters(system, parameters)
    start = np.zeros(extent(system))
    start[independent_places(system)] = independent_positions(system, q_active)
    found: list[Mode] = []
    for q, branch in every_posture(stages, start, p):
        mode = _checked(system, q[: system.nq], branch, p)
        if mode is not None and not any(_same(mode, other) for other in found):
            found.append(mode)
    return found


def _checked(system: System, q: Vector, branch: tuple[str, ...], p: Vector) -> Mode | None:
    residual = 0.0
    if system.is_closed:
        closing = Closing(system, p)
        residual = float(np.max(np.abs(closing.rows(q)[0]), initial=0.0))
        if closing.openness(q) > CLOSED or not closing.faces(q):
            return None
    return Mode(tuple(float(x) for x in q), branch, residual)


def _same(mode: Mode, other: Mode) -> bool:
    return bool(np.max(np.abs(np.subtract(mode.q, other.q)), initial=0.0) < _SAME)
