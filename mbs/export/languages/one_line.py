"""Text of a scalar in the grammar of mechanism files."""

from __future__ import annotations

from collections.abc import Sequence

import casadi
from sympy.printing.pycode import PythonCodePrinter

from mbs.export.languages.language import plain_number
from mbs.export.languages.plan import LinePlan, arrange
from mbs.export.languages.symbolic import SympyWriter, printer_of
from mbs.operations.graph import Graph

_FORMS = {
    **{name: f"{name}({{0}})" for name in ("sin", "cos", "tan", "sqrt")},
    "atan2": "atan2({0}, {1})",
    "Abs": "sqrt({0}^2)",  # the grammar has no abs, and CasADi simplifies sqrt(x^2) to it
}


def one_line(graph: Graph, names: Sequence[str]) -> str:
    """Return the single result of a graph as an expression in the grammar of mechanism files.

    Args:
        graph: graph with a single input and a single result.
        names: names of the elements of its input.

    Raises:
        ModelError: the grammar does not have an operation of the graph.
    """
    graph, _ = arrange(graph)
    inputs = {
        number: names[node.args[1]]
        for number, node in enumerate(graph.nodes)
        if node.op == casadi.OP_INPUT
    }
    writer = SympyWriter(LinePlan(graph, (), (), {}), inputs, False)
    printer = printer_of(PythonCodePrinter, "the grammar", plain_number, _FORMS, "{0}^{1}")
    return str(printer.text(writer.value(graph.results[0][0])))
