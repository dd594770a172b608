"""Which closed form solves a chain: Pieper's, Paul's, or the cheaper of both."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import casadi
import numpy as np
from casadi import SX, Function
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.errors import ModelError, NoClosedForm
from mbs.loops.sequence import Problem, Sequence
from mbs.messages import did_you_mean, quoted
from mbs.models.inverse_geometry.chain import Chain
from mbs.operations.counts import count

CLOSED_FORMS = ("pieper", "paul")
"""The methods that give steps, the quicker one first."""

Numbers: TypeAlias = NDArray[np.float64] | None
"""(np,) values of the parameters; None where they stay symbols."""

_FEW = 8


def sequence_of(chain: Chain, method: str = "auto", p: Numbers = None) -> Sequence:
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
    require_method(chain.system, method, ("auto", *CLOSED_FORMS))
    found, reasons = list[Sequence](), list[str]()
    for name in CLOSED_FORMS if method == "auto" else (method,):
        steps = _kept(chain, name, p)
        if isinstance(steps, str):
            reasons.append(f"{name}: {steps}")
            continue
        found.append(steps)
        if _is_short(steps):
            break
    if not found:
        raise NoClosedForm(
            f"{chain.system.name}: no closed form gives {', '.join(chain.names)} from the pose of"
            f" frame {chain.frame!r} ({'; '.join(reasons)}); use"
            " mbs.models.inverse_geometry.solve, which needs none"
        )
    return found[0] if len(found) == 1 else min(found, key=lambda steps: _price(chain, steps, p))


def require_method(system: System, method: str, known: tuple[str, ...]) -> None:
    """Refuse a method that is not known.

    Raises:
        ModelError: the message names those that are.
    """
    if method not in known:
        raise ModelError(
            f"{system.name}: method is {quoted(method)}, which is not known here;"
            f" {did_you_mean(method, known)}"
        )


def given_of(way: Chain, T: SX) -> SX:
    """What a sequence of symbolic parameters takes for a pose T, (4, 4)."""
    return SX(casadi.vertcat(way.system.p, casadi.vec(T[:3, :])))


def _kept(chain: Chain, method: str, p: Numbers) -> Sequence | str:
    """The steps by one method, or why there are none; kept on the system."""

    def solve() -> Sequence | str:
        try:
            return _solver(method)(chain.problem(p))
        except NoClosedForm as error:
            return str(error)

    steps: Sequence | str = chain.system.cached(("steps", method, *_key(chain, p)), solve)
    return steps


def _key(chain: Chain, p: Numbers) -> tuple[object, ...]:
    return *chain.key, None if p is None else np.asarray(p, dtype=float).tobytes()


def _solver(method: str) -> Callable[[Problem], Sequence]:
    if method == "pieper":
        from mbs.models.inverse_geometry.pieper import pieper

        return pieper
    from mbs.loops.paul import paul

    return paul


def _is_short(sequence: Sequence) -> bool:
    """Whether no other sequence is worth looking for.

    A wrist leaves no method fewer branches than Pieper's; Paul's, which takes longer to find its
    steps, is asked where that one fails or solves quartics.
    """
    return sequence.branches <= _FEW and all(one.kind != "quartic" for one in sequence.steps)


def _price(chain: Chain, sequence: Sequence, p: Numbers) -> tuple[int, int]:
    """Number of branches, then of operations for all of them; kept on the system."""

    def counted() -> int:
        given = chain.problem(p).given
        every = casadi.horzcat(*(leaf.x for leaf in sequence.leaves(given)))
        return count(Function("leaves", [given], [SX(every)])).total

    operations: int = chain.system.cached(("operations", sequence), counted)
    return sequence.branches, operations
