"""Controller inside an FMU. It replaces the inputs of the motors that it drives."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, get_args

import casadi
from casadi import MX, SX, Function

from mbs.assembly import System
from mbs.errors import ExportError
from mbs.export.fmu.description import FmuVariable, Solver
from mbs.export.fmu.pack import FACES
from mbs.files import PathLike, path_of
from mbs.models.state.signals import effort_function
from mbs.native.compiler import cached_library, flags_for
from mbs.text import quoted

# Control law in C from the user, as a casadi.Function and as source files of the FMU.


_NAME = re.compile(r"[A-Za-z_]\w*", re.ASCII)
_DEFINED = re.compile(
    r"^(?P<type>[A-Za-z_][\w *]*?[ *])(?P<name>[A-Za-z_]\w*)\s*\([^;{}()]*\)\s*\{", re.ASCII | re.M
)
_PREFIXES = ("fmi2", "fmi3", "mbs_")
_C_ARGUMENTS = "double t, const double *q, const double *v, const double *w"

Sources = tuple[tuple[str, str], ...]
"""Pairs of file name and text."""


@dataclass(frozen=True, slots=True)
class CController:
    """C function that computes the joint efforts, with optional further inputs.

    Its prototype, where w holds the further inputs in order, is

        void NAME(double t, const double *q, const double *v, const double *w, double *tau);

    and the prototype of the Jacobian J (nv, 1 + nq + nv + nw) by t, q, v and w, column-major, is

        void NAME(double t, const double *q, const double *v, const double *w, double *J);

    Both may be called at any time in any order, so they must not keep data between calls.

    Attributes:
        function: name of the function.
        inputs: dict from the name of every further input to its number of values, in order.
        jacobian: name of the function of the Jacobian. Central differences if None.
    """

    function: str
    inputs: Mapping[str, int] = field(default_factory=dict)
    jacobian: str | None = None

    def __post_init__(self) -> None:
        for name in filter(None, (self.function, self.jacobian)):
            if not isinstance(name, str) or not _NAME.fullmatch(name):
                raise ExportError(f"controller: {quoted(name)} is no name of a C function")
        for name, size in self.inputs.items():
            if not isinstance(size, int) or isinstance(size, bool) or size < 1:
                raise ExportError(
                    f"controller {self.function}: input {quoted(name)} has {quoted(size)} values;"
                    " give a whole number from 1"
                )


def read_sources(paths: Sequence[PathLike]) -> Sources:
    """Read the C files of the user.

    Raises:
        ExportError: a file cannot be read, is given twice or is no C file, or its name or a
            function in it has a name that the FMU itself uses.
    """
    if not isinstance(paths, Iterable) and not isinstance(paths, os.PathLike):
        raise ExportError(f"sources: {quoted(paths)} is no list of paths; name C files")
    given = [paths] if isinstance(paths, (str, os.PathLike)) else list(paths)
    texts: dict[str, str] = {}
    taken = _own_files() if given else {}
    functions = _functions(taken.values())
    for path in map(path_of, given):
        if path.suffix not in (".c", ".h"):
            raise ExportError(f"sources: {path} is no C file; give files that end in .c or .h")
        if path.name in texts:
            raise ExportError(f"sources: {path.name} is given twice; give each file once")
        if path.name in taken or path.name.startswith(_PREFIXES):
            raise ExportError(f"sources: {path.name} is a file of every FMU; rename yours")
        try:
            texts[path.name] = path.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            reason = getattr(error, "strerror", None) or "it is not UTF-8"
            raise ExportError(f"sources: {path} cannot be read ({reason})") from error
        _check_functions(path.name, _functions([texts[path.name]]), functions)
    return tuple(texts.items())


def _own_files() -> dict[str, str]:
    """Return the source files that every FMU contains: dict from name to text."""
    fixed = (face.fixed(solver) for face in FACES.values() for solver in get_args(Solver))
    return {"model.c": "", "model.h": "", **{k: v for files in fixed for k, v in files.items()}}


def _functions(texts: Iterable[str]) -> set[str]:
    """Return the names of the functions with external linkage that C files define."""
    return {
        found["name"]
        for text in texts
        for found in _DEFINED.finditer(text)
        if "static" not in found["type"].split()
    }


def _check_functions(file: str, found: set[str], taken: set[str]) -> None:
    """Raise ExportError if a function of the user has the name of a function of the FMU."""
    for name in sorted(found):
        if name in taken or name.startswith(_PREFIXES):
            raise ExportError(
                f"sources: {file} defines {name}, which is a function of every FMU; rename yours"
            )


def c_function(
    system: System, law: CController, sources: Sources
) -> tuple[Function, tuple[str, str]]:
    """Return the law as Function `law(t, q, v, w) -> tau`, and the C file by which CasADi calls it.

    Args:
        system: mechanism that the controller drives.
        law: names of the C functions and their inputs.
        sources: C files and headers.

    Raises:
        ExportError: the sources contain no C file.
        CompilerError: no C compiler is installed, or the sources do not compile.
    """
    if not any(name.endswith(".c") for name, _ in sources):
        raise ExportError(
            f"{system.name}: the controller {law.function} is a C function without source; name"
            " its file in sources"
        )
    name = f"mbs_law_{law.function}"
    glue = f"{name}.c", _glue(name, law, (system.nq, system.nv, sum(law.inputs.values())))
    files = dict((*sources, glue))
    complete = ("-Wl,-z,defs",) if sys.platform == "linux" else ()  # undefined symbols are errors
    library = cached_library(files, (*flags_for("".join(files.values())), *complete))
    return casadi.external(name, str(library)), glue


_GLUE = """\
/* Calls {function} as the generated code does. */
#include <math.h>

