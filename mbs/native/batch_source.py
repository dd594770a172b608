"""C code that evaluates a Function for many states, several states at a time in SIMD lanes."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import resources
from itertools import accumulate

from casadi import Function

from mbs.native.c_code import BLOCK, LaneCode, SinCosGroup, blocks, schedule, slots
from mbs.native.frames import EXPORT, HEAD, GraphCode, lane_loop, pointers
from mbs.native.kernel import HEADERS
from mbs.native.repeats import with_calls
from mbs.operations.graph import graph_of

_HEAD = f"""\
{HEAD}\
#include "elementary.h"
#include "rows.h"
{EXPORT}EXPORT int mbs_batch_lanes(void) {{ return MBS_LANES; }}
"""
_INLINE = 16  # angles up to which the sine and cosine code is inlined; else it is called
_WIDEST = 8  # number of lanes of the widest processor, for the size of the work space


@dataclass(frozen=True, slots=True)
class BatchSource:
    """C code of a batch.

    Attributes:
        files: file name to text; one file defines `mbs_batch(ports, work, first, last)`.
        work: work space of a call of `mbs_batch` in doubles.
    """

    files: dict[str, str]
    work: int


def batch_source(
    function: Function, block: int = BLOCK, finite: bool = False, valid: int = 0
) -> BatchSource:
    """Return C files that evaluate a Function, whose inputs and outputs are dense columns.

    Args:
        function: Function of scalar operations.
        block: maximum number of assignments in a C function.
        finite: whether all outputs of a state are NaN if an input of the state is not finite, even
            an input without effect.
        valid: number of flags among the outputs; they are the last outputs. If a flag is not 1,
            the other outputs of the state are NaN. Flags are not written to arrays.

    Raises:
        ModelError: the Function has no scalar operations, or an operation that C lacks.
    """
    graph = graph_of(function)
    pieces = blocks(graph, with_calls(graph, schedule(graph)), block)
    where = slots(graph, pieces)
    angles = sum(
        len(step.angles) for steps in pieces for step in steps if isinstance(step, SinCosGroup)
    )
    sincos = "mbs_sincos_wide" if angles <= _INLINE else "mbs_sincos_wide_call"
    body = GraphCode("batch", LaneCode(graph, where, sincos, [False] * len(graph.inputs)), pieces)
    taken = [port.sparsity.nnz() for port in graph.inputs]
    given = [port.sparsity.nnz() for port in graph.outputs]
    starts = list(accumulate([*taken, *given], initial=where.count))
    places = [f"w + {start}" for start in starts[:-1]]
    count, shown = len(taken), len(given) - valid
    sources = list(zip(places, taken, strict=False))
    flags = [f"out[{shown + k}][0]" for k in range(valid)]
    once = [
        *(
            f"  if (ports[{k}].row) mbs_take(ports + {k}, c, many, {size}, {place});"
            for k, (place, size) in enumerate(sources)
        ),
        *body.calls(),
        *(_flag(sources, flags, given[:shown]) if finite else ()),
        *(
            f"  mbs_give(ports + {count + k}, c, many, {size}, out[{k}]);"
            for k, size in enumerate(given[:shown])
        ),
    ]
    lines = [
        _HEAD,
        *body.texts(),
        "EXPORT void mbs_batch(const mbs_port *ports, double *work, long long first,"
        " long long last)",
        "{",
        "  mbs_lanes *const w = (mbs_lanes *)mbs_aligned(work);",
        pointers("const double", "in", [f"(const double *)({place})" for place in places[:count]]),
        pointers("mbs_lanes", "out", places[count:]),
        *(
            f"  if (!ports[{k}].row) mbs_take_same(ports + {k}, {size}, {place});"
            for k, (place, size) in enumerate(sources)
        ),
        *lane_loop("first", "last", once),
        "  mbs_store_end();",
        "}",
    ]
    runtime = resources.files("mbs.native").joinpath("runtime")
    headers = {name: runtime.joinpath(name).read_text("utf-8") for name in (*HEADERS, "rows.h")}
    return BatchSource({"batch.c": "\n".join(lines), **headers}, _WIDEST * (starts[-1] + 1))


def _flag(inputs: list[tuple[str, int]], flags: list[str], outputs: list[int]) -> list[str]:
    """Return C lines that set outputs to NaN in lanes with a non-finite input or a flag 0.

    x * 0 is NaN for an infinite or NaN input x. A flag is 1, 0, or NaN for a NaN input. `inputs`
    are C pointers with lengths, `outputs` the lengths of the outputs.
    """
    return [
        "    mbs_lanes zero = mbs_all(0.0);",
        *(f"    zero += mbs_times_zero({place}, {size});" for place, size in inputs),
        *(f"    zero += mbs_all(1.0) - {flag};" for flag in flags),
        "    const mbs_bits wrong = ~(mbs_bits)(zero == 0.0);",
        "    if (__builtin_expect(mbs_any(wrong), 0)) {",
        *(f"      mbs_spoil(out[{k}], {size}, wrong);" for k, size in enumerate(outputs)),
        "    }",
    ]
