"""Export of models as C source: .c and .h files, CMakeLists.txt and an example program."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import casadi
import numpy as np
from casadi import MX, SX, Function

from mbs.assembly import System
from mbs.assembly.model_function import ModelFunction
from mbs.errors import ExportError, ModelError
from mbs.export.c_check import NO_FAST_MATH, STATUS, StatusCheck, check_of
from mbs.export.c_options import CLibraryArguments, CLibraryOptions, Functions, Model
from mbs.export.c_step import StepTexts, step_texts
from mbs.files import path_of, write_texts
from mbs.native._compiled import generated, require_function, require_names, unwritten
from mbs.native.c_code import Real, literal
from mbs.native.frames import NOINLINE
from mbs.native.handwritten import handwritten_text, names_declared
from mbs.native.scalar_source import bare_source
from mbs.options import arguments_of, faults, group_values
from mbs.text import in_c_comment, quoted

# Names that are reserved in C, C++ and CMake.


def _words(text: str) -> list[str]:
    """Return the words of a text, which blanks and line breaks separate."""
    return text.split()


_KEYWORDS = _words("""
alignas alignof and and_eq asm auto bitand bitor bool break case catch char class compl const
constexpr continue decltype default delete do double else enum explicit export extern false float
for friend goto if inline int long mutable namespace new noexcept not not_eq nullptr operator or
or_eq private protected public register reinterpret_cast restrict return short signed sizeof static
static_assert struct switch template this thread_local throw true try typedef typeid typename union
unsigned using virtual void volatile wchar_t while xor xor_eq typeof typeof_unqual
const_cast dynamic_cast static_cast concept requires char8_t char16_t char32_t
""")
_REAL_FUNCTIONS = _words("""
acos acosh asin asinh atan atan2 atanh cbrt ceil copysign cos cosh erf erfc exp exp2 expm1 fabs fdim
floor fma fmax fmin fmod frexp hypot ilogb ldexp lgamma llrint llround log log10 log1p log2 logb
lrint lround modf nan nearbyint nextafter nexttoward pow remainder remquo rint round scalbln scalbn
sin sinh sqrt tan tanh tgamma trunc j0 j1 jn y0 y1 yn drem significand scalb
exp10 pow10
""")
_FUNCTIONS = _words("""
abort abs atexit atof atoi atol bsearch calloc div exit free getenv labs ldiv llabs malloc mblen
qsort rand realloc srand strtod strtol strtoul system clearerr fclose feof ferror fflush fgetc fgets
fopen fprintf fputc fputs fread freopen fscanf fseek ftell fwrite getc getchar gets perror printf
putc putchar puts remove rename rewind scanf setbuf setvbuf snprintf sprintf sscanf tmpfile tmpnam
ungetc vfprintf vprintf vsnprintf vsprintf memchr memcmp memcpy memmove memset strcat strchr strcmp
strcoll strcpy strcspn strerror strlen strncat strncmp strncpy strpbrk strrchr strspn strstr strtok
clock difftime mktime time asctime ctime gmtime localtime strftime signal raise isnan isinf isfinite
index main gamma isnormal signbit fpclassify finite ffs bcmp bcopy bzero rindex random srandom
casadi_real casadi_int stdin stdout stderr errno linux unix i386 signgam assert
NULL EOF FILE NAN INFINITY HUGE_VAL RAND_MAX BUFSIZ DOMAIN SING OVERFLOW UNDERFLOW
CASADI_CODEGEN_PREFIX CASADI_NAMESPACE_CONCAT CASADI_PREFIX CASADI_SYMBOL_EXPORT
""")
_RESERVED = {
    *_KEYWORDS,
    *_FUNCTIONS,
    *_REAL_FUNCTIONS,
    *(f"{name}{kind}" for name in _REAL_FUNCTIONS for kind in "fl"),
}
_FILES = _words("""
assert complex ctype errno fenv float inttypes iso646 limits locale math setjmp signal stdalign
stdarg stdatomic stdbit stdbool stdckdint stddef stdint stdio stdlib stdnoreturn string tgmath
threads time uchar wchar wctype strings memory unistd features malloc
example all clean test install help package edit_cache rebuild_cache m c dl rt pthread
""")
_SUFFIXES = _words("""
eval alloc_mem init_mem free_mem checkout release incref decref n_in n_out name_in name_out
default_in sparsity_in sparsity_out work work_bytes check start step motion state watched
""")
_OF_CASADI = ("null", "jac", "hess")


def library_name(folder: str) -> str:
    """Return the name of the files and of the CMake target of a library.

    It is the folder name as a C identifier: `2r` becomes models_2r, and `math` becomes math_models.

    Args:
        folder: name of the folder, without its path.
    """
    name = re.sub(r"\W", "_", folder, flags=re.ASCII)
    if not re.search(r"[A-Za-z0-9]", name):
        return "models"
    if not name[0].isalpha():
        return f"models_{name.lstrip('_')}"
    return f"{name}_models" if name.lower() in _FILES else name


def check_function_names(names: Sequence[str], where: str) -> None:
    """Check that names of Functions are valid and distinct names of C functions.

    Args:
        names: names of all Functions of a library.
        where: name of the library, for the error message.

    Raises:
        ModelError: a name is no identifier or is reserved in C or C++, or two names result in the
            same name of a generated C function or macro.
    """
    owner: dict[str, str] = {}
    for name in names:
        if not re.fullmatch(r"[A-Za-z](_?[A-Za-z0-9])*_?", name, re.ASCII) or name in _OF_CASADI:
            raise ModelError(
                f"{where}: {name!r} is no name of a function; use letters, digits and single"
                " underscores, a letter first"
            )
        if name in _RESERVED or name.startswith("casadi_"):
            raise ModelError(
                f"{where}: {name!r} is a name of C; give another one, as in"
                f" {{'my_{name}': function}}"
            )
        sizes = (f"{name.upper()}_SZ_W", f"{name.upper()}_STEP_SZ_W")
        for made in (name, *sizes, *(f"{name}_{suffix}" for suffix in _SUFFIXES)):
            if made in owner:
                raise ModelError(
                    f"{where}: functions {owner[made]!r} and {name!r} would both make {made} in C;"
                    " give one of them another name, as in {'name': function}"
                )
            owner[made] = name


def parameter_names(names: Iterable[str], taken: Iterable[str]) -> list[str]:
    """Return valid, distinct names of C parameters, unchanged if possible.

    Characters other than ASCII letters, digits and underscores become underscores. Underscores are
    appended to names that are not free.

    Args:
        names: desired names.
        taken: names that are already used in the same scope.
    """
    used = set(taken)
    free = []
    for name in names:
        name = re.sub(r"\W", "_", name, flags=re.ASCII)
        if not name[:1].isalpha():
            name = f"x_{name}"
        while name in used or name in _RESERVED:
            name += "_"
        used.add(name)
        free.append(name)
    return free


_MARK = "Generated by mbs"
_PROTOTYPE = """\
/** {signature}
 *
{arguments} *
 *  All matrices are dense and stored column by column. `w` is scratch memory of
 *  {upper}_SZ_W numbers; nothing is allocated and nothing is kept between calls.
 *  No pointer may be NULL. Returns {returns}.
 */
