"""Sizes of the rows and columns of the constraints, so that nothing depends on units.

Rows are lengths or cosines, columns belong to angles or displacements. A displacement is measured
by the length that an angle moves the rows of positions, and a row by its own size at the
assembled posture.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.loops.closure import row_labels
from mbs.loops.velocity import constraint_jacobian

_VANISHING = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class Scales:
    """What rows are multiplied by, and columns: D J E has rows of about unit length.

    Attributes:
        rows: (m,) for every constraint row, rows of positions first [1/m or 1].
        length: for displacements [m]; angles count as they are.
    """

    rows: NDArray[np.float64]
    length: float

    def columns(self, units: list[str]) -> NDArray[np.float64]:
        """For coordinates of these units."""
        return np.array([self.length if unit.startswith("m") else 1.0 for unit in units])


def scales(system: System) -> Scales:
    """The scales of a system; ones where a symbol has no value, and no rows in an open chain."""

    def build() -> Scales:
        J = np.array(constraint_jacobian(system)(list(system.posture), system.p_default))
        if J.size == 0 or not np.all(np.isfinite(J)):
            return Scales(np.ones(len(J)), 1.0)
        units = [speed.unit for speed in system.speeds]
        labels = [label for _, loop in row_labels(system) for label in loop]
        length = _length(J, labels, units)
        sizes = np.linalg.norm(J * Scales(np.ones(0), length).columns(units), axis=1)
        usual = float(np.median(sizes[sizes > 0])) if np.any(sizes > 0) else 1.0
        return Scales(1 / np.where(sizes > _VANISHING * usual, sizes, usual), length)

    found: Scales = system.cached("constraint scales", build)
    return found


def _length(J: NDArray[np.float64], labels: list[str], units: list[str]) -> float:
    """How far an angle moves the rows of positions, the largest of them."""
    turns = [k for k, unit in enumerate(units) if unit.startswith("rad")]
    places = [k for k, label in enumerate(labels) if label.startswith("force")]
    moved = np.abs(J[np.ix_(places, turns)])
    largest = float(np.max(moved, initial=0.0))
    return largest if largest > 0 else 1.0
