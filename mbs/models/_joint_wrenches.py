"""Wrenches that joints transmit: constraint forces and the efforts along the joint."""

from __future__ import annotations

import casadi
from casadi import SX, Function

from mbs.assembly import System
from mbs.assembly.model_function import Named, model_function, require_system
from mbs.assembly.tables import JointRow, WeldedPart
from mbs.assembly.tree import Tree
from mbs.loops.closure_equations import row_groups
from mbs.loops.velocity import (
    constraint_jacobian,
    cut_wrenches,
    determining_rows,
    kept_rows,
    on_links,
    part_wrenches,
)
from mbs.models._inverse_dynamics import tree_efforts
from mbs.models.actuation import motors_apart, shared_efforts
from mbs.models.symbols import (
    ExternalForces,
    ModelSymbols,
    check_coordinates,
    configuration_check,
    exerted,
    outputs_of,
    surroundings,
    symbols_of,
    wrenches_on_links,
)
from mbs.recursions.force_elements import (
    element_wrenches,
    inertial_loads,
    sum_wrenches,
    transmitted_wrenches,
)
from mbs.recursions.link_motions import Acceleration, link_accelerations
from mbs.recursions.newton_euler import inertial_wrench
from mbs.recursions.parts import PartsAt
from mbs.recursions.route import relative_pose
from mbs.solvers.linear import solve_saddle, solve_square
from mbs.spatial import Pose, PseudoInertia, Wrench, add_wrenches, cross, transform_wrench, zeros

# Wrenches of Fixed joints, which weld two bodies into one link, as a force sensor measures them.


def weld_wrench(
    system: System,
    s: ModelSymbols,
    a: SX,
    around: ExternalForces,
    joint: JointRow,
    others: dict[str, Wrench],
) -> Wrench:
    """Return the wrench of a Fixed joint on the body of frame_b, about and in frame_b.

    It is the Newton-Euler balance of the part of the link on one side of the joint: inertial wrench
    plus the wrenches that this part exerts on joints, force elements and environment.

    Args:
        system: open or closed mechanism.
        s: symbols of the system.
        a: (nv, 1) accelerations of the tree.
        around: base motion and external wrenches.
        joint: row of a Fixed joint with its welded part.
        others: wrenches of all joints that are not Fixed, by name, about and in their frame_b.
    """
    part, (link, pose) = joint.part, joint.frame_b
    assert part is not None
    motions = link_accelerations(system.tree, s.poses, s.v_tree, a, around.base)
    motion = motions[link] if link >= 0 else around.base
    total = inertial_wrench(PseudoInertia.of(part.inertia), motion)
    total = add_wrenches(total, (zeros(), _rotor_momentum_rate(system, part, s.v_tree, a, motion)))
    elements = element_wrenches(PartsAt(system, s.q, s.v_tree), held=part.ports)
    exerted = [elements.get(link), _external_wrenches(system, part, around).get(link)]
    exerted += [
        _wrench_on_joint(system, s.q, row, link, side, others[row.name])
        for row in system.joints
        for side in "ab"
        if row.name in others and (row.name, side) in part.ports
    ]
    for wrench in exerted:
        if wrench is not None:
            total = add_wrenches(total, wrench)
    f, m = transform_wrench(pose.inverse(), total)
    return part.sign * f, part.sign * m


def _wrench_on_joint(
    system: System, q: SX, row: JointRow, link: int, side: str, wrench: Wrench
) -> Wrench:
    """Return the wrench that a body exerts on a joint, about and in the frame of its link `link`.

    The body is on `side` "a" or "b". `wrench` is the joint wrench on the body of frame_b, about and
    in frame_b.
    """
    T = relative_pose(system.tree, q, (link, Pose.identity()), row.frame_b)
    sign = 1 if side == "a" else -1
    f, m = transform_wrench(T, wrench)
    return sign * f, sign * m


def _external_wrenches(
    system: System, part: WeldedPart, around: ExternalForces
) -> dict[int, Wrench]:
    """Return the wrenches of the bodies of a welded part on their environment, by link index.

    They are taken from the input f_ext of `around`; empty without this input.
    """
    f_ext = dict(around.inputs).get("f_ext")
    if f_ext is None:
        return {}
    keep = SX([float((row.name, "") in part.ports) for row in system.bodies])
    return wrenches_on_links(system, casadi.mtimes(f_ext, casadi.diag(keep)))


