"""Components of one's own, written as users write them: what is taken, and what is refused."""

import math

import casadi
import numpy as np
import pytest
from support.messages import refused

import mbs
from mbs.components import (
    Body,
    Custom,
    Cylindrical,
    DCMotor,
    MotionJoint,
    PointMass,
    Prismatic,
    Revolute,
    ShaftDamper,
    custom,
)
from mbs.components.motion_joint import translation
from mbs.errors import AssemblyError, DescriptionError, ModelError, Unclosable

INERTIA = 0.1  # of the bar about its joint [kg m^2]


def bar(*made, **values):
    """A bar on the joint j, without gravity, with components."""
    m = mbs.Mechanism("m", gravity=(0, 0, 0))
    m.values.update({name: mbs.Parameter(name, value) for name, value in values.items()})
    body = m.add(Body("bar", mass=1.0, inertia=(INERTIA, INERTIA, INERTIA)))
    m.connect(m.world, Revolute("j", axis="z", actuated=False), body)
    for make in made:
        m.add(make(body) if callable(make) else make)
    return m.assemble()


def on_joint(load, **declared):
    """A class on a coordinate, whose effort is what a function of self and at returns."""
    methods = {"loads": lambda self, at: {"joint": load(self, at)}}
    return type("Mine", (Custom,), {"joint": custom.coordinate(), **declared, **methods})


@pytest.mark.parametrize(
    ("load", "told"),
    [
        (lambda self, at: math.sin(at.joint.q), "write casadi.sin"),
        (lambda self, at: at.joint.q * math.nan, "a constant that is not a number"),
        (lambda self, at: 1 if at.joint.q > 0 else 2, "write casadi.if_else"),
        (lambda self, at: max(at.joint.q, 0), "casadi.fmax"),
        (lambda self, at: -self.k * at.joint.q, "from at, such as at.k, and not from self"),
        (lambda self, at: self.k, "from at, such as at.k, and not from self"),
        (
            lambda self, at: casadi.interpolant("table", "linear", [[0, 1]], [0, 1])(at.joint.q),
            "loads at joint calls another Function, such as an interpolant",
        ),
    ],
)
def test_what_is_no_expression_of_symbols(load, told):
    mine = on_joint(load, k=custom.parameter("N.m", 2.0))
    refused(AssemblyError, "c (Mine): loads", told, by=lambda: bar(mine("c", "j")))


def test_an_energy_that_is_a_vector():
    mine = type("Mine", (Custom,), {"p": custom.frame(), "energy": lambda self, at: at.p.p})
    told = "energy is an expression of the shape (3, 1)"
    refused(AssemblyError, "c (Mine)", told, by=lambda: bar(lambda body: mine("c", body)))


@pytest.mark.parametrize(
    ("low", "high", "good", "bad"),
    [
        (None, 10, 9, 11),
        (5, None, 6, 4),
        (None, -2, -3, -1),
        (2, 8, 3, 9),
        (None, 1.05, 1.03, 1.06),
        (-5, -1, -2, -0.5),
        (-5, -1, -2, -6),
    ],
)
@pytest.mark.parametrize("text", ["C", "2*C"])
def test_declared_bounds_hold_in_calls(low, high, good, bad, text):
    scale = 2 if text == "2*C" else 1
    mine = on_joint(lambda self, at: at.k, k=custom.parameter("N.m", min=low, max=high))
    system = bar(mine("c", "j", k=text), C=good / scale)
    if text == "C":
        assert system.bounds["C"] == (low, high)
    ddm = mbs.models.direct_dynamics(system)
    # two divisions in doubles
    assert float(ddm(0, 0, 0, good / scale)) == pytest.approx(good / INERTIA, rel=1e-14)
    refused(ModelError, "c: k is", f"{bad:g}", by=lambda: ddm(0, 0, 0, bad / scale))


