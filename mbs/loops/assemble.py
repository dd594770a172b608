"""The whole way from a mechanism to a System, loops closed and analysed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from mbs.assembly import System
from mbs.assembly.open_system import open_system
from mbs.assembly.parts import guesses_of_unknowns
from mbs.components import Mechanism
from mbs.errors import AssemblyError
from mbs.loops.analysis import analyse
from mbs.numbers import numbers_given
from mbs.recursions.part_checks import check_parts
from mbs.text import did_you_mean


def assemble(
    mechanism: Mechanism, guess: Mapping[str, float], active: Sequence[str] = ()
) -> System:
    """The frozen System of a mechanism.

    Args:
        mechanism: components and connections.
        guess: approximate positions by coordinate name, where loops are closed near to.
        active: velocities that are to be independent where there are loops.

    Raises:
        AssemblyError: the components do not form a mechanism, or a guess names no coordinate.
        Unclosable: no configuration closes the loops.
    """
    guess = {**guesses_of_unknowns(mechanism), **guess}
    system = open_system(mechanism, (*guess, *active))
    check_parts(system)
    _check_guess(system, guess)
    chosen = _choose(system, active)
    if system.cuts or system.couplings or any(p.element.binds for p in system.parts):
        return analyse(system, guess, chosen)
    known = [coordinate.name for coordinate in system.coordinates]
    start = {name: value for name, value in guess.items() if name in known}
    return replace(system, configuration=tuple(system.position(start)), _cache={})


def _choose(system: System, active: Sequence[str]) -> tuple[int, ...]:
    """The numbers of the velocities that the user named."""
    names = [speed.name for speed in system.speeds]
    for name in active:
        if name in [coordinate.name for coordinate in system.cut_coordinates]:
            raise AssemblyError(
                f"{system.name}: {name} cannot be independent, since its joint is cut to open a"
                " loop; cut another joint of the loop"
            )
        if name not in names:
            raise AssemblyError(
                f"{system.name}: active names {name!r}, which is no velocity;"
                f" {did_you_mean(name, names)}"
            )
    return tuple(dict.fromkeys(names.index(name) for name in active))


def _check_guess(system: System, guess: Mapping[str, float]) -> None:
    known = [c.name for c in (*system.coordinates, *system.cut_coordinates)]
    for name, value in guess.items():
        if name not in known:
            raise AssemblyError(
                f"{system.name}: the guess names {name!r}, which is no coordinate;"
                f" {did_you_mean(name, known)}"
            )
        number = numbers_given(value)
        if isinstance(number, str):
            raise AssemblyError(f"{system.name}: the guess of {name} {number}")
