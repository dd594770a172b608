"""Hydraulics: cylinders with chambers of compressible oil, and valves that feed them.

Pressures are gauge pressures, relative to the surroundings. Wires connect flows from a valve to a
cylinder and pressures back. The oil has constant density in flows and contains no gas. A negative
pressure means that a real cylinder would cavitate.
"""

from __future__ import annotations

from collections.abc import Mapping

import casadi
from casadi import SX

from mbs.components import custom
from mbs.components.custom import At, Custom, Load
from mbs.components.forces import one_sided_damping, smooth_ramp


class HydraulicCylinder(Custom):
    """A double-acting cylinder between two points, with the chamber pressures as states.

    With the distance L of the points and the stroke s = L - closed,

        past = leakage (p_a - p_b)
        dp_a/dt = bulk / (dead_a + area_a s) (flow_a - area_a ds/dt - past)
        dp_b/dt = bulk / (dead_b + area_b (stroke - s)) (flow_b + area_b ds/dt + past)
        force = p_a area_a - p_b area_b - friction ds/dt + force of the end stops

    which pushes the points apart. End stops at s = 0 and s = stroke are springs and dampers, whose
    stiffness grows from zero over `end_width` beyond them.

    Source: Merritt 1967 for the flows into compressed volumes.

    Attributes:
        a, b: points of the housing and of the rod.
        area_a: piston area on the side that extends the cylinder [m^2].
        area_b: piston area on the rod side [m^2].
        closed: distance of the points with the rod retracted [m].
        stroke: range of the rod [m].
        dead_a, dead_b: dead volumes: volumes of the chambers, with their pipes, with the piston at
            the end of the chamber [m^3].
        bulk: bulk modulus of the oil [Pa].
        leakage: leakage flow past the piston per pressure [m^3/(s Pa)].
        friction: viscous friction [N s/m].
        end_stiffness: stiffness of the end stops [N/m].
        end_damping: damping of the end stops [N s/m].
        end_width: depth over which the stiffness of the end stops grows [m].
    """

    a = custom.frame()
    b = custom.frame()
    area_a = custom.parameter("m2", positive=True)
    area_b = custom.parameter("m2", positive=True)
    closed = custom.parameter("m", min=0)
    stroke = custom.parameter("m", positive=True)
    dead_a = custom.parameter("m3", 1e-5, positive=True)
    dead_b = custom.parameter("m3", 1e-5, positive=True)
    bulk = custom.parameter("Pa", 1.4e9, positive=True)
    leakage = custom.parameter("m3/s.Pa", 0.0, min=0)
    friction = custom.parameter("N.s/m", 0.0, min=0)
    end_stiffness = custom.parameter("N/m", 1e8, positive=True)
    end_damping = custom.parameter("N.s/m", 1e5, min=0)
    end_width = custom.parameter("m", 1e-4, positive=True)
    p_a = custom.state("Pa", nominal=1e5)  # 1 bar, the order of pressure changes by loads
    p_b = custom.state("Pa", nominal=1e5)  # 1 bar, as p_a
    flow_a = custom.input("m3/s")
    flow_b = custom.input("m3/s")
    force = custom.output("N")

    def rates(self, at: At) -> Mapping[str, SX]:
        """Return the rates of the gauge pressures p_a and p_b of the two chambers [Pa/s].

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        motion = at.a.to(at.b)
        s, rate = motion.length - at.closed, motion.rate
        past = at.leakage * (at.p_a - at.p_b)
        volume_a, volume_b = at.dead_a + at.area_a * s, at.dead_b + at.area_b * (at.stroke - s)
        return {
            "p_a": at.bulk / volume_a * (at.flow_a - at.area_a * rate - past),
            "p_b": at.bulk / volume_b * (at.flow_b + at.area_b * rate + past),
        }

    def loads(self, at: At) -> Mapping[str, Load]:
        """Return the forces ON the points "a" and "b": `force` [N], away from the other point.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return custom.pull(at.a, at.b, -self._force(at))

    def energy(self, at: At) -> SX:
        """Return the energy of the end stops [J], zero between them; the oil is not included.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return SX(at.end_stiffness * sum((area for _, _, _, area in self._end_stops(at)), SX(0)))

    def outputs(self, at: At) -> Mapping[str, SX]:
        """Return {"force": total force of the class docstring [N]}, positive if it pushes.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {"force": self._force(at)}

    def _force(self, at: At) -> SX:
        """Return pressure force, friction and end stop force [N]; positive if it pushes apart."""
        rate = at.a.to(at.b).rate
        total = at.p_a * at.area_a - at.p_b * at.area_b - at.friction * rate
        for sign, share, depth, _ in self._end_stops(at):
            spring = at.end_stiffness * depth
            total += sign * spring - one_sided_damping(at.end_damping * share * rate, spring)
        return SX(total)

    @staticmethod
    def _end_stops(at: At) -> list[tuple[float, SX, SX, SX]]:
        """Return (sign, ramp slope, ramp [m], integral of the ramp [m^2]) of the two end stops.

        The sign is 1 at s = 0, where the stop pushes the points apart, and -1 at s = stroke. The
        other values are zero without contact, see `smooth_ramp`.
        """
        s = at.a.to(at.b).length - at.closed
        sides = ((1.0, -s), (-1.0, s - at.stroke))
        return [(sign, *smooth_ramp(depth, at.end_width)) for sign, depth in sides]


