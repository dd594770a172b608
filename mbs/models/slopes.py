"""Slopes of efforts and accelerations, by every method there is.

Source: Carpentier & Mansard 2018; Singh, Russell & Wensing 2022.
"""

from __future__ import annotations

from collections.abc import Collection
from itertools import accumulate

import casadi
from casadi import SX

from mbs.assembly import System
from mbs.assembly.rates import position_rate
from mbs.models.composition import outputs_of
from mbs.models.direct_dynamics import independent_dynamics
from mbs.models.inverse_dynamics import tree_efforts
from mbs.models.surroundings import surroundings
from mbs.models.symbols import ModelSymbols, solution_order
from mbs.recursions.accelerations import resting_base
from mbs.recursions.composite_body import inertia_matrix as tree_inertia
from mbs.recursions.force_elements import element_efforts
from mbs.recursions.joint_efforts import joint_efforts
from mbs.recursions.newton_euler_derivatives import newton_euler_derivatives
from mbs.recursions.tree_factorization import TreeFactor, factorized, substituted

Blocks = dict[str, SX]
"""Derivatives by the name of the input that they are taken with respect to."""


def efforts_by_ad(system: System, s: ModelSymbols, a: SX) -> tuple[Blocks, SX]:
    """Derivatives of the efforts by differentiating the recursion, and the efforts."""
    tau = s.reduced_effort(tree_efforts(system, s, s.tree_acceleration(a), surroundings(system)))
    blocks = {
        "q": _along_motion(system, s, tau),
        "v": casadi.jacobian(tau, s.v),
        "a": s.reduced_matrix(tree_inertia(system.tree, s.poses)),
    }
    return blocks, tau


def efforts_by_recursion(system: System, s: ModelSymbols, a: SX) -> tuple[Blocks, SX]:
    """The same by recursions of the derivatives, for trees."""
    tree = system.tree
    moving = newton_euler_derivatives(tree, s.poses, s.v, a, resting_base(tree.gravity))
    acting = element_efforts(tree, system.forces, s.poses, s.q, s.v)
    joints = joint_efforts(tree, s.q, s.v, a) + acting
    blocks = {
        "q": moving.dq + _along_motion(system, s, joints),
        "v": moving.dv + casadi.jacobian(joints, s.v),
        "a": moving.A + casadi.jacobian(joints, a),
    }
    return blocks, moving.efforts + joints


def implicit_formula(
    system: System, s: ModelSymbols, tau: SX, names: Collection[str]
) -> tuple[TreeFactor, SX, Blocks]:
    """What the derivatives of the accelerations are solved from.

    Args:
        system: any.
        s: its symbols.
        tau: (m, 1) efforts.
        names: what to differentiate with respect to, of "q", "v" and "p".

    Returns:
        the factors of A, the accelerations, and for each name minus the derivative of the efforts
        at these accelerations.
    """
    before = solution_order(system, s)
    by = efforts_by_recursion if s.reduction is None else efforts_by_ad
    symbol = SX.sym("a", s.size)
    slopes, efforts = by(system, s, symbol)
    factor = factorized(slopes["a"], before)
    if "p" in names:
        slopes["p"] = casadi.jacobian(efforts, system.p)
    H = casadi.substitute(efforts, symbol, SX.zeros(s.size))
    a = substituted(factor, tau - H, before)
    minus = casadi.substitute([-SX(slopes[name]) for name in names], [symbol], [a])
    return factor, a, dict(zip(names, map(casadi.densify, minus), strict=True))


def accelerations_by_efforts(
    system: System, s: ModelSymbols, tau: SX, names: tuple[str, ...]
) -> tuple[Blocks, SX]:
    """Derivatives of the accelerations from those of the efforts, and the accelerations."""
    wanted = [name for name in names if name != "tau"]
    factor, a, right = implicit_formula(system, s, tau, wanted)
    sides = [*right.values(), casadi.densify(SX.eye(s.size))]
    ends = [0, *accumulate(side.shape[1] for side in sides)]
    every = substituted(factor, casadi.horzcat(*sides), solution_order(system, s))
    *solved, inverse = casadi.horzsplit(every, ends)
    blocks = dict(zip(wanted, solved, strict=True))
    return {**blocks, "tau": casadi.triu2symm(casadi.triu(inverse))}, a


def accelerations_by_ad(
    system: System, s: ModelSymbols, tau: SX, names: tuple[str, ...]
) -> tuple[Blocks, SX]:
    """The same by differentiating the direct model."""
    a = outputs_of(system, independent_dynamics(system), s.q, s.v, tau)[0]
    blocks = {
        "q": _along_motion(system, s, a),
        "v": casadi.jacobian(a, s.v),
        "tau": casadi.jacobian(a, tau),
    }
    if "p" in names:
        blocks["p"] = casadi.jacobian(a, system.p)
    return blocks, a


def _along_motion(system: System, s: ModelSymbols, value: SX) -> SX:
    """Derivative of a value when the positions move with unit velocities."""
    slope = casadi.jacobian(value, s.q)
    if system.nq != system.nv:
        u = SX.sym("u", system.nv)
        rate = casadi.jacobian(position_rate(system.tree, s.q, u), u)
        slope = casadi.mtimes(slope, rate)
    return slope if s.reduction is None else casadi.mtimes(slope, s.reduction.G)
