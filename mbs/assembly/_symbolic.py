"""Systems with symbols instead of numeric masses, inertias, lengths or friction."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi
from casadi import SX

from mbs.assembly.khalil_frames import Cut
from mbs.assembly.model_function import require_system
from mbs.assembly.system import System
from mbs.assembly.tables import JointRow
from mbs.assembly.tree import Frame, Link, Tree
from mbs.components.joints import Motion
from mbs.errors import ModelError
from mbs.expressions import Parameter
from mbs.spatial import Inertia, Khalil, Pose, elements
from mbs.spatial.inertia import TEN_PARAMETERS
from mbs.text import did_you_mean, quoted

# Numbers of a system that may become symbols: names, units and values.


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
"""Kinds of numbers, by the name of their group."""

MAGNITUDES = ("M", "XX", "YY", "ZZ", "Ia", "Jm", "Fv", "Fs")
"""Kinds that are never negative."""

PLACEMENT = ("gamma", "b", "alpha", "d", "theta", "r")
"""Kinds of the placement of a link's frame: Khalil parameters."""

_TEXTS = {
    "M": "mass of link {link}",
    "Ia": "rotor inertia seen at joint {link}",
    "Jm": "inertia of the rotor that spins with joint {link}",
    "Fv": "viscous friction of joint {link}",
    "Fs": "Coulomb friction of joint {link}",
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
    """A number of a system, or an expression of its symbols, that may become a symbol.

    Attributes:
        name: name as a symbol: kind and number of the link, such as M3, d4, Fv1; d4_1 for the first
            fixed frame on the path to link 4; G1, G2, G3 for gravity; `joint.frame_a.x` for the
            position of a cut joint.
        kind: a member of `GROUPS`.
        owner: owner of the number: ("link", index from 0), ("fixed frame", "4_1"), ("gravity",
            row), or the name of a cut joint and its frame, "a" or "b".
        value: number or expression.
        unit: unit of the value.
        description: description in one line.
    """

    name: str
    kind: str
    owner: tuple[str, int | str]
    value: SX
    unit: str
    description: str


def adjustables(system: System) -> list[Adjustable]:
    """Return all numbers of a system that may become symbols: links in order, cut joints, gravity.

    Args:
        system: open or closed system.
    """
    rows = [row for j, link in enumerate(system.tree.links) for row in _numbers_of_link(j, link)]
    return [*rows, *_numbers_of_cuts(system), *_numbers_of_gravity(system)]


def _numbers_of_link(j: int, link: Link) -> Iterator[Adjustable]:
    """Yield the numbers of link j (index from 0) and of the fixed frames on the path to it."""
    for k, frame in enumerate(link.via):
        label = f"{j + 1}_{k + 1}"
        for kind, value in zip(PLACEMENT, frame.parameters, strict=True):
            text = f"Khalil parameter {kind} of fixed frame {k + 1} on the path to link {j + 1}"
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


def _numbers_of_cuts(system: System) -> Iterator[Adjustable]:
    """Yield the positions of the frames of cut joints, which may become symbols."""
    for cut in system.cuts:
        joint = cut.edge.joint.name
        for side, (_, pose) in zip("ab", cut.frames, strict=True):
            for row, axis in enumerate("xyz"):
                text = f"{axis} of frame_{side} of {joint} in the frame of its link"
                name = f"{joint}.frame_{side}.{axis}"
                yield Adjustable(name, axis, (joint, side), pose.p[row], "m", text)


def _numbers_of_gravity(system: System) -> Iterator[Adjustable]:
    """Yield the three components of gravity, which may become symbols."""
    for row, axis in enumerate("xyz"):
        text = f"{axis} of the gravity acceleration in the base frame"
        value = system.tree.gravity[row]
        yield Adjustable(f"G{row + 1}", "G", ("gravity", row), value, "m/s2", text)


_Symbols = Mapping[str, SX]
_Given = Mapping[tuple[str, int | str], _Symbols]
"""Symbols by kind, by the owner of the numbers that they replace."""

_OF_THE_JOINT = ("Ia", "Fv", "Fs")


def symbolic(system: System, what: Sequence[str]) -> System:
    """Return a system with some of its numbers as symbols, whose defaults are the numbers.

    The symbols follow the existing parameters in p of every model. Inertial parameters belong to a
    whole link, about the origin of its frame and in its axes, with the names of SYMORO. M3 alone
    changes the mass and keeps first moments and inertia, so that the centre of mass moves. If Fixed
    joints divide a link, the change belongs to the body that no Fixed joint carries. Lengths are
    the Khalil parameters of the frames and the positions of cut joints. Points on a link keep their
    position on the link. The configuration is unchanged.

    Args:
        system: open or closed system.
        what: groups: "masses" (M), "first_moments" (MX, MY, MZ), "inertias" (XX .. ZZ), "lengths"
            (b, d, r, cut joints), "angles" (gamma, alpha, theta), "friction" (Fv, Fs), "rotors"
            (Ia, Jm), "gravity" (G1, G2, G3), whose exact zeros stay zero; single numbers such as
            "M3", "XX2", "d4", "Fv1", also if they are zero; or the name of a body for the ten
            parameters of its link.

    Returns:
        new System; the original system is unchanged.

    Raises:
        ModelError: there is no such group, number or body, a name is given twice, or a number is
            already an expression of symbols.
    """
    require_system(system)
    rows = _choose(system, _names(system, what))
    _check_welds(system, rows)
    taken = {parameter.name for parameter in system.parameters}
    for row in rows:
        if row.name in taken:
            raise ModelError(
                f"{system.name}: {row.name} cannot become a symbol, since there is a parameter of"
                " that name; rename the parameter"
            )
    symbols = {row.name: SX.sym(row.name) for row in rows}
    parameters = [Parameter(r.name, float(r.value), r.unit, r.description) for r in rows]
    return _with_symbols(system, rows, symbols, parameters)


def _names(system: System, what: Sequence[str]) -> list[str]:
    """Return the requested names `what`, a name or a list of names, as a list.

    Raises ModelError for another type or repeated names.
    """
    if not isinstance(what, (str, list, tuple)):
        raise ModelError(
            f"{system.name}: what is to be symbols is {quoted(what)}; give names such as"
            " ['masses', 'd4']"
        )
    names = [what] if isinstance(what, str) else list(what)
    for name in names:
        if names.count(name) > 1:
            raise ModelError(f"{system.name}: {quoted(name)} is to be a symbol twice; name it once")
    return names


def _choose(system: System, names: Sequence[str]) -> list[Adjustable]:
    """Return the numbers with these names or in these groups, in the order of the system."""
    rows = adjustables(system)
    single = {row.name: row for row in rows}
    own = {parameter.name for parameter in system.parameters}
    needed: dict[str, None] = {}
    for name in names:
        if name in GROUPS:
            kinds = GROUPS[name]
            found = [r for r in rows if r.kind in kinds and _is_number(r) and float(r.value)]
        elif name in single:
            _check_number(system, single[name])
            found = [single[name]]
        else:
            found = _numbers_of_body(system, rows, name)
        needed |= dict.fromkeys(row.name for row in found if not _is_itself(row, own))
    return [row for row in rows if row.name in needed]


def _is_number(row: Adjustable) -> bool:
    """Whether the value of the adjustable `row` is a number and not an expression."""
    return bool(row.value.is_constant())


def _is_itself(row: Adjustable, parameters: set[str]) -> bool:
    """Whether the value is already the symbol with the name of the adjustable.

    `parameters` are the names of the parameters of the system.
    """
    return row.name in parameters and row.value.is_symbolic() and row.value.name() == row.name


def _check_number(system: System, row: Adjustable) -> None:
    """Raise ModelError if the value of the adjustable `row` is an expression of other symbols."""
    own = {parameter.name for parameter in system.parameters}
    if not _is_number(row) and not _is_itself(row, own):
        names = ", ".join(dict.fromkeys(s.name() for s in casadi.symvar(row.value)))
        raise ModelError(
            f"{system.name}: {row.name} is an expression of {names} already; use these parameters"
        )


def _numbers_of_body(system: System, rows: Sequence[Adjustable], name: str) -> list[Adjustable]:
    """Return the ten inertial parameters of the link of the body `name` that are not symbols yet.

    Raises ModelError if there is no such body, or if its link has further bodies with mass.

    `rows` are the numbers of the system that may become symbols.
    """
    links = {body.name: body.link for body in system.bodies}
    if name not in links:
        known = [*GROUPS, *links, *(row.name for row in rows)]
        raise ModelError(
            f"{system.name}: there is nothing called {quoted(name)} that may become a symbol;"
            f" {did_you_mean(name, known)}"
        )
    number = links[name]
    others = [b.name for b in system.bodies if b.link == number and b.name != name and b.mass != 0]
    if others:
        raise ModelError(
            f"{system.name}: {name} is one link with {', '.join(others)}, which has one mass; name"
            f" parameters of the link, such as M{number}"
        )
    return [r for r in rows if r.owner == ("link", number - 1) and r.kind in TEN_PARAMETERS]


def _check_welds(system: System, rows: Sequence[Adjustable]) -> None:
    """Raise ModelError if all bodies of a link with inertial symbols are carried by Fixed joints.

    `rows` are the numbers that become symbols.
    """
    for number in sorted({int(r.owner[1]) for r in rows if r.kind in TEN_PARAMETERS}):
        carriers = [j for j in system.joints if j.part is not None and j.frame_b[0] == number]
        bodies = [body.name for body in system.bodies if body.link == number + 1]
        parts = [joint.part.ports for joint in carriers if joint.part is not None]
        if carriers and all(any((body, "") in ports for ports in parts) for body in bodies):
            raise ModelError(
                f"{system.name}: the mass of link {number + 1} cannot become a symbol, since each"
                f" of its bodies is carried by {' or '.join(joint.name for joint in carriers)};"
                " give the body an mbs.Parameter where it is described"
            )


def _with_symbols(
    system: System,
    rows: Sequence[Adjustable],
    symbols: _Symbols,
    parameters: Sequence[Parameter],
) -> System:
    """Return the system with `symbols` instead of the numbers `rows`, and further `parameters`."""
    given: dict[tuple[str, int | str], dict[str, SX]] = {}
    for row in rows:
        given.setdefault(row.owner, {})[row.kind] = symbols[row.name]
    links = tuple(_link(j, link, given) for j, link in enumerate(system.tree.links))
    gravity = [given.get(("gravity", k), {}).get("G", system.tree.gravity[k]) for k in range(3)]
    joints = tuple(_joint(row, system.cuts, given) for row in system.joints)
    return replace(
        system,
        tree=Tree(links, casadi.vertcat(*gravity)),
        cuts=tuple(_cut(cut, given) for cut in system.cuts),
        joints=joints,
        sensors=tuple(
            sensor
            if sensor.joint is None or joints[sensor.joint] is system.joints[sensor.joint]
            else replace(
                sensor, frames=(joints[sensor.joint].frame_a, joints[sensor.joint].frame_b)
            )
            for sensor in system.sensors
        ),
        parameters=(*system.parameters, *parameters),
        bounds={**system.bounds, **{r.name: (0.0, None) for r in rows if r.kind in MAGNITUDES}},
        p=casadi.vertcat(system.p, *symbols.values()),
        _cache={},
    )


def _link(j: int, link: Link, given: _Given) -> Link:
    """Return link j (index from 0) with the symbols in `given` instead of its numbers."""
    via = tuple(
        _frame(frame, given.get(("fixed frame", f"{j + 1}_{k}"), {}))
        for k, frame in enumerate(link.via, 1)
    )
    values = given.get(("link", j), {})
    ten = zip(TEN_PARAMETERS, elements(link.inertia.parameters), strict=True)
    inertia = Inertia.from_parameters(casadi.vertcat(*(values.get(k, old) for k, old in ten)))
    rotor = link.rotor
    if rotor is not None and "Jm" in values:
        rotor = replace(rotor, inertia=values["Jm"])
    joint: dict[str, Any] = {name: values[name] for name in _OF_THE_JOINT if name in values}
    placement = _frame(link.placement, values)
    return replace(link, inertia=inertia, via=via, placement=placement, rotor=rotor, **joint)


def _frame(frame: Khalil, values: _Symbols) -> Khalil:
    """Return the Khalil frame with the symbols in `values` (by kind) instead of its numbers."""
    six = zip(PLACEMENT, frame.parameters, strict=True)
    return Khalil(*(values.get(kind, old) for kind, old in six)) if values else frame


def _with_position(pose: Pose, values: _Symbols) -> Pose:
    """Return the pose with the symbols in `values` (keys x, y, z) instead of its position."""
    if not values:
        return pose
    return pose.at(casadi.vertcat(*(values.get(k, pose.p[i]) for i, k in enumerate("xyz"))))


def _cut(cut: Cut, given: _Given) -> Cut:
    """Return the cut joint with the symbols in `given` instead of the positions of its frames."""
    name = cut.edge.joint.name
    return replace(
        cut,
        pose_a=_with_position(cut.pose_a, given.get((name, "a"), {})),
        pose_b=_with_position(cut.pose_b, given.get((name, "b"), {})),
    )


def _joint(row: JointRow, cuts: Sequence[Cut], given: _Given) -> JointRow:
    """Return the row of a joint with its frames at the changed positions of its cut joint.

    The row is unchanged if it has no cut joint with symbols.

    `given` maps (joint, side) to the symbols of the positions of its frames.
    """
    moves = [
        m for cut in cuts if cut.edge.joint.name == row.name for m in _moved_frames(cut, given)
    ]
    if not moves:
        return row

    def frame(old: Frame) -> Frame:
        return next((new for was, new in moves if _is_same(was, old)), old)

    return replace(row, frame_a=frame(row.frame_a), frame_b=frame(row.frame_b))


def _moved_frames(cut: Cut, given: _Given) -> Iterator[tuple[Frame, Frame]]:
    """Yield each frame of a cut joint with symbols, before and after the substitution.

    `given` maps (joint, side) to the symbols of a frame position.
    """
    for side, (link, pose) in zip("ab", cut.frames, strict=True):
        values = given.get((cut.edge.joint.name, side), {})
        if values:
            yield (link, pose), (link, _with_position(pose, values))


def _is_same(one: Frame, other: Frame) -> bool:
    """Whether two frames are on the same link and have equal poses."""
    same = casadi.is_equal(one[1].matrix, other[1].matrix, 3)
    return one[0] == other[0] and bool(same)
