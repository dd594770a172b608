"""Equations of robots and mechanisms with closed loops, as CasADi graphs.

Compose components in a `Mechanism` or `load` a robot and `assemble()` it. `mbs.models` returns its
equations as `casadi.Function`s, `mbs.export` writes C code and FMUs, and `mbs.simulate` integrates
the motion. All packages except numpy and casadi are imported when they are needed.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from mbs.version import __version__ as __version__

if TYPE_CHECKING:
    from mbs import (
        bridges,
        components,
        errors,
        export,
        formats,
        identification,
        loops,
        models,
        native,
        robots,
        simulate,
        units,
        view,
    )
    from mbs.assembly import System
    from mbs.errors import MbsError
    from mbs.expressions import Parameter
    from mbs.mechanism import Mechanism
    from mbs.result import Result, State
    from mbs.robots import load

_NAMES = {
    "Mechanism": "mbs.mechanism",
    "MbsError": "mbs.errors",
    "Parameter": "mbs.expressions",
    "Result": "mbs.result",
    "State": "mbs.result",
    "System": "mbs.assembly",
    "load": "mbs.robots",
}
_MODULES = (
    "bridges",
    "components",
    "errors",
    "export",
    "formats",
    "identification",
    "loops",
    "models",
    "native",
    "robots",
    "simulate",
    "units",
    "view",
)

__all__ = [
    "MbsError",
    "Mechanism",
    "Parameter",
    "Result",
    "State",
    "System",
    "bridges",
    "components",
    "errors",
    "export",
    "formats",
    "identification",
    "load",
    "loops",
    "models",
    "native",
    "robots",
    "simulate",
    "units",
    "view",
]


def __getattr__(name: str) -> Any:
    """Return a public class or a submodule, imported at the first access."""
    if name in _NAMES:
        return getattr(importlib.import_module(_NAMES[name]), name)
    if name in _MODULES:
        return importlib.import_module(f"mbs.{name}")
    raise AttributeError(f"module 'mbs' has no attribute {name!r}")


def __dir__() -> list[str]:
    """Return the names of the package, including those that are not imported yet."""
    return sorted([*globals(), *__all__])
