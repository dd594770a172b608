"""Draft of one pose: solutions of a closed form, the general method or a search, with copies."""

from __future__ import annotations

from typing import NamedTuple

import casadi
import numpy as np
from casadi import DM, SX, Function
from numpy.typing import NDArray

from mbs.closed_forms.arm import Array
from mbs.closed_forms.arm_search import (
    General,
    general,
    general_of,
    polish,
    search,
    wrapped,
)
from mbs.closed_forms.sequence import StepSequence
from mbs.errors import ModelError, NoClosedForm
from mbs.models.inverse_geometry.chain import FrameChain
from mbs.models.inverse_geometry.closed_form import (
    CLOSED_FORMS,
    closed_form_name,
    given_of,
    require_method,
    sequence_or_none,
)
from mbs.models.inverse_geometry.solutions import PoseDraft
from mbs.models.inverse_geometry.target import SINGULAR, Target
from mbs.numbers import NONZERO

METHODS = ("auto", *CLOSED_FORMS, "general", "search")
"""Values of the argument `method` of `solve`."""

_BRANCH_NEAR = 1e-2
"""Largest residual, relative to max(1 m, arm length), of a branch that is refined. Complex branches
near a double root have a small residual, other invalid branches a large one."""
_DEGENERATE = 1e-5
"""Regularity (squared, dimensionless) below which a step loses digits and may miss roots: it loses
5 of 16 digits in the square and half as many in the angle."""
EXACT = 2e-15
"""Residual, relative to max(1 m, arm length), that is a rounding error of the forward model."""
_ILL_CONDITIONED = 1e-9
"""Regularity of the general method below which it may miss solutions: a simple root has seven
correct digits there, a double root three."""
NOT_VARIED = np.zeros(0)
"""Positions of the varied joints of a chain that has none."""
_STARTS = 300
"""Starts of the search. The rarest of the sixteen configurations of the arm of Manseur and Doty is
reached from every thirtieth start, so that 300 starts miss it with a probability of 4e-5."""
_KEPT = 256
"""Maximum number of cached arms, one per position of locked joints, tens of kilobytes each."""


def pose_draft(
    chain: FrameChain, target: Target, method: str, p: Array, r: Array = NOT_VARIED
) -> PoseDraft:
    """Compute solutions by one method, or by the first method that applies to the chain.

    Args:
        chain: chain that is solved for.
        target: target pose of the numeric chain with its varied joints at r.
        method: "pieper", "paul", "general", "search", or "auto" for a closed form, else the general
            method for six joints, else the search.
        p: (np,) parameter values.
        r: (k,) positions of the varied joints of the chain [rad or m].

    Raises:
        NoClosedForm: method is "pieper" or "paul" and does not apply to the chain.
        ModelError: the method is unknown or does not apply to the chain.
    """
    require_method(chain.system, method, METHODS)
    sequence = sequence_or_none(chain, method, p)
    if sequence is not None:
        return _by_closed_form(chain, target, sequence, p, r)
    if method == "search":
        return search_draft(target)
    ready = general_ready(chain.locked_at(r) if chain.varied else chain, p)
    if ready is None and method == "general":
        raise ModelError(
            f"{chain.system.name}: the general method does not hold for the joints"
            f" {', '.join(chain.names)}: it is for six joints, and not for all with prismatic ones;"
            " use method='search'"
        )
    return search_draft(target) if ready is None else _by_general(target, ready)


def extend_draft(chain: FrameChain, target: Target, draft: PoseDraft, p: Array) -> PoseDraft:
    """Add the solutions of the general method and the solutions along valleys."""
    ready = general_ready(chain, p)
    if draft.method not in ("general", "search") and ready is not None:
        draft = join_drafts(draft, _by_general(target, ready))
    return _add_valley_solutions(target, draft)


def join_drafts(draft: PoseDraft, more: PoseDraft) -> PoseDraft:
    """Return the union of two drafts, marked as certain."""
    q = np.concatenate([draft.q, more.q])
    residual = np.concatenate([draft.residual, more.residual])
    labels = draft.labels + more.labels
    return PoseDraft(q, residual, labels, None, True, draft.method, draft.near)


# Solutions at the far end of a valley of the residual. Near a singular configuration with a
# self-motion, the residual stays small along nearly the same motion (a valley). Another solution
# may exist half a revolution away along it. Steps of a closed form coincide there, and a search
# finds neither solution.