def _rotor_momentum_rate(
    system: System, part: WeldedPart, v: SX, a: SX, motion: Acceleration
) -> SX:
    """Return the rate of the angular momentum of the rotors on a welded part [N m], (3, 1).

    It is in axes of the link of the part, whose motion is `motion`. `v` and `a` (nv, 1) are
    velocities and accelerations of the tree.
    """
    total = zeros()
    for link in system.tree.links:
        if link.rotor is not None and (link.name, "a") in part.ports:
            momentum = link.rotor.momentum
            total += momentum * a[link.v] + cross(motion.w, momentum * v[link.v])
    return total


def joint_wrenches(
    system: System,
    coordinates: str = "independent",
    *,
    f_ext: bool = False,
    moving_base: bool = False,
) -> Function:
    """Return the wrenches that all joints transmit: ``joint_wrenches(q, v, a) -> F``.

    A column [force; moment] of F is the wrench that the body of frame_a exerts on the body of
    frame_b through the joint, about the origin of frame_b and in its axes. It contains all loads in
    the joint: constraint forces, motor, rotor inertia, friction, spring and stops, and the efforts
    of couplings. Force elements between points are not part of joint wrenches. The wrench of a
    Fixed joint balances the part of the link on one side of the joint.

    In a closed system the joint efforts determine how the loops share the load. With independent
    coordinates the independent joints have the efforts of the inverse dynamics, and other joints
    have none. With tree coordinates the input tau gives all efforts. Forces along dropped closure
    rows (`system.loops[..].dropped`) are undetermined for rigid bodies and set to zero. In
    over-constrained loops whose independent rows change with the configuration
    (`system.closure.varies`), the row efforts of smallest norm are used.

    Source: Khalil & Creusot 1997, eq. 15-19 and 22; Haug 1989 for cut joints.

    Args:
        system: open or closed mechanism; q must close the loops.
        coordinates: form for a closed system: "independent" for joint_wrenches(q, v_a, a_a) -> F,
            "tree" for joint_wrenches(q, v, a, tau) -> F. tau must be consistent with the motion, as
            in `direct_dynamics`.
        f_ext: whether to add the input f_ext of external wrenches, see `inverse_dynamics`.
        moving_base: whether to add the inputs v_0, a_0, R_0 of the base motion, see
            `inverse_dynamics`.

    Returns:
        Function of q (nq, 1), v, a and tau (m, 1), and optionally f_ext, v_0, a_0, R_0; F (6,
        joints), one column for each row of `system.joints` [N, N m].
    """
    require_system(system)
    check_coordinates(system, coordinates)

    def build() -> tuple[Named, Named]:
        s = symbols_of(system, coordinates)
        inputs, a, tau = motion_inputs(system, s)
        around = surroundings(system, f_ext, moving_base)
        wrenches = wrenches_of_joints(system, s, a, tau, around)
        F = casadi.horzcat(*(casadi.vertcat(*wrench) for wrench in wrenches))
        return [*inputs, *around.inputs], [("F", F)]

    key = ("joint_wrenches", f_ext, moving_base, coordinates)
    return model_function(system, key, build, configuration_check(system, coordinates))


def motion_inputs(system: System, s: ModelSymbols) -> tuple[Named, SX, SX | None]:
    """Return the inputs q, v, a and tau of a model, accelerations of the tree, and the symbol tau.

    tau is an input only with tree coordinates of a closed system.

    Args:
        system: open or closed mechanism.
        s: symbols of the system.

    Returns:
        (name, symbol) of each input, tree accelerations (nv, 1), and tau (nv, 1) or None.
    """
    name, a = s.input("a")
    inputs = [("q", s.q), ("v" + s.suffix, s.v), (name, a)]
    tau = None
    if system.is_closed and s.reduction is None:
        tau = SX.sym("tau", system.nv)
        inputs.append(("tau", tau))
    return inputs, s.tree_acceleration(a), tau


def wrenches_of_joints(
    system: System, s: ModelSymbols, a: SX, tau: SX | None, around: ExternalForces
) -> list[Wrench]:
    """Return the wrench of each row of `system.joints` on the body of frame_b.

    It is about the origin and in axes of frame_b.

    Args:
        system: open or closed mechanism.
        s: symbols of the system.
        a: (nv, 1) accelerations of the tree.
        tau: (nv, 1) joint efforts; None if they follow from the motion by inverse dynamics.
        around: base motion and external wrenches.
    """
    cut: dict[str, Wrench] = {}
    loads = [
        inertial_loads(system.tree, s.poses, s.v_tree, a, around.base),
        exerted(system, around, s.poses, s.q, s.v_tree),
    ]
    if system.is_closed:
        lam = closure_efforts(system, s, a, tau, around)
        cut = cut_wrenches(system, s.q, lam)
        loads.append(on_links(system, s.q, cut))
        loads.append(part_wrenches(system, s.q, lam))
    through = transmitted_wrenches(system.tree, s.poses, sum_wrenches(*loads))
    between = {
        joint.name: cut[joint.name]
        if joint.cut
        else _wrench_at_frame_b(system.tree, s.q, joint, through)
        for joint in system.joints
        if joint.part is None
    }
    return [
        between[joint.name]
        if joint.part is None
        else weld_wrench(system, s, a, around, joint, between)
        for joint in system.joints
    ]


