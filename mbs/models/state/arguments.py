"""Arguments of the Functions of a state equation, in simulations and in FMUs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import casadi
from casadi import SX, Function

from mbs.assembly import System
from mbs.models.contacts import ContactEquations
from mbs.models.symbols import dense_function

Point = tuple[SX, ...]
"""Symbols of the arguments of a state equation without modes: time and state first, parameters
last. They are (t, x, p) in a simulation and (t, x, z, u, p) in an FMU."""


@dataclass(frozen=True, slots=True, eq=False)
class StateArguments:
    """Arguments of the Functions of a state equation.

    Expressions of a state equation contain further symbols: the inputs of components, and two modes
    of each contact. `function` replaces them by values or by arguments.

    Attributes:
        point: symbols of the arguments without modes.
        modes: (m, 1) symbols of the contact modes, which follow the parameters.
        every_mode: whether `modes` contains both modes of each contact, also of a contact that has
            only a stop or only friction.
        replaced: pairs of symbols and the values that replace them.
    """

    point: Point
    modes: SX = field(default_factory=lambda: SX(0, 1))
    every_mode: bool = False
    replaced: tuple[tuple[SX, SX], ...] = ()

    @property
    def symbols(self) -> list[SX]:
        """Symbols of the arguments, with the modes after the parameters."""
        return [*self.point[:-1], casadi.vertcat(self.point[-1], self.modes)]

    def values(self, expressions: Sequence[SX]) -> list[SX]:
        """Return expressions of the arguments only: replaced symbols have their values."""
        found = [SX(value) for value in expressions]
        for symbols, value in self.replaced:
            found = [SX(one) for one in casadi.substitute(found, [symbols], [value])]
        return found

    def function(self, name: str, outputs: Sequence[SX], *extra: SX) -> Function:
        """Return a Function of the arguments with dense outputs.

        Args:
            name: name of the Function.
            outputs: expressions of the outputs.
            extra: symbols of further arguments at the end.
        """
        return dense_function(name, [*self.symbols, *extra], self.values(outputs))


def state_arguments(
    system: System,
    point: Point,
    contact: ContactEquations | None,
    inputs: SX | None = None,
    *,
    every_mode: bool = False,
) -> StateArguments:
    """Return the arguments of a state equation.

    Args:
        system: open or closed system.
        point: symbols of the arguments without modes.
        contact: equations of rigid stops and Coulomb friction, or None.
        inputs: (nu, 1) values of the inputs of components; None if the inputs are arguments.
        every_mode: attribute of `StateArguments`.
    """
    replaced = list[tuple[SX, SX]]()
    if inputs is not None and system.u.numel():
        replaced.append((system.u, casadi.densify(inputs)))
    modes = SX(0, 1)
    if contact is not None and every_mode:
        modes = contact.values
    elif contact is not None:
        used = [k for k, _ in contact.contacts.elements]
        modes = SX.sym("modes", len(used))
        replaced.append((contact.values, spread(modes, used, contact.values.numel())))
    return StateArguments(point, modes, every_mode, tuple(replaced))


def spread(values: SX, indices: Sequence[int], size: int) -> SX:
    """Return (size, 1) with values at their indices, else zero."""
    every = SX.zeros(size)
    every[list(indices)] = values
    return every
