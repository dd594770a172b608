"""Recursive descent parser of the grammar of `mbs.expressions`; texts are never executed."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from typing import NoReturn

from mbs.errors import ExpressionError
from mbs.expressions.expression import (
    CONSTANTS,
    FUNCTIONS,
    TOKEN,
    Expression,
    Number,
    Parameter,
    finite,
    is_reserved,
    operation,
)
from mbs.text import quoted

_DEEPEST_NESTING = 100


@lru_cache(maxsize=4096)
def parse(text: str) -> Expression:
    """Parse a text to an expression."""
    parser = _Parser(text)
    value = parser.sum()
    if parser.token is not None:
        parser.fail(f"unexpected {parser.token!r}")
    return value


class _Parser:
    """Parser of a text with one token of lookahead."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.depth = 0
        self.tokens = self._tokens()
        self.token: str | None = None
        self.kind: str | None = None
        self.advance()

    def _tokens(self) -> Iterator[tuple[str, str]]:
        position, text = 0, self.text.rstrip()
        while position < len(text):
            match = TOKEN.match(text, position)
            if match is None or match.lastgroup is None:
                self.fail(f"unexpected {text[position:].strip()[:1]!r}")
            yield match.lastgroup, match[match.lastgroup]
            position = match.end()

    def fail(self, reason: str) -> NoReturn:
        raise ExpressionError(
            f"cannot read {quoted(self.text)}: {reason}; write numbers, symbols, + - * / ^,"
            " sin, cos, tan, sqrt, atan2 and pi"
        )

    def advance(self) -> None:
        self.kind, self.token = next(self.tokens, (None, None))

    def accept(self, *marks: str) -> str | None:
        if self.kind == "mark" and self.token in marks:
            mark = self.token
            self.advance()
            return mark
        return None

    def expect(self, mark: str) -> None:
        if not self.accept(mark):
            self.fail(f"{mark!r} is missing")

    def deeper(self) -> None:
        self.depth += 1
        if self.depth > _DEEPEST_NESTING:
            self.fail("it is nested too deeply")

    def sum(self) -> Expression:
        self.deeper()
        value = self.product()
        while mark := self.accept("+", "-"):
            value = operation(mark, value, self.product())
        self.depth -= 1
        return value

    def product(self) -> Expression:
        value = self.unary()
        while mark := self.accept("*", "/"):
            value = operation(mark, value, self.unary())
        return value

    def unary(self) -> Expression:
        negative = False
        while mark := self.accept("-", "+"):
            negative ^= mark == "-"
        value = self.power()
        return -value if negative else value

    def power(self) -> Expression:
        base = self.atom()
        if not self.accept("^", "**"):
            return base
        self.deeper()
        exponent = self.unary()
        self.depth -= 1
        return operation("^", base, exponent)

    def atom(self) -> Expression:
        kind, token = self.kind, self.token
        if kind is None or token is None:
            self.fail("it ends too early")
        if self.accept("("):
            value = self.sum()
            self.expect(")")
            return value
        self.advance()
        if kind == "number":
            return Number(finite(float(token), quoted(token)))
        if kind != "name":
            self.fail(f"unexpected {token!r}")
        return self._named(token)

    def _named(self, name: str) -> Expression:
        if name in CONSTANTS:
            return Number(CONSTANTS[name])
        if not self.accept("("):
            if name in FUNCTIONS:
                self.fail(f"{name} needs its arguments in brackets")
            if is_reserved(name):
                self.fail(f"{name} is not a finite number")
            return Parameter(name)
        if name not in FUNCTIONS:
            self.fail(f"{quoted(name)} is not a function here")
        arguments = [self.sum()]
        while self.accept(","):
            arguments.append(self.sum())
        self.expect(")")
        if len(arguments) != FUNCTIONS[name]:
            self.fail(f"{name} takes {FUNCTIONS[name]} argument(s), not {len(arguments)}")
        return operation(name, *arguments)
