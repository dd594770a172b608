"""The inverse geometric model of an arm as an FMU: a pose comes in, positions of joints go out."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from pathlib import Path

import casadi
import numpy as np
from casadi import SX, Function

from mbs.assembly import System
from mbs.assembly.model_function import require_system
from mbs.errors import ExportError
from mbs.export.fmu.description import FmuModel, FmuVariable, State
from mbs.export.fmu.documentation import about
from mbs.export.fmu.pack import require_version, require_writable, write_fmu
from mbs.export.fmu.variables import parameters
from mbs.files import path_of
from mbs.models.geometry import terminal_frame, transform
from mbs.models.inverse_geometry.chain import FrameChain, frame_chain
from mbs.models.inverse_geometry.closed_form import all_branches, sequence_of, size

_MEMORY = 0.01
"""Time constant [s] with which the joints that choose the branch follow the solution: some times
shorter than what arms do, and some times longer than the steps of a simulation."""
_HOPELESS = 1e6
"""Added to the square of the distance [rad or m] of a branch that does not hold."""
_MISSED = 1e-9
"""Largest difference of an element from the pose, lengths in those of the arm, of a branch that
holds: rounding of inputs in other tools."""


def inverse_geometry_fmu(
    system: System,
    path: str | os.PathLike[str],
    *,
    method: str = "auto",
    frame: str | int | None = None,
    locked: Mapping[str, float] | None = None,
    start: Mapping[str, float] | Sequence[float] | None = None,
    fmi: str = "2.0",
    platforms: Sequence[str] | None = None,
) -> Path:
    """Write the closed form of an arm's inverse geometric model as an FMU.

    Inputs are the pose of the frame in the base, `tool.x`, `tool.y`, `tool.z` and the rotation
    matrix `tool.R11` .. `tool.R33`, whose columns are made orthonormal. Outputs are the positions
    `name.q` of the joints on the branch that is nearest to where the joints were, without leaps by
    whole turns, and `valid`, which is 0 where no branch takes the pose; the joints then stay.
    States `name.last` follow the outputs with the time constant `memory`; their start values choose
    the first branch. Symbols of the system are parameters.

    Args:
        system: an open chain that has a closed form.
        path: of the file to write.
        method: "pieper", "paul", or "auto" for the cheaper of them.
        frame: a body, a named frame, the number of a link, or None for the terminal frame.
        locked: positions of joints that stay where they are, by name [rad or m].
        start: configuration at the start, (nq,) or by name; the assembled one when left out.
        fmi: "2.0" or "3.0".
        platforms: what computers it is for; this computer when left out.

    Returns:
        The path written.

    Raises:
        NoClosedForm: no closed form is known.
        ExportError: the system is closed, the file cannot be written, or another FMI version was
            asked for.
        ModelError: a name is unknown, a parameter has no value, or more than six joints are free.
        CompilerError: there is no C compiler, or there is no such platform.
    """
    require_system(system)
    require_version(system.name, fmi)
    require_writable(path_of(path))
    if system.is_closed:
        raise ExportError(
            f"{system.name}: its loops must be closed too, and no closed form does both; export an"
            " open chain"
        )
    name = terminal_frame(system) if frame is None else frame
    chain = frame_chain(system, name, locked)
    first = np.array(system.position(start))
    return write_fmu(_model(chain, method, first), path, fmi=fmi, platforms=platforms)


def _model(chain: FrameChain, method: str, start: np.ndarray) -> FmuModel:
    system = chain.system
    coordinates = [system.coordinates[k] for k in chain.indices]
    own = tuple(parameters(system))
    values = [parameter.start for parameter in own]
    dgm = transform(system, chain.frame)
    whole = start.copy()
    for name, value in chain.locked.items():
        whole[[c.name for c in system.coordinates].index(name)] = value
    T = np.array(dgm(whole, *([values] if own else [])))
    entries = [("xyz"[k], T[k, 3], "m") for k in range(3)]
    entries += [(f"R{r + 1}{c + 1}", T[r, c], "1") for r in range(3) for c in range(3)]
    states = [
        State(
            name=f"{coordinate.name}.last",
            unit=coordinate.unit,
            start=float(start[index]),
            description=f"where {coordinate.name} was: the nearest branch is taken",
            derivative_unit="rad/s" if coordinate.unit == "rad" else "m/s",
        )
        for coordinate, index in zip(coordinates, chain.indices, strict=True)
    ]
    shown = [
        FmuVariable(name=f"{c.name}.q", unit=c.unit, description=f"position of {c.name}")
        for c in coordinates
    ]
    valid = FmuVariable(name="valid", description="1 where a branch takes the pose, else 0")
    memory = FmuVariable(
        name="memory",
        unit="s",
        start=_MEMORY,
        nominal=_MEMORY,
        min=float(np.finfo(float).tiny),
        description="time constant with which what chooses the branch follows",
    )
    return FmuModel(
        name=f"{system.name}_inverse_geometry",
        description=f"Joint positions of {system.name} for a pose of its frame {chain.frame}",
        states=tuple(states),
        inputs=tuple(
            FmuVariable(name=f"tool.{name}", unit=unit, start=float(value))
            for name, value, unit in entries
        ),
        outputs=(*shown, valid),
        parameters=(*own, memory),
        rhs=_rhs(chain, method),
        documentation=system.source,
        about=about(system),
    )


def _rhs(chain: FrameChain, method: str) -> Function:
    """``rhs(t, x, z, u, p) -> xdot, y`` of the branch nearest to x."""
    n, system = len(chain.names), chain.system
    t, z, x = SX.sym("t"), SX.sym("z", 0), SX.sym("x", n)
    u, p, memory = SX.sym("u", 12), SX.sym("p", system.p.numel()), SX.sym("memory")
    T = casadi.vertcat(casadi.horzcat(_rotation(u[3:]), u[:3]), SX([[0, 0, 0, 1]]))
    every = all_branches(chain, sequence_of(chain, method))
    given = [T, p] if system.parameters else [T]
    q, residual, real, _, _ = every.call(given)
    nearest, least = x, SX(_HOPELESS)
    scale = casadi.fmax(1.0, casadi.substitute(size(chain), system.p, p))
    for b in range(q.size2()):
        apart = q[:, b] - x
        for k in range(n):
            if not chain.prismatic[k]:
                apart[k] -= 2 * math.pi * casadi.floor(apart[k] / (2 * math.pi) + 0.5)
        holds = casadi.logic_and(residual[b] <= _MISSED * scale, real[b] >= -_MISSED)
        away = casadi.sumsqr(apart) + casadi.if_else(holds, 0, _HOPELESS)
        closer = away < least
        nearest = casadi.if_else(closer, x + apart, nearest)
        least = casadi.if_else(closer, away, least)
    valid = least < _HOPELESS
    y = casadi.vertcat(nearest, valid)
    every_p = casadi.vertcat(p, memory)
    return Function("rhs", [t, x, z, u, every_p], [(nearest - x) / memory, y])


def _rotation(rows: SX) -> SX:
    """(3, 3) the rotation beside nine elements, row by row: interpolated inputs are none."""
    R = casadi.reshape(rows, 3, 3).T
    first = R[:, 0] / casadi.norm_2(R[:, 0])
    second = R[:, 1] - first * casadi.dot(first, R[:, 1])
    second = second / casadi.norm_2(second)
    return SX(casadi.horzcat(first, second, casadi.cross(first, second)))
