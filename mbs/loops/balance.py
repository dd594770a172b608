"""Massless nodes between springs and dampers: their motion follows from the balance of forces.

The equation of motion of a coordinate that moves no inertia is the balance of the forces on it. If
these depend on positions alone, the balance is a row of the loops: the analysis makes the position
dependent, and no force acts through the row, since the row is zero where the forces balance.

Where dampers act, the balance D v + f(q) = 0 is a row on velocities with a constant part: the
position is a state, and its velocity follows. Dampers between nodes leave sums of forces without
velocities; these are rows of positions.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import casadi
import numpy as np
from casadi import SX, Function
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.assembly.tables import Balance, LoopRow
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
from mbs.solvers.block_triangular import solve_large
from mbs.solvers.rank import independent_rows, rank

GROUP = "balance of forces"
"""Name of the rows of positions of massless nodes."""
DAMPED = "balance of forces with dampers"
"""Name of their rows of velocities."""
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
    found = [j for j in _massless_links(system) if _joint(system, j) not in driven]
    nodes = tuple((links[j].q.start, links[j].v.start) for j in found)
    balances = _balances(system, nodes) if nodes else None
    if balances is None:
        return system
    names = [system.coordinates[k].name for k, _ in nodes]
    first = len(system.cuts) + len(system.couplings)
    first += sum(part.element.has("rows") for part in parts)
    loops = list(system.loops)
    for is_damped, where in ((False, first), (True, len(loops) + 1)):
        own = [b for b in balances if b.is_damped is is_damped]
        if own:
            bound = tuple(system.speeds[balance.velocity].name for balance in own)
            kind = (DAMPED, "damped balance") if is_damped else (GROUP, "balance")
            loops.insert(where, LoopRow(*kind, bound, ()))
    return replace(
        system,
        nodes=nodes,
        balances=balances,
        loops=tuple(loops),
        coordinates=tuple(
            replace(c, actuated=False) if c.name in names else c for c in system.coordinates
        ),
        speeds=tuple(replace(c, actuated=False) if c.name in names else c for c in system.speeds),
        _cache={},
    )


def balance_rows(system: System, q: SX) -> list[tuple[str, list[tuple[str, Row]]]]:
    """Return the rows of positions of the massless nodes: forces divided by typical stiffnesses.

    Args:
        system: with or without such nodes.
        q: (nq, 1) symbols of positions.
    """
    return _rows(system, q, SX.zeros(system.nv), is_damped=False)


def velocity_balance_rows(system: System, q: SX, v: SX) -> list[tuple[str, list[tuple[str, Row]]]]:
    """Return the rows of velocities of the massless nodes: forces divided by typical dampings.

    They are linear in v, with a constant part.

    Args:
        system: with or without such nodes.
        q: (nq, 1) symbols of positions.
        v: (nv, 1) velocities.
    """
    return _rows(system, q, v, is_damped=True)


def _rows(
    system: System, q: SX, v: SX, *, is_damped: bool
) -> list[tuple[str, list[tuple[str, Row]]]]:
    """Balances of one kind with their names."""
    own = [balance for balance in system.balances if balance.is_damped is is_damped]
    if not own:
        return []
    numbers = [balance.velocity for balance in own]
    if is_damped:
        efforts = _static_efforts(system, q, v)[numbers]
    else:
        every, speed = [balance.velocity for balance in system.balances], SX.sym("v", system.nv)
        moving = _static_efforts(system, q, speed)[every]
        still, D = casadi.substitute(moving, speed, v), casadi.jacobian(moving, speed)[:, every]
        n = len(every)
        efforts = _without_velocities(still, D, range(len(own), n), range(len(own)))
    rows = []
    for k, balance in enumerate(own):
        node = system.speeds[balance.velocity]
        unit = "m" if node.unit.startswith("m") else "1"
        rows.append((node.name, Row(efforts[k] / balance.size, unit)))
    return [(DAMPED if is_damped else GROUP, rows)]


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
    for position, velocity in system.nodes:
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


def _balances(system: System, nodes: Sequence[tuple[int, int]]) -> tuple[Balance, ...] | None:
    """Balances of the forces on nodes; None if forces do not determine the nodes.

    Forces that depend on states, inputs, time or contacts do not, nor those not linear in
    velocities.
    """
    positions, velocities = [k for k, _ in nodes], [k for _, k in nodes]
    for part in system.parts:
        levers = [lever for port in part.coordinates.values() for lever in port]
        if part.element.switches and any(lever.velocity in velocities for lever in levers):
            return None
    q, v = SX.sym("q", system.nq), SX.sym("v", system.nv)
    efforts = _static_efforts(system, q, v)[velocities]
    still, damping = casadi.substitute(efforts, v, 0 * v), casadi.jacobian(efforts, v)
    known = Function("known", [q, system.p], [still, damping], {"allow_free": True})
    if known.has_free():  # states, inputs, time, or velocities with a law that is not linear
        return None
    every = _samples(system, q, damping)
    sizes = _typical([M[:, velocities] for M in every])
    sizes[sizes == 0] = 1.0
    whole = [M / sizes[:, None] for M in every]
    count = max((rank(M) if M.any() else 0 for M in whole), default=0)
    damped = independent_rows([M[:, velocities] for M in every], count)  # the strongest first
    D = [M[:, velocities] for M in whole]
    if any(rank(M[np.ix_(damped, damped)]) < count for M in D if count):
        return None
    others = [k for k in range(len(nodes)) if k not in damped]
    left = _without_velocities(still, damping[:, velocities], damped, others)
    slopes = casadi.jacobian(left, q)[:, positions]
    K = _samples(system, q, slopes)
    stiffness = _typical([M[:, others] for M in K])
    if len(K) < len(D) or not D or not stiffness.all():
        return None
    whole = [np.vstack([M[damped], k / stiffness[:, None]]) for M, k in zip(D, K, strict=True)]
    if any(rank(M) < len(nodes) for M in whole):
        return None
    free = [Balance(velocities[k], float(x), False) for k, x in zip(others, stiffness, strict=True)]
    return (*free, *(Balance(velocities[k], float(sizes[k]), True) for k in damped))


def _without_velocities(efforts: SX, D: SX, damped: Sequence[int], others: Sequence[int]) -> SX:
    """Sums of efforts on which no velocity acts, one for each of the others.

    Args:
        efforts: (n, 1) at rest.
        D: (n, n) their slopes for velocities, of the rank of its damped rows.
        damped: numbers of rows.
        others: numbers of all other rows.
    """
    left = efforts[list(others)]
    if damped and others and not D[list(others), list(damped)].is_zero():
        share = solve_large(D[list(damped), list(damped)], efforts[list(damped)])
        left -= casadi.mtimes(D[list(others), list(damped)], share)
    return left


def _samples(system: System, q: SX, matrix: SX) -> list[NDArray[np.float64]]:
    """Values of a matrix at random configurations, as far as they are finite."""
    function = Function("matrix", [q, system.p], [casadi.densify(matrix)])
    rng = np.random.default_rng(_SEED)
    at = np.array(system.configuration) + rng.uniform(-_REACH, _REACH, (8, system.nq))
    found = [np.array(function(one, system.p_default)) for one in at]
    return [M for M in found if np.isfinite(M).all()]


def _typical(matrices: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
    """(n,) typical sizes of the diagonal of (n, n) matrices; zeros without any matrix."""
    if not matrices:
        return np.zeros(1)
    found: NDArray[np.float64] = np.median([np.abs(np.diag(M)) for M in matrices], axis=0)
    return found
