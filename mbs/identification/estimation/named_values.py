"""Values that have names and a covariance: what estimates and full sets share."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
import numpy.typing as npt

from mbs.errors import ModelError
from mbs.identification.regressors.columns import Column
from mbs.messages import did_you_mean

Array = npt.NDArray[np.float64]


class NamedValues:
    """Parameters by name, and how sure they are.

    Attributes:
        what: they are, for messages.
        columns: the k parameters.
        values: (k,) in the unit of each.
        covariance: (k, k) of the values.
    """

    __slots__ = ()
    what: ClassVar[str]
    columns: tuple[Column, ...]
    values: Array
    covariance: Array

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return tuple(column.name for column in self.columns)

    def __getitem__(self, name: str) -> float:
        if name not in self.names:
            raise ModelError(
                f"{self.what}: there is no parameter {name!r}; {did_you_mean(name, self.names)}"
            )
        return float(self.values[self.names.index(name)])

    @property
    def deviations(self) -> Array:
        """(k,) standard deviations, in the unit of each parameter."""
        return np.asarray(np.sqrt(np.diag(self.covariance)), dtype=float)

    @property
    def percent(self) -> Array:
        """(k,) standard deviations in percent of the values; infinite for a value of zero."""
        return percent_of(self.values, self.covariance)


def percent_of(values: Array, covariance: Array) -> Array:
    """(k,) standard deviations in percent of the values; infinite for a value of zero."""
    sizes = np.abs(values)
    share = 100 * np.sqrt(np.diag(covariance)) / np.where(sizes > 0, sizes, 1.0)
    return np.asarray(np.where(sizes > 0, share, np.inf), dtype=float)
