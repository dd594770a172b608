"""C files of the core of an FMU and of the run-time library include in one direction."""

import re
from pathlib import Path

import pytest

import mbs
from mbs.core.build import SOURCE
from mbs.export.fmu.pack import _CORE_HEADERS, FACES

FMU = Path(mbs.__file__).parent / "export" / "fmu" / "c"
RANK = {header: number for number, header in enumerate(_CORE_HEADERS)}


def included(file: Path) -> list[str]:
    return re.findall(r'^#include "(.+)"$', file.read_text(encoding="utf-8"), re.MULTILINE)


@pytest.mark.parametrize("header", _CORE_HEADERS)
def test_a_part_of_the_core_includes_lower_parts_only(header):
    for file in (FMU / header, (FMU / header).with_suffix(".c")):
        if file.exists():
            above = [name for name in included(file) if RANK.get(name, -1) > RANK[header]]
            assert above == [], file


def test_every_file_of_the_core_is_in_an_fmu():
    compiled = {n for face in FACES.values() for n in (*face.compiled("rodas"), *face.headers)}
    assert {file.name for file in FMU.iterdir()} - compiled == {*RANK, "memory.h"}


@pytest.mark.parametrize("folder", [FMU, SOURCE], ids=["fmu", "library"])
def test_headers_include_each_other_in_no_circle(folder):
    left = {header.name: set(included(header)) for header in folder.glob("*.h")}
    left = {name: uses & left.keys() for name, uses in left.items()}
    while lowest := {name for name, uses in left.items() if not uses}:
        left = {name: uses - lowest for name, uses in left.items() if name not in lowest}
    assert left == {}
