"""Relations between the parameters of a mechanism with closed loops.

A body in the common frame of a cut joint may be attributed to either link if the joint motion does
not change its effect. Links with constant relative orientation share their inertia tensors. The
relations from velocities of links and joints are in `turning_relations`.

Source: Khalil & Bennis 1995 and Bennis & Khalil 1990 for parallelograms and for cut joints.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import casadi
import numpy as np
from casadi import DM, SX, Function
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.assembly.khalil_frames import Cut
from mbs.assembly.tree import Link
from mbs.components import ConstantVelocity, Fixed
from mbs.components.constraints import Constraint
from mbs.components.joints import Motion
from mbs.identification.grouping.numeric import dependence, plain
from mbs.identification.grouping.rules import Key, lambda_transform, on_link
from mbs.loops.reduction import reduction_matrix
from mbs.recursions.link_motions import base_poses, link_poses, link_velocities
from mbs.solvers.rank import first_best
from mbs.spatial import Pose, align_z, nearest_rotation
from mbs.spatial.inertia import TEN_PARAMETERS

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class ClosedConfigurations:
    """Configurations that close the loops.

    Attributes:
        q: (nq, configurations) positions.
        p: (np,) parameters for which the loops are closed.
    """

    q: Array
    p: Array


Relation = dict[Key, SX]
"""Coefficients of parameters in a combination without effect."""

_SAME = 1e-9
"""Difference of cosines, lengths [m] or unit velocities between configurations below which they
count as constant or zero. Closed configurations have errors of 1e-13; true variations are
tenths."""

_TENSOR = TEN_PARAMETERS[:6]
_SYMMETRIC = (("XX", "YY"), ("MZ",), ("M",))
"""Parameters of a body that is symmetric about z: the parameters of a tuple change together."""


def cut_relations(system: System) -> Iterator[Relation]:
    """Yield relations from bodies that may be attributed to either side of a cut joint.

    A relation maps parameters (link index, kind) to their coefficients in a combination without
    effect.

    Args:
        system: system with closed loops.
    """
    for cut in system.cuts:
        axis, shared = _shared_frame(cut)
        sides = [(cut.link_a, cut.pose_a, 1), (cut.link_b, cut.pose_b, -1)]
        through = {
            link: (lambda_transform(pose @ axis), sign) for link, pose, sign in sides if link >= 0
        }
        for kinds in shared:
            relation: Relation = {}
            for link, (matrix, sign) in through.items():
                numbers = [TEN_PARAMETERS.index(kind) for kind in kinds]
                relation |= on_link(link, sign * casadi.sum2(matrix[:, numbers]))
            yield relation


def _shared_frame(cut: Cut) -> tuple[Pose, tuple[tuple[str, ...], ...]]:
    """Return the frame of a body that may be attributed to either side of a cut joint.

    The second result lists tuples of kinds of inertial parameters that change together with equal
    effect on both sides.
    """
    joint = cut.edge.joint
    freedoms = joint.freedoms
    if cut.welded or isinstance(joint, Fixed):
        return Pose.identity(), tuple((name,) for name in TEN_PARAMETERS)
    if isinstance(joint, Constraint):
        held = isinstance(joint, ConstantVelocity)
        return Pose.identity(), _SYMMETRIC[2:] if held else ()
    turning = [freedom for freedom in freedoms if freedom.motion is not Motion.PRISMATIC]
    if not turning:
        return Pose.identity(), tuple((name,) for name in _TENSOR)
    if any(freedom.motion is Motion.FREE for freedom in freedoms):
        return Pose.identity(), ()
    slides = len(turning) < len(freedoms)
    if len(turning) == 1 and turning[0].motion is Motion.REVOLUTE:
        return Pose.rotation(align_z(turning[0].axis)), _SYMMETRIC[:1] if slides else _SYMMETRIC
    return Pose.identity(), () if slides else _SYMMETRIC[2:]


def pair_relations(
    system: System, configurations: Sequence[ClosedConfigurations], *, base_moves: bool = False
) -> Iterator[Relation]:
    """Yield relations of links with constant orientation relative to each other or to the base.

    Args:
        system: system with closed loops.
        configurations: closed configurations on the assembled branch; several sets if lengths are
            symbols.
        base_moves: whether the base moves, so that origins at a constant distance have different
            velocities.
    """
    poses = [_link_poses(system, each) for each in configurations]
    R = np.concatenate([turns for turns, _ in poses], axis=1)
    for b in range(1, len(R)):
        for a in range(b):
            relative = np.einsum("sji,sjk->sik", R[a], R[b])
            if _is_constant(relative):
                same = not base_moves and (a == 0 or _has_constant_offset(poses, a, b))
                yield from _shared_by_pair(a - 1, b - 1, _rotation(relative[0]), same)


def _rotation(R: Array) -> SX:
    """Return a rotation R (3, 3) of all configurations, with rounding errors removed."""
    noise = 1e-12  # ten times the loop error: smaller elements are zeros
    return SX(DM(nearest_rotation(R.tolist(), noise=noise)))


def _has_constant_offset(poses: Sequence[tuple[Array, Array]], a: int, b: int) -> bool:
    """Whether the vector between origins a and b is constant, so that they have the same velocity.

    `poses` are pairs of orientations and origins as returned by `_link_poses`.
    """
    return all(_is_constant(origins[b] - origins[a]) for _, origins in poses)


def _shared_by_pair(a: int, b: int, R: SX, moments: bool) -> Iterator[Relation]:
    """Yield relations that shift parameters of link b to link a, or drop them for the base (-1).

    R is the constant orientation of b relative to a; `moments` includes first moments and mass.
    """
    through = lambda_transform(Pose.rotation(R))
    names = TEN_PARAMETERS[: (9 if a < 0 else 10) if moments else 6]
    for k, name in enumerate(names):
        yield {(b, name): SX(1), **(on_link(a, -through[:, k]) if a >= 0 else {})}


def _link_poses(system: System, configurations: ClosedConfigurations) -> tuple[Array, Array]:
    """Return orientations (1 + links, n, 3, 3) and origins (1 + links, n, 3) of base and links.

    n is the number of configurations.
    """
    q = SX.sym("q", system.nq)
    poses = [Pose.identity(), *base_poses(system.tree, link_poses(system.tree, q))]
    at = Function("poses", [q, system.p], [casadi.horzcat(*(pose.matrix for pose in poses))])
    T = [np.array(at(position, configurations.p)) for position in configurations.q.T]
    matrices = np.array(T).reshape(len(T), 4, len(poses), 4).transpose(2, 0, 1, 3)
    return matrices[..., :3, :3], matrices[..., :3, 3]


def _is_constant(values: Array) -> bool:
    """Whether values (n, ...) are equal in all n configurations."""
    return bool(np.max(np.abs(values - values[0])) < _SAME)


# Relations from the angular velocities of links and the joint velocities of a closed mechanism.

# A first moment along an angular velocity of constant direction in its link has no effect.
# Rotational energies and dissipated powers are dependent if the products of the velocities are.
# Links that rotate about one direction and joints with a constant velocity ratio are special cases.

# Source: Khalil & Bennis 1995 for joints of equal velocity; Gautier 1991 for the dependence.


_MOMENTS = TEN_PARAMETERS[6:9]


@dataclass(frozen=True, slots=True, eq=False)
class Effect:
    """Effect of one parameter, up to a factor common to all parameters of its kind.

    Attributes:
        parameter: the parameter.
        column: (values,) effect at all configurations.
    """

    parameter: Key
    column: Array


def turning_relations(
    system: System, configurations: Sequence[ClosedConfigurations], *, base_moves: bool = False
) -> Iterator[Relation]:
    """Yield the relations that follow from the velocities of links and joints.

    Args:
        system: system with closed loops.
        configurations: closed configurations on the assembled branch, at least
            `configurations_needed`; several sets if lengths are symbols.
        base_moves: whether the base moves, so that the velocities of links do not follow from the
            joints.
    """
    G = np.concatenate([_velocity_matrices(system, each) for each in configurations])
    links = system.tree.links
    joints = {j: G[:, link.v.start] for j, link in enumerate(links) if link.motion.nv == 1}
    angular = [] if base_moves else list(_angular_velocities(system, configurations, G))
    for j, rows in enumerate(angular):
        axis = _one_direction(rows)
        if axis is not None:
            yield {(j, _MOMENTS[k]): SX(axis[k]) for k in np.flatnonzero(axis)}
    energies = [e for j, rows in enumerate(angular) for e in _inertia_effects(j, rows)]
    energies += (Effect((j, "Ia"), _velocity_products(rows, rows)) for j, rows in joints.items())
    yield from _dependence_relations(energies)
    yield from _dependence_relations(
        [Effect((j, "Fv"), _velocity_products(g, g)) for j, g in joints.items()]
    )
    yield from _dependence_relations([Effect((j, "offset"), g.ravel()) for j, g in joints.items()])
    yield from _dry_friction(links, joints)


def configurations_needed(system: System) -> int:
    """Return a number of configurations that avoids accidental dependence of velocity products.

    Args:
        system: system with closed loops.
    """
    effects = 6 * len(system.tree.links) + system.nv
    m = max(len(system.independent), 1)
    return max(12, -(-3 * effects // (m * (m + 1))))


def _velocity_matrices(system: System, configurations: ClosedConfigurations) -> Array:
    """Return the matrices (configurations, nv, m) from independent to tree velocities."""
    at = reduction_matrix(system)
    p = [configurations.p] if configurations.p.size else []
    return np.array([np.array(at(position, *p)) for position in configurations.q.T])


def _angular_velocities(
    system: System, configurations: Sequence[ClosedConfigurations], G: Array
) -> Array:
    """Return the angular velocities (links, configurations, 3, m) in the frames of the links.

    G are the matrices of `_velocity_matrices`: from independent to tree velocities.
    """
    q, v = SX.sym("q", system.nq), SX.sym("v", system.nv)
    motions = link_velocities(system.tree, link_poses(system.tree, q), v)
    slopes = [casadi.densify(casadi.jacobian(motion.w, v)) for motion in motions]
    at = Function("angular", [q, system.p], slopes)
    every = [at(position, each.p) for each in configurations for position in each.q.T]
    numbers = np.array([[np.array(slope) for slope in slopes] for slopes in every])
    rows: Array = np.einsum("njav,nvm->jnam", numbers, G)
    return rows


def _one_direction(rows: Array) -> Array | None:
    """Return constant direction (3,) of angular velocities `rows` (configurations, 3, m), or None.

    None if the direction varies or the angular velocity is always zero.
    """
    columns = rows.transpose(1, 0, 2).reshape(3, -1)
    U, sizes, _ = np.linalg.svd(columns, full_matrices=False)
    if sizes[0] < _SAME or sizes[1] > _SAME * sizes[0]:
        return None
    axis: Array = U[:, 0] * np.sign(U[first_best(np.abs(U[:, 0])), 0])
    axis[np.abs(axis) < _SAME] = 0.0
    unit: Array = axis / np.linalg.norm(axis)
    return unit


def _inertia_effects(j: int, rows: Array) -> Iterator[Effect]:
    """Yield the effects of the inertia tensor of link j on its kinetic energy.

    `rows` (configurations, 3, m) is its angular velocity per independent velocity.
    """
    for name, (k, i) in zip(TEN_PARAMETERS, zip(*np.triu_indices(3), strict=True), strict=False):
        yield Effect((j, name), (1 if k == i else 2) * _velocity_products(rows[:, k], rows[:, i]))


def _velocity_products(first: Array, second: Array) -> Array:
    """Return products of two velocities, `first` and `second` (configurations, m), as one vector.

    Each product is a quadratic form in the m independent velocities. Its m (m + 1) / 2 coefficients
    are listed for every configuration.
    """
    k, i = np.triu_indices(first.shape[1])
    return np.ravel(first[:, k] * second[:, i] + first[:, i] * second[:, k])


def _dependence_relations(effects: Sequence[Effect]) -> Iterator[Relation]:
    """Yield relations between the parameters whose effects are linearly dependent."""
    if not effects:
        return
    found = dependence(np.column_stack([e.column for e in effects]), range(len(effects)))
    if found.residual > _SAME:
        return
    for k, number in enumerate(found.dependent):
        relation = {effects[number].parameter: SX(1)}
        for independent, factor in zip(found.independent, found.factors[:, k], strict=True):
            if abs(factor) > _SAME:
                relation[effects[independent].parameter] = SX(-plain(factor))
        yield relation


def _dry_friction(links: Sequence[Link], joints: dict[int, Array]) -> Iterator[Relation]:
    """Yield relations of Coulomb friction of joints at rest or with a constant velocity ratio.

    `joints` maps link indices to joint velocities (configurations, m) per independent velocity.
    """
    for k, rows in joints.items():
        if np.max(np.abs(rows)) < _SAME:
            yield {(k, "Fs"): SX(1)}
            continue
        for j, other in joints.items():
            square = float(np.sum(other * other))
            ratio = float(np.sum(rows * other)) / square if j < k and square > _SAME else 0.0
            same = np.max(np.abs(rows - ratio * other)) < _SAME * max(1.0, abs(ratio))
            share = plain(abs(ratio))
            if same and (links[k].Fs_width - share * links[j].Fs_width).is_zero():
                yield {(k, "Fs"): SX(1), (j, "Fs"): SX(-share)}
