"""An FMU refuses starts and parameters that have no sense, in words of its own."""

import fmpy
import pytest

import mbs
from mbs.components import Body, Revolute, Spherical


@pytest.fixture(scope="module", params=["2.0", "3.0"])
def archive(request, tmp_path_factory):
    m = mbs.Mechanism("rules")
    ball = m.add(Body("b", mass=1.0, com=(0, 0, 0.1), inertia=(0.02, 0.02, 0.01)))
    arm = m.add(
        Body(
            "arm",
            mass=mbs.Parameter("M", 2.0) - mbs.Parameter("cut", 0.5),
            com=(0.3, 0, 0),
            inertia=(0.1, 0.1, 0.1),
        )
    )
    m.connect(m.world, Spherical("s"), ball)
    m.connect(m.world, Revolute("j", axis="y"), arm)
    path = tmp_path_factory.mktemp("rules") / f"rules{request.param[0]}.fmu"
    return mbs.export.fmu(m.assemble(), path, fmi=request.param)


def outcome(path, start, fmi_type="CoSimulation"):
    """What is logged where it stops; empty where it runs."""
    said = []

    def logger(*args):
        said.append(str(args[-1]))

    try:
        fmpy.simulate_fmu(
            str(path), stop_time=0.05, start_values=start, fmi_type=fmi_type, logger=logger
        )
    except Exception:
        return " ".join(said) or "stopped"
    return ""


@pytest.mark.sweep
@pytest.mark.parametrize("fmi_type", ["CoSimulation", "ModelExchange"])
@pytest.mark.parametrize(
    ("start", "sentence"),
    [
        ({}, ""),
        ({"s.qw.q": 2.0}, "the quaternion of s is not of unit length; divide it by its length"),
        ({"s.qw.q": 0.0}, "the quaternion of s is not of unit length"),
        ({"s.qw.q": 0.6, "s.qx.q": 0.8}, ""),
        ({"cut": 3.0}, "arm, mass is too small; give zero or more"),
        ({"cut": 3.0, "M": 4.0}, ""),
    ],
)
def test_starts(archive, start, sentence, fmi_type):
    said = outcome(archive, start, fmi_type)
    assert sentence in said
    assert bool(said) == bool(sentence)
