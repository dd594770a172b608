"""Functions made of other models, on the same symbols."""

from __future__ import annotations

import casadi
from casadi import SX, Function

from mbs.assembly import System


def outputs_of(system: System, model: Function, *values: SX) -> list[SX]:
    """The outputs of a model on symbols, its parameters passed on when it has any."""
    arguments = [*values, *([system.p] if system.parameters else [])]
    return [SX(output) for output in model.call(arguments)]


def dense_function(name: str, inputs: list[SX], outputs: list[SX]) -> Function:
    """A Function without structural zeros in its outputs, common parts shared."""
    return Function(name, inputs, [casadi.densify(o) for o in outputs], {"cse": True})
