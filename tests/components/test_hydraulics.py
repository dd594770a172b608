"""Hydraulic cylinders and valves: speeds, oil and powers beside formulas written down."""

import casadi
import numpy as np
import pytest
from support.everywhere import agree
from support.messages import refused

import mbs
from mbs.components import (
    Body,
    Custom,
    Force,
    HydraulicCylinder,
    HydraulicValve,
    Prismatic,
    custom,
)
from mbs.errors import DescriptionError
from mbs.recursions.part_checks import check_part
from mbs.recursions.parts import PartsAt

AREA_A, AREA_B, BULK = 2e-3, 1.2e-3, 1.4e9
RATED_FLOW, RATED_DROP, SUPPLY = 6e-4, 3.5e6, 1.6e7
MASS, LOAD = 80.0, 9000.0


class OilMeter(Custom):
    """Mass of oil that came through a port, over its density at no pressure."""

    bulk = custom.parameter("Pa")
    flow = custom.input("m3/s")
    p = custom.input("Pa")
    volume = custom.state("m3", nominal=1e-4)

    def rates(self, at):
        return {"volume": at.flow * casadi.exp(at.p / at.bulk)}


def cylinder(**changed):
    numbers = {
        "area_a": AREA_A,
        "area_b": AREA_B,
        "closed": 0.3,
        "stroke": 0.5,
        "dead_a": 5e-5,
        "dead_b": 4e-5,
        "bulk": BULK,
    }
    return numbers | changed


def press(meters=False, wired=True, **changed):
    """A mass on a slide that a cylinder pushes against a force."""
    m = mbs.Mechanism("press")
    ram = m.add(Body("ram", mass=MASS))
    m.connect(m.world, Prismatic("x", axis="x", actuated=False), ram)
    m.add(Force("load", ram, (-LOAD, 0, 0)))
    c = m.add(HydraulicCylinder("cyl", m.world, ram, **cylinder(**changed)))
    if wired:
        valve = m.add(HydraulicValve("valve", RATED_FLOW, RATED_DROP, SUPPLY))
        m.connect_signal(valve.flow_a, c.flow_a)
        m.connect_signal(valve.flow_b, c.flow_b)
        m.connect_signal("cyl.p_a", valve.p_a)
        m.connect_signal("cyl.p_b", valve.p_b)
    if meters:
        for side in "ab":
            meter = m.add(OilMeter(f"meter_{side}", BULK))
            m.connect_signal(getattr(valve, f"flow_{side}"), meter.flow)
            m.connect_signal(f"cyl.p_{side}", meter.p)
    return m.assemble(guess={"x": 0.4})


def steady(spool):
    """Speed, p_a and p_b at rest of the pressures, with orifices of the square root."""
    k = RATED_FLOW / np.sqrt(RATED_DROP) * abs(spool)
    if spool > 0:
        v = k * np.sqrt((SUPPLY * AREA_A - LOAD) / (AREA_A**3 + AREA_B**3))
        return v, SUPPLY - (AREA_A * v / k) ** 2, (AREA_B * v / k) ** 2
    v = -k * np.sqrt((SUPPLY * AREA_B + LOAD) / (AREA_A**3 + AREA_B**3))
    return v, (AREA_A * v / k) ** 2, SUPPLY - (AREA_B * v / k) ** 2


