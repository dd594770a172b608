"""Positions as a user gives them: by name, or in the order of the independent joints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from mbs.assembly import System
from mbs.errors import ModelError
from mbs.loops.closed_form.places import independent_places
from mbs.messages import quoted

Given = Mapping[str, float] | Sequence[float] | None


def independent_names(system: System) -> list[str]:
    """The independent joints in the order of `system.free`."""
    return [system.speeds[k].name for k in system.free]


def fixed_positions(system: System, values: Given) -> dict[str, float]:
    """The given positions by name.

    Raises:
        ModelError: a sequence does not fit the independent joints.
    """
    names = independent_names(system)
    if values is None or isinstance(values, Mapping):
        return dict(values or {})
    try:
        given = [float(x) for x in values]
    except (TypeError, ValueError):
        raise ModelError(
            f"{system.name}: q_active is {quoted(values)}; give numbers for {', '.join(names)}"
        ) from None
    if len(given) != len(names):
        raise ModelError(
            f"{system.name}: q_active has {len(given)} values, the independent joints are"
            f" {len(names)}: {', '.join(names)}"
        )
    return dict(zip(names, given, strict=True))


def independent_positions(system: System, values: Given) -> list[float]:
    """The positions of the independent joints, those left out as in the assembled posture.

    Raises:
        ModelError: another joint is named, or a value is not finite.
    """
    fixed, names = fixed_positions(system, values), independent_names(system)
    places = dict(zip(names, independent_places(system), strict=True))
    spins = {name: x for name, x in fixed.items() if places.get(name, 0) >= system.nq}
    whole = system.position({name: x for name, x in fixed.items() if name not in spins})
    spun = system.velocity(spins)
    for name in fixed:
        if name not in names:
            raise ModelError(
                f"{system.name}: {name} follows from the loops once a branch is named; give"
                f" positions of the independent joints {', '.join(names)}"
            )
    return [
        whole[place] if place < system.nq else spun[k]
        for k, place in zip(system.free, places.values(), strict=True)
    ]
