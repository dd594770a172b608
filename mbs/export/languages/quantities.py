"""Names of scalars: those that the classic notation has, and those that the models give.

Source: the names of SYMORO+, Khalil & Creusot 1997.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import casadi
from casadi import Function

from mbs.operations.graph import Graph, Port

_PREFIX = {"v": "QP", "a": "QDP", "tau": "GAM"}
"""Quantities whose elements belong to a joint: QP2 is the velocity of joint 2."""

Elements = Sequence[tuple[str, str]]
"""Name and unit of every element of an input or output."""


class MatrixElement(NamedTuple):
    """An element of a matrix; rows and columns count from 0."""

    row: int
    column: int


class Term(NamedTuple):
    """A joint angle in a sum of them."""

    sign: int
    label: str


def elements_of(function: Function, name: str) -> Elements:
    """What the Function knows of the elements of an input or output; empty for a plain one."""
    known = getattr(function, "elements", None)
    return list(known(name)) if known is not None else []


def places(port: Port) -> list[MatrixElement]:
    """Where the non-zero elements of an input or output are."""
    rows, columns = port.sparsity.get_triplet()
    return [MatrixElement(int(row), int(column)) for row, column in zip(rows, columns, strict=True)]


def element_names(port: Port, elements: Elements) -> list[str]:
    """A name for each non-zero element of an input or output.

    Coordinates and parameters have their own, velocities are QP1, QP2 .., accelerations QDP1 ..,
    efforts GAM1 ..; the others are named by their place, such as A12 and H3, or by row and column
    where the columns have names: D3_XX6.
    """
    rows, columns = port.sparsity.shape
    if (rows, columns) == (1, 1) and not elements:
        return [port.name]
    if columns == 1 and len(elements) == rows:
        prefix = _PREFIX.get(port.name.removesuffix("_a"), "")
        labels = [name for name, _ in elements]
        names = [prefix + joint_label(name) if prefix else name for name in labels]
        return [names[place.row] for place in places(port)]
    if columns == 1:
        return [f"{port.name}{place.row + 1}" for place in places(port)]
    if len(elements) == columns != rows:
        place = {p: f"{p.row + 1}_" if rows > 1 else "" for p in places(port)}
        start = f"{port.name}_" if rows == 1 or port.name[-1].isdigit() else port.name
        return [f"{start}{row}{elements[p.column][0]}" for p, row in place.items()]
    between = "_" if max(rows, columns) > 9 else ""
    return [f"{port.name}{p.row + 1}{between}{p.column + 1}" for p in places(port)]


def joint_label(name: str) -> str:
    """What stands for a coordinate in other names: 2 for q2, the name itself for others."""
    return name[1:] if re.fullmatch(r"q\d+", name) else name


def angle_names(graph: Graph, inputs: Sequence[Sequence[str]]) -> dict[int, str]:
    """Sines and cosines of joint angles: S2, C2, S23 of q2 + q3, S2m3 of q2 - q3.

    A constant added to the angle shows as `off`. From ten joints on, S1_2 is of q1 + q2: S12 is
    of q12.

    Args:
        graph: any.
        inputs: names of the elements of every input.

    Returns:
        the name of each such node, joint by joint, sums after single angles.
    """
    return dict(sorted(_angle_names(graph, inputs), key=lambda pair: _angle_order(pair[1])))


def _angle_order(name: str) -> tuple[bool, int, str, bool]:
    label = name[1:]
    number = int(label) if label.isdigit() else 0
    return not number, number, label, name[0] == "C"


def _angle_names(graph: Graph, inputs: Sequence[Sequence[str]]) -> Iterator[tuple[int, str]]:
    sums: dict[int, tuple[Term, ...] | None] = {}
    apart = any(re.fullmatch(r"q\d\d+", name) for names in inputs for name in names)
    for number, node in enumerate(graph.nodes):
        sums[number] = _sum_of_angles(graph, number, sums, inputs)
        letter = {casadi.OP_SIN: "S", casadi.OP_COS: "C"}.get(node.op)
        terms = sums[node.args[0]] if letter else None
        if letter and terms and any(term.label != _OFFSET for term in terms):
            yield number, letter + _joined(terms, apart)


_OFFSET = "off"
_MOST_TERMS = 8


def _sum_of_angles(
    graph: Graph,
    number: int,
    sums: Mapping[int, tuple[Term, ...] | None],
    inputs: Sequence[Sequence[str]],
) -> tuple[Term, ...] | None:
    """The angles that a node adds up, or None when it does something else."""
    node = graph.nodes[number]
    if node.op == casadi.OP_INPUT:
        return (Term(1, joint_label(inputs[node.args[0]][node.args[1]])),)
    if node.op == casadi.OP_CONST:
        return (Term(1, _OFFSET),)
    if node.op not in (casadi.OP_ADD, casadi.OP_SUB, casadi.OP_NEG):
        return None
    parts = [sums[operand] for operand in node.args]
    signs = (1, -1) if node.op == casadi.OP_SUB else (-1,) if node.op == casadi.OP_NEG else (1, 1)
    terms: list[Term] = []
    for sign, part in zip(signs, parts, strict=True):
        if part is None or len(terms) + len(part) > _MOST_TERMS:
            return None
        terms += [Term(sign * term.sign, term.label) for term in part]
    return tuple(terms)


def _joined(terms: Sequence[Term], apart: bool) -> str:
    """The labels in order, `m` before one that is subtracted; the offset comes last, unsigned.

    Args:
        terms: the angles that are added up.
        apart: whether every two labels are kept apart, and not long ones alone.
    """
    joints = sorted((t for t in terms if t.label != _OFFSET), key=_order)
    long = apart or any(len(term.label) > 1 for term in joints)
    text = ""
    for term in joints:
        between = "_" if long and text else ""
        text += between + ("m" if term.sign < 0 else "") + term.label
    return text + (_OFFSET if len(joints) < len(terms) else "")


def _order(term: Term) -> tuple[bool, int, str]:
    number = int(term.label) if term.label.isdigit() else 0
    return term.sign < 0, number, term.label
