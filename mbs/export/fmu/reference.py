"""Reference results of the default experiment in an FMU, for comparison with an importer.

They are computed from the equations by the integrators of `mbs.solvers`, not by the FMU itself.
The files and the manifest follow the layered standard FMI-LS-REF 1.0.0-alpha.1.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any
from xml.etree.ElementTree import Element, SubElement

import casadi
import numpy as np
import numpy.typing as npt
from casadi import DM, MX, Function

from mbs.errors import ExportError, SolverError
from mbs.export.fmu.description import FmuModel, FmuVariable
from mbs.export.fmu.xml import text_of
from mbs.solvers._integrate import integrate, integrate_events
from mbs.solvers.problem import Events

Array = npt.NDArray[np.float64]

FOLDER = "extra/org.fmi-standard.fmi-ls-ref"
"""Folder of the files in the FMU."""

_MANIFEST = "http://fmi-standard.org/fmi-ls-manifest"
_TIGHTEST = 1e-10  # largest relative tolerance of the reference: below the errors of importers
_DIGITS = ".13g"
_AFTER_CONTACT = 1e-9
"""First step after an event [s] if the model has contacts, as in `c/solver.c`."""


@dataclass(frozen=True, slots=True)
class _File:
    """File of the layered standard.

    Attributes:
        name: file name in the folder.
        type: MIME type.
        role: purpose of the file, a term of the standard.
        description: one-line description.
        content: text of the file.
    """

    name: str
    type: str
    role: str
    description: str
    content: str


def reference_files(model: FmuModel) -> dict[str, bytes]:
    """Return the files of the default experiment and its results: dict from path to content.

    Inputs keep their start values. The results contain all outputs at each communication point.

    Args:
        model: description of the FMU.

    Raises:
        ExportError: the simulation fails before the stop time.
    """
    times = np.linspace(0, model.stop_time, round(model.stop_time / model.step_size) + 1)
    results = _csv(times, *_results(model, times))
    files = [
        _File("results.csv", "text/csv", "result", "outputs, inputs at their start values", results)
    ]
    if model.inputs:
        u = np.array([[v.start for v in model.inputs]] * 2)
        inputs = _csv(times[[0, -1]], model.inputs, u)
        files.append(_File("inputs.csv", "text/csv", "other", "inputs of the experiment", inputs))
    experiment = _experiment(model)
    files.append(
        _File(
            "default.exp",
            "application/x-ma-hs-experiments",
            "experiment/validation",
            "the default experiment",
            experiment,
        )
    )
    texts = {file.name: file.content for file in files} | {"fmi-ls-manifest.xml": _manifest(files)}
    return {f"{FOLDER}/{name}": text.encode() for name, text in texts.items()}


def _results(model: FmuModel, times: Array) -> tuple[list[FmuVariable], Array]:
    """Return the outputs and their values, one row per time."""
    states, modes = _motion(model, times)
    nx, count = len(model.states), len(times)
    p = casadi.vertcat(_starts(model.parameters), DM(0, 1))
    every = casadi.vertcat(casadi.repmat(p, 1, count), DM(modes.T))
    u = casadi.repmat(_starts(model.inputs), 1, count)
    x = DM(states.T)
    y = np.array(model.rhs(times[None, :], x[:nx, :], x[nx:, :], u, every)[1]).T
    shown = [k for k, state in enumerate(model.states) if state.output]
    variables = [*(model.states[k] for k in shown), *model.outputs, *model.modes]
    table = np.hstack((states[:, shown], y.reshape(count, len(model.outputs)), modes))
    return variables, table


def _motion(model: FmuModel, times: Array) -> tuple[Array, Array]:
    """Return states followed by dependent coordinates, and modes, one row per time."""
    t, x = MX.sym("t"), MX.sym("x", len(model.states) + len(model.dependents))
    p = MX.sym("p", len(model.parameters) + len(model.modes))
    start = casadi.vertcat(_starts(model.states), _starts(model.dependents))
    tolerance = min(model.tolerance, _TIGHTEST)
    settings: dict[str, Any] = {
        "p": _starts(model.parameters).full().ravel(),
        "project": _project(model, t, x, p),
        "method": "rodas" if model.solver == "rodas" else "dopri5",
        "rtol": tolerance,
        "atol": tolerance,
    }
    rhs, x0 = _rhs(model, t, x, p), start.full().ravel()
    try:
        if model.jumps is None:
            return integrate(rhs, x0, times, **settings), np.zeros((len(times), 0))
        found = integrate_events(rhs, x0, times, _events(model, t, x, p), **settings)
    except SolverError as error:
        raise ExportError(
            f"FMU {model.name}: the reference results do not reach {model.stop_time:g} s ({error});"
            " choose a shorter stop_time, or leave the reference out"
        ) from error
    return found.x, found.modes


def _starts(variables: Sequence[FmuVariable]) -> DM:
    return DM([v.start for v in variables]) if variables else DM(0, 1)


def _split(model: FmuModel, t: MX, x: MX, p: MX) -> list[MX]:
    """Return the arguments t, x, z, u, p of the model functions; x holds states and dependents."""
    nx = len(model.states)
    return [t, x[:nx], x[nx:], MX(_starts(model.inputs)), p]


def _rhs(model: FmuModel, t: MX, x: MX, p: MX) -> Function:
    """Return rhs(t, x, p): derivatives of states and, through the closure, of dependents."""
    point = _split(model, t, x, p)
    rate = model.rhs.call(point)[0]
    if model.closure is None:
        return Function("rhs", [t, x, p], [casadi.densify(rate)])
    states, z = MX.sym("x", point[1].numel()), MX.sym("z", point[2].numel())
    dx, q = MX.sym("dx", states.numel()), MX.sym("p", len(model.parameters))
    moved = casadi.jtimes(model.closure.call([states, z, q])[0], states, dx)
    follow = Function("follow", [states, z, q, dx], [moved])
    z_rate = follow(point[1], point[2], p[: q.numel()], rate)
    return Function("rhs", [t, x, p], [casadi.densify(casadi.vertcat(rate, z_rate))])


def _project(model: FmuModel, t: MX, x: MX, p: MX) -> Function | None:
    if model.closure is None:
        return None
    _, states, z, _, _ = _split(model, t, x, p)
    z_next, residual = model.closure.call([states, z, p[: len(model.parameters)]])
    kept = casadi.densify(casadi.vertcat(states, z_next))
    return Function("project", [t, x, p], [kept, casadi.densify(residual)])


def _events(model: FmuModel, t: MX, x: MX, p: MX) -> Events:
    assert model.jumps is not None
    fired = MX.sym("fired", len(model.jumps.names))
    point = _split(model, t, x, p)
    g = casadi.densify(model.jumps.indicators.call(point)[0])
    after, modes = model.jumps.jump.call([*point, fired])
    moved = [casadi.densify(casadi.vertcat(after, point[2])), casadi.densify(modes)]
    none = DM.zeros(len(model.modes))
    first, beyond = model.jumps.first(
        0.0,
        _starts(model.states),
        _starts(model.dependents),
        _starts(model.inputs),
        casadi.vertcat(_starts(model.parameters), none),
    )
    passed = [
        name for name, b in zip(model.jumps.names, beyond.full().ravel(), strict=True) if b > 0
    ]
    if passed:
        raise ExportError(
            f"FMU {model.name}: the start values are beyond {', '.join(passed)}; move them"
        )
    near, first_step = None, 0.0
    if model.jumps.approaches is not None:
        near = Function("approaches", [t, x, p], model.jumps.approaches.call(point))
        first_step = _AFTER_CONTACT
    return Events(
        Function("indicators", [t, x, p], [g]),
        Function("jump", [t, x, p, fired], moved),
        first.full().ravel(),
        first_step,
        near,
    )


def _csv(times: Array, variables: Sequence[FmuVariable], table: Array) -> str:
    """Return CSV text (RFC 4180): a header row, then one row per time."""
    names = ",".join('"' + name.replace('"', '""') + '"' for name in _names(variables))
    rows = np.column_stack((times, table))
    return "\n".join([names, *(",".join(format(x, _DIGITS) for x in row) for row in rows)]) + "\n"


def _names(variables: Sequence[FmuVariable]) -> list[str]:
    return ["time", *(v.name for v in variables)]


def _experiment(model: FmuModel) -> str:
    root = Element("Experiments", name=model.name)
    experiment = SubElement(root, "Experiment", name="default", tolerance=repr(model.tolerance))
    SubElement(
        experiment,
        "TransientSimulation",
        startTime="0",
        stopTime=repr(model.stop_time),
        stepSize=repr(model.step_size),
    )
    if model.inputs:
        SubElement(experiment, "Stimuli", source="inputs.csv")
    SubElement(experiment, "References", source="results.csv")
    return text_of(root)


def _manifest(files: Sequence[_File]) -> str:
    text = "Layered Standard providing information on related files included in an FMU."
    root = Element(
        "fmiReferences",
        {
            "xmlns:fmi-ls": _MANIFEST,
            "fmi-ls:fmi-ls-name": "org.fmi-standard.fmi-ls-ref",
            "fmi-ls:fmi-ls-version": "1.0.0-alpha.1",
            "fmi-ls:fmi-ls-description": text,
        },
    )
    for file in files:
        SubElement(
            root,
            "Related",
            type=file.type,
            source=file.name,
            role=file.role,
            description=file.description,
            checksum=hashlib.sha3_256(file.content.encode()).hexdigest(),
            checksumType="SHA3-256",
        )
    return text_of(root)
