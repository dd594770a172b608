"""The report on an assembled system, in sentences."""

from __future__ import annotations

from collections.abc import Sequence

from mbs.assembly.system_data import SystemData
from mbs.assembly.tables import Closure
from mbs.assembly.variable_names import like_degrees
from mbs.text import listed


def report(system: SystemData) -> str:
    """Return a text on an assembled system.

    The text gives the tree, the cut joints, the mobility, redundant rows, whether the cut forces
    are unique, the assembled configuration, parameters, forces and sensors.

    Args:
        system: assembled system.
    """
    every = [*_tree(system), *_loops(system), *_parameters(system), *_acting(system)]
    return "\n".join([*every, *_degrees(system)])


def _degrees(system: SystemData) -> list[str]:
    """Return a note, as a list of one line or none, if guesses look like degrees.

    The guess of an open system is its position.
    """
    names = [coordinate.name for coordinate in system.coordinates]
    given = dict(zip(names, system.configuration, strict=True))
    if system.closure is not None:
        given = dict(system.closure.guess)
    note = like_degrees([*system.coordinates, *system.cut_coordinates], given)
    return [f"Note: {note}."] if note else []


def _tree(system: SystemData) -> list[str]:
    """Return the lines on the numbers of coordinates and on each link."""
    links = system.tree.links
    without = {
        row.coordinate: f"a {'slide' if row.slides else 'shaft'} of a drive line"
        for row in system.shafts
        if row.own
    }
    lines = [
        f"{system.name}: {_count(len(links), 'moving link')} in a tree,"
        f" {_count(system.nq, 'position')} q and {_count(system.nv, 'velocity')} v."
    ]
    for number, link in enumerate(links, start=1):
        bodies = [row.name for row in system.bodies if row.link == number]
        before = "the base" if link.antecedent < 0 else f"link {link.antecedent + 1}"
        what = ", ".join(bodies) if bodies else without.get(link.name, "a frame without a body")
        lines.append(
            f"  link {number}: {link.motion.value} {link.name} from {before} carries {what}"
        )
    return lines


def followed(joints: Sequence[str]) -> str:
    """Return text on a coupling of coordinates, such as "j2 follows j1".

    Args:
        joints: names of the coordinates, the driven one first.
    """
    driven, *others = joints
    return f"{driven} follows {' and '.join(others)}"


def _loops(system: SystemData) -> list[str]:
    """Return the lines of the report on loops, couplings, mobility and motors."""
    if system.closure is None:
        return ["No loop: every coordinate is independent."]
    closure = system.closure
    parts = {part.name: type(part.element).__name__ for part in system.parts}
    lines = []
    for loop in system.loops:
        if loop.closing == "coupling":
            lines.append(f"Coupling {loop.name}: {followed(loop.joints)}.")
            continue
        kept = len(loop.rows) - len(loop.dropped)
        if loop.name in parts:
            lines.append(
                f"{parts[loop.name]} {loop.name} binds {listed(loop.joints)}: {kept} of"
                f" {_count(len(loop.rows), 'row')} {'is' if kept == 1 else 'are'} independent."
            )
            continue
        if loop.closing in ("balance", "damped balance"):
            what = "the velocities of " if loop.closing == "damped balance" else ""
            lines.append(
                f"The balance of forces gives {what}{listed(loop.joints)}, which move no mass:"
                f" {kept} of"
                f" {_count(len(loop.rows), 'row')} {'is' if kept == 1 else 'are'} independent."
            )
            continue
        lines.append(
            f"1 loop cut at {loop.name} ({loop.closing}), through {', '.join(loop.joints)}:"
            f" {kept} of {len(loop.rows)} rows are independent."
        )
        if loop.dropped:
            lines.append(
                f"  Dropped, since the others imply them: {', '.join(loop.dropped)};"
                " the cut forces along them are not unique."
            )
        else:
            lines.append("  The cut forces are unique.")
    active = ", ".join(system.velocity_coordinates[k].name for k in closure.independent) or "none"
    lines.append(
        f"Mobility {closure.mobility} (Gruebler-Kutzbach counts {closure.gruebler});"
        f" independent: {active}."
    )
    if closure.motors != closure.independent:
        motors = ", ".join(system.velocity_coordinates[k].name for k in closure.motors)
        lines.append(f"Driven by {_count(len(closure.motors), 'effort')}: {motors}.")
    if len(closure.motors) > closure.mobility:
        lines.append("  They are more than the mobility: which of them carries a load is a choice.")
    lines.append(f"The loops close to {closure.residual:.1e} at the assembled configuration.")
    return [*lines, *_configuration(system, closure)]


_SHOWN_POSITIONS, _SHOWN_MODES = 12, 3
"""Maximum numbers of positions of a configuration and of other configurations in a report."""


def _configuration(system: SystemData, closure: Closure) -> list[str]:
    """Return the lines on the assembled configuration, the guess and other assembly modes."""

    def shown(q: Sequence[float]) -> str:
        pairs = zip(system.coordinates, q, strict=True)
        texts = [f"{c.name} = {x:.5g}" for c, x in pairs]
        more = ", ..." if len(texts) > _SHOWN_POSITIONS else ""
        return ", ".join(texts[:_SHOWN_POSITIONS]) + more

    lines = [f"Assembled at {shown(system.configuration)}."]
    at = dict(zip((c.name for c in system.coordinates), system.configuration, strict=True))
    at |= dict(closure.at_cut)
    missed = [(name, x) for name, x in closure.guess if abs(at[name] - x) > _GUESSED]
    if missed:
        guesses = ", ".join(f"{name} = {x:.5g}" for name, x in missed[:_SHOWN_POSITIONS])
        lines.append(f"  Guesses that are not met: {guesses}.")
    lines += [f"  Another configuration: {shown(q)}." for q in closure.others[:_SHOWN_MODES]]
    if closure.meets:
        lines.append(
            "  The configuration next to the guess is singular: branches of motion meet there. The"
            " mechanism is assembled beside it, on the branch nearest to the guess. Guess more"
            " positions to choose another branch."
        )
    if closure.dead:
        names = ", ".join(system.velocity_coordinates[k].name for k in closure.independent)
        lines.append(
            f"  The configuration is a dead centre of {names}: the other joints do not follow"
            f" from {names} there, and models in independent joints have no value. Guess another"
            " position, or name other independent joints (assemble(active=...))."
        )
    return lines


_GUESSED = 1e-9
"""Difference from a guess that is met [rad or m]: closing moves no position that is locked."""


def _parameters(system: SystemData) -> list[str]:
    """Return a line with the parameters and their default values; none without parameters."""
    if not system.parameters:
        return []
    values = ", ".join(
        f"{p.name} = {'no value' if p.default is None else format(p.default, 'g')}"
        for p in system.parameters
    )
    return [f"Parameters: {values}."]


def _acting(system: SystemData) -> list[str]:
    """Return a sentence for each part of a drive line, force element and sensor."""
    driving = {device.name for device in system.devices}
    return [
        *(row.sentence for row in system.shafts if row.name not in driving),
        *(
            part.sentence
            for part in system.parts
            if not part.element.drives and not part.binds_alone  # those stand among the loops
        ),
        *(device.sentence for device in system.devices),
        *(sensor.sentence for sensor in system.sensors),
    ]


def _count(number: int, noun: str) -> str:
    """Return number and noun as text, with the plural form of the noun."""
    plural = noun[:-1] + "ies" if noun.endswith("y") else noun + "s"
    return f"{number} {noun if number == 1 else plural}"
