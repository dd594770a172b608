"""Two coupled coordinates: the driven one by its polynomial, the driver where that is a line."""

from __future__ import annotations

from collections.abc import Container

from casadi import SX

from mbs.assembly.coordinate_coupling import CoordinateCoupling
from mbs.loops.closed_form.root import Root


def coupled(coupling: CoordinateCoupling, known: Container[int], q: SX) -> Root | str:
    """The unknown one of two coupled coordinates, or why it does not follow.

    Args:
        coupling: one of whose coordinates is known.
        known: numbers in q of known positions.
        q: (nq, 1) symbols of positions.
    """
    terms = coupling.coefficients
    if coupling.driver in known:
        return Root({"": {coupling.driven: coupling.value(q[coupling.driver])}})
    if coupling.driven not in known:
        return "both of its coordinates are unknown"
    if len(terms) != 2:
        return "its driver follows from a polynomial that is not of degree one"
    return Root({"": {coupling.driver: (q[coupling.driven] - terms[0]) / terms[1]}})
