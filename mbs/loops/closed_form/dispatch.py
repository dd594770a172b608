"""The kernel for a loop: the first that finds some of its unknown joints."""

from __future__ import annotations

from collections.abc import Callable

from casadi import SX

from mbs.components.motion import Motion
from mbs.loops.closed_form.aim import aim
from mbs.loops.closed_form.ball import ball
from mbs.loops.closed_form.bennett import bennett
from mbs.loops.closed_form.confined import confined
from mbs.loops.closed_form.distance import at_distance
from mbs.loops.closed_form.free_body import free_body
from mbs.loops.closed_form.normal import along_normal
from mbs.loops.closed_form.orientation import orientation
from mbs.loops.closed_form.planar import planar
from mbs.loops.closed_form.ring import Ring
from mbs.loops.closed_form.root import Root
from mbs.loops.closed_form.slides import slides
from mbs.loops.closed_form.spin import spin
from mbs.loops.closed_form.split import split

_KERNELS: tuple[Callable[[Ring, SX, SX], Root | None], ...] = (
    free_body,
    ball,
    spin,
    slides,
    planar,
    at_distance,
    aim,
    bennett,
    orientation,
    along_normal,
    confined,
)


def closed_form(ring: Ring, q: SX, p: SX) -> Root | str:
    """The ways to find some of the positions of a loop, or why no kernel fits.

    The others follow once these are known.

    Args:
        ring: the loop.
        q: symbols of positions, those of cut joints included.
        p: (np, 1) symbols of parameters.
    """
    if any(joint.motion is Motion.FREE for joint in ring.joints) and len(ring.joints) > 1:
        return "a free body is in it"
    for kernel in _KERNELS:
        root = kernel(ring, q, p)
        if root is not None and any(root.ways.values()):
            return root
    found = split(ring, q, p)
    if isinstance(found, Root):
        return found
    unknown = ", ".join(joint.name for joint in ring.joints)
    count = len(ring.joints)
    return f"{count} positions are unknown ({unknown}) and no kernel fits their axes: {found}"
