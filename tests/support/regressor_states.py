"""Systems with every kind of dynamic parameter, and states of them."""

from __future__ import annotations

from functools import cache

import numpy as np
from casadi import DM, SX, Function, casadi
from support.random_trees import ALL_KINDS, random_state, random_tree

import mbs
from mbs import Mechanism
from mbs.components import (
    Body,
    Free,
    Prismatic,
    Revolute,
    Rotor,
    Spherical,
)
from mbs.loops.reduction import reduction

OPEN = ("puma560", "stanford", "scara", "two_branch_tree", "cart_pole")
CLOSED = ("sr400", "four_bar", "slider_crank", "five_bar", "andrews_squeezer")
TREES = tuple(f"tree{seed}" for seed in range(6))
ROTORS = ("ball_base", "free_base")


@cache
def system_of(name):
    if name in ROTORS:
        return rotors(name).assemble()
    if name in TREES:
        seed = int(name.removeprefix("tree"))
        tree = random_tree(seed, n=4, kinds=ALL_KINDS, aligned=seed % 2 == 0)
        return tree.mechanism.assemble()
    return getattr(mbs.robots, name)().assemble()


def rotors(base):
    """Two geared arms on a base that turns or floats, with friction."""
    m = Mechanism(base, gravity=(1, 2, -9))
    ball = Spherical("s", Ia=0.1, Fv=0.2, Fs=0.3, actuated=True)
    bodies = [
        m.add(Body(name, mass=k, com=(0.1, 0.2, 0.3), inertia=(1.0, 1.1, 1.2)))
        for k, name in enumerate("bcd", start=1)
    ]
    fast, slow = Rotor(inertia=1e-2, ratio=20), Rotor(inertia=1e-2, ratio=50, axis="x")
    first = Revolute("j1", axis="x", rotor=fast, Ia=0.2, Fv=0.1, Fs=0.5, Fs_width=0.1)
    second = Prismatic("j2", axis="y", rotor=slow, Fv=0.1, Fs=0.5)
    m.connect(m.world, ball if base == "ball_base" else Free("f"), bodies[0])
    m.connect(bodies[0].at(0.1, 0.2, 0.3), first, bodies[1])
    m.connect(bodies[1].at(0.3, 0.2, 0.1), second, bodies[2])
    return m


def state_of(system, seed=0):
    """Positions that close the loops, independent velocities and accelerations."""
    rng = np.random.default_rng(seed)
    if not system.is_closed:
        return random_state(system, rng)
    n = len(system.independent)
    return np.array(system.configuration), rng.normal(size=n), rng.normal(size=n)


def moving(name):
    """A system, and a base that moves anyhow."""
    system = turret() if name == "turret" else system_of(name)
    rng = np.random.default_rng(11)
    turn = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    return system, (*rng.uniform(-2, 2, (2, 6)), turn * np.linalg.det(turn))


def turret():
    """A rotor that stands on the base and spins with the first joint."""
    m = Mechanism("turret", gravity=(1, 2, -9))
    gun = m.add(Body("gun", mass=2, com=(0.1, 0.2, 0.3), inertia=(1, 2, 3)))
    m.connect(m.world, Revolute("j", rotor=Rotor(inertia=0.1, ratio=30, axis="x")), gun)
    return m.assemble()


class Motion:
    """Symbols of a state, and derivatives in time along it."""

    def __init__(self, system):
        size = len(system.independent)
        self.system = system
        self.q = SX.sym("q", system.nq)
        self.v, self.a = SX.sym("v", size), SX.sym("a", size)

    def rate(self, value):
        v = self.v
        if self.system.is_closed:
            v = casadi.mtimes(reduction(self.system, self.q, v).G, v)
        state = casadi.vertcat(self.q, self.v)
        change = casadi.vertcat(self.system.qdot(self.q, v), self.a)
        return casadi.reshape(casadi.jtimes(casadi.vec(value), state, change), *value.shape)

    def largest(self, value, state):
        """The largest element of a symbolic matrix."""
        p = DM(self.system.parameter_values())
        found = Function("value", [self.q, self.v, self.a, self.system.p], [value])(*state, p)
        return float(np.abs(np.array(found)).max())
