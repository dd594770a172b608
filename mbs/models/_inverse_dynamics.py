"""Inverse dynamics: joint efforts that produce a motion."""

from __future__ import annotations

import casadi
from casadi import SX, Function

from mbs.assembly import System
from mbs.assembly.model_function import Named, model_function
from mbs.models.actuation import effort_output
from mbs.models.symbols import (
    ExternalForces,
    ModelSymbols,
    configuration_check,
    exerted,
    surroundings,
    symbols_of,
)
from mbs.models.tree_table import TreeLoops
from mbs.recursions.force_elements import element_efforts
from mbs.recursions.link_motions import resting_base
from mbs.recursions.newton_euler import (
    Dynamics,
    joint_efforts,
    newton_euler,
    newton_euler_names,
    spring_effort,
)
from mbs.recursions.parts import PartsAt


def inverse_dynamics(
    system: System,
    coordinates: str = "independent",
    *,
    f_ext: bool = False,
    moving_base: bool = False,
) -> Function:
    """Return the inverse dynamics, joint efforts for accelerations a: ``idm(q, v, a) -> tau``.

    Rotors, viscous and Coulomb friction and springs of the joints, and force elements are included.
    If the motors of a closed system are not exactly its independent joints, the model is idm(q,
    v_a, a_a) -> tau_m with the efforts of all `system.motors`. With redundant motors the sum of
    squares of tau_m, in N m and N, is minimal; `actuation_null_space` spans all solutions.

    Source: Khalil & Kleinfinger 1987; Khalil & Creusot 1997, eq. 15-20 and 22.

    Args:
        system: open or closed mechanism; q must close the loops.
        coordinates: form for a closed system: "independent" for idm(q, v_a, a_a) -> tau_a, or
            "tree".
        f_ext: whether to add an input f_ext (6, bodies): for each row of `system.bodies` the wrench
            [force; moment] that the body exerts on its environment, in the body frame.
        moving_base: whether to add the inputs v_0 (6, 1), velocity [V; w] of the base, a_0 (6, 1),
            linear acceleration of its origin and angular acceleration [vd; wd], both in base axes,
            and R_0 (3, 3), orientation of the base in the frame that gravity is expressed in.

    Returns:
        Function of q (nq, 1), v and a (m, 1), f_ext, v_0, a_0, R_0; tau (m, 1), or tau_m (k, 1) [N
        m or N].
    """

    def build() -> tuple[Named, Named, Named]:
        s = symbols_of(system, coordinates)
        name, a = s.input("a")
        around = surroundings(system, f_ext, moving_base)
        tau, names = _efforts(system, s, s.tree_acceleration(a), around)
        inputs: Named = [("q", s.q), ("v" + s.suffix, s.v), (name, a), *around.inputs]
        return inputs, [effort_output(system, s, tau)], names

    return model_function(
        system,
        ("idm", f_ext, moving_base, coordinates),
        build,
        configuration_check(system, coordinates),
        None if f_ext or moving_base else TreeLoops(system, "idm"),
    )


def bias(
    system: System, coordinates: str = "independent", *, moving_base: bool = False
) -> Function:
    """Return the joint efforts at zero acceleration (nonlinear effects): ``bias(q, v) -> H``.

    tau = A a + H. H contains Coriolis, centrifugal and gravity efforts, friction and springs of the
    joints, and force elements.

    Source: Khalil & Creusot 1997, eq. 25 and section 5.3.1.

    Args:
        system: open or closed mechanism; q must close the loops.
        coordinates: coordinates of a closed system, "independent" or "tree".
        moving_base: whether to add the inputs v_0, a_0, R_0 as for `inverse_dynamics`; H includes
            the acceleration of the base.

    Returns:
        Function of q (nq, 1), v (m, 1), v_0, a_0, R_0; H (m, 1) [N m or N].
    """

    def build() -> tuple[Named, Named, Named]:
        s = symbols_of(system, coordinates)
        around = surroundings(system, moves=moving_base)
        H, names = _efforts(system, s, s.tree_acceleration(SX.zeros(s.size)), around)
        inputs: Named = [("q", s.q), ("v" + s.suffix, s.v), *around.inputs]
        return inputs, [("H" + s.suffix, H)], names

    return model_function(
        system, ("bias", moving_base, coordinates), build, configuration_check(system, coordinates)
    )


