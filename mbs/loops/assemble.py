"""Assembly of a mechanism into a System with closed and analysed loops."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from mbs.assembly import System
from mbs.assembly.component_instances import guesses_of_unknowns
from mbs.assembly.open_system import open_system
from mbs.assembly.variable_names import GUESSES, like_degrees
from mbs.components import Description
from mbs.errors import AssemblyError, Unclosable
from mbs.loops.analysis import analyse
from mbs.loops.balance import with_balance
from mbs.numbers import numbers_given
from mbs.recursions.part_checks import check_parts
from mbs.text import did_you_mean, quoted


def assemble(
    mechanism: Description, guess: Mapping[str, float], active: Sequence[str] = ()
) -> System:
    """Return the immutable System of a mechanism.

    Args:
        mechanism: components and connections.
        guess: approximate positions by coordinate name. Loops are closed near them. They replace
            the guesses of the mechanism.
        active: names of velocities that must be independent in a mechanism with loops.

    Raises:
        AssemblyError: the components form no mechanism, or `guess` or `active` has an invalid name.
        Unclosable: no configuration closes the loops.
    """
    guess = _laid_over(guesses_of_unknowns(mechanism), mechanism.guess, guess)
    for name in guess:
        if not isinstance(name, str):
            raise AssemblyError(
                f"{mechanism.name}: the guess names {name!r}, which is no coordinate; give names"
            )
    system = open_system(mechanism, (*guess, *active))
    check_parts(system)
    guess = _plain_guess(system, guess)
    chosen = _choose(system, active)
    system = with_balance(system, mechanism)
    bound = system.cuts or system.couplings or any(p.element.binds for p in system.parts)
    if bound or system.nodes:
        return _analysed(system, guess, chosen)
    known = [coordinate.name for coordinate in system.coordinates]
    start = {name: value for name, value in guess.items() if name in known}
    return replace(system, configuration=tuple(system.position(start)), _cache={})


def _analysed(system: System, guess: Mapping[str, float], chosen: tuple[int, ...]) -> System:
    """Return the system with closed loops; errors have a note on guesses in degrees."""
    try:
        return analyse(system, guess, chosen)
    except Unclosable as error:
        note = like_degrees([*system.coordinates, *system.cut_coordinates], guess)
        raise (Unclosable(f"{error}; {note}") if note else error) from None


def _choose(system: System, active: Sequence[str]) -> tuple[int, ...]:
    """Return the indices in v of velocities that the user requires as independent.

    Raises:
        AssemblyError: a name is no velocity, or belongs to a cut joint.
    """
    names = [speed.name for speed in system.velocity_coordinates]
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


def _laid_over(*guesses: Mapping[str, float]) -> dict[str, float]:
    """Return the union of guesses, dicts from variable name to position.

    A later guess of a coordinate replaces earlier guesses.
    """
    found: dict[str, float] = {}
    for guess in guesses:
        later = {_base(name) for name in guess}
        found = {name: value for name, value in found.items() if _base(name) not in later}
        found |= guess
    return found


def _base(name: str) -> str:
    """Return the coordinate of a variable: j1 for j1.q. Return any other name unchanged."""
    base, _, kind = str(name).rpartition(".")
    return base if kind in GUESSES else str(name)


def _plain_guess(system: System, guess: Mapping[str, float]) -> dict[str, float]:
    """Return a guess {coordinate name: number}. Names of variables such as j1.q become j1.

    Raises:
        AssemblyError: a name is no coordinate, or a value is no number.
    """
    known = [c.name for c in (*system.coordinates, *system.cut_coordinates)]
    found: dict[str, float] = system.plain_names(guess, GUESSES)
    for name, value in found.items():
        if name not in known:
            raise AssemblyError(
                f"{system.name}: the guess names {name!r}, which is no coordinate;"
                f" {did_you_mean(name, known)}"
            )
        number = numbers_given(value)
        if isinstance(number, str):
            raise AssemblyError(f"{system.name}: the guess of {name} {number}")
        if number.size != 1 or not np.isfinite(number).all():
            raise AssemblyError(
                f"{system.name}: the guess of {name} is {quoted(value)}; give one finite number"
            )
        found[name] = float(number.ravel()[0])
    return found
