"""Inverse geometric model (inverse kinematics) of an arm as an FMU: pose to joint positions."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import casadi
import numpy as np
from casadi import DM, MX, SX, Function

from mbs.assembly.model_function import require_system
from mbs.closed_forms.sequence import StepSequence
from mbs.errors import ExportError
from mbs.export.fmu.description import FmuModel, FmuState, FmuVariable
from mbs.export.fmu.documentation import about
from mbs.export.fmu.options import InverseGeometryFmuArguments
from mbs.export.fmu.pack import require_version, require_writable, write_fmu
from mbs.export.fmu.variables import parameters
from mbs.files import path_of
from mbs.models.geometry import terminal_frame, transform
from mbs.models.inverse_geometry.chain import FrameChain, frame_chain
from mbs.models.inverse_geometry.closed_form import all_branches, size
from mbs.models.inverse_geometry.functions import steps_or_all
from mbs.options import arguments_of

_MEMORY = 0.01
"""Time constant [s] with which the states that select the branch follow the solution: shorter than
the motions of arms, and longer than the steps of a simulation."""
_HOPELESS = 1e6
"""Penalty added to the squared distance [rad or m] of a branch that does not reach the pose."""
_MISSED = 1e-9
"""Largest error of an element of the pose of a valid branch, lengths relative to the size of the
arm: rounding of inputs in other tools."""


@arguments_of(InverseGeometryFmuArguments)
def inverse_geometry_fmu(options: InverseGeometryFmuArguments) -> Path:
    """Write the inverse geometric model (inverse kinematics) of an arm as an FMU.

    Inputs are the pose of the frame in the base: origin `tool.x`, `tool.y`, `tool.z` and rotation
    matrix `tool.R11` .. `tool.R33`, whose columns are orthonormalised. Outputs are the joint
    positions `name.q` on the branch nearest to the previous positions, without jumps by whole
    revolutions, and `valid`. If no branch reaches the pose, `valid` is 0 and the positions stay.
    States `name.last` follow the outputs with the time constant `memory`. Their start values select
    the first branch. Symbols of the system are parameters. The general method has the additional
    output `certain`. It is 0 if solutions may be missing, near singular configurations.

    Args:
        options: see `InverseGeometryFmuArguments`.

    Returns:
        Path of the file.

    Raises:
        NoClosedForm: no closed form is known, and the general method does not apply.
        ExportError: the system is closed, the file cannot be written, or the FMI version is
            unknown.
        ModelError: a name is unknown, a parameter has no value, or more than six joints are free.
        CompilerError: no C compiler is installed, or a platform is unknown.
    """
    system = options.system
    require_system(system)
    require_version(system.name, options.fmi)
    require_writable(path_of(options.path))
    if system.is_closed:
        raise ExportError(
            f"{system.name}: its loops must be closed too, and no method does both; export an"
            " open chain"
        )
    name = terminal_frame(system) if options.frame is None else options.frame
    chain = frame_chain(system, name, options.locked)
    first = np.array(system.position(options.start))
    every = steps_or_all(chain, options.method)
    return write_fmu(
        _model(chain, every, first), options.path, fmi=options.fmi, platforms=options.platforms
    )


def _model(chain: FrameChain, every: StepSequence | Function, start: np.ndarray) -> FmuModel:
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
        FmuState(
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
    certain = FmuVariable(
        name="certain",
        description="0 where a configuration may be missing: next to a singular one, or no pose",
    )
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
        outputs=(*shown, valid, *([certain] if isinstance(every, Function) else [])),
        parameters=(*own, memory),
        rhs=_rhs(chain, every),
        documentation=system.source,
        about=about(system),
    )


def _rhs(chain: FrameChain, every: StepSequence | Function) -> Function:
    """Return ``rhs(t, x, z, u, p) -> xdot, y``. y: the solution nearest to x, and its validity."""
    n, system = len(chain.names), chain.system
    kind: Any = MX if isinstance(every, Function) else SX
    t, z, x = kind.sym("t"), kind.sym("z", 0), kind.sym("x", n)
    u, p, memory = kind.sym("u", 12), kind.sym("p", system.p.numel()), kind.sym("memory")
    T = casadi.vertcat(casadi.horzcat(_rotation(u[3:]), u[:3]), kind(DM([[0, 0, 0, 1]])))
    columns: list[tuple[Any, Any]]
    seen: list[MX] = []
    if isinstance(every, Function):
        columns, seen = _of_general(chain, every, T, x)
    else:
        columns = _of_closed_form(chain, every, T, p)
    turning = 2 * math.pi * DM([not prismatic for prismatic in chain.prismatic])
    nearest, least = x, kind(_HOPELESS)
    for q, holds in columns:
        apart = q - x
        apart = apart - turning * casadi.floor(apart / (2 * math.pi) + 0.5)
        away = casadi.sumsqr(apart) + casadi.if_else(holds, 0, _HOPELESS)
        closer = away < least
        nearest = casadi.if_else(closer, x + apart, nearest)
        least = casadi.if_else(closer, away, least)
    y = casadi.vertcat(nearest, least < _HOPELESS, *seen)
    every_p = casadi.vertcat(p, memory)
    return Function("rhs", [t, x, z, u, every_p], [(nearest - x) / memory, y])


def _of_closed_form(chain: FrameChain, sequence: StepSequence, T: SX, p: SX) -> list[tuple[SX, SX]]:
    """Return the joint positions of every branch of a closed form, and whether it is valid."""
    system = chain.system
    given = [T, p] if system.parameters else [T]
    q, residual, real, _, _ = all_branches(chain, sequence).call(given)
    scale = casadi.fmax(1.0, casadi.substitute(size(chain), system.p, p))
    holds = casadi.logic_and(residual <= _MISSED * scale, real >= -_MISSED)
    return [(q[:, b], holds[b]) for b in range(q.size2())]


def _of_general(
    chain: FrameChain, every: Function, T: MX, x: MX
) -> tuple[list[tuple[MX, MX]], list[MX]]:
    """Return positions and validity of every solution of the general method, and `certain`."""
    q, valid, _, certain = every.call([T])
    columns = [
        # replace NaN of invalid solutions, which would spoil derivatives of sums
        (casadi.if_else(valid[b], q[list(chain.indices), b], x), valid[b])
        for b in range(q.size2())
    ]
    return columns, [certain]


def _rotation(rows: Any) -> Any:
    """Orthonormalise nine elements by rows, such as interpolated inputs. Returns (3, 3)."""
    R = casadi.reshape(rows, 3, 3).T
    first = R[:, 0] / casadi.norm_2(R[:, 0])
    second = R[:, 1] - first * casadi.dot(first, R[:, 1])
    second = second / casadi.norm_2(second)
    return casadi.horzcat(first, second, casadi.cross(first, second))
