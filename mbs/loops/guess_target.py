"""Distance of configurations from a guess, which may contain positions of cut joints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.assembly.tables import Coordinate
from mbs.loops.closing import (
    Closing,
    difference,
    distance_units,
    quaternion_sign,
    row_difference,
)
from mbs.loops.cut_positions import cut_positions_and_slopes

Vector = NDArray[np.float64]

EQUAL = 1e-6
"""Difference below which distances are equal: configurations are closed to 1e-12, and branches of
symmetric mechanisms are equally near up to rounding."""


@dataclass(frozen=True, slots=True, eq=False)
class GuessTarget:
    """Target positions of all joints for the search of the nearest closed configuration.

    All positions are q, then the positions of cut joints. Therefore the comparison does not depend
    on which joint of a loop is cut.

    Attributes:
        system: mechanism whose loops may be open.
        p: (np,) parameters.
        start: (nq,) positions.
        cut: (c,) positions of `system.cut_coordinates`; None if they do not count.
        guessed: indices of the guessed positions among all positions.
    """

    system: System
    p: Vector
    start: Vector
    cut: Vector | None
    guessed: tuple[int, ...]

    @staticmethod
    def at(closing: Closing, start: Vector, guessed: Sequence[int]) -> GuessTarget:
        """Return a target of the tree positions only; positions of cut joints do not count.

        Args:
            closing: closure rows of the loops.
            start: (nq,) target positions.
            guessed: indices in q of the guessed positions.
        """
        return GuessTarget(closing.system, closing.p, start, None, tuple(guessed))

    @staticmethod
    def of(
        system: System,
        p: Vector,
        start: Vector,
        guess: Mapping[str, float],
        cut: Vector | None = None,
    ) -> GuessTarget:
        """Return the target of a start and a guess by coordinate name.

        Args:
            system: mechanism whose loops may be open.
            p: (np,) parameters.
            start: (nq,) positions.
            guess: guessed positions by name, cut joints included.
            cut: (c,) positions of cut joints without a guess. The default is zero.
        """
        rows = system.cut_coordinates
        if cut is None:
            cut = np.array([float(row.name.endswith(".qw")) for row in rows])
        at_cut = [guess.get(row.name, x) for row, x in zip(rows, cut, strict=True)]
        names = [row.name for row in (*system.coordinates, *rows)]
        guessed = tuple(k for k, name in enumerate(names) if name in guess)
        return GuessTarget(system, p, start, np.array(at_cut, dtype=float), guessed)

    def closing(self, held: set[int]) -> Closing:
        """Return the closure rows with some positions locked at the target.

        Args:
            held: indices of the locked positions. Indices from nq on belong to cut joints.
        """
        nq = self.system.nq
        locked = tuple(sorted(k for k in held if k < nq))
        aims = () if self.cut is None else tuple(sorted(k - nq for k in held if k >= nq))
        return Closing(self.system, self.p, locked, aims=aims, cut=self.cut)

    @property
    def rows(self) -> tuple[Coordinate, ...]:
        """Coordinates of all positions."""
        own = self.system.coordinates
        return own if self.cut is None else (*own, *self.system.cut_coordinates)

    def moves(self, q: Vector) -> Vector:
        """Return differences of all positions from the target [rad, m or 1].

        Args:
            q: (nq,) configuration.
        """
        own = difference(self.system, q, self.start)
        if self.cut is None or not len(self.cut):
            return own
        cut = self.system.cut_coordinates
        return np.concatenate([own, row_difference(cut, self._at_cut(q), self.cut)])

    def moves_between(self, q: Vector, other: Vector) -> Vector:
        """Return differences of all positions of two configurations [rad, m or 1].

        Args:
            q: (nq,) first configuration.
            other: (nq,) second configuration.
        """
        own = difference(self.system, q, other)
        if self.cut is None or not len(self.cut):
            return own
        cut = self.system.cut_coordinates
        return np.concatenate([own, row_difference(cut, self._at_cut(q), self._at_cut(other))])

    def signed_positions(self, q: Vector) -> Vector:
        """Return all positions at q (nq,); the first nonzero element of quaternions is positive."""
        found = q if self.cut is None else np.concatenate([q, self._at_cut(q)])
        found = np.array(found, dtype=float)
        for first in [k for k, row in enumerate(self.rows) if row.kind == "quaternion"][::4]:
            part = slice(first, first + 4)
            found[part] *= quaternion_sign(found[part])
        return found

    def _at_cut(self, q: Vector) -> Vector:
        """Return the positions (c,) of the cut joints at q (nq,) [rad, m or 1]."""
        return cut_positions_and_slopes(self.system)(q, self.p)[0].ravel()

    def units(self, closing: Closing) -> Vector:
        """Return divisors of position differences: 1 for angles, else the size of mechanism [m].

        Args:
            closing: closure rows of the loops.
        """
        return distance_units((row.unit for row in self.rows), closing.size)

    def miss(self, closing: Closing, q: Vector) -> float:
        """Return Euclidean distance of a configuration from the guessed positions [rad, or sizes].

        Other positions do not count. Lengths are divided by the size of the mechanism.

        Args:
            closing: closure rows of the loops.
            q: (nq,) configuration.
        """
        moves = self.moves(q) / self.units(closing)
        return float(np.linalg.norm(moves[list(self.guessed)]))

    def distances(
        self, closing: Closing, q: Vector, own: Sequence[int] | None = None
    ) -> tuple[float, float, float]:
        """Return the largest moves of guessed positions, of all positions, and of massless nodes.

        They are in rad, or in sizes of the mechanism.

        Args:
            closing: closure rows of the loops.
            q: (nq,) configuration.
            own: indices in q of the positions that count. The default is all positions, cut joints
                included.
        """
        if own is None:
            moves = np.abs(self.moves(q)) / self.units(closing)
        else:
            units = distance_units((row.unit for row in self.system.coordinates), closing.size)
            moves = np.abs(difference(self.system, q, self.start)) / units
        count = range(len(moves)) if own is None else own
        guessed = sorted(set(self.guessed) & set(count))
        nodes = [k for k, _ in self.system.nodes if k in count]
        return _largest(moves[guessed]), _largest(moves[list(count)]), _largest(moves[nodes])


def _largest(values: Vector) -> float:
    """Return the largest absolute element of `values`; 0 for an empty array."""
    return float(np.max(np.abs(values), initial=0.0))
