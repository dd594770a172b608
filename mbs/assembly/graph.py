"""Connection graph: rigid bodies as nodes, joints as edges, spanning tree and cut joints."""

from __future__ import annotations

import heapq
import math
from collections import deque
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import casadi
import numpy as np
from casadi import SX

from mbs.components import Component, Description, Fixed, Joint, Point, RigidBody
from mbs.components.component import KhalilStep
from mbs.components.couplings import Transmission
from mbs.errors import AssemblyError
from mbs.spatial import Inertia, Khalil, MatrixRotation, Pose

_SAME_POSE = 1e-8
"""Largest distance [m] or angle [rad] between two paths of welds to one body: angles in files have
nine digits, and any clearance is much larger."""

Port = tuple[str, str]
"""Name of a component and its frame: "" of a body, "a" or "b" of a joint."""


@dataclass(frozen=True, slots=True, eq=False)
class BodyNode:
    """A rigid body: bodies and joint frames that are welded together.

    Attributes:
        name: name of the body whose reference frame is the frame of the node.
        members: pose of every body and joint frame in the frame of the node.
    """

    name: str
    members: Mapping[Port, Pose]


@dataclass(frozen=True, slots=True, eq=False)
class JointEdge:
    """A joint between two nodes.

    Attributes:
        joint: description of the joint.
        a, b: indices of the nodes that carry its frame_a and frame_b.
        pose_a, pose_b: poses of frame_a and frame_b in the frames of the nodes.
        khalil: Khalil parameters of frame_a, if it is described by them.
    """

    joint: Joint
    a: int
    b: int
    pose_a: Pose
    pose_b: Pose
    khalil: Khalil | None


@dataclass(frozen=True, slots=True, eq=False)
class BodyGraph:
    """Rigid bodies and the joints between them; node 0 contains the world.

    Attributes:
        nodes: rigid bodies.
        edges: joints.
        size: largest distance between joints on a moving body, or on the world if it is zero [m].
    """

    nodes: tuple[BodyNode, ...]
    edges: tuple[JointEdge, ...]
    size: float


def connection_graph(
    mechanism: Description, symbols: Mapping[str, SX], values: Mapping[str, float]
) -> BodyGraph:
    """Return the connection graph of a mechanism.

    Args:
        mechanism: components and connections.
        symbols: CasADi symbol of every parameter.
        values: value of every parameter, for the comparison of positions.

    Raises:
        AssemblyError: a component is not connected, or welds contradict each other.
    """
    joints = {joint.name for joint in mechanism.joints() if not is_weld(mechanism, joint)}
    if not joints:
        raise AssemblyError(
            f"{mechanism.name}: there is no joint that moves; connect bodies by joints"
        )
    _check_transmissions(mechanism)
    welds = _welds(mechanism, symbols)
    _require_connected(mechanism, welds)
    at = _Evaluator(symbols, values)
    nodes: list[BodyNode] = []
    home: dict[Port, int] = {}
    for port in _ports(mechanism):
        if port not in home:
            members = _welded_to(port, welds, at)
            home.update(dict.fromkeys(members, len(nodes)))
            nodes.append(BodyNode(port[0], members))
    edges = tuple(
        _edge(mechanism, joint, nodes, home, symbols)
        for joint in mechanism.joints()
        if joint.name in joints
    )
    return BodyGraph(tuple(nodes), edges, _size(len(nodes), edges, at))


def _check_transmissions(mechanism: Description) -> None:
    """Raise AssemblyError if a gear, rack or screw couples coordinates of the wrong kinds."""
    motions = {
        freedom.coordinate_of(joint.name): freedom.motion
        for joint in mechanism.joints()
        for freedom in joint.freedoms
    }
    for coupling in mechanism.couplings():
        if isinstance(coupling, Transmission):
            roles = zip(("driven", "driver"), coupling.kinds, strict=True)
            for role, kind in roles:
                name = getattr(coupling, role)
                if motions.get(name, kind) is not kind:
                    raise AssemblyError(
                        f"{mechanism.name}: the {role} coordinate of {type(coupling).__name__}"
                        f" {coupling.name!r} must be {kind.value}, but {name!r} is"
                        f" {motions[name].value}; name another coordinate"
                    )


