"""The whole way from a mechanism to a System, loops closed and analysed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from mbs.assembly import System
from mbs.assembly.open_system import open_system
from mbs.components import Mechanism
from mbs.errors import AssemblyError
from mbs.loops.analysis import analysed
from mbs.messages import did_you_mean


def assemble(mechanism: Mechanism, guess: Mapping[str, float]) -> System:
    """The frozen System of a mechanism.

    Args:
        mechanism: components and connections.
        guess: approximate positions by coordinate name, where loops are closed near to.

    Raises:
        AssemblyError: the components do not form a mechanism, or a guess names no coordinate.
        Unclosable: no posture closes the loops.
    """
    system = open_system(mechanism, guess)
    _check_guess(system, guess)
    if system.cuts or system.couplings:
        return analysed(system, guess)
    known = [coordinate.name for coordinate in system.coordinates]
    start = {name: value for name, value in guess.items() if name in known}
    return replace(system, posture=tuple(system.position(start)), _cache={})


def _check_guess(system: System, guess: Mapping[str, float]) -> None:
    known = [c.name for c in (*system.coordinates, *system.cut_coordinates)]
    for name in guess:
        if name not in known:
            raise AssemblyError(
                f"{system.name}: the guess names {name!r}, which is no coordinate;"
                f" {did_you_mean(name, known)}"
            )
