"""Compile a Function to machine code that is bit-identical to the interpreter, or faster."""

import ctypes
import functools
import hashlib
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import casadi

from mbs.core import code_address, work_sizes
from mbs.errors import ModelError
from mbs.native.array_calls import with_array_calls
from mbs.native.compiler import cached_library, compiler_found, flags_for
from mbs.native.derivatives_on_demand import (
    Derivative,
    by_parameters,
    derivatives_of,
    fill,
    read_record,
    source,
    write_record,
)
from mbs.native.handwritten import handwritten_text, is_handwritten
from mbs.native.kernel import LoopCode, index_key, indexed_library, kernel_library
from mbs.native.patterns import pattern_source, patterns_source
from mbs.native.scalar_source import external_source, is_scalar
from mbs.text import in_c_comment, quoted


def compiled(
    function: casadi.Function, *, derivatives: int = 1, fast: bool = False, loops: bool = True
) -> casadi.Function:
    """Compile a Function to a shared library, which is cached on disk.

    A call whose arguments are arrays, lists or numbers takes about a microsecond and returns numpy
    arrays; an output with one column is returned as a vector. Arrays may have any numeric type and
    memory layout; doubles in Fortran order are not copied. `out=` passes arrays for the outputs. A
    call with symbols, a DM or several columns is evaluated as by the given Function.

    Without `fast` the values are bit-identical to the interpreted Function. The loops over links
    differ from it by rounding, so only `fast=True` uses them. It pays most for derivatives of open
    trees: those of a chain of 30 joints take half the time, their Jacobian a twentieth of the time
    to compile. docs/speed.md gives the number of joints beyond which loops are faster.

    The Function stays interpreted, with the same values, if there is no compiler, if it contains a
    node that cannot be written as C, or if it calls an external function.

    C code that CasADi generates for a Function that calls the result does not contain this code.
    It must be linked with `link_flags`; otherwise the process that loads it ends. To generate C
    code for other computers, use Functions that call the given Function instead.

    Args:
        function: any Function without free symbols.
        derivatives: number of times that the result can be differentiated: 0, 1 (Jacobians,
            forward and reverse products) or 2 (also Hessians, about five times the code), which
            IPOPT needs unless it approximates Hessians. Derivative code is compiled at its first
            use, in any process, and cached. For higher orders CasADi raises "Derivatives cannot be
            calculated for adj1_..", followed by the name of the Function.
        fast: whether to generate code for the processor of this computer, with fused
            multiply-add and vectorised sines and cosines. It is two to three times faster and
            differs from the interpreter by about 1e-15 of the largest element. A map
            (`Function.map`) is computed for several columns at once.
        loops: whether `fast` code of models of large open trees, and of their Jacobians, may
            loop over the links if that is faster (`mbs.models.tree_core`). False: the equations
            are always written out.

    Returns:
        a Function with the same name, inputs, outputs and default inputs. Models keep their
        checks and parameter defaults.

    Raises:
        ModelError: the argument is no Function or has free symbols, or `derivatives` is not 0, 1
            or 2.
        CompilerError: CC names no compiler, or the compiler rejects the code.
    """
    require_function(function)
    _check_order(derivatives)
    like: Any = getattr(function, "like", None)
    library = None
    if compiler_found():
        offer: Any = getattr(function, "loops", None) if fast and loops else None
        looped: LoopCode | None = None if offer is None else offer.code(function, derivatives)
        if looped is not None and looped.value:
            library = _looped_library(function, derivatives, looped)
        library = library or _library(function, derivatives, fast, looped)
    if library is None:
        result: Any = with_array_calls(casadi.Function(function), None, like)
    else:
        code = casadi.external(function.name(), str(library))
        _libraries.setdefault(function.name(), set()).add(library)
        plain = functools.partial(compiled, derivatives=0)
        result = with_array_calls(code, library, like, plain)
    again = functools.partial(compiled, derivatives=derivatives, fast=fast, loops=loops)
    result._source = (again, (function,))
    result._library = library
    return result  # type: ignore[no-any-return]


