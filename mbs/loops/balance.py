"""Massless nodes between springs: their positions follow from the balance of forces.

The equation of motion of a coordinate that moves no inertia is the balance of the forces on it. If
these depend on positions alone, the balance is a row of the loops: the analysis makes the position
dependent, and no force acts through the row, since the row is zero where the forces balance.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import casadi
import numpy as np
from casadi import SX, Function

from mbs.assembly import System
from mbs.assembly.tables import LoopRow
from mbs.assembly.tree import Link
from mbs.components import Mechanism
from mbs.components.custom import Row
from mbs.components.joints import Motion
from mbs.errors import ModelError
from mbs.recursions.force_elements import element_efforts
from mbs.recursions.newton_euler import joint_efforts, newton_euler
from mbs.recursions.parts import PartsAt
from mbs.recursions.poses import link_poses
from mbs.recursions.velocities import resting_base
from mbs.solvers.rank import rank

GROUP = "balance of forces"
"""Name of the rows of massless nodes."""
_SEED, _REACH = 20261128, 0.3
"""Random configurations at which the stiffness of nodes is examined, and their distance from the
assembled one [rad or m]: springs are stretched there, also those that are relaxed as assembled."""


def with_balance(system: System, mechanism: Mechanism) -> System:
    """Return the system with rows for its massless nodes, if the forces on them determine them.

    Args:
        system: open, or with loops that are not analysed yet.
        mechanism: its description.
    """
    links, parts = system.tree.links, system.parts
    if not any(part.element.acts for part in parts) and all(k.stiffness.is_zero() for k in links):
        return system
    driven = {joint.name for joint in mechanism.joints() if joint.actuated}
    nodes = [j for j in _massless_links(system) if _joint(system, j) not in driven]
    velocities = tuple(links[j].v.start for j in nodes)
    stiffness = _stiffness(system, velocities) if velocities else None
    if stiffness is None:
        return system
    positions = tuple(links[j].q.start for j in nodes)
    names = tuple(system.coordinates[k].name for k in positions)
    first = len(system.cuts) + len(system.couplings)
    first += sum(part.element.has("rows") for part in parts)
    row = LoopRow(GROUP, "balance", names, ())
    return replace(
        system,
        balanced=tuple(zip(positions, velocities, stiffness, strict=True)),
        loops=(*system.loops[:first], row, *system.loops[first:]),
        coordinates=tuple(
            replace(c, actuated=False) if c.name in names else c for c in system.coordinates
        ),
        speeds=tuple(replace(c, actuated=False) if c.name in names else c for c in system.speeds),
        _cache={},
    )


def balance_rows(system: System, q: SX) -> list[tuple[str, list[tuple[str, Row]]]]:
    """Return the rows of the massless nodes: forces divided by typical stiffnesses.

    Args:
        system: with or without such nodes.
        q: (nq, 1) symbols of positions.
    """
    if not system.balanced:
        return []
    efforts = _static_efforts(system, q, SX.zeros(system.nv))
    rows = []
    for position, velocity, stiffness in system.balanced:
        coordinate = system.coordinates[position]
        unit = "m" if coordinate.unit == "m" else "1"
        rows.append((coordinate.name, Row(efforts[velocity] / stiffness, unit)))
    return [(GROUP, rows)]


def require_no_balance(
    system: System, what: str, *, links: Iterable[int] = (), velocities: Iterable[int] = ()
) -> None:
    """Refuse a load on a massless node, whose balance has the forces of components only.

    Args:
        system: with or without massless nodes.
        what: the load, for the message.
        links: numbers of links on which the load acts.
        velocities: indices of velocities along which the load acts.

    Raises:
        ModelError: a massless node moves one of the links, or along one of the velocities.
    """
    paths = [system.tree.links[j].v.start for link in links for j in system.tree.path(link)]
    for position, velocity, _ in system.balanced:
        if velocity in (*paths, *velocities):
            raise ModelError(
                f"{system.name}: {what} acts on {system.coordinates[position].name}, which moves no"
                " mass and follows from the balance of the forces of components; give it a mass"
            )


def _joint(system: System, link: int) -> str:
    """Name of the joint of a link."""
    name: str = system.coordinates[system.tree.links[link].q.start].joint
    return name


def _massless_links(system: System) -> list[int]:
    """Numbers of the links of one freedom that move no mass and that no loop goes through."""
    links = system.tree.links
    bound = {name for loop in system.loops for name in loop.joints}
    found = set(range(len(links)))
    for j in reversed(range(len(links))):
        link = links[j]
        in_loop = link.name in bound or _joint(system, j) in bound
        if j in found and (in_loop or not _is_massless(link)):
            found -= set(system.tree.path(j))
    return [] if len(found) == len(links) else sorted(found)


def _is_massless(link: Link) -> bool:
    """Whether a link has no inertia by its description, whatever the parameters are."""
    is_plain = link.motion in (Motion.REVOLUTE, Motion.PRISMATIC) and link.rotor is None
    return is_plain and link.Ia.is_zero() and link.inertia.parameters.is_zero()


def _static_efforts(system: System, q: SX, v: SX) -> SX:
    """(nv, 1) efforts that hold the tree at positions q with velocities v, without inertia."""
    poses, rest = link_poses(system.tree, q), SX.zeros(system.nv)
    weight = newton_euler(system.tree, poses, rest, rest, resting_base(system.tree.gravity))
    own = joint_efforts(system.tree, q, v, rest)
    return weight.efforts + own + element_efforts(PartsAt(system, q, v), poses)


def _stiffness(system: System, velocities: tuple[int, ...]) -> tuple[float, ...] | None:
    """Typical stiffness of each node [N/m or N m/rad]; None if forces do not determine the nodes.

    Forces on a node that depend on velocities, states, inputs or contacts do not.
    """
    for part in system.parts:
        levers = [lever for port in part.coordinates.values() for lever in port]
        if part.element.switches and any(lever.velocity in velocities for lever in levers):
            return None
    q, v = SX.sym("q", system.nq), SX.sym("v", system.nv)
    efforts = _static_efforts(system, q, v)[list(velocities)]
    known = Function("known", [q, system.p], [efforts], {"allow_free": True})
    if known.has_free():  # velocities, states, inputs, time
        return None
    positions = [link.q.start for link in system.tree.links if link.v.start in velocities]
    slopes = Function("slopes", [q, system.p], [casadi.jacobian(efforts, q)[:, positions]])
    rng = np.random.default_rng(_SEED)
    at = np.array(system.configuration) + rng.uniform(-_REACH, _REACH, (8, system.nq))
    every = [np.array(slopes(one, system.p_default)) for one in at]
    every = [K for K in every if np.isfinite(K).all()]
    typical = np.median([np.abs(np.diag(K)) for K in every], axis=0) if every else np.zeros(1)
    if not typical.all() or any(rank(K / typical) < len(K) for K in every):
        return None
    return tuple(map(float, typical))
