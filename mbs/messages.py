"""Parts of messages: values as Python writes them, the nearest known name, how to install."""

from collections.abc import Iterable
from difflib import get_close_matches

DISTRIBUTION = "casadi-mbs"
"""Name of the package on an index, where `mbs`, the name of the import, is another project."""
_LONGEST_QUOTE = 80
_LONGEST_LIST = 20


def quoted(value: object) -> str:
    """The value as Python writes it, on one line, its middle left out when it is long."""
    try:
        text = " ".join(repr(value).split())
    except ValueError:  # an integer of more digits than Python converts
        text = f"a {type(value).__name__} of more digits than can be read"
    half = _LONGEST_QUOTE // 2
    return text if len(text) <= _LONGEST_QUOTE else f"{text[:half]}...{text[-half:]}"


def install_command(extra: str) -> str:
    """What installs an extra of this package, from an index and in a clone of its source.

    Args:
        extra: a key of [project.optional-dependencies] in pyproject.toml.
    """
    return f'pip install "{DISTRIBUTION}[{extra}]" (or, in a clone, pip install -e ".[{extra}]")'


def did_you_mean(name: object, known: Iterable[str]) -> str:
    """The end of a message about an unknown name.

    Args:
        name: what was written.
        known: names that would have been understood.

    Returns:
        the nearest known names, then the others, the first 20 of them.
    """
    names = list(dict.fromkeys(known))
    near = get_close_matches(str(name), names, n=3)
    hint = f"did you mean {' or '.join(repr(n) for n in near)}?" if near else ""
    if near and len(near) == len(names):
        return hint
    more = len(names) - _LONGEST_LIST
    rest = f" and {more} more" if more > 0 else ""
    listed = f"use one of {', '.join(names[:_LONGEST_LIST]) or '(none)'}{rest}"
    return f"{hint} {listed}".strip()
