"""C files have the format of `.clang-format`."""

import shutil
import subprocess
import sysconfig
from pathlib import Path

import pytest

import mbs

ROOT = Path(mbs.__file__).parent
FOLDERS = ("core/source", "export/c", "export/fmu/c", "native/runtime")
PROGRAM = shutil.which("clang-format", path=sysconfig.get_path("scripts"))


@pytest.mark.skipif(PROGRAM is None, reason="clang-format is not installed")
@pytest.mark.parametrize("folder", FOLDERS)
def test_c_files_are_formatted(folder):
    files = [str(file) for file in sorted((ROOT / folder).glob("*.[ch]"))]
    assert files
    command = [str(PROGRAM), "--dry-run", "--Werror", *files]
    found = subprocess.run(command, capture_output=True, text=True, check=False)
    assert found.returncode == 0, found.stderr[:2000]


def test_every_c_file_is_in_a_formatted_folder():
    folders = {file.parent.relative_to(ROOT).as_posix() for file in ROOT.rglob("*.[ch]")}
    assert folders == set(FOLDERS)
