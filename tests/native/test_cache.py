import ctypes
import os
import sys
from concurrent.futures import ThreadPoolExecutor

import pytest

from mbs.errors import CompilerError
from mbs.native import cached_library
from mbs.native.compiler import cache_dir

SOURCE = {"f.c": '#include "f.h"\nint f(void) { return ANSWER; }', "f.h": "#define ANSWER 42"}


@pytest.fixture
def cache(monkeypatch, tmp_path):
    monkeypatch.setenv("MBS_CACHE_DIR", str(tmp_path / "cache"))
    return tmp_path / "cache"


def test_a_library_is_built_once(cache):
    path = cached_library(SOURCE)
    assert ctypes.CDLL(str(path)).f() == 42
    stamp = path.stat().st_mtime_ns
    assert cached_library(SOURCE) == path
    assert path.stat().st_mtime_ns == stamp
    assert list(cache.iterdir()) == [path]


def test_a_header_or_a_flag_makes_another_library(cache):
    first = cached_library(SOURCE)
    assert cached_library({**SOURCE, "f.h": "#define ANSWER 43"}) != first
    assert cached_library(SOURCE, ("-O0", "-fPIC", "-shared")) != first


def test_builders_at_once_do_not_disturb_each_other(cache):
    with ThreadPoolExecutor(4) as pool:
        paths = set(pool.map(lambda _: cached_library(SOURCE), range(4)))
    assert len(paths) == 1
    assert list(cache.iterdir()) == list(paths)


def test_refused_code_leaves_nothing(cache):
    with pytest.raises(CompilerError):
        cached_library({"f.c": "nonsense"})
    assert not list(cache.iterdir())


def test_a_cache_that_cannot_be_written_is_replaced(monkeypatch, tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("")
    monkeypatch.setenv("MBS_CACHE_DIR", str(blocked / "cache"))
    assert cache_dir().is_dir()
    assert ctypes.CDLL(str(cached_library(SOURCE))).f() == 42


@pytest.mark.skipif(os.name != "posix", reason="XDG folders")
def test_the_platform_cache_folder(monkeypatch, tmp_path):
    monkeypatch.delenv("MBS_CACHE_DIR", raising=False)
    monkeypatch.setattr("sys.platform", "linux")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache_dir() == tmp_path / "mbs"


PARTS = {
    "own.c": '#include "shared.h"\nint f(void) { return shared() + OWN; }',
    "shared.c": '#include "shared.h"\n#include <math.h>\nint shared(void) { return BASE; }',
    "shared.h": '#include "base.h"\nint shared(void);\n#define OWN 2',
    "base.h": "#define BASE 40",
}


def test_what_libraries_have_in_common_is_compiled_once(cache, monkeypatch):
    compiled = []
    module = sys.modules["mbs.native.compiler"]
    run = module._compile
    monkeypatch.setattr(
        module, "_compile", lambda c, given, s: (compiled.append(s), run(c, given, s))
    )
    first = cached_library(PARTS, common=("shared.c",))
    assert ctypes.CDLL(str(first)).f() == 42
    other = cached_library({**PARTS, "own.c": PARTS["own.c"] + "\n"}, common=("shared.c",))
    assert ctypes.CDLL(str(other)).f() == 42
    names = [[file.name for file in sources] for sources in compiled]
    assert sorted(names[:2]) == [["own.c"], ["shared.c"]]  # at the same time
    assert names[3] == ["own.c"]
    for linked in (names[2], names[4]):
        assert [name[-2:] for name in linked] == [".o", ".o"]
    assert len(names) == 5
    assert sorted(file.suffix for file in cache.iterdir()) == [".o", first.suffix, first.suffix]


def test_files_that_are_compiled_as_one(cache, monkeypatch):
    compiled = []
    module = sys.modules["mbs.native.compiler"]
    run = module._compile
    monkeypatch.setattr(
        module, "_compile", lambda c, given, s: (compiled.append(s), run(c, given, s))
    )
    library = cached_library(PARTS, together=("shared.c", "own.c"))
    assert ctypes.CDLL(str(library)).f() == 42
    ((one,),) = compiled
    assert one.name not in PARTS


def test_a_header_of_a_header_makes_another_object(cache):
    cached_library(PARTS, common=("shared.c",))
    changed = cached_library({**PARTS, "base.h": "#define BASE 41"}, common=("shared.c",))
    assert ctypes.CDLL(str(changed)).f() == 43


def test_a_damaged_object_is_compiled_again(cache):
    cached_library(PARTS, common=("shared.c",))
    (kept,) = cache.glob("*.o")
    kept.write_bytes(b"")
    other = cached_library({**PARTS, "own.c": PARTS["own.c"] + "\n"}, common=("shared.c",))
    assert ctypes.CDLL(str(other)).f() == 42
    assert kept.stat().st_size > 0
