"""Which closed form solves a chain: Pieper's, Paul's, or the cheaper of both."""

from __future__ import annotations

from collections.abc import Callable

import casadi
import numpy as np
from casadi import SX, Function
from numpy.typing import NDArray

from mbs.errors import ModelError, NoClosedForm
from mbs.loops.sequence import Problem, Sequence
from mbs.messages import did_you_mean, quoted
from mbs.models.inverse_geometry.chain import Chain
from mbs.operations.counts import count

CLOSED_FORMS = ("pieper", "paul")
"""The methods that give steps, the quicker one first."""

_FEW = 8


def sequence_of(
    chain: Chain, method: str = "auto", p: NDArray[np.float64] | None = None
) -> Sequence:
    """The steps that give the joints of a chain from the pose of its frame.

    It is kept on the system: the next call with the same arguments is free.

    Args:
        chain: what is solved for.
        method: "pieper", "paul", or "auto": Pieper's where it fits without a quartic, else the
            one with the fewest branches, and of equals the one with the fewest operations.
        p: (np,) numbers in the place of the parameters; symbols stay symbols when left out.

    Returns:
        Sequence of the loop `chain.problem(p)`.

    Raises:
        NoClosedForm: the message says what stood in the way of each method.
        ModelError: there is no such method.
    """
    if method not in (*CLOSED_FORMS, "auto"):
        raise ModelError(
            f"{chain.system.name}: method is {quoted(method)}, which gives no closed form; "
            + did_you_mean(method, ("auto", *CLOSED_FORMS))
        )
    numbers = None if p is None else np.asarray(p, dtype=float).tobytes()
    key = ("steps", method, *key_of(chain), numbers)
    solved = chain.system.cached(key, lambda: _solved(chain, method, p))
    if isinstance(solved, str):
        raise NoClosedForm(solved)
    steps: Sequence = solved
    return steps


def key_of(chain: Chain) -> tuple[object, ...]:
    """What tells chains of one system apart."""
    return chain.frame, tuple(sorted(chain.locked.items()))


def given_of(way: Chain, T: SX) -> SX:
    """What a sequence of symbolic parameters takes for a pose T, (4, 4)."""
    return SX(casadi.vertcat(way.system.p, casadi.vec(T[:3, :])))


def _solved(chain: Chain, method: str, p: NDArray[np.float64] | None) -> Sequence | str:
    """The cheapest sequence of the methods that are asked for, or why there is none.

    A wrist leaves no method fewer branches than Pieper's; Paul's, which takes longer to find its
    steps, is asked where that one fails or solves quartics.
    """
    problem = chain.problem(p)
    found, reasons = list[Sequence](), list[str]()
    for name in CLOSED_FORMS if method == "auto" else (method,):
        try:
            found.append(_solver(name)(problem))
        except NoClosedForm as error:
            reasons.append(f"{name}: {error}")
            continue
        if _is_short(found[-1]):
            break
    if found:
        return found[0] if len(found) == 1 else min(found, key=lambda s: _price(s, problem))
    return (
        f"{chain.system.name}: no closed form gives {', '.join(chain.names)} from the pose of"
        f" frame {chain.frame!r} ({'; '.join(reasons)}); use"
        " mbs.models.inverse_geometry.solve, which needs none"
    )


def _solver(method: str) -> Callable[[Problem], Sequence]:
    if method == "pieper":
        from mbs.models.inverse_geometry.pieper import pieper

        return pieper
    from mbs.loops.paul import paul

    return paul


def _is_short(sequence: Sequence) -> bool:
    """Whether no other sequence is worth looking for."""
    return sequence.branches <= _FEW and all(one.kind != "quartic" for one in sequence.steps)


def _price(sequence: Sequence, problem: Problem) -> tuple[int, int]:
    """Number of branches, then of operations for all of them."""
    leaves = sequence.leaves(problem.given)
    every = casadi.horzcat(*(leaf.x for leaf in leaves))
    return sequence.branches, count(Function("leaves", [problem.given], [SX(every)])).total
