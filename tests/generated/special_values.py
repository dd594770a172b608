"""Functions and states at which numbers are not finite, and how texts of them are run."""

import ctypes
import subprocess

import casadi
import numpy as np
from casadi import SX, Function

import mbs
from mbs.native import compile_library

NUMBERS = (np.nan, np.inf, -np.inf, 0.0, -0.0, 0.5, -0.5, 1.0, -2.5, 3.0, 1e200, -1e-200)
"""What each input may be."""

_DOMAIN = (
    *(casadi.sqrt, casadi.log, casadi.asin, casadi.acos, casadi.acosh, casadi.atanh, casadi.log1p),
    *(lambda a: a**0.5, lambda a: a**1.5, lambda a: casadi.fmod(7, a)),
)
"""What is complex in Octave where CasADi has NaN; rem(1, inf), in Matlab 1, is NaN in Octave."""

_ONE = (
    *(casadi.sin, casadi.cos, casadi.tan, casadi.atan, casadi.sinh, casadi.cosh, casadi.tanh),
    *(casadi.asinh, casadi.exp, casadi.expm1, casadi.fabs, casadi.sign, casadi.floor, casadi.ceil),
    *(lambda a: a**2, lambda a: a**3, lambda a: a**-2, lambda a: 1 / a, lambda a: -a),
    *(lambda a: casadi.fmin(a, 1), lambda a: casadi.fmax(2, a), lambda a: casadi.fmod(a, 0.0)),
    *(lambda a: casadi.if_else(a, a + 1, 7), casadi.logic_not),
)
_TWO = (
    *(lambda a, b: a + b, lambda a, b: a - b, lambda a, b: a * b, lambda a, b: a / b),
    *(casadi.fmin, casadi.fmax, casadi.copysign, casadi.atan2, casadi.hypot),
    *(lambda a, b: a < b, lambda a, b: a <= b, lambda a, b: a == b, lambda a, b: a != b),
    *(casadi.logic_and, casadi.logic_or),
    *(lambda a, b: casadi.logic_not(a < b), lambda a, b: casadi.if_else(a <= b, a, 3)),
    lambda a, b: casadi.logic_and(casadi.logic_not(a < b), casadi.logic_or(a, b == 1)),
    lambda a, b: casadi.logic_or(casadi.logic_and(a < 1, a >= 1), casadi.logic_not(b <= a)),
    lambda a, b: casadi.if_else(casadi.logic_and(a < 1, a >= 1), b, a),
    lambda a, b: casadi.if_else(casadi.logic_or(a < 1, a >= 1), b, 2 * a),
)


def operations(everywhere):
    """Every operation alone, on the two inputs; with those that are others in Octave or without."""
    x = SX.sym("x", 2)
    ones = (*_ONE, *_DOMAIN) if everywhere else _ONE
    results = [f(x[k]) for f in ones for k in range(2)] + [f(x[0], x[1]) for f in _TWO]
    results += [casadi.fmod(x[0], x[1])] if everywhere else []
    return Function("operations", [x], [casadi.vertcat(*results)], ["x"], ["r"])


_MIXED = (
    *(casadi.sin, casadi.cos, casadi.atan, casadi.tanh, casadi.asinh, casadi.fabs, casadi.sign),
    *(lambda a: casadi.sqrt(casadi.fabs(a)), lambda a: 2 * a, lambda a: a * 0.25, lambda a: a - 1),
    *(lambda a: a**2, lambda a: 3 - a, casadi.logic_not),
)
_JOINED = tuple(f for k, f in enumerate(_TWO) if k not in (3, 6, 7))
"""Without what shows the sign of a zero, which depends on how terms are arranged."""


def random_function(seed, size=25):
    """A graph of random operations on three inputs."""
    rng = np.random.default_rng(seed)
    x = SX.sym("x", 3)
    known = [x[0], x[1], x[2]]
    for _ in range(size):
        a, b = (known[k] for k in rng.integers(0, len(known), 2))
        alone = rng.random() < 0.4
        rule = (_MIXED if alone else _JOINED)[rng.integers(len(_MIXED if alone else _JOINED))]
        known.append(rule(a) if alone else rule(a, b))
    return Function(f"graph{seed}", [x], [casadi.vertcat(*known[-8:])], ["x"], ["r"])


def states(function, count=60):
    """Inputs of special numbers and of plain ones: all pairs, or random triples."""
    n = function.numel_in(0)
    if n == 2:
        return [
            np.array(pair) for pair in np.stack(np.meshgrid(NUMBERS, NUMBERS), -1).reshape(-1, 2)
        ]
    rng = np.random.default_rng(2)
    numbers = np.concatenate([np.array(NUMBERS)[:-2], rng.uniform(-2, 2, 6)])
    return list(rng.choice(numbers, (count, n)))