def _library(
    function: casadi.Function, derivatives: int, fast: bool, loops: LoopCode | None
) -> Path | None:
    """Return the cached library of a Function and its derivatives; None if C cannot express it.

    Args:
        function: Function that is written as straight-line code.
        derivatives: number of times that the result can be differentiated.
        fast: True for vectorised code with fused multiply-add, False for bit-identical code.
        loops: code that loops over the links for its Jacobian; None for straight-line code.
    """
    if calls_machine_code([function]):
        return None
    options = f"{'fast' if fast else 'exact'}, {derivatives} derivatives{_digest(loops)}"
    found = index_key(function, options)
    if found is None:
        return _built(function, derivatives, fast)
    key, text = found
    every = derivatives_of(function.name(), derivatives) if derivatives else []
    if loops is not None and loops.by_parameters:
        every.append(by_parameters(function.name()))
    record = write_record(key, text, every, fast, loops) if derivatives else None
    if derivatives and record is None:  # the cache is not writable: compile all derivatives now
        return _built(function, derivatives, fast)
    later = {} if record is None else {"derivatives.c": source(every, record)}
    return indexed_library(key, lambda: _compiled([function], fast, later))


def _looped_library(function: casadi.Function, derivatives: int, code: LoopCode) -> Path | None:
    """Return the library of a model whose C code loops over its links.

    Derivatives without a loop version are straight-line code that is compiled at its first use.
    None if the cache is not writable.

    `code` generates the C code; `derivatives` is the highest order of the derivatives.
    """
    name = function.name()
    every = derivatives_of(name, derivatives) if derivatives else []
    if code.jacobian:
        of_lines = {f"jac_{name}"}
        if derivatives == 1:  # CasADi forms directional derivatives from the Jacobian
            of_lines |= {f"fwd1_{name}", f"adj1_{name}"}
        every = [part for part in every if part.name not in of_lines]
        every += [by_parameters(name)] if code.by_parameters else []
    if not every:
        return code.library({})
    found = index_key(function, f"loops, {derivatives} derivatives{_digest(code)}")
    record = None if found is None else write_record(*found, every, fast=True)
    if record is None:
        return None
    return code.library({"derivatives.c": source(every, record)})


def _digest(code: LoopCode | None) -> str:
    """Return a hash of loop code as part of the cache key; empty for straight-line code."""
    if code is None:
        return ""
    return f", {hashlib.sha256(repr(sorted(code.files.items())).encode()).hexdigest()}"


def _built(function: casadi.Function, derivatives: int, fast: bool) -> Path | None:
    """Return the library of a Function with all its derivatives, which are compiled immediately.

    None if C cannot express them.

    `derivatives` is the highest order, 0 to 2; `fast` permits changes of rounding.
    """
    every = [function, *_all_derivatives(function, derivatives)]
    known = _products(function) if derivatives == 2 else []
    return _compiled(every, fast, {"patterns.c": patterns_source(known)} if known else {})


def _compiled(
    functions: Sequence[casadi.Function],
    fast: bool,
    further: Mapping[str, str],
) -> Path | None:
    """Compile Functions into a library; None if C cannot express them.

    Args:
        functions: Functions to compile.
        fast: whether to generate fast code, if all Functions permit it.
        further: additional C files of the library: file name to text.
    """
    library = kernel_library(functions, further) if fast else None
    if library is not None:
        return library
    text = exact_source(functions)
    if unwritten(text):
        return None
    return cached_library({"function.c": text, **further}, flags_for(text))


def exact_source(functions: Iterable[casadi.Function]) -> str:
    """Return C code whose values are bit-identical to the interpreted Functions.

    The text defines the functions that CasADi's `external` looks up. This package writes Functions
    of scalar operations, in several C functions if they are long. CasADi writes the others, such
    as Functions with linear solvers, maps and calls; see `unwritten`.

    Args:
        functions: Functions with different names.

    Raises:
        ModelError: the name of an input or output would end a C comment or string, or a Function
            calls a compiled Function of this process.
    """
    every = list(functions)
    scalar = [function for function in every if is_scalar(function)]
    others = [function for function in every if not is_scalar(function)]
    for function in scalar:
        require_names(function)
    texts = [external_source(scalar)] if scalar else []
    return "\n".join([*texts, *([generated(others)] if others else [])])


class MachineCode(NamedTuple):
    """Fast code of a Function in memory, in CasADi's calling convention.

    Attributes:
        library: loaded library. The addresses are valid while it is referenced.
        evaluate, checkout, release: addresses of the C functions; 0 if a function does not exist.
        work: sizes of the work arrays: argument pointers, result pointers, integers, doubles.
    """

    library: ctypes.CDLL
    evaluate: int
    checkout: int
    release: int
    work: tuple[int, int, int, int]


