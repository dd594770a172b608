"""Models of big open trees by one C core, for which a mechanism is a table of numbers."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import casadi
import numpy as np
from casadi import SX, Function

from mbs.assembly import System
from mbs.assembly.model_function import ModelFunction, default_in, require_system
from mbs.assembly.tree import Link
from mbs.components.joints import Motion
from mbs.errors import ModelError
from mbs.native import compiled
from mbs.native.array_calls import with_array_calls
from mbs.native.tree_core import (
    ROWS,
    TreeTable,
    dependent_numbers,
    place_of,
    tree_functions,
    tree_library,
)
from mbs.spatial import elements


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
    ddm once with respect to q, v and a or tau. With respect to parameters it gets NaN.
    Quaternions are brought to unit length first.

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
        _require_known(system)
        table, default = _table(system), default_in(system, 1)[1:]
        return CoreLibrary(
            tree_library(table, len(system.parameters), default),
            tree_functions(table, len(system.parameters), default),
        )

    library: CoreLibrary = system.cached("tree core library", build)
    return library


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


def _require_known(system: System) -> None:
    if system.is_closed:
        raise ModelError(
            f"{system.name}: tree_core is for open trees and this system has loops or couplings;"
            " use mbs.models.inverse_dynamics and direct_dynamics"
        )
    if not system.nv:
        raise ModelError(f"{system.name}: nothing moves, so that tree_core has no models of it")
    for part in system.parts:
        element = part.element
        if not element.drives and (element.acts or element.binds or element.switches):
            raise ModelError(
                f"{system.name}: component {part.name} ({type(element).__name__}) has equations of"
                " its own, which tree_core does not know; use mbs.models.inverse_dynamics and"
                " direct_dynamics"
            )
    for j, link in enumerate(system.tree.links):
        if link.rotor is not None and link.rotor.carrier not in (j, link.antecedent, -1):
            raise ModelError(
                f"{system.name}: the rotor of {link.name} is on neither of the links of the joint,"
                " which tree_core does not know; use mbs.models.inverse_dynamics"
            )


# The table of a tree: its links depth-first, a node for every velocity.


def _depth_first(links: Sequence[Link]) -> list[int]:
    """The links in an order in which every subtree follows its joint without a gap."""
    behind: list[list[int]] = [[] for _ in links]
    waiting: list[int] = []
    for j, link in enumerate(links):
        (behind[link.antecedent] if link.antecedent >= 0 else waiting).append(j)
    order: list[int] = []
    waiting.reverse()
    while waiting:
        j = waiting.pop()
        order.append(j)
        waiting += reversed(behind[j])
    return order


def _table(system: System) -> TreeTable:
    links = system.tree.links
    order = _depth_first(links)
    lists = _lists(links, order)
    numbers = [0.0] * place_of(0, -(-system.nv // 8) * 8) + [0.0] * 3
    dependent: dict[int, SX] = {}

    def put(at: int, value: SX) -> None:
        if value.is_constant():
            numbers[at] = float(value)
        else:
            numbers[at], dependent[at] = float("nan"), value

    last = 0
    for j in order:
        link = links[j]
        first, last = last, last + link.motion.nv
        _put_link(lambda row, node, value: put(place_of(row, node), value), link, j, first)
    for k, value in enumerate(elements(system.tree.gravity)):
        put(len(numbers) - 3 + k, value)
    return TreeTable(
        size=system.nv,
        positions=system.nq,
        lists=lists,
        numbers=numbers,
        places=list(dependent),
        dependent=dependent_numbers(list(dependent.values()), system.p) if dependent else None,
    )


_ONE = SX(1)
_UPPER = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))


def _put_link(put: Callable[[int, int, SX], None], link: Link, j: int, first: int) -> None:
    """The numbers of the nodes of a link, the first of which is given."""
    last, rotor = first + link.motion.nv - 1, link.rotor
    pose, body = link.pose(), link.inertia
    tensor = casadi.vertcat(*(body.J[r, c] for r, c in _UPPER))
    fixed = (("C", pose.R), ("T", pose.p), ("mass", body.m), ("h", body.ms), ("J", tensor))
    for name, value in fixed:
        for k, element in enumerate(elements(SX(value))):
            put(ROWS[name] + k, last, element)
    # what a joint itself needs, the same for all of its velocities
    each = {name: getattr(link, name) for name in ("Ia", "Fv", "stiffness", "rest", "Fs")}
    each["width"] = link.Fs_width
    if rotor is not None:
        each["Ia"] = link.Ia + rotor.seen_at_joint
    each |= {name: _ONE for name, motion in _KINDS.items() if link.motion is motion}
    if link.antecedent >= 0:
        each["inner"] = _ONE
    for node in range(first, last + 1):
        for name, value in each.items():
            put(ROWS[name], node, value)
    if rotor is not None and rotor.carrier >= 0:
        for k, element in enumerate(elements(rotor.momentum)):
            put(ROWS["spin"] + k, first, element)
        put(ROWS["own"], first, SX(int(rotor.carrier == j)))


_KINDS = {"turn": Motion.REVOLUTE, "slide": Motion.PRISMATIC}


_KIND = {Motion.REVOLUTE: 0, Motion.PRISMATIC: 1, Motion.SPHERICAL: 2, Motion.FREE: 2}
"""The kind of the first motion about an axis, as tree_core.h counts; the slides of free joints come
first, and are counted last."""


def _lists(links: Sequence[Link], order: Sequence[int]) -> dict[str, list[int]]:
    """The indices of the nodes of a tree."""
    names = ("before", "link", "end", "first", "last", "kind", "q_at", "v_at", "runs_from", "runs")
    result: dict[str, list[int]] = {name: [] for name in (*names, "joints", "rotor", "rub")}
    first, last = dict[int, int](), {-1: -1}
    ancestry: dict[int, list[int]] = {-1: []}
    size = 0
    for j in order:
        link, count = links[j], links[j].motion.nv
        i = link.antecedent
        first[j], last[j] = size, size + count - 1
        ancestry[j] = _extended(ancestry[i], size, size + count)
        for h in range(count):
            result["before"].append(size - 1 if h else last[i])
            result["link"].append(last[i])
            result["first"].append(first[j])
            result["last"].append(last[j])
            result["kind"].append(_KIND[link.motion] + (h + 3) % count)
            result["q_at"].append(link.q.start if count == 1 else -1)
            result["v_at"].append(link.v.start + h)
            result["runs_from"].append(len(result["runs"]) // 2)
            result["runs"] += ancestry[i]
            if not link.Fs.is_zero():
                result["rub"].append(size)
            size += 1
        if count > 1:
            result["joints"] += [first[j], count, link.q.start]
        if link.rotor is not None and link.rotor.carrier >= 0:
            result["rotor"] += [first[j], last[link.rotor.carrier]]
    result["runs_from"].append(len(result["runs"]) // 2)
    end = dict(last)
    for j in reversed(order):
        i = links[j].antecedent
        if i >= 0:
            end[i] = max(end[i], end[j])
    before = result["before"]
    ahead = {b for k, b in enumerate(before) if b != k - 1}
    result["fork"] = [int(k in ahead) for k in range(size)]
    result["end"] = [end[j] + 1 for j in order for _ in range(links[j].motion.nv)]
    return result


def _extended(runs: list[int], first: int, end: int) -> list[int]:
    """Runs of nodes with another one behind them."""
    if runs and runs[-1] == first:
        return [*runs[:-1], end]
    return [*runs, first, end]


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
