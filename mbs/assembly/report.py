"""What was assembled, in plain sentences."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mbs.assembly.system import System


def report(system: System) -> str:
    """Tree, cut joints, mobility, dropped rows, whether the cut forces are unique, what acts."""
    every = [*_tree(system), *_loops(system), *_parameters(system), *_acting(system)]
    return "\n".join(every)


def _tree(system: System) -> list[str]:
    links = system.tree.links
    without = {row.coordinate: "a shaft of a drive line" for row in system.shafts if row.own}
    lines = [
        f"{system.name}: {_count(len(links), 'moving link')} in a tree,"
        f" {_count(system.nq, 'position')} q and {_count(system.nv, 'velocity')} v."
    ]
    for number, link in enumerate(links, start=1):
        carried = [row.name for row in system.bodies if row.link == number]
        before = "the base" if link.antecedent < 0 else f"link {link.antecedent + 1}"
        what = ", ".join(carried) if carried else without.get(link.name, "a frame without a body")
        lines.append(
            f"  link {number}: {link.motion.value} {link.name} from {before} carries {what}"
        )
    return lines


def _loops(system: System) -> list[str]:
    if system.closure is None:
        return ["No loop: every coordinate is independent."]
    closure = system.closure
    lines = []
    for loop in system.loops:
        if loop.closing == "coupling":
            lines.append(f"Coupling {loop.name}: {' follows '.join(loop.joints)}.")
            continue
        kept = len(loop.rows) - len(loop.dropped)
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
    active = ", ".join(system.speeds[k].name for k in closure.active) or "none"
    lines.append(
        f"Mobility {closure.mobility} (Gruebler-Kutzbach counts {closure.gruebler});"
        f" independent: {active}."
    )
    if closure.motors != closure.active:
        motors = ", ".join(system.speeds[k].name for k in closure.motors)
        lines.append(f"Driven by {_count(len(closure.motors), 'effort')}: {motors}.")
    if len(closure.motors) > closure.mobility:
        lines.append("  They are more than the mobility: which of them carries a load is a choice.")
    lines.append(f"The loops close to {closure.residual:.1e} at the assembled posture.")
    return lines


def _parameters(system: System) -> list[str]:
    if not system.parameters:
        return []
    values = ", ".join(
        f"{p.name} = {'no value' if p.default is None else format(p.default, 'g')}"
        for p in system.parameters
    )
    return [f"Parameters: {values}."]


def _acting(system: System) -> list[str]:
    """Parts of drive lines, force elements, sensors: a sentence for each."""
    driving = {device.name for device in system.devices}
    return [
        *(row.sentence for row in system.shafts if row.name not in driving),
        *(force.sentence for force in system.forces),
        *(device.sentence for device in system.devices),
        *(sensor.sentence for sensor in system.sensors),
    ]


def _count(number: int, noun: str) -> str:
    plural = noun[:-1] + "ies" if noun.endswith("y") else noun + "s"
    return f"{number} {noun if number == 1 else plural}"
