"""The connection graph of a system: which bodies there are, and which joints join them."""

from __future__ import annotations

from dataclasses import dataclass

from mbs.assembly import System

_KINDS = {
    "pointonline": "point on line",
    "pointonplane": "point on plane",
    "rollingdisc": "rolling disc",
    "constantvelocity": "constant velocity",
}
_MOST_NAMES = 3


@dataclass(frozen=True, slots=True)
class ConnectionNode:
    """A rigid link: its number, 0 for the base, and the names of its bodies, a line each."""

    number: int
    lines: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class ConnectionEdge:
    """A joint or constraint.

    Attributes:
        name: of the joint.
        kind: in words.
        driven: whether a motor moves it.
        cut: whether it closes a loop.
        ends: numbers of the links that it joins; in the tree the one nearer to the base first.
    """

    name: str
    kind: str
    driven: bool
    cut: bool
    ends: tuple[int, int]


@dataclass(frozen=True, slots=True)
class Connections:
    """A spanning tree of links, and the joints that were cut.

    Attributes:
        nodes: by number of the link.
        children: for each link the joints of the tree that lead away from the base.
        cuts: the joints that close loops.
        remarks: couplings of coordinates, in sentences.
    """

    nodes: dict[int, ConnectionNode]
    children: dict[int, tuple[ConnectionEdge, ...]]
    cuts: tuple[ConnectionEdge, ...]
    remarks: tuple[str, ...]


def connections(system: System) -> Connections:
    """The graph of a system; welds join nothing, since what they hold is one link."""
    edges = [_edge(system, k) for k, row in enumerate(system.joints) if row.part is None]
    edges = [edge for edge in edges if edge.ends[0] != edge.ends[1]]
    numbers = sorted({0, *(end for edge in edges for end in edge.ends)})
    children: dict[int, tuple[ConnectionEdge, ...]] = dict.fromkeys(numbers, ())
    reached, waiting = {0}, [0]
    for here in waiting:
        for edge in edges:
            if here in edge.ends and not edge.cut:
                there = sum(edge.ends) - here
                if there not in reached:
                    turned = ConnectionEdge(edge.name, edge.kind, edge.driven, False, (here, there))
                    children[here] += (turned,)
                    reached.add(there)
                    waiting.append(there)
    nodes = {number: ConnectionNode(number, _names(system, number)) for number in numbers}
    return Connections(nodes, children, tuple(e for e in edges if e.cut), _remarks(system))


def _edge(system: System, k: int) -> ConnectionEdge:
    row = system.joints[k]
    speeds = (*system.speeds, *system.cut_coordinates)
    driven = any(speed.actuated for speed in speeds if speed.joint == row.name)
    ends = row.frame_a[0] + 1, row.frame_b[0] + 1
    return ConnectionEdge(row.name, _KINDS.get(row.kind, row.kind), driven, row.cut, ends)


def _names(system: System, number: int) -> tuple[str, ...]:
    if number == 0:
        return ("base",)
    names = [body.name for body in system.bodies if body.link == number]
    if len(names) > _MOST_NAMES:
        names = [*names[: _MOST_NAMES - 1], f"and {len(names) - _MOST_NAMES + 1} more"]
    return tuple(names) or (f"link {number}",)


def _remarks(system: System) -> tuple[str, ...]:
    return tuple(
        f"{loop.name}: {' follows '.join(loop.joints)}"
        for loop in system.loops
        if loop.closing == "coupling"
    )