def machine_code(function: casadi.Function) -> MachineCode | None:
    """Return the fast code of a Function for use by other C code; None if there is none.

    Args:
        function: any Function without free symbols.

    Raises:
        ModelError: the argument is no Function or has free symbols.
        CompilerError: CC names no compiler, or the compiler rejects the code.
    """
    require_function(function)
    path = _library(function, 0, True, None) if compiler_found() else None
    if path is None:
        return None
    name, library = function.name(), ctypes.CDLL(str(path))
    if hasattr(library, f"{name}_incref"):
        library[f"{name}_incref"]()
    ends = ("", "_checkout", "_release")
    evaluate, checkout, release = (code_address(library, f"{name}{end}") for end in ends)
    arguments, results, integers, reals = work_sizes(library, name)
    return MachineCode(library, evaluate, checkout, release, (arguments, results, integers, reals))


def fetch_derivatives(record: str, number: int, table: int) -> None:
    """Compile a derivative of a compiled Function; the library calls this at the first use.

    Args:
        record: path of the file that contains the serialised Function.
        number: index of the derivative.
        table: address of the table that receives the addresses of the derivative code.

    Raises:
        CompilerError: the file was deleted, or the compiler rejects the code.
        ModelError: the derivative cannot be written as C.
    """
    given, every, fast, loops = read_record(Path(record))
    part = every[number]
    function = given(part)
    if loops is not None and part.name == f"jac_{function.name()}":
        own = [by_parameters(function.name())] if loops.by_parameters else []
        later = {"derivatives.c": source(every, Path(record), own)} if own else {}
        return fill(table, loops.library(later), every, number)

    def make() -> Path | None:
        if not part.pattern:
            return _compiled([part.of(function)], fast, {})
        inner = Derivative(part.name.removeprefix("jac_")).of(function)
        # the exact pattern of a compiled Jacobian; second derivatives are not compiled for it
        known = inner is function
        text = pattern_source(inner.jacobian()) if known else patterns_source([inner])
        return cached_library({"patterns.c": text})

    options = f"{'fast' if fast else 'exact'}, {part}"
    found = index_key(function, options)
    library = make() if found is None else indexed_library(found[0], make)
    if library is None:
        raise ModelError(
            f"{part.name} holds what CasADi cannot write as C; differentiate {function.name()}"
            " itself in place of its machine code"
        )
    fill(table, library, every, number)


def c_source(function: casadi.Function, *, derivatives: int = 0) -> str:
    """Return C code of a Function, with the derivatives that CasADi's `external` looks up.

    Args:
        function: any Function without free symbols.
        derivatives: 0 for the value only. 1 adds `jac_`, `fwd1_` and `adj1_` of the Function. 2
            also adds `fwd1_` and `adj1_` of the latter two, from which CasADi forms Hessians
            direction by direction.

    Returns:
        text of a C file.

    Raises:
        ModelError: the argument is no Function or has free symbols.
    """
    require_function(function)
    _check_order(derivatives)
    return exact_source([function, *_all_derivatives(function, derivatives)])


def generated(functions: Iterable[casadi.Function], name: str = "generated", **options: Any) -> str:
    """Return C code by CasADi of Functions, and of all Functions that they call.

    The text may contain `#error` lines; see `unwritten`.

    Args:
        functions: Functions to write. Their names are different.
        name: prefix of the names of functions that CasADi adds.
        options: options of `casadi.CodeGenerator`.

    Raises:
        ModelError: the name of an input or output would end a C comment or string, or a Function
            calls machine code.
    """
    generator, every = casadi.CodeGenerator(name, options), list(functions)
    for function in every:
        require_names(function)
        _require_equations(function)
        generator.add(function)
    return handwritten_text(every) + str(generator.dump())


def require_names(function: casadi.Function) -> None:
    """Raise if the name of an input or output cannot be part of C comments and strings.

    Args:
        function: Function to check, with all Functions that it calls.

    Raises:
        ModelError: the message gives the Function and the name.
    """
    for part in (function, *function.find_functions()):
        for name in (*part.name_in(), *part.name_out()):
            if name != in_c_comment(name) or '"' in name:
                raise ModelError(
                    f"{part.name()}: the name {quoted(name)} cannot be written as C; call inputs"
                    " and outputs by letters, digits and underscores"
                )


def calls_machine_code(functions: Iterable[casadi.Function]) -> bool:
    """Whether a Function calls an external function, which its C code cannot contain.

    Handwritten functions of this package do not count; see `mbs.native.handwritten`.

    Args:
        functions: any Functions.
    """
    return any(_machine_code_in(function) for function in functions)


def _machine_code_in(function: casadi.Function) -> list[str]:
    """Return names of the external functions that a Function calls, without handwritten ones."""
    return [
        part.name()
        for part in function.find_functions()
        if part.is_a("External") and not is_handwritten(part)
    ]


