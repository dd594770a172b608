"""Massless nodes between springs and dampers: their motion follows from the balance of forces.

The equation of motion of a coordinate that moves no inertia is the balance of the forces on it. If
these depend on positions alone, the balance is a row of the loops: the analysis makes the position
dependent, and no force acts through the row, since the row is zero where the forces balance.

Where dampers act, the balance D v + f(q) = 0 is a row on velocities with a constant part: the
position is a state, and its velocity follows. Dampers between nodes leave sums of forces without
velocities; these are rows of positions. Dry friction parallel to a damper on a node holds the node
up to a limit of the other forces: D v = f - limit sign(f), or v = 0.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import casadi
import numpy as np
from casadi import SX, Function
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.assembly.component_instances import ComponentInstance
from mbs.assembly.tables import Balance, LoopRow
from mbs.assembly.tree import Link
from mbs.components import Description
from mbs.components.custom import Friction, OneWay, Row, Stop
from mbs.components.joints import Motion
from mbs.errors import ModelError
from mbs.recursions.force_elements import element_efforts
from mbs.recursions.link_motions import link_poses, resting_base
from mbs.recursions.newton_euler import joint_efforts, newton_euler
from mbs.recursions.parts import PartsAt
from mbs.solvers.block_triangular import solve_large
from mbs.solvers.rank import independent_rows, rank
from mbs.text import listed

GROUP = "balance of forces"
"""Name of the rows of positions of massless nodes."""
DAMPED = "balance of forces with dampers"
"""Name of the velocity rows of massless nodes."""
_DEPTH = 20
"""Depth to which two expressions are compared: friction laws have few operations."""
_SEED, _REACH = 20261128, 0.3
"""Random seed, and largest distance from the assembled configuration [rad or m], of configurations
at which the stiffness of nodes is evaluated: springs without load at assembly are loaded there."""


def with_balance(system: System, mechanism: Description) -> System:
    """Return the system with rows for its massless nodes, if the forces on them determine them.

    Args:
        system: open system, or system with loops before their analysis.
        mechanism: description of the system.
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
            bound = tuple(system.velocity_coordinates[balance.velocity].name for balance in own)
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
        velocity_coordinates=tuple(
            replace(c, actuated=False) if c.name in names else c
            for c in system.velocity_coordinates
        ),
        _cache={},
    )


def balance_rows(system: System, q: SX) -> list[tuple[str, list[tuple[str, Row]]]]:
    """Return the force balances of undamped massless nodes, divided by typical stiffnesses.

    Args:
        system: mechanism with or without massless nodes.
        q: (nq, 1) symbols of positions.

    Returns:
        At most one pair: name of the group, and (name of the node, row) of each balance.
    """
    return _rows(system, q, SX.zeros(system.nv), is_damped=False)


def velocity_balance_rows(system: System, q: SX, v: SX) -> list[tuple[str, list[tuple[str, Row]]]]:
    """Return the force balances of damped massless nodes, which are zero in every motion.

    Each is divided by a typical damping of its node, and is linear in v with a constant part.

    Args:
        system: mechanism with or without massless nodes.
        q: (nq, 1) symbols of positions.
        v: (nv, 1) velocities.

    Returns:
        At most one pair: name of the group, and (name of the node, row) of each balance.
    """
    return _rows(system, q, v, is_damped=True)


def _rows(
    system: System, q: SX, v: SX, *, is_damped: bool
) -> list[tuple[str, list[tuple[str, Row]]]]:
    """Return force balances of massless nodes as constraint rows, [(group name, [(node, row)])].

    Args:
        system: mechanism with massless nodes.
        q: (nq, 1) symbols of positions.
        v: (nv, 1) velocities.
        is_damped: True for rows on velocities (nodes with dampers), False for rows on positions.
    """
    own = [balance for balance in system.balances if balance.is_damped is is_damped]
    if not own:
        return []
    numbers = [balance.velocity for balance in own]
    if is_damped:
        efforts = _static_efforts(system, q, v)[numbers]
        still = _static_efforts(system, q, 0 * v)[numbers]
        for k, balance in enumerate(own):
            if balance.frictions:
                limit = _limit(system, balance.frictions, q)
                pushed = casadi.fmax(still[k] - limit, 0) + casadi.fmin(still[k] + limit, 0)
                efforts[k] += pushed - still[k]
    else:
        every, speed = [balance.velocity for balance in system.balances], SX.sym("v", system.nv)
        moving = _static_efforts(system, q, speed)[every]
        still, D = casadi.substitute(moving, speed, v), casadi.jacobian(moving, speed)[:, every]
        n = len(every)
        efforts = _without_velocities(still, D, range(len(own), n), range(len(own)))
    rows = []
    for k, balance in enumerate(own):
        node = system.velocity_coordinates[balance.velocity]
        unit = "m" if node.unit.startswith("m") else "1"
        rows.append((node.name, Row(efforts[k] / balance.size, unit)))
    return [(DAMPED if is_damped else GROUP, rows)]


