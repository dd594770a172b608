"""Geometric models: transforms, inverse geometry and the closure of loops."""

from __future__ import annotations

from mbs import loops
from mbs.assembly import System
from mbs.errors import NoClosedForm
from mbs.models.catalogue.configurations import INVERSE_GEOMETRY
from mbs.models.catalogue.entry import BASE, TARGET, Entry, one_frame
from mbs.models.geometry import direct_geometry, transform


def _without_closed_form(system: System) -> str:
    """Return the reason why the loops have no closed form, "" if they do or for open systems."""
    if not system.is_closed:
        return ""
    try:
        loops.function(system)
    except NoClosedForm:
        return f"the loops of {system.name} have no closed form; they are solved by iteration"
    return ""


GEOMETRIC: tuple[Entry, ...] = (
    Entry(
        "transform",
        "Geometric",
        "Transformation matrix",
        "iTj(q)",
        (TARGET, one_frame("relative_to", "seen from frame", BASE)),
        transform,
    ),
    Entry(
        "dgm",
        "Geometric",
        "Fast geometric model",
        "0Tn(q)",
        (TARGET,),
        direct_geometry,
        obstacle=_without_closed_form,
    ),
    *INVERSE_GEOMETRY,
    Entry(
        "closure",
        "Geometric",
        "Constraint geometric equations of loops",
        "phi(q) = 0",
        function=loops.closure_residual,
        structures="closed",
    ),
    Entry(
        "closed-form",
        "Geometric",
        "Closed form of the loops",
        "q(q_a)",
        function=loops.function,
        structures="closed",
        obstacle=_without_closed_form,
    ),
)
