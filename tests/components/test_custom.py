"""Components by their equations: what is declared, what is refused and how, where numbers go."""

import copy
import pickle
from dataclasses import dataclass

import casadi
import numpy as np
import pytest
from support.messages import refused

import mbs
from mbs.components import (
    AbsoluteSensor,
    Body,
    Box,
    Component,
    Custom,
    Damper,
    DCMotor,
    Gain,
    Integrator,
    JointEffort,
    JointSensor,
    Planar,
    Prismatic,
    Revolute,
    RollingDisc,
    Spherical,
    Spring,
    WrenchSensor,
    custom,
)
from mbs.components.custom import At, Row, Signal
from mbs.errors import AssemblyError, DescriptionError, ModelError


def pendulum(*made, gravity=(0, -9.81, 0), actuated=True, **values):
    """A bar on a revolute joint, with what is made of its right end."""
    m = mbs.Mechanism("m", gravity=gravity, parameters=values)
    bar = m.add(Box("bar", length=1.0, mass=2.0))
    m.connect(m.world, Revolute("j1", axis="z", actuated=actuated), bar.left)
    for make in made:
        m.add(make(bar.right))
    return m


def four_bar(stiffness=0.0):
    """Four bars whose loop is cut at j3, where nothing is on it; with a spring on it."""
    m = mbs.Mechanism("four_bar", gravity=(0, -9.81, 0))
    a, b, c = (m.add(Box(n, length=L, mass=1.0)) for n, L in (("a", 0.3), ("b", 0.8), ("c", 0.7)))
    m.connect(m.world, Revolute("j1", axis="z"), a.left)
    m.connect(a.right, Revolute("j2", axis="z", actuated=False), b.left)
    m.connect(b.right, Revolute("j3", axis="z", actuated=False, stiffness=stiffness), c.right)
    m.connect(m.world.at(0.9, 0, 0), Revolute("j4", axis="z", actuated=False), c.left)
    return m


def of(**methods):
    """A class on one point, with these methods; `ports` and others are declared beside them."""
    return type("Mine", (Custom,), {"point": custom.frame(), **methods})


def refused_at_assembly(*parts, **methods):
    m = pendulum(lambda tip: of(**methods)("c", tip))
    refused(AssemblyError, "c (Mine)", *parts, by=m.assemble)


def up(force=1.0):
    return {"point": custom.force([0, force, 0])}


# Components that are right.


class Drag(Custom):
    """Air drag on a point: force -c |v| v."""

    point = custom.frame()
    c = custom.parameter("kg/m", min=0)

    def loads(self, at):
        v = at.point.v
        return {"point": custom.force(-at.c * custom.regular_length(v) * v)}

    def dissipation(self, at):
        v = at.point.v
        return at.c * custom.regular_length(v) * casadi.dot(v, v)


class Actuator(Custom):
    """A force with a lag, upwards on a point."""

    point = custom.frame()
    time = custom.parameter("s", 0.1, positive=True)
    force = custom.state("N", start=2.0, nominal=10.0)
    order = custom.input("N", default=1.5)
    shown = custom.output("N")

    def rates(self, at):
        return {"force": (at.order - at.force) / at.time}

    def loads(self, at):
        return {"point": custom.force([0, at.force, 0])}

    def outputs(self, at):
        return {"shown": at.force}


class HookeanLine(Custom):
    """A spring by its energy alone."""

    a = custom.frame()
    b = custom.frame()
    k = custom.parameter("N/m")
    rest = custom.parameter("m", 0.0)

    def energy(self, at):
        return 0.5 * at.k * (at.a.to(at.b).length - at.rest) ** 2


class TestDeclarations:
    def test_what_is_declared(self):
        assert list(Actuator.declared) == ["point", "time", "force", "order", "shown"]
        part = Actuator("a", Box("b", length=1.0, mass=1.0))
        assert str(part.time) == "0.1"
        assert part.force == 2.0
        assert (part.state_names, part.input_names, part.output_names) == (
            ("force",),
            ("order",),
            ("shown",),
        )
        assert part.order == Signal(part, "order", "input")
        assert str(part.shown) == "a.shown"
        assert Actuator("a", Box("b", length=1.0, mass=1.0), force=7).force == 7.0

    def test_declarations_are_inherited(self):
        class Slow(Actuator):
            """With a time constant of its own, and one more output."""

            time = custom.parameter("s", 3.0)
            rate = custom.output("N/s")

            def outputs(self, at):
                return {**Actuator.outputs(self, at), "rate": self.rates(at)["force"]}

        assert list(Slow.declared) == [*Actuator.declared, "rate"]
        m = pendulum(lambda tip: Slow("slow", tip))
        found = mbs.simulate.run(m.assemble(), 0.1, u={"slow": 0.0}, tolerance=1e-10, quiet=True)
        assert np.abs(found["slow.shown"] - 2 * np.exp(-found.time / 3)).max() < 1e-9
        assert np.abs(found["slow.rate"] + found["slow.shown"] / 3).max() < 1e-12

    def test_a_dataclass_of_the_package_can_be_derived_from(self):
        @dataclass(frozen=True, slots=True)
        class Twice(Damper):
            """Its damping counts twice."""

            def tension(self, length, rate, symbols):
                return 2 * Damper.tension(self, length, rate, symbols)

        one = pendulum(lambda tip: Twice("d", Box("bar", length=1.0, mass=2.0).frame, tip, 3.0))
        m = pendulum()
        m.add(Twice("d", m.world.at(0.5, 1, 0), m.components["bar"].right, 3.0))
        n = pendulum()
        n.add(Damper("d", n.world.at(0.5, 1, 0), n.components["bar"].right, 6.0))
        idm = (mbs.models.inverse_dynamics(x.assemble())(0.3, 2.0, 1.0) for x in (m, n))
        assert float(next(idm)) == float(next(idm))
        assert one.components["d"].damping == m.components["d"].damping

    def test_parameters_that_may_stay_away(self):
        class Maybe(Custom):
            """A force, and damping if it is given."""

            point = custom.frame()
            f = custom.parameter("N")
            c = custom.parameter("N.s/m", None, min=0)

            def loads(self, at):
                drag = 0 if at.c is None else at.c * at.point.v
                return {"point": custom.force(casadi.vertcat(0, at.f, 0) - drag)}

        def held(**given):
            m = pendulum(lambda tip: Maybe("x", tip, f=5.0, **given), gravity=(0, 0, 0))
            return float(mbs.models.inverse_dynamics(m.assemble())(0.0, 2.0, 0.0))

        assert held() == pytest.approx(-5, abs=1e-14)
        assert held(c=3.0) == pytest.approx(-5 + 3 * 2, abs=1e-14)
        refused(DescriptionError, "x", "c is -1 N.s/m", by=lambda: held(c=-1.0))

    @pytest.mark.parametrize(
        ("make", "parts"),
        [
            (lambda: custom.parameter("bananas"), ["parameter", "'bananas'", "SI"]),
            (lambda: custom.state("m/s/s"), ["state", "'m/s/s'"]),
            (lambda: custom.unknown("kg"), ["unknown", "'kg'", "'m' or 'rad'"]),
            (lambda: of(name=custom.parameter()), ["Mine", "named 'name'"]),
            (lambda: of(loads=custom.input()), ["Mine", "input cannot be named 'loads'"]),
            (lambda: of(lam=custom.output()), ["Mine", "'lam'"]),
            (lambda: of(_x=custom.state()), ["Mine", "'_x'"]),
            (
                lambda: of(a=custom.parameter("1", 2.0), b=custom.parameter()),
                ["Mine", "declare what has a default after what has none"],
            ),
        ],
    )
    def test_declarations_that_are_refused(self, make, parts):
        refused(DescriptionError, *parts, by=make)

    @pytest.mark.parametrize(
        ("make", "parts"),
        [
            (lambda body: Drag("d", 3.0, c=1.0), ["d", "point is 3.0", "body"]),
            (lambda body: Drag("d", body, c=-0.1), ["d", "c is -0.1 kg/m"]),
            (lambda body: Drag("d", body, c="2 +"), ["d", "c", "2 +"]),
            (lambda body: Drag("d d", body, c=1.0), ["Drag 'd d'", "name"]),
            (lambda body: Actuator("a", body, time=0.0), ["a", "time is 0 s"]),
            (lambda body: Actuator("a", body, force="2"), ["a", "force"]),
            (lambda body: Actuator("a", body, force=float("nan")), ["a", "force"]),
            (lambda body: Along("x", 3.0), ["x", "on is 3.0", "'j1'"]),
            (lambda body: Along("x", ""), ["x", "on is ''"]),
        ],
    )
    def test_values_that_are_refused(self, make, parts):
        body = Box("b", length=1.0, mass=1.0)
        refused(DescriptionError, *parts, by=lambda: make(body))

    def test_a_joint_stands_for_its_coordinate(self):
        assert Along("x", Revolute("j1")).on == "j1"

    def test_bounds_hold_for_symbols(self):
        m = pendulum(lambda tip: Drag("d", tip, c="C"), C=-1.0)
        refused(DescriptionError, "d", "c is -1 kg/m", by=m.assemble)