def expected(function):
    """The values at every state, one column each."""
    return np.hstack([np.array(function(x)) for x in states(function)])


def require_same(function, columns):
    """What a text gave at the states: equal, NaN where CasADi has NaN, to 1e-12 elsewhere."""
    wanted = expected(function)
    with np.errstate(invalid="ignore"):
        gap = np.abs(columns - wanted)
    fine = (gap <= 1e-12 * np.maximum(1, np.abs(wanted))) | (columns == wanted)
    fine |= np.isnan(columns) & np.isnan(wanted)
    if not fine.all():
        row, state = np.argwhere(~fine)[0]
        x = states(function)[state]
        raise AssertionError(
            f"{function.name()}: row {row} at {x} is {columns[row, state]}, not"
            f" {wanted[row, state]}; {np.sum(~fine)} such"
        )


POINTER = ctypes.POINTER(ctypes.c_double)


def called(library, spelling, function):
    """The columns of a routine of pointers."""
    routine = getattr(library, spelling.format(function.name()))
    columns = []
    for x in states(function):
        given, out = np.array(x, dtype=float), np.full(function.numel_out(0), 7.25)
        routine(given.ctypes.data_as(POINTER), out.ctypes.data_as(POINTER))
        columns.append(out)
    return np.array(columns).T


def in_c(functions, folder):
    """By function the columns of its C text."""
    source = folder / "m.c"
    source.write_text("\n".join(mbs.export.code(f, "c") for f in functions))
    strict = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-Wno-tautological-compare"]
    flags = [*strict, "-O1", "-ffp-contract=off", "-fPIC", "-shared"]
    library = ctypes.CDLL(str(compile_library([source], flags=flags, output=folder / "m.so")))
    return [called(library, "{}", f) for f in functions]


def in_fortran(functions, folder):
    """Likewise of its Fortran."""
    (folder / "m.f90").write_text("\n".join(mbs.export.code(f, "fortran") for f in functions))
    flags = ["-std=f2008", "-Wall", "-Werror", "-O1", "-ffp-contract=off", "-fPIC", "-shared"]
    _run(["gfortran", *flags, "m.f90", "-o", "m.so"], folder)
    library = ctypes.CDLL(str(folder / "m.so"))
    return [called(library, "{}_", f) for f in functions]


def in_rust(functions, folder):
    """Likewise of its Rust."""
    main = ["fn main() {"]
    for f in functions:
        for x in states(f):
            numbers = ", ".join(f"f64::from_bits({v.view(np.uint64)}u64)" for v in np.asarray(x))
            main.append(f"    let mut r = [7.25f64; {f.numel_out(0)}];")
            main.append(f"    {f.name()}(&[{numbers}], &mut r);")
            main.append('    for v in r.iter() { print!("{:?} ", v); } println!();')
    texts = [mbs.export.code(f, "rust") for f in functions]
    (folder / "m.rs").write_text("\n".join([*texts, *main, "}"]))
    _run(["rustc", "-D", "warnings", "--edition", "2021", "m.rs"], folder)
    return _printed(functions, _run(["./m"], folder).stdout)


def in_octave(functions, folder):
    """Likewise of its Matlab, run by Octave."""
    script = []
    for f in functions:
        mbs.export.code(f, "octave", folder / f"{f.name()}.m")
        for x in states(f):
            numbers = " ".join({"nan": "NaN"}.get(repr(float(v)), repr(float(v))) for v in x)
            script.append(f"printf('%.17g ', {f.name()}([{numbers}])); printf('\\n');")
    (folder / "run_all.m").write_text("\n".join(script))
    command = ["octave-cli", "--no-history", "--norc", "--quiet", "run_all.m"]
    answer = _run(command, folder)
    assert "warning" not in answer.stderr
    return _printed(functions, answer.stdout)


def in_python(functions, folder):
    """Likewise of its Python, all states at once."""
    columns = []
    for f in functions:
        space = {}
        exec(mbs.export.code(f, "python"), space)
        with np.errstate(all="ignore"):
            columns.append(space[f.name()](np.array(states(f)).T))
    return columns


def _printed(functions, text):
    rows = [[float(v) for v in line.split()] for line in text.splitlines()]
    columns, first = [], 0
    for f in functions:
        count = len(states(f))
        columns.append(np.array(rows[first : first + count]).T)
        first += count
    return columns


def _run(command, folder):
    answer = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert answer.returncode == 0, answer.stderr[:3000]
    return answer
