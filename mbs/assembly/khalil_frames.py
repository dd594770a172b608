"""Links and their frames: every joint axis becomes the z axis of a Khalil frame.

The pose between two consecutive axes is decomposed into gamma, b, alpha, d, theta, r. Since
Rz(gamma) Tz(b) commutes with the motion of the joint before, the gamma and b of the first joint on
a link are moved into theta and r of the link itself: frame j then sits where the classical
notation puts it, with x along the common perpendicular to the next axis. Frames that a table gave
stay as they were given.

Source: Khalil & Kleinfinger 1986, section 2.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import casadi
import numpy as np
from casadi import DM, SX

from mbs.assembly.graph import Edge, Graph, inertia_of
from mbs.assembly.spanning_tree import Branch, SpanningTree
from mbs.assembly.tree import CarriedRotor, Frame, Link, Tree
from mbs.components import Mechanism
from mbs.components.motion import Freedom, Motion
from mbs.expressions import to_sx
from mbs.spatial import Inertia, Khalil, MatrixTurn, Pose, align_z, snapped

_FLIP = Pose.turned(SX(DM([[1, 0, 0], [0, -1, 0], [0, 0, -1]])))
_EFFORTS = ("Ia", "Fv", "Fs", "Fs_width", "stiffness", "rest")
"""What acts on the velocity and position of every freedom of a joint."""

_ALONG_Z = (Motion.REVOLUTE, Motion.PRISMATIC)


@dataclass(frozen=True, slots=True, eq=False)
class Cut:
    """A joint that was cut, and where its two frames are.

    Attributes:
        edge: the joint.
        link_a, link_b: links that carry frame_a and frame_b (-1 for the base).
        pose_a, pose_b: these frames in the frames of the links.
        welded: the joint itself stayed in the tree, and its free end is welded instead.
    """

    edge: Edge
    link_a: int
    link_b: int
    pose_a: Pose
    pose_b: Pose
    welded: bool

    @property
    def frames(self) -> tuple[Frame, Frame]:
        """Frame_a and frame_b."""
        return (self.link_a, self.pose_a), (self.link_b, self.pose_b)


@dataclass(frozen=True, slots=True, eq=False)
class Framed:
    """A tree with its cuts, and where every node of the graph went.

    Attributes:
        tree: links with frames and inertias.
        joints: for each link, the name of the joint that moves it.
        cuts: the cut joints.
        homes: for each node its link (-1 for the base) and the pose of its frame in the link's.
    """

    tree: Tree
    joints: tuple[str, ...]
    cuts: tuple[Cut, ...]
    homes: tuple[tuple[int, Pose], ...]


@dataclass(slots=True)
class _Draft:
    """A link whose frame may still slide and turn about its axis."""

    name: str
    joint: str
    antecedent: int
    motion: Motion
    placement: Khalil
    edge: Edge
    fixed_frame: bool = False
    nodes: dict[int, Pose] = field(default_factory=dict)


def khalil_frames(
    mechanism: Mechanism, graph: Graph, spanning: SpanningTree, symbols: Mapping[str, SX]
) -> Framed:
    """Number the links, place their frames and gather their inertias.

    Args:
        mechanism: the components.
        graph: bodies and joints.
        spanning: which joints are in the tree, in which order.
        symbols: CasADi symbol of every parameter.
    """
    drafts: list[_Draft] = []
    home: dict[int, int] = {0: -1}
    base = {0: Pose.identity()}
    stubs: dict[int, int] = {}
    for branch in (*spanning.branches, *_kept(spanning)):
        last, pose = _extend(drafts, base, home[branch.parent], branch)
        if branch.child < 0:
            stubs[id(branch.edge)] = last
            drafts[last].nodes[-1] = pose
        else:
            home[branch.child] = last
            drafts[last].nodes[branch.child] = pose

    def place(node: int) -> tuple[int, Pose]:
        link = home[node]
        return link, (base if link < 0 else drafts[link].nodes)[node]

    cuts = []
    for edge in spanning.cuts:
        link_b, pose_b = place(edge.b)
        link_a, pose_a = place(edge.a)
        stub = stubs.get(id(edge))
        if stub is not None:
            pose = drafts[stub].nodes[-1]
            cuts.append(Cut(edge, stub, link_b, pose, pose_b @ edge.pose_b, True))
        else:
            cuts.append(
                Cut(edge, link_a, link_b, pose_a @ edge.pose_a, pose_b @ edge.pose_b, False)
            )
    homes = tuple(place(node) for node in range(len(graph.nodes)))
    inertias = [Inertia.zero()] * len(drafts)
    for node, (link, pose) in zip(graph.nodes, homes, strict=True):
        if link >= 0:
            own = inertia_of(node, mechanism, symbols)
            inertias[link] = inertias[link] + own.seen_from(MatrixTurn(pose.R), pose.p)
    gravity = casadi.vertcat(*(to_sx(g, symbols) for g in mechanism.world.gravity))
    rotors = [_rotor(draft.edge, place, symbols) for draft in drafts]
    tree = Tree(_links(drafts, inertias, rotors, symbols), gravity)
    return Framed(tree, tuple(draft.joint for draft in drafts), tuple(cuts), homes)


def _kept(spanning: SpanningTree) -> list[Branch]:
    """Cut joints with a motor, friction or a rotor: they stay, and their free end is welded."""
    return [Branch(edge, edge.a, -1, True) for edge in spanning.cuts if edge.joint.carries_effort]


def _extend(
    drafts: list[_Draft],
    base: dict[int, Pose],
    parent: int,
    branch: Branch,
) -> tuple[int, Pose]:
    """Add the links of one joint; the last of them, and the pose of the child node in it."""
    edge = branch.edge
    near, far = (edge.pose_a, edge.pose_b) if branch.forward else (edge.pose_b, edge.pose_a)
    nodes = base if parent < 0 else drafts[parent].nodes
    here = nodes[branch.parent] @ near
    given = edge.khalil if branch.forward and nodes[branch.parent].is_identity() else None
    freedoms = edge.joint.freedoms if branch.forward else edge.joint.freedoms[::-1]
    for freedom in freedoms:
        aligned = _aligned(freedom, branch.forward)
        if given is not None and aligned.is_identity():
            placement = given
            if parent >= 0:
                drafts[parent].fixed_frame = True
        else:
            placement = _settled(drafts, parent, Khalil.of_pose(here @ aligned))
        drafts.append(
            _Draft(
                freedom.coordinate_of(edge.joint.name),
                edge.joint.name,
                parent,
                freedom.motion,
                placement,
                edge,
                fixed_frame=placement is given,
            )
        )
        parent, here, given = len(drafts) - 1, aligned.inverse(), None
    end = Pose.identity() if branch.child < 0 else far.inverse()
    return parent, here @ end


def _settled(drafts: list[_Draft], parent: int, placement: Khalil) -> Khalil:
    """The placement once gamma and b have moved into the parent's own theta and r."""
    if parent < 0:
        return placement
    draft = drafts[parent]
    if draft.fixed_frame or draft.motion not in _ALONG_Z:
        draft.fixed_frame = True
        return placement
    draft.fixed_frame = True
    shift = Khalil(placement.gamma, placement.b, SX(0), SX(0), SX(0), SX(0)).pose()
    back = shift.inverse()
    draft.placement = draft.placement.turned(placement.gamma).slid(placement.b)
    draft.nodes = {node: back @ pose for node, pose in draft.nodes.items()}
    return Khalil(SX(0), SX(0), placement.alpha, placement.d, placement.theta, placement.r)


