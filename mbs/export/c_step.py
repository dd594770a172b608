"""Simulation of a mechanism in C without heap: a state and steps of a fixed length."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from importlib import resources
from itertools import accumulate

import casadi
from casadi import MX, Function

from mbs.assembly import System
from mbs.assembly.tables import ACCELERATION_UNIT
from mbs.assembly.tree import quaternion_slices
from mbs.assembly.validity import UNIT
from mbs.errors import ModelError
from mbs.export.c_check import NO_FAST_MATH
from mbs.export.fmu.description import FmuVariable
from mbs.export.fmu.source import diagonal_blocks, leading_states, steepness
from mbs.export.fmu.variables import (
    dependents,
    inputs,
    loop_size,
    outputs,
    parameters,
    states,
)
from mbs.loops.closing import distance_units
from mbs.models.state.independent import MinimalState, consistent_start, minimal_state
from mbs.native.c_code import Real, literal
from mbs.native.frames import NOINLINE
from mbs.native.scalar_source import bare_source
from mbs.text import in_c_comment

_HEADER = """\
/** {title}: its motion in steps of the classical Runge-Kutta method of order 4.
 *
 *  A state is yours: copy it to keep it, have as many as you like. Begin with {name}_start.
 *  Elements, in SI units and radians:
 *
 *    x  {x}
 *    z  {z}
 *    u  {u}
 *    p  {p}
 *    q  {q}
 *    v  {v}
 *    a  {a}
 */
{watched}typedef struct {{
  {real} t; /* time [s], 0 at the start */
  {real} x[{nx}]; /* states of the independent joints */
  {real} z[{nz}]; /* positions that closed loops determine */
  {real} p[{np}]; /* parameters; another start is needed to change them */
  /* what a step hands to the next one */
  {real} u[{nu}], slope[{nx}];
  int known;
{kept}}} {name}_state;

/** Begins at a state.
 *
 *  @param[out] s      is NaN where the status is not MBS_OK
 *  @param[in]  x      ({x_size}); NULL: as assembled, at rest
 *  @param[in]  guess  ({z_size}) of z, chooses the branch of closed loops; NULL: as assembled
 *  @param[in]  p      ({p_size}); NULL: default values
 *  @param      w      scratch memory of {upper}_STEP_SZ_W numbers
 */
int {name}_start(
    {name}_state *s, const {real} *x, const {real} *guess, const {real} *p, {real} *w);

/** One step of length h [s], u held. The state stays where it is when the status is not MBS_OK.
 *
 *  MBS_OPEN and MBS_UNDETERMINED: the loops cannot be closed along the step, or it comes to a
 *  singular configuration, beyond which the motion may be on another branch.
 *
 *  @param[in]  u  ({u_size}); no pointer of a call may be NULL
 */
int {name}_step({name}_state *s, const {real} *u, {real} h, {real} *w);

/** Positions, velocities and accelerations of all joints of the tree.
 *
 *  @param[out] q  ({nq})
 *  @param[out] v  ({nv})
 *  @param[out] a  ({nv})
 */
int {name}_motion(
    const {name}_state *s, const {real} *u, {real} *q, {real} *v, {real} *a, {real} *w);
#define {upper}_STEP_SZ_W {sz_w}
"""

_WATCHED = """\
typedef struct {{
  int on;
  {real} time, sign[{nb}], v[{n}], a[{n}];
}} {name}_watched;
"""

_HEAD = """\
/* {mark}. The equations of {title} and the steps that integrate them. */
#include "{library}.h"

#include <float.h>
#include <math.h>
#include <stddef.h>
#include <string.h>

{no_fast_math}typedef {library}_real real;
#define REAL(number) ((real)(number))
#define SHARED static
#define NOT_A_NUMBER REAL(NAN)
{precision}
#define SYSTEM(part) {name}_##part
#define STEP_SZ_W {upper}_STEP_SZ_W
{sizes}
#define UNIT_LENGTH REAL({unit})
enum {{ STATES = 0, DEPENDENTS = NX, PARAMETERS = NX + NZ }};
{watched}
static int all_finite(const real *x, int n) {{
    int i;
    for (i = 0; i < n; i++)
        if (!real_finite(x[i])) return 0;
    return 1;
}}
"""

_PRECISION: dict[Real, str] = {
    "double": """\
