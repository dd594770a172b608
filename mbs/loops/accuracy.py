"""Accuracy of second derivatives of the loops near singular configurations."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from casadi import DM, SX
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.assembly.model_function import ConfigurationCheck
from mbs.errors import SingularPosture
from mbs.loops.closing import Closing, distance_units
from mbs.loops.examination import LEAST_SINE, configuration_health, loop_rows, require_determined
from mbs.loops.velocity import scales

Array = NDArray[np.float64]
Evaluate = Callable[[Mapping[str, DM]], Sequence[DM]]

_ROUNDED = 2.5e-3
"""Squared sine between rows of the passive joints below which the effect of rounding is tested: at
a sine of 0.05, rounding changes second derivatives by 1e-11 of squared speeds."""
_MOVE = 1e-12
"""Random move of a position for a test [rad, or sizes of the mechanism]: exact derivatives change
by about this fraction."""
_NO_SYMBOLS = DM(0, 1)
_PLANE = 2
"""Number of dimensions of an array with columns."""
_TRIALS, _SEED = 3, 20261128
_NEWTON = 3
"""Newton steps onto the loops after a move: they converge quadratically."""
_ROUNDING = 1e-5
"""Largest effect of rounding on second derivatives, as a fraction of the largest row element."""
_ROUNDING_OF_SPEEDS = 1e-10
"""Largest effect of rounding as a fraction of squared speeds, for derivatives that are zero."""


def require_accurate(
    system: System,
    names: Sequence[str],
    evaluate: Evaluate,
    inputs: Mapping[str, Any],
    outputs: Sequence[DM],
) -> None:
    """Raise if second derivatives depend on the last digits of the positions.

    Their rounding grows with the third power of the inverse sine between the rows of the passive
    joints and with squared speeds, so that no sine alone limits it. The derivatives are evaluated
    again at configurations that are as closed and differ by rounding.

    Args:
        system: mechanism with closed loops.
        names: names of the outputs. The outputs "A" and derivatives by positions ("_dq") are
            tested.
        evaluate: returns the outputs at other inputs.
        inputs: numeric values of the inputs; q and p as DM with one or several columns.
        outputs: values at these inputs.

    Raises:
        SingularPosture: the derivatives have no accuracy at these velocities.
    """
    tested = [k for k, name in enumerate(names) if name == "A" or "_dq" in name]
    q, v, p = _point(system, inputs)
    count = q.shape[1]
    health = configuration_health(system)
    leads = (health if count == 1 else health.map(count)).call([DM(q), DM(p)])[1].nonzeros()
    near = [k for k in range(count) if leads[k] < _ROUNDED]
    if not near or not tested:
        return
    numbers = {name: DM(value) for name, value in inputs.items()}
    floors = _floors(system, names, v, outputs, tested)
    size = Closing(system, p[:, near[0]]).size
    units = distance_units((coordinate.unit for coordinate in system.coordinates), size)
    rng = np.random.default_rng(_SEED)
    for _ in range(_TRIALS):
        moved = q.copy()
        for k in near:
            start = q[:, k] + _MOVE * units * rng.uniform(-1, 1, system.nq)
            moved[:, k] = Closing(system, p[:, k]).polished(start, _NEWTON)
        others = evaluate({**numbers, "q": DM(moved)})
        for k, number in [(k, number) for k in near for number in tested]:
            found, other = (_column(x[number], k, count) for x in (outputs, others))
            allowed = _ROUNDING * np.max(np.abs(found), axis=1) + floors[number][k]
            if not np.all(np.max(np.abs(other - found), axis=1) <= allowed):
                _refuse(system, leads[k])


def _refuse(system: System, leads: float) -> None:
    """Raise SingularPosture with the names of the independent joints and the sine sqrt(leads).

    `leads` is the smallest squared sine between a row of the passive joints and the rows before it.
    """
    names = ", ".join(system.velocity_coordinates[k].name for k in system.independent)
    raise SingularPosture(
        f"{system.name}: the configuration is so near a singular one that second derivatives of the"
        f" loops have no accuracy at these velocities with {names} as independent joints (sine"
        f" {leads**0.5:.2g}; rounding changes them by more than {_ROUNDING:g}); take another"
        " configuration, smaller velocities, or other independent joints (assemble(active=...))"
    )


def _column(value: DM, k: int, count: int) -> Array:
    """Return the columns of an output (m, n count) that belong to column k of batched inputs.

    Args:
        value: output of a mapped function: one block of n columns for each input column.
        k: index of the input column.
        count: number of input columns.
    """
    full = np.asarray(value.full(), dtype=float)
    width = full.shape[1] // count
    return full[:, k * width : (k + 1) * width]


def _floors(
    system: System,
    names: Sequence[str],
    v: Array,
    outputs: Sequence[DM],
    tested: Sequence[int],
) -> dict[int, list[Array]]:
    """Return the changes by rounding that count as zero, {output index: [(rows,) for each column]}.

    They are 1e-10 of the largest squared speed, times the typical size of each row of the output.

    Args:
        system: mechanism with closed loops.
        names: names of the outputs.
        v: (m, n) independent velocities, one column per configuration.
        outputs: values of the outputs.
        tested: indices of the outputs that are tested.
    """
    units = scales(system).columns(
        [system.velocity_coordinates[k].unit for k in system.independent]
    )
    count = v.shape[1]
    squares = np.max((v / units[:, None]) ** 2, axis=0, initial=0.0)
    masses = [k for k, name in enumerate(names) if name.startswith("dtau") and "_da" in name]

    def rows(number: int, k: int) -> Array:
        """Return the typical size (rows,) of output `number` at configuration k.

        It is 1 for accelerations, and the effort of a unit acceleration for efforts.
        """
        found = np.zeros(outputs[number].shape[0])
        if names[number].startswith("dtau"):
            sizes = (float(np.max(np.abs(_column(outputs[i], k, count)))) for i in masses)
            return found + max(sizes, default=0.0)
        first = len(system.chosen_coordinates) if names[number] == "A" else 0
        found[first : first + len(units)] = units
        return found

    return {
        number: [_ROUNDING_OF_SPEEDS * squares[k] * rows(number, k) for k in range(count)]
        for number in tested
    }


def _point(system: System, inputs: Mapping[str, Any]) -> list[Array]:
    """Return positions q, independent velocities v and parameters p of some inputs of a model.

    They have shapes (nq, n), (m, n) and (np, n), with the same number n of columns.
    """
    sizes = {"q": system.nq, "v_a": len(system.independent), "p": len(system.parameters)}
    found = [_columns(inputs.get(name, _NO_SYMBOLS), size) for name, size in sizes.items()]
    count = max(values.shape[1] for values in found)
    return [
        values if values.shape == (size, count) else np.broadcast_to(values, (size, count))
        for values, size in zip(found, sizes.values(), strict=True)
    ]


def _columns(value: Any, size: int) -> Array:
    """Return an input as columns (size, n).

    A vector becomes one column, a scalar becomes (1, 1).
    """
    full = np.asarray(value.full() if isinstance(value, DM) else value, dtype=float)
    if full.ndim < _PLANE:
        return full.reshape(-1, 1)
    return full.T if full.shape[0] != size and full.shape == (1, size) else full


def _delicate(system: System, q: SX) -> SX:
    """Return 1 if q (nq, 1) is so near a singularity that rounding must be tested, else 0."""
    return SX(configuration_health(system)(q, system.p)[1] < _ROUNDED)


DIFFERENTIABLE = ConfigurationCheck(
    functools.partial(loop_rows, least=LEAST_SINE),
    functools.partial(require_determined, least=LEAST_SINE),
    require_accurate,
    _delicate,
)
"""Check that the loops are closed and that their second derivatives are accurate."""
