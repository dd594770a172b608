"""Turns from the orientations around a loop, before anything is known of its slides.

Turns about one direction are one: the loop is made of up to three directions. One turn is what is
missing; of two directions each turn brings the other axis to where it belongs, those that share
their direction with others staying unknown; three turns are solved as a spherical loop.

Source: Khalil & Creusot 1997, section 3.3; for RCCC loops Duffy 1980.
"""

from __future__ import annotations

from casadi import SX

from mbs.components.motion import Motion
from mbs.loops.closed_form.centre import centres
from mbs.loops.closed_form.ring import Ring
from mbs.loops.closed_form.root import Root, positions
from mbs.loops.closed_form.sphere import sphere
from mbs.loops.closed_form.survey import parallel, with_elbow
from mbs.loops.closed_form.trigonometry import in_plane, last_angle, turn_onto


def orientation(ring: Ring, q: SX, p: SX) -> Root | None:
    """The turns that orientations alone give; None where there is none."""
    if any(joint.motion not in (Motion.REVOLUTE, Motion.PRISMATIC) for joint in ring.joints):
        return None
    turns = _turns_alone(ring)
    directions, shared = _directions(turns, q, p)
    match len(directions.joints):
        case 1 if not shared:
            (joint,) = directions.joints
            return Root({"": positions([joint], [last_angle(in_plane(directions.gaps[0].pose.R))])})
        case 2 if len(shared) < 2:
            return _of_two(directions, shared)
        case 3 if not shared and _placed(ring, turns, q, p):
            return sphere(with_elbow(directions, q))
    return None


def _turns_alone(ring: Ring) -> Ring:
    """The loop with its slides held at zero."""
    for k, joint in enumerate(ring.joints):
        if joint.motion is Motion.PRISMATIC:
            return _turns_alone(ring.without(k))
    return ring


def _directions(ring: Ring, q: SX, p: SX) -> tuple[Ring, frozenset[str]]:
    """One turn for each direction, and the names of those that stand for several."""
    shared, k = set[str](), 0
    while k < len(ring.joints) > 1:
        if parallel(ring.gaps[k].pose, q, p):
            shared.discard(ring.joints[k].name)
            shared.add(ring.joints[k - 1].name)
            ring = ring.without(k)
        else:
            k += 1
    return ring, frozenset(shared)


def _placed(ring: Ring, turns: Ring, q: SX, p: SX) -> bool:
    """Whether positions do not hinder three turns: slides are free, or the axes meet."""
    if len(ring.joints) == len(turns.joints):
        return any(centre.count == 3 for centre in centres(ring, q, p))
    return len(ring.joints) == len(turns.joints) + 3


def _of_two(ring: Ring, shared: frozenset[str]) -> Root:
    values: dict[int, SX] = {}
    for begun in (ring, ring.rotated(1)):
        joint, (R1, R2) = begun.joints[0], (gap.pose.R for gap in begun.gaps)
        if joint.name not in shared:
            turn = turn_onto(R2[0:2, 2], R1[2, 0:2].T)
            values |= positions([joint], [turn.value])
    return Root({"": values})