class TestPair:
    @pytest.mark.parametrize("spool", [0.6, -0.4])
    def test_steady_speed(self, spool):
        system = press()
        v, p_a, p_b = steady(spool)
        result = mbs.simulate.run(
            system,
            0.6,
            q0={"x": 0.35 if spool > 0 else 0.75},
            v0={"x": v},
            z0={"cyl.p_a": p_a, "cyl.p_b": p_b},
            u={"valve.spool": spool},
        )
        # the smooth root has (1e3 Pa / dp)^2 / 4 less flow than the sharp one: 1e-8 of it
        assert abs(result["x.v"][-1] / v - 1) < 1e-7
        assert abs(result["cyl.p_a"][-1] / p_a - 1) < 1e-6
        assert abs(result["cyl.p_b"][-1] / p_b - 1) < 1e-6
        assert abs(result["cyl.force"][-1] - LOAD) < 1e-3
        assert abs(result["valve.flow_a"][-1] - AREA_A * v) < 1e-7 * abs(AREA_A * v)

    def test_it_settles_from_rest(self):
        system = press(friction=2000.0)
        result = mbs.simulate.run(
            system, 0.8, q0={"x": 0.31}, z0={"cyl.p_a": LOAD / AREA_A}, u={"valve": 0.6}
        )
        k = RATED_FLOW / np.sqrt(RATED_DROP) * 0.6
        v = result["x.v"][-1]
        # p_a A_a - p_b A_b = load + friction v, with both orifices
        left = (SUPPLY - (AREA_A * v / k) ** 2) * AREA_A - (AREA_B * v / k) ** 2 * AREA_B
        assert v > 0.2
        assert abs(left - LOAD - 2000 * v) < 1e-4 * LOAD

    def test_oil_is_kept(self):
        system = press(meters=True)
        result = mbs.simulate.run(system, 0.3, q0={"x": 0.4}, u={"valve": 0.8}, tolerance=1e-9)
        s = result["x.q"] - 0.3
        for side, volume in (("a", 5e-5 + AREA_A * s), ("b", 4e-5 + AREA_B * (0.5 - s))):
            held = volume * np.exp(result[f"cyl.p_{side}"] / BULK)
            came = result[f"meter_{side}.volume"]
            assert np.ptp(came) > 1e-5
            # 1e-9 of the tolerance on a state of 1e-4 m^3 whose errors count by its nominal size
            assert np.abs(held - held[0] - came).max() < 1e-7 * np.ptp(came)

    def test_everywhere(self, tmp_path):
        shown = ["x.q", "cyl.p_a", "cyl.force", "valve.flow_b"]
        start = {"u": {"valve.spool": 0.6}, "z0": {"cyl.p_a": 5e6, "cyl.p_b": 1e6}}
        agree(press(friction=2000.0, leakage=1e-12), tmp_path, 0.05, shown, **start)

    def test_closed_valve_holds_the_load(self):
        system = press()
        p_a, A = (LOAD + 2e6 * AREA_B) / AREA_A, BULK * AREA_A**2 / (5e-5 + AREA_A * 0.2)
        B = BULK * AREA_B**2 / (4e-5 + AREA_B * 0.3)
        result = mbs.simulate.run(
            system,
            0.2,
            q0={"x": 0.5},
            v0={"x": 1e-4},
            z0={"cyl.p_a": p_a, "cyl.p_b": 2e6},
            u={"valve": 0.0},
            step=1e-4,
            tolerance=1e-12,
        )
        # the spring of the oil: k = bulk A^2 / V of both chambers
        w = np.sqrt((A + B) / MASS)
        assert np.abs(result["x.q"] - 0.5 - 1e-4 / w * np.sin(w * result.time)).max() < 1e-9


