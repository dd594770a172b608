"""Selection of the closed form of a loop: the first kernel that finds some of its joints."""

from __future__ import annotations

from collections.abc import Callable

from casadi import SX

from mbs.closed_forms.planar import along_normal, planar
from mbs.closed_forms.roots import LoopBranches
from mbs.closed_forms.spatial import (
    aim,
    at_distance,
    bennett,
    confine,
    free_body,
    orientation,
    prismatic,
    spherical,
    spin,
)
from mbs.closed_forms.split import split
from mbs.components.joints import Motion
from mbs.recursions.chain import Ring

_KERNELS: tuple[Callable[[Ring, SX, SX], LoopBranches | None], ...] = (
    free_body,
    spherical,
    spin,
    prismatic,
    planar,
    at_distance,
    aim,
    bennett,
    orientation,
    along_normal,
    confine,
)


def closed_form(ring: Ring, q: SX, p: SX) -> LoopBranches | str:
    """Return the branches of some unknown positions of a loop, from the first kernel that fits.

    A kernel is a solution method for one arrangement of joints. The other positions can be solved
    once these are known.

    Args:
        ring: loop chain.
        q: symbols of positions, cut joints included.
        p: (np, 1) symbols of parameters.

    Returns:
        Branches, or text that describes why no kernel fits.
    """
    if any(joint.motion is Motion.FREE for joint in ring.joints) and len(ring.joints) > 1:
        return "a free body is in it"
    for kernel in _KERNELS:
        root = kernel(ring, q, p)
        if root is not None and any(root.branches.values()):
            return root
    found = split(ring, q, p)
    if isinstance(found, LoopBranches):
        return found
    unknown = ", ".join(joint.name for joint in ring.joints)
    count = len(ring.joints)
    return f"{count} positions are unknown ({unknown}) and no kernel fits their axes: {found}"
