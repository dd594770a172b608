"""Platforms of libraries; nothing is compiled here."""

import pytest

import mbs.native.compiler as cross
from mbs.errors import CompilerError
from mbs.native.compiler import PLATFORMS, cross_compiler, host_platform, platform_named


def test_every_platform_has_a_target_and_a_suffix():
    suffixes = {name: goal.suffix for name, goal in PLATFORMS.items()}
    assert suffixes == {
        "x86_64-linux": ".so",
        "aarch64-linux": ".so",
        "x86_64-windows": ".dll",
        "x86_64-darwin": ".dylib",
        "aarch64-darwin": ".dylib",
    }
    assert platform_named("x86_64-linux").target == "x86_64-linux-gnu.2.17"


@pytest.mark.parametrize(
    ("machine", "system", "name", "folder"),
    [
        ("AMD64", "win32", "x86_64-windows", "win64"),
        ("x86_64", "linux", "x86_64-linux", "linux64"),
        ("arm64", "darwin", "aarch64-darwin", "aarch64-darwin"),
        ("riscv64", "linux", "riscv64-linux", "riscv64-linux"),
    ],
)
def test_this_computer(monkeypatch, machine, system, name, folder):
    monkeypatch.setattr(cross.platform, "machine", lambda: machine)
    monkeypatch.setattr(cross.sys, "platform", system)
    assert (host_platform().name, host_platform().fmi2) == (name, folder)


def test_an_unknown_platform_is_refused_with_a_proposal():
    with pytest.raises(CompilerError, match=r"no platform 'x86_64-win'.*x86_64-windows"):
        platform_named("x86_64-win")


def test_without_ziglang_the_message_says_what_to_install(monkeypatch):
    monkeypatch.setattr(cross.importlib.util, "find_spec", lambda _: None)
    with pytest.raises(CompilerError, match=r'aarch64-linux.*pip install "casadi-mbs\[cross\]"'):
        cross_compiler(PLATFORMS["aarch64-linux"])
