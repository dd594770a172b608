"""What the rates at which links and joints of a closed mechanism turn say of its parameters.

Along an angular velocity that keeps one direction in its link a first moment has no effect.
Rotational energies and dissipations are dependent where the products of the rates are; links that
turn about one direction and joints with a constant ratio of velocities are cases of it.

Source: Khalil & Bennis 1995 for joints of equal velocity; Gautier 1991 for the dependence.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import casadi
import numpy as np
from casadi import SX, Function

from mbs.assembly import System
from mbs.assembly.tree import Link
from mbs.identification.base.loops import Array, ClosedPostures, Relation
from mbs.identification.base.rank import dependence, plain
from mbs.identification.base.rules import Key
from mbs.loops.reduction import reduction_matrix
from mbs.recursions.poses import link_poses
from mbs.recursions.velocities import link_velocities
from mbs.solvers.rank import first_best
from mbs.spatial.inertia import TEN_PARAMETERS

_SAME = 1e-9
_MOMENTS = TEN_PARAMETERS[6:9]


@dataclass(frozen=True, slots=True, eq=False)
class Effect:
    """What one parameter does, up to a factor that all of its kind share.

    Attributes:
        parameter: it.
        column: (values,) in all postures.
    """

    parameter: Key
    column: Array


def turning_relations(
    system: System, postures: Sequence[ClosedPostures], *, base_moves: bool = False
) -> Iterator[Relation]:
    """What the rates of links and joints say.

    Args:
        system: with closed loops.
        postures: on the branch, more than one set where lengths are symbols; at least
            `postures_needed`.
        base_moves: whether the base turns, so that the rates of links are not those of joints.
    """
    G = np.concatenate([_slopes(system, each) for each in postures])
    links = system.tree.links
    joints = {j: G[:, link.v.start] for j, link in enumerate(links) if link.motion.nv == 1}
    angular = [] if base_moves else list(_angular(system, postures, G))
    for j, rows in enumerate(angular):
        axis = _one_direction(rows)
        if axis is not None:
            yield {(j, _MOMENTS[k]): SX(axis[k]) for k in np.flatnonzero(axis)}
    energies = [e for j, rows in enumerate(angular) for e in _rotational(j, rows)]
    energies += (Effect((j, "Ia"), _product(rows, rows)) for j, rows in joints.items())
    yield from _dependent(energies)
    yield from _dependent([Effect((j, "Fv"), _product(g, g)) for j, g in joints.items()])
    yield from _dependent([Effect((j, "offset"), g.ravel()) for j, g in joints.items()])
    yield from _dry_friction(links, joints)


def postures_needed(system: System) -> int:
    """So many that products of rates are not dependent by chance."""
    effects = 6 * len(system.tree.links) + system.nv
    m = max(len(system.active), 1)
    return max(12, -(-3 * effects // (m * (m + 1))))


def _slopes(system: System, postures: ClosedPostures) -> Array:
    """(postures, nv, m) velocities of the tree from the independent ones."""
    at = reduction_matrix(system)
    p = [postures.p] if postures.p.size else []
    return np.array([np.array(at(position, *p)) for position in postures.q.T])


def _angular(system: System, postures: Sequence[ClosedPostures], G: Array) -> Array:
    """(links, postures, 3, m) angular velocities in the frames of the links."""
    q, v = SX.sym("q", system.nq), SX.sym("v", system.nv)
    motions = link_velocities(system.tree, link_poses(system.tree, q), v)
    slopes = [casadi.densify(casadi.jacobian(motion.w, v)) for motion in motions]
    at = Function("angular", [q, system.p], slopes)
    every = [at(position, each.p) for each in postures for position in each.q.T]
    numbers = np.array([[np.array(slope) for slope in slopes] for slopes in every])
    rows: Array = np.einsum("njav,nvm->jnam", numbers, G)
    return rows


def _one_direction(rows: Array) -> Array | None:
    """(3,) the only direction of an angular velocity (postures, 3, m); None when it changes."""
    columns = rows.transpose(1, 0, 2).reshape(3, -1)
    U, sizes, _ = np.linalg.svd(columns, full_matrices=False)
    if sizes[0] < _SAME or sizes[1] > _SAME * sizes[0]:
        return None
    axis: Array = U[:, 0] * np.sign(U[first_best(np.abs(U[:, 0])), 0])
    axis[np.abs(axis) < _SAME] = 0.0
    unit: Array = axis / np.linalg.norm(axis)
    return unit


def _rotational(j: int, rows: Array) -> Iterator[Effect]:
    """Energies of the inertia tensor of link j, from its angular velocity (postures, 3, m)."""
    for name, (k, i) in zip(TEN_PARAMETERS, zip(*np.triu_indices(3), strict=True), strict=False):
        yield Effect((j, name), (1 if k == i else 2) * _product(rows[:, k], rows[:, i]))


def _product(first: Array, second: Array) -> Array:
    """Coefficients of a product of two rates, (postures, m) each, in all postures."""
    k, i = np.triu_indices(first.shape[1])
    return np.ravel(first[:, k] * second[:, i] + first[:, i] * second[:, k])


def _dependent(effects: Sequence[Effect]) -> Iterator[Relation]:
    """Relations of parameters with dependent effects."""
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
    """Dry friction of joints at rest, and of joints whose velocities keep a constant ratio."""
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
