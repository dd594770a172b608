"""The library of a Function is found again without its text, and made again when it is damaged."""

import subprocess
import sys

import casadi
import numpy as np
import pytest
from casadi import SX, Function

from mbs.native import cached_library, compiled, compiler_found, kernel
from mbs.native.compiler import LIBRARY_SUFFIX, is_whole

pytestmark = pytest.mark.skipif(not compiler_found(), reason="there is no compiler")

MAKER = sys.modules["mbs.native._compiled"]
POINT = np.array([0.3, -0.7])


@pytest.fixture
def cache(monkeypatch, tmp_path):
    monkeypatch.setenv("MBS_CACHE_DIR", str(tmp_path / "cache"))
    return tmp_path / "cache"


@pytest.fixture
def built(monkeypatch):
    """How often a text was written."""
    calls = []
    make = MAKER._compiled

    def counted(*arguments):
        calls.append(arguments)
        return make(*arguments)

    monkeypatch.setattr(MAKER, "_compiled", counted)
    return calls


def model(factor=2.0, name="f", options=None):
    x = SX.sym("x", 2)
    return Function(name, [x], [factor * casadi.sin(x) * x[1]], ["x"], ["y"], options or {})


def replaced(file, content):
    """Another file of the same name: the first one may be loaded."""
    file.unlink()
    file.write_bytes(content)


def parts(cache):
    return {suffix: sorted(cache.glob(f"*{suffix}")) for suffix in (".library", LIBRARY_SUFFIX)}


@pytest.mark.parametrize("fast", [False, True])
def test_a_text_is_written_once(cache, built, fast):
    first, second = (compiled(model(), fast=fast) for _ in range(2))
    assert len(built) == 1
    np.testing.assert_array_equal(first(POINT), second(POINT))
    np.testing.assert_allclose(np.array(second.call([POINT])[0]), np.array(model()(POINT)))


def test_what_differs_has_a_library_of_its_own(cache, built):
    slope = SX([[1.0, 2.0], [3.0, 4.0]])
    x, y = SX.sym("x", 2), SX.sym("y", 2)
    given = Function("jac_f", [x, y], [slope], ["x", "out_y"], ["jac_y_x"])
    compiled(model())
    compiled(model(3.0))
    compiled(model(name="g"))
    compiled(model(), derivatives=2)
    compiled(model(), fast=True)
    other = compiled(model(options={"custom_jacobian": given}))
    assert len(built) == 6
    found = other.jacobian()(POINT, np.zeros(2))
    np.testing.assert_array_equal(np.array(found), np.array(casadi.DM(slope)))


def test_another_writer_writes_again(cache, built, monkeypatch):
    compiled(model())
    monkeypatch.setattr(kernel, "_generator_hash", lambda: "another version")
    compiled(model())
    assert len(built) == 2


@pytest.mark.parametrize(
    "damage",
    [
        lambda entry, library: entry.write_text("nothing.so"),
        lambda entry, library: entry.write_text("../" + library.name),
        lambda entry, library: entry.write_bytes(b"\xff\x00\xff"),
        lambda entry, library: entry.write_text(""),
        lambda entry, library: entry.unlink(),
        lambda entry, library: library.unlink(),
        lambda entry, library: replaced(library, library.read_bytes()[:100]),
        lambda entry, library: replaced(library, b""),
    ],
)
def test_what_is_damaged_is_made_again(cache, built, damage):
    function = model(5.0)
    with_array = compiled(function)  # the helper of array calls is in the cache too
    before = parts(cache)
    (entry,) = before[".library"]
    library = cache / entry.read_text()
    damage(entry, library)
    again = compiled(function)
    assert len(built) == 2
    assert is_whole(cache / entry.read_text())
    np.testing.assert_array_equal(again(POINT), with_array(POINT))
    assert parts(cache) == before


def test_a_damaged_library_of_texts_is_built_again(cache):
    files = {"f.c": "int f(void) { return 42; }"}
    library = cached_library(files)
    whole = library.read_bytes()
    library.write_bytes(whole[:50])
    assert not is_whole(library)
    assert cached_library(files) == library
    assert library.read_bytes() == whole


def test_a_library_that_another_user_keeps_to_himself_is_built_elsewhere(cache, monkeypatch):
    files = {"f.c": "int f(void) { return 43; }"}
    library = cached_library(files)
    module = sys.modules["mbs.native.compiler"]
    read = module._checksum

    def guarded(path):
        if path == library:
            raise PermissionError(path)
        return read(path)

    def held(source, target):
        raise PermissionError(target)

    module._checked.cache_clear()
    monkeypatch.setattr(module, "_checksum", guarded)
    monkeypatch.setattr(module.os, "replace", held)
    assert not is_whole(library)
    own = cached_library(files)
    assert own.parent != cache
    assert own.read_bytes() == library.read_bytes()


def test_an_index_that_cannot_be_written_is_done_without(cache, built, monkeypatch):
    def full(source, target):
        raise OSError("no space is left")

    model_before = compiled(model(7.0))
    for entry in parts(cache)[".library"]:
        entry.unlink()
    monkeypatch.setattr(kernel.os, "replace", full)
    again = compiled(model(7.0))
    np.testing.assert_array_equal(again(POINT), model_before(POINT))
    assert len(built) == 2
    assert not parts(cache)[".library"]
    assert not list(cache.glob("build-*"))


def test_a_callback_is_left_to_the_interpreter(cache, built):
    class Twice(casadi.Callback):
        def __init__(self):
            casadi.Callback.__init__(self)
            self.construct("twice", {})

        def eval(self, arguments):
            return [2 * arguments[0]]

    twice = Twice()
    x = casadi.MX.sym("x")
    function = compiled(Function("outer", [x], [twice(x) + 1]), derivatives=0)
    assert function(3)[0] == 7
    assert not parts(cache)[".library"]


def test_processes_at_once(cache):
    text = (
        "import casadi; from mbs.native import compiled; x = casadi.SX.sym('x', 3);"
        "f = compiled(casadi.Function('f', [x], [casadi.sin(x) * x[0]]), derivatives=2, fast=True);"
        "print(f.is_a('External'), float(f([0.5, 1, 2])[2]))"
    )
    running = [
        subprocess.Popen([sys.executable, "-c", text], stdout=subprocess.PIPE, text=True)
        for _ in range(3)
    ]
    said = {process.communicate()[0] for process in running}
    assert len(said) == 1
    kind, value = said.pop().split()
    assert kind == "True"
    assert float(value) == pytest.approx(0.5 * np.sin(2), rel=1e-14)
    assert len(parts(cache)[".library"]) == 1
    assert not list(cache.glob("build-*"))
