"""Gravity and mount from texts."""

import numpy as np
import pytest

import mbs
from mbs.app.tasks.mounting import mounting_of
from mbs.errors import DescriptionError


def test_texts_are_the_arguments_of_load():
    assert mounting_of() == mounting_of(" ") == {}
    assert mounting_of("0, 0, -1.62") == {"gravity": ["0", "0", "-1.62"]}
    steps = ["x=pi", "position = 0, 0, 2.5", "z=pi/2", "x=-pi"]
    assert mounting_of(mount=steps) == {
        "mount": {
            "rotation": [("x", "pi"), ("z", "pi/2"), ("x", "-pi")],
            "position": ["0", "0", "2.5"],
        }
    }


def test_a_robot_on_a_wall():
    given = mounting_of("0,0,-1.62", ["x=pi/2"])
    system = mbs.load("rx90", **given).assemble()
    gravity = [float(system.tree.gravity[k]) for k in range(3)]
    np.testing.assert_allclose(gravity, [0, -1.62, 0], atol=1e-15)


@pytest.mark.parametrize(
    ("gravity", "mount", "message"),
    [
        ("9.81", [], "gravity: '9.81' has not three values; write them as 0,0,-9.81"),
        ("1,,2", [], "gravity: '1,,2' has not three values"),
        ("", ["x"], "mount: 'x' is no step of a mount; write a rotation as x=pi/2"),
        ("", ["w=1"], "mount: 'w=1' is no step of a mount"),
        ("", ["position=1"], "mount position: '1' has not three values"),
        ("", ["position=0,0,1", "position=0,0,2"], "mount: the position is given twice"),
    ],
)
def test_other_texts_raise(gravity, mount, message):
    with pytest.raises(DescriptionError) as caught:
        mounting_of(gravity, mount)
    assert message in str(caught.value)
