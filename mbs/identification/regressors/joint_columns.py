"""What one parameter of a joint or of its motor adds to efforts, momenta and energy."""

from __future__ import annotations

from dataclasses import dataclass, replace

import casadi
from casadi import SX

from mbs.assembly.tree import CarriedRotor, Link, Tree
from mbs.identification.regressors.columns import COUPLED, Column
from mbs.recursions.accelerations import Acceleration
from mbs.recursions.joint_efforts import rotor_and_friction
from mbs.recursions.poses import LinkPose
from mbs.recursions.regressor import work
from mbs.recursions.regressor_twists import PathTwist, path_twist_rates, path_twists
from mbs.recursions.rotors import rotor_efforts, rotor_moments
from mbs.recursions.velocities import Velocity, link_velocities
from mbs.spatial import zeros

_INERTIAS = ("Ia", "Iam", "Jm")


@dataclass(frozen=True, slots=True, eq=False)
class JointColumns:
    """Columns of joints for one state of the tree.

    Attributes:
        tree: the links.
        poses: each with respect to its antecedent.
        v: (nv, 1) joint velocities.
        velocities: of the links.
        base: velocity of the base; None at rest.
    """

    tree: Tree
    poses: list[LinkPose]
    v: SX
    velocities: list[Velocity]
    base: Velocity | None

    @staticmethod
    def of(tree: Tree, poses: list[LinkPose], v: SX, base: Velocity | None = None) -> JointColumns:
        """With the velocities of the links that follow."""
        return JointColumns(tree, poses, v, link_velocities(tree, poses, v, base), base)

    def effort(self, column: Column, a: SX, motions: list[Acceleration], base: Acceleration) -> SX:
        """(nv, 1) efforts for a unit of a parameter.

        Args:
            column: the parameter.
            a: (nv, 1) joint accelerations.
            motions: of the links.
            base: its motion.
        """
        if column.kind != "Jm":
            return self._own(column, self.v, a)
        alone = self._with_one_rotor(column)
        total = rotor_efforts(alone, a, motions, base)
        for c, moment in rotor_moments(alone, self.v, a, motions).items():
            total += self._along(self._twists(c), moment)
        return total

    def momentum(self, column: Column) -> SX:
        """(nv, 1) derivative of kinetic energy in v for a unit of a parameter."""
        if column.kind not in _INERTIAS:
            return zeros(self.tree.nv)
        if column.kind != "Jm":
            return self._own(column, zeros(self.tree.nv), self.v)
        link, rotor = self._rotor(column)
        total = zeros(self.tree.nv)
        total[link.v] = rotor.seen_at_joint * self.v[link.v] + self._spin(rotor)
        if rotor.carrier >= 0:
            spin = rotor.momentum * self.v[link.v]
            total += self._along(self._twists(rotor.carrier), spin)
        return total

    def rest(self, column: Column) -> SX:
        """(nv, 1) what the efforts are beside the rate of the momentum."""
        if column.kind != "Jm":
            return self._own(column, self.v, zeros(self.tree.nv))
        link, rotor = self._rotor(column)
        if rotor.carrier < 0:
            return zeros(self.tree.nv)
        rates = path_twist_rates(self.tree, self.poses, self.velocities)
        return -self._along(rates[rotor.carrier], rotor.momentum * self.v[link.v])

    def energy(self, column: Column) -> SX:
        """Kinetic energy of a unit of a parameter; friction and offsets have none."""
        if column.kind not in _INERTIAS:
            return SX(0)
        return SX(0.5 * casadi.dot(self.v, self.momentum(column)))

    def power(self, column: Column) -> SX:
        """Power that a unit of a parameter takes and does not give back."""
        if column.kind in _INERTIAS:
            return SX(0)
        return SX(casadi.dot(self.v, self.rest(column)))

    def _own(self, column: Column, v: SX, a: SX) -> SX:
        """The law of the joints, with this parameter alone."""
        link, total = self.tree.links[column.link - 1], zeros(self.tree.nv)
        if column.kind == "offset":
            total[link.v] = 1
            return total
        one = {column.kind.removesuffix("m"): SX(1)}
        Ia, Fv, Fs = (one.get(kind, SX(0)) for kind in ("Ia", "Fv", "Fs"))
        unit = replace(link, Ia=Ia, Fv=Fv, Fs=Fs)
        if column.kind not in COUPLED:
            total[link.v] = _law(unit, v[link.v], a[link.v])
            return total
        second = self.tree.links[column.other - 1]
        effort = _law(unit, v[link.v] + v[second.v], a[link.v] + a[second.v])
        total[link.v] = total[second.v] = effort
        return total

    def _with_one_rotor(self, column: Column) -> Tree:
        links = [
            replace(link, rotor=self._rotor(column)[1] if number == column.link else None)
            for number, link in enumerate(self.tree.links, start=1)
        ]
        return Tree(tuple(links), self.tree.gravity)

    def _rotor(self, column: Column) -> tuple[Link, CarriedRotor]:
        """The joint and its rotor with a unit of inertia."""
        link = self.tree.links[column.link - 1]
        assert link.rotor is not None
        return link, replace(link.rotor, inertia=SX(1))

    def _spin(self, rotor: CarriedRotor) -> SX:
        """Momentum that the turning of the carrier gives the rotor."""
        carrier = self.velocities[rotor.carrier] if rotor.carrier >= 0 else self.base
        return SX(0) if carrier is None else SX(casadi.dot(rotor.momentum, carrier.w))

    def _twists(self, carrier: int) -> list[PathTwist]:
        return path_twists(self.tree, self.poses)[carrier]

    def _along(self, twists: list[PathTwist], moment: SX) -> SX:
        """(nv, 1) work of a moment in each of some velocities."""
        total = zeros(self.tree.nv)
        for twist in twists:
            total[twist.row] = work(twist, (None, moment))
        return total


def _law(link: Link, v: SX, a: SX) -> SX:
    alone = replace(link, v=slice(0, link.motion.nv))
    return rotor_and_friction(Tree((alone,), zeros()), v, a)
