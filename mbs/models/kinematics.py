"""Kinematic models: Jacobians, velocities and accelerations of links and frames."""

from __future__ import annotations

import casadi
from casadi import SX, Function

from mbs.assembly import System
from mbs.assembly.model_function import Named, model_function, require_system
from mbs.errors import ModelError
from mbs.loops.balance import require_no_drift
from mbs.loops.reduction import reduction
from mbs.models.symbols import (
    ModelSymbols,
    check_coordinates,
    configuration_check,
    is_reduced,
    symbols_of,
)
from mbs.recursions.jacobian import VelocityTarget, cheapest_jacobian, renaud
from mbs.recursions.link_motions import Acceleration, Velocity, moving_base, resting_base
from mbs.recursions.link_motions import link_accelerations as tree_accelerations
from mbs.recursions.link_motions import link_velocities as tree_velocities
from mbs.recursions.route import express
from mbs.spatial import Pose, zeros
from mbs.text import quoted


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
    """Return the geometric Jacobian of a frame: ``jacobian(q) -> J`` with [V; w] = J v.

    V is the velocity of the frame origin, w the angular velocity. form="renaud" returns
    ``jacobian_renaud(q) -> R6, L, J`` with the full Jacobian R6 L J. Its factor J is about a
    reference point and in the axes of an intermediate link, which minimise its operations. L
    transforms to the frame origin, R6 rotates into the axes of `expressed_in`.

    Source: Renaud 1980; Khalil & Creusot 1997, eq. 3-5; for closed systems J G.

    Args:
        system: open or closed mechanism; q must close the loops.
        frame: name of a body or frame, or index of a link.
        expressed_in: frame whose axes V and w are expressed in.
        form: "full" or "renaud".
        coordinates: velocities of a closed system, "independent" (v is v_a) or "tree".
        intermediate: intermediate link for "renaud", by index, 0 for the base. By default the link
            with the fewest operations.
        reference: link for "renaud", by index, whose origin is the reference point. By default the
            link with the fewest operations.

    Returns:
        Function of q (nq, 1); J (6, m) [m or 1; 1/m or 1], R6 and L (6, 6) [1; m].

    Raises:
        ModelError: the frame or the form is unknown, or the intermediate or reference link is not
            between the base and the frame.
    """
    require_system(system)
    check_coordinates(system, coordinates)
    target, axes = system.frame(frame), system.frame(expressed_in)
    if form not in ("full", "renaud"):
        raise ModelError(f"{system.name}: form is {quoted(form)}; use 'full' or 'renaud'")
    between = [_tree_link(system, target[0], frame, k) for k in (intermediate, reference)]

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
            configuration_check(system, coordinates),
        )
    key = ("jacobian_renaud", frame, expressed_in, coordinates, intermediate, reference)
    return model_function(system, key, factors, configuration_check(system, coordinates))


def in_coordinates(system: System, q: SX, J: SX, coordinates: str) -> SX:
    """Return a Jacobian of tree velocities for the input velocities: J G if independent.

    Args:
        system: open or closed mechanism.
        q: (nq, 1) symbols of positions.
        J: (k, nv) Jacobian.
        coordinates: "independent" or "tree".
    """
    if is_reduced(system, coordinates):
        columns = set(casadi.sparsify(J).sparsity().get_triplet()[1])
        require_no_drift(system, "a Jacobian", sorted(columns))
        return casadi.mtimes(J, reduction(system, q).G)
    return J


def _tree_link(system: System, link: int, frame: str | int, number: int | None) -> int | None:
    """Return the tree index (-1 is the base) of the link with the user's index `number` (0: base).

    Raise ModelError if it is not between the base and `link`, the tree index of the link of
    `frame`. None if `number` is None.
    """
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


# Velocities and accelerations of links and frames, with a fixed or moving base.


def link_velocities(
    system: System, coordinates: str = "independent", *, moving_base: bool = False
) -> Function:
    """Return the velocities of all links, each in its own frame: ``link_velocities(q, v) -> V``.

    Source: Khalil & Creusot 1997, eq. 6.

    Args:
        system: open or closed mechanism; q must close the loops.
        coordinates: velocities of a closed system, "independent" (v is v_a) or "tree".
        moving_base: whether to add an input v_0 (6, 1), velocity [V; w] of the base in base axes.

    Returns:
        Function of q (nq, 1), v (m, 1) and v_0; V (6, nl) with one column [V; w] per link: velocity
        of the frame origin and angular velocity [m/s, rad/s].
    """
    require_system(system)

    def build() -> tuple[Named, Named]:
        s = symbols_of(system, coordinates)
        v_0 = SX.sym("v_0", 6)
        base = Velocity(v_0[0:3], v_0[3:6]) if moving_base else None
        columns = [
            casadi.vertcat(link.V, link.w)
            for link in tree_velocities(system.tree, s.poses, s.v_tree, base)
        ]
        extra: Named = [("v_0", v_0)] if moving_base else []
        return [*_state(s), *extra], [("V", casadi.horzcat(*columns))]

    return model_function(
        system,
        ("link_velocities", moving_base, coordinates),
        build,
        configuration_check(system, coordinates),
    )


