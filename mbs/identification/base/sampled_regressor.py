"""Numbers of the dynamic regressor in random states."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from casadi import Function
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.identification.base.states import States
from mbs.identification.regressors.columns import Column, every_column, numbers_among
from mbs.identification.regressors.dynamic import regressor

Array = NDArray[np.float64]


def sampled_regressor(system: System, columns: Sequence[Column], states: States, p: Array) -> Array:
    """(rows, columns) the regressor in all states, one below the other.

    The regressor with all columns of these kinds is kept for the next choice of columns.

    Args:
        system: open or closed.
        columns: parameters of the system.
        states: those to take.
        p: (np,) parameters of the system.

    Raises:
        ModelError: a column is no parameter of the system.
    """
    every = every_column(system, columns)
    numbers = numbers_among(system, every, columns)
    D = regressor(system, every, moving_base=states.base is not None)
    inputs = [states.q, states.v, states.a, *(states.base or ())]
    inputs += [np.tile(p[:, None], (1, states.count))] if system.parameters else []
    W = np.array(Function(D).map(states.count)(*inputs))
    rows = W.reshape(-1, states.count, len(every)).transpose(1, 0, 2).reshape(-1, len(every))
    return rows[:, numbers]
