"""The numbers of a system that may become symbols: their names, units and values."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from casadi import SX

from mbs.assembly.system import System
from mbs.assembly.tree import Link
from mbs.components.motion import Motion
from mbs.spatial import elements
from mbs.spatial.inertia import TEN_PARAMETERS

GROUPS = {
    "masses": ("M",),
    "first_moments": ("MX", "MY", "MZ"),
    "inertias": ("XX", "XY", "XZ", "YY", "YZ", "ZZ"),
    "lengths": ("b", "d", "r", "x", "y", "z"),
    "angles": ("gamma", "alpha", "theta"),
    "friction": ("Fv", "Fs"),
    "rotors": ("Ia", "Jm"),
    "gravity": ("G",),
}
"""Kinds of numbers by the name of their group."""

MAGNITUDES = ("M", "XX", "YY", "ZZ", "Ia", "Jm", "Fv", "Fs")
"""Kinds that are never negative, of bodies and joints as of links."""

PLACEMENT = ("gamma", "b", "alpha", "d", "theta", "r")
"""Kinds that place the frame of a link."""

_TEXTS = {
    "M": "mass of link {link}",
    "Ia": "rotor inertia seen at joint {link}",
    "Jm": "inertia of the rotor that spins with joint {link}",
    "Fv": "viscous friction of joint {link}",
    "Fs": "dry friction of joint {link}",
    **{kind: f"first moment {kind} of link {{link}}" for kind in GROUPS["first_moments"]},
    **{kind: f"inertia {kind} of link {{link}}" for kind in GROUPS["inertias"]},
    **{kind: f"Khalil parameter {kind} of link {{link}}" for kind in PLACEMENT},
}
_FIXED_UNITS = {
    "M": "kg",
    "Jm": "kg.m2",
    **dict.fromkeys(GROUPS["first_moments"], "kg.m"),
    **dict.fromkeys(GROUPS["inertias"], "kg.m2"),
    **dict.fromkeys(GROUPS["lengths"], "m"),
    **dict.fromkeys(GROUPS["angles"], "rad"),
}
_TURNING = {"Ia": "kg.m2", "Fv": "N.m.s/rad", "Fs": "N.m"}
_SLIDING = {"Ia": "kg", "Fv": "N.s/m", "Fs": "N"}


@dataclass(frozen=True, slots=True, eq=False)
class Adjustable:
    """A number of a system, or an expression of its symbols, by the name it would have as a symbol.

    Attributes:
        name: kind and number of the link, such as M3, d4, Fv1; d4_1 for the first fixed frame on
            the way to link 4; G1, G2, G3 for gravity; of the place of a cut joint
            `joint.frame_a.x`.
        kind: a member of `GROUPS`.
        owner: what it belongs to: ("link", number from 0), ("fixed frame", "4_1"), ("gravity",
            row), or the name of a cut joint and its frame, "a" or "b".
        value: the number or expression.
        unit: of it.
        description: one line.
    """

    name: str
    kind: str
    owner: tuple[str, int | str]
    value: SX
    unit: str
    description: str


def adjustables(system: System) -> list[Adjustable]:
    """Every number that may become a symbol: links in order, then cut joints, then gravity."""
    rows = [row for j, link in enumerate(system.tree.links) for row in _of_link(j, link)]
    return [*rows, *_of_cuts(system), *_of_gravity(system)]


def _of_link(j: int, link: Link) -> Iterator[Adjustable]:
    for k, frame in enumerate(link.via):
        label = f"{j + 1}_{k + 1}"
        for kind, value in zip(PLACEMENT, frame.parameters, strict=True):
            text = f"Khalil parameter {kind} of fixed frame {k + 1} on the way to link {j + 1}"
            owner = ("fixed frame", label)
            yield Adjustable(f"{kind}{label}", kind, owner, value, _FIXED_UNITS[kind], text)
    values = dict(zip(TEN_PARAMETERS, elements(link.inertia.parameters), strict=True))
    values |= dict(zip(PLACEMENT, link.placement.parameters, strict=True))
    values |= {"Fv": link.Fv, "Fs": link.Fs}
    if link.rotor is None:
        values["Ia"] = link.Ia
    else:
        values["Jm"] = link.rotor.inertia
    units = _SLIDING if link.motion is Motion.PRISMATIC else _TURNING
    for kind, value in values.items():
        unit, text = {**_FIXED_UNITS, **units}[kind], _TEXTS[kind].format(link=j + 1)
        yield Adjustable(f"{kind}{j + 1}", kind, ("link", j), value, unit, f"{text} ({link.name})")


def _of_cuts(system: System) -> Iterator[Adjustable]:
    for cut in system.cuts:
        joint = cut.edge.joint.name
        for side, (_, pose) in zip("ab", cut.frames, strict=True):
            for row, axis in enumerate("xyz"):
                text = f"{axis} of frame_{side} of {joint} in the frame of its link"
                name = f"{joint}.frame_{side}.{axis}"
                yield Adjustable(name, axis, (joint, side), pose.p[row], "m", text)


def _of_gravity(system: System) -> Iterator[Adjustable]:
    for row, axis in enumerate("xyz"):
        text = f"{axis} of the gravity acceleration in the base frame"
        value = system.tree.gravity[row]
        yield Adjustable(f"G{row + 1}", "G", ("gravity", row), value, "m/s2", text)