def require_no_drift(system: System, what: str, velocities: Iterable[int]) -> None:
    """Raise if a matrix of independent velocities contains the velocity of a damped massless node.

    Args:
        system: mechanism with or without massless nodes with dampers.
        what: name of the matrix in the error message.
        velocities: indices in v of the velocities of the matrix.

    Raises:
        ModelError: one of the velocities is that of a massless node, and a node has a damper.
    """
    nodes = {k for _, k in system.nodes} if any(b.is_damped for b in system.balances) else set()
    for velocity in velocities:
        if velocity in nodes:
            raise ModelError(
                f"{system.name}: {what} in independent coordinates does not give the velocity of"
                f" {system.velocity_coordinates[velocity].name}, which moves no mass and which"
                " springs move while"
                " the independent joints rest; use coordinates='tree', or give it a mass"
            )


def _limit(system: System, names: Sequence[str], q: SX) -> SX:
    """Return the sum of the largest dry-friction forces of some components, (1, 1) [N or N m].

    `names` are the names of the components; friction is evaluated at positions q and at rest.
    """
    at, total = PartsAt(system, q, SX.zeros(system.nv)), SX(0)
    for part in system.parts:
        if part.name in names:
            total += sum((SX(law.limit) for law in part.element.frictions(at.at(part)).values()), 0)
    return total


def require_no_balance(
    system: System, what: str, *, links: Iterable[int] = (), velocities: Iterable[int] = ()
) -> None:
    """Raise if a load acts on a massless node, whose balance has forces of components only.

    Args:
        system: mechanism with or without massless nodes.
        what: description of the load for the error message.
        links: indices of links on which the load acts.
        velocities: indices in v of the velocities along which the load acts.

    Raises:
        ModelError: a massless node moves one of the links, or moves along one of the velocities.
    """
    paths = [system.tree.links[j].v.start for link in links for j in system.tree.path(link)]
    for position, velocity in system.nodes:
        if velocity in (*paths, *velocities):
            raise ModelError(
                f"{system.name}: {what} acts on {system.coordinates[position].name}, which moves no"
                " mass and follows from the balance of the forces of components; give it a mass"
            )


def without_values(system: System) -> str:
    """Return a hint for an error message that massless nodes need values of parameters.

    It is empty if all parameters have values, or no coordinate moves without mass.

    Args:
        system: mechanism whose massless nodes were searched.
    """
    missing = [parameter.name for parameter in system.parameters if parameter.default is None]
    nodes = [
        system.velocity_coordinates[system.tree.links[j].v.start].name
        for j in _massless_links(system)
    ]
    if system.nodes or not nodes or not missing:
        return ""
    verb = "moves" if len(nodes) == 1 else "move"
    return (
        f"; {listed(nodes)} {verb} no mass, and the balance of forces needs values of"
        f" {listed(missing)}: give Mechanism(parameters=)"
    )


def obstacles(system: System, velocity: int) -> str:
    """Return text on the elements that prevent the force balance from determining a coordinate.

    Args:
        system: mechanism in which the coordinate moves no inertia.
        velocity: index of the coordinate in v.
    """
    link = next(
        j for j, one in enumerate(system.tree.links) if one.v.start <= velocity < one.v.stop
    )
    node, name = system.tree.links[link], system.velocity_coordinates[velocity].name
    if link not in _massless_links(system):
        return ""
    found = []
    if not SX(node.Fs).is_zero():
        found.append(
            f"the friction Fs of {_joint(system, link)}, which is not linear in velocities"
        )
    acts = not node.stiffness.is_zero() or not SX(node.Fv).is_zero()
    for part in system.parts:
        levers = [lever.velocity for port in part.coordinates.values() for lever in port]
        links = {k for one, _ in part.frames if one >= 0 for k in system.tree.path(one)}
        if velocity in levers or link in links:
            acts = acts or part.element.acts
            reason = _obstacle(system, part, velocity)
            if reason:
                found.append(f"{type(part.element).__name__} {part.name}, {reason}")
    if found:
        return f"; the balance of forces does not give {name} because of {listed(found)}"
    if not acts:
        return f"; no spring and no damper acts on {name}"
    return f"; the springs and dampers on {name} do not determine its motion, or it has a motor"


