"""Models whose structure the tests of descriptions know."""

import casadi as ca

from mbs.export.fmu.description import FmuModel, FmuState, FmuVariable, Jumps


def ball(jumps=True):
    """A ball that bounces; a mode counts the bounces and brakes it."""
    t, x, z, u = ca.SX.sym("t"), ca.SX.sym("x", 2), ca.SX.sym("z", 0), ca.SX.sym("u")
    p, fired = ca.SX.sym("p", 4), ca.SX.sym("fired", 1)
    e, g, drag, count = ca.vertsplit(p)
    point = [t, x, z, u, p]
    xdot = ca.vertcat(x[1], -g - drag * count * x[1] + 2 * u)
    return FmuModel(
        name="ball",
        states=(
            FmuState(name="h", unit="m", start=1.0, output=True),
            FmuState(name="v", unit="m/s", start=0.0),
        ),
        inputs=(FmuVariable(name="push", unit="m/s2"),),
        outputs=(
            FmuVariable(name="scaled", unit="m"),
            FmuVariable(name="weighted", unit="m"),
            FmuVariable(name="plain", unit="m/s2"),
        ),
        parameters=(
            FmuVariable(name="e", start=0.5, fixed=True),
            FmuVariable(name="g", unit="m/s2", start=9.81),
            FmuVariable(name="drag", unit="1/s", start=0.1),
        ),
        rhs=ca.Function("rhs", point, [xdot, ca.vertcat(count * x[0], e * x[0] + x[1], g)]),
        jumps=Jumps(
            modes=(FmuVariable(name="count"),),
            first=ca.Function("first", point, [ca.if_else(x[0] > 5, 1.0, 0.0), -x[0]]),
            indicators=ca.Function("indicators", point, [x[0]]),
            jump=ca.Function(
                "jump",
                [*point, fired],
                [ca.vertcat(x[0], x[1] - fired * (1 + e) * x[1]), count + fired],
            ),
            names=("floor",),
        )
        if jumps
        else None,
        stop_time=1.0,
    )


def two_cranks(coupled):
    """Two slider-cranks side by side; where coupled, the second hangs on the first slider."""
    x, z, p = ca.SX.sym("x", 2), ca.SX.sym("z", 4), ca.SX.sym("p", 2)
    rows = []
    for k in range(2):
        base = z[1] if coupled and k else 0
        rows.append(ca.cos(x[k]) + p[k] * ca.cos(z[2 * k]) - z[2 * k + 1] + base)
        rows.append(ca.sin(x[k]) - p[k] * ca.sin(z[2 * k]))
    r = ca.vertcat(*rows)
    step = z - ca.solve(ca.sparsify(ca.jacobian(r, z)), r)
    t, u = ca.SX.sym("t"), ca.SX.sym("u", 0)
    return FmuModel(
        name="cranks",
        states=(FmuState(name="a", unit="rad"), FmuState(name="b", unit="rad")),
        outputs=(FmuVariable(name="s1", unit="m"), FmuVariable(name="s2", unit="m")),
        parameters=(FmuVariable(name="l1", start=3.0), FmuVariable(name="l2", start=3.0)),
        dependents=tuple(
            FmuVariable(name=n, start=s) for n, s in zip("cdef", (0, 4, 0, 4), strict=True)
        ),
        rhs=ca.Function("rhs", [t, x, z, u, p], [ca.DM([1, 1]), ca.vertcat(z[1], z[3])]),
        closure=ca.Function("closure", [x, z, p], [step, ca.norm_inf(r)]),
    )
