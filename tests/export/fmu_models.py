"""The models that the tests of FMUs share."""

import dataclasses
from typing import NamedTuple

import casadi as ca
import numpy as np

from mbs.export.fmu.description import FmuModel, FmuState, FmuVariable, Jumps
from mbs.solvers import integrate


class Point(NamedTuple):
    """The symbols of a model without loops."""

    t: ca.SX
    x: ca.SX
    z: ca.SX
    u: ca.SX
    p: ca.SX


def point_of(states: int, inputs: int, parameters: int) -> Point:
    """Symbols of these sizes; the parameters are followed by the modes."""
    sizes = (1, states, 0, inputs, parameters)
    return Point(*(ca.SX.sym(name, n) for name, n in zip("txzup", sizes, strict=True)))


def moving(name: str, unit: str, rate: str, description: str, **options: float) -> FmuState:
    """A state that is an output too."""
    return FmuState(
        name=name,
        unit=unit,
        derivative_unit=rate,
        description=description,
        output=True,
        **options,
    )


def pendulum() -> FmuModel:
    """A damped pendulum with a torque, a time-dependent push and the place of its mass."""
    t, z = ca.SX.sym("t"), ca.SX.sym("z", 0)
    x, u, p = ca.SX.sym("x", 2), ca.SX.sym("u"), ca.SX.sym("p", 4)
    mass, length, damping, g = ca.vertsplit(p)
    push = 0.1 * ca.sin(3 * t)
    inertia = mass * length**2
    torque = u + push - damping * x[1] - mass * g * length * ca.sin(x[0])
    xdot = ca.vertcat(x[1], torque / inertia)
    y = ca.vertcat(length * ca.sin(x[0]), -length * ca.cos(x[0]))
    return FmuModel(
        name="damped pendulum",
        description="A pendulum with damping & torque",
        states=(
            FmuState(
                name="j1.q",
                unit="rad",
                derivative_unit="rad/s",
                start=1.0,
                description="angle",
                output=True,
            ),
            FmuState(
                name="j1.v",
                unit="rad/s",
                derivative_unit="rad/s2",
                nominal=3.0,
                description="angular velocity",
            ),
        ),
        inputs=(FmuVariable(name="tau", unit="N.m", description="torque on the joint"),),
        outputs=(
            FmuVariable(name="tip.x", unit="m", description="where the mass is"),
            FmuVariable(name="tip.y", unit="m", description="how high it is"),
        ),
        parameters=(
            FmuVariable(name="mass", unit="kg", start=1.0, min=1e-6, max=1e6, description="mass"),
            FmuVariable(name="length", unit="m", start=0.5, min=1e-6, description="length"),
            FmuVariable(
                name="damping", unit="N.m.s/rad", start=0.05, min=0.0, description="damping"
            ),
            FmuVariable(name="g", unit="m/s2", start=9.81, description="gravity"),
        ),
        rhs=ca.Function("pendulum_rhs", [t, x, z, u, p], [xdot, y]),
        stop_time=3.0,
        documentation="A damped pendulum.\n\nIts angle is measured from the vertical <down>.",
    )