int {name}_eval({parameters}, {real} *w);
#define {upper}_SZ_W {sz_w}
"""

_WRAPPER = """\
int {name}_eval({parameters}, {real} *w) {{
  const {real} *arg[{sz_arg}];
  {real} *res[{sz_res}];
  long long int iw[{sz_iw}];
{declared}  int status = MBS_OK;
{assignments}
{body}  return status;
}}
"""
_CALL = "if ({name}(arg, res, iw, w, 0)) status = MBS_NO_RESULT;"
_CHECKED = """\
  {call}
  /* afterwards, beside what is still being computed */
  if (!({finite})) status = MBS_NOT_FINITE;
{rows}  if (!status && !({numbers})) status = MBS_NO_RESULT;
  if (status) {{
{erase}  }}
"""
_ROWS = """\
  for (k = 0; k < {count} && !status; ++k)
    if (!(holds[k] > {zero})) status = wrong[k];
"""
_HOLDS = """\
  static const unsigned char wrong[] = {{{statuses}}};
  {real} holds[{count}] = {{0}};
  int k;
"""
_HELPERS = """\
/* What is called where something is wrong stays out of the way. */
#undef COLD
#ifdef __GNUC__
#define COLD __attribute__((noinline, cold))
#else
#define COLD
#endif

/* Whether all are numbers: a sum of them is none where one is none. */
static COLD int mbs__finite(const {real} *x, int n) {{
  {real} sum = 0;
  int k, all = 1;
  for (k = 0; k < n; ++k) sum += x[k];
  if ({abs}(sum) <= {largest}) return 1;
  for (k = 0; k < n; ++k) all &= {abs}(x[k]) <= {largest};
  return all;
}}

