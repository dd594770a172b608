"""The mechanical part of a one-cylinder engine, example Engine1a of the Modelica library."""

from __future__ import annotations

from mbs.components import Prismatic, Revolute
from mbs.mechanism import Mechanism
from mbs.robots.bars import round_bar, square_bar

_SOURCE = (
    "Modelica Standard Library, Modelica.Mechanics.MultiBody.Examples.Loops.Engine1a; its planar"
    " loop: Otter, Elmqvist & Mattsson 2003"
)
_GRAVITY = 9.80665
_STEEL = 7700
_THROW, _ROD, _PISTON = 0.1, 0.2, 0.1
_ALONG = (0.1, 0, 0)
_WEB = (0.02, 0.1, 0.05)


def single_cylinder_engine() -> Mechanism:
    """Mechanics of a one-cylinder engine: crankshaft, connecting rod and piston.

    There is no gas force. The joint `crank` rotates the shaft about x; its inertia includes a
    flywheel of 1 kg m^2. The joint `cylinder` is the displacement of the piston downwards from y =
    0.45 m, and `wrist` the angle of the connecting rod on its pin. The loop is closed at the crank
    pin. All parts are of steel; gravity is 9.80665 m/s^2 along -y. The mechanism is assembled with
    crank = 0 and the piston at top dead centre; the example starts with `v0={"crank": 10}` [rad/s].

    Source: Modelica Standard Library, example Engine1a.
    """
    m = Mechanism(
        "single_cylinder_engine",
        gravity=(0, -_GRAVITY, 0),
        source=_SOURCE,
        guess={"cylinder": 0.45 - _THROW - _ROD - _PISTON},
    )
    shaft = m.add(round_bar("shaft", _ALONG, 0.05, _STEEL))
    up = m.add(square_bar("up", (0, _THROW, 0), _WEB, _STEEL))
    throw = m.add(round_bar("throw", _ALONG, 0.03, _STEEL))
    down = m.add(square_bar("down", (0, -_THROW, 0), _WEB, _STEEL))
    m.connect(shaft.at(*_ALONG), up)
    m.connect(up.at(0, _THROW), throw)
    m.connect(throw.at(*_ALONG), down)
    piston = m.add(round_bar("piston", (0, -_PISTON, 0), 0.1, _STEEL))
    rod = m.add(square_bar("rod", (0, -_ROD, 0), (0.02, _ROD, 0.06), _STEEL))
    m.connect(m.world, Revolute("crank", axis="x", actuated=True, Ia=1), shaft)
    m.connect(m.world.at(0.15, 0.45), Prismatic("cylinder", axis="-y"), piston)
    m.connect(piston.at(0, -_PISTON), Revolute("wrist", axis="x"), rod)
    pin = Revolute("pin", axis="x")
    m.connect(rod.at(0, -_ROD), pin, throw.at(0.05))
    m.cut(pin)
    return m
