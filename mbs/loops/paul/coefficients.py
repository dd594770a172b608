"""Coefficients of an equation of a split loop, as expressions of what is known."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from itertools import product

import casadi
import numpy as np
from casadi import DM, SX

from mbs.loops.paul.equation import Equation, Key
from mbs.loops.paul.knowledge import Knowledge, Members
from mbs.loops.paul.representation import SIZE, joint_basis, represented_pose
from mbs.loops.paul.terms import ZERO, Row


@dataclass(frozen=True, slots=True, eq=False)
class Ways:
    """The matrices of the gaps of a loop, forwards and backwards, and a length of it.

    Attributes:
        on, back: (15, 15) each.
        length: of the size of the loop [m].
    """

    on: tuple[SX, ...]
    back: tuple[SX, ...]
    length: SX


@dataclass(frozen=True, slots=True, eq=False)
class Factor:
    """X cos(angle) + Y sin(angle), or X alone where there is no angle."""

    X: SX
    Y: SX


def ways(knowledge: Knowledge) -> Ways:
    """The matrices of the gaps of a loop."""
    poses = [gap.pose for gap in knowledge.ring.gaps]
    opposite = [gap.inverse().pose for gap in knowledge.ring.gaps]
    on = tuple(map(represented_pose, poses, opposite))
    back = tuple(map(represented_pose, opposite, poses))
    squares = [SX(casadi.sumsqr(pose.p)) for pose in poses]
    numbers = [square for square in squares if square.is_constant() and float(square) > 0]
    length = casadi.sqrt(sum(numbers or squares, SX(0 if numbers else 1e-60)))
    return Ways(on, back, SX(length))


def factor(knowledge: Knowledge, ways: Ways, equation: Equation, key: Key) -> Factor:
    """What stands with a product of the variables of an equation."""
    total, part = Factor(SX(0), SX(0)), equation.parts.get(key)
    if part is None:
        return total
    sums = [value for _, value, _ in knowledge.open_sums()]
    for source in part.sources:
        own = _own(knowledge, ways, equation, source.term)
        if source.known:
            angle = sum((way * sums[number] for number, way in source.known), SX(0))
            own = _turned(own, angle, source.conjugate)
        total = Factor(total.X + own.X, total.Y + own.Y)
    x, y = np.max(np.abs(part.values.real)), np.max(np.abs(part.values.imag))
    return Factor(total.X if x > ZERO else SX(0), total.Y if y > ZERO else SX(0))


def _turned(own: Factor, angle: SX, conjugate: bool) -> Factor:
    """X and Y of G = X - i Y times e^i(angle), or of its conjugate."""
    c, s = casadi.cos(angle), casadi.sin(angle)
    X, Y = own.X * c + own.Y * s, own.Y * c - own.X * s
    return Factor(SX(X), SX(-Y if conjugate else Y))


def _own(knowledge: Knowledge, ways: Ways, equation: Equation, term: Members) -> Factor:
    """X and Y of one product of powers of the joints."""
    joints = knowledge.ring.joints
    slides = {k: power for k, power in term if not joints[k].turns}
    angles = [(k, sign) for k, sign in term if joints[k].turns]
    if not angles:
        return Factor(_coefficient(knowledge, ways, equation.row, slides), SX(0))
    if not _has_partner(equation, slides, angles, term):
        cosines = {k: 1 for k, _ in angles}
        with_sine = cosines | {angles[0][0]: 2}
        return Factor(
            _coefficient(knowledge, ways, equation.row, slides | cosines),
            _coefficient(knowledge, ways, equation.row, slides | with_sine),
        )
    return _mixed(knowledge, ways, equation.row, (slides, angles))


def _has_partner(
    equation: Equation,
    slides: Mapping[int, int],
    angles: list[tuple[int, int]],
    term: Members,
) -> bool:
    """Whether the same joints come together with other signs too."""
    pattern = {k for k, _ in angles} | set(slides)
    return any(
        other != term
        and {k for k, _ in other} == pattern
        and all(slides.get(k, power) == power for k, power in other)
        for other in equation.patterns
    )


def _mixed(
    knowledge: Knowledge,
    ways: Ways,
    row: Row,
    term: tuple[Mapping[int, int], list[tuple[int, int]]],
) -> Factor:
    """G = X - i Y from all products of cosines and sines of the joints."""
    slides, angles = term
    X, Y = SX(0), SX(0)
    for choice in product((1, 2), repeat=len(angles)):
        weight = 2 * np.prod(
            [0.5 if c == 1 else -0.5j * e for c, (_, e) in zip(choice, angles, strict=True)]
        )
        chosen = {k: c for c, (k, _) in zip(choice, angles, strict=True)}
        value = _coefficient(knowledge, ways, row, dict(slides) | chosen)
        X, Y = X + weight.real * value, Y - weight.imag * value
    return Factor(SX(X), SX(Y))


def _coefficient(knowledge: Knowledge, ways: Ways, row: Row, chosen: Mapping[int, int]) -> SX:
    """What stands with a product of the elementary functions of the joints.

    Args:
        knowledge: whose known joints are put in.
        ways: the gaps.
        row: of the equation.
        chosen: number of the function of each joint of the product: see `joint_basis`.
    """
    total = SX(0)
    for way in (1, -1):
        steps = list(_steps(row, len(ways.on), way))
        if all(("joint", k) in steps for k in chosen):
            total += way * _along(knowledge, ways, (row, steps, way), chosen)
    return SX(total)


def _steps(row: Row, n: int, way: int) -> Iterator[tuple[str, int]]:
    """The joints and the gaps between two frames, on one way around the loop."""
    point = row.start
    while point != row.end:
        at = point if way > 0 else (point - 1) % (2 * n)
        yield ("joint", at // 2) if at % 2 == 0 else ("gap", (at // 2 + 1) % n)
        point = (point + way) % (2 * n)


def _along(
    knowledge: Knowledge,
    ways: Ways,
    path: tuple[Row, list[tuple[str, int]], int],
    chosen: Mapping[int, int],
) -> SX:
    """The element of w at the end of a way."""
    row, steps, way = path
    r = SX(1, SIZE)
    r[0, row.element] = 1
    for kind, k in steps:
        if kind == "gap":
            matrix = (ways.on if way > 0 else ways.back)[k]
        else:
            matrix = _joint(knowledge, k, chosen.get(k, 0), way)
        r = SX(casadi.sparsify(casadi.mtimes(r, matrix)))
        if r.nnz() == 0:
            return SX(0)
    return SX(r[0, 0] + r[0, 6 + row.seed])


def _joint(knowledge: Knowledge, k: int, number: int, way: int) -> SX:
    """One of the factors of an unknown joint, or the whole of a known one."""
    joint = knowledge.ring.joints[k]
    sign = way * joint.sign
    if k not in knowledge.known:
        return _sparse_basis(joint.turns, sign)[number]
    basis, q = _sparse_basis(joint.turns, 1), knowledge.position(k)
    if joint.turns:
        return SX(basis[0] + casadi.cos(q) * basis[1] + (sign * casadi.sin(q)) * basis[2])
    return SX(basis[0] + (sign * q) * basis[1] + (q * q) * basis[2])


@cache
def _sparse_basis(turns: bool, sign: int) -> tuple[SX, SX, SX]:
    """The factors of a joint that moves with or against the way."""
    one, first, second = (SX(casadi.sparsify(DM(matrix))) for matrix in joint_basis(not turns))
    return (one, first, sign * second) if turns else (one, sign * first, second)
