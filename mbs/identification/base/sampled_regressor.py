"""Numbers of the dynamic regressor in random states."""

from __future__ import annotations

from collections.abc import Sequence

import casadi
import numpy as np
from casadi import SX, Function
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.errors import ModelError
from mbs.identification.base.application import with_parameters
from mbs.identification.base.states import States
from mbs.identification.columns import Column
from mbs.identification.regressor import Regressor, regressor
from mbs.messages import did_you_mean
from mbs.models.inverse_dynamics import tree_efforts
from mbs.models.surroundings import surroundings
from mbs.models.symbols import symbols_of

Array = NDArray[np.float64]


def sampled_regressor(system: System, columns: Sequence[Column], states: States, p: Array) -> Array:
    """(rows, columns) the regressor in all states, one below the other.

    Raises:
        ModelError: a column is no parameter of the system.
    """
    D = whole_regressor(system, columns)
    names = [column.name for column in D.columns]
    unknown = next((column.name for column in columns if column.name not in names), None)
    if unknown is not None:
        raise ModelError(
            f"{system.name}: {unknown!r} is no parameter of the system;"
            f" {did_you_mean(unknown, names)}"
        )
    W = _stacked(D, states, [states.q, states.v, states.a], p, len(names))
    return W[:, [names.index(column.name) for column in columns]]


def whole_regressor(system: System, columns: Sequence[Column]) -> Regressor:
    """The regressor that has these columns, and others perhaps."""
    pairs = [(column.link, column.other) for column in columns if column.other]
    return regressor(
        system,
        offsets=any(column.kind == "offset" for column in columns),
        couplings=list(dict.fromkeys(pairs)),
    )


def sampled_on_moving_base(
    system: System, columns: Sequence[Column], states: States, p: Array, seed: int
) -> Array:
    """(rows, columns) the regressor of the joint efforts while the base moves anyhow."""
    D = _on_moving_base(system, columns)
    count, rng = states.q.shape[1], np.random.default_rng(seed)
    moved = [rng.uniform(-3, 3, (6, count)), rng.uniform(-5, 5, (6, count))]
    turns = [np.linalg.qr(rng.standard_normal((3, 3)))[0] for _ in range(count)]
    R = np.hstack([turn * np.sign(np.linalg.det(turn)) for turn in turns])
    return _stacked(D, states, [states.q, states.v, states.a, *moved, R], p, len(columns))


def _stacked(D: Function, states: States, inputs: list[Array], p: Array, width: int) -> Array:
    count = states.q.shape[1]
    inputs = [*inputs, *([np.tile(p[:, None], (1, count))] if "p" in D.name_in() else [])]
    W = np.array(Function(D).map(count)(*inputs))
    return W.reshape(-1, count, width).transpose(1, 0, 2).reshape(-1, width)


def _on_moving_base(system: System, columns: Sequence[Column]) -> Function:
    def build() -> Function:
        K = SX.sym("K", len(columns))
        moved = with_parameters(system, columns, K)
        s = symbols_of(system)
        name, a = s.input("a")
        around = surroundings(moved, moves=True)
        tau = s.reduced_effort(tree_efforts(moved, s, s.tree_acceleration(a), around))
        D = casadi.densify(casadi.jacobian(tau, K))
        inputs = [s.q, s.v, a, *(value for _, value in around.inputs), system.p]
        names = ["q", "v", name, *(key for key, _ in around.inputs), "p"]
        return Function("moving_regressor", inputs, [D], names, ["D"], {"cse": True})

    function: Function = system.cached(("moving_regressor", tuple(columns)), build)
    return function
