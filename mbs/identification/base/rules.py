"""Which inertial parameters of a tree have no effect of their own, joint by joint.

A parameter of link j either does no work at all, or its effect is a combination of the effects of
other parameters: of link j itself and, moved by the lambda matrix, of its antecedent i.

Source: Gautier & Khalil 1990; Khalil & Bennis 1995; Khalil & Dombre 2002, section 9.4. Prismatic
joints between turning ones and rotors of prismatic joints differ from the sources, whose rules
leave out a parameter that has an effect or keep one that has none of its own.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from casadi import DM, SX

from mbs.assembly.tree import Link
from mbs.components.motion import Motion
from mbs.identification.base.lambda_transform import lambda_transform
from mbs.identification.base.resting import resting_height
from mbs.identification.base.structure import Structure
from mbs.spatial import Pose, elements
from mbs.spatial.inertia import TEN_PARAMETERS

Key = tuple[int, str]
"""A parameter: number of the link from 0, and kind."""

Effects = Mapping[Key, SX]
"""Coefficients of parameters."""

_TENSOR = TEN_PARAMETERS[:6]
_MOMENTS = TEN_PARAMETERS[6:9]
_Z = SX(DM([0, 0, 1]))
_LEAST = 1e-9
"""An element of a unit vector below this is zero."""


@dataclass(frozen=True, slots=True, eq=False)
class Removal:
    """A parameter that leaves, and the parameters that take its effect over.

    Attributes:
        parameter: that leaves.
        effects: the combination of parameters that has the same effect; empty when it has none.
    """

    parameter: Key
    effects: Effects


def tree_rules(structure: Structure) -> Iterator[Removal]:
    """The removals of a tree, from its last link to its first, in the order to make them."""
    for j in reversed(range(len(structure.tree.links))):
        yield from _moved_to_antecedent(structure, j)
        yield from _without_effect(structure, j)
        yield from _rotor(structure, j)


def _moved_to_antecedent(structure: Structure, j: int) -> Iterator[Removal]:
    """What joint j cannot tell from a part of link i, or of the base."""
    link = structure.tree.links[j]
    combinations: list[tuple[str, dict[str, float], dict[str, float]]] = []
    match link.motion:
        case Motion.REVOLUTE:
            combinations = [
                ("YY", {"XX": -1}, {"XX": 1, "YY": 1}),
                ("MZ", {}, {"MZ": 1}),
                ("M", {}, {"M": 1}),
            ]
        case Motion.PRISMATIC:
            combinations = [(name, {}, {name: 1}) for name in _TENSOR]
        case Motion.SPHERICAL:
            combinations = [("M", {}, {"M": 1})]
    if not combinations:
        return
    pose = link.pose()
    if link.motion is Motion.PRISMATIC:
        pose = Pose.turned(pose.R)
    through = lambda_transform(pose) if link.antecedent >= 0 else None
    for name, own, moved in combinations:
        effects: dict[Key, SX] = {(j, kind): SX(x) for kind, x in own.items()}
        if through is not None:
            column = sum((x * _column(through, kind) for kind, x in moved.items()), SX(0))
            effects |= on_link(link.antecedent, column)
        yield Removal((j, name), effects)


def _without_effect(structure: Structure, j: int) -> Iterator[Removal]:
    match structure.tree.links[j].motion:
        case Motion.REVOLUTE:
            yield from _revolute(structure, j)
        case Motion.PRISMATIC:
            yield from _prismatic(structure, j)
        case Motion.SPHERICAL:
            yield from _spherical(structure, j)


def _revolute(structure: Structure, j: int) -> Iterator[Removal]:
    """A link that turns about one direction shows ZZ alone; on a resting axis no moments."""
    if structure.one_direction([*structure.before(j), j]):
        yield from _nothing(j, ("XX", "XY", "XZ", "YZ"))
    if _on_line(structure, j):
        yield from _nothing(j, ("MX", "MY"))
    elif structure.weightless:
        yield from _about_resting_point(structure, j)


def _on_line(structure: Structure, j: int) -> bool:
    """Whether axis j is a line at rest, along gravity or without it."""
    before = structure.before(j)
    return (
        structure.gravity_along(j)
        and structure.one_direction(before)
        and all(structure.coaxial(j, k) for k in structure.turning(before))
        and all(structure.parallel(j, k) for k in structure.sliding(before))
    )


def _about_resting_point(structure: Structure, j: int) -> Iterator[Removal]:
    """Without gravity the moments about a point at rest on axis j have no effect."""
    height = resting_height(structure, j)
    if height is None:
        return
    at_point = lambda_transform(Pose.moved(height * _Z))
    for name in ("MX", "MY"):
        effects = on_link(j, -_column(at_point, name))
        yield Removal((j, name), {key: x for key, x in effects.items() if key != (j, name)})


def _prismatic(structure: Structure, j: int) -> Iterator[Removal]:
    """Behind a prismatic joint moments count only where something before it turns."""
    before = structure.before(j)
    turning = structure.turning(before)
    if structure.rests(before):
        yield from _nothing(j, _MOMENTS)
    elif structure.one_direction(before) and structure.parallel(turning[0], j):
        through = lambda_transform(structure.tree.links[j].pose())
        for name in ("MX", "MY"):
            antecedent = structure.tree.links[j].antecedent
            yield Removal((j, name), on_link(antecedent, _column(through, name)))
        yield from _nothing(j, ("MZ",))
    elif structure.one_direction(before):
        yield _moments_across(structure, turning[0], j)


def _moments_across(structure: Structure, first: int, j: int) -> Removal:
    """Moments along the only direction of turning have no effect.

    With (ax, ay, az) that direction in frame j: ax MX + ay MY + az MZ is the moment that leaves,
    by its last parameter whose factor is zero for no value of the symbols.
    """
    axis = structure.seen_from_link(first, j).R[:, 2]
    sizes = np.abs(structure.axes_in(first, j))
    least, most = np.min(sizes, axis=0), np.max(sizes, axis=0)
    leaving = max(k for k in range(3) if least[k] > _LEAST)
    others = (k for k in range(3) if k != leaving and most[k] > _LEAST)
    effects = {(j, _MOMENTS[k]): -axis[k] / axis[leaving] for k in others}
    return Removal((j, _MOMENTS[leaving]), effects)


def _spherical(structure: Structure, j: int) -> Iterator[Removal]:
    """Without gravity the moments about a centre at rest have no effect."""
    if structure.weightless and structure.point_rests(j, structure.origins[:, j]):
        yield from _nothing(j, _MOMENTS)


def _rotor(structure: Structure, j: int) -> Iterator[Removal]:
    """The rotor of a joint, where it has the effect of some parameters of the link."""
    effects, rotor = _rotor_effects(structure, j), structure.tree.links[j].rotor
    if effects is not None:
        yield Removal((j, "Ia"), effects)
    if rotor is not None and rotor.carrier < 0 and not structure.base_moves:
        same = {(j, "Ia"): SX(1)} if effects is None else effects
        scale = rotor.ratio**2
        yield Removal((j, "Jm"), {key: scale * x for key, x in same.items()})


def _rotor_effects(structure: Structure, j: int) -> Effects | None:
    """What has the effect of Ia; None when nothing has."""
    link = structure.tree.links[j]
    match link.motion:
        case Motion.REVOLUTE if _turns_alone(structure, j):
            return {(j, "ZZ"): SX(1)}
        case Motion.SPHERICAL if structure.rests(structure.before(j)):
            return {(j, name): SX(1) for name in ("XX", "YY", "ZZ")}
        case Motion.PRISMATIC if _slides_alone(structure, j):
            return {(j, "M"): SX(1), **_mass_before(link)}
    return None


def _turns_alone(structure: Structure, j: int) -> bool:
    """Whether the angular velocity of link j along its axis is that of its joint."""
    before = structure.before(j)
    turning = structure.turning(before)
    across = all(structure.perpendicular(k, j) for k in turning)
    return structure.rests(before) or (structure.one_direction(before) and across)


def _slides_alone(structure: Structure, j: int) -> bool:
    """Whether the velocity of link j along its axis is that of its joint, and weighs nothing."""
    before = structure.before(j)
    return (
        structure.gravity_across(j)
        and structure.one_direction(before)
        and all(structure.parallel(k, j) for k in structure.turning(before))
        and all(structure.perpendicular(k, j) for k in structure.sliding(before))
    )


def _mass_before(link: Link) -> dict[Key, SX]:
    """A mass at the origin of frame j that is fixed on link i, taken away."""
    if link.antecedent < 0:
        return {}
    through = lambda_transform(link.pose())
    return on_link(link.antecedent, -_column(through, "M"))


def _column(through: SX, name: str) -> SX:
    return through[:, TEN_PARAMETERS.index(name)]


def on_link(link: int, column: SX) -> dict[Key, SX]:
    """The parameters (10, 1) of a body fixed on a link, those that are zero left out."""
    pairs = zip(TEN_PARAMETERS, elements(column), strict=True)
    return {(link, name): x for name, x in pairs if not x.is_zero()}


def _nothing(j: int, names: Iterable[str]) -> Iterator[Removal]:
    yield from (Removal((j, name), {}) for name in names)