class Along(Custom):
    """A force along a coordinate, quadratic in its velocity."""

    on = custom.coordinate()
    c = custom.parameter("1", 1.0)

    def loads(self, at):
        return {"on": -at.c * at.on.v * casadi.fabs(at.on.v)}

    def dissipation(self, at):
        return at.c * casadi.fabs(at.on.v) ** 3


class TestWhatIsAdded:
    def test_what_says_nothing_is_refused(self):
        class Rope(Custom):
            """Says nothing."""

            a = custom.frame()

        class Plain(Component):
            """Of a kind that no equation knows."""

        m = pendulum()
        refused(
            DescriptionError,
            "Rope 'rope' says nothing",
            "loads, energy, rates, rows",
            by=lambda: m.add(Rope("rope", m.world)),
        )
        refused(
            DescriptionError,
            "Plain 'plain' says nothing",
            "derive it from Custom",
            by=lambda: m.add(Plain("plain")),
        )
        assert "rope" not in m.components

    def test_what_acts_on_nothing_that_moves_is_refused(self):
        m = pendulum()
        m.add(Drag("d", m.world.at(1), c=1.0))
        refused(AssemblyError, "d:", "does not move", by=m.assemble)

    def test_a_point_of_a_body_that_is_not_there(self):
        m = pendulum()
        m.add(Drag("d", Box("other", length=1.0, mass=1.0), c=1.0))
        refused(AssemblyError, "d", "'other'", by=m.assemble)

    def test_a_coordinate_that_is_locked(self):
        m = pendulum(lambda tip: Along("x", "j1"))
        refused(DescriptionError, "m: x knows the coordinate j1", by=lambda: m.lock({"j1": 0.2}))

    def test_a_coordinate_that_is_not_there(self):
        m = pendulum(lambda tip: Along("x", "j2"))
        refused(AssemblyError, "x: there is no coordinate 'j2'", "j1", by=m.assemble)


# Every sentence of the questions at assembly.


class TestLoads:
    def test_errors_in_methods_are_told_by_their_name(self):
        def loads(self, at):
            return {"point": custom.force(1 / 0)}

        refused_at_assembly("loads raises ZeroDivisionError: division by zero", loads=loads)

    def test_unknown_attributes(self):
        m = pendulum(lambda tip: of(loads=lambda self, at: up(at.strength))("c", tip))
        refused(DescriptionError, "c: there is no at.strength", "point", by=m.assemble)

    def test_nothing_and_no_dict(self):
        refused_at_assembly(
            "loads returns nothing; return a dict by name", loads=lambda self, at: None
        )
        refused_at_assembly(
            "loads returns a FrameLoad; return a dict",
            loads=lambda self, at: custom.force([0, 0, 1]),
        )

    def test_ports(self):
        refused_at_assembly(
            "loads names 'pont', which is no port",
            "point",
            loads=lambda self, at: {"pont": custom.force([0, 1, 0])},
        )

    def test_kinds_and_shapes(self):
        refused_at_assembly(
            "loads gives an expression at the frame point",
            "custom.force(...)",
            loads=lambda self, at: {"point": at.point.v},
        )
        refused_at_assembly(
            "the force at point has the shape (2, 1); give (3, 1)",
            loads=lambda self, at: {"point": custom.force([0, 1])},
        )
        refused_at_assembly(
            "the moment at point has the shape (1, 3)",
            loads=lambda self, at: {"point": custom.torque(at.point.w.T)},
        )

    def test_efforts_are_one_number(self):
        class Wide(Custom):
            """Gives three efforts for one coordinate."""

            on = custom.coordinate()

            def loads(self, at):
                return {"on": casadi.vertcat(1, 2, at.on.v)}

        m = pendulum(lambda tip: Wide("w", "j1"))
        refused(
            AssemblyError, "w (Wide): loads at on", "of the shape (3, 1); give one", by=m.assemble
        )

    def test_symbols_of_nobody(self):
        stray = casadi.SX.sym("stray")
        refused_at_assembly(
            "loads at point holds the symbol 'stray'",
            "declare it",
            loads=lambda self, at: up(stray),
        )
        refused_at_assembly(
            "energy holds the symbol 'stray'", energy=lambda self, at: stray * at.point.p[0]
        )


