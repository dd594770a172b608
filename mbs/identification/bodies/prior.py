"""What is known of the bodies before anything was measured."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from mbs.errors import ModelError
from mbs.messages import quoted

Array = npt.NDArray[np.float64]

HEAVIEST = 100.0
"""Bound on the mass of a link where none is given [kg]."""


@dataclass(frozen=True, slots=True, eq=False)
class Prior:
    """Bounds on masses, and a set of parameters to stay near where a record says nothing.

    Source: Lee, Wensing & Park 2020 (divergence from a guess).

    Attributes:
        guess: (k,) parameters such as those of a drawing, in the order of the columns; balls of
            1 kg at the origins of the links when None.
        emphasis: weight of the divergence from the guess; 1 lets it count as one equation.
        heaviest: bound on the mass of every link, or of each in turn [kg].
        total_mass: of all links together [kg], or None where it was not weighed.
    """

    guess: npt.ArrayLike | None = None
    emphasis: float = 1.0
    heaviest: float | Sequence[float] = HEAVIEST
    total_mass: float | None = None

    def __post_init__(self) -> None:
        masses = np.atleast_1d(np.asarray(self.heaviest, dtype=float))
        if not ((masses > 0).all() and self.emphasis > 0):
            raise ModelError(
                f"prior: heaviest is {quoted(self.heaviest)} kg and emphasis {self.emphasis:g};"
                " give more than zero"
            )
        if self.guess is not None and not np.isfinite(np.asarray(self.guess, dtype=float)).all():
            raise ModelError("prior: a number of the guess is not finite; give one for each column")
        if self.total_mass is not None and not self.total_mass > 0:
            raise ModelError(
                f"prior: the total mass is {self.total_mass:g} kg; give what was weighed"
            )

    def masses(self, links: int) -> Array:
        """(links,) bounds on the masses [kg].

        Raises:
            ModelError: there are not as many bounds as links, or the total mass is beyond them.
        """
        given = np.atleast_1d(np.asarray(self.heaviest, dtype=float))
        if given.size not in (1, links):
            raise ModelError(
                f"prior: {given.size} bounds on masses are given for {links} links; give one for"
                " each, or one for all"
            )
        bounds = np.array(np.broadcast_to(given, links))
        if self.total_mass is not None and self.total_mass >= bounds.sum():
            raise ModelError(
                f"prior: the total mass is {self.total_mass:g} kg and the links may have"
                f" {bounds.sum():g} kg; raise heaviest, or check the total mass"
            )
        return bounds