class HydraulicValve(Custom):
    """A 4/3 spool valve between a supply, a tank and the two chambers of a cylinder.

    The spool position is between -1 and 1. Positive values connect the supply with a, and b with
    the tank; negative values connect the supply with b, and a with the tank. The opening is
    proportional to the spool position; at zero all edges are closed. The flow through an edge is
    rated_flow |spool| sqrt(dp / rated_drop), with the sign of the pressure difference dp. sqrt(dp)
    is dp / (dp^2 + transition^2)^(1/4), which is smooth at zero.

    Source: Merritt 1967 for orifices and spool valves.

    Attributes:
        rated_flow: flow through one open edge at the rated pressure difference [m^3/s].
        rated_drop: rated pressure difference [Pa].
        supply: pressure of the supply [Pa].
        tank: pressure of the tank [Pa].
        transition: pressure difference below which the square root is smoothed [Pa].
    """

    rated_flow = custom.parameter("m3/s", positive=True)
    rated_drop = custom.parameter("Pa", positive=True)
    supply = custom.parameter("Pa")
    tank = custom.parameter("Pa", 0.0)
    transition = custom.parameter("Pa", 1e3, positive=True)
    spool = custom.input()
    p_a = custom.input("Pa")
    p_b = custom.input("Pa")
    flow_a = custom.output("m3/s")
    flow_b = custom.output("m3/s")

    def outputs(self, at: At) -> Mapping[str, SX]:
        """Return flow_a and flow_b: flows from the valve INTO chambers a and b [m^3/s].

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        s = casadi.fmin(casadi.fmax(at.spool, -1), 1)
        ahead, back = casadi.fmax(s, 0), casadi.fmax(-s, 0)
        fill_a, drain_a = self._flow(at, at.supply - at.p_a), self._flow(at, at.p_a - at.tank)
        fill_b, drain_b = self._flow(at, at.supply - at.p_b), self._flow(at, at.p_b - at.tank)
        return {
            "flow_a": ahead * fill_a - back * drain_a,
            "flow_b": back * fill_b - ahead * drain_b,
        }

    @staticmethod
    def _flow(at: At, drop: SX) -> SX:
        """Return the flow through a fully open edge at the pressure difference `drop` [Pa] [m^3/s].

        It has the sign of `drop`.
        """
        root = drop / (drop**2 + at.transition**2) ** 0.25
        return SX(at.rated_flow * root / casadi.sqrt(at.rated_drop))
