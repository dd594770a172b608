"""The price of a result, by which one of several ways to it is chosen."""

from __future__ import annotations

from collections.abc import Collection

import casadi
from casadi import SX, Function

from mbs.assembly.tree import Tree
from mbs.components.motion import Motion
from mbs.operations import count
from mbs.recursions.poses import LinkPose
from mbs.spatial import vector


def cost(value: SX, q: SX, p: SX) -> int:
    """The price of a matrix; see `mbs.operations.counts.Count.price`.

    Args:
        value: of the symbols q and p.
        q: (nq, 1) positions.
        p: (np, 1) parameters; operations on them alone are free.
    """
    names = ["q", "p"], ["value"]
    f = Function("f", [q, p], [casadi.densify(value)], *names, {"cse": True})
    return count(f).price


def price(value: SX, parameters: Collection[int]) -> int:
    """The price of a matrix of any symbols, operations on parameters alone being free.

    Args:
        value: the matrix.
        parameters: hashes of their symbols; see `parameters_of`.
    """
    symbols = casadi.symvar(value)
    kinds: tuple[list[SX], list[SX]] = ([], [])
    for symbol in symbols:
        kinds[symbol.element_hash() in parameters].append(symbol)
    return cost(value, casadi.vertcat(SX(0, 1), *kinds[0]), casadi.vertcat(SX(0, 1), *kinds[1]))


def parameters_of(tree: Tree, poses: list[LinkPose]) -> frozenset[int]:
    """Hashes of the symbols that the constants of a tree hold."""
    constants = [tree.gravity]
    for link, pose in zip(tree.links, poses, strict=True):
        constants += [link.inertia.parameters, pose.foot, pose.at_seat(vector([1, 1, 1]))]
        if link.motion is Motion.REVOLUTE:
            constants.append(pose.height)
    symbols = casadi.symvar(casadi.vertcat(*map(casadi.vec, constants)))
    return frozenset(symbol.element_hash() for symbol in symbols)