#define real_abs fabs
#define real_within_half_turn(angle) atan2(sin(angle), cos(angle))
#define real_max fmax
#define real_min fmin
#define real_sqrt sqrt
#define real_finite(x) (fabs(x) <= DBL_MAX)
/* as solvers do that keep the time at both ends */
#define STEP_LENGTH(t, h, end) ((end) - (t))""",
    "float": """\
#define REAL_IS_FLOAT
#define real_abs fabsf
#define real_within_half_turn(angle) atan2f(sinf(angle), cosf(angle))
#define real_max fmaxf
#define real_min fminf
#define real_sqrt sqrtf
#define real_finite(x) (fabsf(x) <= FLT_MAX)
/* time has too few digits to measure a step by */
#define STEP_LENGTH(t, h, end) (h)""",
}

_EXAMPLE = """\
  {{
    static {name}_state s;
    static {real} w[{upper}_STEP_SZ_W];
    const {real} u[{nu}] = {{0}};
    {real} q[{nq}], v[{nv}], a[{nv}];
    int status = {name}_start(&s, NULL, NULL, NULL, w);
    for (int k = 0; k < 100 && !status; ++k) status = {name}_step(&s, u, {step}, w);
    if (!status) status = {name}_motion(&s, u, q, v, a, w);
    if (status) {{
      printf("{name} status %d\\n", status);
      failed = 1;
    }} else {{
      printf("{name} q");
      for (int k = 0; k < {nq}; ++k) printf(" %.17g", (double)q[k]);
      printf("\\n");
    }}
  }}
"""


@dataclass(frozen=True, slots=True)
class StepTexts:
    """C texts of the simulation of a system.

    Attributes:
        header: part of the header of the library.
        source: text of a C file.
        example: part of the example program.
    """

    header: str
    source: str
    example: str


def step_texts(system: System, name: str, library: str, real: Real, mark: str) -> StepTexts:
    """Return the C texts of the simulation of a system.

    Args:
        system: mechanism, open or closed, without rigid stops and Coulomb friction.
        name: name of the system in C.
        library: name of the library.
        real: type of numbers, "double" or "float".
        mark: text in the first line of generated files.

    Raises:
        ModelError: the system has events, nothing can move, a parameter has no value, or an
            equation contains operations that are not scalar.
    """
    state = minimal_state(system, lambda seen: [seen.q, seen.v, seen.a])
    if state.events is not None:
        raise ModelError(
            f"{system.name}: rigid stops, Coulomb friction and components have events, which"
            " steps of a fixed length cannot follow; take elastic stops, viscous friction and"
            " components without events, or mbs.export.fmu"
        )
    if state.rhs.size1_in(1) == 0:
        raise ModelError(f"{system.name}: nothing can move, so there is no motion to step through")
    x, z = consistent_start(system, state)
    variables = _Variables(
        states(system, state, x),
        dependents(system, state, z),
        tuple(inputs(system, state, ())),
        tuple(parameters(system)),
    )
    code, work = bare_source(_functions(system, state, variables), real)
    sizes = _sizes(system, state, variables, work)
    words = {"name": name, "upper": name.upper(), "real": f"{library}_real", "library": library}
    title = in_c_comment(system.name)
    return StepTexts(
        _header(system, variables, sizes, {**words, "title": title}),
        "\n".join(
            [
                _head(sizes, {**words, "title": title, "mark": mark}, real),
                *_tables(system, state, variables, real),
                "\n" + NOINLINE,
                code,
                *(_shared_file(file) for file in ("closure.h", "closure.c", "watch.h", "watch.c")),
                (resources.files("mbs.export") / "c" / "step.c").read_text(encoding="utf-8"),
            ]
        ),
        _EXAMPLE.format(
            **words,
            nu=max(1, sizes["NU"]),
            nq=sizes["NQ"],
            nv=sizes["NV"],
            step=literal(0.001, real),  # step [s] of the example, as of a controller at 1 kHz
        ),
    )


