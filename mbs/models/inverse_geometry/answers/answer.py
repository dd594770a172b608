"""From the solutions of a chain to those of the robot: names of branches, loops, reasons."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mbs.models.inverse_geometry.answers.distinct import distinct
from mbs.models.inverse_geometry.answers.families import Family
from mbs.models.inverse_geometry.answers.labels import Anatomy, anatomy, labels
from mbs.models.inverse_geometry.answers.reasons import unreachable
from mbs.models.inverse_geometry.answers.roots import ChainPlace, ChainRoot
from mbs.models.inverse_geometry.answers.solutions import Solutions
from mbs.models.inverse_geometry.answers.target import Target
from mbs.models.inverse_geometry.answers.wishes import RobotSolution, Wishes
from mbs.models.inverse_geometry.arm import Array
from mbs.models.inverse_geometry.chain import Chain
from mbs.models.inverse_geometry.numeric.nearest import Nearest, nearest
from mbs.models.inverse_geometry.whole_robots.closed_robot import ClosedPosture, close, why_searched

_NO_LOOP = "the loops stay open: the joints on the way to the frame reach the pose, the others not"


@dataclass(frozen=True, slots=True, eq=False)
class Question:
    """A pose of a frame at the end of a chain.

    Attributes:
        chain: that is solved for.
        target: its wanted pose.
        p: (np,) parameters.
        wishes: what the user asks for beside the pose.
    """

    chain: Chain
    target: Target
    p: Array
    wishes: Wishes

    @property
    def place(self) -> ChainPlace:
        """Where the chain stands in the robot."""
        return ChainPlace(self.chain.places, self.whole)

    def whole(self, q: Array) -> Array:
        """(nq,) the posture of the robot for that of its chain, (n,); NaN where loops stay open."""
        postures = self.closed(q)
        return postures[0].q if postures else np.full(self.chain.system.nq, np.nan)

    def closed(self, q: Array) -> list[ClosedPosture]:
        """The postures of the robot for that of its chain, (n,): several where loops allow."""
        near = self.wishes.near
        if self.chain.system.is_closed:
            return close(self.chain.system, self.chain, q[None, :], self.p, near)
        whole = near.copy()
        whole[list(self.chain.places)] = q
        return [ClosedPosture(whole, "", 0.0)]


def answer(question: Question, found: list[ChainRoot], method: str) -> Solutions:
    """The solutions of the robot, or why there is none.

    Args:
        question: what was asked for.
        found: the solutions of the chain.
        method: that gave them.
    """
    if not found:
        closest = nearest(question.target.arm, question.target.T)
        reason = unreachable(question.target, closest)
        return question.wishes.solutions([], method, reason, _whole(question, closest))
    drafts = _drafts(question, _named(question, _shown(question, found)))
    if why_searched(question.chain.system, question.chain) is not None:
        method += ", loops by search"
    return question.wishes.solutions(drafts, method, "" if drafts else _NO_LOOP)


def _drafts(question: Question, found: list[ChainRoot]) -> list[RobotSolution]:
    """The solutions of the robot: several for one of the chain where its loops allow."""
    target = question.target
    q = np.array([root.q for root in found])
    residual, sigma = target.residual(q), target.singular_values(q)[:, -1]
    return [
        RobotSolution(
            posture.q,
            "; ".join(label for label in (root.label, posture.label) if label),
            max(float(residual[k]), posture.residual),
            float(sigma[k]),
            root.multiplicity,
            root.family,
        )
        for k, root in enumerate(found)
        for posture in question.closed(q[k])
    ]


def _named(question: Question, found: list[ChainRoot]) -> list[ChainRoot]:
    """With the names of shoulder, elbow and wrist where the arm has them, else a number."""
    way, arm = question.chain, question.target.arm
    key = ("anatomy", *way.key, question.p.tobytes())
    has: Anatomy = way.system.cached(key, lambda: anatomy(arm))
    named = labels(arm, has, np.array([root.q for root in found]))
    names = [name or root.label for name, root in zip(named, found, strict=True)]
    seen = dict[str, int]()
    result = []
    for k, (root, name) in enumerate(zip(found, names, strict=True)):
        seen[name] = seen.get(name, 0) + 1
        again = f"{name} ({seen[name]})" if name and names.count(name) > 1 else name
        result.append(replace(root, label=again or str(k + 1)))
    return result


def _shown(question: Question, found: list[ChainRoot]) -> list[ChainRoot]:
    """With the postures that stand for self-motions; those that prove to be one are listed once."""
    shown = list[ChainRoot]()
    for root in found:
        if root.family is None:
            shown.append(root)
            continue
        q = _representative(question, root.family)
        if not any(_is_same(question.target, other, root.family, q) for other in shown):
            shown.append(replace(root, q=q))
    return shown


def _is_same(target: Target, other: ChainRoot, family: Family, q: Array) -> bool:
    """Whether a root is a self-motion of the same joints through the same posture q, (n,)."""
    if other.family is None or other.family.moving != family.moving:
        return False
    return len(distinct(target, np.array([other.q, q]))) == 1


def _representative(question: Question, family: Family) -> Array:
    """The posture of a self-motion that is within limits, its free joint near the seed's."""
    places, near = list(question.chain.places), question.wishes.near
    value = float(near[places[question.chain.names.index(family.free)]])
    first = family.nearest(value)
    for q in (first, *family.postures_from(value)):
        whole = near.copy()
        whole[places] = q
        if not set(question.wishes.bounds.outside(whole)) & set(question.chain.names):
            return np.asarray(q)
    return first


def _whole(question: Question, found: Nearest) -> Nearest:
    """The nearest pose with the posture of the whole robot; NaN where its loops stay open."""
    whole = question.whole(found.q)
    if not np.all(np.isfinite(whole)):
        return replace(found, q=whole)
    return replace(found, q=question.wishes.bounds.wound(whole, question.wishes.near))
