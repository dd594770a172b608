"""Symbols that a grouping depends on, and the system in which they are constants.

Columns of the regressor depend on each other in a way that lengths, angles and gravity decide. What
is found at numbers of these symbols holds there alone, so that a system in which it is used must
not take other numbers for them.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, is_dataclass, replace
from typing import Any

import casadi
import numpy as np
from casadi import SX

from mbs.assembly import System
from mbs.errors import ModelError
from mbs.expressions import Expression, Parameter
from mbs.expressions.expression import Number, Operation, operation
from mbs.identification.regressors.columns import Column, every_column
from mbs.identification.regressors.dynamic import regressor
from mbs.loops.closure import closure_rows


def deciding_symbols(
    system: System, columns: Sequence[Column], *, base_moves: bool = False
) -> tuple[str, ...]:
    """Names of the parameters on which the regressor or the closed configurations depend.

    Parameters that are only inertial parameters or friction of a link are not among them.

    Args:
        system: open or closed.
        columns: the parameters that are grouped.
        base_moves: whether the base has a motion of its own.
    """
    if not system.parameters:
        return ()
    D = regressor(system, every_column(system, columns), moving_base=base_moves)
    found = {int(k) for k in D.jac_sparsity(0, D.name_in().index("p")).get_col()}
    # The distance of two points of the base decides how loops close, and D may not show it.
    if system.is_closed:
        rows = closure_rows(system, SX.sym("q", system.nq))
        found |= {k for k in range(len(system.parameters)) if casadi.depends_on(rows, system.p[k])}
    return tuple(p.name for k, p in enumerate(system.parameters) if k in found)


def with_constants(system: System, names: Sequence[str]) -> System:
    """The system in which some symbols are the constants of their defaults, and no parameters.

    The input p of its models has the other parameters only: values other than these constants
    cannot be given to it.

    Args:
        system: open or closed.
        names: of the parameters that become constants.

    Raises:
        ModelError: one of them has no default.
    """
    if not names:
        return system
    values: dict[str, float] = {}
    for parameter in system.parameters:
        if parameter.name in names:
            if parameter.default is None:
                raise ModelError(
                    f"{system.name}: parameters are grouped at the default of {parameter.name!r},"
                    " which has none; give it a default where the mechanism is described"
                )
            values[parameter.name] = parameter.default
    rest = [k for k, parameter in enumerate(system.parameters) if parameter.name not in values]
    parameters = tuple(system.parameters[k] for k in rest)
    changed: System = _changer(system.symbol_table, values)(replace(system, _cache={}))
    bounds = {name: own for name, own in system.bounds.items() if name not in values}
    return replace(changed, parameters=parameters, p=system.p[rest], bounds=bounds, _cache={})


def _changer(symbols: Mapping[str, SX], values: Mapping[str, float]) -> Callable[[Any], Any]:
    """What puts numbers into everything that a system holds, expressions of components too."""
    before = casadi.vertcat(*(symbols[name] for name in values))
    after = SX(casadi.DM(np.array(list(values.values()))))
    done: dict[int, tuple[Any, Any]] = {}

    def changed(value: Any) -> Any:
        if isinstance(value, SX):
            return casadi.substitute(value, before, after) if depends(value) else value
        if isinstance(value, Expression):
            return _with_numbers(value, values)
        if id(value) not in done:  # what is shared is changed once
            # kept with the original, so that no other object gets its id
            done[id(value)] = (value, inside(value))
        return done[id(value)][1]

    def depends(value: SX) -> bool:
        return bool(value.nnz()) and bool(casadi.depends_on(value, before))

    def inside(value: Any) -> Any:
        if isinstance(value, tuple | list):
            elements = [changed(element) for element in value]
            same = all(new is old for new, old in zip(elements, value, strict=True))
            return value if same else type(value)(elements)
        if isinstance(value, Mapping):
            return {key: changed(element) for key, element in value.items()}
        if is_dataclass(value) and not isinstance(value, type):
            return _rebuilt(value, changed)
        return value

    return changed


def _rebuilt(value: Any, change: Callable[[Any], Any]) -> Any:
    """A copy of a dataclass with its fields changed; itself where nothing changes."""
    fresh = {f.name: change(getattr(value, f.name)) for f in fields(value)}
    if all(fresh[name] is getattr(value, name) for name in fresh):
        return value
    # Not `replace`: what the constructor computes must be changed too, and is checked already.
    made = copy.copy(value)
    for name, one in fresh.items():
        object.__setattr__(made, name, one)
    return made


def _with_numbers(value: Expression, values: Mapping[str, float]) -> Expression:
    """The expression with numbers in the place of these parameters; others stay symbols."""
    if isinstance(value, Parameter):
        return Number(values[value.name]) if value.name in values else value
    if isinstance(value, Operation):
        return operation(value.operator, *(_with_numbers(a, values) for a in value.arguments))
    return value
