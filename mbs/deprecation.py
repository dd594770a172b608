"""Old names of public objects. They work for one version more, with a DeprecationWarning."""

from __future__ import annotations

import importlib
import warnings
from collections.abc import Callable, Mapping
from typing import Any


def moved(module: str, names: Mapping[str, str]) -> Callable[[str], Any]:
    """Return the function `__getattr__` of a module, which finds names that have moved.

    It warns with a DeprecationWarning, and raises AttributeError for other names.

    Args:
        module: name of the module.
        names: present place of each old name, such as {"Mechanism": "mbs.Mechanism"}.
    """

    def get(name: str) -> Any:
        if name not in names:
            raise AttributeError(f"module {module!r} has no attribute {name!r}")
        place, _, present = names[name].rpartition(".")
        warnings.warn(
            f"{module}.{name} is now {names[name]}; change the import",
            DeprecationWarning,
            stacklevel=2,
        )
        return getattr(importlib.import_module(place), present)

    return get
