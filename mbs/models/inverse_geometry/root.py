"""A solution of a chain, before it is completed to a configuration of the robot."""

from __future__ import annotations

from dataclasses import dataclass

from mbs.closed_forms.arm import Array
from mbs.models.inverse_geometry.self_motions import Family

MOST_ROOTS = 16
"""Roots of a pose of six joints; fewer joints have fewer."""


@dataclass(frozen=True, slots=True, eq=False)
class ChainRoot:
    """A solution of the chain.

    Attributes:
        q: (n,) configuration [rad or m].
        label: of the branch it comes from, "" where it comes from none.
        multiplicity: how many roots meet in it, 0 on a self-motion.
        family: the self-motion that it stands for.
        branches: of a closed form that meet in it.
        at_most: whether the multiplicity is an upper bound.
        undecided: whether double precision does not decide that it is one solution of its own.
    """

    q: Array
    label: str
    multiplicity: int
    family: Family | None = None
    branches: frozenset[str] = frozenset()
    at_most: bool = False
    undecided: bool = False