def _obstacle(system: System, part: ComponentInstance, velocity: int) -> str:
    """Return a clause "which ..." on why a component prevents the force balance of a massless node.

    Empty if it does not.

    Args:
        system: mechanism with the node.
        part: component that acts on the node.
        velocity: index in v of the velocity of the node.
    """
    q, v = SX.sym("q", system.nq), SX.sym("v", system.nv)
    if part.element.has("stops"):
        return "which locks and releases a mass only: give the node a mass"
    if part.element.has("frictions"):
        laws = part.element.frictions(PartsAt(system, q, v).at(part)).values()
        if not all(map(_sticks_as_it_slides, laws)):
            return (
                "which needs sticking = sliding, since without mass the velocity would jump when"
                " sliding begins: give equal limits, or give the node a mass"
            )
        return (
            "which needs viscous damping of the node alone, such as Fv of its joint, since friction"
            " gives a force and no velocity: add damping, or replace the friction and a spring on"
            " the node by a SpringFrictionSeries"
        )
    if not part.element.acts:
        return ""
    if part.inputs or part.states:
        return "which has inputs or states"
    alone = replace(system, parts=(part,), _cache={})
    effort = element_efforts(PartsAt(alone, q, v), link_poses(system.tree, q))[velocity]
    is_linear = not casadi.depends_on(casadi.jacobian(effort, v), v)
    return "" if is_linear else "which is not linear in velocities"


def _joint(system: System, link: int) -> str:
    """Return the name of the joint between a link (by index) and its parent."""
    name: str = system.coordinates[system.tree.links[link].q.start].joint
    return name


def _massless_links(system: System) -> list[int]:
    """Return indices of links whose single joint freedom moves no inertia and is in no loop.

    All descendants of such a link are massless too. Empty if all links are massless.
    """
    links = system.tree.links
    bound = {name for loop in system.loops for name in loop.joints}
    found = set(range(len(links)))
    for j in reversed(range(len(links))):
        link, path = links[j], system.tree.path(j)
        if link.name in bound or _joint(system, j) in bound or not _is_plain(link):
            found -= set(path)
        elif not link.inertia.parameters.is_zero():
            # moments of inertia alone do not resist displacements
            turns = {k for k in path if links[k].motion is Motion.REVOLUTE}
            found -= set(path) if _has_mass(link) else turns
    return [] if len(found) == len(links) else sorted(found)


def _is_plain(link: Link) -> bool:
    """Whether the joint of a link is revolute or prismatic and has no rotor inertia."""
    is_one = link.motion in (Motion.REVOLUTE, Motion.PRISMATIC)
    return is_one and link.rotor is None and link.Ia.is_zero()


def _has_mass(link: Link) -> bool:
    """Whether the mass or the first moment of a link is not identically zero."""
    return not (link.inertia.m.is_zero() and link.inertia.ms.is_zero())


def _static_efforts(system: System, q: SX, v: SX) -> SX:
    """Return the efforts (nv, 1) of gravity, joint laws and components at q and v.

    They hold the tree without inertia: accelerations and inertial velocity terms are zero.
    """
    poses, rest = link_poses(system.tree, q), SX.zeros(system.nv)
    weight = newton_euler(system.tree, poses, rest, rest, resting_base(system.tree.gravity))
    own = joint_efforts(system.tree, q, v, rest)
    return weight.efforts + own + element_efforts(PartsAt(system, q, v), poses)


def _balances(system: System, nodes: Sequence[tuple[int, int]]) -> tuple[Balance, ...] | None:
    """Return the force balances that determine the motion of massless nodes; None if they do not.

    `nodes` are pairs (index in q, index in v). Forces on nodes must be linear in velocities, and
    may depend on positions and parameters.
    """
    positions, velocities = [k for k, _ in nodes], [k for _, k in nodes]
    q, v = SX.sym("q", system.nq), SX.sym("v", system.nv)
    frictions = _frictions(system, nodes, q, v)
    if frictions is None:
        return None
    efforts = _static_efforts(system, q, v)[velocities]
    still, damping = casadi.substitute(efforts, v, 0 * v), casadi.jacobian(efforts, v)
    limits = [law.limit for laws in frictions.values() for _, law in laws]
    known = Function("known", [q, system.p], [still, damping, *limits], {"allow_free": True})
    if known.has_free():  # states, inputs, time, or velocities with a law that is not linear
        return None
    every = _samples(system, q, damping)
    if not every:
        return None
    sizes = _typical([M[:, velocities] for M in every])
    sizes[sizes == 0] = 1.0
    whole = [M / sizes[:, None] for M in every]
    count = max((rank(M) if M.any() else 0 for M in whole), default=0)
    damped = independent_rows([M[:, velocities] for M in every], count)  # the strongest rows first
    D = [M[:, velocities] for M in whole]
    if any(rank(M[np.ix_(damped, damped)]) < count for M in D if count):
        return None
    if any(not _is_alone(damping, velocities, k) or k not in damped for k in frictions):
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
    names = {k: tuple(name for name, _ in laws) for k, laws in frictions.items()}
    held = (Balance(velocities[k], float(sizes[k]), True, names.get(k, ())) for k in damped)
    return (*free, *held)


