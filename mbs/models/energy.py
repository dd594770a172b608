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
    """``energy(q, v) -> E, U``: kinetic energy, rotors included, and potential energy.

    The potential energy is that of gravity, of the springs of the joints and of what force elements
    store.

    Source: Khalil & Creusot 1997, eq. 49-50.

    Args:
        system: open or closed; q must close the loops.
        coordinates: of a closed system, "independent" or "tree".

    Returns:
        Function of q (nq, 1) and v (m, 1); E, U [J], U zero with everything at the base's
        origin and the springs at rest.
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
