import os
import stat

import pytest

from mbs.errors import ExportError
from mbs.files import path_of, read_sealed, whole_file, write_bytes, write_sealed, write_text


def test_text_is_written_as_it_is(tmp_path):
    write_text("å\r\nb\n", tmp_path / "a.txt")
    assert (tmp_path / "a.txt").read_bytes() == "å\r\nb\n".encode()
    write_bytes(b"\0", str(tmp_path / "a.txt"))
    assert (tmp_path / "a.txt").read_bytes() == b"\0"
    assert len(list(tmp_path.iterdir())) == 1


def test_permissions_are_those_of_any_file(tmp_path):
    (tmp_path / "plain").write_text("")
    write_text("", tmp_path / "ours")
    modes = {stat.S_IMODE(path.stat().st_mode) for path in tmp_path.iterdir()}
    assert len(modes) == 1


def test_an_interrupted_block_leaves_the_old_file(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("old")

    def interrupted():
        with whole_file(path) as scratch:
            scratch.write_text("new")
            assert scratch.suffix == ".txt"
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(
    ("path", "message"),
    [
        ("", "is a folder"),
        ("no/a.txt", "the file cannot be written .*; choose a writable place"),
        ("folder" + os.sep, "is a folder; give the name of a file"),
    ],
)
def test_places_that_are_refused(tmp_path, path, message):
    with pytest.raises(ExportError, match=message):
        write_text("", f"{tmp_path}{os.sep}{path}")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("path", [None, 3, b"a"])
def test_what_is_no_path(path):
    with pytest.raises(ExportError, match="is not a path"):
        path_of(path)


def test_what_is_sealed_is_read_back_whole_or_not_at_all(tmp_path):
    path = tmp_path / "sealed"
    content = b"first\nsecond\x00\n"
    write_sealed(content, path)
    assert read_sealed(path) == content
    for damaged in (b"", path.read_bytes()[:-1], path.read_bytes().replace(b"first", b"fIrst")):
        path.write_bytes(damaged)
        with pytest.raises(ValueError, match="sealed is damaged"):
            read_sealed(path)
    with pytest.raises(OSError, match="No such file"):
        read_sealed(tmp_path / "none")