_Frictions = dict[int, list[tuple[str, Friction]]]
"""Component name and friction law of each dry friction, by index of the node that it acts on."""


def _frictions(system: System, nodes: Sequence[tuple[int, int]], q: SX, v: SX) -> _Frictions | None:
    """Return the dry frictions that act on massless nodes, by node.

    None if a stop or one-way element acts on a node, or if a friction does not act on a single node
    alone.

    Args:
        system: mechanism with massless nodes.
        nodes: (index in q, index in v) of each massless node.
        q: (nq, 1) symbols of positions.
        v: (nv, 1) symbols of velocities.
    """
    at, found = PartsAt(system, q, v), _Frictions()
    own = casadi.vertcat(*(x for k, j in nodes for x in (q[k], v[j])))
    for part in system.parts:
        if not part.element.switches:
            continue
        seen = at.at(part)
        laws = [*part.element.stops(seen).values(), *part.element.frictions(seen).values()]
        touched = [law for law in laws if casadi.depends_on(casadi.vertcat(*_motion(law)), own)]
        for law in touched:
            if not isinstance(law, Friction) or len(laws) > 1 or not _sticks_as_it_slides(law):
                return None
            number = next((n for n, (_, j) in enumerate(nodes) if _same(SX(law.slip), v[j])), None)
            if number is None:
                return None
            found.setdefault(number, []).append((part.name, law))
    return found


def _same(one: SX, other: SX) -> bool:
    """Whether two simplified expressions consist of the same operations."""
    return bool(casadi.is_equal(casadi.simplify(one), casadi.simplify(other), _DEPTH))


def _motion(law: Friction | Stop | OneWay) -> list[SX]:
    """Return the variable on which a law switches: gap of a stop, velocity of other elements."""
    if isinstance(law, Stop):
        return [SX(law.gap)]
    return [SX(law.slip if isinstance(law, Friction) else law.velocity)]


def _sticks_as_it_slides(law: Friction) -> bool:
    """Whether the friction at rest is equal to the friction while sliding."""
    return law.sticking is None or _same(SX(law.sticking), SX(law.limit))


def _is_alone(damping: SX, velocities: Sequence[int], node: int) -> bool:
    """Whether no damper connects a node to another node.

    Args:
        damping: (n, nv) derivatives of the efforts on nodes by velocities.
        velocities: indices in v of the nodes.
        node: index of the node.
    """
    row, column = SX(damping[node, :]), SX(damping[:, velocities[node]])
    row[velocities[node]], column[node] = 0, 0
    return bool(casadi.sparsify(row).nnz() == 0 and casadi.sparsify(column).nnz() == 0)


def _without_velocities(efforts: SX, D: SX, damped: Sequence[int], others: Sequence[int]) -> SX:
    """Return force balances from which the velocities are eliminated, one per row of `others`.

    Args:
        efforts: (n, 1) efforts at rest.
        D: (n, n) derivatives of the efforts by velocities. The damped rows have its full rank.
        damped: indices of the damped rows.
        others: indices of all other rows.
    """
    left = efforts[list(others)]
    if damped and others and not D[list(others), list(damped)].is_zero():
        share = solve_large(D[list(damped), list(damped)], efforts[list(damped)])
        left -= casadi.mtimes(D[list(others), list(damped)], share)
    return left


def _samples(system: System, q: SX, matrix: SX) -> list[NDArray[np.float64]]:
    """Return finite numeric values of a matrix expression of q at eight random configurations."""
    function = Function("matrix", [q, system.p], [casadi.densify(matrix)])
    rng = np.random.default_rng(_SEED)
    at = np.array(system.configuration) + rng.uniform(-_REACH, _REACH, (8, system.nq))
    found = [np.array(function(one, system.p_default)) for one in at]
    return [M for M in found if np.isfinite(M).all()]


def _typical(matrices: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Return medians (n,) of the absolute diagonals of several (n, n) matrices.

    Without matrices, the result is a single zero.
    """
    if not matrices:
        return np.zeros(1)
    found: NDArray[np.float64] = np.median([np.abs(np.diag(M)) for M in matrices], axis=0)
    return found
