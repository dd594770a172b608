"""What a visitor typed into the form of a simulation, and the settings that it stands for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from mbs.app.tasks.simulation import SimulationSettings
from mbs.assembly import System

Texts = dict[str, str]
"""Fields of the form: "duration", "method" and so on, and "q0.j1", "law.j1", "kind.j1"."""

Row = tuple[str, str, str, bool]
"""Name of a joint, unit of its position ("" for several), unit of its rate, and motor or not."""

KINDS = {"tau": "effort", "q": "position", "v": "velocity", "a": "acceleration"}
"""What a law of a joint gives."""

PICTURE = "the posture of the picture"
TYPED = "typed positions"

_FIRST = {
    "duration": "2",
    "step": "0.01",
    "tolerance": "1e-8",
    "method": "dopri5",
    "start": PICTURE,
}


def first_texts(texts: Mapping[str, str]) -> Texts:
    """The fields at first: what was typed before, the others by default."""
    return {**_FIRST, **texts}


def chosen_rows(system: System) -> list[Row]:
    """The joints that a start and laws are given for: in a closed system the independent ones."""
    units = {c.name: c.unit for c in system.coordinates}
    speeds = [system.speeds[k] for k in system.active]
    return [(s.name, units.get(s.name, ""), s.unit, s.actuated) for s in speeds]


def settings_of(system: System, texts: Mapping[str, str], q: Sequence[float]) -> SimulationSettings:
    """The settings of a form.

    Args:
        system: that moves; fields of joints that it does not have are left alone.
        texts: of the form; empty ones are left out.
        q: (nq,) posture of the picture [rad or m].
    """
    rows = chosen_rows(system)
    typed = texts["start"] == TYPED
    laws = {name: texts.get(f"law.{name}", "").strip() for name, *_ in rows}
    kinds = {name: texts.get(f"kind.{name}", "") for name in laws}
    return SimulationSettings(
        duration=texts["duration"],
        step=texts["step"],
        tolerance=texts["tolerance"],
        method=texts["method"],
        q0=_given(texts, "q0", [name for name, unit, *_ in rows if unit]) if typed else {},
        posture=() if typed else tuple(q),
        v0=_given(texts, "v0", [name for name, *_ in rows]),
        tau={n: law for n, law in laws.items() if law and kinds[n] in ("", "tau")},
        motion={f"{n}.{kinds[n]}": x for n, x in laws.items() if x and kinds[n] in ("q", "v", "a")},
        inputs=_given(texts, "u", [device.name for device in system.devices]),
    )


def _given(texts: Mapping[str, str], what: str, names: Sequence[str]) -> dict[str, str]:
    found = {name: texts.get(f"{what}.{name}", "").strip() for name in names}
    return {name: text for name, text in found.items() if text}
