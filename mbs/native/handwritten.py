"""Functions with handwritten C code, which is copied into the C code of their callers."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import casadi
from casadi import Function

from mbs.native.compiler import FLAGS, cached_library
from mbs.native.frames import EXPORT, function_table

FUNCTION = "FUNCTION"
"""Placeholder of the function name in handwritten C text."""

RUNTIME_FLAGS = ("-O3", *FLAGS[1:])
"""Flags for the C run-time, which consists of loops that -O3 makes faster."""
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
    """C text of a handwritten function.

    Attributes:
        own: definitions of the function and its Jacobian `jac_...`, after their includes and
            tables.
        common: run-time files that the function includes or calls: file name to text. Several
            functions may share them.
    """

    own: str
    common: Mapping[str, str]


_known: dict[str, HandwrittenC] = {}
"""Handwritten functions by name. The name contains a hash of the text. Entries are never removed,
because the end of the last copy of a Function cannot be observed."""


def handwritten(
    signature: Function, jacobian: Function, own: str, common: Mapping[str, str], work: int
) -> Function:
    """Compile handwritten C code for this computer, as a Function.

    Args:
        signature: placeholder Function with the inputs and outputs; its content is ignored.
        jacobian: placeholder Function with the inputs and outputs of the Jacobian.
        own: C text that includes headers of `common` and defines ``int FUNCTION(const double
            **arg, double **res, long long *iw, double *w, int mem)`` and ``jac_FUNCTION``. It may
            use math.h and string.h, but no heap and no static or global variables that change.
        common: C files and headers to link: file name to text. The C files must not define the
            same name twice.
        work: doubles of w that the function or its Jacobian needs.

    Returns:
        external Function. Its name is the name of the signature and a hash of the text.
        `generated` writes the text together with the code of Functions that call it.

    Raises:
        CompilerError: there is no compiler, or it rejects the code.
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
    """Return a Function with the same inputs and outputs and another name."""
    symbols = [casadi.MX.sym(x, *function.size_in(x)) for x in function.name_in()]
    return Function(name, symbols, function.call(symbols), function.name_in(), function.name_out())


def is_handwritten(function: Function) -> bool:
    """Whether a Function is the result of `handwritten`, or the Jacobian of such a Function.

    Args:
        function: any Function.
    """
    return function.is_a("External") and function.name().removeprefix("jac_") in _known


def handwritten_text(functions: Iterable[Function]) -> str:
    """Return the handwritten C code that Functions call; empty if there is none.

    All functions of the text are static, so that several libraries of a program may contain it.

    Args:
        functions: any Functions.
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
    """Return the names that a handwritten text declares, which other functions must not use.

    Args:
        text: C text from `handwritten_text`.
    """
    return {name for pattern in _DECLARED for name in pattern.findall(text)}


def _unfolded(name: str, files: Mapping[str, str], seen: set[str]) -> str:
    """Return the text of a C file with its headers inserted and without include guard.

    Headers in `seen` are left out; the file and the inserted headers are added to `seen`.
    """
    seen.add(name)
    text = files[name]
    if guarded := _GUARD.fullmatch(text):  # drop the guard: a library header may use its name
        text = _PROTOTYPE.sub("INTERNAL ", guarded[1] + guarded[2])
    return _without_includes(text, files, seen)


def _without_includes(text: str, files: Mapping[str, str], seen: set[str]) -> str:
    """Return C text in which includes of `files` are replaced by their texts, once each.

    Headers in `seen` are left out; inserted headers are added to it.
    """

    def put(match: re.Match[str]) -> str:
        header = match.group(1)
        return "" if header in seen else _unfolded(header, files, seen)

    return _INCLUDE.sub(put, text)
