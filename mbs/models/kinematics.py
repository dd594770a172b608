"""Kinematic models: velocities of frames."""

from __future__ import annotations

import casadi
from casadi import SX, Function

from mbs.assembly import System
from mbs.assembly.model_function import Named, model_function, require_system
from mbs.errors import ModelError
from mbs.loops.reduction import reduction
from mbs.messages import quoted
from mbs.models.symbols import check_coordinates, is_reduced, posture_check
from mbs.recursions.jacobian import VelocityTarget
from mbs.recursions.renaud import cheapest_jacobian, renaud


def jacobian(
    system: System,
    frame: str | int,
    expressed_in: str | int = "base",
    form: str = "full",
    *,
    coordinates: str = "independent",
    intermediate: int | None = None,
    reference: int | None = None,
) -> Function:
    """``jacobian(q) -> J``: velocity of a frame, [V; w] = J v, V being that of its origin.

    With form="renaud" it is ``jacobian_renaud(q) -> R6, L, J``, three factors whose product is
    that matrix: R6 turns from an intermediate frame into the wanted axes, L moves the velocity of
    a reference point to the origin of the frame, J is in the intermediate frame, where it has the
    fewest terms.

    Source: Renaud 1980; Khalil & Creusot 1997, eq. 3-5; for closed systems J G.

    Args:
        system: open or closed; q must close the loops.
        frame: a body, a named frame, or the number of a link.
        expressed_in: the frame in whose axes V and w are.
        form: "full" or "renaud".
        coordinates: of a closed system, "independent" (v is v_a) or "tree".
        intermediate: for "renaud", number of the link in whose axes J is, 0 for the base; left
            out, the one with the fewest operations is taken.
        reference: for "renaud", number of the link whose origin the velocity J v belongs to.

    Returns:
        Function of q (nq, 1); J (6, m) [m or 1; 1/m or 1], R6 and L (6, 6) [1; m].

    Raises:
        ModelError: there is no such frame or form, or the intermediate frame is not between the
            base and the frame.
    """
    require_system(system)
    check_coordinates(system, coordinates)
    target, axes = system.frame(frame), system.frame(expressed_in)
    if form not in ("full", "renaud"):
        raise ModelError(f"{system.name}: form is {quoted(form)}; use 'full' or 'renaud'")
    between = [_on_the_way(system, target[0], frame, k) for k in (intermediate, reference)]

    def full() -> tuple[Named, Named]:
        q = SX.sym("q", system.nq)
        J = cheapest_jacobian(VelocityTarget(system.tree, q, system.p, target, axes))
        return [("q", q)], [("J", in_coordinates(system, q, J, coordinates))]

    def factors() -> tuple[Named, Named]:
        q = SX.sym("q", system.nq)
        found = renaud(VelocityTarget(system.tree, q, system.p, target, axes), *between)
        J = in_coordinates(system, q, found.J, coordinates)
        return [("q", q)], [("R6", found.rotation), ("L", found.displacement), ("J", J)]

    if form == "full":
        if between != [None, None]:
            raise ModelError(
                f"{system.name}: an intermediate frame or a reference was given; they belong to"
                " form='renaud'"
            )
        return model_function(
            system,
            ("jacobian", frame, expressed_in, coordinates),
            full,
            posture_check(system, coordinates),
        )
    key = ("jacobian_renaud", frame, expressed_in, coordinates, intermediate, reference)
    return model_function(system, key, factors, posture_check(system, coordinates))


def in_coordinates(system: System, q: SX, J: SX, coordinates: str) -> SX:
    """A Jacobian of the tree as one of the velocities that are input: J G in a closed system."""
    if is_reduced(system, coordinates):
        return casadi.mtimes(J, reduction(system, q).G)
    return J


def _on_the_way(system: System, link: int, frame: str | int, number: int | None) -> int | None:
    """The link of this number, which must carry the frame; -1 is the base."""
    if number is None:
        return None
    k, _ = system.frame(number)
    path = [-1, *system.tree.path(link)]
    if k not in path:
        raise ModelError(
            f"{system.name}: link {number} is not between the base and frame {quoted(frame)}; the"
            f" links there are {', '.join(str(m + 1) for m in path)}"
        )
    return k
