"""The configuration at which the loops of a mechanism are assembled: the nearest to the guesses."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

import casadi
import numpy as np
from casadi import SX, Function
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.components.joints import Motion
from mbs.errors import Unclosable
from mbs.loops.closing import CLOSED, Closing, candidates, difference, unwound
from mbs.loops.configuration import closed_configuration
from mbs.loops.cut_positions import cut_positions
from mbs.solvers.least_squares import gauss_newton

Vector = NDArray[np.float64]

_FEW = 24
"""Free positions up to which other configurations are searched: a search costs a start each, and
larger mechanisms are assembled near their guesses."""
_NEAR = 0.1
"""Distance of a configuration from its start below which no other one is searched [rad, or sizes of
the mechanism]: branches that are nearer to each other meet there."""
_EQUAL = 1e-6
"""Difference of distances that are equal: configurations are closed to 1e-12, and branches of
symmetric mechanisms are equally near up to rounding."""


@dataclass(frozen=True, slots=True, eq=False)
class Assembled:
    """A closed configuration.

    Attributes:
        q: (nq,) positions [rad or m].
        others: further configurations with the same locked positions.
    """

    q: Vector
    others: tuple[Vector, ...] = ()


def assembled_configuration(system: System, guess: Mapping[str, float], p: Vector) -> Assembled:
    """Return the configuration that closes the loops and is nearest to a guess.

    A position without a guess counts as zero. A guess that closes the loops is returned unchanged.
    Otherwise some positions are held, and the loops are closed with the other positions. Several
    sets of held positions are tried in turn, until the loops close:

    1. if a position is guessed: all positions except the unknowns of components, such as the
       parameter of a curve;
    2. guessed positions, positions of motors, and joints with a spring; a joint with a spring that
       has no guess is held where the spring has no force;
    3. smaller sets of these; those without the joints with springs come last.

    The distance of two configurations is the largest difference of a position. Lengths are divided
    by the size of the mechanism. Positions of joints that are cut count too. If two
    configurations are at the same distance, the first position that differs decides, in the order
    of the description: the larger value is taken.
    Solved angles are within half a turn of their guess, or of zero.

    Args:
        system: its loops need not be closed yet.
        guess: approximate positions by coordinate name [rad or m].
        p: (np,) parameters.

    Raises:
        Unclosable: no configuration closes the loops.
    """
    names = [coordinate.name for coordinate in system.coordinates]
    known = {name: value for name, value in guess.items() if name in names}
    given = np.array(system.position(known))
    rest = rest_positions(system, p)
    start = np.array(system.position({**{names[k]: x for k, x in rest.items()}, **known}))
    target = _Target.of(system, p, start, guess)
    if _closes(Closing(system, p), given) and target.meets_cuts(given):
        return Assembled(given)
    unknown = _unknowns(system)
    guessed = {k for k, name in enumerate(names) if name in known} - unknown
    stages = list(_stages(system, unknown, guessed, set(rest)))
    for locked in stages:
        closing = Closing(system, p, tuple(sorted(locked)))
        found = _nearest(closing, target)
        if found is not None:
            return _with_cuts_met(found, target, stages)
    motors = tuple(k for k, c in enumerate(system.coordinates) if c.actuated)
    try:
        q = closed_configuration(Closing(system, p, motors), start, restarts=10)
    except Unclosable:
        q = closed_configuration(Closing(system, p), start)
    return Assembled(unwound(Closing(system, p), q, start))


# Comparison of configurations with the guess.


@dataclass(frozen=True, slots=True, eq=False)
class _Target:
    """Positions of all joints that an assembled configuration is to be near to.

    All positions are q, then the positions of joints that are cut. Therefore the comparison does
    not depend on the joint of a loop that is cut.

    Attributes:
        system: its loops need not be closed yet.
        p: (np,) parameters.
        start: (nq,) positions.
        cut: (c,) positions of `system.cut_coordinates`.
        guessed: indices of the guessed positions among all positions.
    """

    system: System
    p: Vector
    start: Vector
    cut: Vector
    guessed: tuple[int, ...]

    @staticmethod
    def of(system: System, p: Vector, start: Vector, guess: Mapping[str, float]) -> _Target:
        """The target of a start and a guess by coordinate name."""
        rows = system.cut_coordinates
        cut = [guess.get(row.name, float(row.name.endswith(".qw"))) for row in rows]
        names = [row.name for row in (*system.coordinates, *rows)]
        guessed = tuple(k for k, name in enumerate(names) if name in guess)
        return _Target(system, p, start, np.array(cut, dtype=float), guessed)

    @property
    def guessed_cuts(self) -> list[int]:
        """Indices of guessed positions in `system.cut_coordinates`."""
        return [k - self.system.nq for k in self.guessed if k >= self.system.nq]

    def cut_moves(self, q: Vector) -> Vector:
        """(c,) differences of positions of cut joints from the target [rad, m or 1]."""
        rows = self.system.cut_coordinates
        found = np.array(cut_positions(self.system)(q, self.p)).ravel()
        moves = found - self.cut
        turns = np.array([row.unit == "rad" for row in rows], dtype=bool)
        moves[turns] = np.remainder(moves[turns] + np.pi, 2 * np.pi) - np.pi
        for k, row in enumerate(rows):
            if row.name.endswith(".qw"):
                part = slice(k, k + 4)
                moves[part] = min(moves[part], found[part] + self.cut[part], key=_largest)
        return moves

    def meets_cuts(self, q: Vector) -> bool:
        """Whether guessed positions of cut joints have their values."""
        guessed = self.guessed_cuts
        return not guessed or _largest(self.cut_moves(q)[guessed]) < _EQUAL

    def distances(self, q: Vector, size: float) -> tuple[float, float]:
        """Largest move of a guessed position and of any [rad, or sizes of the mechanism].

        Args:
            q: (nq,) configuration.
            size: size of the mechanism [m].
        """
        rows = (*self.system.coordinates, *self.system.cut_coordinates)
        scales = np.where([row.unit.startswith("m") for row in rows], size, 1.0)
        moves = np.concatenate([difference(self.system, q, self.start), self.cut_moves(q)])
        moves = np.abs(moves / scales)
        return _largest(moves[list(self.guessed)]), _largest(moves)


def _largest(values: Vector) -> float:
    return float(np.max(np.abs(values), initial=0.0))


def _with_cuts_met(found: Assembled, target: _Target, stages: Iterable[set[int]]) -> Assembled:
    """The configuration with guessed positions of cut joints, if the others can follow."""
    if target.meets_cuts(found.q):
        return found
    system, p, guessed = target.system, target.p, target.guessed_cuts
    q, given = SX.sym("q", system.nq), SX.sym("p", system.p.numel())
    own = cut_positions(system)(q, given)[guessed]
    slopes = Function("cut_slopes", [q, given], [casadi.densify(casadi.jacobian(own, q))])
    for locked in stages:
        closing = Closing(system, p, tuple(sorted(locked)))
        free = closing.free

        def residual(x: Vector, closing: Closing = closing) -> tuple[Vector, Vector]:
            at = found.q.copy()
            at[closing.free] = x
            r, J = closing.rows(at)
            more = np.array(slopes(at, p))[:, closing.free]
            return np.concatenate([r, target.cut_moves(at)[guessed]]), np.vstack([J, more])

        met = list[Vector]()
        for start in (found.q, *candidates(closing, target.start)):
            root = gauss_newton(residual, start[free])
            at = found.q.copy()
            at[free] = root.x
            if root.converged and closing.faces(at):
                met.append(unwound(closing, at, target.start))
        if met:
            return _best(closing, met, target)
    return found


def rest_positions(system: System, p: Vector) -> dict[int, float]:
    """Return positions at which springs of joints have no force [rad or m], by index in q.

    Joints without a spring are left out.
    """
    found = dict[int, float]()
    for link in system.tree.links:
        if link.motion in (Motion.FREE, Motion.SPHERICAL):
            continue
        values = Function("spring", [system.p], [link.stiffness, link.rest])(p)
        stiffness, rest = (float(value) for value in values)
        if stiffness > 0 and np.isfinite(rest):
            found[link.q.start] = rest
    return found


def _unknowns(system: System) -> set[int]:
    """Indices of the coordinates that are unknowns of components, or massless nodes."""
    names = {
        f"{part.name}.{name}" for part in system.parts for name in part.element.names_of("unknown")
    }
    found = {k for k, coordinate in enumerate(system.coordinates) if coordinate.name in names}
    return found | {position for position, _, _ in system.balanced}


def _stages(
    system: System, unknown: set[int], guessed: set[int], rest: set[int]
) -> Iterator[set[int]]:
    """Indices of locked positions, fewer in each stage."""
    motors = {k for k, c in enumerate(system.coordinates) if c.actuated}
    stages = []
    if unknown and guessed:
        stages.append(set(range(system.nq)) - unknown)
    stages += [guessed | motors | rest, guessed | rest, (guessed & motors) | rest, motors | rest]
    stages += [rest, guessed, guessed & motors, motors, set()]
    for number, locked in enumerate(stages):
        if locked not in stages[:number]:
            yield locked


def _nearest(closing: Closing, target: _Target) -> Assembled | None:
    """The closed configuration nearest to the target; None if none is found."""
    system, free, start = closing.system, closing.free, target.start
    if not free:
        return Assembled(start) if _closes(closing, start) else None
    first = closing.nearest(start)
    if first.is_closed:
        q = unwound(closing, first.q, start)
        if len(free) > _FEW or target.distances(q, closing.size)[1] < _NEAR:
            return Assembled(q)
    elif len(free) > _FEW:
        return None
    found = [q] if first.is_closed else []
    for other in candidates(closing, start):
        if not any(np.abs(difference(system, other, one)).max() < _EQUAL for one in found):
            found.append(other)
    return _best(closing, found, target) if found else None


def _best(closing: Closing, found: list[Vector], target: _Target) -> Assembled:
    """The nearest of some configurations to the target, and the others."""
    best = found[0]
    for other in found[1:]:
        if _is_nearer(closing, other, best, target):
            best = other
    others = [q for q in found if np.abs(difference(closing.system, q, best)).max() > _EQUAL]
    return Assembled(best, tuple(others))


def _closes(closing: Closing, q: Vector) -> bool:
    """Whether a configuration closes the loops as it is."""
    return closing.openness(q) <= CLOSED and closing.faces(q)


def _is_nearer(closing: Closing, q: Vector, other: Vector, target: _Target) -> bool:
    """Whether the configuration q is nearer to the target than the configuration `other`.

    Guessed positions are compared first, then all positions. If both are equally near, the first
    position that differs decides, in the order of the description: the larger value is nearer.
    """
    own, others = (target.distances(one, closing.size) for one in (q, other))
    for distance, least in zip(own, others, strict=True):
        if abs(distance - least) > _EQUAL:
            return distance < least
    system = closing.system
    order = {row.name: number for number, row in enumerate(system.joints)}
    moves = difference(system, q, other)
    apart = [k for k in range(system.nq) if abs(moves[k]) > _EQUAL]
    first = min(apart, key=lambda k: order.get(system.coordinates[k].joint, k), default=None)
    return first is not None and bool(moves[first] > 0)
