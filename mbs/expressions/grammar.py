"""Words of the grammar: names, functions and constants."""

from __future__ import annotations

import math
import re

FUNCTIONS = {"sin": 1, "cos": 1, "tan": 1, "sqrt": 1, "atan2": 2}
CONSTANTS = {"pi": math.pi, "Pi": math.pi}
NUMBER = r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
"""Pattern of a number without its sign."""

TOKEN = re.compile(
    rf"\s*(?:(?P<number>{NUMBER})"
    r"|(?P<name>[A-Za-z_][A-Za-z0-9_]*(?:\.[A-Za-z_][A-Za-z0-9_]*)*)"
    r"|(?P<mark>\*\*|[-+*/^(),]))",
    re.ASCII,
)
_NOT_NUMBERS = ("nan", "inf", "infinity")


def is_reserved(name: str) -> bool:
    """Whether the name means something else than a symbol."""
    return name in (*FUNCTIONS, *CONSTANTS) or name.lower() in _NOT_NUMBERS
