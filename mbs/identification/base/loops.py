"""Relations between the parameters of a mechanism with closed loops.

Either side of a cut joint may carry a body that looks the same from both, and links that never
turn relative to each other share their inertia tensors. For the rates of links and joints see
`turning`.

Source: Khalil & Bennis 1995 and Bennis & Khalil 1990 for parallelograms; cut joints as there.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import casadi
import numpy as np
from casadi import DM, SX, Function
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.assembly.khalil_frames import Cut
from mbs.components import ConstantVelocity, Fixed
from mbs.components.constraints import Constraint
from mbs.components.motion import Freedom, Motion
from mbs.identification.base.lambda_transform import lambda_transform
from mbs.identification.base.rules import Key, on_link
from mbs.recursions.poses import base_poses, link_poses
from mbs.spatial import Pose, align_z, nearest_rotation
from mbs.spatial.inertia import TEN_PARAMETERS

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class ClosedPostures:
    """Postures that close the loops.

    Attributes:
        q: (nq, postures).
        p: (np,) the parameters for which they do.
    """

    q: Array
    p: Array


Relation = dict[Key, SX]
"""Coefficients of parameters whose effects cancel."""

_SAME = 1e-9

_TENSOR = TEN_PARAMETERS[:6]
_SYMMETRIC = (("XX", "YY"), ("MZ",), ("M",))
"""Of a body that looks the same after any turn about z: each tuple varies together."""


def cut_relations(system: System) -> Iterator[Relation]:
    """What a body in the common frame of a cut joint does is the same on either side of it."""
    for cut in system.cuts:
        axis, shared = _shared(cut)
        sides = [(cut.link_a, cut.pose_a, 1), (cut.link_b, cut.pose_b, -1)]
        through = {
            link: (lambda_transform(pose @ axis), sign) for link, pose, sign in sides if link >= 0
        }
        for kinds in shared:
            relation: Relation = {}
            for link, (matrix, sign) in through.items():
                numbers = [TEN_PARAMETERS.index(kind) for kind in kinds]
                relation |= on_link(link, sign * casadi.sum2(matrix[:, numbers]))
            yield relation


def _shared(cut: Cut) -> tuple[Pose, tuple[tuple[str, ...], ...]]:
    """The frame in which a body is taken, and combinations that both sides see alike."""
    joint = cut.edge.joint
    freedoms = joint.freedoms
    if cut.welded or isinstance(joint, Fixed):
        return Pose.identity(), tuple((name,) for name in TEN_PARAMETERS)
    if isinstance(joint, Constraint):
        held = isinstance(joint, ConstantVelocity)
        return Pose.identity(), _SYMMETRIC[2:] if held else ()
    turning = [freedom for freedom in freedoms if freedom.motion is not Motion.PRISMATIC]
    if not turning:
        return Pose.identity(), tuple((name,) for name in _TENSOR)
    if any(freedom.motion is Motion.FREE for freedom in freedoms):
        return Pose.identity(), ()
    slides = len(turning) < len(freedoms)
    if len(turning) == 1 and turning[0].motion is Motion.REVOLUTE:
        return _along(turning[0]), _SYMMETRIC[:1] if slides else _SYMMETRIC
    return Pose.identity(), () if slides else _SYMMETRIC[2:]


def _along(freedom: Freedom) -> Pose:
    return Pose.turned(align_z(freedom.axis))


def pair_relations(
    system: System, postures: Sequence[ClosedPostures], *, base_moves: bool = False
) -> Iterator[Relation]:
    """Links whose orientations stay the same relative to each other or to the base.

    Args:
        system: with closed loops.
        postures: on the branch; more than one set where lengths are symbols.
        base_moves: whether the base turns, so that origins that keep their distance move apart.
    """
    poses = [_link_poses(system, each) for each in postures]
    R = np.concatenate([turns for turns, _ in poses], axis=1)
    for b in range(1, len(R)):
        for a in range(b):
            relative = np.einsum("sji,sjk->sik", R[a], R[b])
            if _constant(relative):
                same = not base_moves and (a == 0 or _side_by_side(poses, a, b))
                yield from _shared_by_pair(a - 1, b - 1, _rotation(relative[0]), same)


def _rotation(R: Array) -> SX:
    """A constant rotation as measured at closed configurations, which are open by some 1e-13."""
    return SX(DM(nearest_rotation(R.tolist(), noise=1e-12)))


def _side_by_side(poses: Sequence[tuple[Array, Array]], a: int, b: int) -> bool:
    """Whether two origins keep their distance and its direction, so that they move alike."""
    return all(_constant(origins[b] - origins[a]) for _, origins in poses)


def _shared_by_pair(a: int, b: int, R: SX, moments: bool) -> Iterator[Relation]:
    """What link b shares with link a, or loses to the base."""
    through = lambda_transform(Pose.turned(R))
    names = TEN_PARAMETERS[: (9 if a < 0 else 10) if moments else 6]
    for k, name in enumerate(names):
        yield {(b, name): SX(1), **(on_link(a, -through[:, k]) if a >= 0 else {})}


def _link_poses(system: System, postures: ClosedPostures) -> tuple[Array, Array]:
    """Orientations (1 + links, postures, 3, 3) and origins (.., 3) of the base and all links."""
    q = SX.sym("q", system.nq)
    poses = [Pose.identity(), *base_poses(system.tree, link_poses(system.tree, q))]
    at = Function("poses", [q, system.p], [casadi.horzcat(*(pose.matrix for pose in poses))])
    T = [np.array(at(position, postures.p)) for position in postures.q.T]
    matrices = np.array(T).reshape(len(T), 4, len(poses), 4).transpose(2, 0, 1, 3)
    return matrices[..., :3, :3], matrices[..., :3, 3]


def _constant(values: Array) -> bool:
    return bool(np.max(np.abs(values - values[0])) < _SAME)
