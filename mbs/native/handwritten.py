"""Functions whose C is written by hand, carried along wherever C of their callers is written."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import casadi
from casadi import Function

from mbs.native.compiler import FLAGS, cached_library
from mbs.native.kernel import EXPORT, function_table

FUNCTION = "FUNCTION"
"""What stands for the name of the function in its C text."""

RUNTIME_FLAGS = ("-O3", *FLAGS[1:])
"""Of the run-time: what it does is loops, which the highest level makes faster."""
_INTERNAL = """\
#undef INTERNAL
#ifdef __GNUC__
#define INTERNAL static __attribute__((unused))
#else
#define INTERNAL static
#endif
"""
_INCLUDE = re.compile(r'^#include "(\w+\.h)"\n', re.MULTILINE)
_STANDARD = re.compile(r"^#include <\w+\.h>\n", re.MULTILINE)
_GUARD = re.compile(r"(.*)#ifndef (?:\w+)\n#define \w+\n(.*)#endif\n", re.DOTALL)
_PROTOTYPE = re.compile(r"^(?=(?:void|int|double|long long) \w+\()", re.MULTILINE)
_MACRO = re.compile(r"^#define (\w+)", re.MULTILINE)


@dataclass(frozen=True, slots=True, eq=False)
class HandwrittenC:
    """C text of a function.

    Attributes:
        own: the definition of the function and of `jac_` it, after its headers and tables.
        common: files of the run-time that it calls, shared with others: name to text.
    """

    own: str
    common: Mapping[str, str]


_known: dict[str, HandwrittenC] = {}
"""By the names of the functions, which hold a hash of the text; each lives as long as the
process, since a Function does not tell when the last of its copies goes."""


def handwritten(
    signature: Function, jacobian: Function, own: str, common: Mapping[str, str], work: int
) -> Function:
    """A Function of C text; compiled by and for this computer.

    Args:
        signature: a Function that has its inputs and outputs, and no content.
        jacobian: likewise, of its Jacobian.
        own: C text, which includes headers of `common` and defines ``int FUNCTION(const double
            **arg, double **res, long long *iw, double *w, int mem)`` and ``jac_FUNCTION``. It may
            use math.h and string.h, no heap, and no variable that changes outside of functions.
        common: C files and headers that it is linked with; no two of the C files have a name in
            common.
        work: doubles that each of both takes in w.

    Returns:
        External Function, whose name is that of the signature and a hash of the text. `generated`,
        and what is made by it, writes the text beside that of Functions that call it.

    Raises:
        CompilerError: there is no compiler, or it refused the code.
    """
    whole = "".join([own, *common.keys(), *common.values()])
    name = f"{signature.name()}_{hashlib.sha256(whole.encode()).hexdigest()[:12]}"
    own = own.replace(FUNCTION, name)
    table = [
        function_table(_renamed(function, f"{prefix}{name}"), work)
        for prefix, function in (("", signature), ("jac_", jacobian))
    ]
    files = {
        **common,
        "function.c": EXPORT + own,
        "table.c": "#include <math.h>\n" + EXPORT + "\n".join(table) + "\n",
    }
    runtime = [file for file in common if file.endswith(".c")]
    library = cached_library(files, RUNTIME_FLAGS, common=runtime)
    _known[name] = HandwrittenC(own, MappingProxyType(dict(common)))
    return casadi.external(name, str(library))


def _renamed(function: Function, name: str) -> Function:
    symbols = [casadi.MX.sym(x, *function.size_in(x)) for x in function.name_in()]
    return Function(name, symbols, function.call(symbols), function.name_in(), function.name_out())


def is_handwritten(function: Function) -> bool:
    """Whether a Function is one of `handwritten`, or its Jacobian."""
    return function.is_a("External") and function.name().removeprefix("jac_") in _known


def handwritten_text(functions: Iterable[Function]) -> str:
    """The C text of all that Functions call of `handwritten`; empty where they call none.

    It is one text of functions that no other file sees, so that several libraries in one program
    may have it: what stands in the headers is declared static.

    Args:
        functions: any.
    """
    called = {
        part.name().removeprefix("jac_"): None
        for function in functions
        for part in (function, *function.find_functions())
        if is_handwritten(part)
    }
    known = [_known[name] for name in sorted(called)]
    if not known:
        return ""
    seen: set[str] = set()
    texts = []
    for files in known:
        texts += [
            _unfolded(name, files.common, seen)
            for name in files.common
            if name.endswith(".c") and name not in seen
        ]
        texts.append(_without_includes(files.own, files.common, seen))
    body = "\n".join(texts)
    standard = sorted(set(_STANDARD.findall(body)))
    macros = sorted({*_MACRO.findall(body), "INTERNAL", "EXPORT"})
    return "".join(
        [
            *standard,
            _INTERNAL,
            "#undef EXPORT\n#define EXPORT INTERNAL\n",
            _STANDARD.sub("", body),
            *(f"#undef {name}\n" for name in macros),
        ]
    )


_DECLARED = (
    re.compile(r"^(?:INTERNAL|EXPORT|static)[\w* ]*?(\w+)[\[(]", re.MULTILINE),  # functions, arrays
    re.compile(r"\b([A-Z][A-Z_]+) = "),  # constants
    re.compile(r"^(?:typedef [\w ]+|\}) (\w+)(?:\[.*\])?;", re.MULTILINE),  # types
)


def names_declared(text: str) -> set[str]:
    """The names that no function beside such a text may have.

    Args:
        text: as `handwritten_text` gives it.
    """
    return {name for pattern in _DECLARED for name in pattern.findall(text)}


def _unfolded(name: str, files: Mapping[str, str], seen: set[str]) -> str:
    """A file, the headers before it that were not seen yet."""
    seen.add(name)
    text = files[name]
    if guarded := _GUARD.fullmatch(text):  # no guard: that of a library may have the same name
        text = _PROTOTYPE.sub("INTERNAL ", guarded[1] + guarded[2])
    return _without_includes(text, files, seen)


def _without_includes(text: str, files: Mapping[str, str], seen: set[str]) -> str:
    def put(match: re.Match[str]) -> str:
        header = match.group(1)
        return "" if header in seen else _unfolded(header, files, seen)

    return _INCLUDE.sub(put, text)