def slider_crank() -> FmuModel:
    """A crank whose rod angle and slider position follow from the closure of the loop."""
    t, x, u = ca.SX.sym("t"), ca.SX.sym("x", 2), ca.SX.sym("u")
    z, p = ca.SX.sym("z", 2), ca.SX.sym("p", 5)
    crank, rod, inertia, mass, damping = ca.vertsplit(p)
    q, v, phi, slider = x[0], x[1], z[0], z[1]
    rows = ca.vertcat(
        crank * ca.cos(q) + rod * ca.cos(phi) - slider,
        crank * ca.sin(q) - rod * ca.sin(phi),
    )
    newton = z - ca.solve(ca.jacobian(rows, z), rows)
    closure = ca.Function("closure", [x, z, p], [newton, ca.norm_inf(rows)])
    turn = crank * ca.cos(q) / (rod * ca.cos(phi))
    s1 = -crank * ca.sin(q) - rod * ca.sin(phi) * turn
    s2 = ca.jacobian(s1, q) + ca.jacobian(s1, phi) * turn
    a = (u - damping * v - mass * s1 * s2 * v**2) / (inertia + mass * s1**2)
    return FmuModel(
        name="slider_crank",
        description="A slider driven by a crank",
        states=(
            FmuState(
                name="crank.q",
                description="angle of the crank",
                unit="rad",
                derivative_unit="rad/s",
                start=0.3,
                output=True,
            ),
            FmuState(
                name="crank.v",
                description="angular velocity of the crank",
                unit="rad/s",
                derivative_unit="rad/s2",
                start=6.0,
                nominal=5.0,
            ),
        ),
        inputs=(
            FmuVariable(name="torque", description="torque on the crank", unit="N.m", start=0.1),
        ),
        outputs=(
            FmuVariable(name="slider.v", description="velocity of the slider", unit="m/s"),
            FmuVariable(name="force", description="force on the slider", unit="N"),
        ),
        parameters=(
            FmuVariable(
                name="crank.length",
                description="length of the crank",
                unit="m",
                start=0.1,
                min=1e-6,
            ),
            FmuVariable(
                name="rod.length", description="length of the rod", unit="m", start=0.3, min=1e-6
            ),
            FmuVariable(
                name="inertia",
                description="inertia of the crank",
                unit="kg.m2",
                start=0.01,
                min=1e-9,
            ),
            FmuVariable(
                name="mass", description="mass of the slider", unit="kg", start=0.5, min=0.0
            ),
            FmuVariable(
                name="damping",
                description="viscous friction of the crank",
                unit="N.m.s/rad",
                start=0.001,
                min=0.0,
            ),
        ),
        dependents=(
            FmuVariable(name="rod.angle", description="angle of the rod", unit="rad", start=0.0),
            FmuVariable(name="slider.s", description="place of the slider", unit="m", start=0.4),
        ),
        rhs=ca.Function(
            "crank_rhs",
            [t, x, z, u, p],
            [ca.vertcat(v, a), ca.vertcat(s1 * v, mass * (s1 * a + s2 * v**2))],
        ),
        closure=closure,
        stop_time=2.0,
    )


def ball() -> FmuModel:
    """A ball that falls on a floor, until it rests there."""
    point = point_of(2, 0, 4)
    (h, v), (g, e, slow, rest) = ca.vertsplit(point.x), ca.vertsplit(point.p)
    fired, back = ca.SX.sym("fired"), -e * v
    stays = back <= slow
    return FmuModel(
        name="ball",
        description="A ball on a floor",
        states=(
            moving("h", "m", "m/s", "height", start=1.0),
            moving("v", "m/s", "m/s2", "velocity"),
        ),
        outputs=(FmuVariable(name="energy", unit="J", description="per mass"),),
        parameters=(
            FmuVariable(name="g", unit="m/s2", start=10.0, description="gravity"),
            FmuVariable(name="e", start=0.8, min=0.0, max=1.0, description="restitution"),
            FmuVariable(name="slow", unit="m/s", start=1e-3, description="it rests below"),
        ),
        rhs=ca.Function("rhs", point, [ca.vertcat(v, -g * (1 - rest)), g * h + v**2 / 2]),
        jumps=Jumps(
            modes=(FmuVariable(name="rests", description="1 on the floor"),),
            first=ca.Function("first", point, [0, -h]),
            indicators=ca.Function("indicators", point, [ca.if_else(rest, 1, h)]),
            jump=ca.Function(
                "jump",
                [*point, fired],
                [ca.if_else(stays, ca.SX(2, 1), ca.vertcat(h, ca.fmax(v, back))), stays],
            ),
            names=("floor",),
        ),
        stop_time=3.0,
    )


