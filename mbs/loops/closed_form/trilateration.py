"""A point that two or three slides move and as many rigid links hold: spheres that meet.

Each link tells the distance of a point on what the slides move from a known centre:
s'M s + 2 c_i's + k_i = 0 in the displacements s. Their differences are linear; the line that they
leave is cut with the first sphere. The sign says on which side of the plane of the centres the
point is, the first three of which are counted counterclockwise about its normal (of two centres: to
the left of the line from the first to the second).

Source: Clavel 1988.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import casadi
from casadi import SX

from mbs.components.motion import Motion
from mbs.loops.closed_form.distance import Span
from mbs.loops.closed_form.root import Root
from mbs.loops.closed_form.survey import always_zero
from mbs.spatial import Pose, cross, vector


@dataclass(frozen=True, slots=True, eq=False)
class _Sphere:
    """s'M s + 2 c's + k = 0.

    Attributes:
        M: (n, n) of the directions of the slides.
        c: (n, 1).
        k: what is left.
    """

    M: SX
    c: SX
    k: SX


def slid_places(span: Span) -> frozenset[int] | None:
    """Numbers in q of the slides between the ends of a link, where these are two or three."""
    if any(joint.motion is not Motion.PRISMATIC for joint in span.joints):
        return None
    places = frozenset(joint.place for joint in span.joints if joint.place is not None)
    return places if len(places) in (2, 3) else None


def independent_links(spans: Mapping[int, Span], q: SX, p: SX) -> list[int] | None:
    """Which links hold the point, the others holding it likewise; None where they are too few.

    Args:
        spans: with the same slides between their ends, by number of the loop.
        q: symbols of positions.
        p: symbols of parameters.
    """
    places = sorted(slid_places(next(iter(spans.values()))) or ())
    found, centres = list[int](), list[SX]()
    for number, span in spans.items():
        centre = _sphere(span, places).c
        apart = [other - centres[0] for other in (*centres[1:], centre) if centres]
        if not centres or not always_zero(_spanned(apart), q, p):
            found.append(number)
            centres.append(centre)
        if len(found) == len(places):
            return found
    return None


def _spanned(a: Sequence[SX]) -> SX:
    """What vanishes where vectors do not differ in direction."""
    return a[0] if len(a) == 1 else cross(a[0], a[1])


def held_point(name: str, spans: Sequence[Span]) -> Root:
    """The two places of a point that rigid links hold.

    Args:
        name: for the labels.
        spans: as many as there are slides between the ends of each of them.
    """
    places = sorted(slid_places(spans[0]) or ())
    spheres = [_sphere(span, places) for span in spans]
    first = spheres[0]
    base, along = _line(spheres)
    A, B = casadi.bilin(first.M, along, along), casadi.dot(along, first.M @ base + first.c)
    C = casadi.bilin(first.M, base, base) + 2 * casadi.dot(first.c, base) + first.k
    root = casadi.sqrt(B * B - A * C)
    ways = {}
    for label, sign in (("+", 1), ("-", -1)):
        point = base + along * ((sign * root - B) / A)
        ways[f"{name}:{label}"] = {place: point[k] for k, place in enumerate(places)}
    return Root(ways)


def _sphere(span: Span, places: Sequence[int]) -> _Sphere:
    pose, axes = Pose.moved(-span.goal), dict[int | None, SX]()
    for joint, gap in zip(span.joints, span.gaps, strict=False):
        pose = pose @ gap.pose
        axes[joint.place] = joint.sign * pose.R[:, 2]
    pose = pose @ span.gaps[-1].pose
    e = pose.p + pose.R @ span.start
    U = casadi.horzcat(*(axes[place] for place in places))
    return _Sphere(U.T @ U, U.T @ e, casadi.sumsqr(e) - span.squared)


def _line(spheres: Sequence[_Sphere]) -> tuple[SX, SX]:
    """A point and the direction of the line on which the spheres meet."""
    first, *others = spheres
    a = [other.c - first.c for other in others]
    h = [(first.k - other.k) / 2 for other in others]
    if len(a) == 1:
        along = vector([a[0][1], -a[0][0]])
        return h[0] * a[0] / casadi.sumsqr(a[0]), along
    along = cross(a[0], a[1])
    base = h[0] * cross(a[1], along) + h[1] * cross(along, a[0])
    return base / casadi.sumsqr(along), along
