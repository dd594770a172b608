"""What a kernel finds: every way to close a loop, as expressions of what is known."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from casadi import SX

from mbs.components.motion import Motion
from mbs.loops.closed_form.ring import Unknown

Positions = Mapping[int, SX]
"""Position of each unknown joint, by its number in q."""


@dataclass(frozen=True, slots=True, eq=False)
class Spun:
    """The spin of a rod at a posture whose quaternion is known.

    Attributes:
        place: number of the spin among the positions.
        angle: expression of all positions [rad].
    """

    place: int
    angle: SX


@dataclass(frozen=True, slots=True, eq=False)
class Root:
    """The ways to close a loop.

    Attributes:
        ways: positions by label, such as "j3:+"; the label is empty where there is one way only.
        spun: the spin on which they depend, if they do.
    """

    ways: Mapping[str, Positions]
    spun: Spun | None = None


def positions(joints: Sequence[Unknown], values: Sequence[SX]) -> Positions:
    """Positions in q from those along the way around the loop; balls are left out."""
    return {
        joint.place: joint.sign * value
        for joint, value in zip(joints, values, strict=True)
        if joint.place is not None and joint.motion is not Motion.SPHERICAL
    }


def signed(joint: Unknown) -> tuple[tuple[str, int], ...]:
    """The labels of a joint with two roots, each with the sign of the root along the loop."""
    return tuple((f"{joint.name}:{label}", sign * joint.sign) for label, sign in _SIGNS)


_SIGNS = (("+", 1), ("-", -1))
