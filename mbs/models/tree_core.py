"""Models of big open trees by one C core, for which a mechanism is a table of numbers."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import casadi
import numpy as np
from casadi import SX, Function

from mbs.assembly import System
from mbs.assembly.model_function import ModelFunction, require_system
from mbs.assembly.tree import Link, quaternion_slices
from mbs.components.joints import Motion
from mbs.errors import ModelError
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
    """The models of an open tree as machine code that loops over its links.

    Each is a casadi.Function with the inputs and outputs of the builder of its name. Called with
    numpy arrays it returns numpy arrays, as `mbs.native.compiled` does.

    Attributes:
        idm: as `inverse_dynamics`.
        inertia_matrix: as `inertia_matrix`.
        ddm: as `direct_dynamics`.
        idm_derivatives: as `inverse_dynamics_derivatives`.
        ddm_derivatives: as `direct_dynamics_derivatives`.
    """

    idm: Function
    inertia_matrix: Function
    ddm: Function
    idm_derivatives: Function
    ddm_derivatives: Function


def tree_core(system: System) -> TreeCore:
    """The five dynamic models of an open tree, of any size, without equations written out.

    Args:
        system: an open tree.

    Raises:
        ModelError: the system has loops, or components with equations of their own.
        CompilerError: there is no compiler, or it refused the code.
    """
    require_system(system)
    names = ("idm", "inertia", "ddm", "idm_derivatives", "ddm_derivatives")
    return TreeCore(*(core_function(system, name) for name in names))


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
        table, parameters = _table(system), len(system.parameters)
        path = tree_library(table, parameters)
        return CoreLibrary(path, tree_functions(table, parameters))

    library: CoreLibrary = system.cached("tree core library", build)
    return library


def core_function(system: System, name: str) -> Function:
    """One function of the core: "idm", "inertia" and so on."""

    def build() -> Function:
        path = core_library(system).path
        code = casadi.external(name, str(path))
        result: Any = with_array_calls(code, path, ModelFunction(code, system).like)
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
        if not element.drives and (element.acts or element.binds):
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


def _put_link(put: Any, link: Link, j: int, first: int) -> None:
    """The numbers of the nodes of a link, the first of which is given."""
    last = first + link.motion.nv - 1
    pose, body = link.pose(), link.inertia
    for row, value in (("C", pose.R), ("T", pose.p), ("h", body.ms), ("mass", body.m)):
        for k, element in enumerate(elements(SX(value))):
            put(ROWS[row] + k, last, element)
    for k, (row, column) in enumerate(((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))):
        put(ROWS["J"] + k, last, body.J[row, column])
    put(ROWS["first"], first, _ONE)
    rotor = link.rotor
    for node in range(first, last + 1):
        if link.motion is Motion.REVOLUTE:
            put(ROWS["turn"], node, _ONE)
        if link.motion is Motion.PRISMATIC:
            put(ROWS["slide"], node, _ONE)
        if link.antecedent >= 0:
            put(ROWS["inner"], node, _ONE)
        put(ROWS["Ia"], node, link.Ia if rotor is None else link.Ia + rotor.seen_at_joint)
        for name in ("Fv", "stiffness", "rest", "Fs"):
            put(ROWS[name], node, getattr(link, name))
        put(ROWS["width"], node, link.Fs_width)
    if rotor is not None and rotor.carrier >= 0:
        for k, element in enumerate(elements(rotor.momentum)):
            put(ROWS["spin"] + k, first, element)
        if rotor.carrier == j:
            put(ROWS["own"], first, _ONE)


def _lists(links: Sequence[Link], order: Sequence[int]) -> dict[str, list[int]]:
    """The indices of the nodes of a tree."""
    names = ("before", "link", "end", "first", "q_at", "v_at", "runs_from", "runs")
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


def require_core_inertia(system: System) -> None:
    """Refuse a tree in which some velocity moves no inertia; as `require_inertia`, by the core.

    Raises:
        ModelError: which velocity, and what to give mass to.
    """

    def check() -> bool:
        if any(p.default is None for p in system.parameters):
            return True
        rng = np.random.default_rng(_SEED)
        q = np.array(system.configuration) + rng.uniform(-1.0, 1.0, system.nq)
        for part in quaternion_slices(system.tree):
            q[part] /= np.linalg.norm(q[part])
        p = [np.array(system.p_default)] if system.parameters else []
        free, locked = core_function(system, "pivots")(q, *p)
        moves = np.abs(free) > _VANISHING * np.maximum(np.abs(locked), _NO_INERTIA)
        if not moves.all():
            name = system.speeds[int(np.max(np.flatnonzero(~moves)))].name
            raise ModelError(
                f"{system.name}: {name} can move without moving any inertia, so its acceleration"
                " is not determined; give mass to what it carries, or a rotor inertia Ia"
            )
        return True

    system.cached("core has inertia", check)
