"""Model of the sensor signals of a mechanism."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import casadi
from casadi import SX, Function

from mbs.assembly import System
from mbs.assembly.model_function import Named, model_function, require_system
from mbs.assembly.tables import ANGULAR, QUATERNION, AttachedSensor
from mbs.closed_forms.spatial import unit_quaternion
from mbs.errors import ModelError
from mbs.models._direct_dynamics import direct_dynamics
from mbs.models._joint_wrenches import motion_inputs, wrenches_of_joints
from mbs.models.loop_kinematics import cut_coordinate
from mbs.models.symbols import (
    ExternalForces,
    ModelSymbols,
    check_coordinates,
    configuration_check,
    outputs_of,
    surroundings,
    symbols_of,
)
from mbs.recursions.link_motions import (
    Acceleration,
    Velocity,
    link_accelerations,
    link_velocities,
    resting_base,
)
from mbs.recursions.parts import later_signal, later_sources
from mbs.recursions.readings import (
    Readings,
    axes_of,
    coordinate_readings,
    frame_readings,
    in_axes,
)
from mbs.recursions.route import frame_velocity, relative_acceleration, relative_motion
from mbs.spatial import Wrench, zeros


def measurements(system: System, coordinates: str = "independent") -> Function:
    """Return the sensor signals: ``measurements(q, v, a) -> tip_p, tip_v, ...``.

    There is one output per quantity of each sensor, in the order of `system.sensors`, with the
    names of `AttachedSensor.outputs`: tip_p is the position of sensor tip, arm_tip_p of arm.tip.

    Args:
        system: open or closed, with sensors; q must close the loops.
        coordinates: form for a closed system: "independent" for measurements(q, v_a, a_a), "tree"
            for measurements(q, v, a, tau) with tau consistent with the motion, see
            `joint_wrenches`.

    Returns:
        Function of q (nq, 1), v, a and tau (m, 1); outputs are vectors (3, 1), orientations (3, 3)
        and scalars.

    Raises:
        ModelError: the system has no sensors.
    """
    require_system(system)
    check_coordinates(system, coordinates)
    if not system.sensors:
        raise ModelError(
            f"{system.name}: there is no sensor; add one to the mechanism, such as"
            " AbsoluteSensor('tip', body)"
        )

    def build() -> tuple[Named, Named]:
        s = symbols_of(system, coordinates)
        inputs, a, tau = motion_inputs(system, s)
        return inputs, readings(system, s, a, tau, surroundings(system))

    check = configuration_check(system, coordinates)
    return model_function(system, ("measurements", coordinates), build, check)


def readings(
    system: System, s: ModelSymbols, a: SX, tau: SX | None, around: ExternalForces
) -> list[tuple[str, SX]]:
    """Return (name, expression) of the outputs of `measurements`, with external wrenches.

    Args:
        system: open or closed mechanism.
        s: symbols of the system.
        a: (nv, 1) accelerations of the tree.
        tau: (nv, 1) joint efforts; None if they follow from the motion by inverse dynamics.
        around: base motion and external wrenches.
    """
    state = _observed(system, s, a, tau, around)
    outputs: list[tuple[str, SX]] = []
    for attached in system.sensors:
        read = _READ[attached.sensor.reads](state, attached)
        outputs += [(name, read[quantity.name]) for name, quantity in attached.outputs]
    return outputs


def with_readings(
    system: System,
    values: list[SX],
    state: tuple[SX, SX, SX | None, SX],
    wrenches: SX | None = None,
) -> list[SX]:
    """Replace sensor signals of accelerations and forces in expressions by their values.

    They are signals that are wired to component inputs.

    Args:
        system: open or closed mechanism.
        values: expressions of rates and outputs of components.
        state: q, v, a and tau (nv, 1) of the tree; if a is None, it follows from tau.
        wrenches: external wrenches of the model, if it has any.

    Raises:
        ModelError: a wired sensor reads forces, and the model has external wrenches.
    """
    sources = later_sources(system)
    symbols = casadi.vertcat(SX(0, 1), *(later_signal(system, one) for one in sources))
    if not symbols.numel() or not casadi.depends_on(casadi.veccat(*values), symbols):
        return values
    q, v, a, tau = state
    if a is None:
        model = direct_dynamics(system, coordinates="tree")
        a, *_ = outputs_of(system, model, q, v, tau)
    motion = (q, v, a, tau) if system.is_closed else (q, v, a)
    read = outputs_of(system, measurements(system, "tree"), *motion)
    names = [
        (attached, quantity) for attached in system.sensors for _, quantity in attached.outputs
    ]
    found = []
    for source in sources:
        name, _, element = source.signal.partition(".")
        for (attached, quantity), value in zip(names, read, strict=True):
            if attached.sensor.name == source.owner and quantity.name == name:
                if wrenches is not None and wrenches.numel() and attached.joint is not None:
                    raise ModelError(
                        f"{system.name}: the wire from {source} carries a force, which external"
                        " wrenches change; leave the inputs with wrenches out"
                    )
                found.append(casadi.vec(value)[quantity.elements.index(element)])
    return list(casadi.substitute(values, [symbols], [casadi.vertcat(*found)]))


@dataclass(frozen=True, slots=True, eq=False)
class _Observed:
    """Motion and joint wrenches from which sensor signals are computed.

    Attributes:
        system: mechanism.
        s: symbols of the system.
        a: (nv, 1) accelerations of the tree.
        velocities, accelerations: motion of each link in its frame, without gravity.
        wrenches: wrench of each joint about and in frame_b; empty if no sensor measures a joint
            wrench.
    """

    system: System
    s: ModelSymbols
    a: SX
    velocities: list[Velocity]
    accelerations: list[Acceleration]
    wrenches: list[Wrench]


def _observed(
    system: System, s: ModelSymbols, a: SX, tau: SX | None, around: ExternalForces
) -> _Observed:
    """Return the motions and joint wrenches from which sensor signals are computed.

    `a` are the accelerations (nv, 1) of the tree and `tau` its joint efforts, as in
    `wrenches_of_joints`. Without joint sensors the wrenches are left out.
    """
    transmits = any(attached.joint is not None for attached in system.sensors)
    wrenches = wrenches_of_joints(system, s, a, tau, around) if transmits else []
    return _Observed(
        system,
        s,
        a,
        link_velocities(system.tree, s.poses, s.v_tree),
        link_accelerations(system.tree, s.poses, s.v_tree, a, resting_base(zeros())),
        wrenches,
    )


def _frame_signals(state: _Observed, attached: AttachedSensor) -> Readings:
    """Return the signals, by name, of the sensor `attached` of a frame motion or a frame distance.

    `state` has the motions of the links.
    """
    tree = state.system.tree
    return frame_readings(tree, attached, state.s.q, state.velocities, state.accelerations)


def _coordinate_signals(state: _Observed, attached: AttachedSensor) -> Readings:
    """Return the signals, by name, of the sensor `attached` of a joint coordinate.

    They are position, velocity and acceleration. `state` has the motions of the tree.
    """
    system, s, name = state.system, state.s, attached.coordinate
    if attached.frames:
        return _cut_rotation(state, attached)
    if name in [row.name for row in system.cut_coordinates]:
        q, v, a = cut_coordinate(system, s, state.a, name)
        return {"q": q, "v": v, "a": a}
    tables = system.coordinates, system.velocity_coordinates
    return coordinate_readings(name, tables, s.q, s.v_tree, state.a)


def _cut_rotation(state: _Observed, attached: AttachedSensor) -> Readings:
    """Return the signals, by name, of the sensor `attached` of a cut joint's rotation.

    It measures a quaternion element, or an element of angular velocity and acceleration. `state`
    has the motions of the links.
    """
    frame_a, frame_b = attached.frames
    motion = relative_motion(state.system.tree, frame_a, frame_b, state.s.q, state.velocities)
    element = attached.coordinate.rpartition(".")[2]
    if element in QUATERNION:
        return {"q": unit_quaternion(motion.R)[QUATERNION.index(element)]}
    rate = relative_acceleration(motion, frame_a, frame_b, state.accelerations)
    w, wd = (casadi.mtimes(motion.R.T, x) for x in (motion.w, rate.wd))
    number = ANGULAR.index(element)
    return {"v": w[number], "a": wd[number]}


def _joint_load(state: _Observed, attached: AttachedSensor) -> Readings:
    """Return the force f and moment m that a joint transmits, in the axes of its sensor `attached`.

    `state` has the joint wrenches.
    """
    assert attached.joint is not None
    f, m = state.wrenches[attached.joint]
    home = attached.frames[1]
    return in_axes(state.system.tree, state.s.q, {"f": f, "m": m}, axes_of(attached), home)


def _power(state: _Observed, attached: AttachedSensor) -> Readings:
    """Return the power P that the joint of the sensor `attached` delivers to the body of frame_b.

    `state` has motions and joint wrenches.
    """
    assert attached.joint is not None
    f, m = state.wrenches[attached.joint]
    V, w = frame_velocity(attached.frames[1], state.velocities)
    return {"P": casadi.dot(f, V) + casadi.dot(m, w)}


_READ: dict[str, Callable[[_Observed, AttachedSensor], Readings]] = {
    **dict.fromkeys(("absolute", "relative", "distance"), _frame_signals),
    "coordinate": _coordinate_signals,
    "wrench": _joint_load,
    "power": _power,
}
