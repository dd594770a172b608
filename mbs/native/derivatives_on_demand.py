"""Derivatives of a compiled Function, made when CasADi first asks for them.

CasADi finds the derivatives of an external Function `f` by the names `jac_f`, `fwd1_f` and `adj1_f`
in the library of `f`, whoever asks: a call of `jacobian`, a solver, a graph with a call of `f` in
it, in this process or in one that a Function was sent to. To write and compile them takes ten times
as long as `f`. So the library has these names, and behind them what asks Python for the true code
when it is first called; Python finds the Function in a file of the cache, or makes it where it was
promised in this process.
"""

from __future__ import annotations

import ctypes
import functools
import json
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from importlib import resources
from pathlib import Path
from typing import Any, NamedTuple

import casadi

from mbs.errors import CompilerError, ExportError
from mbs.files import read_sealed, write_sealed
from mbs.native.compiler import cache_dir
from mbs.native.kernel import LoopCode

_SUFFIX = ".function"

_ENDS = {
    "": "int, (const double **arg, double **res, ll *iw, double *w, int mem),"
    " (arg, res, iw, w, mem)",
    "_n_in": "ll, (void), ()",
    "_n_out": "ll, (void), ()",
    "_default_in": "double, (ll i), (i)",
    "_name_in": "const char *, (ll i), (i)",
    "_name_out": "const char *, (ll i), (i)",
    "_sparsity_in": "const ll *, (ll i), (i)",
    "_sparsity_out": "const ll *, (ll i), (i)",
    "_work": "int, (ll *arg, ll *res, ll *iw, ll *w), (arg, res, iw, w)",
    "_checkout": "int, (void), ()",
    "_release": "void, (int mem), (mem)",
    "_incref": "void, (void), ()",
    "_decref": "void, (void), ()",
}
"""Names beside that of a derivative that CasADi may ask for: type, arguments, what is passed on."""

_PATTERN = "_sparsity_out"

_FAILS = ("", "_work")
"""Those that answer 1 where there is no code, which CasADi reports; the others answer 0."""

_LATE = ("_release", "_decref")
"""Those that are called at the end."""


class Derivative(NamedTuple):
    """What is made at once: the code of a derivative, or where a Jacobian has elements.

    Attributes:
        name: of the Function in C, `jac_fwd1_f` for the Jacobian of `fwd1_f`.
        pattern: its sparsity alone. CasADi asks for that of `jac_f` also where it takes products
            with directions in place of the Jacobian.
    """

    name: str
    pattern: bool = False

    def symbols(self) -> list[tuple[str, str]]:
        """Its names in the library, as beginning and end."""
        if self.pattern:
            return [(self.name, _PATTERN)]
        apart = self.name.startswith("jac_")
        return [(self.name, end) for end in _ENDS if not (apart and end == _PATTERN)]

    def of(self, function: casadi.Function) -> casadi.Function:
        """That derivative of a Function."""
        return _derivative(function, self.name)


def _derivative(function: casadi.Function, name: str) -> casadi.Function:
    if name == function.name():
        return function
    way, _, rest = name.partition("_")
    inner = _derivative(function, rest)
    if way == _BY_PARAMETERS:
        return _by_parameters(inner, name)
    return inner.jacobian() if way == "jac" else getattr(inner, _WAYS[way])(1)


_WAYS = {"fwd1": "forward", "adj1": "reverse"}

_BY_PARAMETERS = "byp"


def by_parameters(function: str) -> Derivative:
    """The derivative of the first output of a Function by its last input, every element of it.

    Args:
        function: its name.
    """
    return Derivative(f"{_BY_PARAMETERS}_{function}")


def _by_parameters(function: casadi.Function, name: str) -> casadi.Function:
    symbols: Any = function.sx_in() if function.is_a("SXFunction") else function.mx_in()
    slope = casadi.densify(casadi.jacobian(function.call(symbols)[0], symbols[-1]))
    return casadi.Function(name, symbols, [slope], function.name_in(), ["slope"], {"cse": True})


def derivatives_of(function: str, order: int) -> list[Derivative]:
    """The derivatives of a Function by the names that CasADi gives them.

    Args:
        function: its name.
        order: how often it can be differentiated, 1 or 2.
    """
    first = [f"{way}_{function}" for way in _WAYS]
    jacobian = f"jac_{function}"
    every = [Derivative(jacobian), Derivative(jacobian, pattern=True), *map(Derivative, first)]
    if order == 2:
        every += [Derivative(f"{way}_{name}") for name in first for way in _WAYS]
        every += [Derivative(f"jac_{name}", pattern=True) for name in first]
    return every


