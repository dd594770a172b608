"""Shared libraries for other computers, made by the compiler inside ziglang."""

import importlib.util
import platform
import sys
from dataclasses import dataclass
from importlib import metadata

from mbs.errors import CompilerError
from mbs.messages import did_you_mean, install_command, quoted
from mbs.native.compiler import LIBRARY_SUFFIX, Compiler

_OLD_GLIBC = "2.17"
"""Every Linux in use since 2014 has it."""


@dataclass(frozen=True, slots=True)
class Platform:
    """A kind of computer that a library is made for.

    Attributes:
        name: as FMI 3.0 names it.
        fmi2: as FMI 2.0 names it.
        target: as ziglang names it.
        suffix: of its shared libraries.
    """

    name: str
    fmi2: str
    target: str
    suffix: str


PLATFORMS = {
    p.name: p
    for p in (
        Platform("x86_64-linux", "linux64", f"x86_64-linux-gnu.{_OLD_GLIBC}", ".so"),
        Platform("aarch64-linux", "aarch64-linux", f"aarch64-linux-gnu.{_OLD_GLIBC}", ".so"),
        Platform("x86_64-windows", "win64", "x86_64-windows-gnu", ".dll"),
        Platform("x86_64-darwin", "darwin64", "x86_64-macos", ".dylib"),
        Platform("aarch64-darwin", "aarch64-darwin", "aarch64-macos", ".dylib"),
    )
}


def host_platform() -> Platform:
    """This computer."""
    machine = {"amd64": "x86_64", "arm64": "aarch64"}.get(platform.machine().lower())
    machine = machine or platform.machine().lower()
    system = {"win32": "windows", "darwin": "darwin"}.get(sys.platform, "linux")
    name = f"{machine}-{system}"
    return PLATFORMS.get(name, Platform(name, name, "", LIBRARY_SUFFIX))


def platform_named(name: object) -> Platform:
    """The platform of a name.

    Raises:
        CompilerError: there is none of that name.
    """
    if isinstance(name, str) and name in PLATFORMS:
        return PLATFORMS[name]
    raise CompilerError(
        f"there is no platform {quoted(name)}; {did_you_mean(str(name), list(PLATFORMS))}"
    )


def cross_compiler(goal: Platform) -> Compiler:
    """The compiler that makes libraries for a platform, on whatever computer it runs.

    Raises:
        CompilerError: ziglang is not installed.
    """
    if importlib.util.find_spec("ziglang") is None:
        raise CompilerError(
            f"libraries for {goal.name} are made with ziglang, which is not installed; run: "
            + install_command("cross")
        )
    command = (sys.executable, "-m", "ziglang", "cc", "-target", goal.target)
    return Compiler(command, metadata.version("ziglang"))