def row_efforts(system: System) -> Function:
    """Return the efforts of all closure rows: ``row_efforts(q, v, a, tau) -> lam``.

    Args:
        system: closed mechanism. The motion q, v, a must close the loops; tau must be consistent
            with it.

    Returns:
        Function of q (nq, 1), v, a and tau (nv, 1); lam (m, 1) of all rows, dropped ones included.
    """

    def build() -> tuple[Named, Named]:
        s = symbols_of(system, "tree")
        a, tau = SX.sym("a", system.nv), SX.sym("tau", system.nv)
        lam = closure_efforts(system, s, a, tau, surroundings(system))
        return [("q", s.q), ("v", s.v), ("a", a), ("tau", tau)], [("lam", lam)]

    return model_function(system, ("row_efforts",), build)


def shown_outputs(system: System, parts: PartsAt, a: SX, tau: SX) -> SX:
    """Return the outputs (ny, 1) of components, with the efforts of their rows substituted.

    Args:
        system: open or closed mechanism.
        parts: components of the system at positions and velocities.
        a: (nv, 1) accelerations of the tree.
        tau: (nv, 1) joint efforts, including drives and external loads.
    """
    y, symbols = parts.outputs(), parts.effort_symbols
    if not symbols.numel() or not casadi.depends_on(y, symbols):
        return y
    assert parts.v is not None
    (lam,) = outputs_of(system, row_efforts(system), parts.q, parts.v, a, tau)
    names = [part.name for part in system.parts if part.element.binds]
    groups = row_groups(system)
    every = [g.name for g in groups for _ in g.positions]
    every += [g.name for g in groups for _ in g.velocities]
    own = [k for k, name in enumerate(every) if name in names]
    return casadi.substitute(y, symbols, casadi.densify(lam[own]))


def closure_efforts(
    system: System, s: ModelSymbols, a: SX, tau: SX | None, around: ExternalForces
) -> SX:
    """Return the efforts lam (m, 1) of all closure rows.

    J' lam are the required efforts minus the motor efforts. Efforts of dropped rows are zero. If
    the independent rows change with the configuration, lam has the smallest norm.

    Args:
        system: closed mechanism.
        s: symbols of the system.
        a: (nv, 1) accelerations of the tree.
        tau: (nv, 1) motor efforts; None if they follow from the motion by inverse dynamics.
        around: base motion and external wrenches.
    """
    closure = system.closure
    assert closure is not None
    needed = tree_efforts(system, s, a, around)
    if tau is None and motors_apart(system, s):
        tau = shared_efforts(system, s, needed)
    left = needed if tau is None else needed - tau
    rows = determining_rows(system, s.q)
    if s.reduction is not None or closure.varies:
        shares = solve_square(rows.square.T, left[list(closure.passive)])
        lam = casadi.mtimes(rows.mixed.T, shares)
    else:
        rest = SX.zeros(rows.J.shape[0])
        lam = solve_saddle(SX.eye(system.nv), rows.J, -left, rest, 1.0)[1]
    if closure.varies:
        return casadi.densify(lam)
    every = SX.zeros(constraint_jacobian(system).size1_out(0))
    if lam.numel():
        every[kept_rows(system)] = lam
    return every


def _wrench_at_frame_b(tree: Tree, q: SX, joint: JointRow, through: list[Wrench]) -> Wrench:
    """Return the wrench of a tree joint on the body of frame_b, about and in frame_b.

    Args:
        tree: tree of the system.
        q: (nq, 1) positions.
        joint: row of the joint.
        through: wrench transmitted to each link by its antecedent, in the frame of the link.
    """
    link = max(joint.frame_a[0], joint.frame_b[0])
    T = relative_pose(tree, q, joint.frame_b, (link, Pose.identity()))
    f, m = transform_wrench(T, through[link])
    sign = 1 if link == joint.frame_b[0] else -1
    return sign * f, sign * m