def link_accelerations(
    system: System, coordinates: str = "independent", *, moving_base: bool = False
) -> Function:
    """Return the accelerations of all links: ``link_accelerations(q, v, a) -> Vd``.

    They are relative to an inertial frame, each in the axes of its link, without gravity.

    Source: Khalil & Creusot 1997, eq. 8-10.

    Args:
        system: open or closed mechanism; q must close the loops.
        coordinates: velocities of a closed system, "independent" (v is v_a) or "tree".
        moving_base: whether to add inputs v_0 (6, 1), velocity [V; w] of the base, and a_0 (6, 1),
            linear acceleration of its origin and angular acceleration [vd; wd], in base axes.

    Returns:
        Function of q (nq, 1), v, a (m, 1), v_0 and a_0; Vd (6, nl) with one column [vd; wd] per
        link: acceleration of the frame origin and angular acceleration [m/s^2, rad/s^2].
    """
    require_system(system)

    def build() -> tuple[Named, Named]:
        s = symbols_of(system, coordinates)
        name, a = s.input("a")
        base, extra = _base_motion(moving_base)
        motions = tree_accelerations(system.tree, s.poses, s.v_tree, s.tree_acceleration(a), base)
        columns = [casadi.vertcat(link.vd, link.wd) for link in motions]
        return [*_state(s), (name, a), *extra], [("Vd", casadi.horzcat(*columns))]

    return model_function(
        system,
        ("link_accelerations", moving_base, coordinates),
        build,
        configuration_check(system, coordinates),
    )


def jacobian_dot_velocity(
    system: System,
    frame: str | int,
    expressed_in: str | int = "base",
    *,
    coordinates: str = "independent",
    moving_base: bool = False,
) -> Function:
    """Return the acceleration of a frame for zero a, the term dJ/dt v: ``jpqp(q, v) -> jpqp``.

    The time derivative is taken in the inertial frame; the result is then expressed in the axes of
    `expressed_in`. For a closed system with independent coordinates it is d(J G)/dt v_a, including
    the motion of the dependent joints.

    Source: Khalil & Creusot 1997, section 4.4.

    Args:
        system: open or closed mechanism; q must close the loops.
        frame: name of a body or frame, or index of a link.
        expressed_in: frame whose axes the result is expressed in.
        coordinates: velocities of a closed system, "independent" (v is v_a) or "tree".
        moving_base: whether to add inputs v_0 and a_0 as for `link_accelerations`; the acceleration
            of the base is then included.

    Returns:
        Function of q (nq, 1), v (m, 1), v_0 and a_0; jpqp (6, 1), linear acceleration of the frame
        origin and angular acceleration [m/s^2, rad/s^2].

    Raises:
        ModelError: the frame is unknown.
    """
    require_system(system)
    check_coordinates(system, coordinates)
    (j, inside), axes = system.frame(frame), system.frame(expressed_in)

    def build() -> tuple[Named, Named]:
        s = symbols_of(system, coordinates)
        base, extra = _base_motion(moving_base)
        a = s.tree_acceleration(SX.zeros(s.size))
        links = tree_accelerations(system.tree, s.poses, s.v_tree, a, base)
        motion = links[j] if j >= 0 else base
        vd = motion.vd + casadi.mtimes(motion.rate.U, inside.p)
        home = (j, Pose.identity())
        parts = express(system.tree, s.q, axes, home, [vd, motion.wd])
        return [*_state(s), *extra], [("jpqp", casadi.vertcat(*parts))]

    key = ("jpqp", frame, expressed_in, moving_base, coordinates)
    return model_function(system, key, build, configuration_check(system, coordinates))


def _state(s: ModelSymbols) -> Named:
    """Return the named inputs q and v (or v_a in independent coordinates)."""
    return [("q", s.q), ("v" + s.suffix, s.v)]


def _base_motion(moves: bool) -> tuple[Acceleration, Named]:
    """Return the motion of the base without gravity, and its inputs v_0 and a_0 if it moves."""
    if not moves:
        return resting_base(zeros()), []
    v_0, a_0 = SX.sym("v_0", 6), SX.sym("a_0", 6)
    return moving_base(v_0[3:6], a_0[3:6], a_0[0:3]), [("v_0", v_0), ("a_0", a_0)]
