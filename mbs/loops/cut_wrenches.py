"""The wrenches of cut joints: what the efforts of their closure rows are between two bodies.

A small displacement of frame_b that the tree does not make, by x and by the turn y in its own axes,
opens the rows by d phi; the rows do the work lam' d phi = F' x + M' y, whatever they are made of.

Source: Haug 1989, for reactions from the efforts of rows.
"""

from __future__ import annotations

from dataclasses import replace

import casadi
from casadi import DM, SX

from mbs.assembly import System
from mbs.loops.closure import closure_rows
from mbs.loops.rolling import contact, pose_on_plane, radius_of, rolling_discs
from mbs.recursions.route import relative_pose
from mbs.recursions.transmitted import summed
from mbs.spatial import Pose, Wrench, add_wrenches, carried, cross, skew, vector


def cut_wrenches(system: System, q: SX, lam: SX) -> dict[str, Wrench]:
    """For every cut joint the wrench on the body of frame_b, about and in frame_b.

    Args:
        system: with closed loops.
        q: (nq, 1) symbols of positions that close the loops.
        lam: (m, 1) efforts of all rows, those of rolling discs last.
    """
    small = [SX.sym(cut.edge.joint.name, 6) for cut in system.cuts]
    moved = tuple(
        replace(cut, pose_b=cut.pose_b @ _displaced(d))
        for cut, d in zip(system.cuts, small, strict=True)
    )
    rows = closure_rows(replace(system, cuts=moved, _cache={}), q)
    positions = rows.numel()
    work = casadi.dot(lam[:positions], rows)
    every = casadi.vertcat(*small) if small else SX(0, 1)
    slopes = casadi.substitute(casadi.gradient(work, every), every, SX.zeros(every.numel()))
    parts = casadi.vertsplit(casadi.densify(slopes), 6) if small else []
    result = {
        cut.edge.joint.name: (part[:3], part[3:])
        for cut, part in zip(system.cuts, parts, strict=True)
    }
    for name, wrench in _against_slip(system, q, lam[positions:]).items():
        result[name] = add_wrenches(result[name], wrench)
    return result


def on_links(system: System, q: SX, wrenches: dict[str, Wrench]) -> dict[int, Wrench]:
    """For some links the wrench that they exert on cut joints, about and in their frames.

    Args:
        system: with closed loops.
        q: (nq, 1) positions.
        wrenches: as `cut_wrenches` gives them.
    """
    exerted: list[dict[int, Wrench]] = []
    for cut in system.cuts:
        for link, sign in ((cut.link_a, 1), (cut.link_b, -1)):
            if link >= 0:
                T = relative_pose(system.tree, q, (link, Pose.identity()), cut.frames[1])
                f, m = carried(T, wrenches[cut.edge.joint.name])
                exerted.append({link: (sign * f, sign * m)})
    return summed(*exerted)


def _displaced(d: SX) -> Pose:
    """A frame moved by d[:3] and turned by d[3:], both small."""
    return Pose(SX(DM.eye(3)) + skew(d[3:]), d[:3])


def _against_slip(system: System, q: SX, lam: SX) -> dict[str, Wrench]:
    """What the rows of rolling discs, which bind velocities alone, do to the disc."""
    result: dict[str, Wrench] = {}
    for number, (cut, disc) in enumerate(rolling_discs(system)):
        along = [lam[2 * number], lam[2 * number + 1]]
        pose = pose_on_plane(system, q, cut, disc)
        f = vector([*along, 0])
        m = cross(contact(pose, disc, radius_of(system, disc)).point, f)
        result[disc.name] = casadi.mtimes(pose.R.T, f), casadi.mtimes(pose.R.T, m)
    return result
