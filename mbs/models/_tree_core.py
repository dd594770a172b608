"""Models of large open trees by one C library that interprets a numeric table of the mechanism."""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import casadi
from casadi import Function

from mbs.assembly import System
from mbs.assembly.model_function import ModelFunction, require_system
from mbs.assembly.tree import normalised
from mbs.errors import ModelError
from mbs.models._direct_dynamics import direct_dynamics, velocity_without_inertia
from mbs.models._inverse_dynamics import inverse_dynamics
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
    """Dynamic models of an open tree as compiled code that loops over its links.

    Each model is a casadi.Function with the inputs and outputs of the corresponding function of
    `mbs.models`. Called with numpy arrays it returns numpy arrays, as `mbs.native.compiled` does.

    Attributes:
        system: open mechanism.
    """

    system: System

    @property
    def idm(self) -> Function:
        """Inverse dynamics ``idm(q, v, a) -> tau``; see `inverse_dynamics`."""
        return core_function(self.system, "idm")

    @property
    def inertia_matrix(self) -> Function:
        """Inertia matrix (mass matrix) ``inertia(q) -> A``, not differentiable.

        See `inertia_matrix`.
        """
        return core_function(self.system, "inertia")

    @property
    def ddm(self) -> Function:
        """Forward dynamics ``ddm(q, v, tau) -> a``; see `direct_dynamics`."""
        return core_function(self.system, "ddm")

    @property
    def idm_derivatives(self) -> Function:
        """``idm_derivatives(q, v, a) -> dtau_dq, dtau_dv, dtau_da, tau``, not differentiable.

        These are derivatives of inverse dynamics, see `inverse_dynamics_derivatives`.
        """
        return core_function(self.system, "idm_derivatives")

    @property
    def ddm_derivatives(self) -> Function:
        """``ddm_derivatives(q, v, tau) -> da_dq, da_dv, da_dtau, a``, not differentiable.

        These are derivatives of forward dynamics, see `direct_dynamics_derivatives`.
        """
        return core_function(self.system, "ddm_derivatives")


def tree_core(system: System) -> TreeCore:
    """Return five compiled dynamic models of an open tree of any size, without symbolic equations.

    One C library, compiled once and cached, loops over the links. The mechanism is a numeric table;
    a short Function computes its parameter-dependent entries at every call. Rotors, friction and
    springs of the joints are included. CasADi can differentiate idm and ddm once, by derivative
    code of the library. Derivatives with respect to parameters use symbolic equations, built at the
    first request. Quaternions are normalised first.

    Source: Khalil & Creusot 1997, eq. 15-20; Walker & Orin 1982; Featherstone 1983; Singh, Russell
    & Wensing 2022; Carpentier & Mansard 2018.

    Args:
        system: open tree of revolute, prismatic, spherical and free joints.

    Raises:
        ModelError: the system has loops, components with their own equations, a joint whose frame_b
            is on the side of the base, or a rotor on a third link. Access to `ddm` and
            `ddm_derivatives` raises it if a joint moves no inertia.
        CompilerError: there is no compiler, or the compilation fails.
    """
    require_system(system)
    core_library(system)
    return TreeCore(system)


@dataclass(frozen=True, slots=True, eq=False)
class CoreLibrary:
    """Compiled code of a tree.

    Attributes:
        path: path of the shared library; its functions have CasADi's calling convention.
        shapes: placeholder Functions with the signatures of these functions, by name.
    """

    path: Path
    shapes: Mapping[str, Function]


def core_library(system: System) -> CoreLibrary:
    """Return the library of all models of a tree, compiled or from the cache.

    Args:
        system: open mechanism.

    Raises:
        ModelError: the tree core does not support the system.
    """

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
    """Return C source whose parameter derivatives are built from equations at their first call.

    The source works only in the current process.

    Args:
        system: open mechanism; it is kept in memory until the process ends, as is the library.
        files: C sources of its core; their hash identifies the request.
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
    """Return a function of the compiled library by its name in C, such as "idm".

    Args:
        system: open mechanism.
        name: key of `CoreLibrary.shapes`.

    Raises:
        ModelError: the name starts with "ddm", and a joint moves no inertia.
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


# Detection of velocities that move no inertia.


def _require_inertia(system: System) -> None:
    """Raise ModelError if a velocity of the tree moves no inertia, as in `direct_dynamics`."""
    if any(p.default is None for p in system.parameters):
        return
    pivots = casadi.external("pivots", str(core_library(system).path))
    number = velocity_without_inertia(system, pivots)
    if number is not None:
        name = system.velocity_coordinates[number].name
        raise ModelError(
            f"{system.name}: {name} can move without moving any inertia, so its acceleration"
            " is not determined; give mass to what it carries, or a rotor inertia Ia"
        )
