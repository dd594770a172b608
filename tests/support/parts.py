"""Built-in components asked as those of a user are, and their heat as a state."""

import numpy as np
from casadi import SX

import mbs
from mbs.components import custom
from mbs.recursions.part_checks import check_part
from mbs.recursions.parts import PartsAt


def asked(mechanism, **options):
    """The assembled system, each of whose components has answered all questions of assembling."""
    system = mechanism.assemble(**options)
    at = PartsAt(system, SX.sym("q", system.nq), SX.sym("v", system.nv))
    for part in system.parts:
        check_part(system, part, at)
    return system


def metered(kind):
    """A kind of component whose heat [J] is a state."""

    class Metered(kind):
        heat = custom.state("J")

        def rates(self, at):
            return {**kind.rates(self, at), "heat": self.dissipation(at)}

    return Metered


def run(system, duration, **options):
    return mbs.simulate.run(system, duration, quiet=True, **{"tolerance": 1e-11, **options})


def stored(result, *heats):
    """Energy of a motion with the heat so far [J]."""
    total = result["kinetic_energy"] + result["potential_energy"]
    return total + sum((result[f"{name}.heat"] for name in heats), np.zeros(len(total)))
