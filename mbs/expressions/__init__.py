"""Numbers that may contain symbols: the grammar of all numbers that a user or a file writes.

A scalar is a number, a `Parameter`, or a text such as `"pi/2 + A"`. Texts are parsed by a grammar
of numbers, symbols, `+ - * / ^`, sin, cos, tan, sqrt, atan2 and pi; they are never executed.

    sum      := product (("+" | "-") product)*
    product  := unary (("*" | "/") unary)*
    unary    := ("+" | "-") unary | power
    power    := atom (("^" | "**") unary)?
    atom     := number | symbol | function "(" sum ("," sum)* ")" | "(" sum ")"
"""

from mbs.expressions._expression import (
    MORE_THAN_ZERO,
    Expression,
    Number,
    Operation,
    Parameter,
    Scalar,
    expression,
    number,
    operation,
    out_of_bounds,
    parameters_of,
    plain_numbers,
    renamed,
    to_float,
    to_sx,
    whole_number,
    with_values,
    without_defaults,
)

__all__ = [
    "MORE_THAN_ZERO",
    "Expression",
    "Number",
    "Operation",
    "Parameter",
    "Scalar",
    "expression",
    "number",
    "operation",
    "out_of_bounds",
    "parameters_of",
    "plain_numbers",
    "renamed",
    "to_float",
    "to_sx",
    "whole_number",
    "with_values",
    "without_defaults",
]
