"""Numeric table of an open tree, for compiled models that loop over links instead of equations."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import casadi
from casadi import SX, Function

from mbs.assembly import System
from mbs.assembly.model_function import default_in
from mbs.assembly.tree import Link, quaternion_slices
from mbs.components.joints import Motion
from mbs.native.kernel import LoopCode
from mbs.native.tree_core import (
    COMMON,
    ROWS,
    TreeTable,
    dependent_numbers,
    place_of,
    tree_files,
    tree_functions,
)
from mbs.spatial import elements


def unknown_to_core(system: System) -> str:
    """Return the reason why `tree_core` does not support a system, as error text; else empty."""
    if system.is_closed:
        return (
            "tree_core is for open trees and this system has loops or couplings;"
            " use mbs.models.inverse_dynamics and direct_dynamics"
        )
    if not system.nv:
        return "nothing moves, so that tree_core has no models of it"
    for part in system.parts:
        element = part.element
        if not element.drives and (element.acts or element.binds or element.switches):
            return (
                f"component {part.name} ({type(element).__name__}) has equations of"
                " its own, which tree_core does not know; use mbs.models.inverse_dynamics and"
                " direct_dynamics"
            )
    for j, link in enumerate(system.tree.links):
        if link.backward:
            return (
                f"joint {link.name} connects its frame_b to the side of the base, which tree_core"
                " does not know; exchange its frames, or use mbs.models.inverse_dynamics and"
                " direct_dynamics"
            )
        if link.rotor is not None and link.rotor.carrier not in (j, link.antecedent, -1):
            return (
                f"the rotor of {link.name} is on neither of the links of the joint,"
                " which tree_core does not know; use mbs.models.inverse_dynamics"
            )
    return ""


# Selection of models whose compiled code loops over the links instead of expanded equations.


_LONGEST = {"inertia": 30, "idm_derivatives": 13, "ddm_derivatives": 16, "idm": 100}
"""Largest number of velocities on one branch, by model, for which expanded equations are faster
than loops: measured on chains (docs/speed.md). The longest branch counts, because vector lanes are
filled along branches."""

_LONGEST_OF_JACOBIAN = {"idm": 9, "ddm": 8}
"""Largest number of velocities on one branch for which expanded equations are faster for the
Jacobian with respect to q, v and a or tau: measured on chains."""

_MANY = 60_000
"""Number of operations of expanded equations above which loops are always used: such code compiles
for ten seconds and more, and exceeds the caches of a processor."""


@dataclass(frozen=True, slots=True)
class TreeLoops:
    """Loop code that `mbs.native.compiled` may use instead of the equations of a tree model.

    Attributes:
        system: open mechanism.
        name: name of the model in the tree core, such as "idm".
        normalises: whether the equations normalise quaternions first, as the tree core does.
    """

    system: System
    name: str
    normalises: bool = False

    def code(self, function: Function, derivatives: int) -> LoopCode | None:
        """Return C code with loops if it is faster than the equations, else None.

        None also for quaternion joints if the equations do not normalise quaternions: solvers that
        vary q freely leave unit norm, and there the values differ.

        Args:
            function: Function with the equations.
            derivatives: number of times that the compiled Function will be differentiated.
        """
        system, name = self.system, self.name
        other = bool(quaternion_slices(system.tree)) and not self.normalises
        if function.name() != name or other or unknown_to_core(system):
            return None
        longest = _longest_branch(system)
        many = function.n_instructions() > _MANY
        value = many or longest > _LONGEST.get(name, longest)
        first = name in _LONGEST_OF_JACOBIAN and derivatives > 0
        jacobian = first and (value or longest > _LONGEST_OF_JACOBIAN[name])
        if not (value or jacobian):
            return None
        table = table_of(system)
        shapes = shapes_of(system, table)
        if _port_sizes(shapes[name]) != _port_sizes(function):
            return None
        names = [name] * value + [f"jac_{name}"] * jacobian
        files = tree_files(table, {x: shapes[x] for x in names})
        return LoopCode(files, COMMON, value, jacobian, jacobian and table.dependent is not None)


def _port_sizes(function: Function) -> list[object]:
    """Return the names and sizes of the inputs and outputs of a Function."""
    return [
        *((function.name_in(k), function.size_in(k)) for k in range(function.n_in())),
        *((function.name_out(k), function.size_out(k)) for k in range(function.n_out())),
    ]


def _longest_branch(system: System) -> int:
    """Return the largest number of velocities on a path from the base to a leaf."""
    behind: list[int] = []
    for link in system.tree.links:
        before = behind[link.antecedent] if link.antecedent >= 0 else 0
        behind.append(before + link.motion.nv)
    return max(behind)


def shapes_of(system: System, table: TreeTable) -> dict[str, Function]:
    """Return placeholder Functions with the signatures of the tree core, by name.

    Args:
        system: open mechanism.
        table: table of its tree.
    """
    return tree_functions(table, len(system.parameters), default_in(system, 1)[1:])


# Table of a tree: links in depth-first order, one node per velocity.


def _depth_first(links: Sequence[Link]) -> list[int]:
    """Return link indices in depth-first order, so that each subtree is contiguous."""
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


def table_of(system: System) -> TreeTable:
    """Return the table of an open tree: index lists, numbers, parameter-dependent numbers.

    Args:
        system: open mechanism.
    """
    links = system.tree.links
    order = _depth_first(links)
    lists = _index_lists(links, order)
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
    """Write the data of link j to a table by calls `put(row, node, value)`.

    `first` is its first node; each velocity is a node.
    """
    last, rotor = first + link.motion.nv - 1, link.rotor
    pose, body = link.pose(), link.inertia
    tensor = casadi.vertcat(*(body.J[r, c] for r, c in _UPPER))
    fixed = (("C", pose.R), ("T", pose.p), ("mass", body.m), ("h", body.ms), ("J", tensor))
    for name, value in fixed:
        for k, element in enumerate(elements(SX(value))):
            put(ROWS[name] + k, last, element)
    # data of the joint, equal for all of its velocities
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
"""Code in tree_core.h of the first rotation of a joint. The translations of a free joint are its
first velocities but have the last codes."""


def _index_lists(links: Sequence[Link], order: Sequence[int]) -> dict[str, list[int]]:
    """Return the index lists of the nodes of a tree by name, as declared in tree_core.h.

    `order` has the link indices in depth-first order.
    """
    names = ("before", "link", "end", "first", "last", "kind", "q_at", "v_at", "runs_from", "runs")
    result: dict[str, list[int]] = {name: [] for name in (*names, "joints", "rotor", "rub")}
    first, last = dict[int, int](), {-1: -1}
    ancestry: dict[int, list[int]] = {-1: []}
    size = 0
    for j in order:
        link, count = links[j], links[j].motion.nv
        i = link.antecedent
        first[j], last[j] = size, size + count - 1
        ancestry[j] = _with_run(ancestry[i], size, size + count)
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


def _with_run(runs: list[int], first: int, end: int) -> list[int]:
    """Return a flat list of runs with the run of nodes [first, end) appended.

    Adjacent ones merge.
    """
    if runs and runs[-1] == first:
        return [*runs[:-1], end]
    return [*runs, first, end]
