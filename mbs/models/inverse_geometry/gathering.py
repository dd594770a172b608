"""Configurations that may solve: the leaves of a closed form, the general method, the search."""

from __future__ import annotations

from dataclasses import dataclass

import casadi
import numpy as np
from casadi import DM, SX, Function

from mbs.closed_forms.arm import Array
from mbs.closed_forms.sequence import StepSequence
from mbs.errors import ModelError, NoClosedForm
from mbs.models.inverse_geometry.chain import FrameChain
from mbs.models.inverse_geometry.closed_form import (
    CLOSED_FORMS,
    given_of,
    require_method,
    sequence_of,
)
from mbs.models.inverse_geometry.search import General, general, general_of, polish, search
from mbs.models.inverse_geometry.target import Target

METHODS = ("auto", *CLOSED_FORMS, "general", "search")
"""The methods that `solve` knows."""

_BRANCH_NEAR = 1e-2
"""Residual, of max(1 m, the arm's length), up to which a branch is polished: near a double root
those that are not real miss by little, and all others that do not hold miss by much."""
_DEGENERATE = 1e-5
"""Squared and free of units, below which a step loses digits and its other roots may be missed:
five of sixteen in the square, half as many in the angle."""
ILL_CONDITIONED = 1e-9
"""Regularity of the general method below which it may miss solutions: seven digits are left of a
root, of a double one three."""
NOT_VARIED = np.zeros(0)
"""Positions of the varied joints of a chain that has none."""
_STARTS = 300
_KEPT = 256
"""Arms kept ready, one for every position of a locked joint, of tens of kilobytes each."""


@dataclass(frozen=True, slots=True, eq=False)
class Gathered:
    """Solutions as the methods give them, some of them more than once.

    Attributes:
        q: (m, n) configurations [rad or m].
        labels: of the branches they come from, "" where they come from none.
        method: that gave them.
        doubtful: whether further ones may be missing, because the pose is next to a degenerate
            one of the method.
    """

    q: Array
    labels: tuple[str, ...]
    method: str
    doubtful: bool


def gather(
    chain: FrameChain, target: Target, method: str, p: Array, r: Array = NOT_VARIED
) -> Gathered:
    """The solutions by one method, or by the first that holds for the chain.

    Args:
        chain: what is solved for.
        target: the target pose, of the chain in numbers, its varied joints at r.
        method: "pieper", "paul", "general", "search"; "auto" for a closed form, else the general
            method for six joints, else the search.
        p: (np,) the parameters.
        r: (k,) positions of the chain's varied joints [rad or m].

    Raises:
        NoClosedForm: "pieper" or "paul" was asked for and does not fit.
        ModelError: there is no such method, or it does not hold for the chain.
    """
    require_method(chain.system, method, METHODS)
    if method in (*CLOSED_FORMS, "auto"):
        try:
            return _by_closed_form(chain, target, sequence_of(chain, method, p), p, r)
        except NoClosedForm:
            if method != "auto":
                raise
    if method == "search":
        return _by_search(target)
    ready = general_ready(chain.locked_at(r) if chain.varied else chain, p)
    if ready is None and method == "general":
        raise ModelError(
            f"{chain.system.name}: the general method does not hold for the joints"
            f" {', '.join(chain.names)}: it is for six joints, and not for all with prismatic ones;"
            " use method='search'"
        )
    return _by_search(target) if ready is None else _by_general(target, ready)


def gather_further(chain: FrameChain, target: Target, gathered: Gathered, p: Array) -> Gathered:
    """What was gathered, and what the general method and the search add to it."""
    parts = [gathered]
    ready = general_ready(chain, p)
    if gathered.method != "general" and ready is not None:
        parts.append(_by_general(target, ready))
    if gathered.method != "search":
        parts.append(_by_search(target))
    return Gathered(
        np.concatenate([part.q for part in parts]),
        tuple(label for part in parts for label in part.labels),
        gathered.method,
        False,
    )


def _by_closed_form(
    chain: FrameChain, target: Target, sequence: StepSequence, p: Array, r: Array
) -> Gathered:
    q, regular = (np.array(part).T for part in _leaves(chain, sequence, p)(DM(target.T), DM(r)))
    error = target.residual(q)
    near = np.flatnonzero(error < _BRANCH_NEAR * max(1.0, target.arm.length))
    doubtful = bool(np.min(regular) < _DEGENERATE)
    labels = tuple(sequence.label(int(b)) for b in near)
    return _polish(target, Gathered(q[near], labels, _name(chain, sequence, p), doubtful))


def _leaves(chain: FrameChain, sequence: StepSequence, p: Array) -> Function:
    """``leaves(T, r) -> q, regular``: a column for every branch, kept on the system.

    q (n, branches) are configurations [rad or m], regular (1, branches) the least of the quantities
    that must not vanish, and 1.
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


def _name(chain: FrameChain, sequence: StepSequence, p: Array) -> str:
    """Which of the closed forms a sequence is."""
    try:
        return "pieper" if sequence is sequence_of(chain, "pieper", p) else "paul"
    except NoClosedForm:
        return "paul"


def _by_general(target: Target, ready: General) -> Gathered:
    q = general(ready, target.T)
    doubtful = ready.prepared.regularity < ILL_CONDITIONED
    return _polish(target, Gathered(q, ("",) * len(q), "general", doubtful))


def _by_search(target: Target) -> Gathered:
    q = search(target.arm, target.T, _STARTS)
    return _polish(target, Gathered(q, ("",) * len(q), "search", False))


def _polish(target: Target, gathered: Gathered) -> Gathered:
    """The solutions beside what was gathered."""
    if not len(gathered.q):
        return gathered
    better = polish(target.arm, target.T, gathered.q)
    solved = np.flatnonzero(better.residual < target.tolerance)
    labels = tuple(gathered.labels[k] for k in solved)
    return Gathered(better.q[solved], labels, gathered.method, gathered.doubtful)


def general_ready(chain: FrameChain, p: Array) -> General | None:
    """The general method of a chain for parameters p, (np,); None where it does not hold."""

    def build() -> General | None:
        try:
            return general_of(chain.arm(p))
        except (ModelError, NoClosedForm):
            return None

    key = (*chain.key, p.tobytes())
    ready: General | None = chain.system.recent("general", key, build, _KEPT)
    return ready