def clapper() -> FmuModel:
    """A pendulum between two stops, which counts its impacts."""
    point, fired = point_of(2, 1, 5), ca.SX.sym("fired", 2)
    (q, w), (length, e, low, high, hits) = ca.vertsplit(point.x), ca.vertsplit(point.p)
    outward = ca.if_else(fired[1], w, -w) > 0
    xdot = ca.vertcat(w, point.u - 9.81 / length * ca.sin(q))
    return FmuModel(
        name="clapper",
        description="A pendulum between stops",
        states=(
            moving("q", "rad", "rad/s", "angle", start=1.0),
            moving("w", "rad/s", "rad/s2", "angular velocity", nominal=3.0),
        ),
        inputs=(FmuVariable(name="push", unit="rad/s2", description="torque over inertia"),),
        outputs=(FmuVariable(name="energy", unit="J", description="over inertia"),),
        parameters=(
            FmuVariable(name="length", unit="m", start=0.5, min=0.01, description="length"),
            FmuVariable(name="e", start=0.9, min=0.0, max=1.0, description="restitution"),
            FmuVariable(name="low", unit="rad", start=-0.5, description="lower stop"),
            FmuVariable(name="high", unit="rad", start=1.2, description="upper stop"),
        ),
        rhs=ca.Function("rhs", point, [xdot, w**2 / 2 - 9.81 / length * ca.cos(q)]),
        jumps=Jumps(
            modes=(FmuVariable(name="hits", description="number of impacts"),),
            first=ca.Function("first", point, [0, ca.vertcat(low - q, q - high)]),
            indicators=ca.Function("indicators", point, [ca.vertcat(q - low, high - q)]),
            jump=ca.Function(
                "jump", [*point, fired], [ca.vertcat(q, ca.if_else(outward, -e * w, w)), hits + 1]
            ),
            names=("low stop", "high stop"),
        ),
        stop_time=3.0,
    )


def block() -> FmuModel:
    """A block with Coulomb friction and a force on it."""
    point, fired = point_of(2, 1, 3), ca.SX.sym("fired", 2)
    (_, v), (mass, most, mode) = ca.vertsplit(point.x), ca.vertsplit(point.p)
    force, slides = point.u, mode != 0
    a = ca.if_else(slides, (force - most * mode) / mass, 0)
    first = ca.if_else(slides, mode * v, most - force)
    begins = ca.if_else(fired[0], 1, ca.if_else(fired[1], -1, 0))
    return FmuModel(
        name="block",
        description="A block with friction",
        states=(
            moving("s", "m", "m/s", "way"),
            moving("v", "m/s", "m/s2", "velocity", start=1.0),
        ),
        inputs=(FmuVariable(name="force", unit="N", description="along the way"),),
        outputs=(FmuVariable(name="a", unit="m/s2", description="acceleration"),),
        parameters=(
            FmuVariable(name="mass", unit="kg", start=2.0, min=1e-3, description="mass"),
            FmuVariable(name="most", unit="N", start=3.0, min=0.0, description="friction force"),
        ),
        rhs=ca.Function("rhs", point, [ca.vertcat(v, a), a]),
        jumps=Jumps(
            modes=(FmuVariable(name="mode", description="0 sticks; 1, -1 slides"),),
            first=ca.Function("first", point, [ca.sign(v), ca.SX(2, 1)]),
            indicators=ca.Function(
                "indicators", point, [ca.vertcat(first, ca.if_else(slides, 1, most + force))]
            ),
            jump=ca.Function(
                "jump",
                [*point, fired],
                [ca.vertcat(point.x[0], ca.if_else(slides, 0, v)), ca.if_else(slides, 0, begins)],
            ),
            names=("block forwards", "block backwards"),
        ),
        stop_time=2.0,
    )