def inertia_of(node: BodyNode, mechanism: Description, symbols: Mapping[str, SX]) -> Inertia:
    """Return the inertia of all bodies of a node about the origin of its frame, in its axes.

    Args:
        node: rigid body of the graph.
        mechanism: components of the bodies.
        symbols: CasADi symbol of every parameter.
    """
    total = Inertia.zero()
    for (name, _), pose in node.members.items():
        component = mechanism.components[name]
        if isinstance(component, RigidBody):
            total = total + component.inertial(symbols).seen_from(MatrixRotation(pose.R), pose.p)
    return total


def is_weld(mechanism: Description, joint: Joint) -> bool:
    """Whether a joint welds its two bodies into one rigid body: a Fixed joint that is not cut.

    Args:
        mechanism: mechanism with the joint.
        joint: any joint.
    """
    return isinstance(joint, Fixed) and joint.name not in mechanism.cuts


def _ports(mechanism: Description) -> Iterator[Port]:
    """Yield the ports of the world, of all bodies and of both sides of all joints."""
    yield mechanism.world.name, ""
    yield from ((body.name, "") for body in mechanism.bodies())
    for joint in mechanism.joints():
        yield joint.name, "a"
        yield joint.name, "b"


Weld = tuple[Port, Pose, Point]


def _welds(
    mechanism: Description, symbols: Mapping[str, SX]
) -> dict[Port, list[tuple[Port, Pose]]]:
    """Return for each port the ports welded to it and their relative poses."""
    welds: dict[Port, list[tuple[Port, Pose]]] = {port: [] for port in _ports(mechanism)}

    def weld(a: Port, b: Port, pose: Pose) -> None:
        welds[a].append((b, pose))
        welds[b].append((a, pose.inverse()))

    for a, b in mechanism.connections:
        pose = a.placement.pose(symbols) @ b.placement.pose(symbols).inverse()
        weld((a.owner.name, a.port), (b.owner.name, b.port), pose)
    for joint in mechanism.joints():
        if is_weld(mechanism, joint):
            weld((joint.name, "a"), (joint.name, "b"), Pose.identity())
    return welds


def _require_connected(
    mechanism: Description, welds: Mapping[Port, list[tuple[Port, Pose]]]
) -> None:
    """Raise AssemblyError if a body or a joint frame has no connection.

    `welds` are the welded ports of each port.
    """
    for (name, side), neighbours in welds.items():
        if not neighbours and name != mechanism.world.name:
            component: Component = mechanism.components[name]
            what = f"frame_{side} of joint {name!r}" if side else f"{name!r}"
            raise AssemblyError(
                f"{mechanism.name}: {what} is connected to nothing; "
                + ("connect it" if isinstance(component, Joint) else "connect it or leave it out")
            )


def _welded_to(
    start: Port,
    welds: Mapping[Port, list[tuple[Port, Pose]]],
    at: _Evaluator,
) -> dict[Port, Pose]:
    """Return every port that is welded to `start`, with its pose relative to `start`.

    Raises AssemblyError if two paths of welds give different poses.

    `welds` lists the welded ports of each port; `at` evaluates expressions.
    """
    members = {start: Pose.identity()}
    queue = deque([start])
    while queue:
        port = queue.popleft()
        for neighbour, pose in welds[port]:
            place = members[port] @ pose
            if neighbour not in members:
                members[neighbour] = place
                queue.append(neighbour)
            else:
                _require_same_place(neighbour, members[neighbour], place, at)
    return members


class _Evaluator:
    """Callable from an expression to its numeric value at fixed values of the parameters."""

    def __init__(self, symbols: Mapping[str, SX], values: Mapping[str, float]) -> None:
        """Prepare evaluation at `values` by name of the parameters in `symbols`."""
        self.p = casadi.vertcat(*symbols.values()) if symbols else SX(0, 1)
        self.values = [values[name] for name in symbols]

    def __call__(self, value: SX) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
        """Return the numeric value of an expression, as an array of its shape."""
        if not casadi.symvar(value):
            return np.array(casadi.DM(value))
        return np.array(casadi.Function("f", [self.p], [value])(self.values))


def _require_same_place(port: Port, first: Pose, second: Pose, at: _Evaluator) -> None:
    """Raise AssemblyError if two paths of welds give different poses of a port.

    `first` and `second` are the two poses, `at` evaluates expressions.
    """
    difference = at(first.matrix - second.matrix)
    gap = float(np.linalg.norm(difference[:3, 3]))
    chord = float(np.linalg.norm(difference[:3, :3])) / (2 * np.sqrt(2))
    angle = 2 * np.arcsin(min(1.0, chord))
    if max(gap, angle) > _SAME_POSE:
        raise AssemblyError(
            f"{port[0]!r} is welded at two places that differ by {gap:.3g} m and {angle:.3g} rad;"
            " take one of the welds away"
        )


