"""Header comment of a written function: signature, inputs, outputs, operations. Scalar names."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import casadi
from casadi import Function

from mbs.export.languages.language import Argument
from mbs.operations.counts import Count, count_graph
from mbs.operations.graph import Graph, Port
from mbs.text import ascii_line, joint_label
from mbs.version import __version__

# Names of scalars from the classic notation and from the models.
#
# Source: the names of SYMORO+, Khalil & Creusot 1997.


_PREFIX = {"v": "QP", "a": "QDP", "tau": "GAM"}
"""Prefixes of the names of joint velocities, accelerations and efforts, such as QP2."""

Elements = Sequence[tuple[str, str]]
"""Name and unit of every element of an input or output."""


class MatrixElement(NamedTuple):
    """Position of a matrix element.

    Attributes:
        row, column: indices from 0.
    """

    row: int
    column: int


class Term(NamedTuple):
    """Joint angle in a sum of joint angles.

    Attributes:
        sign: +1 or -1.
        label: label of the joint, such as "2" for q2; "off" for a constant.
    """

    sign: int
    label: str


def elements_of(function: Function, name: str) -> Elements:
    """Return names and units of the elements of an input or output.

    Args:
        function: model, or another Function.
        name: name of the input or output.

    Returns:
        (name, unit) of each element; empty if the elements have no names.
    """
    known = getattr(function, "elements", None)
    return list(known(name)) if known is not None else []


def places(port: Port) -> list[MatrixElement]:
    """Return row and column of the structural nonzeros of an input or output, column by column.

    Args:
        port: input or output of a graph.
    """
    rows, columns = port.sparsity.get_triplet()
    return [MatrixElement(int(row), int(column)) for row, column in zip(rows, columns, strict=True)]


def element_names(port: Port, elements: Elements) -> list[str]:
    """Return a name for each structural nonzero of an input or output.

    Coordinates and parameters keep their names. Velocities are QP1, QP2, ..., accelerations QDP1,
    ..., efforts GAM1, .... Other elements are named by row and column, such as A12 and H3, or by
    row and column name if the columns have names, such as D3_XX6.

    Args:
        port: input or output of a graph.
        elements: names and units of its elements; empty if they have no names.
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


def angle_names(graph: Graph, inputs: Sequence[Sequence[str]]) -> dict[int, str]:
    """Return names of the sines and cosines of joint angles and of their sums.

    Examples: S2, C2, S23 for sin(q2 + q3), S2m3 for sin(q2 - q3). A constant offset of the angle
    adds `off`. With ten or more joints, S1_2 is sin(q1 + q2), because S12 is sin(q12).

    Args:
        graph: graph of scalar operations.
        inputs: names of the elements of each input.

    Returns:
        Dict from node index to name, single angles in the order of the joints, then sums.
    """
    return dict(sorted(_angle_names(graph, inputs), key=lambda pair: _angle_order(pair[1])))


def _angle_order(name: str) -> tuple[bool, int, str, bool]:
    """Return the sort key of an angle name: single angles by joint number, then sums."""
    label = name[1:]
    number = int(label) if label.isdigit() else 0
    return not number, number, label, name[0] == "C"


def _angle_names(graph: Graph, inputs: Sequence[Sequence[str]]) -> Iterator[tuple[int, str]]:
    """Yield (node, name) of the sines and cosines of joint angles and of their sums."""
    sums: dict[int, tuple[Term, ...] | None] = {}
    apart = any(re.fullmatch(r"q\d\d+", name) for names in inputs for name in names)
    for number, node in enumerate(graph.nodes):
        sums[number] = _sum_of_angles(graph, number, sums, inputs)
        letter = {casadi.OP_SIN: "S", casadi.OP_COS: "C"}.get(node.op)
        terms = sums[node.args[0]] if letter else None
        if letter and terms and any(term.label != _OFFSET for term in terms):
            yield number, letter + _join(terms, apart)


_OFFSET = "off"
_MOST_TERMS = 8


def _sum_of_angles(
    graph: Graph,
    number: int,
    sums: Mapping[int, tuple[Term, ...] | None],
    inputs: Sequence[Sequence[str]],
) -> tuple[Term, ...] | None:
    """Return the joint angles of which node `number` is the sum, or None if it is no such sum.

    `sums` gives this for previous nodes, `inputs` the names of the elements of each input.
    """
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


def _join(terms: Sequence[Term], apart: bool) -> str:
    """Join the labels of a sum of angles, sorted, with `m` before subtracted angles.

    The offset comes last, without sign.

    Args:
        terms: angles of the sum.
        apart: whether labels are always separated by `_`, else only if a label is longer than 1.
    """
    joints = sorted((t for t in terms if t.label != _OFFSET), key=_order)
    long = apart or any(len(term.label) > 1 for term in joints)
    text = ""
    for term in joints:
        between = "_" if long and text else ""
        text += between + ("m" if term.sign < 0 else "") + term.label
    return text + (_OFFSET if len(joints) < len(terms) else "")


def _order(term: Term) -> tuple[bool, int, str]:
    """Return the sort key of an angle in a sum: added angles first, by joint number."""
    number = int(term.label) if term.label.isdigit() else 0
    return term.sign < 0, number, term.label