def test_annotated_fields_keep_their_place_among_declarations():
    class Mine(Custom):
        joint = custom.coordinate()
        count: int = 2
        k = custom.parameter("N.m", 3.0)

        def loads(self, at):
            return {"joint": self.count * at.k}

    ddm = mbs.models.direct_dynamics(bar(Mine("c", "j", 5, 4.0)))
    assert float(ddm(0, 0, 0)) == pytest.approx(5 * 4.0 / INERTIA, rel=1e-14)  # rounding


def test_classes_that_are_not_made_as_declared():
    def slotted():
        return type("Mine", (Custom,), {"__slots__": (), "joint": custom.coordinate()})

    refused(DescriptionError, "Mine", "__slots__", by=slotted)
    own_init = on_joint(lambda self, at: 1, __init__=lambda self: Custom.__init__(self, "c"))
    refused(DescriptionError, "c: Mine.__init__", "'joint'", by=own_init)
    skips = on_joint(
        lambda self, at: at.k, k=custom.parameter(min=0), __post_init__=lambda self: None
    )
    refused(DescriptionError, "c: Mine.__post_init__", "'k'", by=lambda: bar(skips("c", "j", -5)))


def test_a_motor_with_a_further_state():
    class Warm(DCMotor):
        heat = custom.state("J")

        def rates(self, at):
            return {**super().rates(at), "heat": at.resistance * at.i**2}

    m = mbs.Mechanism("m")
    motor = Warm("motor", resistance=2.0, inductance=1e-3, constant=0.1, inertia=1e-3)
    m.connect(motor.flange, ShaftDamper("load", 0.01).flange)
    system = m.assemble()
    assert system.states == (("motor.i", "A"), ("motor.heat", "J"))
    result = mbs.simulate.run(system, 0.2, u={"motor": 5.0}, step=1e-4, quiet=True)
    # trapezoids of 1e-4 s, a twentieth of L / R
    assert result["motor.heat"][-1] == pytest.approx(
        np.trapezoid(2.0 * result["motor.i"] ** 2, result.time), rel=1e-3
    )


def test_wires_by_names_into_placed_mechanisms():
    """Each leg's gauge holds the other's actuator: two legs that start alike move as one alone."""

    class Actuator(Custom):
        joint = custom.coordinate()
        order = custom.input("rad")
        angle = custom.output("rad")

        def loads(self, at):
            return {"joint": -3.0 * at.order}

        def outputs(self, at):
            return {"angle": at.joint.q}

    def leg():
        m = mbs.Mechanism("leg", gravity=(0, 0, 0))
        body = m.add(Body("bar", mass=1.0, inertia=(INERTIA, INERTIA, INERTIA)))
        m.connect(m.world, Revolute("j", axis="z", actuated=False), body)
        m.add(Actuator("act", "j"))
        return m

    one, two = leg(), mbs.Mechanism("two", gravity=(0, 0, 0))
    one.connect_signal("act.angle", "act.order")
    for side in ("left", "right"):
        two.connect(two.world, two.add(leg(), side).base)
    refused(
        DescriptionError,
        "two: a wire leads to 'left.act.ordr'",
        "left.act.order",
        by=lambda: two.connect_signal("right.act.angle", "left.act.ordr"),
    )
    two.connect_signal("right.act.angle", "left.act.order")
    two.connect_signal("left.act.angle", "right.act.order")
    system = two.assemble()
    assert system.inputs == ()
    start = {"left.j": 0.3, "right.j": 0.3}
    result = mbs.simulate.run(system, 0.5, q0=start, tolerance=1e-10, quiet=True)
    alone = mbs.simulate.run(one.assemble(), 0.5, q0={"j": 0.3}, tolerance=1e-10, quiet=True)
    exact = 0.3 * np.cos(np.sqrt(3.0 / INERTIA) * result.time)
    for found in (result["left.j.q"], result["right.j.q"], alone["j.q"]):
        assert found == pytest.approx(exact, abs=1e-9)  # tolerance of 1e-10


class Lag(Custom):
    """A torque that follows an order, on a joint without a motor."""

    joint = custom.coordinate()
    tau = custom.state("N.m", start=0.5)
    order = custom.input("N.m")
    shown = custom.output("N.m")

    def rates(self, at):
        return {"tau": (at.order - at.tau) / 0.2}

    def loads(self, at):
        return {"joint": at.tau - 2.0 * at.joint.q}

    def outputs(self, at):
        return {"shown": at.tau - 2.0 * at.joint.q}


