"""Options of an action: keywords, docstring and checks follow from the fields of a dataclass."""

from __future__ import annotations

import inspect
import os
from dataclasses import dataclass, field
from typing import get_type_hints

import pytest

import mbs
from mbs.export.fmu.options import FmuOptions
from mbs.options import described, faults, group_values, keywords_of, option_fields


def _short(label: str, value: object) -> str:
    return "" if isinstance(value, str) and len(value) < 9 else f"{label} is {value!r}; be short"


@dataclass(frozen=True, kw_only=True)
class Size:
    __slots__ = ()
    length: float = field(default=1.0, metadata=described("length. By default one.", unit="m"))


@dataclass(frozen=True, slots=True, kw_only=True)
class Box(Size):
    title: str = field(
        default="", metadata=described("text on the lid.", label="lid", check=_short)
    )
    count: int = 0


@keywords_of(Box)
def wrap(system: int, path: str | os.PathLike[str], *, options: Box) -> tuple[int, Box]:
    """Wrap it up.

    Args:
        system: number of the box.
        path: not used.
        options: see `Box`.

    Returns:
        Number and options.
    """
    return system, options


def test_a_function_has_the_fields_as_keywords() -> None:
    assert wrap(3, "x", title="tea") == (3, Box(title="tea"))
    assert wrap(system=3, path="x") == (3, Box())
    assert list(inspect.signature(wrap).parameters) == ["system", "path", "length", "title"]
    assert inspect.signature(wrap).parameters["length"].default == 1.0
    assert get_type_hints(wrap)["length"] is float
    for words in ({"width": 1.0}, {"count": 2}):  # a field without description is no option
        with pytest.raises(TypeError, match=f"unexpected keyword argument '{next(iter(words))}'"):
            wrap(3, "x", **words)
    with pytest.raises(TypeError, match="missing 2 required positional arguments"):
        wrap()


def test_the_docstring_lists_the_fields() -> None:
    text = inspect.getdoc(wrap) or ""
    assert "path: not used.\n    length: length [m]. By default one.\n    title: text on" in text
    assert "options" not in text.partition("Returns")[0]


def test_invalid_options_are_told_and_groups_are_taken_out() -> None:
    assert list(faults(Box())) == []
    assert list(faults(Box(title="chamomile"))) == ["lid is 'chamomile'; be short"]
    assert group_values(Box(length=2.0), Size) == {"length": 2.0}
    assert list(option_fields(Box)) == ["length", "title"]


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
