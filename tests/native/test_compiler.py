import importlib.util
import os
import platform
import shlex
import signal
import subprocess
import threading
import time

import pytest

from mbs.core.build import SOURCE, ZIG
from mbs.errors import CompilerError
from mbs.native import compile_library, compiler_found, find_compiler
from mbs.native.compiler import FLAGS, chosen_flags, flags_for


def test_a_compiler_is_found():
    compiler = find_compiler()
    assert compiler.command
    assert compiler.version


def test_cc_is_obeyed(monkeypatch):
    monkeypatch.setenv("CC", shlex.join([*find_compiler().command, "-m64"]))
    assert find_compiler().command[-1] == "-m64"


def test_cc_that_does_not_start(monkeypatch):
    monkeypatch.setenv("CC", "no-such-compiler")
    with pytest.raises(CompilerError, match="CC is 'no-such-compiler' and does not start"):
        find_compiler()


def test_only_a_missing_compiler_is_no_error(monkeypatch, tmp_path):
    assert compiler_found()
    for wanted in ("no-such-compiler", "'open"):
        monkeypatch.setenv("CC", wanted)
        with pytest.raises(CompilerError, match="does not start"):
            compiler_found()
    monkeypatch.setenv("CC", "")
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr("importlib.util.find_spec", lambda _: None)
    assert not compiler_found()


def test_no_compiler_says_what_to_install(monkeypatch, tmp_path):
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr("importlib.util.find_spec", lambda _: None)
    with pytest.raises(CompilerError, match=r"install gcc or clang, or run: pip install"):
        find_compiler()


def test_refused_code_names_the_error(tmp_path):
    source = tmp_path / "bad.c"
    source.write_text("int f(void) { return nothing; }")
    with pytest.raises(CompilerError, match=r"refused bad\.c: .*nothing"):
        compile_library([source], output=tmp_path / "bad.so")


@pytest.mark.skipif(os.name == "nt", reason="the script is one of a POSIX shell")
def test_control_c_ends_the_compiler(tmp_path, monkeypatch):
    script, number = tmp_path / "slow", tmp_path / "number"
    script.write_text(
        f'#!/bin/sh\ncase "$1" in --version) exit;; esac\necho $$ > {number}\nexec sleep 60'
    )
    script.chmod(0o700)
    monkeypatch.setenv("CC", str(script))
    source = tmp_path / "a.c"
    source.write_text("int a;")

    def press():
        while not (number.exists() and number.read_text().strip()):
            time.sleep(0.01)
        os.kill(os.getpid(), signal.SIGINT)

    # a program that a shell starts in the background ignores control-C
    usual = signal.signal(signal.SIGINT, signal.default_int_handler)
    threading.Thread(target=press, daemon=True).start()
    try:
        with pytest.raises(KeyboardInterrupt):
            compile_library([source], output=tmp_path / "a.so")
    finally:
        signal.signal(signal.SIGINT, usual)
    with pytest.raises(ProcessLookupError):
        os.kill(int(number.read_text()), 0)


def test_a_refused_link_names_the_missing_function(tmp_path):
    source = tmp_path / "open.c"
    source.write_text("int nowhere(void); int main(void) { return nowhere(); }")
    with pytest.raises(CompilerError, match=r"refused open\.c: .*nowhere"):
        compile_library([source], flags=["-O0"], output=tmp_path / "open")


PYTHON = ("module", "array_call")  # with the header of Python, which is not pedantic
LIBRARY = sorted(file for file in SOURCE.glob("*.c") if file.stem not in PYTHON)


def test_the_runtime_is_clean_c99(tmp_path):
    strict = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Wvla", "-Werror", "-c"]
    command = [*find_compiler().command, *strict, *map(str, LIBRARY)]
    answer = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path)
    assert answer.returncode == 0, answer.stderr


@pytest.mark.skipif(importlib.util.find_spec("ziglang") is None, reason="no ziglang")
@pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="registers of x86-64")
def test_ziglang_uses_no_instructions_of_this_processor_only(tmp_path):
    (tmp_path / "sum.c").write_text(
        "void f(double *x, const double *y) { for (int i = 0; i < 64; i++) x[i] += y[i]; }"
    )
    subprocess.run([*ZIG, "-O3", "-S", "sum.c", "-o", "sum.s"], cwd=tmp_path, check=True)
    text = (tmp_path / "sum.s").read_text()
    assert "xmm" in text
    assert "ymm" not in text
    assert "zmm" not in text


def test_long_code_is_optimized_less():
    assert flags_for("x\n" * 100) == FLAGS
    assert flags_for("x\n" * 50_000)[0] == "-O1"
    assert flags_for("x\n" * 500_000)[0] == "-O0"
    assert flags_for("x\n" * 500_000)[1:] == FLAGS[1:]


def test_the_level_of_optimization_can_be_chosen(monkeypatch):
    monkeypatch.delenv("MBS_ARCHITECTURE", raising=False)
    monkeypatch.setenv("MBS_OPTIMIZE", "0")
    assert chosen_flags(("-O2", "-fPIC")) == ("-O0", "-fPIC")
    monkeypatch.setenv("MBS_OPTIMIZE", "")
    assert chosen_flags(("-O2", "-fPIC")) == ("-O2", "-fPIC")
    monkeypatch.setenv("MBS_OPTIMIZE", "fast")
    with pytest.raises(CompilerError, match=r"MBS_OPTIMIZE is 'fast'; set it to 0, 1, 2 or 3"):
        chosen_flags(("-O2",))


def test_the_architecture_can_be_chosen(monkeypatch):
    monkeypatch.setenv("MBS_OPTIMIZE", "")
    monkeypatch.setenv("MBS_ARCHITECTURE", "x86-64-v3")
    assert chosen_flags(("-O2", "-march=native", "-fPIC")) == ("-O2", "-fPIC", "-march=x86-64-v3")
    monkeypatch.setenv("MBS_ARCHITECTURE", "x86 64")
    with pytest.raises(CompilerError, match="MBS_ARCHITECTURE is 'x86 64'; set it to a name"):
        chosen_flags(("-O2",))
