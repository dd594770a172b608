"""Options of an action: keywords, docstring and checks follow from the fields of a dataclass."""

from __future__ import annotations

import inspect
import re
from dataclasses import dataclass, field
from typing import Any, get_type_hints

import numpy as np
import pytest

import mbs
from mbs.errors import ModelError
from mbs.export.fmu.options import FmuOptions
from mbs.models.inverse_geometry.options import PoseOptions
from mbs.options import (
    arguments_of,
    described,
    faults,
    group_values,
    method_arguments_of,
    option_fields,
)
from mbs.simulate.options import MotionOptions, RunArguments


def _short(label: str, value: object) -> str:
    return "" if isinstance(value, str) and len(value) < 9 else f"{label} is {value!r}; be short"


@dataclass(frozen=True, kw_only=True)
class Size:
    __slots__ = ()
    length: float = field(default=1.0, metadata=described("length. By default one.", unit="m"))


@dataclass(frozen=True, slots=True)
class Box(Size):
    system: int = field(metadata=described("number of the box."))
    path: str = field(default="x", metadata=described("not used."))
    title: str = field(
        default="", kw_only=True, metadata=described("text on the lid.", label="lid", check=_short)
    )


@arguments_of(Box)
def wrap(options: Box) -> Box:
    """Wrap it up.

    Args:
        options: see `Box`.

    Returns:
        The box.
    """
    return options


class Shop:
    @method_arguments_of(Box)
    def __init__(self, options: Box) -> None:
        """Open the shop.

        Args:
            options: see `Box`.
        """
        self.options = options


def test_a_function_has_the_fields_as_arguments() -> None:
    assert wrap(3, "y", title="tea") == Box(3, "y", title="tea")
    assert wrap(system=3) == Box(3)
    assert str(inspect.signature(wrap)) == (
        "(system: 'int', path: 'str' = 'x', *, length: 'float' = 1.0, title: 'str' = '') -> 'Box'"
    )
    assert get_type_hints(wrap)["length"] is float
    assert (wrap.__name__, wrap.__module__) == ("wrap", __name__)


def test_a_method_has_the_fields_as_arguments() -> None:
    assert Shop(3, length=2.0).options == Box(3, length=2.0)
    assert list(inspect.signature(Shop).parameters) == ["system", "path", "length", "title"]


@pytest.mark.parametrize(("action", "name", "own"), [(wrap, "wrap", 0), (Shop, "Shop.__init__", 1)])
def test_wrong_arguments_raise_the_errors_of_python(action: Any, name: str, own: int) -> None:
    texts = {
        "missing 1 required positional argument: 'system'": lambda: action(),
        "got an unexpected keyword argument 'width'": lambda: action(3, width=1.0),
        "got multiple values for argument 'path'": lambda: action(3, "y", path="z"),
        f"takes from {1 + own} to {2 + own} positional arguments but {3 + own} were given": (
            lambda: action(3, "y", 1.0)
        ),
    }
    for text, call in texts.items():
        with pytest.raises(TypeError, match=f"^{re.escape(f'{name}() {text}')}$"):
            call()


def test_the_docstring_lists_the_fields() -> None:
    text = inspect.getdoc(wrap) or ""
    assert "path: not used.\n    length: length [m]. By default one.\n    title: text on" in text
    assert "options" not in text.partition("Returns")[0]
    assert "    system: number of the box.\n" in (inspect.getdoc(Shop.__init__) or "")


def test_invalid_options_are_told_and_groups_are_taken_out() -> None:
    assert list(faults(Box(1))) == []
    assert list(faults(Box(1, title="chamomile"))) == ["lid is 'chamomile'; be short"]
    assert group_values(Box(1, length=2.0), Size) == {"length": 2.0}
    assert list(option_fields(Box)) == ["system", "path", "length", "title"]


def test_the_signature_of_the_export_of_an_fmu_is_its_options() -> None:
    names = (
        "system path fmi inputs outputs parameters fixed flanges controller sources platforms"
        " stop_time step_size tolerance solver internal_step max_step target reference arrays"
        " description author version copyright license"
    )
    signature = inspect.signature(mbs.export.fmu)
    assert list(signature.parameters) == names.split()
    made = FmuOptions()
    for name, parameter in list(signature.parameters.items())[2:]:
        assert parameter.kind is parameter.KEYWORD_ONLY
        assert parameter.default == getattr(made, name)
    text = inspect.getdoc(mbs.export.fmu) or ""
    assert all(f"\n    {name}: " in text for name in names.split())
    assert get_type_hints(mbs.export.fmu)["stop_time"] is float


@pytest.mark.parametrize(
    ("action", "names"),
    [
        (
            mbs.simulate.run,
            "system duration q0 v0 tau motion u z0 guess parameters step tolerance max_step method"
            " quiet",
        ),
        (mbs.simulate.Simulator, "system inputs outputs tau motion u method"),
        (
            mbs.simulate.Simulator.__call__,
            "self duration q0 v0 z0 guess inputs parameters step tolerance max_step quiet",
        ),
    ],
)
def test_the_signatures_of_a_simulation_are_its_options(action: Any, names: str) -> None:
    signature = inspect.signature(action)
    assert list(signature.parameters) == names.split()
    assert all(
        parameter.default == field.default
        for name, (field, _) in option_fields(RunArguments).items()
        if (parameter := signature.parameters.get(name))
        and name not in ("system", "duration", "quiet")
    )
    text = inspect.getdoc(action.__init__ if inspect.isclass(action) else action) or ""
    assert all(f"\n    {name}: " in text for name in names.split() if name != "self")


def test_the_signature_of_a_c_library_is_its_options() -> None:
    signature = inspect.signature(mbs.export.c_library)
    defaults = {name: parameter.default for name, parameter in signature.parameters.items()}
    assert list(defaults) == ["functions", "folder", "target", "real", "checked"]
    assert list(defaults.values())[2:] == ["hosted", "double", True]
    text = inspect.getdoc(mbs.export.c_library) or ""
    assert all(f"\n    {name}: " in text for name in defaults)


def test_options_of_a_motion_have_commands_and_fields_of_a_form() -> None:
    found = option_fields(MotionOptions)
    assert list(found) == ["step", "tolerance", "max_step", "method"]
    assert all(option.in_form for _, option in found.values())
    assert [option.command for _, option in found.values()] == [
        "--step",
        "--tolerance",
        "--max-step",
        "--method",
    ]
    others = set(option_fields(RunArguments)) - set(found)
    assert not any(option_fields(RunArguments)[name][1].command for name in others)


def test_the_methods_of_a_pose_are_those_of_the_solver() -> None:
    (option,) = (option for _, option in option_fields(PoseOptions).values())
    system = mbs.load("scara").assemble()
    with pytest.raises(ModelError, match="method is 'none'") as stopped:
        mbs.models.inverse_geometry.solve(system, np.eye(4), method="none")
    assert set(option.choices) <= set(re.findall(r"\w+", str(stopped.value)))
    text = inspect.getdoc(mbs.models.inverse_geometry.solve) or ""
    assert " ".join(option.text.split()) in " ".join(text.split())