def gravity_effort(
    system: System, coordinates: str = "independent", *, moving_base: bool = False
) -> Function:
    """Return the joint efforts that balance gravity and springs at rest: ``gravity(q) -> Q``.

    Force elements act with their value at zero velocity: springs, stops and sources, not dampers.

    Source: Khalil & Creusot 1997, eq. 23.

    Args:
        system: open or closed mechanism; q must close the loops.
        coordinates: coordinates of a closed system, "independent" or "tree".
        moving_base: whether to add the input R_0 (3, 3), orientation of the base in the frame that
            gravity is expressed in.

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

    return model_function(
        system,
        ("gravity", moving_base, coordinates),
        build,
        configuration_check(system, coordinates),
    )


def _efforts(system: System, s: ModelSymbols, a: SX, around: ExternalForces) -> tuple[SX, Named]:
    """Return the efforts in input coordinates for tree accelerations a (nv, 1).

    The second result are (name, scalar) of intermediate quantities.
    """
    dynamics = _dynamics(system, s, a, around)
    tau = dynamics.efforts + own_efforts(system, s, a)
    return s.reduced_effort(tau), newton_euler_names(dynamics)


def tree_efforts(system: System, s: ModelSymbols, a: SX, around: ExternalForces) -> SX:
    """Return the inverse dynamics (nv, 1) of the tree for accelerations a, with joint friction.

    Args:
        system: open or closed mechanism.
        s: symbols of the system.
        a: (nv, 1) accelerations of the tree.
        around: base motion and external wrenches.
    """
    return _dynamics(system, s, a, around).efforts + own_efforts(system, s, a)


def own_efforts(system: System, s: ModelSymbols, a: SX) -> SX:
    """Return the efforts (nv, 1) of the joints themselves and of components on coordinates.

    They are efforts of rotors, friction, springs and stops.

    Args:
        system: open or closed mechanism.
        s: symbols of the system.
        a: (nv, 1) accelerations of the tree.
    """
    acting = PartsAt(system, s.q, s.v_tree).efforts()
    return joint_efforts(system.tree, s.q, s.v_tree, a) + acting


def _dynamics(system: System, s: ModelSymbols, a: SX, around: ExternalForces) -> Dynamics:
    """Return the results of the Newton-Euler recursion for accelerations a (nv, 1).

    `around` has the base motion and external wrenches.
    """
    external = exerted(system, around, s.poses, s.q, s.v_tree)
    return newton_euler(system.tree, s.poses, s.v_tree, a, around.base, external)


def tree_gravity(system: System, s: ModelSymbols, gravity: SX | None = None) -> SX:
    """Return the tree efforts (nv, 1) that balance gravity, springs, stops and sources at rest.

    Args:
        system: open or closed mechanism.
        s: symbols of the system.
        gravity: (3, 1) gravity acceleration in the base frame [m/s^2]; default: that of the tree.
    """
    rest = SX.zeros(system.nv)
    base = resting_base(system.tree.gravity if gravity is None else gravity)
    efforts = newton_euler(system.tree, s.poses, rest, rest, base).efforts
    return efforts + static_efforts(system, s)


def static_efforts(system: System, s: ModelSymbols) -> SX:
    """Return the tree efforts (nv, 1) that balance springs, stops and sources at rest.

    Gravity is not included.

    Args:
        system: open or closed mechanism.
        s: symbols of the system.
    """
    rest = SX.zeros(system.nv)
    acting = element_efforts(PartsAt(system, s.q, rest), s.poses)
    return spring_effort(system.tree, s.q) + acting
