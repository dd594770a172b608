"""Loading of the robot that a command line names."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from mbs.app.cli.printing import note

if TYPE_CHECKING:
    from mbs.assembly import System
    from mbs.mechanism import Mechanism

_MOST_NOTES = 8
"""Maximum number of reader notes that are printed; some files have hundreds."""


def mechanism(
    robot: str,
    parameters: Sequence[str] | None = None,
    gravity: str = "",
    mount: Sequence[str] | None = None,
) -> Mechanism:
    """Return the mechanism of a robot, and print the notes of its reader on standard error.

    Args:
        robot: name in the catalogue, or path of a file.
        parameters: NAME=VALUE for some of its symbols.
        gravity: "X,Y,Z" in the world [m/s^2]; empty for the gravity of the robot.
        mount: steps of the mount, such as "x=pi" and "position=0,0,2.5".

    Raises:
        DescriptionError: the robot or a symbol does not exist, the file is malformed, or gravity or
            mount is invalid.
    """
    from mbs.app.tasks.mounting import mounting_of
    from mbs.robots import load

    mounting = mounting_of(gravity, mount or (), names=("--gravity", "--mount"))
    loaded = load(robot, numbers(parameters, "--parameter"), **mounting)
    for one in loaded.notes[:_MOST_NOTES]:
        note(f"{robot}: {one}")
    if len(loaded.notes) > _MOST_NOTES:
        note(f"{robot}: and {len(loaded.notes) - _MOST_NOTES} notes more, see mechanism.notes")
    return loaded


def system(
    robot: str,
    parameters: Sequence[str] | None = None,
    gravity: str = "",
    mount: Sequence[str] | None = None,
) -> System:
    """Return the assembled robot.

    Args:
        robot: name in the catalogue, or path of a file.
        parameters: NAME=VALUE for some of its symbols.
        gravity: "X,Y,Z" in the world [m/s^2]; empty for the gravity of the robot.
        mount: steps of the mount, such as "x=pi" and "position=0,0,2.5".

    Raises:
        DescriptionError: see `mechanism`.
        AssemblyError: the components do not form a mechanism.
        Unclosable: the loops cannot be closed.
    """
    described = mechanism(robot, parameters, gravity, mount)
    known = len(described.notes)
    assembled = described.assemble()
    for one in described.notes[known:][:_MOST_NOTES]:
        note(f"{robot}: {one}")
    return assembled


def numbers(texts: Sequence[str] | None, option: str) -> dict[str, float]:
    """Return numbers by name from texts such as "L2=0.3" and "j1=pi/2".

    Args:
        texts: texts as the user typed them.
        option: name of the option, for error messages.

    Raises:
        DescriptionError: a text is not an assignment of a number.
    """
    from mbs.app.tasks.laws import assignments
    from mbs.expressions import number

    given = assignments(texts or (), option)
    return {name: number(text, f"{option} {name}") for name, text in given.items()}


def configuration(system: System, texts: Sequence[str] | None, option: str = "--q") -> list[float]:
    """Return positions q (nq,) [rad or m] with closed loops.

    Args:
        system: the robot.
        texts: NAME=VALUE for some of its positions; other positions are as assembled.
        option: name of the option, for error messages.

    Raises:
        ModelError: a name is unknown.
        Unclosable: the loops cannot be closed with these positions.
    """
    given = numbers(texts, option)
    q = system.position(given)
    if not given or not system.is_closed:
        return q
    from mbs import loops

    return [float(x) for x in loops.solve(system, given)]
