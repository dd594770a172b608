"""A Function as machine code: equal to the interpreted one to the last bit, or faster."""

import contextlib
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
from mbs.native.repeats import LEAST
from mbs.native.scalar_source import external_source
from mbs.text import in_c_comment, quoted


def compiled(
    function: casadi.Function, *, derivatives: int = 1, fast: bool = False, loops: bool = True
) -> casadi.Function:
    """The same Function backed by a cached shared library.

    A call whose arguments are arrays, lists or numbers returns numpy arrays, what has one column
    as a vector, in about a microsecond, whatever the arrays hold and however they lie in memory;
    doubles whose columns follow each other are not even copied. `out=` takes arrays for the
    outputs. A call with symbols, a DM or several columns is as before.

    Without a compiler, or when the Function holds a node that CasADi cannot write as C or calls
    an external function, the given Function stays interpreted: the answers are the same, only
    slower.

    CasADi's own C text of a Function that calls the result lacks this code, and ends the process
    that loads it unless it is linked with `link_flags`. For other computers, generate C of
    Functions that call the given Function instead.

    Args:
        function: any Function without free symbols.
        derivatives: how often the answer can be differentiated: 0, 1 (Jacobians, forward and
            reverse products) or 2 (Hessians too, for about five times the code), which IPOPT
            needs unless it approximates them. Their code is made when they are first asked for,
            in whatever process, and kept. Beyond it CasADi refuses to differentiate:
            "Derivatives cannot be calculated for adj1_..", the name of the Function after it.
        fast: code for the processor of this computer, with fused multiplications and all sines
            and cosines in vector lanes: two to three times faster, equal to the interpreted
            Function to about 1e-15 of the largest element instead of the last bit. A map
            (`Function.map`) is computed for several columns at once.
        loops: of `fast` code, whether models of big open trees, and their Jacobians, may be
            computed by loops over the links where that is faster (`mbs.models.tree_core`); False
            for equations written out in any case.

    Returns:
        a Function with the same name, inputs, outputs and default inputs; of a model, with its
        checks and its parameter defaults too.

    Raises:
        ModelError: it is no Function, it has free symbols, or `derivatives` is not 0, 1 or 2.
        CompilerError: CC names no compiler, or the compiler refused the code.
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
    """The library of a Function and its derivatives; None when they cannot be written as C.

    Args:
        function: is written as straight lines.
        derivatives: how often it can be differentiated.
        fast: of which kind the code is.
        loops: what its Jacobian is made of; None for straight lines.
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
    if derivatives and record is None:  # nothing can be kept on disk: all at once
        return _built(function, derivatives, fast)
    later = {} if record is None else {"derivatives.c": source(every, record)}
    return indexed_library(key, lambda: _compiled([function], fast, later))


def _looped_library(function: casadi.Function, derivatives: int, code: LoopCode) -> Path | None:
    """The library of a model that loops over its links; None where its record cannot be kept.

    Derivatives that the loops do not have are straight lines, made on demand.
    """
    name = function.name()
    every = derivatives_of(name, derivatives) if derivatives else []
    if code.jacobian:
        of_lines = {f"jac_{name}"}
        if derivatives == 1:  # CasADi makes products of the Jacobian
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
    """What distinguishes C text from other text of the same model, such as of another version."""
    if code is None:
        return ""
    return f", {hashlib.sha256(repr(sorted(code.files.items())).encode()).hexdigest()}"


def _built(function: casadi.Function, derivatives: int, fast: bool) -> Path | None:
    """The library of a Function and its derivatives, all of them made at once."""
    every = [function, *_all_derivatives(function, derivatives)]
    known = _products(function) if derivatives == 2 else []
    return _compiled(every, fast, {"patterns.c": patterns_source(known)} if known else {})


def _compiled(
    functions: Sequence[casadi.Function],
    fast: bool,
    further: Mapping[str, str],
) -> Path | None:
    """The library of Functions.

    Args:
        functions: what to compile.
        fast: code for this processor, where there is any.
        further: C files that belong to it.
    """
    library = kernel_library(functions, further) if fast else None
    if library is not None:
        return library
    text = _exact(functions)
    if unwritten(text):
        return None
    return cached_library({"function.c": text, **further}, flags_for(text))


def _exact(functions: Sequence[casadi.Function]) -> str:
    """C text that gives the bits of the interpreted Functions.

    CasADi's own is one C function, for which compilers take more than proportional time.
    """
    scalar = all(function.is_a("SXFunction") for function in functions)
    if scalar and any(function.n_instructions() >= LEAST for function in functions):
        with contextlib.suppress(ModelError):
            return external_source(functions)
    return generated(functions)


class MachineCode(NamedTuple):
    """Where C finds the fast code of a Function, in CasADi's calling convention.

    Attributes:
        library: that holds it; as long as it lives the addresses hold.
        evaluate, checkout, release: addresses, 0 for what it does without.
        work: pointers to arguments and results, integers and doubles that it works with.
    """

    library: ctypes.CDLL
    evaluate: int
    checkout: int
    release: int
    work: tuple[int, int, int, int]