_NEARLY_MOVES = 1e-6
"""Largest residual, relative to max(1 m, arm length), along a valley. Near a fold, where two
solutions meet, the residual at the same distance is about 1e-3."""
_ALONG = 0.2
"""Step along a valley [rad or arm lengths] that four Newton steps correct. A solution attracts
configurations within a quarter revolution."""
_SETTLED = 1e-8  # Newton step [rad or arm lengths] after which the error, its square, is rounding
_STEPS_ALONG = 32  # number of steps along a valley, a full revolution
_CROSSINGS = 8  # iterations of false position; along a sine each doubles the number of digits


def _add_valley_solutions(target: Target, draft: PoseDraft) -> PoseDraft:
    """Add the solutions along the valleys that start at singular solutions."""
    if target.arm.size != 6:
        return draft
    s = target.singular_values(draft.q) if len(draft.q) else np.zeros((0, 6))
    singular, twice = s[:, -1] < SINGULAR, s[:, -2] < SINGULAR
    starts = [draft.q[singular], np.zeros((0, 6)) if draft.near is None else draft.near]
    start = np.concatenate(starts) / target.unit
    found = _far_ends(target, start) if len(start) else []
    if np.any(twice):
        found += _around(target, draft.q[twice] / target.unit)
    if not found:
        return draft
    q = wrapped(target.arm, np.concatenate(found) * target.unit)
    return join_drafts(draft, _solutions_among(target, q))


def _far_ends(target: Target, start: Array) -> list[Array]:
    """Return solutions x (k, 6) along the valleys through singular configurations (m, 6)."""
    here = _valley_at(target, start)._replace(x=start)
    back = here._replace(along=-here.along)
    valley = _Valley(*(np.concatenate(parts) for parts in zip(here, back, strict=True)))
    scale, found = max(1.0, target.arm.length), list[Array]()
    for _ in range(_STEPS_ALONG):
        ahead = _valley_at(target, valley.x + _ALONG * valley.along).like(valley)
        # a valley ends if the residual rises or the correction is large
        going = ahead.residual < _NEARLY_MOVES * scale
        going &= np.linalg.norm(ahead.x - valley.x, axis=1) < 2 * _ALONG
        crossed = going & (ahead.height * valley.height < 0) & (valley.residual > target.decided)
        if np.any(crossed):
            found.append(_crossing(target, valley.of(crossed), ahead.of(crossed)))
        valley = ahead.of(going)
        if not len(valley.x):
            break
    return found


_FEW_ENDS = 4  # minima of a singular value along a self-motion from which valleys start


def valley_draft(target: Target, x: Array) -> PoseDraft:
    """Find solutions along the valleys that branch off a self-motion with samples x (k, 6).

    Valleys start at minima of the second smallest singular value, where another motion of the arm
    nearly crosses the self-motion.
    """
    found, q = list[Array](), np.zeros((0, x.shape[1]))
    if x.shape[1] == 6 and len(x) > 2:
        _, s, Vt = np.linalg.svd(target.excess(x)[1])
        inner = s[1:-1, 4]
        lowest = 1 + np.flatnonzero((inner < s[:-2, 4]) & (inner <= s[2:, 4]))
        lowest = lowest[np.argsort(s[lowest, 4], kind="stable")][:_FEW_ENDS]
        steps = _ALONG * Vt[lowest, 4]
        if len(lowest):
            found = _far_ends(target, np.concatenate([x[lowest] + steps, x[lowest] - steps]))
    if found:
        q = wrapped(target.arm, np.concatenate(found) * target.unit)
    return _solutions_among(target, q)


def _solutions_among(target: Target, q: Array) -> PoseDraft:
    """Return the configurations q (m, n) that reach the pose."""
    residual = target.residual(q) if len(q) else np.zeros(0)
    reached = residual < target.tolerance
    return _draft(q[reached], residual[reached])


def _draft(
    q: Array, residual: Array, method: str = "", certain: bool = True, near: Array | None = None
) -> PoseDraft:
    """Return a draft without branch names."""
    return PoseDraft(q, residual, ("",) * len(q), None, certain, method, near)


_REACH = 5  # number of steps along a valley, one radian in total


def along_valley(target: Target, start: Array) -> Array:
    """Return (m,) the highest residual within 1 rad along the valley through each x (m, 6).

    Of both directions the lower value is returned. The configurations x must be singular.
    """
    here = _valley_at(target, start)._replace(x=start)
    highest = []
    for side in (here, here._replace(along=-here.along)):
        valley, most = side, np.zeros(len(start))
        for _ in range(_REACH):
            valley = _valley_at(target, valley.x + _ALONG * valley.along).like(valley)
            most = np.maximum(most, valley.residual)
        highest.append(most)
    return np.minimum(*highest)


