"""Build hook of the package: compiles the run-time library `mbs.core._core`."""

from __future__ import annotations

import importlib.util
import os
import sys
import sysconfig
from pathlib import Path
from types import ModuleType
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


def _build_module() -> ModuleType:
    """`mbs/core/build.py`, loaded without the package, which cannot be imported yet."""
    file = Path(__file__).parent / "mbs" / "core" / "build.py"
    spec = importlib.util.spec_from_file_location("build_core", file)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


class RuntimeLibraryHook(BuildHookInterface):  # type: ignore[type-arg]
    """Compiles the library and gives the wheel the tag of its platform."""

    PLUGIN_NAME = "custom"

    def dependencies(self) -> list[str]:
        """Return the requirement on a C compiler, if this computer has none."""
        return [] if _build_module().installed_compiler() else ["ziglang>=0.13"]

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile the library before the wheel is packed."""
        core = _build_module()
        try:
            library = core.build()
        except core.BuildError as error:
            self.app.abort(str(error))
        # cibuildwheel and releases choose the oldest platform on which the library runs
        platform = os.environ.get("MBS_WHEEL_PLATFORM", sysconfig.get_platform())
        build_data["pure_python"] = False
        build_data["tag"] = f"cp311-abi3-{platform.replace('-', '_').replace('.', '_')}"
        build_data["artifacts"].append(f"mbs/core/{library.name}")
