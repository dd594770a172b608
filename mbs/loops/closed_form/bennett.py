"""Bennett's loop: four turns about skew axes, which moves nevertheless.

Opposite links are alike, so that a half turn about a line takes the loop onto itself: it swaps the
axes next to the known one, and takes the known axis to the one opposite. The line lies along the
sum or the difference of the swapped axes; only one of them closes the loop, all the way round.

Source: Bennett 1903.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi
from casadi import SX

from mbs.components.motion import Motion
from mbs.loops.closed_form.ring import Ring
from mbs.loops.closed_form.root import Root, positions
from mbs.loops.closed_form.survey import always_zero
from mbs.loops.closed_form.trigonometry import Angle, in_plane, turn_onto
from mbs.spatial import Pose, vector

_Z = (0.0, 0.0, 1.0)


@dataclass(frozen=True, slots=True, eq=False)
class _Axes:
    """Directions of the axes before, at and after the known one, seen after the last joint."""

    before: SX
    known: SX
    after: SX


def bennett(ring: Ring, q: SX, p: SX) -> Root | None:
    """The only way to close a loop of three unknown turns and a known one; None for other loops."""
    turns = all(joint.motion is Motion.REVOLUTE for joint in ring.joints)
    if len(ring.joints) != 3 or not turns:
        return None
    for first in range(3):
        begun = ring.rotated(first)
        known = begun.gaps[0].pivots
        if len(known) == 1 and not any(gap.pivots for gap in begun.gaps[1:]):
            ways = _closing(begun, known[0], q, p)
            if len(ways) == 1:
                return Root({"": positions(ring.rotated(first).joints, [t.value for t in ways[0]])})
    return None


def _closing(ring: Ring, known: Pose, q: SX, p: SX) -> list[list[Angle]]:
    """The angles by the half turns that close the loop at every position of the known joint."""
    axes = _Axes(vector(_Z), known.R[:, 2], ring.gaps[0].pose.R[:, 2])
    found = list[list[Angle]]()
    for side in (1, -1):
        if not _alike(ring, axes, side, q, p):
            continue
        for swap in (1, -1):
            angles = _angles(ring, axes, swap, side * swap)
            if always_zero(_opening(ring, angles), q, p):
                found.append(angles)
    return found


def _alike(ring: Ring, axes: _Axes, side: int, q: SX, p: SX) -> bool:
    """Whether the twists of the unknown links are those of the known ones opposite."""
    _, R2, R3 = (gap.pose.R for gap in ring.gaps)
    first = R2[2, 2] - side * casadi.dot(axes.before, axes.known)
    second = R3[2, 2] - side * casadi.dot(axes.after, axes.known)
    return always_zero(casadi.vertcat(first, second), q, p)


def _angles(ring: Ring, axes: _Axes, swap: int, sense: int) -> list[Angle]:
    """The three angles when the half turn takes the axis after the known one to swap x before."""
    R1, R2, R3 = (gap.pose.R for gap in ring.gaps)
    line = axes.after + swap * axes.before
    across = 2 * casadi.dot(line, axes.known) / casadi.sumsqr(line)
    opposite = sense * (across * line - axes.known)
    a = turn_onto(in_plane(R2[:, 2]), in_plane(R1.T @ opposite))
    before = Pose.turned(R2.T @ _turned(a).R.T @ R1.T).R @ axes.before
    b = turn_onto(in_plane(R3[:, 2]), in_plane(before))
    c = turn_onto(in_plane(opposite), R3[2, 0:2].T)
    return [a, b, c]


def _opening(ring: Ring, angles: list[Angle]) -> SX:
    """What stays open of the loop, positions and directions."""
    pose = Pose.identity()
    for gap, angle in zip(ring.gaps, angles, strict=True):
        pose = pose @ gap.pose @ _turned(angle)
    return casadi.vec(pose.matrix - Pose.identity().matrix)


def _turned(angle: Angle) -> Pose:
    c, s = casadi.cos(angle.value), casadi.sin(angle.value)
    rows = (casadi.horzcat(c, -s, 0), casadi.horzcat(s, c, 0), casadi.horzcat(SX(0), 0, 1))
    return Pose.turned(casadi.vertcat(*rows))
