"""The devices that drive shafts: what they deliver, and how their own states change."""

from __future__ import annotations

import casadi
from casadi import SX, Function

from mbs.assembly import System
from mbs.assembly.model_function import Named, model_function, require_system
from mbs.errors import ModelError


def devices(system: System) -> Function:
    """``devices(v, z, u) -> tau, zdot, y``: the motors and torques of the drive lines.

    The elements of z, u and y are those that `devices(system).elements("z")` names: currents of
    motors; voltages and torques; what a simulation shows beside them.

    Args:
        system: open or closed, with devices.

    Returns:
        Function of v (nv, 1) velocities of the tree, z (nz, 1) states and u (nu, 1) inputs; tau
        (nv, 1) what they deliver at the coordinates [N m or N], zdot (nz, 1), y (ny, 1).

    Raises:
        ModelError: the system has no device.
    """
    require_system(system)
    if not system.devices:
        raise ModelError(
            f"{system.name}: there is no motor and no torque on a flange; connect a DCMotor or a"
            " TorqueSource, or use the efforts tau of the joints"
        )

    def build() -> tuple[Named, Named]:
        nz, nu = state_count(system), len(system.devices)
        v, z, u = SX.sym("v", system.nv), SX.sym("z", nz), SX.sym("u", nu)
        tau, zdot, y = device_equations(system, v, z, u)
        return [("v", v), ("z", z), ("u", u)], [("tau", tau), ("zdot", zdot), ("y", y)]

    return model_function(system, ("devices",), build)


def state_count(system: System) -> int:
    """Number of the states of all devices."""
    return sum(len(device.states) for device in system.devices)


def device_equations(system: System, v: SX, z: SX, u: SX) -> tuple[SX, SX, SX]:
    """What all devices deliver at the coordinates, the rates of their states, and their outputs.

    Args:
        system: with devices or without any.
        v: (nv, 1) velocities of the tree.
        z: (nz, 1) states, device by device.
        u: (nu, 1) inputs, one for each device.
    """
    tau = SX.zeros(system.nv)
    rates, shown, first = [SX(0, 1)], [SX(0, 1)], 0
    for number, device in enumerate(system.devices):
        last = first + len(device.states)
        own = z[first:last], u[number], v
        tau[device.velocity] += device.effort(*own)
        rates.append(device.rate(*own))
        shown.append(device.shown(*own))
        first = last
    return tau, casadi.vertcat(*rates), casadi.vertcat(*shown)
