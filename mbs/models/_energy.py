"""Kinetic and potential energy."""

from __future__ import annotations

from casadi import Function

from mbs.assembly import System
from mbs.assembly.model_function import Named, model_function
from mbs.models.symbols import configuration_check, symbols_of
from mbs.recursions.energy import kinetic_energy, potential_energy
from mbs.recursions.newton_euler import spring_energy
from mbs.recursions.parts import PartsAt


def energy(system: System, coordinates: str = "independent") -> Function:
    """Return kinetic energy, including rotors, and potential energy: ``energy(q, v) -> E, U``.

    The potential energy includes gravity, joint springs and energy stored in force elements.

    Source: Khalil & Creusot 1997, eq. 49-50.

    Args:
        system: open or closed mechanism; q must close the loops.
        coordinates: coordinates of a closed system, "independent" or "tree".

    Returns:
        Function of q (nq, 1) and v (m, 1); E and U [J]. The gravity term of U is zero at the origin
        of the base, the spring terms are zero at rest length.
    """

    def build() -> tuple[Named, Named]:
        s = symbols_of(system, coordinates)
        E = kinetic_energy(system.tree, s.poses, s.v_tree)
        elastic = spring_energy(system.tree, s.q) + PartsAt(system, s.q).energy()
        U = potential_energy(system.tree, s.poses) + elastic
        return [("q", s.q), ("v" + s.suffix, s.v)], [("E", E), ("U", U)]

    return model_function(
        system, ("energy", coordinates), build, configuration_check(system, coordinates)
    )