class TestStatesAndOutputs:
    def test_rates(self):
        refused_at_assembly("rates returns nothing", x=custom.state(), rates=lambda self, at: None)
        refused_at_assembly(
            "rates gives nothing for 'y'; return one value for each of x, y",
            x=custom.state(),
            y=custom.state(),
            rates=lambda self, at: {"x": at.y},
        )
        refused_at_assembly(
            "rates gives 'z', which is not declared",
            x=custom.state(),
            rates=lambda self, at: {"x": at.x, "z": 1},
        )
        refused_at_assembly(
            "rates of x is an expression of the shape (3, 1)",
            x=custom.state(),
            rates=lambda self, at: {"x": at.point.v},
        )

    def test_a_state_without_a_rate(self):
        refused_at_assembly(
            "rates gives nothing for 'x'",
            x=custom.state(),
            loads=lambda self, at: up(at.x),
        )

    def test_outputs(self):
        refused_at_assembly(
            "outputs gives nothing for 'y'", y=custom.output(), outputs=lambda self, at: {}
        )
        refused_at_assembly(
            "outputs gives 'z', which is not declared",
            y=custom.output(),
            outputs=lambda self, at: {"y": 1, "z": 2},
        )
        refused_at_assembly(
            "outputs of y is nothing", y=custom.output(), outputs=lambda self, at: {"y": None}
        )

    def test_an_output_without_a_value(self):
        refused_at_assembly(
            "outputs gives nothing for 'y'", y=custom.output(), loads=lambda self, at: up()
        )


class TestRows:
    def test_no_row(self):
        refused_at_assembly("rows returns no row", rows=lambda self, at: {})

    def test_units(self):
        refused_at_assembly(
            "the row 'a' has the unit 'kg'; use 'm' or '1'",
            rows=lambda self, at: {"a": Row(at.point.p[0], "kg")},
        )

    def test_shape(self):
        refused_at_assembly("row 'a'", "(3, 1)", rows=lambda self, at: {"a": at.point.p})

    def test_rows_of_velocities(self):
        refused_at_assembly(
            "the row 'a' depends on velocities",
            "use velocity_rows",
            rows=lambda self, at: {"a": at.point.v[0]},
        )

    def test_rows_of_states_and_inputs(self):
        refused_at_assembly(
            "the row 'a' depends on states or inputs",
            order=custom.input("m"),
            rows=lambda self, at: {"a": at.point.p[0] - at.order},
        )

    def test_rows_of_what_wires_bring(self):
        """The row would hold, but with other forces than those of its component."""
        mine = of(
            order=custom.input("rad"),
            rows=lambda self, at: {"a": Row(at.point.p[0] - at.order, "1")},
        )
        m = pendulum(lambda tip: mine("c", tip))
        m.add(JointSensor("enc", "j1"))
        m.connect_signal("enc.q", m.components["c"].order)
        refused(AssemblyError, "the row 'a' depends on states or inputs", by=m.assemble)

    @pytest.mark.parametrize("extra", [lambda v: v**2, lambda v: v + 1, lambda v: casadi.sin(v)])
    def test_velocity_rows_are_linear(self, extra):
        refused_at_assembly(
            "'a' of velocity_rows is not linear in velocities alone",
            velocity_rows=lambda self, at: {"a": extra(at.point.v[0])},
        )

    def test_unknowns_need_rows(self):
        refused_at_assembly(
            "the number of unknowns is 2 and that of rows 1",
            s=custom.unknown("m"),
            t=custom.unknown("m"),
            rows=lambda self, at: {"a": at.point.p[0] - at.s - at.t},
        )


class TestPowers:
    def test_energy_of_velocities(self):
        refused_at_assembly(
            "energy depends on velocities", energy=lambda self, at: at.point.v[0] ** 2
        )

    def test_heat_below_zero(self):
        refused_at_assembly(
            "dissipation is -",
            "never negative",
            loads=lambda self, at: {"point": custom.force(2 * at.point.v)},
            dissipation=lambda self, at: -2 * casadi.sumsqr(at.point.v),
        )

    def test_loads_against_heat(self):
        refused_at_assembly(
            "its loads have the power",
            "make them agree",
            loads=lambda self, at: {"point": custom.force(-2 * at.point.v)},
            dissipation=lambda self, at: casadi.sumsqr(at.point.v),
        )

    def test_loads_against_energy(self):
        def energy(self, at):
            return 3 * at.point.p[1]

        refused_at_assembly(
            "its loads have the power",
            "leave loads out",
            loads=lambda self, at: up(3.0),
            energy=energy,
        )
        good = pendulum(lambda tip: of(loads=lambda s, at: up(-3.0), energy=energy)("c", tip))
        assert good.assemble().nq == 1

    def test_energy_and_heat_together(self):
        methods = {
            "loads": lambda self, at: {
                "point": custom.force(casadi.vertcat(0, -3, 0) - 2 * at.point.v)
            },
            "energy": lambda self, at: 3 * at.point.p[1],
        }
        good = methods | {"dissipation": lambda self, at: 2 * casadi.sumsqr(at.point.v)}
        assert pendulum(lambda tip: of(**good)("c", tip)).assemble().nq == 1
        # damping beside the energy without a word about heat is allowed, a spring is not
        assert pendulum(lambda tip: of(**methods)("c", tip)).assemble().nq == 1
        bad = methods | {"dissipation": lambda self, at: 3 * casadi.sumsqr(at.point.v)}
        refused_at_assembly("make them agree", **bad)

    def test_efforts_on_coordinates_and_shafts(self):
        class Bad(Along):
            """With half the heat."""

            def dissipation(self, at):
                return 0.5 * Along.dissipation(self, at)

        assert pendulum(lambda tip: Along("x", "j1")).assemble().nq == 1
        refused(AssemblyError, "x (Bad)", "power", by=pendulum(lambda tip: Bad("x", "j1")).assemble)