#define N_Q {nq}
#define N_V {nv}
#define N_W {nw}
#define N_IN (1 + N_Q + N_V + N_W)

void {function}({point}, double *tau);
{prototype}
static const long long SIZES[4][3] = {{{{1, 1, 1}}, {{N_Q, 1, 1}}, {{N_V, 1, 1}}, {{N_W, 1, 1}}}};
static const long long BLOCKS[4][3] = {{
    {{N_V, 1, 1}}, {{N_V, N_Q, 1}}, {{N_V, N_V, 1}}, {{N_V, N_W, 1}}}};

static void mbs_gather(const double **arg, double *in) {{
    const int sizes[] = {{1, N_Q, N_V, N_W}};
    for (int k = 0; k < 4; ++k)
        for (int i = 0; i < sizes[k]; ++i) *in++ = arg[k] ? arg[k][i] : 0;
}}

static void mbs_evaluate(const double *in, double *tau) {{
    {function}(in[0], in + 1, in + 1 + N_Q, in + 1 + N_Q + N_V, tau);
}}

{differentiate}
int {name}(const double **arg, double **res, long long *iw, double *w, int mem) {{
    (void)iw, (void)mem;
    mbs_gather(arg, w);
    if (res[0]) mbs_evaluate(w, res[0]);
    return 0;
}}

int jac_{name}(const double **arg, double **res, long long *iw, double *w, int mem) {{
    const int sizes[] = {{1, N_Q, N_V, N_W}};
    double *J = w + N_IN;
    (void)iw, (void)mem;
    mbs_gather(arg, w);
    mbs_differentiate(w, J, J + N_V * N_IN);
    for (int k = 0; k < 4; ++k)
        for (int i = 0; i < N_V * sizes[k]; ++i, ++J)
            if (res[k]) res[k][i] = *J;
    return 0;
}}

