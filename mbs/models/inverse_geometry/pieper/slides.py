"""Three joints that slide, anywhere in the loop: the turns first, then three linear equations.

Source: Pieper 1968; Khalil & Creusot 1997, section 3.3 for the types of equations.
"""

from __future__ import annotations

import casadi
import numpy as np
from casadi import SX

from mbs.errors import NoClosedForm
from mbs.loops.sequence import Step, step
from mbs.loops.sequence.step import Found
from mbs.models.inverse_geometry.pieper.forms import PieperLoop
from mbs.models.inverse_geometry.pieper.orientation import three_turns
from mbs.spatial import Pose

_TINY = 1e-280


def three_slides(scene: PieperLoop) -> list[Step]:
    """The steps of a loop of three joints that turn and three that slide.

    Raises:
        NoClosedForm: two of the turning axes are always parallel, or the slides coplanar.
    """
    turns = scene.ring
    for k in reversed([k for k, joint in enumerate(turns.joints) if not joint.turns]):
        turns = turns.without(k)
    names = ", ".join(joint.name for joint in turns.joints)
    if any(scene.zero(gap.pose.R[:2, 2]) for gap in turns.gaps):
        raise NoClosedForm(
            f"joints {names} turn and the others slide, but two of the three axes stay parallel,"
            " so that the turns are not determined"
        )
    first = int(np.argmax([len(casadi.symvar(gap.pose.R)) for gap in turns.gaps]))
    begun = PieperLoop(scene.problem, turns.rotated(first), scene.length)
    A, B, G = begun.after(0).pose.R, begun.after(1).pose.R, begun.after(2).pose.R.T
    return [*three_turns(begun, (0, 1, 2), A, B, G), _slides(scene)]


def _slides(scene: PieperLoop) -> Step:
    """The joints that slide, from the sum of all ways around the loop."""
    way, places, columns = Pose.identity(), list[int](), list[SX]()
    for k, (joint, gap) in enumerate(zip(scene.ring.joints, scene.ring.gaps, strict=True)):
        way = way @ gap.pose
        if joint.turns:
            way = way @ scene.motion(k)
        else:
            columns.append(joint.sign * way.R[:, 2])
            places.append(k)
    M = casadi.horzcat(*columns)
    adjugate = casadi.horzcat(*(_cross(M, k) for k in range(3))).T
    determinant = casadi.dot(M[:, 0], _cross(M, 0))
    if scene.zero(determinant):
        names = ", ".join(scene.ring.joints[k].name for k in places)
        raise NoClosedForm(f"joints {names} slide in one plane, so that they are not determined")
    r = -casadi.mtimes(adjugate, way.p) * determinant / (determinant * determinant + _TINY)
    ends = [scene.suffix(k) for k in places]
    values = {scene.place(k): r[m] for m, k in enumerate(places)}
    return step(
        scene.problem,
        "linear",
        _text(scene, places, ends),
        {},
        Found(values, (), (determinant * determinant,), _named(M, way.p, ends)),
    )


def _cross(M: SX, k: int) -> SX:
    """(3, 1) the vector product of the two columns after column k."""
    return SX(casadi.cross(M[:, (k + 1) % 3], M[:, (k + 2) % 3]))


def _named(M: SX, p: SX, ends: list[str]) -> dict[str, SX]:
    named = {f"{axis}{end}": M[m, k] for k, end in enumerate(ends) for m, axis in enumerate("XYZ")}
    return named | {f"{axis}0": p[m] for m, axis in enumerate("XYZ")}


def _text(scene: PieperLoop, places: list[int], ends: list[str]) -> str:
    names = [scene.ring.joints[k].name for k in places]
    rows = (
        " + ".join(f"{axis}{end} {name}" for end, name in zip(ends, names, strict=True))
        for axis in "XYZ"
    )
    return ", ".join(f"{row} + {axis}0 = 0" for row, axis in zip(rows, "XYZ", strict=True))