class TestWires:
    def test_what_is_no_signal(self):
        m = pendulum()
        gain = m.add(Gain("k", 2.0))
        refused(DescriptionError, "m:", "no output", by=lambda: m.connect_signal(gain.u, gain.u))
        refused(DescriptionError, "m:", "no output", by=lambda: m.connect_signal(3.0, gain.u))
        refused(DescriptionError, "m:", "no input", by=lambda: m.connect_signal(gain.y, gain.y))
        refused(DescriptionError, "m:", "no input", by=lambda: m.connect_signal(gain.y, "k.y"))
        assert m.wires == []

    def test_what_is_not_there(self):
        m = pendulum()
        gain = m.add(Gain("k", 2.0))
        m.connect_signal("enc.q", gain.u)
        refused(AssemblyError, "k.u is wired to 'enc.q'", "no signal", by=m.assemble)

    def test_a_component_that_was_taken_away(self):
        m = pendulum()
        m.add(JointSensor("enc", "j1"))
        m.connect_signal("enc.q", Gain("k", 2.0).u)
        del m.components["k"]
        refused(AssemblyError, "k.u, whose component is not in the mechanism", by=m.assemble)

    def test_two_sources(self):
        m = pendulum()
        gain, other = Gain("k", 2.0), Gain("other", 1.0)
        m.add(JointSensor("enc", "j1"))
        m.connect_signal("enc.q", gain.u)
        m.connect_signal(other.y, gain.u)
        refused(AssemblyError, "k.u is wired to enc.q and to other.y", "one source", by=m.assemble)

    def test_components_are_added(self):
        m = pendulum()
        gain, other = Gain("k", 2.0), Gain("other", 1.0)
        m.connect_signal(other.y, gain.u)
        assert m.components["k"] is gain
        assert m.components["other"] is other
        refused(
            DescriptionError,
            "two components are named 'k'",
            by=lambda: m.connect_signal(Gain("k", 2.0).y, other.u),
        )

    def test_rings(self):
        m = pendulum()
        a, b, c = (m.add(Gain(name, 2.0)) for name in "abc")
        for one, two in ((a, b), (b, c), (c, a)):
            m.connect_signal(one.y, two.u)
        refused(AssemblyError, "ring", "a.y", "b.y", "c.y", "states", by=m.assemble)
        # a state in the ring breaks it
        m = pendulum()
        a, b = m.add(Gain("a", -2.0)), m.add(Integrator("b", x=1.0))
        m.connect_signal(a.y, b.u)
        m.connect_signal(b.y, a.u)
        result = mbs.simulate.run(m.assemble(), 0.5, tolerance=1e-10, quiet=True)
        assert np.abs(result["b.y"] - np.exp(-2 * result.time)).max() < 1e-9

    def test_a_signal_beside_a_ring_is_not_part_of_it(self):
        # both outputs come from one component, but only one of them follows from its input
        class Two(Custom):
            """Passes its input on, and shows a constant."""

            u = custom.input()
            same = custom.output()
            one = custom.output()

            def outputs(self, at):
                return {"same": at.u, "one": 4.0}

        m = pendulum()
        two, gain = m.add(Two("two")), m.add(Gain("k", 3.0))
        m.connect_signal(two.one, gain.u)
        m.connect_signal(gain.y, two.u)
        result = mbs.simulate.run(m.assemble(), 0.01, quiet=True)
        assert result["two.same"][-1] == 12.0

    @pytest.mark.parametrize("reading", ["enc.a", "tip.a.x"])
    def test_accelerations_that_change_themselves(self, reading):
        class Push(Custom):
            """A torque at a joint by an input."""

            at_joint = custom.coordinate()
            u = custom.input()

            def loads(self, at):
                return {"at_joint": at.u}

        m = pendulum()
        m.add(JointSensor("enc", "j1"))
        m.add(AbsoluteSensor("tip", m.components["bar"].right))
        gain, push = m.add(Gain("k", 2.0)), m.add(Push("push", "j1"))
        m.connect_signal(reading, gain.u)
        m.connect_signal(gain.y, push.u)
        refused(AssemblyError, "k.y", "push.u", "accelerations or forces", by=m.assemble)

    def test_efforts_of_rows(self):
        m = mbs.Mechanism("m", gravity=(0, 0, -9.81))
        w = m.add(Body("w", mass=1.0))
        m.connect(m.world, Prismatic("x", axis="x"), n := m.add(Body("n", mass=1.0)))
        m.connect(n, Prismatic("z", axis="z", actuated=False), w)
        rail, gain = m.add(Rail("rail", w)), m.add(Gain("k", 1.0))
        m.connect_signal(rail.push, gain.u)
        refused(AssemblyError, "rail.push", "forces that the motion itself", by=m.assemble)

    def test_a_sensor_on_a_joint_that_would_be_cut(self):
        """A torque by the angle of a joint of the loop is that of a spring on it."""
        systems = []
        for wired in (False, True):
            m = four_bar(0.0 if wired else 3.0)
            if wired:
                m.add(JointSensor("enc", "j3"))
                gain = m.add(Gain("k", -3.0))
                m.connect_signal("enc.q", gain.u)
                m.connect_signal(gain.y, m.add(JointEffort("effort", "j3")).tau)
            guess = {"j1": 1.0, "j2": -0.5}
            if systems:  # the spring at rest chose the configuration
                names = (c.name for c in systems[0].coordinates)
                guess = dict(zip(names, systems[0].configuration, strict=True))
            systems.append(m.assemble(guess=guess))
        given, ours = (
            mbs.simulate.run(system, 1.0, v0={"j1": 2.0}, tolerance=1e-10, quiet=True)
            for system in systems
        )
        assert np.abs(given["j1.q"] - ours["j1.q"]).max() < 1e-9  # ten tolerances

    def test_a_sensor_on_a_joint_that_is_cut(self):
        m = four_bar()
        m.add(JointSensor("enc", "j3"))
        m.connect_signal("enc.q", m.add(Gain("k", -3.0)).u)
        m.cut(m.components["j3"])
        refused(AssemblyError, "enc.q, whose joint 'j3' is cut", by=m.assemble)

    def test_sensors_feed_inputs(self):
        m = pendulum()
        m.add(JointSensor("enc", "j1"))
        m.add(AbsoluteSensor("tip", m.components["bar"].right))
        for name, source in (("q", "enc.q"), ("v", "enc.v"), ("x", "tip.p.x"), ("vy", "tip.v.y")):
            m.connect_signal(source, m.add(Gain(name, 2.0)).u)
        result = mbs.simulate.run(m.assemble(), 0.5, q0={"j1": 0.4}, quiet=True)
        assert np.abs(result["q.y"] - 2 * result["j1.q"]).max() < 1e-12
        assert np.abs(result["v.y"] - 2 * result["j1.v"]).max() < 1e-12
        assert np.abs(result["x.y"] - 2 * np.cos(result["j1.q"])).max() < 1e-12
        assert np.abs(result["vy.y"] - 2 * np.cos(result["j1.q"]) * result["j1.v"]).max() < 1e-12


class Follower(Custom):
    """A torsion spring whose rest angle is an input, and a torque that is another one."""

    joint = custom.coordinate()
    k = custom.parameter("N.m/rad", min=0)
    rest = custom.input("rad")

    def energy(self, at):
        return at.k / 2 * (at.joint.q - at.rest) ** 2


class Pushed(Follower):
    """The same with its loads written out, and a torque beside them."""

    def loads(self, at):
        return {"joint": -at.k * (at.joint.q - at.rest) + at.rest}


class TestEnergiesOfInputs:
    """Inputs are constants in an energy, whatever feeds them: the loads are its partial slopes."""

    @pytest.mark.parametrize("source", ["enc.q", "tip.R.xy", None])
    @pytest.mark.parametrize(("kind", "extra"), [(Follower, 0.0), (Pushed, 1.0)])
    def test_loads(self, source, kind, extra):
        m = mbs.Mechanism("m", gravity=(0, 0, 0))
        for name in ("a", "b"):
            body = m.add(Body(name, mass=1.0, inertia=(0.1, 0.1, 0.1)))
            m.connect(m.world, Revolute(f"j{name}", axis="z"), body)
        m.add(JointSensor("enc", "ja"))
        m.add(AbsoluteSensor("tip", m.components["a"]))
        spring = m.add(kind("c", "jb", k=2.0))
        if source:
            m.connect_signal(source, spring.rest)
        system = m.assemble()
        rest = {"enc.q": 0.3, "tip.R.xy": -np.sin(0.3), None: 0.7}[source]
        values = {"q": [0.3, 0.1], "v": [0.2, 0.0], "a": [0.0, 0.0], "z": [], "u": [0.7]}
        model = mbs.models.inverse_dynamics(system)
        tau = np.array(model(*(values[name] for name in model.name_in()))).ravel()
        assert tau == pytest.approx([0.0, -2.0 * (rest - 0.1) - extra * rest], abs=1e-14)
        energy = mbs.models.energy(system)
        found = energy.call({k: values[k] for k in energy.name_in()})
        assert float(found["U"]) == pytest.approx((rest - 0.1) ** 2, abs=1e-14)


