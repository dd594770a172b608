"""Inverse dynamic models: efforts that produce a motion."""

from __future__ import annotations

import casadi
from casadi import SX, Function

from mbs.assembly import System
from mbs.assembly.model_function import Named, model_function
from mbs.models.moving_base import base_under_gravity
from mbs.models.symbols import ModelSymbols, symbols_of
from mbs.recursions.accelerations import Acceleration, resting_base
from mbs.recursions.joint_efforts import joint_efforts, spring_effort
from mbs.recursions.names import newton_euler_names
from mbs.recursions.newton_euler import Dynamics, Wrench, newton_euler
from mbs.spatial import cross


def inverse_dynamics(
    system: System,
    f_ext: bool = False,
    coordinates: str = "independent",
    *,
    moving_base: bool = False,
) -> Function:
    """``idm(q, v, a) -> tau``: the joint efforts that produce the accelerations a.

    Rotors, viscous and dry friction and springs of the joints are included.

    Source: Khalil & Kleinfinger 1987; Khalil & Creusot 1997, eq. 15-20 and 22.

    Args:
        system: open or closed; q must close the loops.
        f_ext: add an input f_ext (6, bodies): for each row of `system.bodies` the wrench
            [force; moment] that the body exerts on its environment, in the body's frame.
        coordinates: of a closed system, "independent" for idm(q, v_a, a_a) -> tau_a, or "tree".
        moving_base: add the inputs v_0 (6), velocity [V; w] of the base, a_0 (6), accelerations
            [vd; wd] of its origin and angular, both in its own axes, and R_0 (3, 3), orientation
            of the base in the frame in which gravity is given.

    Returns:
        Function of q (nq, 1), v and a (m, 1), f_ext, v_0, a_0, R_0; tau (m, 1) [N m or N].
    """

    def build() -> tuple[Named, Named, Named]:
        s = symbols_of(system, coordinates)
        name, a = s.input("a")
        wrenches = SX.sym("f_ext", 6, len(system.bodies))
        external = external_wrenches(system, wrenches) if f_ext else None
        base, motion = base_under_gravity(system.tree.gravity, moving_base)
        dynamics = tree_dynamics(system, s, s.tree_acceleration(a), base, external)
        tau = s.reduced_effort(with_joints(system, s, dynamics, s.tree_acceleration(a)))
        inputs: Named = [("q", s.q), ("v" + s.suffix, s.v), (name, a)]
        extra: Named = [("f_ext", wrenches)] if f_ext else []
        names = newton_euler_names(dynamics)
        return [*inputs, *extra, *motion], [("tau" + s.suffix, tau)], names

    return model_function(system, ("idm", f_ext, moving_base, coordinates), build)


def bias(
    system: System, coordinates: str = "independent", *, moving_base: bool = False
) -> Function:
    """``bias(q, v) -> H``: the efforts at zero acceleration, so that tau = A a + H.

    Coriolis, centrifugal and gravity efforts, friction and springs of the joints.

    Source: Khalil & Creusot 1997, eq. 25 and section 5.3.1.

    Args:
        system: open or closed; q must close the loops.
        coordinates: as for `inverse_dynamics`.
        moving_base: as for `inverse_dynamics`; the acceleration of the base is part of H.

    Returns:
        Function of q (nq, 1), v (m, 1), v_0, a_0, R_0; H (m, 1) [N m or N].
    """

    def build() -> tuple[Named, Named, Named]:
        s = symbols_of(system, coordinates)
        base, motion = base_under_gravity(system.tree.gravity, moving_base)
        a = s.tree_acceleration(SX.zeros(s.size))
        dynamics = tree_dynamics(system, s, a, base)
        H = s.reduced_effort(with_joints(system, s, dynamics, a))
        inputs: Named = [("q", s.q), ("v" + s.suffix, s.v), *motion]
        return inputs, [("H" + s.suffix, H)], newton_euler_names(dynamics)

    return model_function(system, ("bias", moving_base, coordinates), build)


def gravity_effort(
    system: System, coordinates: str = "independent", *, moving_base: bool = False
) -> Function:
    """``gravity(q) -> Q``: the efforts that hold the mechanism still, against springs too.

    Source: Khalil & Creusot 1997, eq. 23.

    Args:
        system: open or closed; q must close the loops.
        coordinates: as for `inverse_dynamics`.
        moving_base: add the input R_0 (3, 3), orientation of the base in the frame in which
            gravity is given.

    Returns:
        Function of q (nq, 1) and R_0; Q (m, 1) [N m or N].
    """

    def build() -> tuple[Named, Named]:
        s = symbols_of(system, coordinates)
        R_0 = SX.sym("R_0", 3, 3)
        gravity = system.tree.gravity
        turned = casadi.mtimes(R_0.T, gravity) if moving_base else gravity
        extra: Named = [("R_0", R_0)] if moving_base else []
        Q = s.reduced_effort(tree_gravity(system, s, turned))
        return [("q", s.q), *extra], [("Q" + s.suffix, Q)]

    return model_function(system, ("gravity", moving_base, coordinates), build)


def tree_dynamics(
    system: System,
    s: ModelSymbols,
    a: SX,
    base: Acceleration,
    external: dict[int, Wrench] | None = None,
) -> Dynamics:
    """The recursions over the tree for its accelerations a (nv, 1), without joint effects."""
    return newton_euler(system.tree, s.poses, s.v_tree, a, base, external)


def with_joints(system: System, s: ModelSymbols, dynamics: Dynamics, a: SX) -> SX:
    """(nv, 1) efforts with the drives, friction and springs of the joints."""
    return dynamics.efforts + joint_efforts(system.tree, s.q, s.v_tree, a)


def tree_efforts(system: System, s: ModelSymbols, a: SX, base: Acceleration | None = None) -> SX:
    """(nv, 1) efforts of the tree, those of its joints included, for accelerations a (nv, 1)."""
    resting = resting_base(system.tree.gravity)
    return with_joints(system, s, tree_dynamics(system, s, a, base or resting), a)


def tree_gravity(system: System, s: ModelSymbols, gravity: SX | None = None) -> SX:
    """(nv, 1) efforts of the tree that hold it still, against gravity and springs."""
    rest = SX.zeros(system.nv)
    base = resting_base(system.tree.gravity if gravity is None else gravity)
    efforts = newton_euler(system.tree, s.poses, rest, rest, base).efforts
    return efforts + spring_effort(system.tree, s.q)


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