def _aligned(freedom: Freedom, forward: bool) -> Pose:
    """The frame with z along the axis of a freedom, reversed when the joint is run backwards."""
    if freedom.motion not in _ALONG_Z:
        return Pose.identity()
    pose = Pose.turned(align_z(np.array(freedom.axis)))
    return pose if forward else pose @ _FLIP


def _rotor(
    edge: Edge, place: Callable[[int], tuple[int, Pose]], symbols: Mapping[str, SX]
) -> CarriedRotor | None:
    """The rotor of a joint on the link that has the joint's frame_a."""
    rotor = edge.joint.rotor
    if rotor is None:
        return None
    link, pose = place(edge.a)
    axis = edge.joint.freedoms[0].axis if rotor.axis is None else rotor.axis
    return CarriedRotor(
        carrier=link,
        axis=snapped(casadi.mtimes((pose @ edge.pose_a).R, SX(DM(list(axis))))),
        inertia=to_sx(rotor.inertia, symbols),
        ratio=to_sx(rotor.ratio, symbols),
    )


def _links(
    drafts: list[_Draft],
    inertias: list[Inertia],
    rotors: list[CarriedRotor | None],
    symbols: Mapping[str, SX],
) -> tuple[Link, ...]:
    links, nq, nv = [], 0, 0
    for draft, inertia, rotor in zip(drafts, inertias, rotors, strict=True):
        motion = draft.motion
        q, v = slice(nq, nq + motion.nq), slice(nv, nv + motion.nv)
        links.append(
            Link(
                name=draft.name,
                antecedent=draft.antecedent,
                motion=motion,
                placement=draft.placement,
                inertia=inertia,
                rotor=rotor,
                q=q,
                v=v,
                **{name: to_sx(getattr(draft.edge.joint, name), symbols) for name in _EFFORTS},
            )
        )
        nq, nv = q.stop, v.stop
    return tuple(links)