class Rail(Custom):
    """A point stays on the line z = x / 2."""

    point = custom.frame()
    push = custom.output("N")

    def rows(self, at):
        return {"line": at.point.p[2] - at.point.p[0] / 2}

    def outputs(self, at):
        return {"push": at.lam["line"]}


class Edge(Custom):
    """A point slides along the x axis of its frame alone."""

    point = custom.frame()
    side = custom.output("N")

    def velocity_rows(self, at):
        return {"side": casadi.dot(at.point.R[:, 1], at.point.v)}

    def outputs(self, at):
        return {"side": at.lam["side"]}


class Rolls(Custom):
    """A thin disc about its y axis that rolls on the plane z = 0, written out."""

    disc = custom.frame()
    r = custom.parameter("m", positive=True)

    def _arm(self, at):
        """From the centre to the lowest point of the rim, and the sine of the tilt."""
        e, n = at.disc.R[:, 1], casadi.SX([0, 0, 1])
        s = casadi.norm_2(casadi.cross(n, e))
        return -at.r * (n - e[2] * e) / s, s

    def rows(self, at):
        return {"height": at.disc.p[2] - at.r * self._arm(at)[1]}

    def velocity_rows(self, at):
        arm, _ = self._arm(at)
        v = at.disc.v + casadi.cross(at.disc.w, arm)
        return {"x": v[0], "y": v[1]}


class TestRowsInMotion:
    def test_knife_edge_on_a_slope(self):
        # Neimark and Fufaev: x = g sin(slope) sin^2(w t) / (2 w^2)
        m = mbs.Mechanism("sleigh", gravity=(4.0, 0, 0))
        sleigh = m.add(Body("sleigh", mass=3.0, inertia=(0.1, 0.1, 0.2)))
        m.connect(m.world, Planar("p", axis="z", actuated=False), sleigh)
        m.add(Edge("edge", sleigh))
        system = m.assemble()
        assert system.closure.mobility == 2
        result = mbs.simulate.run(system, 2.0, v0={"p.phi": 1.5}, tolerance=1e-11, quiet=True)
        w, t = 1.5, result.time
        assert np.abs(result["p.phi.q"] - w * t).max() < 1e-9
        assert np.abs(result["p.s_x.q"] - 4 / (2 * w**2) * np.sin(w * t) ** 2).max() < 1e-8
        y = 4 / (2 * w**2) * (w * t - 0.5 * np.sin(2 * w * t))
        assert np.abs(result["p.s_y.q"] - y).max() < 1e-8
        # across the edge: mass (speed w + slope sin(w t)), with the speed g sin(w t) / w
        side = 3 * (4 * np.sin(w * t) + 4 * np.sin(w * t))
        assert np.abs(result["edge.side"] - side).max() < 1e-7 * 24

    @pytest.mark.parametrize("count", [1, 2])
    def test_rows_that_always_hold(self, count):
        class Flat(Custom):
            """A point of a planar mechanism is in its plane."""

            point = custom.frame()
            push = custom.output("N")

            def rows(self, at):
                return {str(k): at.point.p[2] for k in range(count)}

            def outputs(self, at):
                return {"push": at.lam["0"]}

        free, held = pendulum().assemble(), pendulum(lambda tip: Flat("flat", tip)).assemble()
        assert held.closure.mobility == 1
        one, two = (mbs.simulate.run(s, 0.3, tolerance=1e-10, quiet=True) for s in (free, held))
        assert np.abs(one["j1.q"] - two["j1.q"]).max() < 1e-12
        assert np.all(two["flat.push"] == 0)
        assert mbs.models.dae(held, "index1").z.numel() == 1

    @pytest.mark.parametrize("rail_first", [True, False])
    def test_rows_of_positions_come_before_rows_of_velocities(self, rail_first):
        """Names, kinds and rows of `system.loops` and residuals of the closure in one order."""
        m = mbs.Mechanism("sleigh", gravity=(4.0, 0, 0))
        sleigh = m.add(Body("sleigh", mass=3.0, inertia=(0.1, 0.1, 0.2)))
        m.connect(m.world, mbs.components.Free("p", actuated=False), sleigh)
        parts = [Rail("rail", sleigh.at(0.1)), Edge("edge", sleigh)]
        for part in parts if rail_first else reversed(parts):
            m.add(part)
        system = m.assemble()
        assert [(loop.name, loop.closing, loop.rows) for loop in system.loops] == [
            ("rail", "rail", ("line",)),
            ("edge", "edge", ("side",)),
        ]
        q = [0.3, 0.2, 0.7, 1, 0, 0, 0]
        assert float(mbs.loops.closure_residual(system)(q)[0]) == pytest.approx(
            0.7 - 0.4 / 2, abs=1e-14
        )
        report = system.report()
        assert report.index("Rail rail binds p: 1 of 1") < report.index("Edge edge binds p: 1 of 1")

    def test_the_joint_does_not_carry_what_the_edge_does(self):
        m = mbs.Mechanism("sleigh", gravity=(4.0, 0, -9.81))
        sleigh = m.add(Body("sleigh", mass=3.0, com=(0.2, 0, 0), inertia=(0.1, 0.1, 0.2)))
        m.connect(m.world, Planar("p", axis="z", actuated=False), sleigh)
        m.add(Edge("edge", sleigh.at(-0.1, 0.05)))
        system = m.assemble()
        q = [0.3, 0.2, 0.7]
        # it turns about the point of the edge, which stands
        R = np.array([[np.cos(0.7), -np.sin(0.7)], [np.sin(0.7), np.cos(0.7)]])
        v = [*(-1.5 * R @ [-0.05, -0.1]), 1.5]
        a, lam = mbs.models.direct_dynamics(system, coordinates="tree")(q, v, np.zeros(3))
        F = np.array(mbs.models.joint_wrenches(system, "tree")(q, v, a, np.zeros(3)))[:, 0]
        assert abs(float(lam)) > 1
        # along x, along y and about z nothing is carried; the weight is
        assert np.abs(F[[0, 1, 5]]).max() < 1e-12
        assert F[2] == pytest.approx(3 * 9.81, rel=1e-13)

    def test_rolling_disc_as_the_built_in_one(self):
        ends = []
        for own in (True, False):
            m = mbs.Mechanism("coin", gravity=(0, 0, -9.81))
            body = m.add(Body("body", mass=0.4, inertia=(1e-3, 2e-3, 1e-3)))
            m.connect(m.world, mbs.components.Free("f"), body)
            if own:
                m.add(Rolls("rolls", body, r=0.1))
            else:
                m.connect(m.world, RollingDisc("rolls", radius=0.1, normal="z", axis="y"), body)
            system = m.assemble(guess={"f.z": 0.1}, active=("f.wx", "f.wy", "f.wz"))
            result = mbs.simulate.run(
                system,
                0.5,
                v0={"f.wx": 0.3, "f.wy": 12.0, "f.wz": 1.0},
                tolerance=1e-10,
                quiet=True,
            )
            ends.append([result[f"f.{x}.q"][-1] for x in ("x", "y", "z", "qw", "qx", "qy", "qz")])
        assert np.abs(ends[0][0]) > 0.3
        assert np.abs(np.array(ends[0]) - ends[1]).max() < 1e-8


