"""How far local tangent coordinates of passage_chart.c reach, on a circle."""

import ctypes
import re
from pathlib import Path

import numpy as np
import pytest

from mbs.core import core_files
from mbs.core.build import SOURCE
from mbs.native import cached_library, compiler_found

pytestmark = pytest.mark.skipif(not compiler_found(), reason="no C compiler")

CIRCLE = Path(__file__).parents[1] / "support" / "circle_chart.c"
NAMES = ("stepper", "dopri5", "dense", "sparse_pattern", "sparse_qr", "skyline")
PASSAGE = sorted(file.stem for file in SOURCE.glob("passage*.c"))
FILES = [name + end for name in (*NAMES, *PASSAGE) for end in (".c", ".h")]


@pytest.fixture(scope="module")
def state_at():
    """State and alignment at an angle [rad] from the origin of the chart, or the status."""
    texts = core_files(FILES)
    statuses = re.search(r"enum \{(.*?)\}", re.sub(r"/\*.*?\*/", "", texts["stepper.h"]), re.S)[1]
    names = [name.partition("=")[0].strip() for name in statuses.split(",")]
    function = ctypes.CDLL(str(cached_library(texts | {CIRCLE.name: CIRCLE.read_text()})))
    x, alignment = np.zeros(4), np.zeros(1)

    def state(angle):
        addresses = (ctypes.c_void_p(array.ctypes.data) for array in (x, alignment))
        status = function.circle_state(ctypes.c_double(angle), *addresses)
        return (x.copy(), alignment[0]) if status == 0 else names[status]

    return state


@pytest.mark.parametrize("degrees", [-78.3, -40, 0, 20, 60, 78.3])
def test_states_within_the_chart(state_at, degrees):
    a = np.deg2rad(degrees)
    x, alignment = state_at(a)
    assert x == pytest.approx([np.cos(a), np.sin(a), -np.sin(a), np.cos(a)], abs=1e-11)
    assert alignment == pytest.approx(np.cos(a), abs=1e-12)


@pytest.mark.parametrize("degrees", [-89, -78.6, 78.6, 89])
def test_a_chart_is_left_where_its_tangents_have_turned_by_78_degrees(state_at, degrees):
    """At an alignment of 0.2: arccos(0.2) is 78.46 degrees."""
    assert state_at(np.deg2rad(degrees)) == "STEPPER_CHART_LEFT"
