"""The joints of a system: those of the tree, those that were cut, and those that weld."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from casadi import SX

from mbs.assembly.graph import Port, is_weld
from mbs.assembly.khalil_frames import Cut
from mbs.assembly.tables import Places
from mbs.assembly.tree import Frame
from mbs.components import Joint, Mechanism, RigidBody
from mbs.spatial import Inertia, MatrixTurn


@dataclass(frozen=True, slots=True, eq=False)
class WeldedPart:
    """What a Fixed joint holds: the bodies of a link on one side of it.

    Attributes:
        ports: its bodies, by their names and "", and the frames "a" and "b" of joints on it.
        inertia: of its bodies, about the origin of the link's frame and in its axes.
        sign: 1 where it has the frame_b of the joint, -1 where it has frame_a.
    """

    ports: frozenset[Port]
    inertia: Inertia
    sign: int


@dataclass(frozen=True, slots=True, eq=False)
class JointRow:
    """A joint or constraint between two bodies.

    Attributes:
        name: of the joint.
        kind: of joint, in lower case.
        cut: whether it was cut to open a loop.
        frame_a, frame_b: link (-1 for the base) that carries the frame, and pose in the link's.
        part: what a joint that welds two bodies into one link holds, None of all others.
    """

    name: str
    kind: str
    cut: bool
    frame_a: Frame
    frame_b: Frame
    part: WeldedPart | None


def joint_rows(
    mechanism: Mechanism, places: Places, cuts: Sequence[Cut], symbols: Mapping[str, SX]
) -> tuple[JointRow, ...]:
    """Every joint in the order added, without those that close a ring of welds.

    In such a ring rigid bodies do not determine what a joint transmits.

    Args:
        mechanism: the components.
        places: where bodies and joints are.
        cuts: the joints that were cut.
        symbols: CasADi symbol of every parameter.
    """
    cut = {row.edge.joint.name for row in cuts}
    rows = []
    for joint in mechanism.joints():
        part = _part(mechanism, joint, places, symbols) if is_weld(mechanism, joint) else None
        if is_weld(mechanism, joint) and part is None:
            continue
        frames = places[joint.name, "a"], places[joint.name, "b"]
        kind = type(joint).__name__.lower()
        rows.append(JointRow(joint.name, kind, joint.name in cut, *frames, part))
    return tuple(rows)


def _part(
    mechanism: Mechanism, joint: Joint, places: Places, symbols: Mapping[str, SX]
) -> WeldedPart | None:
    """The side of a weld that is not the world; None where both sides are welded elsewhere."""
    sides = {port: _welded(mechanism, joint, port) for port in "ab"}
    if (joint.name, "a") in sides["b"]:
        return None
    side, sign = ("a", -1) if (mechanism.world.name, "") in sides["b"] else ("b", 1)
    inertia = Inertia.zero()
    for name, _ in sides[side]:
        component = mechanism.components[name]
        if isinstance(component, RigidBody):
            pose = places[name, ""][1]
            inertia = inertia + component.inertial(symbols).seen_from(MatrixTurn(pose.R), pose.p)
    return WeldedPart(frozenset(sides[side]), inertia, sign)


def _welded(mechanism: Mechanism, joint: Joint, port: str) -> list[Port]:
    """What is welded to one frame of a joint other than through the joint, in the order found."""
    found: dict[Port, None] = {(joint.name, port): None}
    queue = deque(found)
    while queue:
        here = queue.popleft()
        for there in _neighbours(mechanism, joint, here):
            if there not in found:
                found[there] = None
                queue.append(there)
    return list(found)


def _neighbours(mechanism: Mechanism, without: Joint, port: Port) -> Iterator[Port]:
    for a, b in mechanism.connections:
        ends = (a.owner.name, a.port), (b.owner.name, b.port)
        if port in ends:
            yield ends[0] if port == ends[1] else ends[1]
    joint = mechanism.components[port[0]]
    if isinstance(joint, Joint) and joint.name != without.name and is_weld(mechanism, joint):
        yield joint.name, "b" if port[1] == "a" else "a"
