"""Inverse dynamic models: efforts that produce a motion."""

from __future__ import annotations

import casadi
from casadi import SX, Function

from mbs.assembly import System
from mbs.assembly.model_function import Named, model_function
from mbs.models.symbols import ModelSymbols, symbols_of
from mbs.recursions.accelerations import resting_base
from mbs.recursions.newton_euler import Wrench, newton_euler, rotor_and_friction
from mbs.spatial import cross


def inverse_dynamics(
    system: System, f_ext: bool = False, coordinates: str = "independent"
) -> Function:
    """``idm(q, v, a) -> tau``: the joint efforts that produce the accelerations a.

    Rotor inertia, viscous and dry friction of the joints are included.

    Source: Khalil & Kleinfinger 1987; Khalil & Creusot 1997, eq. 15-20 and 22.

    Args:
        system: open or closed; q must close the loops.
        f_ext: add an input f_ext (6, bodies): for each row of `system.bodies` the wrench
            [force; moment] that the body exerts on its environment, in the body's frame.
        coordinates: of a closed system, "independent" for idm(q, v_a, a_a) -> tau_a, or "tree".

    Returns:
        Function of q (nq, 1), v and a (m, 1) and f_ext; tau (m, 1) [N m or N].
    """

    def build() -> tuple[Named, Named]:
        s = symbols_of(system, coordinates)
        name, a = s.input("a")
        wrenches = SX.sym("f_ext", 6, len(system.bodies))
        external = external_wrenches(system, wrenches) if f_ext else None
        tau = s.reduced_effort(tree_efforts(system, s, s.tree_acceleration(a), external))
        inputs: Named = [("q", s.q), ("v" + s.suffix, s.v), (name, a)]
        extra: Named = [("f_ext", wrenches)] if f_ext else []
        return [*inputs, *extra], [("tau" + s.suffix, tau)]

    return model_function(system, ("idm", f_ext, coordinates), build)


def bias(system: System, coordinates: str = "independent") -> Function:
    """``bias(q, v) -> H``: the efforts at zero acceleration, so that tau = A a + H.

    Coriolis, centrifugal and gravity efforts and the friction of the joints.

    Source: Khalil & Creusot 1997, eq. 25 and section 5.3.1.

    Args:
        system: open or closed; q must close the loops.
        coordinates: as for `inverse_dynamics`.

    Returns:
        Function of q (nq, 1) and v (m, 1); H (m, 1) [N m or N].
    """

    def build() -> tuple[Named, Named]:
        s = symbols_of(system, coordinates)
        a = s.tree_acceleration(SX.zeros(s.size))
        H = s.reduced_effort(tree_efforts(system, s, a))
        return [("q", s.q), ("v" + s.suffix, s.v)], [("H" + s.suffix, H)]

    return model_function(system, ("bias", coordinates), build)


def gravity_effort(system: System, coordinates: str = "independent") -> Function:
    """``gravity(q) -> Q``: the efforts that hold the mechanism still.

    Source: Khalil & Creusot 1997, eq. 23.

    Args:
        system: open or closed; q must close the loops.
        coordinates: as for `inverse_dynamics`.

    Returns:
        Function of q (nq, 1); Q (m, 1) [N m or N].
    """

    def build() -> tuple[Named, Named]:
        s = symbols_of(system, coordinates)
        Q = s.reduced_effort(tree_gravity(system, s))
        return [("q", s.q)], [("Q" + s.suffix, Q)]

    return model_function(system, ("gravity", coordinates), build)


def tree_efforts(
    system: System, s: ModelSymbols, a: SX, external: dict[int, Wrench] | None = None
) -> SX:
    """(nv, 1) efforts of the tree, friction and rotors included, for accelerations a (nv, 1)."""
    tree = system.tree
    tau = newton_euler(tree, s.poses, s.v_tree, a, resting_base(tree.gravity), external).efforts
    return tau + rotor_and_friction(tree, s.v_tree, a)


def tree_gravity(system: System, s: ModelSymbols) -> SX:
    """(nv, 1) efforts of the tree that hold it still."""
    rest = SX.zeros(system.nv)
    base = resting_base(system.tree.gravity)
    return newton_euler(system.tree, s.poses, rest, rest, base).efforts


def external_wrenches(system: System, wrenches: SX) -> dict[int, Wrench]:
    """The wrenches of bodies, (6, bodies) in their frames, brought to the frames of their links."""
    result: dict[int, Wrench] = {}
    for column, row in enumerate(system.bodies):
        link, pose = system.frames[row.name]
        f = casadi.mtimes(pose.R, wrenches[0:3, column])
        m = casadi.mtimes(pose.R, wrenches[3:6, column]) + cross(pose.p, f)
        before = result.get(link)
        result[link] = (f, m) if before is None else (before[0] + f, before[1] + m)
    return result
