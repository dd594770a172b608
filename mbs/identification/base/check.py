"""Whether grouping by rules leaves as many parameters as sampled regressors have rank."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Check:
    """What random states say about a set of base parameters.

    Attributes:
        rank: of the regressor in random states.
        agrees: whether the rules alone kept as many parameters.
        relations: what the rules did not find, as equations between columns of the regressor.
        applied: whether these relations took parameters out of the set.
        error: largest difference between the full and the grouped regressor, by the longest
            column of the full one.
        gap: of the singular values at the rank.
        text: the same in one or two sentences.
    """

    rank: int
    agrees: bool
    relations: tuple[str, ...]
    applied: bool
    error: float
    gap: float
    text: str