@dataclass(frozen=True, slots=True)
class _Variables:
    """Descriptions of the elements of the vectors in C.

    Attributes:
        x: states of the independent joints.
        z: positions that closed loops determine.
        u: inputs.
        p: parameters.
    """

    x: tuple[FmuVariable, ...]
    z: tuple[FmuVariable, ...]
    u: tuple[FmuVariable, ...]
    p: tuple[FmuVariable, ...]


def _functions(system: System, state: MinimalState, variables: _Variables) -> list[Function]:
    """Return the Functions that step.c, closure.c and watch.c call, with dense arguments.

    `state` gives the equations of motion in independent coordinates.
    """
    sizes = [len(own) for own in (variables.x, variables.z, variables.u, variables.p)]
    t, (x, z, u, p) = MX.sym("t"), (MX.sym("s", size) for size in sizes)
    point = [t, x, z, u, p]
    xdot, y = state.rhs.call(point)
    ends = [0, *accumulate([system.nq, system.nv, system.nv])]
    seen = casadi.vertsplit(y, [0, *(y.numel() - ends[-1] + end for end in ends)])[1:]
    made = {"mbs_rates": (point, [xdot]), "mbs_motion": (point, seen)}
    if state.closure is not None:
        loop = [x, z, p]
        steep = steepness(state.closure, loop, (variables.x, variables.p, variables.z))
        made["mbs_closure"] = loop, state.closure.call(loop)
        made["mbs_sensitivity"] = loop, [steep]
        if diagonal_blocks(state.slopes):
            first, n = len(state.accelerations) + len(state.shown), len(state.passive)
            passive = casadi.vertsplit(y, [0, first, first + n, first + 2 * n, y.numel()])[1:3]
            made["mbs_passive"] = point, passive
            made["mbs_slopes"] = loop, state.slopes.call(loop)  # type: ignore[union-attr]
    return [
        Function(name, taken, [casadi.densify(casadi.vec(value)) for value in values])
        for name, (taken, values) in made.items()
    ]


def _sizes(system: System, state: MinimalState, variables: _Variables, work: int) -> dict[str, int]:
    """Return the C constants of sizes by name.

    `work` is the number of elements of scratch memory that the functions need.
    """
    nx, nz = len(variables.x), len(variables.z)
    return {
        "NX": nx,
        "NZ": nz,
        "NU": len(variables.u),
        "NP": len(variables.p),
        "NQ": system.nq,
        "NV": system.nv,
        "NB": len(diagonal_blocks(state.slopes)),
        "N_PASSIVE": len(state.passive),
        "N_QUATERNIONS": len(_quaternions(system, state)),
        "WORK": work,
        "SZ_W": work + nz * nz + 4 * nx + 2 * nz + 2 * len(state.passive),
    }


def _quaternions(system: System, state: MinimalState) -> list[int]:
    """Return the first index in x of each quaternion whose four elements are all states."""
    indices = [state.positions.index(k) if k in state.positions else -1 for k in range(system.nq)]
    starts = []
    for part in quaternion_slices(system.tree):
        own = indices[part]
        if own[0] >= 0 and own == list(range(own[0], own[0] + len(own))):
            starts.append(own[0])
    return starts


def _header(
    system: System, variables: _Variables, sizes: dict[str, int], words: dict[str, str]
) -> str:
    """Return the part of the library header that declares the simulation.

    `sizes` are the C constants, `words` the names that the text template contains.
    """
    speeds = system.velocity_coordinates
    texts = {
        "x": _words((v.name, v.unit) for v in variables.x),
        "z": _words((v.name.removesuffix(".solved"), v.unit) for v in variables.z),
        "u": _words((v.name, v.unit) for v in variables.u),
        "p": _words((v.name, v.unit) for v in variables.p),
        "q": _words((c.name, c.unit) for c in system.coordinates),
        "v": _words((s.name, s.unit) for s in speeds),
        "a": _words((s.name, ACCELERATION_UNIT[s.unit]) for s in speeds),
    }
    watched = kept = ""
    if sizes["NB"]:
        counts = {"nb": sizes["NB"] + 1, "n": sizes["N_PASSIVE"] + 1}
        watched = _WATCHED.format(**words, **counts)
        kept = f"  {words['name']}_watched watched;\n"
    return _HEADER.format(
        **words,
        **texts,
        watched=watched,
        kept=kept,
        nx=sizes["NX"],
        nz=max(1, sizes["NZ"]),
        nu=max(1, sizes["NU"]),
        np=max(1, sizes["NP"]),
        nq=sizes["NQ"],
        nv=sizes["NV"],
        x_size=sizes["NX"],
        z_size=sizes["NZ"],
        p_size=sizes["NP"],
        u_size=sizes["NU"],
        sz_w=sizes["SZ_W"],
    )


