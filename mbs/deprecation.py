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


class RenamedAttribute:
    """Old name of an attribute of a class. Its use gives the value of the new name and a warning.

    Args:
        present: new name of the attribute or method.
    """

    def __init__(self, present: str) -> None:
        self.present = present

    def __set_name__(self, owner: type, name: str) -> None:
        """Record the class and the old name."""
        self.text = f"{owner.__name__}.{name} is now {owner.__name__}.{self.present}"

    def __get__(self, instance: Any, owner: type | None = None) -> Any:
        """Return the attribute under its new name."""
        warnings.warn(f"{self.text}; change the name", DeprecationWarning, stacklevel=2)
        return getattr(owner if instance is None else instance, self.present)