long long {name}_n_in(void) {{ return 4; }}
long long {name}_n_out(void) {{ return 1; }}
const long long *{name}_sparsity_in(long long k) {{ return SIZES[k]; }}
const long long *{name}_sparsity_out(long long k) {{ (void)k; return SIZES[2]; }}
int {name}_work(long long *arg, long long *res, long long *iw, long long *w) {{
    *arg = 4, *res = 1, *iw = 0, *w = N_IN;
    return 0;
}}
long long jac_{name}_n_in(void) {{ return 5; }}
long long jac_{name}_n_out(void) {{ return 4; }}
const long long *jac_{name}_sparsity_in(long long k) {{ return SIZES[k < 4 ? k : 2]; }}
const long long *jac_{name}_sparsity_out(long long k) {{ return BLOCKS[k]; }}
int jac_{name}_work(long long *arg, long long *res, long long *iw, long long *w) {{
    *arg = 5, *res = 4, *iw = 0, *w = N_IN + N_V * N_IN + 2 * N_V;
    return 0;
}}
"""
_DIFFERENCES = """\
/* Central differences; `room` holds 2 N_V numbers. */
static void mbs_differentiate(double *in, double *J, double *room) {
    for (int k = 0; k < N_IN; ++k, J += N_V) {
        const double x = in[k], h = 6e-6 * fmax(1, fabs(x)), up = x + h, down = x - h;
        in[k] = up;
        mbs_evaluate(in, room);
        in[k] = down;
        mbs_evaluate(in, room + N_V);
        in[k] = x;
        for (int i = 0; i < N_V; ++i) J[i] = (room[i] - room[N_V + i]) / (up - down);
    }
}
"""
_GIVEN = """\
static void mbs_differentiate(double *in, double *J, double *room) {{
    (void)room;
    {jacobian}(in[0], in + 1, in + 1 + N_Q, in + 1 + N_Q + N_V, J);
}}
"""


def _glue(name: str, law: CController, sizes: tuple[int, int, int]) -> str:
    nq, nv, nw = sizes
    prototype, differentiate = "", _DIFFERENCES
    if law.jacobian is not None:
        prototype = f"void {law.jacobian}({_C_ARGUMENTS}, double *J);\n"
        differentiate = _GIVEN.format(jacobian=law.jacobian)
    return _GLUE.format(
        name=name,
        function=law.function,
        point=_C_ARGUMENTS,
        prototype=prototype,
        differentiate=differentiate,
        nq=nq,
        nv=nv,
        nw=nw,
    )


Law = Function | Callable[[Any, Any, Any], Any] | CController | str | None
"""Types of a control law in the arguments of `fmu`."""

_POINT = ("t", "q", "v")


@dataclass(frozen=True, slots=True, eq=False)
class Controller:
    """Control law with its inputs w.

    Attributes:
        effort: `effort(t, q, v, w, p) -> tau`, (nv, 1). None if the motor efforts are inputs.
        device: `device(t, q, v, w, p) -> u`, inputs of the components (such as motors). None if
            they are inputs of the FMU.
        inputs: variables of w.
        sources: further C files of the FMU.
    """

    effort: Function | None = None
    device: Function | None = None
    inputs: tuple[FmuVariable, ...] = ()
    sources: Sources = ()


def controller_of(system: System, law: Law, sources: Sources = ()) -> Controller:
    """Convert a control law to the controller of an FMU.

    Args:
        system: mechanism that the controller drives.
        law: a function of (t, q, v) that returns tau, as in `mbs.simulate.run`; a casadi.Function
            with inputs t, q, v and optional further inputs, and outputs "tau" (nv, 1), "u" (inputs
            of the components) or both; or a C function of the sources.
        sources: C files and headers.

    Raises:
        ExportError: the law has other inputs or outputs, or another type.
        ModelError: a Python function cannot be traced or returns no efforts.
        CompilerError: C sources do not compile.
    """
    if law is None:
        return Controller(sources=sources)
    if isinstance(law, str):
        law = CController(law)
    if isinstance(law, CController):
        called, glue = c_function(system, law, sources)
        names = [
            (f"{name}[{k + 1}]" if n > 1 else name)
            for name, n in law.inputs.items()
            for k in range(n)
        ]
        inputs = tuple(_input(name, 0.0) for name in names)
        point = _symbols(system, called, len(inputs))
        effort = Function("effort", point, [called(*point[:4])])
        return Controller(effort, None, inputs, (*sources, glue))
    if isinstance(law, Function):
        return _of_function(system, law, sources)
    if not callable(law):
        raise ExportError(
            f"{system.name}: the controller is {quoted(law)}; give a function of (t, q, v), a"
            " casadi.Function, an mbs.export.CController or the name of a C function"
        )
    traced = effort_function(system, law)
    assert traced is not None
    t, q, v, w, p = _symbols(system, traced, 0)
    return Controller(Function("effort", [t, q, v, w, p], [traced(t, q, v, p)]), sources=sources)


def _of_function(system: System, law: Function, sources: Sources) -> Controller:
    _check_inputs(system, law)
    outputs = _outputs(system, law)
    further = range(3, law.n_in())
    sizes = [law.numel_in(k) for k in further]
    point = _symbols(system, law, sum(sizes))
    t, q, v, w, _ = point
    offsets = [sum(sizes[:k]) for k in range(len(sizes) + 1)]
    values = law.call([t, q, v, *(w[a:b] for a, b in pairwise(offsets))])
    made = {
        name: Function(kind, point, [casadi.densify(casadi.vec(values[outputs[name]]))])
        for name, kind in (("tau", "effort"), ("u", "device"))
        if name in outputs
    }
    return Controller(made.get("tau"), made.get("u"), tuple(_inputs(law)), sources)


def _symbols(system: System, law: Function, nw: int) -> list[Any]:
    """Return symbols t, q, v, w and p: SX if the law is an SX function, else MX."""
    kind = SX if law.is_a("SXFunction") else MX
    sizes = {"t": 1, "q": system.nq, "v": system.nv, "w": nw, "p": len(system.parameters)}
    return [kind.sym(name, size) for name, size in sizes.items()]


def _check_inputs(system: System, law: Function) -> None:
    sizes = [law.numel_in(k) for k in range(min(3, law.n_in()))]
    expected = [1, system.nq, system.nv]
    if sizes != expected:
        raise ExportError(
            f"{system.name}: the controller {law.name()} starts with inputs of sizes {sizes}; give"
            f" t, q and v of sizes {expected}, then further inputs"
        )
    names = law.name_in()
    if any(name in _POINT and name != _POINT[k] for k, name in enumerate(names[:3])):
        raise ExportError(
            f"{system.name}: the controller {law.name()} has inputs {', '.join(names)};"
            " give t, q and v first, in this order"
        )
    for k in range(3, law.n_in()):
        if law.size2_in(k) != 1:
            raise ExportError(
                f"{system.name}: input {law.name_in(k)} of the controller {law.name()} has"
                f" {law.size2_in(k)} columns; make it a column of numbers"
            )
    if law.has_free():
        raise ExportError(
            f"{system.name}: the controller {law.name()} holds the symbols"
            f" {', '.join(law.get_free())}; make them inputs"
        )


def _outputs(system: System, law: Function) -> dict[str, int]:
    """Return the output index of the efforts "tau" and of the component inputs "u"."""
    names = law.name_out()
    columns = {name: k for k, name in enumerate(names)}
    if len(names) == 1 and names != ["u"]:
        columns = {"tau": 0}
    sizes = {"tau": system.nv, "u": system.u.numel()}
    if not set(columns) <= set(sizes):
        raise ExportError(
            f"{system.name}: the controller {law.name()} has outputs {', '.join(names)}; call them"
            " tau for efforts of joints, and u for inputs of devices"
        )
    for name, k in columns.items():
        if law.numel_out(k) != sizes[name] or not sizes[name]:
            raise ExportError(
                f"{system.name}: the controller {law.name()} gives {law.numel_out(k)} values of"
                f" {name}, the system has {sizes[name]}"
            )
    return columns


def _inputs(law: Function) -> Iterator[FmuVariable]:
    for k in range(3, law.n_in()):
        name, size, start = law.name_in(k), law.numel_in(k), law.default_in(k)
        for i in range(size):
            yield _input(name if size == 1 else f"{name}[{i + 1}]", start)


def _input(name: str, start: float) -> FmuVariable:
    return FmuVariable(name=name, start=start, description=f"input {name} of the controller")
