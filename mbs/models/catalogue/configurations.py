"""Inverse geometric models of the catalogue: closed forms and the general method."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from casadi import Function

from mbs.assembly import System
from mbs.components.joints import Motion
from mbs.errors import NoClosedForm
from mbs.models import inverse_geometry
from mbs.models.catalogue.entry import NOTHING, TARGET, Chosen, Entry, Values, several
from mbs.models.geometry import terminal_frame

SIX = 6
"""Number of degrees of freedom of a pose."""

_INSTEAD = (
    "Configurations are found by closed form where there is one, else by search from random starts;"
    " each is checked with the forward model."
)

Frame = str | int


def moving_joints(system: System, frame: Frame) -> tuple[str, ...]:
    """Return the names of the joints between base and frame; () if one is spherical or free."""
    links = [system.tree.links[k] for k in system.tree.path(system.frame(frame)[0])]
    simple = all(link.motion in (Motion.REVOLUTE, Motion.PRISMATIC) for link in links)
    return tuple(link.name for link in links) if simple else ()


def surplus_joints(system: System, frame: Frame) -> tuple[str, ...]:
    """Return the joints that are locked by default, so that a pose determines the others.

    The locked joints precede the middle of the chain. The elbow of a seven-joint arm stays free.
    """
    names = moving_joints(system, frame)
    surplus = max(0, len(names) - SIX)
    first = max(0, (len(names) - surplus - 1) // 2)
    return names[first : first + surplus]


def _frame(system: System, chosen: Chosen) -> Frame:
    found: Frame = chosen.get("frame", terminal_frame(system))
    return found


def _joints(system: System, chosen: Chosen = NOTHING, /) -> Values:
    return moving_joints(system, _frame(system, chosen))


def _surplus(system: System, chosen: Chosen = NOTHING, /) -> tuple[str, ...]:
    return surplus_joints(system, _frame(system, chosen))


LOCKED = several("locked", "joints that stay as assembled", _joints, _surplus)


def held_at(
    system: System, names: Sequence[str], q: Sequence[float] | None = None
) -> dict[str, float]:
    """Return joint positions by name from q (nq,), default the assembled configuration."""
    places = zip(system.coordinates, system.configuration if q is None else q, strict=True)
    return {c.name: float(x) for c, x in places if c.name in names}


def _function(method: str, branches: str = "one") -> Callable[..., Function]:
    def function(system: System, frame: Frame, locked: Sequence[str]) -> Function:
        held = held_at(system, locked)
        return inverse_geometry.function(system, method, frame, held, branches=branches)

    return function


def _sheet(method: str) -> Callable[..., str]:
    def text(system: System, frame: Frame, locked: Sequence[str]) -> str:
        return inverse_geometry.text(system, method, frame, held_at(system, locked))

    return text


def _general(system: System, frame: Frame, locked: Sequence[str]) -> str:
    """Return a text that describes the general method for a chain."""
    names = [name for name in moving_joints(system, frame) if name not in locked]
    title = f"Inverse geometric model of {system.name}, general method: frame {frame!r}"
    if not names:
        return (
            f"{title}\nThe frame hangs on joints with several freedoms, or on none; the pose"
            " closes one loop more, and the loops give every joint.\n"
        )
    joints = f"{title}\njoints: {', '.join(names)}"
    if len(names) != SIX:
        return f"{joints}\nThe method is for six joints, here are {len(names)}. {_INSTEAD}\n"
    try:
        found = inverse_geometry.function(system, "general", frame, held_at(system, locked))
    except NoClosedForm as error:
        return f"{joints}\nThere is no characteristic matrix: {error}. {_INSTEAD}\n"
    return joints + "\n" + _characteristic(found)


def _characteristic(found: Function) -> str:
    """Return the text of the equation of the characteristic matrices M0, M1, M2."""
    joint, slides = found.joint, found.prismatic  # type: ignore[attr-defined]
    terms = [f"M{k}(T)" for k in range(found.n_out())]
    powers = ["", joint, f"{joint}^2"] if slides else ["", f"cos({joint})", f"sin({joint})"]
    parts = [f"{term} {power}".strip() for term, power in zip(terms, powers, strict=False)]
    size = found.size1_out(0)
    return (
        f"1. {joint} from det({' + '.join(parts)}) = 0, matrices of {size} rows whose elements are"
        " functions of the pose T alone\n2. the other joints from the null vector of that matrix,"
        " one configuration for each root\n3. each configuration is corrected and checked with the"
        " forward"
        " model\nSource: Raghavan & Roth 1993; Manocha & Canny 1994\n"
    )


def _longest_chain(system: System) -> int:
    frames = range(1, len(system.tree.links) + 1)
    return max((len(moving_joints(system, frame)) for frame in frames), default=0)


def _is_open(system: System) -> bool:
    return not system.is_closed


def _has_six(system: System) -> bool:
    """Whether six joints are free between the base and some frame."""
    return _longest_chain(system) >= SIX


def _too_short(method: str, fewest: int) -> Callable[[System], str]:
    def obstacle(system: System) -> str:
        longest = _longest_chain(system)
        if longest >= fewest:
            return ""
        joints = "joints, six of them," if fewest == SIX else "joints"
        return (
            f"{method} is for revolute or prismatic {joints} between the base and a frame;"
            f" {system.name} has {longest or 'none'}{' at most' if longest else ''}"
        )

    return obstacle


def _closed_form(key: str, name: str, method: str, fewest: int) -> Entry:
    return Entry(
        key,
        "Geometric",
        f"Inverse geometric model, {name}",
        "q = igm(T)",
        (TARGET, LOCKED),
        _function(method),
        _sheet(method),
        method,
        writes=_is_open,
        obstacle=_too_short(name, fewest),
    )


INVERSE_GEOMETRY: tuple[Entry, ...] = (
    _closed_form("igm-pieper", "Pieper's method", "pieper", SIX),
    _closed_form("igm-paul", "Paul's method", "paul", 1),
    Entry(
        "igm-general",
        "Geometric",
        "Inverse geometric model, general method",
        "q = igm(T)",
        (TARGET, LOCKED),
        _function("general"),
        _general,
        "general",
        writes=_has_six,
        numeric=_function("general", "all"),
    ),
)
