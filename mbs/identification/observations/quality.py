"""How well a record shows the parameters, and which it does not show."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from mbs.errors import ModelError
from mbs.identification.estimation.triangle import triangle
from mbs.identification.observations.observations import Observations

Array = npt.NDArray[np.float64]

_NOTHING = 1e-9
_DEPENDENT = 1e-7
_SHARE = 0.05
_LISTED = 8


@dataclass(frozen=True, slots=True, eq=False)
class ExcitationQuality:
    """The singular values of the observations, and the parameters behind those that are zero.

    Attributes:
        condition: largest over smallest singular value of W.
        scaled_condition: the same with every column of length one, which no choice of units moves.
        singular_values: (k,) of the scaled columns, those of unseen parameters zero.
        unseen: parameters that no effort depends on.
        inseparable: parameters of which only combinations can be found, more than those that the
            combinations need.
    """

    condition: float
    scaled_condition: float
    singular_values: Array
    unseen: tuple[str, ...]
    inseparable: tuple[str, ...]

    @property
    def sentence(self) -> str:
        """What is wrong with the record, or an empty text."""
        parts = []
        if self.unseen:
            parts.append(f"{_listed(self.unseen)} cannot be seen at all")
        if self.inseparable:
            parts.append(f"{_listed(self.inseparable)} cannot be told apart")
        return " and ".join(parts)


def excitation_quality(observations: Observations) -> ExcitationQuality:
    """The condition number of the observations and the parameters that they do not show.

    Columns of zeros are taken out first, then every column is scaled to length one; otherwise
    rounding would count as a column.

    Source: Gautier 1991 (numerical rank); Presse & Gautier 1993 (condition number).
    """
    R = triangle(observations.rows[0])
    names = np.array(observations.names)
    lengths = np.linalg.norm(R, axis=0)
    seen = lengths > _NOTHING * max(float(lengths.max(initial=0.0)), 1e-300)
    _, values, modes = np.linalg.svd(R[:, seen] / lengths[seen])
    values = np.concatenate([values, np.zeros(len(modes) - len(values))])
    null = modes[values <= _DEPENDENT * values.max(initial=0.0)]
    inseparable = names[seen][np.abs(null).max(axis=0, initial=0.0) > _SHARE]
    missing = np.zeros(int((~seen).sum()))
    raw = np.linalg.svd(R, compute_uv=False)
    full = len(null) == 0 and len(missing) == 0 and len(R) >= len(names)
    return ExcitationQuality(
        float(raw[0] / raw[-1]) if full else float("inf"),
        float(values[0] / values[-1]) if full else float("inf"),
        np.concatenate([values, missing]),
        tuple(str(name) for name in names[~seen]),
        tuple(str(name) for name in inseparable),
    )


def require_visible(observations: Observations) -> ExcitationQuality:
    """The quality of observations that show every parameter.

    Raises:
        ModelError: names the parameters that cannot be seen or told apart.
    """
    count, rows = len(observations.columns), len(observations)
    if rows < count:
        dropped = observations.dropped
        left_out = f", {dropped} next to singular postures being left out" if dropped else ""
        raise ModelError(
            f"observations: {rows} equations are too few for {count} parameters{left_out}; give a"
            " longer record"
        )
    quality = excitation_quality(observations)
    if quality.sentence:
        raise ModelError(
            f"observations: {quality.sentence} in this record; group them with base_parameters,"
            " select others, or record a motion that excites them"
        )
    return quality


def _listed(names: tuple[str, ...]) -> str:
    more = len(names) - _LISTED
    return ", ".join(names[:_LISTED]) + (f" and {more} more" if more > 0 else "")