_FREE = 0.3
"""Smallest component of a joint in a null-space direction for which the joint is moved along it."""


def _around(target: Target, start: Array) -> list[Array]:
    """Find solutions x (k, 6) along the rotation of a joint, from doubly singular configurations.

    With two small singular values the null-space direction is undetermined, but one joint nearly
    moves alone. Solutions may be at the minima of the residual along its rotation.
    """
    null = np.linalg.svd(target.excess(start)[1])[2][:, -2:]
    leads = (np.max(np.abs(null), axis=1) > _FREE) & ~target.arm.prismatic
    rows, joints = np.nonzero(leads)
    if not len(rows):
        return []
    x, held = start[rows], np.eye(6)[joints]
    every = [x]
    for _ in range(_STEPS_ALONG):
        guess = every[-1] + _ALONG * held
        every.append(target.corrected(guess, held[:, None], np.sum(held * guess, axis=1)[:, None]))
    points = np.array(every)
    residual = target.residual(points * target.unit)
    lowest = (residual[1:-1] < residual[:-2]) & (residual[1:-1] < residual[2:])
    lowest &= residual[1:-1] < _NEARLY_MOVES * max(1.0, target.arm.length)
    step, row = np.nonzero(lowest)
    if not len(step):
        return []
    after = residual[step + 2, row] < residual[step, row]
    other = points[np.where(after, step + 2, step), row]
    return [_nearest_between(target, points[step + 1, row], other, held[row])]


def _nearest_between(target: Target, x: Array, other: Array, held: Array) -> Array:
    """Return configurations (m, 6) of least residual near pairs of points x and `other` (m, 6).

    Secant method in the position of one joint, in which the equations are nearly linear.
    """
    best, least = x, target.residual(x * target.unit)
    for _ in range(_CROSSINGS):
        e, slope = (target.excess(point)[0] for point in (x, other))
        slope = slope - e
        size = np.maximum(np.sum(slope * slope, axis=1), NONZERO)
        part = np.clip(-np.sum(e * slope, axis=1) / size, -1.0, 2.0)
        guess = x + part[:, None] * (other - x)
        x, other = target.corrected(guess, held[:, None], np.sum(held * guess, axis=1)[:, None]), x
        residual = target.residual(x * target.unit)
        best = np.where((residual < least)[:, None], x, best)
        least = np.fmin(residual, least)
    return best


class _Valley(NamedTuple):
    """Points of valleys: all equations hold except the equation of the smallest singular value.

    Attributes:
        along: (m, 6) direction of the valley: right singular vector.
        across: (m, 6) direction of the remaining equation: left singular vector.
        height: (m,) value of the remaining equation.
        x: (m, 6) scaled points, see `Target`.
        residual: (m,) residuals of the points.
    """

    along: Array
    across: Array
    height: Array
    x: Array
    residual: Array

    def of(self, which: NDArray[np.bool_]) -> _Valley:
        """Return the points of a mask."""
        return _Valley(*(part[which] for part in self))

    def like(self, before: _Valley) -> _Valley:
        """Flip the signs of singular vectors to agree with the points before."""
        on = np.sign(np.sum(self.along * before.along, axis=1))
        same = np.sign(np.sum(self.across * before.across, axis=1))
        return self._replace(
            along=on[:, None] * self.along,
            across=same[:, None] * self.across,
            height=same * self.height,
        )


def _valley_at(target: Target, x: Array) -> _Valley:
    """Correct points x (m, 6) to the nearest valley by Newton's method."""
    step = np.ones_like(x)
    for last in (False, False, False, False, True):
        e, J = target.excess(x)
        U, s, Vt = np.linalg.svd(J)
        if last or np.max(np.abs(step)) < _SETTLED:
            break
        amounts = np.einsum("mik,mi->mk", U[:, :, :5], e) / np.maximum(s[:, :5], NONZERO)
        step = np.clip(np.einsum("mki,mk->mi", Vt[:, :5], amounts), -_ALONG, _ALONG)
        x = x - step
    across = U[:, :, 5]
    height = np.sum(across * e, axis=1)
    return _Valley(Vt[:, 5], across, height, x, target.residual(x * target.unit))


