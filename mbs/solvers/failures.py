"""Why an integration stops, in words."""

from collections.abc import Sequence

from mbs.errors import Interrupted, SolverError

MAX_STEPS = 100_000
REASONS = {
    "steps": f"more than {MAX_STEPS} steps between two output times; ask for a looser tolerance "
    "or, when fast decays are in the system, for a method for stiff equations",
    "small": "error control asks for a step below the rounding of time; "
    "look for a singularity or a jump",
    "rhs": "the right-hand side has no value there",
    "projection": "the projection onto the constraints does not converge; "
    "look for a singular posture",
    "singular": "a singular configuration is not passed, the rows of the loops stay dependent "
    "around it; start elsewhere, or end the run before",
    "near miss": "branches of motion come near each other and do not meet, by so little that what "
    "turns there cannot be told from what goes on; make the branches meet, or miss by more, or ask "
    "for a looser tolerance",
    "undetermined": "the motion starts in a singular configuration, where branches of motion meet, "
    "and its velocities are those of no branch with the mobility of the mechanism; give velocities "
    "of one branch to all joints, or start beside it",
    "finite": "a value is not finite; look for a singularity",
    "indicators": "an event indicator has no value there; look for efforts or laws that have none, "
    "or a singular configuration",
    "jump": "the jump of an event has no value there",
    "settle": "the events there do not settle, each jump asks for another one; "
    "let the jump make the indicators positive, or zero and rising",
    "standstill": "more than 100 events, and time hardly advances; "
    "add a mode in which what repeats is at rest",
}


class Failure(Exception):
    """An evaluation had no answer, so the step must be shortened."""


_SINGULAR = ("singular", "near miss", "undetermined", "projection")


def failed(
    t: float, h: float, reason: str, fired: Sequence[int] = (), state: Sequence[float] = ()
) -> SolverError:
    """The error that says when, with which step and why an integration stopped.

    Args:
        t: time of the last accepted state, s.
        h: step that was wanted next, s; 0 when there was none.
        reason: a key of REASONS.
        fired: numbers of the event indicators that are to blame.
        state: the last one that was reached.

    Returns:
        an error to raise.
    """
    step = f" with step {h:.3g} s" if h > 0 else ""
    who = f"; indicators {', '.join(map(str, fired))}" if fired else ""
    return SolverError(
        f"integration stopped at t = {t:.9g} s{step}: {REASONS[reason]}{who}",
        state=state,
        singular=reason in _SINGULAR,
        time=t,
    )


def interrupted(t: float) -> Interrupted:
    """What says when an integration was interrupted.

    Args:
        t: time of the last accepted state, s.
    """
    return Interrupted(f"integration interrupted at t = {t:.9g} s", time=t)
