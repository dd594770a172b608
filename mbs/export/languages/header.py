"""What stands above the text of a function: what it is, its inputs and outputs, its cost."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterator, Sequence
from typing import Any

import casadi
from casadi import Function

from mbs.comments import ascii_line
from mbs.export.languages.quantities import Elements, elements_of, joint_label
from mbs.export.languages.unit import Argument
from mbs.operations.counts import Count, count_graph
from mbs.operations.graph import Graph, Port
from mbs.version import __version__

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
    """The header, line by line.

    Args:
        function: what is written.
        graph: of its true outputs.
        arguments: inputs, then outputs.
        names: of the elements of every argument.
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
    """The user's name of an element where the text has another one that does not show it."""
    label = re.sub(r"\W", "_", joint_label(element))
    return "" if name.endswith(label) else f" = {element}"


def _cost(graph: Graph) -> str:
    count = count_graph(graph)
    text = f"Operations: {_tally(count)}."
    once = count.parameter_only
    if once is not None and once.total:
        text += f" On parameters alone, besides: {_tally(once)}."
    return text


def _tally(count: Count) -> str:
    numbers = ((getattr(count, key), words) for key, words in _KINDS.items())
    return ", ".join(f"{n} {words[n > 1]}" for n, words in numbers if n) or "none"


def _paragraph(text: str) -> list[str]:
    together = re.sub(r" \[", "\0[", ascii_line(text))
    lines = textwrap.wrap(together, _WIDTH, subsequent_indent="    ")
    return [line.replace("\0", " ") for line in lines]


def tables(function: Function) -> tuple[str, ...]:
    """The geometric parameters of the links, as the classic output lists them.

    A fixed frame that leads to link 4 is numbered 4.1 and has sigma 2.
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
    return str(value) if isinstance(value, casadi.SX) else f"{value:.10g}"