def stopped_crank() -> FmuModel:
    """The slider-crank whose slider meets a stop: a limit of a dependent coordinate."""
    model = slider_crank()
    t, x, u = ca.SX.sym("t"), ca.SX.sym("x", 2), ca.SX.sym("u")
    z, p, fired = ca.SX.sym("z", 2), ca.SX.sym("p", 8), ca.SX.sym("fired")
    point, (place, e, hits) = [t, x, z, u, p], ca.vertsplit(p[5:])
    crank = p[0]
    rate = -crank * ca.sin(x[0]) - crank * ca.cos(x[0]) * ca.tan(z[0])
    turned = ca.if_else(rate * x[1] < 0, -e * x[1], x[1])
    return dataclasses.replace(
        model,
        name="stopped_crank",
        parameters=(
            *model.parameters,
            FmuVariable(name="place", unit="m", start=0.35, description="of the stop"),
            FmuVariable(name="e", start=0.7, min=0.0, max=1.0, description="restitution"),
        ),
        rhs=ca.Function("rhs", point, model.rhs(t, x, z, u, p[:5])),
        closure=ca.Function("closure", [x, z, p[:7]], model.closure(x, z, p[:5])),
        jumps=Jumps(
            modes=(FmuVariable(name="hits", description="number of impacts"),),
            first=ca.Function("first", point, [0, place - z[1]]),
            indicators=ca.Function("indicators", point, [z[1] - place]),
            jump=ca.Function("jump", [*point, fired], [ca.vertcat(x[0], turned), hits + 1]),
            names=("slider stop",),
        ),
    )


def fall(times, e=0.8, g=10.0, slow=1e-3):
    """Height of the ball, which falls from 1 m, and its energy; at rest once it is slow."""
    rows, begin, speed = [], -np.sqrt(2 / g), np.sqrt(2 * g)
    for t in times:
        while speed and t > begin + 2 * speed / g:
            begin, speed = begin + 2 * speed / g, e * speed if e * speed > slow else 0.0
        flight = t - begin if speed else 0.0
        rows.append([speed * flight - g / 2 * flight**2, speed**2 / 2])
    return np.array(rows)


def impact_times(count, e=0.8, g=10.0):
    """When the ball hits the ground."""
    flights = 2 * np.sqrt(2 / g) * e ** np.arange(count)
    return np.sqrt(2 / g) + np.concatenate(([0], np.cumsum(flights[1:])))


def logarithm() -> FmuModel:
    """A falling number whose indicator, its logarithm plus five, has no value below zero."""
    symbols, fired = point_of(1, 0, 1), ca.SX.sym("fired")
    functions = {
        "first": [ca.SX(0), ca.SX(-1)],
        "indicators": [ca.log(symbols.x) + 5],
        "jump": [ca.SX(1), 1 - symbols.p],
    }
    made = {
        name: ca.Function(name, [*symbols, fired] if name == "jump" else symbols, values)
        for name, values in functions.items()
    }
    return FmuModel(
        name="logarithm",
        states=(FmuState(name="x", start=1.0, output=True),),
        rhs=ca.Function("rhs", symbols, [ca.SX(-1), ca.SX(0, 1)]),
        jumps=Jumps(modes=(FmuVariable(name="x.mode"),), names=("x",), **made),
    )


def crank_reference(times, torque=0.1, **parameters):
    """The slider-crank without a closure to solve: the rod angle is an arc sine."""
    model = slider_crank()
    t, x = ca.SX.sym("t"), ca.SX.sym("x", 2)
    values = [parameters.get(v.name, v.start) for v in model.parameters]
    angle = ca.asin(values[0] / values[1] * ca.sin(x[0]))
    z = ca.vertcat(angle, values[0] * ca.cos(x[0]) + values[1] * ca.cos(angle))
    xdot, _ = model.rhs(t, x, z, torque, values)
    return integrate(ca.Function("f", [t, x], [xdot]), [0.3, 6.0], times, rtol=1e-12, atol=1e-12)


EVENTFUL = (ball, block, clapper, logarithm, stopped_crank)
MODELS = {make.__name__: make for make in (*EVENTFUL, pendulum, slider_crank)}
