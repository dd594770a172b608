"""What is to be solved: a loop, the symbols in it, and numbers at which it closes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from casadi import DM, SX, Function
from numpy.typing import NDArray

from mbs.loops.closed_form.ring import Ring

Matrix = NDArray[np.float64]

_ZERO = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """A loop whose joints are looked for.

    Attributes:
        ring: the loop; the place of each joint is its number in x.
        x: (2 n, 1) symbols of the positions of its n joints [rad or m], then of as many further
            angles that a solution may use, such as sums of joint angles.
        given: (m, 1) symbols of everything that is known: parameters, and the pose to be reached.
        samples: values of x[:n] and given, (n,) and (m,), at which the loop closes; the positions
            are generic, and so are symbolic lengths.
    """

    ring: Ring
    x: SX
    given: SX
    samples: Sequence[tuple[Matrix, Matrix]]

    @property
    def size(self) -> int:
        """The number of joints."""
        return len(self.ring.joints)

    def at_samples(self, values: SX) -> list[Matrix]:
        """The values of an expression of x and given at every sample; further angles are zero."""
        function = Function("values", [self.x, self.given], [values])
        rest = np.zeros(self.x.numel() - self.size)
        return [
            np.array(DM(function(np.concatenate([x, rest]), given))) for x, given in self.samples
        ]

    def always_zero(self, values: SX) -> bool:
        """Whether an expression of x and given vanishes wherever the loop closes."""
        return all(bool(np.all(np.abs(sample) < _ZERO)) for sample in self.at_samples(values))
