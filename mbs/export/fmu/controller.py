"""A controller inside an FMU: it replaces the inputs of the motors that it drives."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import casadi
from casadi import MX, SX, Function

from mbs.assembly import System
from mbs.errors import ExportError
from mbs.export.fmu.c_law import CController, Sources, c_function
from mbs.export.fmu.description import FmuVariable
from mbs.messages import quoted
from mbs.models.effort import effort_function

Law = Function | Callable[[Any, Any, Any], Any] | CController | str | None
"""A law as a user gives it."""

_POINT = ("t", "q", "v")


@dataclass(frozen=True, slots=True, eq=False)
class Controller:
    """A control law with inputs of its own.

    Attributes:
        effort: `effort(t, q, v, w, p) -> tau`, (nv, 1); None where the motors are inputs.
        device: `device(t, q, v, w, p) -> u`, one input for each device; None likewise.
        inputs: w.
        sources: further C files that the FMU needs.
    """

    effort: Function | None = None
    device: Function | None = None
    inputs: tuple[FmuVariable, ...] = ()
    sources: Sources = ()


def controller_of(system: System, law: Law, sources: Sources = ()) -> Controller:
    """The controller of an FMU.

    Args:
        system: that it drives.
        law: a function of (t, q, v) that returns tau, as `mbs.simulate.run` takes it; a Function
            with inputs t, q, v and further ones, and outputs "tau" (nv, 1), "u" (one input for
            each device) or both; a C function of the sources.
        sources: C files and headers.

    Raises:
        ExportError: it has other inputs or outputs, or is no law.
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
    places = [sum(sizes[:k]) for k in range(len(sizes) + 1)]
    values = law.call([t, q, v, *(w[a:b] for a, b in pairwise(places))])
    made = {
        name: Function(kind, point, [casadi.densify(casadi.vec(values[outputs[name]]))])
        for name, kind in (("tau", "effort"), ("u", "device"))
        if name in outputs
    }
    return Controller(made.get("tau"), made.get("u"), tuple(_inputs(law)), sources)


def _symbols(system: System, law: Function, nw: int) -> list[Any]:
    """t, q, v, w and p: SX where the law is made of scalars, else MX."""
    kind = SX if law.is_a("SXFunction") else MX
    sizes = {"t": 1, "q": system.nq, "v": system.nv, "w": nw, "p": len(system.parameters)}
    return [kind.sym(name, size) for name, size in sizes.items()]


def _check_inputs(system: System, law: Function) -> None:
    sizes = [law.numel_in(k) for k in range(min(3, law.n_in()))]
    wanted = [1, system.nq, system.nv]
    if sizes != wanted:
        raise ExportError(
            f"{system.name}: the controller {law.name()} starts with inputs of sizes {sizes}; give"
            f" t, q and v of sizes {wanted}, then further inputs"
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
    """Which output gives the efforts, and which the inputs of the devices."""
    names = law.name_out()
    places = {name: k for k, name in enumerate(names)}
    if len(names) == 1 and names != ["u"]:
        places = {"tau": 0}
    sizes = {"tau": system.nv, "u": len(system.devices)}
    if not set(places) <= set(sizes):
        raise ExportError(
            f"{system.name}: the controller {law.name()} has outputs {', '.join(names)}; call them"
            " tau for efforts of joints, and u for inputs of devices"
        )
    for name, k in places.items():
        if law.numel_out(k) != sizes[name] or not sizes[name]:
            raise ExportError(
                f"{system.name}: the controller {law.name()} gives {law.numel_out(k)} values of"
                f" {name}, the system has {sizes[name]}"
            )
    return places


def _inputs(law: Function) -> Iterator[FmuVariable]:
    for k in range(3, law.n_in()):
        name, size, start = law.name_in(k), law.numel_in(k), law.default_in(k)
        for i in range(size):
            yield _input(name if size == 1 else f"{name}[{i + 1}]", start)


def _input(name: str, start: float) -> FmuVariable:
    return FmuVariable(name=name, start=start, description=f"input {name} of the controller")
