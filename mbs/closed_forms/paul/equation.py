"""Equations of a split loop with few unknowns, sorted into terms of the joint positions."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from itertools import product

import casadi
import numpy as np
from casadi import DM, SX
from numpy.typing import NDArray

from mbs.closed_forms.displacement_matrices import SIZE, motion_parts, symbolic_rho
from mbs.closed_forms.paul.splits import (
    MOST_VARIABLES,
    KnownFrames,
    Members,
    SplitRow,
    Values,
    Variable,
    simple_rows,
    splits,
)
from mbs.closed_forms.sequence import ZERO
from mbs.recursions.chain import Ring

Key = tuple[int, ...]

PRODUCTS = 2
"""Largest number of variables in an equation with products of variables."""

_ALIKE = 2
"""Number of equations kept among multiples of each other: the cheapest one is known only after the
construction of steps."""

_WEIGHT = (0, 3, 2, 2, 2, 2, 1, 1, 1, 4, 4, 4, 6, 6, 6)


@dataclass(frozen=True, slots=True)
class Source:
    """Product of powers of joint positions from which part of an equation originates.

    Attributes:
        term: joint indices and their powers; for angles, the multiple m of e^(i m q).
        known: index of each known sum that is removed from the term, and its multiple.
        conjugate: whether the remaining angles have the opposite sign.
    """

    term: Members
    known: tuple[tuple[int, int], ...] = ()
    conjugate: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """Coefficient of one product of variables in an equation.

    Attributes:
        values: (samples,) G in Re(G e^i(angle)) times prismatic joints; real without an angle.
        sources: terms of joints whose sum it is.
    """

    values: Values
    sources: tuple[Source, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Equation:
    """Equation: the sum of its parts is zero.

    Attributes:
        row: frames and element of w from which the equation originates.
        variables: unknowns.
        parts: coefficients by the powers of the variables, for angles the multiples. A key and its
            conjugate do not both appear.
        patterns: all terms of joints in the equation.
        cost: estimated cost of the coefficients.
    """

    row: SplitRow
    variables: tuple[Variable, ...]
    parts: Mapping[Key, Part]
    patterns: frozenset[Members]
    cost: int

    @property
    def linear(self) -> bool:
        """Whether the equation is linear in cosines, sines and lengths of its variables."""
        return all(sum(abs(power) for power in key) <= 1 for key in self.parts)

    def at(self, key: Key) -> Values:
        """Return the values (samples,) of the coefficient with this key; zero if there is none."""
        part = self.parts.get(key)
        return np.zeros(1, dtype=complex) if part is None else part.values


def equations(knowledge: KnownFrames, most: int = PRODUCTS) -> tuple[Equation, ...]:
    """Return the equations of all splits with few unknowns, the two cheapest of equal equations.

    Args:
        knowledge: known joints and sums.
        most: largest number of variables in an equation with products of variables, before known
            sums are removed.
    """
    prismatic = frozenset(
        k for k, joint in enumerate(knowledge.ring.joints) if not joint.is_rotational
    )
    sums = [(known.members, at) for known, _, at in knowledge.open_sums()]
    found = dict[object, list[Equation]]()
    for split in splits(knowledge):
        for row, terms in simple_rows(split, prismatic, most):
            new = _equation(row, terms, prismatic, sums)
            if new is not None:
                found.setdefault(_fingerprint(new), []).append(new)
    return tuple(
        equation
        for equal in found.values()
        for equation in sorted(equal, key=lambda own: own.cost)[:_ALIKE]
    )


def _fingerprint(equation: Equation) -> object:
    """Return a hashable value that is equal for equations that are multiples of each other.

    It consists of the rounded coefficients at all samples, scaled to unit length and one sign.
    """
    keys = sorted(equation.parts)
    samples = max(len(part.values) for part in equation.parts.values())
    table = np.stack([np.broadcast_to(equation.parts[key].values, samples) for key in keys])
    size = np.linalg.norm(table, axis=0)
    table /= np.where(size > 0, size, 1.0) * np.where(_leading(table) < 0, -1.0, 1.0)
    return equation.variables, tuple(keys), (np.round(table, 6) + 0.0).tobytes()  # -0.0 is 0.0


def _leading(table: Values) -> NDArray[np.float64]:
    """Return for each column of a complex `table` a real number whose sign changes with the column.

    It is the first real or imaginary part of at least 0.3 of the largest, so that rounding does not
    decide its sign.
    """
    parts = np.concatenate([table.real, table.imag])
    largest = np.max(np.abs(parts), axis=0)
    # a value near zero must not decide; of values that are equal up to rounding, take the first
    first = np.argmax(np.abs(parts) > 0.3 * largest, axis=0)
    leading: NDArray[np.float64] = np.take_along_axis(parts, first[None], axis=0)[0]
    return leading


def _equation(
    row: SplitRow,
    terms: Mapping[Members, Values],
    prismatic: frozenset[int],
    sums: list[tuple[Members, NDArray[np.float64]]],
) -> Equation | None:
    """Return the equation of `terms` with its variables; None if there are too many variables.

    `sums` are known sums of angles, with their values at the samples, which are removed.
    """
    reduced = dict[Members, tuple[Values, list[Source]]]()
    for term, given in terms.items():
        turns = any(k not in prismatic for k, _ in term)
        rest, source, values = _without_known_sums(
            term, given * (2 if turns else 1), prismatic, sums
        )
        before = reduced.get(rest)
        if before is None:
            reduced[rest] = values, [source]
        else:
            reduced[rest] = before[0] + values, [*before[1], source]
    if sums:
        reduced = {term: own for term, own in reduced.items() if np.max(np.abs(own[0])) > ZERO}
    variables = _variables([*reduced], prismatic)
    if not variables or len(variables) > MOST_VARIABLES:
        return None
    parts = {
        _key(term, variables): Part(values, tuple(sources))
        for term, (values, sources) in reduced.items()
    }
    if len(parts) < len(reduced):
        return None
    cost = _WEIGHT[row.element] + sum(len(part.sources) for part in parts.values())
    equation = Equation(row, variables, parts, frozenset(terms), cost)
    return equation if len(variables) <= PRODUCTS or equation.linear else None


def _without_known_sums(
    term: Members,
    values: Values,
    prismatic: frozenset[int],
    sums: list[tuple[Members, NDArray[np.float64]]],
) -> tuple[Members, Source, Values]:
    """Remove the known sums of angles from a term; return the remaining term and its values.

    `values` (samples,) are the coefficients of the term, `sums` as in `_equation`.
    """
    rest, known = term, list[tuple[int, int]]()
    for number, (members, at) in enumerate(sums):
        powers = dict(rest)
        multiple = powers.get(members[0][0], 0) if members else 0
        if multiple and all(powers.get(k, 0) == multiple * sign for k, sign in members):
            rest = tuple(member for member in rest if member[0] not in dict(members))
            values = values * np.exp(1j * multiple * at)
            known.append((number, multiple))
    if not known:
        return term, Source(term), values
    leading = next((e for k, e in rest if k not in prismatic), 0)
    if leading < 0:
        rest = tuple((k, e if k in prismatic else -e) for k, e in rest)
        values = values.conj()
    elif leading == 0:
        values = values.real.astype(complex)
    return rest, Source(term, tuple(known), leading < 0), values


def _variables(terms: list[Members], prismatic: frozenset[int]) -> tuple[Variable, ...]:
    """Return the variables of terms; joints whose angles have a constant ratio are one variable.

    `terms` are products of powers of joint positions; `prismatic` are indices of prismatic joints.
    """
    columns = dict[int, list[int]]()
    for number, term in enumerate(terms):
        for k, power in term:
            columns.setdefault(k, [0] * len(terms))[number] = power
    groups = list[tuple[list[int], Variable]]()
    for k in sorted(columns):
        column = columns[k]
        for at, (leader, variable) in enumerate(groups):
            ratio = 1 if leader == column else -1 if leader == [-e for e in column] else 0
            if ratio and k not in prismatic and not variable.prismatic:
                groups[at] = (leader, Variable(False, (*variable.members, (k, ratio))))
                break
        else:
            groups.append((column, Variable(k in prismatic, ((k, 1),))))
    return tuple(variable for _, variable in groups)


def _key(term: Members, variables: tuple[Variable, ...]) -> Key:
    """Return the exponent of each variable in a term."""
    powers = dict(term)
    return tuple(powers.get(variable.members[0][0], 0) for variable in variables)


# Coefficients of an equation of a split loop, as expressions of known quantities.


@dataclass(frozen=True, slots=True, eq=False)
class RingMatrices:
    """Known transforms of a loop as (15, 15) matrices, see `symbolic_rho`; from `ring_matrices`.

    Attributes:
        on: matrices from joint to joint.
        back: matrices in the opposite direction.
        length: typical length of the loop [m].
    """

    on: tuple[SX, ...]
    back: tuple[SX, ...]
    length: SX


@dataclass(frozen=True, slots=True, eq=False)
class Factor:
    """Coefficients of X cos(angle) + Y sin(angle), or of X alone for a term without angle."""

    X: SX
    Y: SX


def ring_matrices(ring: Ring) -> RingMatrices:
    """Return the matrices (15, 15) of the known transforms of a loop.

    Args:
        ring: loop chain.
    """
    poses = [gap.pose for gap in ring.gaps]
    opposite = [gap.inverse().pose for gap in ring.gaps]
    on = tuple(map(symbolic_rho, poses, opposite))
    back = tuple(map(symbolic_rho, opposite, poses))
    squares = [SX(casadi.sumsqr(pose.p)) for pose in poses]
    numbers = [square for square in squares if square.is_constant() and float(square) > 0]
    # 1e-30 m if all symbolic lengths are zero, to prevent division by zero
    length = casadi.sqrt(sum(numbers or squares, SX(0 if numbers else 1e-60)))
    return RingMatrices(on, back, SX(length))


def factor(knowledge: KnownFrames, matrices: RingMatrices, equation: Equation, key: Key) -> Factor:
    """Return the coefficient of a product of variables in an equation, as an expression.

    Args:
        knowledge: known joints and sums.
        matrices: matrices of the known transforms.
        equation: equation with numeric coefficients.
        key: powers of the variables, for angles their multiples.
    """
    total, part = Factor(SX(0), SX(0)), equation.parts.get(key)
    if part is None:
        return total
    sums = [value for _, value, _ in knowledge.open_sums()]
    for source in part.sources:
        own = _single_term(knowledge, matrices, equation, source.term)
        if source.known:
            angle = sum((multiple * sums[number] for number, multiple in source.known), SX(0))
            own = _rotate(own, angle, source.conjugate)
        total = Factor(total.X + own.X, total.Y + own.Y)
    x, y = np.max(np.abs(part.values.real)), np.max(np.abs(part.values.imag))
    return Factor(total.X if x > ZERO else SX(0), total.Y if y > ZERO else SX(0))


def _rotate(own: Factor, angle: SX, conjugate: bool) -> Factor:
    """Return X and Y of G = X - i Y times e^i(angle), or of its conjugate.

    `own` contains X and Y; `conjugate` selects the conjugate of G.
    """
    c, s = casadi.cos(angle), casadi.sin(angle)
    X, Y = own.X * c + own.Y * s, own.Y * c - own.X * s
    return Factor(SX(X), SX(-Y if conjugate else Y))


def _single_term(
    knowledge: KnownFrames, matrices: RingMatrices, equation: Equation, term: Members
) -> Factor:
    """Return X and Y of the product of joint powers `term` in an equation."""
    joints = knowledge.ring.joints
    prismatic = {k: power for k, power in term if not joints[k].is_rotational}
    angles = [(k, sign) for k, sign in term if joints[k].is_rotational]
    if not angles:
        return Factor(_coefficient(knowledge, matrices, equation.row, prismatic), SX(0))
    if not _has_partner(equation, prismatic, angles, term):
        cosines = {k: 1 for k, _ in angles}
        with_sine = cosines | {angles[0][0]: 2}
        return Factor(
            _coefficient(knowledge, matrices, equation.row, prismatic | cosines),
            _coefficient(knowledge, matrices, equation.row, prismatic | with_sine),
        )
    return _combined_term(knowledge, matrices, equation.row, (prismatic, angles))


def _has_partner(
    equation: Equation,
    prismatic: Mapping[int, int],
    angles: list[tuple[int, int]],
    term: Members,
) -> bool:
    """Whether the equation contains another term of the same joints with other signs of angles.

    `prismatic` maps joints to powers, `angles` are pairs of joint and sign, both of `term`.
    """
    pattern = {k for k, _ in angles} | set(prismatic)
    return any(
        other != term
        and {k for k, _ in other} == pattern
        and all(prismatic.get(k, power) == power for k, power in other)
        for other in equation.patterns
    )


def _combined_term(
    knowledge: KnownFrames,
    matrices: RingMatrices,
    row: SplitRow,
    term: tuple[Mapping[int, int], list[tuple[int, int]]],
) -> Factor:
    """Return G = X - i Y of a term from all products of cosines and sines of its joints.

    `term` is the powers of prismatic joints, and the pairs of joint and sign of revolute joints.

    `row` is the equation, `matrices` and `knowledge` the known transforms and joints.
    """
    prismatic, angles = term
    X, Y = SX(0), SX(0)
    for choice in product((1, 2), repeat=len(angles)):
        weight = 2 * np.prod(
            [0.5 if c == 1 else -0.5j * e for c, (_, e) in zip(choice, angles, strict=True)]
        )
        chosen = {k: c for c, (k, _) in zip(choice, angles, strict=True)}
        value = _coefficient(knowledge, matrices, row, dict(prismatic) | chosen)
        X, Y = X + weight.real * value, Y - weight.imag * value
    return Factor(SX(X), SX(Y))


def _coefficient(
    knowledge: KnownFrames, matrices: RingMatrices, row: SplitRow, chosen: Mapping[int, int]
) -> SX:
    """Return the coefficient of a product of elementary functions of the joints.

    Args:
        knowledge: known joints, whose positions are inserted.
        matrices: matrices of the known transforms.
        row: frames and element of w of the equation.
        chosen: index of the function of each joint in the product, see `motion_parts`.
    """
    total = SX(0)
    for direction in (1, -1):
        steps = list(_path(row, len(matrices.on), direction))
        if all(("joint", k) in steps for k in chosen):
            total += direction * _path_element(knowledge, matrices, (row, steps, direction), chosen)
    return SX(total)


def _path(row: SplitRow, n: int, direction: int) -> Iterator[tuple[str, int]]:
    """Yield ("joint", k) or ("gap", k) from the start frame to the end frame of an equation `row`.

    The loop has n joints and is traversed forwards (`direction` 1) or backwards (-1).
    """
    point = row.start
    while point != row.end:
        at = point if direction > 0 else (point - 1) % (2 * n)
        yield ("joint", at // 2) if at % 2 == 0 else ("gap", (at // 2 + 1) % n)
        point = (point + direction) % (2 * n)


def _path_element(
    knowledge: KnownFrames,
    matrices: RingMatrices,
    path: tuple[SplitRow, list[tuple[str, int]], int],
    chosen: Mapping[int, int],
) -> SX:
    """Return an element of w at the end of a path through joints and known transforms.

    `path` is the row, its steps and the direction; `chosen` is as in `_coefficient`. The vector w
    (15,) contains products of origin and z axis of a frame.
    """
    row, steps, direction = path
    r = SX(1, SIZE)
    r[0, row.element] = 1
    for kind, k in steps:
        if kind == "gap":
            matrix = (matrices.on if direction > 0 else matrices.back)[k]
        else:
            matrix = _joint_matrix(knowledge, k, chosen.get(k, 0), direction)
        r = SX(casadi.sparsify(casadi.mtimes(r, matrix)))
        if r.nnz() == 0:
            return SX(0)
    return SX(r[0, 0] + r[0, 6 + row.seed])


def _joint_matrix(knowledge: KnownFrames, k: int, number: int, direction: int) -> SX:
    """Return the matrix (15, 15) of joint k at its known position.

    For an unknown joint, it is the basis matrix with index `number`.
    """
    joint = knowledge.ring.joints[k]
    sign = direction * joint.sign
    if k not in knowledge.known:
        return _sparse_basis(joint.is_rotational, sign)[number]
    basis, q = _sparse_basis(joint.is_rotational, 1), knowledge.position(k)
    if joint.is_rotational:
        return SX(basis[0] + casadi.cos(q) * basis[1] + (sign * casadi.sin(q)) * basis[2])
    return SX(basis[0] + (sign * q) * basis[1] + (q * q) * basis[2])


@cache
def _sparse_basis(turns: bool, sign: int) -> tuple[SX, SX, SX]:
    """Return three basis matrices of a joint that moves with (sign 1) or against the path (-1).

    They multiply 1, cos q, sin q, or 1, r, r^2. `turns` is whether the joint is revolute.
    """
    one, first, second = (SX(casadi.sparsify(DM(matrix))) for matrix in motion_parts(not turns))
    return (one, first, sign * second) if turns else (one, sign * first, second)