def _edge(
    mechanism: Description,
    joint: Joint,
    nodes: list[BodyNode],
    home: Mapping[Port, int],
    symbols: Mapping[str, SX],
) -> JointEdge:
    """Return the edge of a joint between two nodes.

    `home` maps ports to node indices. Raises AssemblyError if both sides are on one node.
    """
    a, b = home[joint.name, "a"], home[joint.name, "b"]
    if a == b:
        raise AssemblyError(
            f"{mechanism.name}: joint {joint.name!r} connects {nodes[a].name!r} to itself;"
            " connect it to two bodies"
        )
    return JointEdge(
        joint,
        a,
        b,
        nodes[a].members[joint.name, "a"],
        nodes[b].members[joint.name, "b"],
        _given_khalil(mechanism, joint, nodes[a], symbols),
    )


def _size(nodes: int, edges: Sequence[JointEdge], at: _Evaluator) -> float:
    """Return the largest distance between two joints of one body [m]; 1 if there is none.

    `nodes` is the number of bodies, `edges` the joints between them, and `at` evaluates
    expressions.
    """
    points = at(casadi.horzcat(SX(3, 0), *(p for e in edges for p in (e.pose_a.p, e.pose_b.p))))
    on: list[list[Any]] = [[] for _ in range(nodes)]
    for number, edge in enumerate(edges):
        on[edge.a].append(points[:, 2 * number])
        on[edge.b].append(points[:, 2 * number + 1])

    def spread(points: Sequence[Any]) -> float:
        gaps = (math.hypot(*(p - q)) for k, p in enumerate(points) for q in points[:k])
        return max(gaps, default=0.0)

    return max(map(spread, on[1:]), default=0.0) or spread(on[0]) or 1.0


def _given_khalil(
    mechanism: Description, joint: Joint, node: BodyNode, symbols: Mapping[str, SX]
) -> Khalil | None:
    """Return Khalil parameters of frame_a relative to its node; None if described otherwise.

    `node` is the rigid group of bodies that carries frame_a.
    """
    for a, b in mechanism.connections:
        if b.owner is joint and b.port == "a" and not b.placement.steps:
            steps = a.placement.steps
            on_frame = node.members[a.owner.name, a.port].is_identity()
            if on_frame and len(steps) == 1 and isinstance(steps[0], KhalilStep):
                return steps[0].khalil(symbols)
    return None


# Spanning tree and cut joints.


@dataclass(frozen=True, slots=True, eq=False)
class Branch:
    """A joint of the tree, traversed from the node nearer to the base.

    Attributes:
        edge: the joint.
        parent, child: indices of the nodes on the base side and on the other side. The child is -1
            for the free end of a joint that stays in the tree although it closes a loop.
        forward: Whether frame_a is on the side of the base.
    """

    edge: JointEdge
    parent: int
    child: int
    forward: bool


@dataclass(frozen=True, slots=True, eq=False)
class SpanningTree:
    """Branches in the order of the link numbers, and the joints that close loops."""

    branches: tuple[Branch, ...]
    cuts: tuple[JointEdge, ...]


