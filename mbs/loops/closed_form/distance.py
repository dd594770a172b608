"""One joint that brings two centres of a loop to the distance that a rigid link between them tells.

The centres are balls, or turns whose axes meet. Seen from the joint, one of them is at m, the other
one at d beyond the joint. A turn gives X cos t + Y sin t = Z, a slide a quadratic equation. These
are the revolute and the prismatic joint "with length constraint" of Modelica's assemblies.

Source: Khalil & Creusot 1997, section 3.3, equation of type 2; Otter et al. 2003.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import casadi
from casadi import SX

from mbs.loops.closed_form.centre import Centre, centres
from mbs.loops.closed_form.ring import Gap, Ring, Unknown
from mbs.loops.closed_form.root import Root, positions, signed
from mbs.loops.closed_form.survey import always_zero
from mbs.loops.closed_form.trigonometry import across, in_plane, root_angle, square


@dataclass(frozen=True, slots=True, eq=False)
class Span:
    """A rigid link between two centres, and the way around the loop from its end to its start.

    Attributes:
        joints: unknown ones on that way.
        gaps: one before each of them, and one after the last.
        goal: (3, 1) the end of the link, before the first gap.
        start: (3, 1) the start of the link, after the last gap.
        squared: the square of its length.
    """

    joints: tuple[Unknown, ...]
    gaps: tuple[Gap, ...]
    goal: SX
    start: SX
    squared: SX


def spans(ring: Ring, q: SX, p: SX) -> Iterator[Span]:
    """Every rigid link of a loop between two centres."""
    n = len(ring.joints)
    found = centres(ring, q, p)
    for one in found:
        for other in found:
            apart = not set(one.places(n)) & set(other.places(n))
            if apart and (one.first + one.count - other.first) % n == 0:
                yield _span(ring.rotated(one.first), one, other)


def _span(begun: Ring, one: Centre, other: Centre) -> Span:
    """The span between the first centre of a loop and the second one, next to it."""
    link = begun.gaps[one.count].pose
    after = one.count + other.count
    return Span(
        begun.joints[after:],
        (*begun.gaps[after:], begun.gaps[0]),
        other.after,
        one.before,
        square(link.p + link.R @ other.before - one.after),
    )


def at_distance(ring: Ring, q: SX, p: SX) -> Root | None:
    """The two ways to place a joint so that a rigid link fits; None where no link asks for it."""
    for span in spans(ring, q, p):
        if len(span.joints) == 1:
            m, d = _ends(span)
            idle = any(always_zero(in_plane(end), q, p) for end in (m, d))
            if not (idle and span.joints[0].turns):
                return _placed(span.joints[0], m, d, span.squared)
    return None


def _ends(span: Span) -> tuple[SX, SX]:
    """What the joint turns or moves, and the rest of the link, seen from it."""
    before, after = (gap.pose for gap in span.gaps)
    back = before.inverse()
    return -(back.p + back.R @ span.goal), after.p + after.R @ span.start


def _placed(joint: Unknown, m: SX, d: SX, squared: SX) -> Root:
    def value(sign: int) -> SX:
        if joint.turns:
            Z = (squared - square(m) - square(d)) / 2 - m[2] * d[2]
            return root_angle(m[0] * d[0] + m[1] * d[1], -across(m, d), Z, sign).value
        w = m + d
        return SX(sign * casadi.sqrt(squared - w[0] * w[0] - w[1] * w[1]) - w[2])

    return Root({label: positions([joint], (value(sign),)) for label, sign in signed(joint)})
