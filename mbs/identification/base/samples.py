"""Numbers for the symbols of a system: what holds for several of them holds by structure."""

from __future__ import annotations

import casadi
import numpy as np
from casadi import SX, Function
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.identification.base.grouping import Sampled

Array = NDArray[np.float64]

_SEED = 20260411
_SPREAD = 0.05
_TRIES = 40


def default_parameters(system: System) -> Array:
    """(np,) values of the parameters, an irregular number for each that has none."""
    free = 0.4 + 0.6 * np.random.default_rng(_SEED).random(len(system.parameters))
    defaults = np.array(system.p_default, dtype=float)
    return np.where(np.isnan(defaults), free, defaults)


def parameter_samples(system: System, value: SX) -> list[Array]:
    """Values of the parameters: the defaults, then some near them where the value depends on them.

    Args:
        system: whose parameters they are.
        value: expression that must have a number at every sample.
    """
    first = default_parameters(system)
    if not casadi.symvar(value):
        return [first]
    rng = np.random.default_rng(_SEED)
    at = Function("value", [system.p], [casadi.densify(value)])
    found, reach = [first], _SPREAD
    for _ in range(_TRIES):
        trial = first * (1 + rng.uniform(-reach, reach, first.shape))
        trial += rng.uniform(-reach, reach, first.shape)
        if at(trial).is_regular():
            found.append(trial)
        reach *= 1.0 if at(trial).is_regular() else 0.5
        if len(found) == 4:
            break
    return found


def sampler(system: System) -> Sampled:
    """What evaluates scalars at samples of the parameters of a system."""

    def sampled(values: list[SX]) -> Array:
        column = casadi.vertcat(*values)
        if column.is_constant():
            return np.array(casadi.DM(column)).reshape(1, -1)
        at = Function("coefficients", [system.p], [casadi.densify(column)])
        return np.array([np.array(at(p)).ravel() for p in parameter_samples(system, column)])

    return sampled