static COLD void mbs__erase({real} *x, int n) {{
  int k;
  for (k = 0; k < n; ++k) x[k] = ({real})NAN;
}}
"""

_LARGEST: dict[Real, tuple[str, str]] = {
    "double": ("fabs", "DBL_MAX"),
    "float": ("fabsf", "FLT_MAX"),
}
"""C function of the absolute value, and C constant of the largest number, by type."""

_FEW = 64
"""Largest number of values that one sum checks for NaN. If the sum overflows, each is checked."""


@arguments_of(CLibraryArguments)
def c_library(options: CLibraryArguments) -> Path:
    """Write models as portable C source.

    The folder contains `NAME.c` (generated code and wrappers), `NAME.h` (a documented prototype for
    each function), `CMakeLists.txt`, and `example.c`, a program that calls every function once and
    prints its outputs. NAME is the name of the folder as a C identifier: `2r` becomes models_2r,
    and `math` becomes math_models. Inputs with a reserved name of C get an underscore.

    A call returns an `mbs_status`, documented in the header: MBS_OK, or the error, with all outputs
    NaN. Calls in Python have the same checks. An error is an input or result that is not finite,
    a quaternion without unit length, a parameter out of its bounds, an open loop (beyond a
    tolerance relative to the size of the mechanism), or a configuration in which the independent
    joints do not determine the others. A casadi.Function that is no model is only checked for
    finite inputs and outputs. The unused columns of the general inverse geometric model (solutions
    that do not exist) are NaN without an error.

    With target="bare" the code is for microcontrollers: C99 in scalar operations, without heap,
    files and global variables. It needs math.h, memset and memcpy. A system in `functions` becomes
    a simulation of its motion in a separate file. The caller owns its state. `SYSTEM_start` sets
    the start. `SYSTEM_step` makes a step of the classical Runge-Kutta method, with loops closed at
    every evaluation. `SYSTEM_motion` computes positions, velocities and accelerations of all
    joints. If it is compiled in double without fused multiplications (`-std=c99` or
    `-ffp-contract=off` of GCC and clang), results equal `mbs.export.fmu(system, solver="rk4")`.

    Args:
        options: see `CLibraryArguments`.

    Returns:
        Path of the folder.

    Raises:
        ExportError: the folder cannot be written, or contains a file of the same name that mbs did
            not write. Nothing is written then. Or the target or type is unknown.
        ModelError: a name is invalid, a function cannot be written as C, or a system has events,
            which steps of a fixed length cannot locate.
    """
    place = path_of(options.folder)
    library = _library(place, options)
    entries, systems = _entries(options.functions, str(place), library)
    steps = {
        name: step_texts(system, name, library.name, library.real, _MARK)
        for name, system in systems.items()
    }
    files = {
        f"{library.name}.h": _header(entries, steps, library),
        "example.c": _example(entries, steps, library),
        "CMakeLists.txt": _cmake(library, [f"{name}_step.c" for name in steps]),
        **{f"{name}_step.c": step.source for name, step in steps.items()},
    }
    if f"{library.name}.c" in files:
        raise ModelError(
            f"{place}: its code and the motion of {library.name[:-5]} would both be"
            f" {library.name}.c; choose another folder"
        )
    files[f"{library.name}.c"] = _source(entries, library, str(place))
    for file in files:
        _check_ours(place / file)
    write_texts(files, place)
    return place


@dataclass(frozen=True, slots=True)
class _Library(CLibraryOptions):
    """Options of a C library with the name of its files.

    Attributes:
        name: name of the files without suffix, and of the CMake target.
    """

    name: str

    @property
    def bare(self) -> bool:
        """Whether the code is for systems without an operating system."""
        return self.target == "bare"

    @property
    def type(self) -> str:
        """Name of the number type in the header."""
        return f"{self.name}_real" if self.bare else "double"


def _library(place: Path, options: CLibraryOptions) -> _Library:
    """Return the options of a library; raise an ExportError if they are invalid."""
    for sentence in faults(options):
        raise ExportError(f"{place}: {sentence}")
    if options.real == "float" and options.target != "bare":
        raise ExportError(f"{place}: real='float' is for bare libraries; add target='bare'")
    name = library_name(place.resolve().name)
    return _Library(name, **group_values(options, CLibraryOptions))


@dataclass(frozen=True, slots=True)
class _Entry:
    """Function of the library.

    Attributes:
        name: name in C.
        model: function as given by the user.
        code: the same function under this name with dense inputs and outputs. If the inputs have
            conditions, its last output is 1 for each condition that holds, else 0.
        statuses: status codes of violated conditions.
        inputs: names of the input parameters in C.
        outputs: names of the output parameters in C.
    """

    name: str
    model: Function
    code: Function
    statuses: tuple[str, ...]
    inputs: list[str]
    outputs: list[str]


def _entries(
    functions: Functions, where: str, library: _Library
) -> tuple[list[_Entry], dict[str, System]]:
    """Return the functions of the library and the systems to simulate, by their names in C.

    Raise a ModelError if a name is invalid or a model cannot be written.
    """
    pairs = _pairs(functions)
    if not pairs:
        raise ModelError(f"{where}: there is no function to write; give at least one")
    names = [name for name, _ in pairs]
    for name in names:
        if not isinstance(name, str):
            raise ModelError(f"{where}: the name {quoted(name)} is not a text; give one")
        if names.count(name) > 1:
            raise ModelError(
                f"{where}: two functions are named {name!r}; name them by a dict, as in"
                f" {{'{name}_left': left, '{name}_right': right}}"
            )
    check_function_names(names, where)
    _check_handwritten([(n, m) for n, m in pairs if isinstance(m, Function)], where, library)
    if library.bare and library.type in names:
        raise ModelError(
            f"{where}: {library.type} is the type of numbers; give the function another name, as in"
            f" {{'my_{library.type}': function}}"
        )
    systems = {name: model for name, model in pairs if isinstance(model, System)}
    if systems and not library.bare:
        raise ModelError(
            f"{where}: {next(iter(systems))} is a System, whose motion bare libraries have; add"
            " target='bare', or give models of it, such as mbs.models.direct_dynamics(system)"
        )
    entries = [
        _entry(name, model, library) for name, model in pairs if not isinstance(model, System)
    ]
    return entries, systems


def _check_handwritten(
    functions: Sequence[tuple[str, Function]], where: str, library: _Library
) -> None:
    """Raise a ModelError if handwritten C code of models does not fit to the library.

    This is so for single precision, and for names that conflict with names in that code.
    """
    text = handwritten_text([function for _, function in functions])
    if text and library.real == "float":
        raise ModelError(
            f"{where}: the general inverse geometric model refines its configurations to 1e-12,"
            " which single precision does not have; leave real='float' out"
        )
    taken = names_declared(text)
    for name, _ in functions:
        if name in taken:
            raise ModelError(
                f"{where}: {name!r} is a name of C beside the general inverse geometric model; give"
                f" another one, as in {{'my_{name}': function}}"
            )


def _pairs(functions: Any) -> list[tuple[str, Model]]:
    """Return pairs of name in C and model; raise a ModelError for other objects."""
    if isinstance(functions, Mapping):
        for function in functions.values():
            _require_model(function)
        return list(functions.items())
    single = isinstance(functions, (str, Function)) or not isinstance(functions, Iterable)
    given: list[Any] = [functions] if single else list(functions)
    for function in given:
        _require_model(function)
    return [(_name(function), function) for function in given]


def _require_model(model: object) -> None:
    """Raise a ModelError if a model is neither a System nor a Function with named arguments."""
    if not isinstance(model, System):
        require_function(model)
        require_names(cast("Function", model))


def _name(model: Model) -> str:
    """Return the name of a model in C; invalid characters in the name of a System become "_"."""
    if isinstance(model, Function):
        return model.name()
    text = re.sub(r"[^A-Za-z0-9]+", "_", model.name).lstrip("_")
    return text if text[:1].isalpha() else f"system_{text}"


def _entry(name: str, model: Function, library: _Library) -> _Entry:
    """Return a function of the library with its check and the names of its arguments in C."""
    taken = ["w", "k", "arg", "res", "iw", "mem", name, f"{name}_eval", f"{name.upper()}_SZ_W"]
    taken += ["status", "wrong", "holds", "answer", "failed", library.type]
    inputs = parameter_names(model.name_in(), taken)
    desired = [f"{out}_out" if out in model.name_in() else out for out in model.name_out()]
    outputs = parameter_names(desired, [*taken, *inputs])
    check = check_of(model, library.real) if library.checked else None
    statuses = check.statuses if check else ()
    return _Entry(name, model, _code(name, model, check), statuses, inputs, outputs)


def _code(name: str, model: Function, check: StatusCheck | None) -> Function:
    """Return a model under a name, with dense inputs and outputs and the check as last output.

    Common subexpressions of both, such as sines and cosines of joint angles, are computed once.
    """
    patterns = [model.sparsity_in(k) for k in range(model.n_in())]
    patterns += [model.sparsity_out(k) for k in range(model.n_out())]
    if check is None and name == model.name() and all(pattern.is_dense() for pattern in patterns):
        return model
    scalar = model.is_a("SXFunction")
    kind: Any = SX if scalar else MX
    symbols = [kind.sym(f"x{k}", *model.size_in(k)) for k in range(model.n_in())]
    outputs = [casadi.densify(value) for value in Function.call(model, symbols)]
    if check is not None:
        outputs += check.function.call(symbols)
    return Function(name, symbols, outputs, {"cse": scalar})


def _check_ours(file: Path) -> None:
    """Raise an ExportError if a file exists that mbs did not write."""
    try:
        with file.open(encoding="utf-8", errors="replace") as stream:
            first = stream.readline()
    except (FileNotFoundError, NotADirectoryError):
        return
    except OSError:
        first = ""
    if _MARK not in first:
        raise ExportError(
            f"{file} was not written by mbs and is left alone; move it or choose another folder"
        )


def _source(entries: Sequence[_Entry], library: _Library, where: str) -> str:
    """Return the text of NAME.c.

    Functions of scalar operations are static, so that compilers inline them. CasADi writes other
    functions. Raise a ModelError if it cannot write a function as C.
    """
    scalar = [entry.code for entry in entries if _is_scalar(entry, library)]
    others = [entry.code for entry in entries if not _is_scalar(entry, library)]
    parts = [f'/* {_MARK}. */\n#include "{library.name}.h"\n']
    parts.append("#include <float.h>\n#include <math.h>\n#include <string.h>\n")
    if scalar:
        parts += [NOINLINE, bare_source(scalar, library.real)[0]]
    if others:  # the helper functions of CasADi have external linkage, so they need a prefix
        parts.append(generated(others, library.name, with_header=False, casadi_int="long long int"))
        if problem := unwritten(parts[-1]):
            raise ModelError(f"{where}: {problem}")
    if library.checked and entries:
        size, largest = _LARGEST[library.real]
        parts.append(NO_FAST_MATH + _HELPERS.format(real=library.type, abs=size, largest=largest))
    return "\n".join([*parts, *(_wrapper(entry, library) for entry in entries)])


def _is_scalar(entry: _Entry, library: _Library) -> bool:
    """Whether mbs writes the code as scalar operations; CasADi writes calls and maps."""
    return entry.code.is_a("SXFunction") or (library.bare and not handwritten_text([entry.code]))


def _parameters(entry: _Entry, real: str) -> str:
    """Return the C parameters of a function: inputs, then outputs, as pointers to `real`."""
    inputs = [f"const {real} *{name}" for name in entry.inputs]
    outputs = [f"{real} *{name}" for name in entry.outputs]
    return ", ".join([*inputs, *outputs])


def _wrapper(entry: _Entry, library: _Library) -> str:
    """Return the C text of NAME_eval, which calls the generated code and checks its arguments."""
    lines = [f"  arg[{k}] = {name};" for k, name in enumerate(entry.inputs)]
    lines += [f"  res[{k}] = {name};" for k, name in enumerate(entry.outputs)]
    words = {"real": library.type, "count": len(entry.statuses)}
    declared = _HOLDS.format(statuses=", ".join(entry.statuses), **words) if entry.statuses else ""
    if entry.statuses:
        lines.append(f"  res[{len(entry.outputs)}] = holds;")
    call = _CALL.format(name=entry.name)
    return _WRAPPER.format(
        name=entry.name,
        real=library.type,
        parameters=_parameters(entry, library.type),
        sz_arg=max(1, entry.code.sz_arg()),
        sz_res=max(1, entry.code.sz_res()),
        sz_iw=max(1, entry.code.sz_iw()),
        declared=declared,
        assignments="\n".join(lines),
        body=_checking_body(entry, library, call) if library.checked else f"  {call}\n",
    )


def _checking_body(entry: _Entry, library: _Library, call: str) -> str:
    """Return the C statements that call a function and set its status."""
    model = entry.model
    inputs = [(name, model.numel_in(k)) for k, name in enumerate(entry.inputs)]
    outputs = [(name, model.numel_out(k)) for k, name in enumerate(entry.outputs)]
    empty: tuple[str, ...] = getattr(model, "may_be_nan", ())
    full = [pair for k, pair in enumerate(outputs) if model.name_out(k) not in empty]
    count, half = len(entry.statuses), literal(0.5, library.real)
    return _CHECKED.format(
        finite=_all_finite(inputs, library.real),
        call=call,
        rows=_ROWS.format(count=count, zero=half) if count else "",
        numbers=_all_finite(full, library.real),
        erase="".join(f"    mbs__erase({name}, {n});\n" for name, n in outputs if n),
    )


def _all_finite(arrays: Iterable[tuple[str, int]], real: Real) -> str:
    """Return a C condition that all values are finite: one sum for few values, else a loop.

    `arrays` are pairs of name and number of elements.
    """
    given = [(name, n) for name, n in arrays if n]
    one_by_one = " && ".join(f"mbs__finite({name}, {n})" for name, n in given) or "1"
    if not 0 < sum(n for _, n in given) <= _FEW:
        return one_by_one
    sums = (" + ".join(f"{name}[{k}]" for k in range(n)) for name, n in given)
    total = " +\n        ".join(f"({text})" for text in sums)  # sums run in parallel
    size, largest = _LARGEST[real]
    return f"{size}({total}) <= {largest} ||\n        ({one_by_one})"


def _header(entries: Sequence[_Entry], steps: Mapping[str, StepTexts], library: _Library) -> str:
    """Return the text of NAME.h with the prototypes of functions and simulations (`steps`)."""
    guard = f"MBS_{library.name.upper()}_H"
    texts = [STATUS]
    if library.bare:
        texts.append(f"/** The type of numbers. */\ntypedef {library.real} {library.name}_real;\n")
    texts += [_prototype(entry, library) for entry in entries]
    texts += [step.header for step in steps.values()]
    return (
        f"/* {_MARK}. SI units, radians. */\n#ifndef {guard}\n#define {guard}\n\n"
        '#ifdef __cplusplus\nextern "C" {\n#endif\n\n'
        + "\n".join(texts)
        + "\n#ifdef __cplusplus\n}\n#endif\n\n#endif\n"
    )


def _prototype(entry: _Entry, library: _Library) -> str:
    """Return the documented C prototype of a function."""
    model = entry.model
    lines = [
        f" *  @param[in]  {name}  ({model.size1_in(k)}, {model.size2_in(k)})"
        f"{_elements(model, model.name_in(k))}\n"
        for k, name in enumerate(entry.inputs)
    ]
    lines += [
        f" *  @param[out] {name}  ({model.size1_out(k)}, {model.size2_out(k)})"
        f"{_elements(model, model.name_out(k))}\n"
        for k, name in enumerate(entry.outputs)
    ]
    inside, outside = ", ".join(model.name_in()), ", ".join(model.name_out())
    return _PROTOTYPE.format(
        signature=in_c_comment(f"{entry.name}({inside}) -> {outside}"),
        arguments="".join(lines),
        name=entry.name,
        real=library.type,
        upper=entry.name.upper(),
        parameters=_parameters(entry, library.type),
        returns=_returns(entry, library),
        sz_w=_scratch(entry, library),
    )


def _returns(entry: _Entry, library: _Library) -> str:
    """Return the text of the possible status codes of a call."""
    if not library.checked:
        return "MBS_OK: nothing is checked"
    every = ["MBS_OK", "MBS_NOT_FINITE", *dict.fromkeys(entry.statuses)]
    return ", ".join(every) + " or MBS_NO_RESULT"


def _scratch(entry: _Entry, library: _Library) -> int:
    """Return the number of elements of the work array w of a function."""
    if _is_scalar(entry, library):
        return bare_source([entry.code], library.real)[1]
    return max(1, entry.code.sz_w())


def _elements(model: Function, name: str) -> str:
    """Return the text of names and units of the elements of an argument, empty if unknown."""
    known = model.elements(name) if isinstance(model, ModelFunction) else []
    return ": " + ", ".join(in_c_comment(f"{e} [{unit}]") for e, unit in known) if known else ""


def _example(entries: Sequence[_Entry], steps: Mapping[str, StepTexts], library: _Library) -> str:
    """Return the text of example.c, which calls all functions and simulations (`steps`)."""
    head = (
        f"/* {_MARK}. */\n#include <stdio.h>\n"
        f'#include "{library.name}.h"\n\nint main(void) {{\n  int failed = 0;\n'
    )
    calls = (_example_call(entry, library) for entry in entries)
    motions = (step.example for step in steps.values())
    return "".join([head, *calls, *motions, "  return failed;\n}\n"])


def _example_call(entry: _Entry, library: _Library) -> str:
    """Return a C block that calls a model and prints its outputs with all digits, or its status."""
    model, real = entry.model, library.type
    lines = ["  {\n"]
    for k, name in enumerate(entry.inputs):
        numbers = (float(x) for x in example_input(model, k).ravel(order="F"))
        values = ", ".join(literal(x, library.real) for x in numbers)
        lines.append(f"    const {real} {name}[] = {{{values or '0'}}};\n")
    for k, name in enumerate(entry.outputs):
        lines.append(f"    {real} {name}[{max(1, model.numel_out(k))}];\n")
    lines.append(f"    static {real} w[{entry.name.upper()}_SZ_W];\n")
    arguments = ", ".join([*entry.inputs, *entry.outputs, "w"])
    lines.append(f"    int status = {entry.name}_eval({arguments});\n")
    lines.append(f'    if (status) printf("{entry.name} status %d\\n", status);\n')
    lines.append("    failed |= status;\n")
    for k, name in enumerate(entry.outputs):
        lines.append(f'    printf("{entry.name} {model.name_out(k)}");\n')
        lines.append(
            f"    for (int k = 0; k < {model.numel_out(k)}; ++k)"
            f' printf(" %.17g", (double){name}[k]);\n    printf("\\n");\n'
        )
    return "".join([*lines, "  }\n"])


def example_input(model: Function, k: int) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    """Return the values of an input in the example program, which are irregular.

    Parameters have their default values. For mechanisms with loops, quaternions or parameters,
    positions come from the assembled configuration.

    Args:
        model: Function of the library.
        k: index of the input.

    Returns:
        Values (rows, columns).
    """
    rows, columns = model.size_in(k)
    numbers = np.arange(rows * columns, dtype=float)
    # irregular values from -0.2 up, different for every input and element
    values = (0.1 + 0.2 * k + 0.3 * np.sin(1.0 + numbers)).reshape(rows, columns, order="F")
    if not isinstance(model, ModelFunction):
        return values
    system, name = model.system, model.name_in(k)
    own: Any = model.example(name)
    if np.ndim(own) == 2:
        return np.array(own, dtype=float)
    if name != "p" and (system.is_closed or system.parameters or system.nq != system.nv):
        named = {c.name: x for c, x in zip(system.coordinates, system.configuration, strict=True)}
        if name in ("q", "q_a"):
            own = [named.get(element) for element, _ in model.elements(name)]
    if own is None or len(own) != rows or None in list(own):
        return values
    return np.repeat(np.array(own, dtype=float).reshape(-1, 1), columns, axis=1)


def _cmake(library: _Library, more: Sequence[str]) -> str:
    """Return the text of CMakeLists.txt; `more` are further C files."""
    name = library.name
    example = f"add_executable(example example.c)\ntarget_link_libraries(example {name})\n"
    if library.bare:
        example = f"if(NOT CMAKE_CROSSCOMPILING)\n{example}endif()\n"
    return (
        f"# {_MARK}.\ncmake_minimum_required(VERSION 3.10)\n"
        f"project({name} C)\n"
        "if(NOT CMAKE_BUILD_TYPE)\n  set(CMAKE_BUILD_TYPE Release)\nendif()\n"
        f"add_library({name} {' '.join([f'{name}.c', *more])})\n"
        f"target_include_directories({name} PUBLIC ${{CMAKE_CURRENT_SOURCE_DIR}})\n"
        f"if(UNIX)\n  target_link_libraries({name} PUBLIC m)\nendif()\n{example}"
    )
