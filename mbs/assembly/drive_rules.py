"""What is refused in a drive line, and how it is said."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

from mbs.components import IdealGear, Joint, Mechanism, ShaftInertia
from mbs.components.drive_elastic import ElasticGear, ShaftForce
from mbs.components.drive_flange import Flange, Flanged
from mbs.components.motion import Motion
from mbs.errors import AssemblyError
from mbs.expressions import Expression


def check_flanges(mechanism: Mechanism, parts: Sequence[Flanged]) -> None:
    """Refuse flanges that are connected to nothing, or to a joint that slides.

    Raises:
        AssemblyError: which flange, and what to connect.
    """
    joined: dict[Flange, list[Flange]] = {}
    for a, b in mechanism.shafts:
        joined.setdefault(a, []).append(b)
        joined.setdefault(b, []).append(a)
    for part in parts:
        loose = [flange for flange in part.flanges if flange not in joined]
        ends = isinstance(part, ShaftInertia) and len(loose) < len(part.flanges)
        if loose and not ends:
            raise AssemblyError(
                f"{mechanism.name}: {loose[0]} of {type(part).__name__} {part.name!r} is connected"
                " to nothing; connect it to another flange or leave the component out"
            )
    for flange in joined:
        if _slides(flange):
            _check_sliding(mechanism, flange, joined)


def _slides(flange: Flange) -> bool:
    joint = flange.owner
    return isinstance(joint, Joint) and joint.freedoms[0].motion is Motion.PRISMATIC


def _check_sliding(mechanism: Mechanism, start: Flange, joined: dict[Flange, list[Flange]]) -> None:
    """Whatever is connected to a flange that slides must slide, or be the end of a gear."""
    seen, queue = {start}, deque([start])
    while queue:
        for other in joined[queue.popleft()]:
            if other in seen:
                continue
            geared = isinstance(other.owner, (IdealGear, ElasticGear)) and other.port == "b"
            if not geared and not _slides(other):
                raise AssemblyError(
                    f"{mechanism.name}: {other} turns but joint {start.owner.name!r} slides; put an"
                    " IdealGear or ElasticGear between them, its flange_b on the joint and its"
                    " ratio in rad for 1 m"
                )
            seen.add(other)
            queue.append(other)


def ring_of_gears(
    mechanism: Mechanism, key: tuple[str, str], first: Expression, second: Expression
) -> AssemblyError:
    """Gears that form a ring and do not agree."""
    return AssemblyError(
        f"{mechanism.name}: rigid gears drive {key[0]!r} in two ways, with the ratios {first} and"
        f" {second}, so that nothing can turn; take one of them away or make it elastic"
    )


def inertia_missing(mechanism: Mechanism, flanges: Sequence[Flange]) -> AssemblyError:
    """Flanges that turn without any inertia."""
    names = ", ".join(str(flange) for flange in flanges)
    return AssemblyError(
        f"{mechanism.name}: {names} turn without any inertia and without a joint, so that their"
        " acceleration is not determined; connect a ShaftInertia to them"
    )


def same_shaft(mechanism: Mechanism, part: ShaftForce) -> AssemblyError:
    """An elastic part between flanges that are rigidly connected."""
    return AssemblyError(
        f"{mechanism.name}: both flanges of {type(part).__name__} {part.name!r} are on one rigid"
        " shaft, which it cannot twist; connect one of them to another shaft"
    )
