"""Options of the inverse geometric model that the command line and the app have."""

from __future__ import annotations

from dataclasses import dataclass, field

from mbs.options import described

_METHODS = {
    "auto": "the cheapest that fits",
    "pieper": "Pieper",
    "paul": "Paul",
    "general": "general (Raghavan and Roth)",
    "search": "search from random starts",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseOptions:
    """Options of `mbs.models.inverse_geometry.solve` with a text form."""

    method: str = field(
        default="auto",
        metadata=described(
            '"auto" selects a closed form if one exists, else the general method, else the search.'
            ' "pieper", "paul", "general" and "search" select one method.',
            _METHODS,
            command="--method",
            command_text="method; auto takes the cheapest that fits.",
            in_form=True,
        ),
    )
