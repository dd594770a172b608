"""Constant placements: the pose of one frame seen from another."""

from __future__ import annotations

from dataclasses import dataclass

import casadi
from casadi import DM, SX

from mbs.spatial.rotation import axis_turn
from mbs.spatial.vectors import elements, exact_product, zeros


@dataclass(frozen=True, slots=True)
class AxisTurn:
    """A turn about the axis "x", "y" or "z" by an angle [rad] that has a symbol in it."""

    axis: str
    angle: SX


@dataclass(frozen=True, slots=True)
class Pose:
    """Pose of a frame j seen from a frame i.

    Attributes:
        R: (3, 3) orientation; its columns are the axes of j in frame i.
        p: (3, 1) origin of j in frame i [m].
        chain: the displacements one after the other that make it, where symbols turn it: turns by
            an angle with a symbol, and poses whose orientation is of numbers. From them the angles
            are read off as they were written; the matrix would leave the sign of a sine open.
            Empty where R is of numbers, and where symbols in R came from elsewhere.
    """

    R: SX
    p: SX
    chain: tuple[AxisTurn | Pose, ...] = ()

    @staticmethod
    def identity() -> Pose:
        """The frame itself."""
        return Pose(casadi.densify(SX(DM.eye(3))), zeros())

    @staticmethod
    def turned(R: SX) -> Pose:
        """A frame with the same origin and the orientation R."""
        return Pose(casadi.densify(R), zeros())

    @staticmethod
    def about(axis: str, angle: SX) -> Pose:
        """A frame with the same origin, turned by an angle [rad] about "x", "y" or "z"."""
        R = axis_turn(axis, angle).matrix
        return Pose(R, zeros(), () if R.is_constant() else (AxisTurn(axis, angle),))

    @staticmethod
    def moved(p: SX) -> Pose:
        """A frame with the same orientation and the origin p."""
        return Pose(Pose.identity().R, casadi.densify(p))

    @property
    def steps(self) -> tuple[AxisTurn | Pose, ...]:
        """The displacements that make it: those of its chain, or itself."""
        return self.chain or (self,)

    def __matmul__(self, other: Pose) -> Pose:
        """T_ik from T_ij and T_jk."""
        chain = _joined(self, other) if self.chain or other.chain else ()
        return Pose(
            _with_lone_ones(exact_product(self.R, other.R)),
            exact_product(self.R, other.p, self.p),
            chain,
        )

    def inverse(self) -> Pose:
        """T_ji from T_ij."""
        return Pose(
            self.R.T,
            exact_product(-self.R.T, self.p),
            tuple(_inverse(step) for step in reversed(self.chain)),
        )

    @property
    def matrix(self) -> SX:
        """(4, 4) homogeneous transform."""
        return casadi.vertcat(
            casadi.horzcat(self.R, self.p), casadi.horzcat(SX(DM([[0, 0, 0]])), SX(1))
        )

    def at(self, p: SX) -> Pose:
        """A frame with the same orientation and its origin at p, (3, 1)."""
        turns = (step if isinstance(step, AxisTurn) else Pose.turned(step.R) for step in self.chain)
        return Pose(self.R, p, (Pose.moved(p), *turns) if self.chain else ())

    def is_identity(self) -> bool:
        """Whether it is the constant identity."""
        return bool(casadi.is_equal(self.matrix, casadi.densify(SX(DM.eye(4))), 1))


def _joined(first: Pose, second: Pose) -> tuple[AxisTurn | Pose, ...]:
    """The displacements of both, those without a turn by a symbol made one; empty if unknown."""
    joined: list[AxisTurn | Pose] = []
    for step in (*first.steps, *second.steps):
        if isinstance(step, Pose):
            if not step.R.is_constant():
                return ()
            if joined and isinstance(before := joined[-1], Pose):
                joined[-1] = before @ step
                continue
        joined.append(step)
    return tuple(joined)


def _inverse(step: AxisTurn | Pose) -> AxisTurn | Pose:
    return AxisTurn(step.axis, -step.angle) if isinstance(step, AxisTurn) else step.inverse()


def _with_lone_ones(R: SX) -> SX:
    """The rotation, its elements that stand alone in a row or a column exactly 1 or -1."""
    if R.is_constant() and not _has_alone(DM(R).nonzeros()):
        return R
    entries = elements(R)
    for place, entry in enumerate(entries):
        if not entry.is_constant() or abs(float(entry)) in (0.0, 1.0):
            continue
        row, column = place % 3, place // 3
        in_row = (entries[row + 3 * k] for k in range(3) if k != column)
        in_column = (entries[k + 3 * column] for k in range(3) if k != row)
        if all(e.is_zero() for e in in_row) or all(e.is_zero() for e in in_column):
            R[place] = 1.0 if float(entry) > 0 else -1.0
    return R


def _has_alone(elements: list[float]) -> bool:
    """Whether an element alone in its row or column, of nine, is not yet 1 or -1."""
    lines = (*(elements[k : k + 3] for k in (0, 3, 6)), *(elements[k::3] for k in range(3)))
    return any(line.count(0.0) == 2 and max(map(abs, line)) != 1.0 for line in lines)