def source(
    every: Sequence[Derivative], record: Path, own: Sequence[Derivative] | None = None
) -> str:
    """C text that has the names of derivatives.

    Args:
        every: the derivatives.
        record: the file of the Function.
        own: those of them whose names it has, all when left out.
    """
    head = resources.files("mbs.native").joinpath("runtime/on_demand.c").read_text("utf-8")
    path = os.fspath(record).replace("\\", "\\\\").replace('"', '\\"').replace("?", "\\?")
    count = sum(len(part.symbols()) for part in every)
    start = [f"#define COUNT {count}", f"#define PARTS {len(every)}", f'#define RECORD "{path}"']
    return "\n".join([*start, head, *_lines(every, every if own is None else own)])


def _lines(every: Sequence[Derivative], own: Sequence[Derivative]) -> Iterator[str]:
    symbols = [(k, name, end) for k, part in enumerate(every) for name, end in part.symbols()]
    for index, (part, name, end) in enumerate(symbols):
        if every[part] not in own:
            continue
        kind, rest = _ENDS[end].split(", ", 1)
        at = f"{name}{end}, {index}, {part}, {'there' if end in _LATE else 'fetched'}"
        if kind == "void":
            yield f"FORWARD_VOID({at}, {rest})"
        else:
            yield f"FORWARD({at}, {int(end in _FAILS)}, {kind}, {rest})"


def fill(table: int, library: Path, every: Sequence[Derivative], made: int) -> None:
    """Put the addresses of the functions of a library into the table of another one.

    Args:
        table: its address; it keeps zeros where the library has no such name.
        library: of a derivative.
        every: all derivatives.
        made: the number of that one.
    """
    code, symbols = ctypes.CDLL(os.fspath(library)), every[made].symbols()
    first = sum(len(part.symbols()) for part in every[:made])
    size = ctypes.sizeof(ctypes.c_void_p)
    addresses = (ctypes.c_void_p * len(symbols)).from_address(table + first * size)
    for k, (name, end) in enumerate(symbols):
        if hasattr(code, name + end):
            addresses[k] = ctypes.cast(code[name + end], ctypes.c_void_p).value


def write_record(
    key: str, text: str, every: Sequence[Derivative], fast: bool, loops: LoopCode | None = None
) -> Path | None:
    """The file of a Function whose derivatives are made later; None where it cannot be written.

    Args:
        key: distinguishes it from others.
        text: the serialised Function.
        every: these derivatives.
        fast: of which kind their code is.
        loops: what the Jacobian is made of, where it is not straight lines.
    """
    record = cache_dir() / f"{key}{_SUFFIX}"
    parts = (part.name + _ONLY_PATTERN * part.pattern for part in every)
    content = f"{' '.join((str(int(fast)), *parts))}\n{json.dumps(loops)}\n{text}".encode()
    with suppress(OSError, ValueError):
        if read_sealed(record) == content:
            return record
    try:
        os.fspath(record).encode()  # it stands in C text
        write_sealed(content, record)
    except (ExportError, ValueError):
        return None
    return record


_ONLY_PATTERN = "*"


class DerivativeSource(NamedTuple):
    """What derivatives are made of.

    Attributes:
        function: gives the Function of that derivative.
        every: all of the derivatives.
        fast: of which kind their code is.
        loops: what the Jacobian is made of, where it is not straight lines.
    """

    function: Callable[[Derivative], casadi.Function]
    every: Sequence[Derivative]
    fast: bool
    loops: LoopCode | None = None


_PROMISED: dict[Path, DerivativeSource] = {}


def promise(record: Path, content: DerivativeSource) -> None:
    """Have derivatives made in this process without a file, in which the equations would stand.

    Args:
        record: the path that the library has.
        content: of it.
    """
    _PROMISED[record] = content


@functools.lru_cache(maxsize=1)  # one derivative is often followed by another
def read_record(record: Path) -> DerivativeSource:
    """The Function, its derivatives and the kind of their code.

    Raises:
        CompilerError: the file has gone or is damaged.
    """
    if record in _PROMISED:
        return _PROMISED[record]
    try:
        options, code, text = read_sealed(record).decode().split("\n", 2)
        fast, *names = options.split()
        every = [
            Derivative(n.removesuffix(_ONLY_PATTERN), n.endswith(_ONLY_PATTERN)) for n in names
        ]
        function, loops = casadi.Function.deserialize(text), json.loads(code)
        by_loops = LoopCode(*loops) if loops else None
        return DerivativeSource(lambda _: function, every, bool(int(fast)), by_loops)
    except (OSError, ValueError, RuntimeError) as error:
        raise CompilerError(
            f"the derivatives of a compiled Function cannot be made: {record} has gone or is"
            " damaged; compile the Function again"
        ) from error
