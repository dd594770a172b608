"""Conditions at which the laws of efforts, inputs and loads jump, bend or act only briefly.

Conditions on time, constants and parameters result in times at which integration steps end.
Conditions on states result in expressions whose zero crossings are events.

Source: Cellier and Kofman 2006, chapter 9, for events in time and in states.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import casadi
import numpy as np
from casadi import SX, Function
from numpy.typing import NDArray

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

# Detection of conditions in a graph of scalar operations.


_TIME, _POSITION, _OTHER = 1, 2, 4
"""Bits of the dependence of an expression on symbols; 0 for constants and parameters."""

_DIFFERENCE = {casadi.OP_LT, casadi.OP_LE, casadi.OP_FMIN, casadi.OP_FMAX}
_SELF = {casadi.OP_SIGN, casadi.OP_FABS}
_BENDS = {casadi.OP_FMIN, casadi.OP_FMAX, casadi.OP_FABS}
_STEEP = {casadi.OP_TANH, casadi.OP_ERF, casadi.OP_ATAN}
_WAVES = {casadi.OP_SIN, casadi.OP_COS, casadi.OP_TAN}
_LINEAR = {casadi.OP_ADD, casadi.OP_SUB, casadi.OP_NEG, casadi.OP_TWICE}
_ARITHMETIC = {*_LINEAR, casadi.OP_MUL, casadi.OP_DIV, casadi.OP_INV, casadi.OP_SQ}

_NEGLIGIBLE = 20.0
"""Negative exponent beyond which an exponential counts as zero: exp(-20) is 2e-9."""


@dataclass(slots=True)
class Conditions:
    """Conditions in the expressions of laws.

    Attributes:
        zeros: expressions of time at whose zeros a law jumps or bends.
        wholes: expressions of time at whose integer values a law jumps.
        terms: expressions of time only, from which the laws are formed with states.
        hints: expressions of time near whose zeros a smooth law changes within a short time.
        phases: arguments of waves and of periodic laws in periods, expressions of time.
        crossings: expressions of states at whose zeros a law jumps, bends or starts to act briefly.
        counts: expressions of states at whose integer values a law jumps.
        short: elements of `crossings` near whose zeros a smooth law acts only briefly.
    """

    zeros: list[SX] = field(default_factory=list)
    wholes: list[SX] = field(default_factory=list)
    terms: list[SX] = field(default_factory=list)
    hints: list[SX] = field(default_factory=list)
    phases: list[SX] = field(default_factory=list)
    crossings: list[SX] = field(default_factory=list)
    counts: list[SX] = field(default_factory=list)
    short: list[SX] = field(default_factory=list)


@dataclass(slots=True)
class _Walk:
    """Traversal of the graph of expressions, with the dependence of each node.

    Attributes:
        known: dependence of each symbol, by hash; other symbols are states.
        depends: dependence of each visited node, by hash, in the order of traversal.
        nodes: visited nodes, by hash.
    """

    known: Mapping[int, int]
    depends: dict[int, int] = field(default_factory=dict)
    nodes: dict[int, SX] = field(default_factory=dict)

    def visit(self, root: SX) -> None:
        """Visit all nodes of an expression, operands first."""
        stack = [(root, False)]
        while stack:
            node, ready = stack.pop()
            key = node.element_hash()
            if key in self.depends:
                continue
            operands = operands_of(node)
            if not ready and operands:
                stack.append((node, True))
                stack += [(one, False) for one in operands]
                continue
            self.nodes[key] = node
            if node.is_symbolic():
                self.depends[key] = self.known.get(key, _OTHER)
            else:
                found = 0
                for one in operands:
                    found |= self.depends[one.element_hash()]
                self.depends[key] = found

    def of(self, node: SX) -> int:
        """Return the dependence of a visited node."""
        return self.depends[node.element_hash()]


def operands_of(node: SX) -> list[SX]:
    """Return the operands of a scalar expression; symbols and constants have no operands."""
    if node.is_symbolic() or node.is_constant():
        return []
    return [node.dep(k) for k in range(node.n_dep())]


def conditions_of(
    laws: SX, time: SX, positions: SX, constants: SX, *, jumps_alone: bool = False
) -> Conditions:
    """Find the conditions in the expressions of laws.

    Args:
        laws: (n, 1) expressions.
        time: symbol of the time; empty for laws without time.
        positions: symbols of positions.
        constants: symbols that are constant during a motion, such as parameters.
        jumps_alone: whether bends and brief smooth laws are omitted.
    """
    found = Conditions()
    known = {
        symbol.element_hash(): value
        for symbols, value in ((time, _TIME), (positions, _POSITION), (constants, 0))
        for symbol in _elements(symbols)
    }
    walk = _Walk(known)
    roots = list(_elements(casadi.densify(laws)))
    for root in roots:
        walk.visit(root)
    for key, node in walk.nodes.items():
        depends = walk.depends[key]
        if depends and not node.is_symbolic():
            _collect(node, depends, found, jumps_alone=jumps_alone)
    if any(value & _TIME for value in walk.depends.values()):
        found.terms += _terms(walk, roots)
    return found


def _elements(symbols: SX) -> Iterator[SX]:
    dense = casadi.vec(casadi.densify(SX(symbols)))
    return (dense[k] for k in range(dense.numel()))


def _collect(node: SX, depends: int, found: Conditions, *, jumps_alone: bool) -> None:
    """Add the conditions of a node to `found`."""
    if node.is_call() or node.is_output() or (jumps_alone and node.op() in _BENDS):
        return  # an interpolant is continuous
    alone = depends == _TIME
    for kind, value in _condition(node.op(), operands_of(node)):
        if kind == "side":
            (found.zeros if alone else found.crossings).append(value)
        elif kind == "count":
            (found.wholes if alone else found.counts).append(value)
        if alone and kind in ("count", "phase"):
            found.phases.append(value)
        elif alone and kind in ("steep", "negligible"):
            found.hints.append(value)
        elif (
            kind == "negligible"
            and not jumps_alone
            and depends & _POSITION
            and not depends & _OTHER
        ):
            found.crossings.append(value)
            found.short.append(value)


def _condition(op: int, operands: Sequence[SX]) -> Iterator[tuple[str, SX]]:
    """Yield kind and value of each condition of an operation.

    A law jumps or bends at the zeros of a "side" and at integer values of a "count". An exponential
    is "negligible" below a zero. A "steep" function changes near a zero. A "phase" counts periods.
    """
    first, *others = operands
    if op in _DIFFERENCE:
        yield "side", first - others[0]
    elif op in _SELF:
        yield "side", first
    elif op == casadi.OP_COPYSIGN:
        yield "side", others[0]
    elif op == casadi.OP_ATAN2:  # atan2 jumps at half a revolution
        yield "side", casadi.if_else(others[0] < 0, first, 1)
    elif op == casadi.OP_EXP:
        yield "negligible", first + _NEGLIGIBLE
    elif op in _STEEP:
        yield "steep", first
    elif op in _WAVES:
        yield "phase", first / (2 * math.pi)
    else:
        yield from _whole(op, operands)


def _whole(op: int, operands: Sequence[SX]) -> Iterator[tuple[str, SX]]:
    """Yield the conditions of integer parts and remainders."""
    first, *others = operands
    if op == casadi.OP_FLOOR:
        yield "count", first
    elif op == casadi.OP_CEIL:
        yield "count", -first
    elif op == casadi.OP_FMOD:  # the ratio is truncated towards zero
        yield "side", first
        yield "count", casadi.fabs(first / others[0])
    elif op == casadi.OP_REMAINDER:  # the ratio is rounded
        yield "count", first / others[0] + 0.5


def _terms(walk: _Walk, roots: Sequence[SX]) -> list[SX]:
    """Return the expressions of time only that states or outputs use; sums as their summands."""
    used = {root.element_hash(): root for root in roots if walk.of(root) == _TIME}
    for key, node in walk.nodes.items():
        if walk.depends[key] & ~_TIME:
            for one in operands_of(node):
                if walk.of(one) == _TIME:
                    used[one.element_hash()] = one
    terms: dict[int, SX] = {}
    left, seen = list(used.values()), set[int]()
    while left:
        node = left.pop()
        if node.element_hash() in seen:
            continue
        seen.add(node.element_hash())
        if node.is_symbolic():
            continue
        is_sum = not (node.is_call() or node.is_output()) and node.op() in _LINEAR
        if is_sum:
            left += [one for one in operands_of(node) if walk.of(one) == _TIME]
        else:
            terms[node.element_hash()] = node
    return list(terms.values())


_DEPTH = 50
"""Depth of operations to which expressions are compared: more than conditions of laws have."""


def distinct(values: Sequence[SX], known: Sequence[SX]) -> list[SX]:
    """Remove expressions that are equal to an earlier expression up to the sign.

    Args:
        values: expressions.
        known: expressions that are removed from `values` too.
    """
    every, found = list(known), list[SX]()
    for value in values:
        twins = (value, -value)
        if not any(casadi.is_equal(one, twin, _DEPTH) for one in every for twin in twins):
            found.append(value)
            every.append(value)
    return found


# Times at which integration steps end.


_CELLS = 2048
"""Minimum number of cells of a time interval in the search for zeros of a function of time. The
cells resolve a pulse of a smooth law whose width is a thousandth of the interval."""
_PER_PERIOD = 16
"""Number of cells per period of a wave, which separates both zeros of its slope."""
_MOST_CELLS = 2_000_000
"""Maximum number of cells: more cells would require gigabytes of memory."""
_HALVINGS = 80
"""Maximum number of bisections of a zero: more than the bits of a double, so that they end at
adjacent numbers."""
_SECTIONS = 60
"""Number of golden sections in the search for an extremum: 0.62^60 is 3e-13 of the cell."""
_GOLDEN = (math.sqrt(5) - 1) / 2
_ROUNDS = 6
"""Maximum number of searches, each with the jumps of the search before: the largest depth of nested
conditions."""
_UNEVEN = 0.02
"""Largest deviation of a law from a straight line in a cell, as a fraction of its range."""
_LEVELS = 40
"""Maximum number of bisections of a cell in which a law deviates from a straight line."""
_MOST_POINTS = 200_000
"""Maximum number of samples of a law."""
_VARIATION = 0.45
"""Variation of a law at which an interval ends, as a fraction of its range. It differs from 1/2, so
that no end is on the axis of a symmetric pulse."""
_SHORTER = 4.0
"""Ratio of two intervals above which error control might step over the shorter interval."""
_NEAR_ZERO = 1e-3
"""Lower limit of the reference time for rounding, as a fraction of the interval."""
_SAME = 1e3 * float(np.finfo(float).eps)
"""Largest relative difference of simultaneous jumps; the integrator has the same tolerance."""


@dataclass(frozen=True, slots=True, eq=False)
class TimeLaws:
    """Parts of laws that depend on time only: Functions of (t, p), each with a column of values.

    Attributes:
        lines: Function of p: (a, 2) constants and slopes of the conditions that are linear in time.
        zeros: conditions at whose zeros a law jumps or bends.
        wholes: conditions at whose integer values a law jumps.
        terms: smooth parts of laws.
        hints: expressions near whose zeros a smooth law changes within a short time.
        rates: rates of phases, in periods per second.
        p: number of parameters; zero if the laws depend on no parameter.
    """

    lines: Function
    zeros: Function
    wholes: Function
    terms: Function
    hints: Function
    rates: Function
    p: int

    def stops(self, begin: float, end: float, p: Array) -> tuple[Array, Flags]:
        """Return the times in an interval at which integration steps must end.

        Args:
            begin: begin of the interval [s].
            end: end of the interval [s].
            p: values of the parameters.

        Returns:
            Times (m,) in increasing order [s]; (m,) whether a law may jump or bend at each time.
        """
        if not end > begin:
            return np.empty(0), np.empty(0, bool)
        search = _Search(self, begin, end, np.asarray(p, dtype=float)[: self.p])
        hard = search.jumps()
        soft = search.shorter_intervals(hard)
        soft = soft[~_near(soft, hard, _SAME * max(abs(begin), abs(end)))]
        times = np.concatenate([hard, soft])
        order = np.argsort(times, kind="stable")
        flags = np.arange(len(times)) < len(hard)
        return times[order], flags[order]


def time_laws(found: Conditions, time: SX, p: SX) -> TimeLaws | None:
    """Return the parts of laws that depend on time only, or None if there are none.

    Args:
        found: conditions of all laws.
        time: symbol of the time.
        p: (np, 1) symbols of the parameters.
    """
    zeros, lines = list[SX](), list[SX]()
    for value in found.zeros:
        slope = casadi.jacobian(value, time)
        if _is_arithmetic(value) and not casadi.depends_on(slope, time):
            lines.append(casadi.horzcat(casadi.substitute(value, time, 0), slope))
        else:
            zeros.append(value)
    if not (zeros or lines or found.wholes or found.terms):
        return None
    rates = [casadi.jacobian(value, time) for value in found.phases]
    every = [*found.zeros, *found.wholes, *found.terms, *found.hints]
    if not casadi.depends_on(casadi.vertcat(*every), p):
        p = SX(0, 1)

    def made(name: str, values: Sequence[SX]) -> Function:
        dense = casadi.densify(casadi.vertcat(SX(0, 1), *values))
        return Function(name, [time, p], [dense])

    rows = casadi.densify(casadi.vertcat(SX(0, 2), *lines))
    return TimeLaws(
        lines=Function("lines", [p], [rows]),
        zeros=made("zeros", zeros),
        wholes=made("wholes", found.wholes),
        terms=made("terms", found.terms),
        hints=made("hints", found.hints),
        rates=made("rates", rates),
        p=p.numel(),
    )


def _is_arithmetic(value: SX) -> bool:
    """Whether an expression consists of sums, products and quotients only."""
    walk = _Walk({})
    walk.visit(value)
    inner = (node for node in walk.nodes.values() if operands_of(node))
    return all(
        not (node.is_call() or node.is_output()) and node.op() in _ARITHMETIC for node in inner
    )


def _near(values: Array, others: Array, distance: float) -> Flags:
    """Return whether each value is within a distance of any of the sorted `others`."""
    if not len(others):
        return np.zeros(len(values), bool)
    place = np.searchsorted(others, values)
    above = others[np.minimum(place, len(others) - 1)]
    below = others[np.maximum(place - 1, 0)]
    near: Flags = np.minimum(abs(above - values), abs(values - below)) <= distance
    return near


Curve = Callable[[Array], Array]
"""Function from times (m,) to values (k, m), or to values (m,) of a separate row each."""


@dataclass(slots=True)
class _Search:
    """Search for the times in an interval [begin, end] at which steps must end."""

    laws: TimeLaws
    begin: float
    end: float
    p: Array

    def _values(self, function: Function, times: Array) -> Array:
        """Return the values (k, m) of a function at m times."""
        if not function.numel_out(0) or not len(times):
            return np.empty((function.numel_out(0), len(times)))
        every = np.repeat(self.p[:, None], len(times), 1)
        found: Array = np.array(function(times.reshape(1, -1), every))
        return found.reshape(function.numel_out(0), len(times))

    def _grid(self, more: Array) -> Array:
        """Return the sampling times of a search: equal cells, and both sides of known jumps."""
        span = self.end - self.begin
        coarse = np.linspace(self.begin, self.end, _CELLS + 1)
        rates = np.abs(self._values(self.laws.rates, coarse))
        fastest = float(np.max(rates[np.isfinite(rates)], initial=0.0))
        cells = min(max(_CELLS, math.ceil(_PER_PERIOD * fastest * span)), _MOST_CELLS)
        aside = _SAME * max(abs(self.begin), abs(self.end))
        every = [np.linspace(self.begin, self.end, cells + 1), more - aside, more + aside]
        times = np.unique(np.concatenate(every))
        return times[(times >= self.begin) & (times <= self.end)]

    def jumps(self) -> Array:
        """Return the times at which laws jump or bend, in increasing order."""
        found = [self._of_lines()]
        zeros, wholes = self.laws.zeros, self.laws.wholes
        if zeros.numel_out(0) or wholes.numel_out(0):
            known = _distinct(found[0], self.begin, self.end)
            for _ in range(_ROUNDS):
                grid = self._grid(known)
                more = [known, *self._whole_numbers(grid), *self._roots(zeros, grid)]
                count, known = len(known), _distinct(np.concatenate(more), self.begin, self.end)
                if len(known) == count:
                    break
            return known
        return _distinct(found[0], self.begin, self.end)

    def _of_lines(self) -> Array:
        lines = np.array(self.laws.lines(self.p)).reshape(-1, 2)
        level, slope = lines[slope_is_there(lines)].T
        with np.errstate(over="ignore"):
            times: Array = -level / slope
        return times[np.isfinite(times)]

    def _whole_numbers(self, grid: Array) -> Iterator[Array]:
        """Yield the times at which values pass integers."""
        values = np.floor(self._values(self.laws.wholes, grid))
        for row in range(len(values)):
            passed = np.flatnonzero(values[row, 1:] != values[row, :-1])
            passed = passed[np.isfinite(values[row, passed] + values[row, passed + 1])]
            left, right = grid[passed], grid[passed + 1]
            low = values[row, passed]

            def is_past(times: Array, row: int = row, low: Array = low) -> Flags:
                past: Flags = np.floor(self._values(self.laws.wholes, times)[row]) != low
                return past

            yield _bisect(is_past, left, right)

    def _roots(self, function: Function, grid: Array) -> Iterator[Array]:
        """Yield the times at which values become or cease to be positive, or negative."""
        values = self._values(function, grid)
        for row in range(len(values)):
            for sign in (1.0, -1.0):
                yield from self._flips(function, row, sign, grid, values[row])

    def _flips(
        self, function: Function, row: int, sign: float, grid: Array, values: Array
    ) -> Iterator[Array]:
        """Yield the times at which sign * value becomes or ceases to be positive."""

        def value(times: Array) -> Array:
            found: Array = sign * self._values(function, times)[row]
            return found

        v = sign * values
        up = v > 0
        flips = np.flatnonzero(up[1:] != up[:-1])
        left, right = grid[flips], grid[flips + 1]
        yield _flip(value, left, right, up[flips])
        # peaks below zero at the grid points may exceed zero between the points
        inner = (v[1:-1] >= v[:-2]) & (v[1:-1] >= v[2:]) & (v[1:-1] <= 0)
        inner &= (v[1:-1] > v[:-2]) | (v[1:-1] > v[2:])
        peaks = np.flatnonzero(inner) + 1
        if len(peaks):
            a, b = grid[peaks - 1], grid[peaks + 1]
            top = _maximum(value, a, b)
            above = value(top) > 0
            a, b, top = a[above], b[above], top[above]
            off = np.zeros(len(top), bool)
            yield _flip(value, a, top, off)
            yield _flip(value, top, b, ~off)

    def shorter_intervals(self, hard: Array) -> Array:
        """Return the ends of long smooth intervals before a short change of a smooth law.

        Without these stops, error control could step over the change.
        """
        terms = self.laws.terms
        if not terms.numel_out(0):
            return np.empty(0)
        grid = self._grid(hard)
        hints = [*self._roots(self.laws.hints, grid)]
        if hints:
            grid = np.unique(np.concatenate([grid, *hints, *self._tops(grid)]))
        found = []
        for row in range(terms.numel_out(0)):
            times, values = self._sampled(row, grid)
            found += [self._uneven(times, values, hard)]
        return np.unique(np.concatenate(found))

    def _tops(self, grid: Array) -> Iterator[Array]:
        """Yield the times of maxima of hints: the middle of a short change."""
        values = self._values(self.laws.hints, grid)
        for row in range(len(values)):
            v = values[row]
            peaks = np.flatnonzero((v[1:-1] > v[:-2]) & (v[1:-1] >= v[2:])) + 1
            if len(peaks):

                def value(times: Array, row: int = row) -> Array:
                    found: Array = self._values(self.laws.hints, times)[row]
                    return found

                yield _maximum(value, grid[peaks - 1], grid[peaks + 1])

    def _sampled(self, row: int, grid: Array) -> tuple[Array, Array]:
        """Return times and values of a term, refined where its curvature is large."""
        terms, times = self.laws.terms, grid
        values = self._values(terms, times)[row]
        active = np.arange(len(times) - 1)
        for _ in range(_LEVELS):
            span = _span(values)
            middle = 0.5 * (times[active] + times[active + 1])
            there = self._values(terms, middle)[row]
            off = np.abs(there - 0.5 * (values[active] + values[active + 1]))
            split = (off > _UNEVEN * span) & (middle > times[active]) & (middle < times[active + 1])
            if not split.any() or len(times) > _MOST_POINTS:
                break
            at = active[split] + 1
            times, values = (
                np.insert(old, at, new[split]) for old, new in ((times, middle), (values, there))
            )
            first = active[split] + np.arange(int(split.sum()))
            active = np.sort(np.concatenate([first, first + 1]))
        return times, values

    def _uneven(self, times: Array, values: Array, hard: Array) -> Array:
        """Return the ends of intervals of equal variation that are much longer than the next."""
        span = _span(values)
        if span == 0.0:
            return np.empty(0)
        # jumps do not count as variation: the samples on both sides are neighbours
        change = np.abs(np.diff(values))
        change[~np.isfinite(change)] = 0.0
        change[_near(times[1:], hard, 2 * _SAME * max(abs(self.begin), abs(self.end)))] = 0.0
        varied = np.concatenate([[0.0], np.cumsum(change)]) / (_VARIATION * span)
        levels = np.arange(1, math.floor(varied[-1]) + 1)
        if len(levels) > _MOST_POINTS:
            return np.empty(0)  # the law varies everywhere, which error control detects
        ends = times[np.searchsorted(varied, levels)]
        borders = np.unique(np.concatenate([[self.begin], ends]))
        lengths = np.diff(borders)
        kept = np.flatnonzero(lengths[:-1] > _SHORTER * lengths[1:]) + 1
        return borders[kept]


def slope_is_there(lines: Array) -> Flags:
    """Return whether each line (constant, slope) has a zero."""
    there: Flags = (lines[:, 1] != 0) & np.isfinite(lines).all(axis=1)
    return there


def _span(values: Array) -> float:
    """Return the range of the finite values."""
    finite = values[np.isfinite(values)]
    return float(np.ptp(finite)) if len(finite) else 0.0


def _distinct(times: Array, begin: float, end: float) -> Array:
    """Return the distinct times inside an interval in increasing order."""
    inside: Array = np.sort(times[(times > begin) & (times < end)])
    # near time zero the tolerance is relative to the length of the interval
    apart = np.diff(inside) > _SAME * np.maximum(np.abs(inside[1:]), _NEAR_ZERO * (end - begin))
    found: Array = inside[np.concatenate([np.ones(min(len(inside), 1), bool), apart])]
    return found


def _flip(value: Curve, left: Array, right: Array, up: Flags) -> Array:
    """Return the times between left and right at which values become or cease to be positive."""

    def is_past(times: Array) -> Flags:
        past: Flags = (value(times) > 0) != up
        return past

    return _bisect(is_past, left, right)


def _bisect(is_past: Callable[[Array], Flags], left: Array, right: Array) -> Array:
    """Return by bisection the first times, to rounding, at which `is_past` is True."""
    left, right = left.copy(), right.copy()
    if not len(left):
        return right
    for _ in range(_HALVINGS):
        middle = 0.5 * (left + right)
        if not np.any((middle > left) & (middle < right)):
            break
        past = is_past(middle)
        right, left = np.where(past, middle, right), np.where(past, left, middle)
    return right


def _maximum(value: Curve, a: Array, b: Array) -> Array:
    """Return the times of the maxima between a and b, by golden-section search."""
    a, b = a.copy(), b.copy()
    c, d = b - _GOLDEN * (b - a), a + _GOLDEN * (b - a)
    at_c, at_d = value(c), value(d)
    for _ in range(_SECTIONS):
        left = at_c > at_d
        a, b = np.where(left, a, c), np.where(left, d, b)
        new = np.where(left, b - _GOLDEN * (b - a), a + _GOLDEN * (b - a))
        fresh = value(new)
        c, d = np.where(left, new, d), np.where(left, c, new)
        at_c, at_d = np.where(left, fresh, at_d), np.where(left, at_c, fresh)
    found: Array = np.where(at_c > at_d, c, d)
    return found
