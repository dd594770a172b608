"""The options of an FMU as a form."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial

from nicegui import ui

from mbs.app.desk.panels.plots_fields import FieldLook, choice_field, several_field, text_field
from mbs.app.tasks.exporting import SOLVERS, FmuSettings
from mbs.assembly import System

_SOLVERS = {
    "dopri5": "dopri5, explicit",
    "rodas": "rodas, stiff",
    "rk4": "rk4, fixed step",
}
_OUTPUTS = ("energy", "closure", "poses", "cut_forces", "sensors")
_PARAMETERS = (
    "masses", "first_moments", "inertias", "lengths", "angles", "friction", "rotors", "gravity"
)  # fmt: skip


@dataclass(slots=True)
class FmuAsked:
    """What the form holds; attributes as those of `FmuSettings`, `more_...` as typed."""

    fmi: str = "2.0"
    solver: str = "dopri5"
    stop_time: str = "10"
    step_size: str = "0.01"
    tolerance: str = "1e-8"
    internal_step: str = "0.001"
    outputs: list[str] = field(default_factory=list)
    parameters: list[str] = field(default_factory=list)
    more_inputs: str = ""
    more_outputs: str = ""
    more_parameters: str = ""

    def settings(self) -> FmuSettings:
        """The settings that the form stands for."""
        return FmuSettings(
            fmi=self.fmi,
            inputs=_names(self.more_inputs),
            outputs=(*self.outputs, *_names(self.more_outputs)),
            parameters=(*self.parameters, *_names(self.more_parameters)),
            stop_time=self.stop_time,
            step_size=self.step_size,
            tolerance=self.tolerance,
            solver=self.solver,
            internal_step=self.internal_step,
        )


def fmu_form(system: System, asked: FmuAsked) -> None:
    """Fields that write into `asked`.

    Args:
        system: that is exported.
        asked: of the form, at first and later.
    """
    offered = [name for name in _OUTPUTS if _is_offered(system, name)]
    asked.outputs = [name for name in asked.outputs if name in offered]
    joint = system.speeds[system.active[0]].name if system.active else "j1"
    with ui.element("div").classes("desk-form"):
        _choice(asked, {"2.0": "2.0", "3.0": "3.0"}, FieldLook("FMI", "84px", "fmi"))
        solvers = {name: _SOLVERS.get(name, name) for name in SOLVERS}
        solver = _choice(asked, solvers, FieldLook("Solver", "160px", "solver"))
        _input("Stop time [s]", asked, "stop_time", "100px")
        _input("Step [s]", asked, "step_size", "84px")
        _input("Tolerance", asked, "tolerance", "90px")
        inner = _input("Step of rk4 [s]", asked, "internal_step", "110px")
        inner.bind_visibility_from(solver, "value", value="rk4")
    beside = "Outputs beside the motion of joints and tool"
    _several(asked, offered, FieldLook(beside, "100%", "outputs"))
    _several(asked, _PARAMETERS, FieldLook("Numbers that become parameters", "100%", "parameters"))
    with ui.element("div").classes("desk-form"):
        _input("More inputs", asked, "more_inputs", "150px").tooltip(
            f"such as {joint}.q, {joint}.a or tool.wrench; commas between them"
        )
        _input("More outputs", asked, "more_outputs", "150px").tooltip(
            f"such as pose:tool or wrench:{joint}; commas between them"
        )
        _input("More parameters", asked, "more_parameters", "150px").tooltip(
            "such as M3 or d4, or the name of a body; commas between them"
        )


def _is_offered(system: System, output: str) -> bool:
    if output == "closure":
        return system.is_closed
    return output != "sensors" or bool(system.sensors)


def _names(text: str) -> tuple[str, ...]:
    return tuple(part for part in re.split(r"[,\s]+", text) if part)


def _input(label: str, asked: FmuAsked, key: str, width: str) -> ui.input:
    look = FieldLook(label, width, key)
    return text_field(look, getattr(asked, key), partial(setattr, asked, key))


def _choice(asked: FmuAsked, options: dict[str, str], look: FieldLook) -> ui.select:
    key = look.marker
    return choice_field(look, options, getattr(asked, key), partial(setattr, asked, key))


def _several(asked: FmuAsked, names: Sequence[str], look: FieldLook) -> None:
    key, options = look.marker, {name: name.replace("_", " ") for name in names}
    several_field(look, options, getattr(asked, key), partial(setattr, asked, key))
