"""Small mechanisms with rigid stops and Coulomb friction, for state equations and FMUs."""

import numpy as np

import mbs
from mbs.components import Box, CoulombFriction, PointMass, Prismatic, Revolute, RigidStop, Spring

G = 9.81
DENSITY, WIDTH = 2700.0, 0.05
FIVE = {"a": (0.5, 0.6), "b": (0.5, 0.6)}
FIVE_GUESS = {"a1": 2.0, "a2": -1.2, "b1": 1.1, "b2": 1.2}
FOUR = {"a": (0.4, 1.0), "b": (0.9,)}
FOUR_GUESS = {"a1": 1.0, "a2": -0.8, "b1": 1.4}


def pendulum(*elements, mass=1.5, length=0.7):
    """A point mass on a horizontal rod at q = 0, which hangs at q = -pi/2."""
    m = mbs.Mechanism("pendulum")
    rod = m.add(PointMass("mass", mass))
    m.connect(m.world, Revolute("q", axis="-y", actuated=True), rod.at(-length, 0, 0))
    for element in elements:
        m.add(element)
    return m.assemble()


def block(slope, *elements, mass=2.0):
    """A block on a slope that falls along x."""
    m = mbs.Mechanism("block", gravity=(G * np.sin(slope), 0, -G * np.cos(slope)))
    m.connect(m.world, Prismatic("x", axis="x", actuated=True), m.add(PointMass("mass", mass)))
    for element in elements:
        m.add(element)
    return m.assemble()


def stick_slip(stiffness=40.0, static=30.0, sliding=20.0, mass=10.0):
    """A block on a rough floor behind a spring whose other end `pull` is moved."""
    m = mbs.Mechanism("stick_slip", gravity=(0, 0, 0))
    puller, body = m.add(PointMass("puller", 1.0)), m.add(PointMass("body", mass))
    m.connect(m.world, Prismatic("pull", axis="x", actuated=True), puller)
    m.connect(m.world, Prismatic("x", axis="x"), body)
    m.add(Spring("spring", puller.at(1.0), body, stiffness=stiffness, length=1.0))
    m.add(CoulombFriction("dry", joint="x", sliding=sliding, sticking=static))
    return m.assemble()


def bars(lengths, base, gravity, *elements, guess):
    """A planar loop of two arms, the last bar of one pinned to the last one of the other.

    The arms start at the origin and at (base, 0); their joints are a1, a2, .. and b1, b2, ..
    """
    m = mbs.Mechanism("bars", gravity=(0, gravity, 0))
    ends = []
    for arm, start in (("a", m.world), ("b", m.world.at(base, 0, 0))):
        end = start
        for k, length in enumerate(lengths[arm], start=1):
            bar = m.add(Box(f"bar_{arm}{k}", length=length, width=WIDTH, density=DENSITY))
            driven = k == 1 and (arm == "a" or len(lengths["b"]) == 2)
            m.connect(end, Revolute(f"{arm}{k}", axis="z", actuated=driven), bar.left)
            end = bar.right
        ends.append(end)
    pin = Revolute("pin", axis="z")
    m.connect(ends[0], pin, ends[1])
    m.cut(pin)
    for element in elements:
        m.add(element)
    return m.assemble(guess=guess)


def four_bar(gravity, *elements):
    """A four-bar whose crank a1 is driven and whose rocker b1 follows."""
    return bars(FOUR, 0.8, gravity, *elements, guess=FOUR_GUESS)


def stopped_rocker():
    """A four-bar under gravity whose rocker bounces off a stop."""
    return four_bar(-G, RigidStop("end", joint="b1", upper=2.2, restitution=0.4))


def five_bar(gravity, *elements):
    """A five-bar with the driven joints a1 and b1."""
    return bars(FIVE, 0.6, gravity, *elements, guess=FIVE_GUESS)


def slider_crank(*elements):
    """The slider-crank of the catalogue with more elements."""
    m = mbs.load("slider_crank")
    for element in elements:
        m.add(element)
    return m.assemble()
