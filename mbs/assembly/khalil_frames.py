"""Links and their frames: every joint axis becomes the z axis of a Khalil frame.

The pose between two consecutive axes is decomposed into gamma, b, alpha, d, theta, r. Since
Rz(gamma) Tz(b) commutes with the motion of the previous joint, the gamma and b of the first joint
on a link are absorbed into theta and r of the link itself. Frame j is then at its position in the
classical notation, with x along the common perpendicular to the next axis. Frames from a table are
kept. If the common perpendicular is far, or its position depends on a symbol, the frame stays at
the described origin, with fixed frames in between (`spatial.khalil.frames_to`).

Source: Khalil & Kleinfinger 1986, section 2.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import casadi
from casadi import DM, SX

from mbs.assembly.graph import BodyGraph, Branch, JointEdge, SpanningTree, inertia_of
from mbs.assembly.tree import CarriedRotor, Frame, Link, Tree
from mbs.components import Description
from mbs.components.joints import Freedom, Motion
from mbs.expressions import to_sx
from mbs.spatial import Inertia, Khalil, MatrixRotation, Pose, align_z, exact_product, frames_to

_FLIP = Pose.rotation(SX(DM([[1, 0, 0], [0, -1, 0], [0, 0, -1]])))
_EFFORTS = ("Ia", "Fv", "Fs", "Fs_width", "stiffness", "rest")
"""Attributes of a joint that act on the velocity and position of each of its freedoms."""

_ALONG_Z = (Motion.REVOLUTE, Motion.PRISMATIC)


@dataclass(frozen=True, slots=True, eq=False)
class Cut:
    """A cut joint and the positions of its two frames.

    Attributes:
        edge: the joint.
        link_a, link_b: indices of the links that carry frame_a and frame_b (-1 for the base).
        pose_a, pose_b: poses of frame_a and frame_b in the frames of the links.
        welded: Whether the joint itself stays in the tree, with its free end welded.
    """

    edge: JointEdge
    link_a: int
    link_b: int
    pose_a: Pose
    pose_b: Pose
    welded: bool

    @property
    def frames(self) -> tuple[Frame, Frame]:
        """Link and pose of frame_a and of frame_b."""
        return (self.link_a, self.pose_a), (self.link_b, self.pose_b)


@dataclass(frozen=True, slots=True, eq=False)
class KhalilTree:
    """A tree with its cuts, and the link of every node of the graph.

    Attributes:
        tree: links with frames and inertias.
        joints: name of the joint of each link.
        cuts: cut joints.
        homes: link (-1 for the base) of each node, and pose of its frame in the link's frame.
    """

    tree: Tree
    joints: tuple[str, ...]
    cuts: tuple[Cut, ...]
    homes: tuple[tuple[int, Pose], ...]


@dataclass(frozen=True, slots=True, eq=False)
class _DescribedLink:
    """A link as described, before its frame is chosen.

    Attributes:
        name: name of the motion.
        joint: name of the joint.
        antecedent: index of the antecedent link, -1 for the base.
        motion: motion of the link; along or about z for prismatic and revolute motions.
        backward: see `Link`.
        pose: frame of the motion at zero relative to the frame of the antecedent's motion, both as
            described.
        given: Khalil parameters of the pose, if it is described by them.
        edge: the joint.
        nodes: pose of every node on the link, and of the free end of a cut joint (-1), in the frame
            of the motion.
    """

    name: str
    joint: str
    antecedent: int
    motion: Motion
    backward: bool
    pose: Pose
    given: Khalil | None
    edge: JointEdge
    nodes: dict[int, Pose] = field(default_factory=dict)


@dataclass(slots=True)
class _Chosen:
    """The chosen frame of a link, on the axis of its joint.

    Attributes:
        via, placement: successive frames from the antecedent to the chosen frame.
        shift: chosen frame relative to the described frame of the motion: a rotation about and a
            translation along the axis of the joint.
        settled: Whether the frame is final.
    """

    via: tuple[Khalil, ...]
    placement: Khalil
    shift: Pose
    settled: bool


def khalil_frames(
    mechanism: Description, graph: BodyGraph, spanning: SpanningTree, symbols: Mapping[str, SX]
) -> KhalilTree:
    """Return the tree of links with numbered links, Khalil frames and inertias.

    Args:
        mechanism: components and connections.
        graph: bodies and joints.
        spanning: joints of the tree, in order, and cut joints.
        symbols: CasADi symbol of every parameter.
    """
    drafts: list[_DescribedLink] = []
    home: dict[int, int] = {0: -1}
    base = {0: Pose.identity()}
    stubs: dict[int, int] = {}
    for branch in (*spanning.branches, *_branches_with_free_end(spanning)):
        last, pose = _extend(drafts, base, home[branch.parent], branch)
        if branch.child < 0:
            stubs[id(branch.edge)] = last
            drafts[last].nodes[-1] = pose
        else:
            home[branch.child] = last
            drafts[last].nodes[branch.child] = pose
    chosen = _chosen_frames(drafts, graph.size)

    def place(node: int) -> tuple[int, Pose]:
        link = home[node]
        return link, base[node] if link < 0 else placed_on(link, node)

    def placed_on(link: int, node: int) -> Pose:
        return chosen[link].shift.inverse() @ drafts[link].nodes[node]

    cuts = []
    for edge in spanning.cuts:
        link_b, pose_b = place(edge.b)
        link_a, pose_a = place(edge.a)
        stub = stubs.get(id(edge))
        if stub is not None:
            pose = placed_on(stub, -1)
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
            inertias[link] = inertias[link] + own.seen_from(MatrixRotation(pose.R), pose.p)
    gravity = casadi.vertcat(*(to_sx(g, symbols) for g in mechanism.world.gravity))
    rotors = [_rotor(draft.edge, place, symbols) for draft in drafts]
    tree = Tree(_links(drafts, chosen, inertias, rotors, symbols), gravity)
    return KhalilTree(tree, tuple(draft.joint for draft in drafts), tuple(cuts), homes)


def _branches_with_free_end(spanning: SpanningTree) -> list[Branch]:
    """Return the branches of cut joints that stay in the tree with a free end.

    These are joints with an effort, and joints without closure rows.

    `spanning` is the spanning tree.
    """
    return [
        Branch(edge, edge.a, -1, True)
        for edge in spanning.cuts
        if edge.joint.carries_effort or not edge.joint.closes
    ]


def _extend(
    drafts: list[_DescribedLink],
    base: dict[int, Pose],
    parent: int,
    branch: Branch,
) -> tuple[int, Pose]:
    """Append the links of the joint of a branch to `drafts`.

    `base` contains the poses of nodes on the base; `parent` is the index of the link before the
    joint. Return the last link and the pose of the child node on it.
    """
    edge = branch.edge
    near, far = (edge.pose_a, edge.pose_b) if branch.forward else (edge.pose_b, edge.pose_a)
    nodes = base if parent < 0 else drafts[parent].nodes
    here = nodes[branch.parent] @ near
    given = edge.khalil if branch.forward and nodes[branch.parent].is_identity() else None
    freedoms = edge.joint.freedoms if branch.forward else edge.joint.freedoms[::-1]
    for freedom in freedoms:
        aligned = _align(freedom, branch.forward)
        drafts.append(
            _DescribedLink(
                freedom.coordinate_of(edge.joint.name),
                edge.joint.name,
                parent,
                freedom.motion,
                not branch.forward and freedom.motion not in _ALONG_Z,
                here @ aligned,
                given if aligned.is_identity() else None,
                edge,
            )
        )
        parent, here, given = len(drafts) - 1, aligned.inverse(), None
    end = Pose.identity() if branch.child < 0 else far.inverse()
    return parent, here @ end


def _chosen_frames(drafts: Sequence[_DescribedLink], size: float) -> list[_Chosen]:
    """Return the frame of every link: the described frame, or Khalil's frame if it is near.

    The gamma and b of the first link after a revolute or prismatic joint move the frame of that
    joint along and about its axis, unless it was described by Khalil parameters. They are then zero
    in the following frame.

    Args:
        drafts: links as described.
        size: size of the mechanism [m].
    """
    chosen: list[_Chosen] = []
    for draft in drafts:
        before = chosen[draft.antecedent] if draft.antecedent >= 0 else None
        via: tuple[Khalil, ...] = ()
        placement, stays = draft.given, draft.motion not in _ALONG_Z
        if placement is not None and (before is None or before.shift.is_identity()):
            stays = True
        else:
            pose = draft.pose if before is None else before.shift.inverse() @ draft.pose
            *fixed, placement = frames_to(pose, size)
            if before is not None and not before.settled:
                first, *others = (*fixed, placement)
                shared, left = first.split()
                before.placement = before.placement.rotate(shared.gamma).shift(shared.b)
                before.shift = shared.pose()
                *fixed, placement = (left, *others)
            via = tuple(fixed)
        if before is not None:
            before.settled = True
        chosen.append(_Chosen(via, placement, Pose.identity(), stays))
    return chosen


def _align(freedom: Freedom, forward: bool) -> Pose:
    """Return the rotation of a frame with z along the axis of a freedom.

    The axis is reversed for a joint that the tree passes from frame_b to frame_a.
    """
    if freedom.motion not in _ALONG_Z:
        return Pose.identity()
    pose = Pose.rotation(align_z(freedom.axis))
    return pose if forward else pose @ _FLIP


def _rotor(
    edge: JointEdge, place: Callable[[int], tuple[int, Pose]], symbols: Mapping[str, SX]
) -> CarriedRotor | None:
    """Return the rotor of a joint, on the link of the joint's frame_a; None without rotor.

    `place` maps a node index to link and pose.
    """
    rotor = edge.joint.rotor
    if rotor is None:
        return None
    link, pose = place(edge.a)
    axis = edge.joint.freedoms[0].axis if rotor.axis is None else rotor.axis
    return CarriedRotor(
        carrier=link,
        axis=exact_product((pose @ edge.pose_a).R, SX(DM(list(axis)))),
        inertia=to_sx(rotor.inertia, symbols),
        ratio=to_sx(rotor.ratio, symbols),
    )


def _links(
    drafts: list[_DescribedLink],
    chosen: list[_Chosen],
    inertias: list[Inertia],
    rotors: list[CarriedRotor | None],
    symbols: Mapping[str, SX],
) -> tuple[Link, ...]:
    """Return the links of a tree from their descriptions, chosen frames, inertias and rotors.

    The lists have one element for each link; `symbols` are those of the parameters.
    """
    links, nq, nv = [], 0, 0
    for draft, frame, inertia, rotor in zip(drafts, chosen, inertias, rotors, strict=True):
        motion = draft.motion
        q, v = slice(nq, nq + motion.nq), slice(nv, nv + motion.nv)
        links.append(
            Link(
                name=draft.name,
                antecedent=draft.antecedent,
                motion=motion,
                backward=draft.backward,
                via=frame.via,
                placement=frame.placement,
                inertia=inertia,
                rotor=rotor,
                q=q,
                v=v,
                **{name: to_sx(getattr(draft.edge.joint, name), symbols) for name in _EFFORTS},
            )
        )
        nq, nv = q.stop, v.stop
    return tuple(links)
