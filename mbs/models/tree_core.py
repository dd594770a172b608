"""Models of big open trees by one C core, for which a mechanism is a table of numbers."""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import casadi
import numpy as np
from casadi import Function

from mbs.assembly import System
from mbs.assembly.model_function import ModelFunction, require_system
from mbs.assembly.tree import normalised
from mbs.errors import ModelError
from mbs.models.direct_dynamics import direct_dynamics
from mbs.models.inverse_dynamics import inverse_dynamics
from mbs.models.tree_table import shapes_of, table_of, unknown_to_core
from mbs.native import compiled
from mbs.native.array_calls import with_array_calls
from mbs.native.compiler import cache_dir, cached_library
from mbs.native.derivatives_on_demand import (
    Derivative,
    DerivativeSource,
    by_parameters,
    promise,
    source,
)
from mbs.native.kernel import FAST_FLAGS
from mbs.native.tree_core import COMMON, tree_files


@dataclass(frozen=True, slots=True, eq=False)
class TreeCore:
    """The dynamic models of an open tree as machine code that loops over its links.

    Each is a casadi.Function with the inputs and outputs of the builder of its name. Called with
    numpy arrays it returns numpy arrays, as `mbs.native.compiled` does.

    Attributes:
        system: the tree.
    """

    system: System

    @property
    def idm(self) -> Function:
        """``idm(q, v, a) -> tau``; see `inverse_dynamics`."""
        return core_function(self.system, "idm")

    @property
    def inertia_matrix(self) -> Function:
        """``inertia(q) -> A``; see `inertia_matrix`. It cannot be differentiated."""
        return core_function(self.system, "inertia")

    @property
    def ddm(self) -> Function:
        """``ddm(q, v, tau) -> a``; see `direct_dynamics`."""
        return core_function(self.system, "ddm")

    @property
    def idm_derivatives(self) -> Function:
        """``idm_derivatives(q, v, a) -> dtau_dq, dtau_dv, dtau_da, tau``.

        See `inverse_dynamics_derivatives`. It cannot be differentiated.
        """
        return core_function(self.system, "idm_derivatives")

    @property
    def ddm_derivatives(self) -> Function:
        """``ddm_derivatives(q, v, tau) -> da_dq, da_dv, da_dtau, a``.

        See `direct_dynamics_derivatives`. It cannot be differentiated.
        """
        return core_function(self.system, "ddm_derivatives")


def tree_core(system: System) -> TreeCore:
    """The five dynamic models of an open tree of any size, no equation written out.

    One C file, compiled once and kept, loops over the links; the mechanism is a table of numbers,
    which a short Function of the parameters completes at every call. Rotors, friction and springs
    of the joints are included. Derivatives are those of the core: CasADi differentiates idm and
    ddm once; with respect to parameters by the equations, which are built when that is first
    asked for. Quaternions are brought to unit length first.

    Source: Khalil & Creusot 1997, eq. 15-20; Walker & Orin 1982; Featherstone 1983; Singh, Russell
    & Wensing 2022; Carpentier & Mansard 2018.

    Args:
        system: an open tree of revolute, prismatic, spherical and free motions.

    Raises:
        ModelError: the system has loops, or components with equations of their own; or, of ddm, a
            joint moves no inertia.
        CompilerError: there is no compiler, or it refused the code.
    """
    require_system(system)
    core_library(system)
    return TreeCore(system)


@dataclass(frozen=True, slots=True, eq=False)
class CoreLibrary:
    """The machine code of a tree.

    Attributes:
        path: of the shared library, whose functions have CasADi's calling convention.
        shapes: by name, Functions that have their inputs and outputs, and no content.
    """

    path: Path
    shapes: Mapping[str, Function]


def core_library(system: System) -> CoreLibrary:
    """The library of all models of a tree."""

    def build() -> CoreLibrary:
        if unknown := unknown_to_core(system):
            raise ModelError(f"{system.name}: {unknown}")
        table = table_of(system)
        shapes = shapes_of(system, table)
        files = tree_files(table, shapes)
        if table.dependent is not None:
            files["derivatives.c"] = _by_parameters(system, files)
        return CoreLibrary(cached_library(files, FAST_FLAGS, common=COMMON), shapes)

    library: CoreLibrary = system.cached("tree core library", build)
    return library


_BY_PARAMETERS = [by_parameters(name) for name in ("idm", "ddm")]


def _by_parameters(system: System, files: Mapping[str, str]) -> str:
    """C text that makes the derivatives by parameters from the equations, in this process alone.

    Args:
        system: the tree, which is kept for it as the library is, to the end of the process.
        files: C text of its core, which the promise is known by.
    """
    digest = hashlib.sha256("\0".join(files.values()).encode()).hexdigest()
    record = cache_dir() / f"{digest[:40]}.promised"

    def equations(part: Derivative) -> Function:
        ddm = part == _BY_PARAMETERS[1]
        f = direct_dynamics(system) if ddm else inverse_dynamics(system)
        q, *others = f.sx_in()
        values = f.call([normalised(system.tree, q), *others])
        return Function(f.name(), [q, *others], values, f.name_in(), f.name_out())

    promise(record, DerivativeSource(equations, _BY_PARAMETERS, fast=True))
    return source(_BY_PARAMETERS, record)


def core_function(system: System, name: str) -> Function:
    """One function of the core by its name in C, such as "idm".

    Args:
        system: an open tree.
        name: one of `CoreLibrary.shapes`.
    """

    def build() -> Function:
        if name.startswith("ddm"):
            _require_inertia(system)
        path = core_library(system).path
        code = casadi.external(name, str(path))
        like, plain = ModelFunction(code, system).like, functools.partial(compiled, derivatives=0)
        result: Any = with_array_calls(code, path, like, plain)
        result._source = (functools.partial(core_function, name=name), (system,))
        return result  # type: ignore[no-any-return]

    function: Function = system.cached(("tree core", name), build)
    return function


# A velocity that moves no inertia.


_SEED = 20260103
_VANISHING = 1e-12
"""Inertia left, in parts of what it is with the links behind locked, that counts as none: rounding
of as many terms as there are links leaves 1e-15 of it."""
_NO_INERTIA = 1e-30
"""Stands for an inertia of zero where one divides [kg m^2 or kg]; no body has so little."""


def _require_inertia(system: System) -> None:
    """Refuse a tree in which some velocity moves no inertia, as `direct_dynamics` does."""
    if any(p.default is None for p in system.parameters):
        return
    pivots = casadi.external("pivots", str(core_library(system).path))
    rng = np.random.default_rng(_SEED)
    q = np.array(system.configuration) + rng.uniform(-1.0, 1.0, system.nq)
    p = [system.p_default] if system.parameters else []
    free, locked = (np.array(x).ravel() for x in pivots(q, *p))
    # The inertia of files may be negative: what counts is whether anything is there.
    moves = np.abs(free) > _VANISHING * np.maximum(np.abs(locked), _NO_INERTIA)
    if not moves.all():
        name = system.speeds[int(np.max(np.flatnonzero(~moves)))].name
        raise ModelError(
            f"{system.name}: {name} can move without moving any inertia, so its acceleration"
            " is not determined; give mass to what it carries, or a rotor inertia Ia"
        )