_WIDTH = 90
_KINDS = {
    "mul": ("multiplication", "multiplications"),
    "add": ("addition", "additions"),
    "div": ("division", "divisions"),
    "sqrt": ("square root", "square roots"),
    "trig": ("function of an angle", "functions of angles"),
    "other": ("other", "others"),
}


def header(
    function: Function, graph: Graph, arguments: Sequence[Argument], names: Sequence[Sequence[str]]
) -> tuple[str, ...]:
    """Return the lines of the header comment.

    Args:
        function: Function that is written.
        graph: graph of its operations, without outputs for intermediate quantities.
        arguments: inputs, then outputs.
        names: names of the elements of each argument.
    """
    inside, outside = ", ".join(function.name_in()), ", ".join(function.name_out())
    system = getattr(function, "system", None)
    robot = f" of {system.name}" if system is not None else ""
    lines = _paragraph(f"{graph.name}({inside}) -> {outside}{robot}")
    if system is not None and system.source:
        lines += _paragraph(f"Data: {system.source}")
    lines.append("")
    ports = [*graph.inputs, *graph.outputs]
    for k, (port, argument) in enumerate(zip(ports, arguments, strict=True)):
        direction = "input " if k < len(graph.inputs) else "output"
        elements = elements_of(function, port.name)
        lines += _argument(direction, port, argument, elements, names[k])
    lines += ["", *_paragraph(_cost(graph))]
    lines.append(f"Units are SI and radians. Written by mbs {__version__}.")
    return tuple(lines)


def _argument(
    direction: str, port: Port, argument: Argument, elements: Elements, names: Sequence[str]
) -> Iterator[str]:
    """Yield the header lines of an argument: shape, and names and units of its elements.

    `direction` is "input " or "output".
    """
    size = "" if argument.scalar else f" ({port.sparsity.size1()}, {port.sparsity.size2()})"
    text = f"{direction} {argument.name}{size}"
    if elements and len(elements) == len(names):
        text += ": " + ", ".join(
            f"{name}{_meaning(name, element)} [{unit}]"
            for name, (element, unit) in zip(names, elements, strict=True)
        )
    elif names and not argument.scalar and argument.is_vector:
        text += f": {names[0]}" + (f" .. {names[-1]}" if len(names) > 1 else "")
    elif names and not argument.scalar:
        text += f": {names[0]} .. {names[-1]}"
        if port.sparsity.nnz() < port.sparsity.numel():
            text += ", the others are zero"
    yield from _paragraph(text)


def _meaning(name: str, element: str) -> str:
    """Return ` = element` if the name in the text does not show the name of the element."""
    label = re.sub(r"\W", "_", joint_label(element))
    return "" if name.endswith(label) else f" = {element}"


def _cost(graph: Graph) -> str:
    """Return the sentence that gives the operation counts of a graph."""
    count = count_graph(graph)
    text = f"Operations: {_tally(count)}."
    once = count.parameter_only
    if once is not None and once.total:
        text += f" On parameters alone, besides: {_tally(once)}."
    return text


def _tally(count: Count) -> str:
    """Return operation counts as text, "none" if there are no operations."""
    numbers = ((getattr(count, key), words) for key, words in _KINDS.items())
    return ", ".join(f"{n} {words[n > 1]}" for n, words in numbers if n) or "none"


def _paragraph(text: str) -> list[str]:
    """Return a text wrapped into lines; a unit stays on the line of its quantity."""
    together = re.sub(r" \[", "\0[", ascii_line(text))
    lines = textwrap.wrap(together, _WIDTH, subsequent_indent="    ")
    return [line.replace("\0", " ") for line in lines]


def tables(function: Function) -> tuple[str, ...]:
    """Return the lines of the table of geometric parameters, as in the listings of SYMORO.

    The table is empty for a Function without a system. A fixed frame on the path to link 4 has the
    number 4.1 and sigma 2.

    Args:
        function: model, or another Function.
    """
    system = getattr(function, "system", None)
    if system is None:
        return ()
    keys = ("ant", "sigma", "gamma", "b", "alpha", "d", "theta", "r")
    rows: list[tuple[str, ...]] = [("j", *keys)]
    sigma = {"revolute": "0", "prismatic": "1"}
    for row in system.links:
        before = str(row.antecedent)
        for number, fixed in enumerate(row.via, 1):
            rows.append((f"{row.number}.{number}", before, "2", *map(_cell, fixed)))
            before = f"{row.number}.{number}"
        place = (row.gamma, row.b, row.alpha, row.d, row.theta, row.r)
        kind = sigma.get(row.motion, row.motion)
        rows.append((str(row.number), before, kind, *map(_cell, place)))
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = ["  ".join(c.rjust(w) for c, w in zip(row, widths, strict=True)) for row in rows]
    return ("", "Geometric parameters", "", *lines)


def _cell(value: Any) -> str:
    """Return a parameter with ten digits, or as an expression."""
    return str(value) if isinstance(value, casadi.SX) else f"{value:.10g}"