def test_small_motions_without_motors():
    """They ended in a RuntimeError of CasADi where inputs are those of components alone."""
    found = mbs.models.linearise(bar(Lag("lag", "j")), outputs=["lag.shown"]).at()
    slopes = {
        "A": [[0, 1, 0], [-2 / INERTIA, 0, 1 / INERTIA], [0, 0, -5]],
        "B": [[0], [0], [5]],
        "C": [[-2, 0, 1]],
    }
    for name, exact in slopes.items():
        assert np.abs(getattr(found, name) - exact).max() < 1e-13  # rounding
    assert found.u == (("lag.order", "N.m"),)


def test_rates_and_outputs_without_drives():
    devices = mbs.models.devices(bar(Lag("lag", "j")))
    tau, rate, shown = devices(0.3, 0.0, 0.5, 0.7)
    assert (float(tau), float(rate)) == pytest.approx((0.0, 1.0), abs=1e-15)  # rounding
    assert float(shown) == pytest.approx(0.5 - 2.0 * 0.3, abs=1e-15)


class TestRows:
    def test_that_contradict_each_other_are_open_in_metres(self):
        mine = type(
            "Mine",
            (Custom,),
            {
                "p": custom.frame(),
                "rows": lambda self, at: {"a": at.p.p[2] - 0.1, "b": at.p.p[2] - 0.2},
            },
        )
        m = mbs.Mechanism("m", gravity=(0, 0, 0))
        stone = m.add(PointMass("stone", mass=1.0))
        m.connect(m.world, Prismatic("z", axis="z", actuated=False), stone)
        m.add(mine("c", stone))
        refused(Unclosable, "c open by 0.0707 m and 0 in direction cosines", by=m.assemble)

    def test_that_leave_an_unknown_alone(self):
        mine = type(
            "Mine",
            (Custom,),
            {
                "p": custom.frame(),
                "s": custom.unknown(),
                "rows": lambda self, at: {"a": at.p.p[2] - 0.1},
            },
        )
        told = ("c (Mine): no row depends on the unknown 's'",)
        refused(AssemblyError, *told, by=lambda: bar(lambda body: mine("c", body)))


def test_an_output_that_is_named_as_a_coordinate_is():
    class Reads(Custom):
        joint = custom.coordinate()
        q = custom.output("m")

        def outputs(self, at):
            return {"q": at.joint.q}

    m = mbs.Mechanism("m", gravity=(0, 0, 0))
    body = m.add(Body("bar", mass=1.0, inertia=(INERTIA, INERTIA, INERTIA)))
    m.connect(m.world, Cylindrical("c", axis="z", actuated=False), body)
    m.add(Reads("c.s", "c.s"))
    refused(AssemblyError, "m: c.s.q is", "rename the component", by=m.assemble)


def test_the_coordinate_of_a_motion_is_independent():
    """It was a velocity of the frame, which stands still where the curve turns back."""

    class Track(MotionJoint):
        s = custom.unknown("rad")

        def motion(self, at):
            return translation(casadi.cos(at.s), 0.5 * casadi.sin(at.s), 0)

    m = mbs.Mechanism("m", gravity=(0, 0, 0))
    body = m.add(Body("bar", mass=1.0, inertia=(INERTIA, INERTIA, INERTIA)))
    m.connect(m.world, Track("track"), body)
    system = m.assemble()
    assert [system.velocity_coordinates[k].name for k in system.closure.independent] == ["track.s"]
    # at s = 0 with the rate v the speed is v / 2, and the tension v^2 has no part along the track
    q = [1.0, 0, 0, 1, 0, 0, 0, 0]
    assert float(mbs.models.direct_dynamics(system)(q, 2.0, 0.0)) == pytest.approx(0, abs=1e-12)
    assert float(mbs.models.energy(system)(q, 2.0)[0]) == pytest.approx(0.5, rel=1e-12)