class TestLoadsFromEnergy:
    def test_spring_as_the_built_in_one(self):
        results = []
        for make in (HookeanLine, Spring):
            m = pendulum(gravity=(0.3, -9.81, 0.0))
            m.add(make("s", m.world.at(0.4, 1.0, 0.2), m.components["bar"].at(0.7, 0.1), 30.0, 0.5))
            system = m.assemble()
            idm, ddm = mbs.models.inverse_dynamics(system), mbs.models.direct_dynamics(system)
            results.append(
                [idm(0.3, 0.2, 1.0), ddm(0.3, 0.2, 0.5), mbs.models.energy(system)(0.3, 0.2)[1]]
            )
        assert np.array(results[0]).ravel() == pytest.approx(
            np.array(results[1]).ravel(), rel=1e-13
        )

    def test_torsion_on_a_spherical_joint(self):
        # energy of an orientation alone: moments, no force; k (1 - R_zz) of a compass needle
        class Compass(Custom):
            """Aligns the z axis of a frame with that of another one."""

            a = custom.frame()
            b = custom.frame()
            k = custom.parameter("N.m")

            def energy(self, at):
                return at.k * (1 - at.a.to(at.b).R[2, 2])

        m = mbs.Mechanism("needle", gravity=(0, 0, 0))
        needle = m.add(Body("needle", mass=1.0, inertia=(0.2, 0.2, 0.1)))
        m.connect(m.world, Spherical("ball", actuated=False), needle)
        m.add(Compass("c", m.world, needle, 1.8))
        system = m.assemble()
        tilt = 0.4
        q = [np.cos(tilt / 2), np.sin(tilt / 2), 0, 0]
        a = mbs.models.direct_dynamics(system)(q, np.zeros(3), np.zeros(3))
        # 1e-13: rounding of a few operations
        assert np.abs(np.array(a)[:, 0] - [-1.8 * np.sin(tilt) / 0.2, 0, 0]).max() < 1e-13

    def test_energy_of_coordinates(self):
        class Hill(Custom):
            """A potential of two coordinates together."""

            x = custom.coordinate()
            y = custom.coordinate()

            def energy(self, at):
                return casadi.sin(at.x.q) * at.y.q**2

        m = mbs.Mechanism("two", gravity=(0, 0, 0))
        b = m.add(Body("b", mass=1.0))
        m.connect(m.world, Prismatic("px", axis="x"), n := m.add(Body("n", mass=0.0)))
        m.connect(n, Prismatic("py", axis="y"), b)
        m.add(Hill("hill", "px", "py"))
        held = mbs.models.inverse_dynamics(m.assemble())([0.7, 2.0], [0, 0], [0, 0])
        expected = [np.cos(0.7) * 4, np.sin(0.7) * 4]
        assert np.abs(np.array(held)[:, 0] - expected).max() < 1e-14


# Where states, inputs and parameters go.


def driven():
    return pendulum(
        lambda tip: Actuator("a", tip, time="T"), lambda tip: Drag("d", tip, c="C"), T=0.2, C=0.3
    ).assemble()