class TestCylinder:
    def test_power_of_the_oil(self):
        # p Q = p A v at pressures that do not change: work of the force
        system = press(wired=False, leakage=1e-13)
        v, p_a, p_b = 0.1, 8e6, 8e6
        at = PartsAt(system, q := casadi.SX.sym("q"), w := casadi.SX.sym("v"))
        find = casadi.Function(
            "f", [q, w, system.component_states, system.u], [at.rates(), at.outputs()]
        )
        leak = 0.0
        rates, force = find(0.5, v, [p_a, p_b], [AREA_A * v + leak, -AREA_B * v - leak])
        assert np.abs(np.array(rates)).max() < 1e-6
        assert float(force) == pytest.approx((AREA_A - AREA_B) * 8e6, rel=1e-14)
        rates, _ = find(0.5, 0.0, [9e6, 8e6], [0.0, 0.0])
        volumes = np.array([5e-5 + AREA_A * 0.2, 4e-5 + AREA_B * 0.3])
        expected = BULK / volumes * 1e-13 * 1e6 * np.array([-1, 1])
        assert np.abs(np.array(rates)[:, 0] - expected).max() < 1e-9 * expected.max()

    def test_end_stops(self):
        result = mbs.simulate.run(press(), 1.0, q0={"x": 0.7}, u={"valve": 1.0}, method="rodas")
        push = SUPPLY * AREA_A - LOAD
        assert result["x.q"][-1] > 0.8
        # at rest the supply is in one chamber and the tank in the other
        assert abs(result["cyl.p_a"][-1] - SUPPLY) < 1e-4 * SUPPLY
        assert abs(result["cyl.p_b"][-1]) < 1e-4 * SUPPLY
        # beyond the width the stop is stiffness (depth - width / 2)
        assert abs(result["x.q"][-1] - 0.8 - 5e-5 - push / 1e8) < 1e-4 * push / 1e8

    def test_loads_and_energy_of_the_stops_agree(self):
        m = mbs.Mechanism("m")
        ram = m.add(Body("ram", mass=MASS))
        m.connect(m.world, Prismatic("x", axis="x", actuated=False), ram)
        m.add(HydraulicCylinder("cyl", m.world, ram, **cylinder()))
        system = m.assemble()
        at = PartsAt(system, q := casadi.SX.sym("q"), v := casadi.SX.sym("v"))
        f = casadi.Function(
            "f", [q, v, system.component_states], [at.outputs(), casadi.gradient(at.energy(), q)]
        )
        for x in (0.29995, 0.2995, 0.5, 0.80004, 0.801):
            force, slope = f(x, 0.0, [0.0, 0.0])
            assert float(force) == pytest.approx(-float(slope), rel=1e-12, abs=1e-12)
            assert (float(force) == 0) == (x == 0.5)
        for part in system.parts:
            check_part(system, part, PartsAt(system, q, v))


class TestValve:
    def test_flows(self):
        m = mbs.Mechanism("m")
        m.connect(m.world, Prismatic("x"), m.add(Body("b", mass=1.0)))
        m.add(HydraulicValve("v", 1e-3, 1e6, 1e7, tank=1e5, transition=1.0))
        system = m.assemble()
        at = PartsAt(system, casadi.SX.sym("q"), casadi.SX.sym("v"))
        f = casadi.Function("f", [system.u], [at.outputs()])

        def flows(*u):
            return np.array(f(u))[:, 0]

        # 1e-12: the smooth root at 1e6 Pa, less the fourth part of (1 Pa / 1e6 Pa)^2
        assert flows(1.0, 6e6, 4.1e6) == pytest.approx([2e-3, -2e-3], rel=1e-12)
        assert flows(-0.5, 4.1e6, 6e6) == pytest.approx([-1e-3, 1e-3], rel=1e-12)
        assert flows(3.0, 6e6, 4.1e6) == pytest.approx([2e-3, -2e-3], rel=1e-12)
        assert flows(1.0, 1.4e7, 0.0)[0] == pytest.approx(-2e-3, rel=1e-12)  # back to the supply
        assert np.all(flows(0.0, 5e6, 5e6) == 0)
        assert flows(1.0, 1e7, 1e5) == pytest.approx([0, 0], abs=1e-18)
        J = casadi.Function("J", [system.u], [casadi.jacobian(at.outputs(), system.u)])
        assert np.all(np.isfinite(np.array(J([1.0, 1e7, 1e5]))))


@pytest.mark.parametrize(
    ("changed", "parts"),
    [
        ({"area_a": 0.0}, ["cyl", "area_a is 0 m2"]),
        ({"stroke": -1.0}, ["cyl", "stroke is -1 m"]),
        ({"bulk": 0.0}, ["cyl", "bulk is 0 Pa"]),
        ({"leakage": -1.0}, ["cyl", "leakage is -1 m3/s.Pa"]),
    ],
)
def test_descriptions_that_are_refused(changed, parts):
    refused(DescriptionError, *parts, by=lambda: press(**changed))
