"""Momentum and its rate as matrices times the inertial parameters, without joint accelerations.

The effort of a joint is the rate of the momentum along its axis, less what the turning of that
axis makes of it, and gravity: Gamma = d(D1 K)/dt + D2 K.

Source: Khalil & Restrepo 1996; Khalil & Creusot 1997, eq. 41-43.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import casadi
from casadi import SX

from mbs.assembly.tree import Tree
from mbs.recursions.poses import LinkPose
from mbs.recursions.regressor import Unit, axis, element, work
from mbs.recursions.regressor_sums import Elements, filled
from mbs.recursions.regressor_twists import (
    PathTwist,
    path_twist_rates,
    path_twists,
    seen_by_links,
)
from mbs.recursions.velocities import Velocity
from mbs.spatial import cross, is_zero, vector


def momentum_regressor(tree: Tree, poses: list[LinkPose], velocities: list[Velocity]) -> list[SX]:
    """For every link the matrix (nv, 10) of D1: the derivative of kinetic energy in v.

    Args:
        tree: the links.
        poses: each with respect to its antecedent.
        velocities: of the links; see `link_velocities`.
    """
    links: list[Elements] = []
    for velocity, twists in zip(velocities, path_twists(tree, poses), strict=True):
        units = unit_momenta(velocity)
        links.append({twist.row: partial(element, twist, units) for twist in twists})
    return filled(tree, poses, tree.nv, links)


def position_regressor(tree: Tree, poses: list[LinkPose], velocities: list[Velocity]) -> list[SX]:
    """For every link the matrix (nv, 10) of D2: less the derivative of E - U in the positions.

    Args:
        tree: the links.
        poses: each with respect to its antecedent.
        velocities: of the links; see `link_velocities`.
    """
    links: list[Elements] = []
    paths = path_twists(tree, poses)
    rates = path_twist_rates(tree, poses, velocities)
    ups = seen_by_links(tree, poses, -tree.gravity)
    level = _level_rows(tree, paths, ups)
    for j, velocity in enumerate(velocities):
        units, lifts = unit_momenta(velocity), unit_lifts(ups[j])
        rows: dict[int, Callable[[int], SX]] = {}
        for twist, rate in zip(paths[j], rates[j], strict=True):
            raising = None if twist.row in level else twist
            rows[twist.row] = partial(_element, raising, rate, lifts, units)
        links.append(rows)
    return filled(tree, poses, tree.nv, links)


def _level_rows(tree: Tree, paths: list[list[PathTwist]], ups: list[SX]) -> set[int]:
    """Velocities that raise nothing: turns about vertical axes and level slides."""
    own = [
        (twist, ups[j])
        for j, link in enumerate(tree.links)
        for twist in paths[j]
        if link.v.start <= twist.row < link.v.stop
    ]
    return {t.row for t, up in own if is_zero(cross(t.n, up)) and casadi.dot(t.t, up).is_zero()}


def unit_momenta(velocity: Velocity) -> list[Unit]:
    """Momenta of a link of which one inertial parameter is one, in their order."""
    V, w = velocity.V, velocity.w
    turning = (
        (w[0], 0, 0),
        (w[1], w[0], 0),
        (w[2], 0, w[0]),
        (0, w[1], 0),
        (0, w[2], w[1]),
        (0, 0, w[2]),
    )
    inertias: list[Unit] = [(None, vector(angular)) for angular in turning]
    firsts: list[Unit] = [(cross(w, axis(k)), cross(axis(k), V)) for k in range(3)]
    return [*inertias, *firsts, (V, None)]


def unit_lifts(up: SX) -> list[Unit]:
    """The wrenches that hold such a link against gravity, whose opposite is `up`, (3, 1)."""
    nothing: Unit = (None, None)
    return [nothing] * 6 + [(None, cross(axis(k), up)) for k in range(3)] + [(up, None)]


def _element(
    twist: PathTwist | None, rate: PathTwist, lifts: list[Unit], units: list[Unit], k: int
) -> SX:
    lifted = SX(0) if twist is None else work(twist, lifts[k])
    return lifted - work(rate, units[k])