def _words(elements: Iterable[tuple[str, str]]) -> str:
    """Return names with units as text, "none" if there are no elements."""
    return ", ".join(in_c_comment(f"{name} [{unit}]") for name, unit in elements) or "none"


def _head(sizes: dict[str, int], words: dict[str, str], real: Real) -> str:
    """Return the head of the C file: includes, types and sizes.

    `sizes` are the C constants, `words` the names that the text template contains.
    """
    watched = ""
    if sizes["NB"]:
        watched = f"#define WATCHED\ntypedef {words['name']}_watched watched;\n"
    return _HEAD.format(
        **words,
        no_fast_math=NO_FAST_MATH,
        precision=_PRECISION[real],
        sizes="\n".join(f"#define {key} {n}" for key, n in sizes.items() if key != "SZ_W"),
        unit=repr(UNIT),
        watched=watched,
    )


def _tables(system: System, state: MinimalState, variables: _Variables, real: Real) -> list[str]:
    """Return the C arrays of start values, bounds, scales and index tables, as C definitions."""
    joints = (*variables.x, *variables.z)
    every = list(outputs(system, state))
    first = len(state.accelerations) + len(state.shown)
    units = every[first : first + len(state.passive)]
    low = (-math.inf if v.min is None else v.min for v in variables.p)
    high = (math.inf if v.max is None else v.max for v in variables.p)
    made = [
        _numbers("MODEL_START", (v.start for v in (*joints, *variables.p)), real),
        _numbers("MODEL_MIN", low, real),
        _numbers("MODEL_MAX", high, real),
        _places("MODEL_QUATERNIONS", _quaternions(system, state)),
    ]
    if variables.z:
        assert state.closure is not None
        made.append(_numbers("MODEL_NOMINAL", (v.nominal for v in joints), real))
        made.append(_places("MODEL_LEADS", leading_states(state.closure)))
        made.append(_places("MODEL_TURNS", [int(v.unit == "rad") for v in variables.z]))
        sizes = distance_units((v.unit for v in variables.z), loop_size(system))
        made.append(_numbers("MODEL_SPANS", sizes, real))
    if blocks := diagonal_blocks(state.slopes):
        made += [
            _numbers("MODEL_UNITS", (v.nominal for v in units), real),
            _places("MODEL_BLOCKS", list(accumulate(block.size for block in blocks))),
            _places("MODEL_ROWS", [row for block in blocks for row in block.rows]),
            _places("MODEL_COLUMNS", [column for block in blocks for column in block.columns]),
        ]
    return made


def _numbers(name: str, values: Iterable[float], real: Real) -> str:
    """Return the C definition of a constant array `name` of numbers."""
    texts = [f"REAL({literal(float(value), real)})" for value in values] or ["REAL(0)"]
    return f"static const real {name}[] = {{{', '.join(texts)}}};"


def _places(name: str, values: Sequence[int]) -> str:
    """Return the C definition of a constant array `name` of indices."""
    return f"static const int {name}[] = {{{', '.join(map(str, values)) or '0'}}};"


def _shared_file(file: str) -> str:
    """Return the text of a C file of the FMU runtime without #include lines."""
    folder = resources.files("mbs.export.fmu") / "c"
    lines = (folder / file).read_text(encoding="utf-8").splitlines()
    return "\n".join(line for line in lines if not line.startswith("#include")) + "\n"
