"""All postures of a general arm of six joints that reach a pose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mbs.errors import NoClosedForm
from mbs.models.inverse_geometry.arm import Arm, Array
from mbs.models.inverse_geometry.numeric import core
from mbs.models.inverse_geometry.numeric.core_general import HandedLoop, Numbers, solved_by
from mbs.models.inverse_geometry.numeric.merge import merged_with_numpy, reached
from mbs.models.inverse_geometry.numeric.polish import polished_with_numpy
from mbs.models.inverse_geometry.raghavan_roth import Prepared, candidates_many, prepare


@dataclass(frozen=True, slots=True, eq=False)
class General:
    """An arm ready for the general method.

    Attributes:
        arm: of six joints.
        prepared: what the method chose for it.
        handed: both for the compiled core.
    """

    arm: Arm
    prepared: Prepared
    handed: HandedLoop


def general_of(arm: Arm) -> General:
    """An arm made ready, once, for `general`.

    Raises:
        ModelError: it has not six joints, or none that turns.
        NoClosedForm: the method does not hold for it.
    """
    prepared = prepare(arm)
    if not prepared.regular:
        raise NoClosedForm(
            f"arm {' '.join(arm.names)}: the matrix of the general inverse geometric model is"
            f" singular at every posture (its regularity is {prepared.regularity:.0e}); use"
            " method='search'"
        )
    return General(arm, prepared, HandedLoop(arm, prepared))


def general(arm: General, T: Array) -> Array:
    """The postures that reach a pose, by elimination; polished.

    Source: Raghavan & Roth 1993.

    Args:
        arm: see `general_of`.
        T: (4, 4) wanted pose [m].

    Returns:
        (m, 6) all isolated solutions, each once [rad or m]; samples where there are families.
    """
    return general_many(arm, np.asarray(T, dtype=float)[None])[1]


def general_many(arm: General, T: Array) -> tuple[Numbers, Array]:
    """Likewise for many poses.

    Args:
        arm: see `general_of`.
        T: (N, 4, 4) wanted poses [m].

    Returns:
        (m,) numbers of the poses, ascending, and (m, 6) postures for them.
    """
    library = core.core_of(arm.arm)
    if library is not None:
        return solved_by(library, arm.handed, T)
    return general_with_numpy(arm, T)


def general_with_numpy(arm: General, T: Array) -> tuple[Numbers, Array]:
    """`general_many` where there is no C compiler."""
    number, q = candidates_many(arm.prepared, T)
    q = polished_with_numpy(arm.arm, T[number], q).q
    solved = reached(arm.arm, T[number], q)
    number, q = number[solved], q[solved]
    found = [merged_with_numpy(arm.arm, T[k], q[number == k]).q for k in range(len(T))]
    numbers = np.repeat(np.arange(len(T)), [len(own) for own in found])
    return numbers, np.concatenate([np.zeros((0, 6)), *found])