_libraries: dict[str, set[Path]] = {}
"""Libraries of the Functions that `compiled` returned in this process, by name of the Function.
Other external functions are linked by the user."""
_DERIVED = re.compile(r"^((jac|fwd\d+|adj\d+)_)*")
"""Prefixes of the names of derivatives."""


def _require_equations(function: casadi.Function) -> None:
    """Raise ModelError if a Function calls a compiled Function.

    C code would refer to symbols of a library that is not loaded, which ends the process.
    """
    names = [name for name in _machine_code_in(function) if _base(name) in _libraries]
    if names:
        raise ModelError(
            f"{function.name()}: it calls {', '.join(names)}, which is machine code of this"
            " process, so that it cannot be written as C; make it from the Function that was given"
            " to mbs.native.compiled, or use CasADi's generate and mbs.native.link_flags"
        )


def _base(name: str) -> str:
    """Return the name of the Function in the name of its derivative, such as idm in adj1_idm."""
    return _DERIVED.sub("", name)


def link_flags(*functions: casadi.Function) -> list[str]:
    """Return the flags that link C code from CasADi's `generate` with compiled Functions.

    The library of the C code works on this computer only. Options of CasADi that compile a
    Function are `{"jit": True, "compiler": "shell", "jit_options": {"linker_flags": flags}}`.

    Args:
        *functions: Functions that call compiled Functions, and compiled Functions themselves.

    Returns:
        paths of libraries, for the call of the compiler that links. Empty if nothing is compiled.

    Raises:
        ModelError: the argument is no Function, or two compiled Functions have the same name.
    """
    own: dict[str, set[Path]] = {}
    called: list[str] = []
    for function in functions:
        if not isinstance(function, casadi.Function):
            raise ModelError(f"link_flags: {quoted(function)} is no Function; give Functions")
        called += [_base(name) for name in _machine_code_in(function)]
        library = getattr(function, "_library", None)
        if library is not None:
            called.append(function.name())
            own.setdefault(function.name(), set()).add(library)
    found = dict[str, None]()
    for name in dict.fromkeys(called):
        libraries = own.get(name) or _libraries.get(name, set())
        if len(libraries) > 1:
            raise ModelError(
                f"link_flags: there are {len(libraries)} compiled Functions with the name {name};"
                " give the one that is called too, or compile Functions with different names"
            )
        found |= dict.fromkeys(map(str, libraries))
    return list(found)


def unwritten(source: str) -> str:
    """Return the reason, as end of an error message, if CasADi could not write C code; else empty.

    Args:
        source: C text from `generated` or `exact_source`.
    """
    if "#error" not in source:
        return ""
    reason = source[source.index("#error") + 6 :].splitlines()[0].strip()
    return (
        f"CasADi cannot write it as C ({reason}); replace integrators and rootfinders by Newton"
        " steps"
    )


def require_function(function: object) -> None:
    """Raise if an object is not a Function with equations and without free symbols.

    Args:
        function: any object.

    Raises:
        ModelError: the message gives the expected argument.
    """
    if not isinstance(function, casadi.Function) or function.is_null():
        what = "an empty Function" if isinstance(function, casadi.Function) else quoted(function)
        raise ModelError(
            f"{what} is not a Function; give a casadi.Function, such as"
            " mbs.models.inverse_dynamics(system)"
        )
    if function.has_free():
        free = ", ".join(str(symbol) for symbol in function.get_free())
        raise ModelError(f"{function.name()}: symbols {free} are free; make them inputs")
    if function.is_a("External"):
        raise ModelError(
            f"{function.name()} is machine code already; give the Function that it was made of"
        )


def _check_order(derivatives: object) -> None:
    """Raise ModelError unless the number of `derivatives` is 0, 1 or 2."""
    if derivatives not in (0, 1, 2):
        raise ModelError(f"derivatives is {quoted(derivatives)}; use 0, 1 or 2")


def _all_derivatives(function: casadi.Function, order: int) -> list[casadi.Function]:
    """Return the Functions of the derivatives of a Function up to this order, 0 to 2."""
    if order == 0:
        return []
    products = _products(function)
    second = [d for product in products for d in _products(product)] if order == 2 else []
    return [function.jacobian(), *products, *second]


def _products(function: casadi.Function) -> list[casadi.Function]:
    """Return the directional derivatives of a Function, [forward(1), reverse(1)] of CasADi."""
    return [function.forward(1), function.reverse(1)]
