"""Hydraulics: cylinders whose chambers hold compressible oil, and the valves that feed them.

Pressures are gauge pressures, of 0 Pa outside. Wires carry flows from a valve to a cylinder and
pressures back. Oil is taken to be of one density in flows, and without gas: pressures may become
negative, which says that a real cylinder would cavitate.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import casadi
from casadi import SX

from mbs.components import custom
from mbs.components.custom import Custom, Load
from mbs.components.forces import one_sided_damping, smooth_ramp


class HydraulicCylinder(Custom):
    """A double-acting cylinder between two points, with the pressures of its chambers as states.

    With the distance L of the points and the stroke s = L - closed,

        past = leakage (p_a - p_b)
        dp_a/dt = bulk / (dead_a + area_a s) (flow_a - area_a ds/dt - past)
        dp_b/dt = bulk / (dead_b + area_b (stroke - s)) (flow_b + area_b ds/dt + past)
        force = p_a area_a - p_b area_b - friction ds/dt + what the end stops push

    which drives the points apart. End stops at s = 0 and s = stroke are springs and dampers, whose
    stiffness grows from zero over `end_width` beyond them.

    Source: Merritt 1967 for the flows into compressed volumes.

    Attributes:
        a, b: the points of the housing and of the rod.
        area_a: of the piston on the side that extends the cylinder [m^2].
        area_b: on the side of the rod [m^2].
        closed: distance of the points where the rod is drawn in [m].
        stroke: how far it comes out [m].
        dead_a, dead_b: volumes that are left where the piston is at the end of a chamber, with
            those of its pipes [m^3].
        bulk: bulk modulus of the oil [Pa].
        leakage: flow past the piston for a unit of pressure [m^3/(s Pa)].
        friction: viscous friction [N s/m].
        end_stiffness: of the end stops [N/m].
        end_damping: of the end stops [N s/m].
        end_width: over which they come into effect [m].
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
    p_a = custom.state("Pa", nominal=1e5)  # a bar: loads change pressures by as much
    p_b = custom.state("Pa", nominal=1e5)  # likewise
    flow_a = custom.input("m3/s")
    flow_b = custom.input("m3/s")
    force = custom.output("N")

    def rates(self, at: Any) -> Mapping[str, SX]:
        """Of the pressures."""
        motion = at.a.to(at.b)
        s, rate = motion.length - at.closed, motion.rate
        past = at.leakage * (at.p_a - at.p_b)
        volume_a, volume_b = at.dead_a + at.area_a * s, at.dead_b + at.area_b * (at.stroke - s)
        return {
            "p_a": at.bulk / volume_a * (at.flow_a - at.area_a * rate - past),
            "p_b": at.bulk / volume_b * (at.flow_b + at.area_b * rate + past),
        }

    def loads(self, at: Any) -> Mapping[str, Load]:
        """The force drives the points apart."""
        return custom.pull(at.a, at.b, -self._force(at))

    def energy(self, at: Any) -> SX:
        """That of the end stops."""
        return SX(at.end_stiffness * sum((area for _, _, _, area in self._ends(at)), SX(0)))

    def outputs(self, at: Any) -> Mapping[str, SX]:
        """The force."""
        return {"force": self._force(at)}

    def _force(self, at: Any) -> SX:
        rate = at.a.to(at.b).rate
        total = at.p_a * at.area_a - at.p_b * at.area_b - at.friction * rate
        for sign, share, depth, _ in self._ends(at):
            spring = at.end_stiffness * depth
            total += sign * spring - one_sided_damping(at.end_damping * share * rate, spring)
        return SX(total)

    @staticmethod
    def _ends(at: Any) -> list[tuple[float, SX, SX, SX]]:
        """Direction of the push, share of the stiffness, depth and its integral, of both stops."""
        s = at.a.to(at.b).length - at.closed
        sides = ((1.0, -s), (-1.0, s - at.stroke))
        return [(sign, *smooth_ramp(depth, at.end_width)) for sign, depth in sides]


class HydraulicValve(Custom):
    """A 4/3 spool valve between a supply, a tank and the two chambers of a cylinder.

    The spool runs from -1 to 1. Above zero it opens the supply to a and b to the tank, below zero
    the supply to b and a to the tank, as far as it is shifted; at zero all is closed. The flow
    through an edge is rated_flow |spool| sqrt(dp / rated_drop), with its sign, where dp is the
    difference of pressures; sqrt(dp) is dp / (dp^2 + transition^2)^(1/4), smooth at zero.

    Source: Merritt 1967 for orifices and spool valves.

    Attributes:
        rated_flow: through one edge, open, at the rated difference of pressures [m^3/s].
        rated_drop: that difference [Pa].
        supply: pressure of the supply [Pa].
        tank: pressure of the tank [Pa].
        transition: difference of pressures below which the root is smooth [Pa].
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

    def outputs(self, at: Any) -> Mapping[str, SX]:
        """The flows into the chambers."""
        s = casadi.fmin(casadi.fmax(at.spool, -1), 1)
        ahead, back = casadi.fmax(s, 0), casadi.fmax(-s, 0)
        fill_a, drain_a = self._flow(at, at.supply - at.p_a), self._flow(at, at.p_a - at.tank)
        fill_b, drain_b = self._flow(at, at.supply - at.p_b), self._flow(at, at.p_b - at.tank)
        return {
            "flow_a": ahead * fill_a - back * drain_a,
            "flow_b": back * fill_b - ahead * drain_b,
        }

    @staticmethod
    def _flow(at: Any, drop: SX) -> SX:
        """Through an edge that is open, at a difference of pressures."""
        root = drop / (drop**2 + at.transition**2) ** 0.25
        return SX(at.rated_flow * root / casadi.sqrt(at.rated_drop))
