"""Events of a mechanism's FMU: its rigid stops and dry friction."""

from __future__ import annotations

from mbs.assembly import System
from mbs.export.fmu.description import FmuVariable, Jumps
from mbs.models.contacts import contacts_of
from mbs.models.minimal_contacts import element_names
from mbs.models.minimal_state import MinimalState


def jumps(system: System, state: MinimalState) -> Jumps | None:
    """Modes, indicators and jumps of a state equation; None where nothing jumps.

    Args:
        system: open or closed.
        state: its state equation.
    """
    events = state.events
    if events is None:
        return None
    stops = [stop for stop in contacts_of(system).stops if stop is not None]
    modes = []
    for number, name in enumerate(element_names(contacts_of(system))):
        text = "place: -1 at the lower limit, 1 at the upper one, 0 between them"
        if number >= len(stops):
            text = "direction of sliding, -1 or 1, and 0 where friction holds"
        described = f"of {name}, {text}"
        modes.append(FmuVariable(name=f"{name}.mode", min=-1, max=1, description=described))
    return Jumps(
        modes=tuple(modes),
        first=events.first,
        indicators=events.indicators,
        jump=events.jump,
        names=events.names,
    )