def machine_code(function: casadi.Function) -> MachineCode | None:
    """The fast code of a Function for other C code to call; None where there is none.

    Args:
        function: any Function without free symbols.

    Raises:
        ModelError: it is no Function, or it has free symbols.
        CompilerError: CC names no compiler, or the compiler refused the code.
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
    """Make a derivative of a compiled Function; called by its library when it is asked for it.

    Args:
        record: path of the file that holds the Function.
        number: which of its derivatives.
        table: address of where the addresses of their code go.

    Raises:
        CompilerError: the file has gone, or the compiler refused the code.
        ModelError: it cannot be written as C.
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
        # of what is compiled, to the element; of second derivatives no code is compiled
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
    """C text of a Function, with the derivative functions that an external Function looks for.

    Args:
        function: any Function without free symbols.
        derivatives: 0; 1 to add `jac_`, `fwd1_` and `adj1_` of it; 2 to add `fwd1_` and `adj1_`
            of these two, from which CasADi makes Hessians, some directions at a time.

    Returns:
        one C file.

    Raises:
        ModelError: it is no Function, or it has free symbols.
    """
    require_function(function)
    _check_order(derivatives)
    return generated([function, *_all_derivatives(function, derivatives)])


def generated(functions: Iterable[casadi.Function], name: str = "generated", **options: Any) -> str:
    """C text of Functions with different names, and of all that they call; see `unwritten`.

    Args:
        functions: what to write.
        name: what the names of functions that CasADi adds begin with.
        options: of `casadi.CodeGenerator`.

    Raises:
        ModelError: an input or output is called by what would end a comment or a string of C, or
            a Function calls machine code.
    """
    generator, every = casadi.CodeGenerator(name, options), list(functions)
    for function in every:
        require_names(function)
        _require_equations(function)
        generator.add(function)
    return handwritten_text(every) + str(generator.dump())


def require_names(function: casadi.Function) -> None:
    """Refuse names of inputs and outputs that comments and strings of C cannot hold as they are.

    Raises:
        ModelError: says which.
    """
    for part in (function, *function.find_functions()):
        for name in (*part.name_in(), *part.name_out()):
            if name != in_c_comment(name) or '"' in name:
                raise ModelError(
                    f"{part.name()}: the name {quoted(name)} cannot be written as C; call inputs"
                    " and outputs by letters, digits and underscores"
                )


def calls_machine_code(functions: Iterable[casadi.Function]) -> bool:
    """Whether one of these calls an external function, which C text of it does not contain.

    Args:
        functions: any Functions.
    """
    return any(_machine_code_in(function) for function in functions)


def _machine_code_in(function: casadi.Function) -> list[str]:
    """Names of the external functions that a Function calls."""
    return [
        part.name()
        for part in function.find_functions()
        if part.is_a("External") and not is_handwritten(part)
    ]


_libraries: dict[str, set[Path]] = {}
"""Libraries of the Functions that `compiled` returned in this process, by name of the Function.
Users may link other external functions themselves."""
_DERIVED = re.compile(r"^((jac|fwd\d+|adj\d+)_)*")
"""Prefixes of the names of derivatives."""


def _require_equations(function: casadi.Function) -> None:
    """Raise ModelError if a Function calls one that `compiled` returned.

    C text would refer to symbols of a library that nothing loads, which ends the process.
    """
    names = [name for name in _machine_code_in(function) if _base(name) in _libraries]
    if names:
        raise ModelError(
            f"{function.name()}: it calls {', '.join(names)}, which is machine code of this"
            " process, so that it cannot be written as C; make it from the Function that was given"
            " to mbs.native.compiled, or use CasADi's generate and mbs.native.link_flags"
        )


def _base(name: str) -> str:
    """Name of the Function in the name of a derivative, such as idm in adj1_idm."""
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
    """What CasADi could not write of generated C, as the end of a message; empty when nothing."""
    if "#error" not in source:
        return ""
    reason = source[source.index("#error") + 6 :].splitlines()[0].strip()
    return (
        f"CasADi cannot write it as C ({reason}); replace integrators and rootfinders by Newton"
        " steps"
    )


def require_function(function: object) -> None:
    """Refuse what is not a Function of numbers, or has no equations to write.

    Raises:
        ModelError: says what to give.
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
    if derivatives not in (0, 1, 2):
        raise ModelError(f"derivatives is {quoted(derivatives)}; use 0, 1 or 2")


def _all_derivatives(function: casadi.Function, order: int) -> list[casadi.Function]:
    if order == 0:
        return []
    products = _products(function)
    second = [d for product in products for d in _products(product)] if order == 2 else []
    return [function.jacobian(), *products, *second]


def _products(function: casadi.Function) -> list[casadi.Function]:
    """The derivative along one direction, forward and reverse."""
    return [function.forward(1), function.reverse(1)]