def _crossing(target: Target, low: _Valley, high: _Valley) -> Array:
    """Return the roots (m, 6) of the remaining equation between points of opposite sign.

    False position with the Illinois modification.
    """
    for _ in range(_CROSSINGS):
        part = low.height / (low.height - high.height)
        middle = _valley_at(target, low.x + part[:, None] * (high.x - low.x)).like(low)
        beyond = middle.height * low.height < 0
        low = low._replace(height=np.where(beyond, 0.5 * low.height, low.height))
        high = high._replace(height=np.where(beyond, high.height, 0.5 * high.height))
        low, high = (
            _Valley(*(_where(~beyond, a, b) for a, b in zip(middle, low, strict=True))),
            _Valley(*(_where(beyond, a, b) for a, b in zip(middle, high, strict=True))),
        )
    best = np.abs(low.height) < np.abs(high.height)
    return _where(best, low.x, high.x)


def _where(which: NDArray[np.bool_], yes: Array, no: Array) -> Array:
    return np.where(which.reshape(-1, *[1] * (yes.ndim - 1)), yes, no)


def _by_closed_form(
    chain: FrameChain, target: Target, sequence: StepSequence, p: Array, r: Array
) -> PoseDraft:
    q, regular = (np.array(part).T for part in _leaves(chain, sequence, p)(DM(target.T), DM(r)))
    error = target.residual(q)
    near = np.flatnonzero(error < _BRANCH_NEAR * max(1.0, target.arm.length))
    certain = not np.min(regular) < _DEGENERATE
    labels = tuple(sequence.label(int(b)) for b in near)
    return _polish(target, q[near], labels, closed_form_name(chain, sequence, p), certain)


def _leaves(chain: FrameChain, sequence: StepSequence, p: Array) -> Function:
    """Return the cached Function ``leaves(T, r) -> q, regular`` with one column per branch.

    q (n, branches) are configurations [rad or m]. regular (1, branches) is the minimum of 1 and
    the quantities that must not vanish.
    """

    def build() -> Function:
        T = SX.sym("T", 4, 4)
        every = sequence.leaves(given_of(chain, T, p))
        q = casadi.horzcat(*(leaf.x for leaf in every))
        least = [casadi.mmin(casadi.vertcat(SX(1), casadi.fabs(leaf.regular))) for leaf in every]
        outputs = [casadi.densify(q), casadi.densify(casadi.horzcat(*least))]
        return Function("leaves", [T, chain.symbols], outputs, {"cse": True})

    function: Function = chain.system.cached(("leaves", sequence), build)
    return function


def _by_general(target: Target, ready: General) -> PoseDraft:
    q = general(ready, target.T)
    certain = not ready.prepared.regularity < _ILL_CONDITIONED
    return _polish(target, q, ("",) * len(q), "general", certain)


def search_draft(target: Target) -> PoseDraft:
    """Compute solutions by a search from many starts."""
    q = search(target.arm, target.T, _STARTS)
    return _polish(target, q, ("",) * len(q), "search", True)


def _polish(
    target: Target, candidates: Array, labels: tuple[str, ...], method: str, certain: bool
) -> PoseDraft:
    """Refine candidates (m, n) by Newton's method and return those that reach the pose.

    Args:
        target: target pose of the arm.
        candidates: (m, n) configurations [rad or m].
        labels: name of the closed-form branch of each, "" without a branch.
        method: name of the method that computed them.
        certain: whether none is missing.
    """
    if not len(candidates):
        return _draft(candidates, np.zeros(0), method, certain)
    own = target.residual(candidates)
    better, residual = polish(target.arm, target.T, candidates)
    # keep candidates with rounding errors only: near two singularities the closed form is exact,
    # and Newton's method diverges along a valley
    exact = own <= EXACT * max(1.0, target.arm.length)
    q, residual = np.where(exact[:, None], candidates, better), np.where(exact, own, residual)
    reached = exact | (residual < target.tolerance)
    solved = np.flatnonzero(reached)
    names = tuple(labels[k] for k in solved)
    near = candidates[~reached & (own < _NEARLY_MOVES * max(1.0, target.arm.length))]
    return PoseDraft(q[solved], residual[solved], names, None, certain, method, near)


def general_ready(chain: FrameChain, p: Array) -> General | None:
    """Return the general method of a chain for parameters p (np,), or None if inapplicable."""

    def build() -> General | None:
        try:
            return general_of(chain.arm(p))
        except (ModelError, NoClosedForm):
            return None

    key = (*chain.key, p.tobytes())
    ready: General | None = chain.system.memoised("general", key, build, _KEPT)
    return ready


def regular_general(chain: FrameChain, p: Array) -> General | None:
    """Return the general method of a chain for p (np,), or None if it is ill-conditioned."""
    found = general_ready(chain, p)
    return found if found and found.prepared.regularity >= _ILL_CONDITIONED else None
