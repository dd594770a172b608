"""Columns of a link that are sums of columns of the link before it.

A joint cannot tell a part of its link from the same part fixed on the link before: mass on the
axis of a revolute joint, the rotational inertia behind a prismatic joint, the mass at the centre
of a spherical joint.

Source: Gautier & Khalil 1990.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import casadi
from casadi import SX

from mbs.assembly.tree import Tree
from mbs.components.motion import Motion
from mbs.recursions.poses import LinkPose
from mbs.spatial import Inertia, Screw, body_through, elements, zeros

_XX, _YY, _MZ, _M = 0, 3, 8, 9
_DEPTH = 9
_OWN_PRODUCTS = {**dict.fromkeys(range(6), 2), _MZ: 5, _M: 3}
"""Products of an element that is computed as the work of its own unit wrench."""

Elements = Mapping[int, Callable[[int], SX]]
"""For some rows what computes the element of a column, given the number of its parameter."""


@dataclass(frozen=True, slots=True, eq=False)
class ColumnSum:
    """A column of link j: columns of link i times constants, less a column of link j.

    Attributes:
        terms: a constant, and columns of link i that it multiplies, each with its sign.
        less: number of the column of link j, or None.
    """

    terms: tuple[tuple[SX, tuple[tuple[int, int], ...]], ...]
    less: int | None

    @property
    def products(self) -> int:
        """Products of an element."""
        return sum(not (c.is_one() or c.is_minus_one()) for c, _ in self.terms)

    def of(self, before: SX, own: SX) -> SX:
        """The element of a row, from the row (1, 10) of link i and that of link j."""
        total = SX(0)
        for constant, columns in self.terms:
            part = SX(0)
            for column, sign in columns:
                part = part + before[column] if sign > 0 else part - before[column]
            total = total + constant * part
        return total if self.less is None else total - own[self.less]


def filled(tree: Tree, poses: list[LinkPose], height: int, links: list[Elements]) -> list[SX]:
    """For every link the ten columns (height, 10) of its inertial parameters.

    Args:
        tree: the links.
        poses: each with respect to its antecedent.
        height: number of rows.
        links: what computes the elements of the columns that are no sums, for each link.
    """
    result: list[SX] = []
    for j, rows in enumerate(links):
        sums = column_sums(tree, poses, j)
        block, i = zeros(height, 10), tree.links[j].antecedent
        before = result[i] if i >= 0 else block
        for row, element in rows.items():
            for k in range(10):
                if k not in sums:
                    block[row, k] = element(k)
            for k, total in sums.items():
                block[row, k] = total.of(before[row, :], block[row, :])
        result.append(block)
    return result


def column_sums(tree: Tree, poses: list[LinkPose], j: int) -> dict[int, ColumnSum]:
    """The columns of link j that cost less as sums; none where it stands on the base."""
    link = tree.links[j]
    if link.antecedent < 0:
        return {}
    parts: dict[int, tuple[int, ...]]
    match link.motion:
        case Motion.REVOLUTE:
            parts = {_YY: (_XX, _YY), _MZ: (_MZ,), _M: (_M,)}
        case Motion.PRISMATIC:
            parts = {k: (k,) for k in range(6)}
        case Motion.SPHERICAL:
            parts = {_M: (_M,)}
        case Motion.FREE:
            return {}
    sums = {k: _sum(link.motion, poses[j], part) for k, part in parts.items()}
    return {k: total for k, total in sums.items() if total.products <= _OWN_PRODUCTS[k]}


def _sum(motion: Motion, pose: LinkPose, part: tuple[int, ...]) -> ColumnSum:
    """The column of the first parameter of link j, when all parameters of `part` are one."""
    ten = zeros(10)
    for k in part:
        ten[k] = 1
    body, screw = Inertia.from_parameters(ten), pose.motion[0]
    if motion is Motion.PRISMATIC:
        body = body.turned(screw.turn)
    elif isinstance(screw, Screw):
        body = body.slid(2, screw.t)
    constants = elements(body_through(pose.seat, body).parameters)
    return ColumnSum(_grouped(constants), _XX if len(part) > 1 else None)


def _grouped(constants: list[SX]) -> tuple[tuple[SX, tuple[tuple[int, int], ...]], ...]:
    """Columns with the same constant, but for its sign, together; those with zero left out."""
    groups: list[tuple[SX, list[tuple[int, int]]]] = []
    for column, constant in enumerate(constants):
        if constant.is_zero():
            continue
        for known, columns in groups:
            if casadi.is_equal(known, constant, _DEPTH):
                columns.append((column, 1))
                break
            if casadi.is_equal(known, -constant, _DEPTH):
                columns.append((column, -1))
                break
        else:
            groups.append((constant, [(column, 1)]))
    return tuple((constant, tuple(columns)) for constant, columns in groups)
