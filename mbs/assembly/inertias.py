"""Impossible inertias: an error if the body may rotate about several axes, else a note."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from casadi import DM
from numpy.typing import NDArray

from mbs.assembly.tree import Tree
from mbs.components.bodies import GROUPED, KhalilBody, RigidBody
from mbs.components.joints import Motion
from mbs.components.notes import ImportNote
from mbs.errors import DescriptionError

_PARALLEL = 1e-9
"""Largest sine of the angle between parallel axes: rounding gives 1e-15, designs differ by more."""


def inertia_notes(tree: Tree, bodies: Iterable[tuple[RigidBody, int]]) -> list[ImportNote]:
    """Return notes on bodies whose inertia no mass distribution has, such as Ixx > Iyy + Izz.

    The motion of a body with a single rotation axis depends only on the moment of inertia about it,
    so that such an inertia is only noted.

    Args:
        tree: tree of the mechanism.
        bodies: bodies with values of their parameters, and indices of their links, -1 for the base.

    Raises:
        DescriptionError: a body that may rotate about several axes has an impossible inertia.
    """
    faulty = [(body, link) for body, link in bodies if body.inertia_fault]
    several = _rotating_about_several(tree) if faulty else set()
    notes = []
    for body, link in faulty:
        if link in several:
            grouped = f", {GROUPED}" if isinstance(body, KhalilBody) else ""
            raise DescriptionError(
                f"{body.name}: {body.inertia_fault}; the largest must not exceed the sum of the"
                f" other two, unless the body rotates about one axis only{grouped}"
            )
        text = f"{body.inertia_fault}; it rotates about one axis only"
        notes.append(ImportNote("doubted", f"body {body.name!r}", text))
    return notes


def _rotating_about_several(tree: Tree) -> set[int]:
    """Return the indices of the links that may rotate about axes that are not parallel."""
    several: set[int] = set()
    axes: dict[int, NDArray[np.float64]] = {}  # rotation axis of each link, in its frame
    for j, link in enumerate(tree.links):
        i, R = link.antecedent, link.pose().R
        spins = link.motion is not Motion.PRISMATIC
        by_symbol = i in axes and not R.is_constant()
        if i in several or by_symbol or (spins and link.motion is not Motion.REVOLUTE):
            several.add(j)
        elif i in axes:
            axes[j] = np.array(DM(R)).T @ axes[i]
            if spins and np.hypot(*axes[j][:2]) > _PARALLEL:
                several.add(j)
        elif spins:
            axes[j] = np.array([0.0, 0.0, 1.0])
    return several
