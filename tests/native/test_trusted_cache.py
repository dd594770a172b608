"""Machine code comes from folders of the user alone, and compilers end with one kind of error."""

import ctypes
import errno
import os
import stat
import sys
import time

import pytest

from mbs.errors import CompilerError
from mbs.native import cached_library
from mbs.native.compiler import cache_dir

compiler = sys.modules["mbs.native.compiler"]
SOURCE = {"f.c": "int f(void) { return 42; }"}
posix = pytest.mark.skipif(os.name != "posix", reason="owners and modes of files")


@pytest.fixture
def cache(monkeypatch, tmp_path):
    monkeypatch.setenv("MBS_CACHE_DIR", str(tmp_path / "cache"))
    return tmp_path / "cache"


def answered(library):
    return ctypes.CDLL(str(library)).f()


def fake_compiler(folder, script):
    """A compiler that tells its version and then does something else."""
    program = folder / "fake-cc"
    program.write_text(f'#!/bin/sh\n[ "$1" = --version ] && echo fake && exit 0\n{script}\n')
    program.chmod(0o755)
    return compiler.Compiler((str(program),), "fake")


@posix
def test_a_new_cache_is_closed_to_others(cache):
    assert stat.S_IMODE(cache_dir().stat().st_mode) == 0o700
    assert cache_dir() == cache


@posix
def test_others_lose_the_right_to_write(cache):
    cache.mkdir(mode=0o777)
    cache.chmod(0o777)
    assert cache_dir() == cache
    assert stat.S_IMODE(cache.stat().st_mode) == 0o755


@posix
def test_a_cache_of_another_user_is_not_used(cache, monkeypatch):
    planted = cached_library(SOURCE)
    monkeypatch.setattr(compiler.os, "geteuid", lambda: cache.stat().st_uid + 1)
    assert cache_dir() != cache
    assert cached_library(SOURCE).parent != planted.parent


def test_a_full_disk_leaves_the_folder_of_the_process(cache, monkeypatch):
    build = compiler._library_in

    def full(folder, *rest):
        if folder == cache:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return build(folder, *rest)

    monkeypatch.setattr(compiler, "_library_in", full)
    library = cached_library(SOURCE)
    assert library.parent != cache
    assert answered(library) == 42


def test_without_any_room_there_is_one_sentence(cache, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(compiler, "_library_in", full)
    with pytest.raises(CompilerError, match=r"No space left on device\); free space on its disk"):
        cached_library(SOURCE)


@posix
def test_a_compiler_that_finds_the_disk_full(cache, tmp_path):
    left = fake_compiler(tmp_path, "echo 'f.c: error: No space left on device' >&2; exit 1")
    with pytest.raises(CompilerError, match="free space on its disk"):
        cached_library(SOURCE, compiler=left)


@posix
def test_a_compiler_that_hangs_is_ended(cache, tmp_path, monkeypatch):
    monkeypatch.setattr(compiler, "_LONGEST", 0.5)
    with pytest.raises(
        CompilerError, match=r"fake-cc did not end within 0 s at f\.c; take shorter"
    ):
        cached_library(SOURCE, compiler=fake_compiler(tmp_path, "exec sleep 60"))
    assert not list(cache.glob("build-*"))


@posix
@pytest.mark.parametrize(
    ("script", "said"),
    [
        ("kill -9 $$", r"was ended by signal 9 at f\.c; where memory was short"),
        ("exit 0", "wrote no library; name another compiler"),
        ('for last; do :; done; echo "no code" > f.txt; exit 0', "wrote no library"),
        ("exit 3", r"refused f\.c"),
    ],
)
def test_a_compiler_that_fails_is_one_kind_of_error(cache, tmp_path, monkeypatch, script, said):
    monkeypatch.chdir(tmp_path)  # where the third writes
    with pytest.raises(CompilerError, match=said):
        cached_library(SOURCE, compiler=fake_compiler(tmp_path, script))
    assert not list(cache.iterdir())


@posix
def test_what_is_no_library_is_not_kept(cache, tmp_path):
    garbage = 'while [ "$1" != -o ]; do shift; done; echo "no machine code" > "$2"; exit 0'
    with pytest.raises(CompilerError, match="wrote no library"):
        cached_library(SOURCE, compiler=fake_compiler(tmp_path, garbage))
    assert not list(cache.iterdir())


def test_a_compiler_that_has_gone(cache, tmp_path):
    gone = compiler.Compiler((str(tmp_path / "gone"),), "1")
    with pytest.raises(CompilerError, match="does not start"):
        cached_library(SOURCE, compiler=gone)


def test_folders_that_a_killed_process_left_are_removed(cache):
    cache.mkdir(parents=True)
    old, new = cache / "build-old", cache / "build-new"
    for folder in (old, new):
        folder.mkdir()
        (folder / "f.c").write_text("")
    os.utime(old, (time.time() - 2 * 86_400,) * 2)
    compiler._remove_orphans.cache_clear()
    assert cache_dir() == cache
    assert not old.exists()
    assert new.exists()
