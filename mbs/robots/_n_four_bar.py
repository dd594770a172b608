"""A row of four-bar windows, problem A02 of the multibody benchmark library."""

from __future__ import annotations

from itertools import pairwise
from math import pi

from mbs.components import Body, Revolute
from mbs.errors import DescriptionError
from mbs.mechanism import Mechanism
from mbs.text import quoted

_SOURCE = (
    "Gonzalez, Dopico, Lugris & Cuadrado 2006, multibody benchmark library, problem A02;"
    " two windows: Bayo & Avello 1994"
)


def n_four_bar(loops: int = 1) -> Mechanism:
    """N four-bar linkages (windows) in a row, which share their upright rods.

    The upright rods 0 .. N are at x = 0, 1, ..., N m on the ground, with couplers between their
    tops. All 2 N + 1 links are slender homogeneous rods of 1 m and 1 kg; gravity is along -y. Joint
    a<k> is at the lower end of upright k, joint b<k> between upright k and coupler k; the joint
    c<k> at the far end of coupler k closes a loop. There is one degree of freedom, but N + 1 in the
    singular configuration with all rods on one line. The mechanism is assembled upright; the
    benchmark starts with the tops at 1 m/s along x, `v0={"a0": -1}`.

    Source: Gonzalez et al. 2006, problem A02, with N = 40; Bayo & Avello 1994, with N = 2.

    Args:
        loops: number N of linkages.

    Raises:
        DescriptionError: `loops` is not an integer above zero.
    """
    if isinstance(loops, bool) or not isinstance(loops, int) or loops < 1:
        raise DescriptionError(
            f"n_four_bar: loops is {quoted(loops)}; give the number of windows, 1 or more"
        )
    m = Mechanism("n_four_bar", gravity=(0, -9.81, 0), source=_SOURCE)
    uprights = [m.add(_rod(f"upright{k}")) for k in range(loops + 1)]
    for k, upright in enumerate(uprights):
        m.connect(m.world.at(k), _hinge(f"a{k}"), upright)
        m.guess[f"a{k}"] = pi / 2
    for k, (before, after) in enumerate(pairwise(uprights)):
        coupler, closing = m.add(_rod(f"coupler{k}")), _hinge(f"c{k}")
        m.connect(before.at(1), _hinge(f"b{k}"), coupler)
        m.connect(coupler.at(1), closing, after.at(1))
        m.cut(closing)
        m.guess[f"b{k}"] = -pi / 2
    return m


def _rod(name: str) -> Body:
    """Return a slender homogeneous rod of 1 m and 1 kg along x."""
    return Body(name, mass=1, com=(0.5, 0, 0), inertia=(0, 1 / 12, 1 / 12))


def _hinge(name: str) -> Revolute:
    """Return a passive revolute joint about z."""
    return Revolute(name, axis="z", actuated=False)
