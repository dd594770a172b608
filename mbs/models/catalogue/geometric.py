"""Geometric models: transforms, inverse geometry and the closure of loops."""

from __future__ import annotations

from casadi import Function

from mbs import loops
from mbs.assembly import System
from mbs.models import inverse_geometry
from mbs.models.catalogue.entry import Entry
from mbs.models.catalogue.options import TARGET, one_frame
from mbs.models.geometry import direct_geometry, transform


def _postures(key: str, title: str, method: str) -> Entry:
    def function(system: System, frame: str | int) -> Function:
        return inverse_geometry.function(system, method, frame)

    def text(system: System, frame: str | int) -> str:
        return inverse_geometry.text(system, method, frame)

    return Entry(
        key, "Geometric", title, "q = igm(T)", (TARGET,), function, text, method, structures="open"
    )


GEOMETRIC: tuple[Entry, ...] = (
    Entry(
        "transform",
        "Geometric",
        "Transformation matrix",
        "iTj(q)",
        (TARGET, one_frame("relative_to", "seen from frame", lambda _: 0)),
        transform,
    ),
    Entry("dgm", "Geometric", "Fast geometric model", "0Tn(q)", (TARGET,), direct_geometry),
    _postures("igm-pieper", "Inverse geometric model, Pieper's method", "pieper"),
    _postures("igm-paul", "Inverse geometric model, Paul's method", "paul"),
    Entry(
        "igm-general",
        "Geometric",
        "Inverse geometric model, general method",
        "q = igm(T)",
        (TARGET,),
        solver="general",
    ),
    Entry(
        "closure",
        "Geometric",
        "Constraint geometric equations of loops",
        "phi(q) = 0",
        function=loops.closure,
        structures="closed",
    ),
    Entry(
        "closed-form",
        "Geometric",
        "Closed form of the loops",
        "q(q_a)",
        function=loops.function,
        structures="closed",
    ),
)