def spanning_tree(
    name: str,
    graph: BodyGraph,
    *,
    need: Collection[str] = (),
    keep: Collection[str] = (),
    cut: Collection[str] = (),
    given_order: bool = False,
) -> SpanningTree:
    """Return a shallow spanning tree that keeps driven joints and cuts the freest passive joints.

    Prim's algorithm from the world. Among the joints that reach a new body, the joint that is least
    useful as a cut has priority, then the joint with the fewest freedoms, then the joint nearest to
    the base, which keeps loops short. Least useful as cuts are passive joints whose coordinates
    couplings or forces refer to, then driven or guessed joints, then other joints. A driven joint
    that is cut keeps its coordinate. Constraints, which have no coordinates, are always cut.

    Args:
        name: name of the mechanism, for error messages.
        graph: nodes and joints.
        need: names of joints whose coordinates couplings and forces refer to.
        keep: names of joints with a guessed position.
        cut: names of joints that the description cuts.
        given_order: Whether links are numbered in the order of the joints instead of depth-first.

    Raises:
        AssemblyError: a body cannot be reached from the world, or only by a joint to be cut.
    """
    chosen = _prim(graph, set(need), set(keep), set(cut))
    reached = {0} | {edge.a for edge in chosen} | {edge.b for edge in chosen}
    for number in range(len(graph.nodes)):
        if number not in reached:
            raise AssemblyError(_describe_unreached(name, graph, number))
    for edge in chosen:
        if edge.joint.name in cut:
            raise AssemblyError(
                f"{name}: joint {edge.joint.name!r} cannot be cut, since nothing else connects what"
                " it carries to the world; take this cut away"
            )
    cuts = tuple(edge for edge in graph.edges if edge not in chosen)
    branches = _depth_first(graph, chosen)
    if given_order:
        branches = _in_given_order(graph, branches)
    return SpanningTree(tuple(branches), cuts)


def _describe_unreached(name: str, graph: BodyGraph, number: int) -> str:
    """Return the error text for a node `number` without a path to the world, in system `name`."""
    holders = [e.joint for e in graph.edges if number in (e.a, e.b) and not e.joint.places]
    where = f"{name}: no chain of joints leads from the world to {graph.nodes[number].name!r}"
    if holders:
        joint = holders[0]
        return (
            f"{where}: {type(joint).__name__} {joint.name!r} constrains it but does not place it;"
            " connect it to the world by a Free joint, too"
        )
    return f"{where}; connect it, or connect it to the world by a Free joint"


def _prim(graph: BodyGraph, need: set[str], keep: set[str], cut: set[str]) -> list[JointEdge]:
    """Return the joints of a spanning tree by Prim's algorithm; see `spanning_tree`.

    `need`, `keep` and `cut` are names of joints.
    """
    depth = {0: 0}
    chosen: list[JointEdge] = []
    queue: list[tuple[tuple[bool, int, int, int, int], int]] = []

    def offer(node: int) -> None:
        for number, edge in enumerate(graph.edges):
            joint = edge.joint
            if joint.places and node in (edge.a, edge.b):
                driven = joint.carries_effort
                chosen = driven or joint.name in need or joint.name in keep
                rank = 0 if joint.name in need and not driven else 1 if chosen else 2
                key = (joint.name in cut, rank, joint.nv, depth[node], number)
                heapq.heappush(queue, (key, number))

    offer(0)
    while queue:
        _, number = heapq.heappop(queue)
        edge = graph.edges[number]
        new = [node for node in (edge.a, edge.b) if node not in depth]
        if new:
            (node,) = new
            depth[node] = 1 + min(depth[n] for n in (edge.a, edge.b) if n in depth)
            chosen.append(edge)
            offer(node)
    return chosen


def _depth_first(graph: BodyGraph, chosen: list[JointEdge]) -> list[Branch]:
    """Return the joints of a tree as branches in depth-first order from the world.

    `chosen` are the joints of the tree.
    """
    branches: list[Branch] = []
    rank = {id(edge): number for number, edge in enumerate(graph.edges)}
    ordered = sorted(chosen, key=lambda edge: rank[id(edge)])
    seen = {0}
    stack = [iter(_branches_from(0, ordered))]
    while stack:
        branch = next(stack[-1], None)
        if branch is None:
            stack.pop()
        elif branch.child not in seen:
            seen.add(branch.child)
            branches.append(branch)
            stack.append(iter(_branches_from(branch.child, ordered)))
    return branches


def _branches_from(node: int, edges: list[JointEdge]) -> list[Branch]:
    """Return the joints at a node as branches that start at it."""
    return [
        Branch(edge, node, edge.b if edge.a == node else edge.a, edge.a == node)
        for edge in edges
        if node in (edge.a, edge.b)
    ]


def _in_given_order(graph: BodyGraph, branches: list[Branch]) -> list[Branch]:
    """Return the branches in the order of their joints, as far as antecedents allow."""
    rank = {edge.joint.name: number for number, edge in enumerate(graph.edges)}
    waiting = sorted(branches, key=lambda branch: rank[branch.edge.joint.name])
    reached, ordered = {0}, []
    while waiting:
        branch = next(b for b in waiting if b.parent in reached)
        waiting.remove(branch)
        reached.add(branch.child)
        ordered.append(branch)
    return ordered
