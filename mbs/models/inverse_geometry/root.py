"""Solution of a serial chain, before it is completed to a configuration of the robot."""

from __future__ import annotations

from dataclasses import dataclass

from mbs.closed_forms.arm import Array
from mbs.models.inverse_geometry.self_motions import Family

MOST_ROOTS = 16
"""Largest number of isolated solutions of a six-joint chain for one pose (16); shorter chains have
fewer."""


@dataclass(frozen=True, slots=True, eq=False)
class ChainRoot:
    """Solution of the inverse geometric model of a chain.

    Attributes:
        q: (n,) configuration [rad or m].
        label: name of its closed-form branch, "" without a branch.
        multiplicity: number of coinciding roots, 0 on a self-motion.
        family: self-motion through q, or None for an isolated solution.
        branches: names of all closed-form branches that meet in q.
        at_most: whether the multiplicity is an upper bound.
        undecided: whether double precision cannot decide if the merged roots are one solution.
    """

    q: Array
    label: str
    multiplicity: int
    family: Family | None = None
    branches: frozenset[str] = frozenset()
    at_most: bool = False
    undecided: bool = False
