"""Two models that the tests of FMUs share."""

import casadi as ca

from mbs.export.fmu.description import FmuModel, State, Variable


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
            State(
                name="j1.q",
                unit="rad",
                derivative_unit="rad/s",
                start=1.0,
                description="angle",
                output=True,
            ),
            State(
                name="j1.v",
                unit="rad/s",
                derivative_unit="rad/s2",
                nominal=3.0,
                description="angular velocity",
            ),
        ),
        inputs=(Variable(name="tau", unit="N.m", description="torque on the joint"),),
        outputs=(
            Variable(name="tip.x", unit="m", description="where the mass is"),
            Variable(name="tip.y", unit="m", description="how high it is"),
        ),
        parameters=(
            Variable(name="mass", unit="kg", start=1.0, min=1e-6, max=1e6, description="mass"),
            Variable(name="length", unit="m", start=0.5, min=1e-6, description="length"),
            Variable(name="damping", unit="N.m.s/rad", start=0.05, min=0.0, description="damping"),
            Variable(name="g", unit="m/s2", start=9.81, description="gravity"),
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
            State(
                name="crank.q",
                description="angle of the crank",
                unit="rad",
                derivative_unit="rad/s",
                start=0.3,
                output=True,
            ),
            State(
                name="crank.v",
                description="angular velocity of the crank",
                unit="rad/s",
                derivative_unit="rad/s2",
                start=6.0,
                nominal=5.0,
            ),
        ),
        inputs=(Variable(name="torque", description="torque on the crank", unit="N.m", start=0.1),),
        outputs=(
            Variable(name="slider.v", description="velocity of the slider", unit="m/s"),
            Variable(name="force", description="force on the slider", unit="N"),
        ),
        parameters=(
            Variable(
                name="crank.length",
                description="length of the crank",
                unit="m",
                start=0.1,
                min=1e-6,
            ),
            Variable(
                name="rod.length", description="length of the rod", unit="m", start=0.3, min=1e-6
            ),
            Variable(
                name="inertia",
                description="inertia of the crank",
                unit="kg.m2",
                start=0.01,
                min=1e-9,
            ),
            Variable(name="mass", description="mass of the slider", unit="kg", start=0.5, min=0.0),
            Variable(
                name="damping",
                description="viscous friction of the crank",
                unit="N.m.s/rad",
                start=0.001,
                min=0.0,
            ),
        ),
        dependents=(
            Variable(name="rod.angle", description="angle of the rod", unit="rad", start=0.0),
            Variable(name="slider.s", description="place of the slider", unit="m", start=0.4),
        ),
        rhs=ca.Function(
            "crank_rhs",
            [t, x, z, u, p],
            [ca.vertcat(v, a), ca.vertcat(s1 * v, mass * (s1 * a + s2 * v**2))],
        ),
        closure=closure,
        stop_time=2.0,
    )
