"""What `import mbs` loads, which names it offers, and what the package ships."""

import json
import re
import subprocess
import sys
from importlib import resources

import pytest

import mbs
import mbs.errors

HEAVY = ("sympy", "scipy", "fmpy", "mujoco", "matplotlib", "rich", "typer", "pandas", "xarray")


def _modules_after(statement: str) -> list[str]:
    code = f"import json, sys; {statement}; print(json.dumps(sorted(sys.modules)))"
    answer = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    loaded: list[str] = json.loads(answer.stdout.splitlines()[-1])
    return [name for name in loaded if "." not in name]


@pytest.mark.parametrize(
    "statement",
    [
        "import mbs",
        "import mbs; [getattr(mbs, name) for name in mbs.__all__]",
        "import mbs; mbs.models.inverse_dynamics(mbs.load('four_bar').assemble())",
    ],
)
def test_only_numpy_and_casadi_are_loaded(statement: str) -> None:
    loaded = set(_modules_after(statement))
    assert not loaded & set(HEAVY)
    allowed = set(_modules_after("import numpy, numpy.random, casadi")) | {"mbs"}
    assert loaded - sys.stdlib_module_names <= allowed


@pytest.mark.parametrize("name", mbs.__all__)
def test_public_names_resolve(name: str) -> None:
    assert getattr(mbs, name) is not None
    assert name in dir(mbs)


def _place(name: str) -> tuple[bool, bool, str]:
    """Where a name stands in `__all__`: capitals such as PID, then classes, then functions."""
    return not name.isupper(), name[0].islower(), name


@pytest.mark.parametrize(
    "module",
    [
        "bridges",
        "components",
        "export",
        "formats",
        "loops",
        "models",
        "native",
        "robots",
        "simulate",
        "view",
    ],
)
def test_public_names_of_modules_resolve(module: str) -> None:
    inside = getattr(mbs, module)
    assert [name for name in inside.__all__ if not hasattr(inside, name)] == []
    assert inside.__all__ == sorted(inside.__all__, key=_place)
    assert (inside.__doc__ or "").strip()


def test_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = mbs.nothing


def test_types_and_c_sources_are_shipped() -> None:
    package = resources.files("mbs")
    assert (package / "py.typed").is_file()
    assert (package / "export" / "fmu" / "c" / "instance.c").is_file()
    assert (package / "core" / "source" / "dopri5.c").is_file()
    assert (package / "view" / "assets" / "viewer.js").is_file()


def test_tree_of_errors_is_the_documented_one() -> None:
    documented: dict[str, tuple[str, str]] = {}
    above: list[str] = []
    for line in (mbs.errors.__doc__ or "").splitlines():
        match = re.fullmatch(r" {4}((?:[│ ] {3})*(?:[├└]── )?)(\w+)(?: +(\S.*))?", line)
        if match:
            depth = len(match[1]) // 4
            above = [*above[:depth], match[2]]
            documented[match[2]] = (above[depth - 1] if depth else "Exception", match[3] or "")
    classes = {
        name: value
        for name, value in vars(mbs.errors).items()
        if isinstance(value, type) and issubclass(value, Exception)
    }
    assert {name: value.__bases__[0].__name__ for name, value in classes.items()} == {
        name: parent for name, (parent, _) in documented.items()
    }
    assert all(value.__doc__ for value in classes.values())
    assert all(text for name, (_, text) in documented.items() if name != "MbsError")
