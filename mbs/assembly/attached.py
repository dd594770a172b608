"""What acts on the tree and constrains nothing: force elements on points and on coordinates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from casadi import SX

from mbs.assembly.tables import Coordinate, Places
from mbs.components import Component, ForceElement, Mechanism, Point
from mbs.components.forces import CoordinateForce
from mbs.errors import AssemblyError
from mbs.expressions import to_sx
from mbs.messages import did_you_mean
from mbs.spatial import Pose

_Rows = Sequence[Coordinate]


@dataclass(frozen=True, slots=True, eq=False)
class Lever:
    """How much of a coordinate an element acts on.

    Attributes:
        position: number in q of the coordinate, None where it is no position.
        velocity: number in v of the coordinate.
        factor: what a unit of the coordinate contributes.
    """

    position: int | None
    velocity: int
    factor: SX


@dataclass(frozen=True, slots=True, eq=False)
class AttachedForce:
    """A force element and where it acts.

    Attributes:
        element: its description.
        frames: link (-1 for the base) and pose in the link's frame, of each of its points.
        levers: the coordinates that it acts on; none where it acts on points.
        symbols: CasADi symbol of every parameter.
        where: the components that it acts on, in words.
    """

    element: ForceElement
    frames: tuple[tuple[int, Pose], ...]
    levers: tuple[Lever, ...]
    symbols: Mapping[str, SX]
    where: str

    @property
    def sentence(self) -> str:
        """What it is and where it acts."""
        kind, name = type(self.element).__name__, self.element.name
        return f"{kind} {name} acts {self.where}{self.element.scope}."


def force_elements(mechanism: Mechanism) -> list[ForceElement]:
    """Every spring, damper and so on, in the order added."""
    return [c for c in mechanism.components.values() if isinstance(c, ForceElement)]


def attached_forces(
    mechanism: Mechanism,
    places: Places,
    tables: tuple[_Rows, ...],
    symbols: Mapping[str, SX],
) -> tuple[AttachedForce, ...]:
    """Every force element with the links of its points, or the numbers of its coordinates.

    Args:
        mechanism: the components.
        places: where bodies and joints are.
        tables: the coordinates of q, of v, and of cut joints.
        symbols: CasADi symbol of every parameter.

    Raises:
        AssemblyError: one acts on nothing that is there, or on nothing that moves.
    """
    forces = force_elements(mechanism)
    return tuple(_attached(mechanism, force, places, tables, symbols) for force in forces)


def _attached(
    mechanism: Mechanism,
    force: ForceElement,
    places: Places,
    tables: tuple[_Rows, ...],
    symbols: Mapping[str, SX],
) -> AttachedForce:
    if isinstance(force, CoordinateForce):
        levers = tuple(
            Lever(*_coordinate_of(force, name, *tables), to_sx(factor, symbols))
            for name, factor in force.levers
        )
        return AttachedForce(force, (), levers, symbols, _where([n for n, _ in force.levers]))
    frames = []
    for point in force.points:
        require_part(mechanism, force, point, "acts on")
        link, pose = places[point.owner.name, point.port]
        frames.append((link, pose @ point.placement.pose(symbols)))
    links, names = {link for link, _ in frames}, [point.owner.name for point in force.points]
    if links == {-1} or (len(links) == 1 and len(frames) > 1):
        still = "does not move" if links == {-1} else "is one rigid body"
        raise AssemblyError(
            f"{force.name}: what it acts on, {' and '.join(names)}, {still}, so that the"
            f" {type(force).__name__} does nothing; let it act on another body"
        )
    return AttachedForce(force, tuple(frames), (), symbols, _where(names))


def _where(names: Sequence[str]) -> str:
    return f"between {' and '.join(names)}" if len(names) > 1 else f"on {names[0]}"


def require_part(mechanism: Mechanism, component: Component, point: Point, does: str) -> None:
    """Refuse a point of something that is not in the mechanism.

    Raises:
        AssemblyError: what the component does, such as "acts on", it does to a stranger.
    """
    known, is_nested = mechanism.components.get(point.owner.name), type(point.owner) is Component
    if known is None or not (is_nested or known is point.owner):
        raise AssemblyError(
            f"{component.name}: it {does} {point.owner.name!r}, which is not part of"
            f" {mechanism.name}; add that component, or take a point of one that is in it"
        )


def _coordinate_of(
    force: CoordinateForce, name: str, coordinates: _Rows, speeds: _Rows, cut: _Rows
) -> tuple[int | None, int]:
    """Where a coordinate of a force stands in q and in v."""
    q, v = ([row.name for row in table] for table in (coordinates, speeds))
    known = [speed for speed in v if speed in q or not force.needs_position]
    if name not in known and name in [coordinate.name for coordinate in cut]:
        raise AssemblyError(
            f"{force.name}: the joint of {name!r} is cut to open a loop, so that a"
            f" {type(force).__name__} cannot act on it; give that joint some friction Fv of its"
            " own, which keeps it in the tree"
        )
    if name not in known:
        raise AssemblyError(
            f"{force.name}: there is no coordinate {name!r} in the tree that a"
            f" {type(force).__name__} can act on; {did_you_mean(name, known)}"
        )
    return (q.index(name) if name in q else None), v.index(name)