class TestModels:
    def test_places_of_states_inputs_and_parameters(self):
        system = driven()
        assert system.states == (("a.force", "N"),)
        assert system.inputs == (("a.order", "N"),)
        assert system.outputs == (("a.shown", "N"),)
        assert mbs.models.inverse_dynamics(system).name_in() == ["q", "v", "a", "z", "p"]
        assert mbs.models.direct_dynamics(system).name_in() == ["q", "v", "tau", "z", "p"]
        assert mbs.models.inertia_matrix(system).name_in() == ["q", "p"]

    def test_inputs_without_a_state_between(self):
        m = pendulum(
            lambda tip: Pusher("push", "j1"),
            lambda tip: Actuator("a", tip),
            lambda tip: Drag("d", tip, c="C"),
            C=0.3,
        )
        system = m.assemble()
        assert [name for name, _ in system.inputs] == ["push.effort", "a.order"]
        idm, ddm = mbs.models.inverse_dynamics(system), mbs.models.direct_dynamics(system)
        assert idm.name_in() == ["q", "v", "a", "z", "u", "p"]
        assert ddm.name_in() == ["q", "v", "tau", "z", "u", "p"]
        point = 0.3, 0.7, 1.1, 4.0
        pushed, free = idm(*point, [2.5, 9.0], 0.3), idm(*point, [0.0, 0.0], 0.3)
        assert float(pushed - free) == pytest.approx(-2.5, rel=1e-13)
        assert float(ddm(0.3, 0.7, pushed, 4.0, [2.5, 0.0], 0.3)) == pytest.approx(1.1, rel=1e-13)
        refused(ModelError, "u", by=lambda: idm(*point, [2.5], 0.3))
        u = np.array([[2.5, 0.0], [-1.0, 0.0], [0.0, 3.0]])
        rows = [np.full((3, 1), x) for x in point]
        many = np.asarray(mbs.native.batch(idm)(*rows, u, np.full((3, 1), 0.3))).ravel()
        assert many == pytest.approx(float(free) - u[:, 0], rel=1e-12)
        fast = mbs.native.compiled(idm)
        found = np.asarray(fast(*point, u[1], 0.3)).item()
        assert found == pytest.approx(float(free) + 1.0, rel=1e-13)

    def test_values(self):
        system = driven()
        idm = mbs.models.inverse_dynamics(system)
        q, v, a, f, c = 0.3, 0.7, 1.1, 4.0, 0.5
        free = mbs.models.inverse_dynamics(pendulum().assemble())(q, v, a)
        expected = float(free) - f * np.cos(q) + c * v * abs(v)
        p = {s.name: i for i, s in enumerate(system.parameters)}
        values = np.zeros(2)
        values[p["T"]], values[p["C"]] = 0.2, c
        assert float(idm(q, v, a, f, values)) == pytest.approx(expected, rel=1e-13)
        # left out, p has its defaults; z has to be given
        default = float(free) - f * np.cos(q) + 0.3 * v * abs(v)
        assert float(idm(q, v, a, f)) == pytest.approx(default, rel=1e-13)
        refused(ModelError, "z missing", by=lambda: idm(q, v, a))

    def test_wrong_sizes(self):
        idm = mbs.models.inverse_dynamics(driven())
        refused(ModelError, "z", by=lambda: idm(0.1, 0.2, 0.3, [1.0, 2.0]))
        refused(ModelError, "z", by=lambda: idm(0.1, 0.2, 0.3, float("nan")))
        system = driven()
        refused(
            ModelError,
            "z0",
            "force",
            by=lambda: mbs.simulate.run(system, 0.1, z0={"force": 1.0}, quiet=True),
        )
        refused(
            ModelError,
            "orders",
            by=lambda: mbs.simulate.run(system, 0.1, u={"a.orders": 1.0}, quiet=True),
        )

    def test_derivatives_see_parameters(self):
        system = driven()
        ddm = mbs.models.direct_dynamics(system)
        z = casadi.MX.sym("z")
        slope = casadi.Function("s", [z], [casadi.jacobian(ddm(0.3, 0.0, 0.0, z), z)])
        M = float(mbs.models.inertia_matrix(system)(0.3))
        assert float(slope(1.0)) == pytest.approx(np.cos(0.3) / M, rel=1e-13)

    def test_compiled_and_batch(self):
        system = driven()
        idm = mbs.models.inverse_dynamics(system)
        rng = np.random.default_rng(3)
        q, v, a, z = rng.normal(size=(4, 50, 1))
        p = np.tile([0.2, 0.3], (50, 1))
        plain = np.array([float(idm(*row)) for row in zip(q, v, a, z, p, strict=True)])
        fast = mbs.native.compiled(idm)
        assert fast.name_in() == idm.name_in()
        found = [np.asarray(fast(*row)).item() for row in zip(q, v, a, z, p, strict=True)]
        assert np.abs(np.array(found) - plain).max() < 1e-13
        many = mbs.native.batch(idm)
        assert np.abs(np.asarray(many(q, v, a, z, p)).ravel() - plain).max() < 1e-12

    def test_run_takes_starts_and_inputs(self):
        system = driven()
        options = {"tolerance": 1e-11, "quiet": True}
        one = mbs.simulate.run(system, 0.3, z0={"a.force": 5.0}, u={"a.order": 0.0}, **options)
        assert np.abs(one["a.force"] - 5 * np.exp(-one.time / 0.2)).max() < 1e-9
        # left out: the start that is declared, the input at its default
        two = mbs.simulate.run(system, 0.3, **options)
        expected = 1.5 + 0.5 * np.exp(-two.time / 0.2)
        assert np.abs(two["a.force"] - expected).max() < 1e-9
        assert np.all(two["a.order"] == 1.5)
        three = mbs.simulate.run(system, 0.3, u=lambda t, q, v: 10 * t, **options)
        t = three.time
        ramp = 10 * (t - 0.2) + 4 * np.exp(-t / 0.2)
        assert np.abs(three["a.force"] - ramp).max() < 1e-9
        four = mbs.simulate.run(system, 0.3, parameters={"T": 0.4}, u={"a": 0.0}, **options)
        assert np.abs(four["a.force"] - 2 * np.exp(-four.time / 0.4)).max() < 1e-9

    def test_sweep_varies_states_and_inputs(self):
        grid = {"a.force": [0.0, 5.0], "a.order": [1.0, 3.0], "T": [0.2, 0.4]}
        study = mbs.simulate.sweep(driven(), grid, 0.1, tolerance=1e-9)
        for case, result in study:
            lag = np.exp(-0.1 / case["T"])
            end = case["a.order"] + (case["a.force"] - case["a.order"]) * lag
            assert abs(result["a.force"][-1] - end) < 1e-7

    def test_forces_in_joints_know_them(self):
        m = pendulum(lambda tip: Actuator("a", tip), lambda tip: Pusher("push", "j1"))
        m.add(WrenchSensor("bearing", "j1"))
        m.add(AbsoluteSensor("middle", m.components["bar"].center))
        u = {"a.order": 7.0, "push.effort": 2.0}
        result = mbs.simulate.run(m.assemble(), 0.3, u=u, quiet=True)
        # m a = weight + force of the actuator + force of the joint, in axes of the world
        f = np.array([result[f"bearing.f.{x}"] for x in "xy"])
        c, s = np.cos(result["j1.q"]), np.sin(result["j1.q"])
        world = np.array([c * f[0] - s * f[1], s * f[0] + c * f[1]])
        a = np.array([result[f"middle.a.{x}"] for x in "xy"])
        expected = 2 * a - [[0.0], [-2 * 9.81]] - np.array([0 * c, result["a.force"]])
        assert np.abs(world - expected).max() < 1e-10


class TestCopies:
    def test_pickled(self):
        system = driven()
        other = pickle.loads(pickle.dumps(system))
        assert other.states == system.states
        here, there = (mbs.models.direct_dynamics(s)(0.3, 0.2, 0.1, 4.0) for s in (system, other))
        assert float(here) == float(there)
        runs = [
            mbs.simulate.run(s, 0.2, u={"a": 3.0}, quiet=True)["j1.q"][-1] for s in (system, other)
        ]
        assert runs[0] == runs[1]
        idm = pickle.loads(pickle.dumps(mbs.models.inverse_dynamics(system)))
        assert float(idm(0.3, 0.2, 0.1, 4.0)) == float(
            mbs.models.inverse_dynamics(system)(0.3, 0.2, 0.1, 4.0)
        )

    def test_deep_copies(self):
        m = pendulum(lambda tip: Actuator("a", tip))
        m.add(JointSensor("enc", "j1"))
        m.connect_signal("enc.q", m.add(Gain("gain", 2.0)).u)
        m.connect_signal("gain.y", m.components["a"].order)
        n = copy.deepcopy(m)
        m.add(Drag("late", m.components["bar"].right, c=1.0))
        one, two = m.assemble(), n.assemble()
        assert [p.name for p in two.parts] == ["a", "gain"]
        assert [p.name for p in one.parts] == ["a", "gain", "late"]
        assert two.inputs == ()
        third = copy.deepcopy(two)
        values = [mbs.models.direct_dynamics(s)(0.3, 0.2, 0.1, 4.0) for s in (two, third)]
        assert float(values[0]) == float(values[1])

    def test_names_are_scoped(self):
        inner = mbs.Mechanism("axis", parameters={"K": 30.0})
        bar = inner.add(Box("bar", length=1.0, mass=2.0))
        inner.connect(inner.world, Revolute("j", axis="z", actuated=False), bar.left)
        inner.add(JointSensor("enc", "j"))
        gain = inner.add(Gain("k", "-K"))
        force = inner.add(Pusher("push", "j"))
        inner.connect_signal("enc.q", gain.u)
        inner.connect_signal(gain.y, force.effort)
        m = mbs.Mechanism("two", gravity=(0, 0, 0))
        for side, x in (("left", -1.0), ("right", 1.0)):
            placed = m.add(inner, side)
            m.connect(m.world.at(x, 0, 0), placed.base)
        system = m.assemble()
        assert system.inputs == ()
        assert [p.name for p in system.parameters] == ["left.K", "right.K"]
        assert [name for name, _ in system.outputs] == ["left.k.y", "right.k.y"]
        result = mbs.simulate.run(
            system,
            1.0,
            q0={"left.j": 0.1, "right.j": 0.1},
            parameters={"right.K": 120.0},
            tolerance=1e-11,
            quiet=True,
        )
        inertia = float(mbs.models.inertia_matrix(system)([0, 0])[0, 0])
        for side, K in (("left", 30.0), ("right", 120.0)):
            swing = 0.1 * np.cos(np.sqrt(K / inertia) * result.time)
            assert np.abs(result[f"{side}.j.q"] - swing).max() < 1e-8

    def test_wires_between_levels(self):
        inner = mbs.Mechanism("axis", gravity=(0, 0, 0))
        bar = inner.add(Box("bar", length=1.0, mass=2.0))
        inner.connect(inner.world, Revolute("j", axis="z", actuated=False), bar.left)
        inner.add(Actuator("a", bar.right, time=0.2, force=1.0))
        follower = inner.add(Gain("k", 3.0))
        inner.connect_signal("a.force", follower.u)
        m = mbs.Mechanism("outer", gravity=(0, 0, 0))
        for side in ("left", "right"):
            placed = m.add(inner, side)
            m.connect(m.world, placed.base)
            m.connect_signal(mbs.components.Constant(f"{side}.order", 5.0).y, placed["a"].order)
        m.connect_signal("left.k.y", m.add(Gain("sum", 2.0)).u)
        system = m.assemble()
        assert system.inputs == ()
        assert list(system.component_start) == [1.0, 1.0]
        result = mbs.simulate.run(
            system, 0.3, z0={"right.a.force": 0.0}, tolerance=1e-10, quiet=True
        )
        t = result.time
        assert np.abs(result["sum.y"] - 6 * (5 - 4 * np.exp(-t / 0.2))).max() < 1e-8
        assert np.abs(result["right.k.y"] - 3 * (5 - 5 * np.exp(-t / 0.2))).max() < 1e-8


