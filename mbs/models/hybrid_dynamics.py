"""Hybrid dynamics: some accelerations are given, the efforts of the others."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from casadi import SX, Function

from mbs.assembly import System
from mbs.assembly.model_function import Named, model_function, require_system
from mbs.errors import ModelError
from mbs.loops.velocity import closure_jacobian
from mbs.messages import did_you_mean, quoted
from mbs.models.constrained_accelerations import constrained_accelerations
from mbs.models.surroundings import surroundings
from mbs.models.symbols import symbols_of
from mbs.solvers.rank import rank


def hybrid_dynamics(system: System, prescribed: Sequence[str]) -> Function:
    """``hybrid(q, v, tau, a_p) -> a, tau_p``: motion where some joints are driven along a law.

    tau_p is the effort that a drive must add to tau at each prescribed velocity. In a closed
    system q and v close the loops, and lam, the efforts of the independent closure rows, is a
    third output.

    Source: Featherstone 2008, section 9.2; loops as in `direct_dynamics`.

    Args:
        system: open or closed; all coordinates are those of the tree.
        prescribed: names of velocities whose accelerations are given.

    Returns:
        Function of q (nq, 1), v and tau (nv, 1), a_p (k, 1) in the order of the names; a (nv, 1)
        and tau_p (k, 1) [N m or N].

    Raises:
        ModelError: a name is unknown or comes twice, or the loops let the named velocities not
            move independently.
    """
    require_system(system)
    numbers = _numbers(system, prescribed)

    def build() -> tuple[Named, Named]:
        s = symbols_of(system, "tree")
        tau, a_p = SX.sym("tau", system.nv), SX.sym("a_p", len(numbers))
        a, lam, tau_p = constrained_accelerations(
            system, s, tau, surroundings(system), numbers, a_p
        )
        outputs = [("a", a), ("tau_p", tau_p), *([("lam", lam)] if system.is_closed else [])]
        return [("q", s.q), ("v", s.v), ("tau", tau), ("a_p", a_p)], outputs

    return model_function(system, ("hybrid", numbers), build)


def _numbers(system: System, prescribed: Sequence[str]) -> tuple[int, ...]:
    names = [speed.name for speed in system.speeds]
    if isinstance(prescribed, str) or not prescribed:
        raise ModelError(
            f"{system.name}: prescribed is {quoted(prescribed)}; give a list of names of velocities"
        )
    for name in prescribed:
        if name not in names:
            raise ModelError(
                f"{system.name}: there is no velocity {quoted(name)} to prescribe;"
                f" {did_you_mean(str(name), names)}"
            )
    numbers = tuple(names.index(name) for name in prescribed)
    if len(set(numbers)) < len(numbers):
        raise ModelError(f"{system.name}: a velocity is prescribed twice; name each once")
    if not are_independent(system, numbers):
        told = ", ".join(system.speeds[k].name for k in numbers)
        raise ModelError(
            f"{system.name}: {told} cannot all be prescribed, since the loops tie them (mobility"
            f" {len(system.active)}); prescribe joints that can move independently"
        )
    return numbers


def are_independent(system: System, numbers: tuple[int, ...]) -> bool:
    """Whether the loops leave these velocities free of each other at the assembled posture."""
    if not system.is_closed:
        return True
    p = [system.p_default] if system.parameters else []
    J = np.array(closure_jacobian(system)(list(system.posture), *p))
    E = np.eye(system.nv)[list(numbers)]
    return rank(np.vstack([J, E])) == rank(J) + len(numbers)