class Pusher(Custom):
    """An effort along a coordinate."""

    on = custom.coordinate()
    effort = custom.input("N.m")

    def loads(self, at):
        return {"on": at.effort}


def test_what_methods_see():
    seen = {}

    class Look(Custom):
        """Looks at everything."""

        a = custom.frame()
        b = custom.frame()

        def loads(self, at):
            seen["at"], seen["kinds"] = at, (type(at).__name__, at.a.port, at.b.port)
            seen["shapes"] = [x.shape for x in (at.a.p, at.a.R, at.a.v, at.a.w)]
            motion = at.a.to(at.b)
            seen["motion"] = [motion.p, motion.R, motion.V, motion.w, motion.length, motion.rate]
            return custom.pull(at.a, at.b, motion.rate)

    m = pendulum()
    m.add(Look("look", m.world.at(0, 1, 0, rotation=("z", 0.3)), m.components["bar"].right))
    m.assemble()
    assert isinstance(seen["at"], At)
    assert seen["kinds"] == ("At", "a", "b")
    assert seen["shapes"] == [(3, 1), (3, 3), (3, 1), (3, 1)]
    assert [x.shape for x in seen["motion"]] == [(3, 1), (3, 3), (3, 1), (3, 1), (1, 1), (1, 1)]


def test_ends_of_a_wire_have_one_unit():
    m = mbs.Mechanism("servo")
    bar, joint = m.add(Box("bar", length=1.0, mass=1.0)), Revolute("j", axis="z")
    m.connect(m.world, joint, bar.left)
    motor = m.add(DCMotor("motor", 1.0, 0.1, 0.2))
    m.connect(motor.flange, joint.flange)
    m.add(JointSensor("encoder", "j"))
    m.connect_signal("encoder.q", motor.voltage)
    refused(AssemblyError, "[rad] is wired to motor.voltage [V]", "a Gain", by=m.assemble)
    m.wires.clear()
    gain = m.add(Gain("gain", 2.0))
    m.connect_signal("encoder.q", gain.u)
    m.connect_signal(gain.y, motor.voltage)
    assert m.assemble().inputs == ()


def test_a_symbol_of_a_text_has_the_unit_of_its_declaration():
    m = mbs.Mechanism("air", parameters={"c": 0.4, "L": 1.0})
    bar = m.add(Box("bar", length="L", mass=1.0))
    m.connect(m.world, Revolute("j", axis="z"), bar.left)
    m.add(Drag("drag", bar.right, "c"))
    system = m.assemble()
    assert {p.name: (p.unit, p.default) for p in system.parameters} == {
        "L": ("1", 1.0),
        "c": ("kg/m", 0.4),
    }


class Unread(Custom):
    """A torque that does not depend on its input."""

    shaft = custom.coordinate()
    spare = custom.input("N.m")

    def loads(self, at):
        return {"shaft": -0.5 * at.shaft.v}


class Grip(Custom):
    """Friction whose limit grows with the slip."""

    shaft = custom.coordinate()

    def frictions(self, at):
        return {"": custom.Friction(slip=at.shaft.v, limit=1 + casadi.fabs(at.shaft.v) / 2)}


def shaft_with(component):
    m = mbs.Mechanism("m", gravity=(0, 0, 0))
    body = m.add(Body("b", 1, (0, 0, 0), (1, 1, 1)))
    m.connect(m.world, Revolute("j", actuated=True), body)
    m.add(component)
    return m.assemble()


def test_inputs_without_effect_are_accepted():
    system = shaft_with(Unread("c", "j"))
    motions = [
        mbs.simulate.run(system, 1.0, v0={"j": 1.0}, u={"c.spare": u}, quiet=True)["j.v"]
        for u in (0.0, 3.0)
    ]
    assert motions[0][-1] == pytest.approx(np.exp(-0.5), abs=1e-8)
    np.testing.assert_array_equal(*motions)


def test_the_limit_of_a_friction_may_grow_with_the_slip():
    """v' = -(1 + v / 2): v = 4 exp(-t / 2) - 2 until it sticks at t = 2 ln 2."""
    result = mbs.simulate.run(shaft_with(Grip("g", "j")), 2.0, v0={"j": 2.0}, quiet=True)
    exact = np.maximum(4 * np.exp(-result.time / 2) - 2, 0)
    np.testing.assert_allclose(result["j.v"], exact, rtol=0, atol=1e-8)
    assert result.events[0][0] == pytest.approx(2 * np.log(2), abs=1e-8)


def test_a_system_of_a_class_without_a_place_cannot_be_pickled():
    made = type("Made", (Grip,), {})
    with pytest.raises(ModelError, match=r"m: the system cannot be pickled.*Made.*class statement"):
        pickle.dumps(shaft_with(made("g", "j")))
