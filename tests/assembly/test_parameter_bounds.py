"""Bounds of parameters are what the components that hold them refuse."""

import pickle
import sys

import pytest

import mbs
from mbs.assembly import symbolic
from mbs.components import Body, Box, CoulombFriction, Cylinder, JointStop, Revolute, RigidStop
from mbs.errors import DescriptionError

TENSOR = ((0.02, 0, 0), (0, 0.03, 0), (0, 0, 0.04))
TINY = sys.float_info.min


def P(name, default=1.0):
    return mbs.Parameter(name, default)


def system_of(body, *more, **joint):
    m = mbs.Mechanism("m", gravity=(0, -9.81, 0))
    m.connect(m.world, Revolute("j", axis="z", **joint), m.add(body))
    for element in more:
        m.add(element)
    return m.assemble()


@pytest.mark.parametrize(
    ("body", "bounds"),
    [
        (Body("b", mass=P("x"), com=(0.3, 0, 0), inertia=TENSOR), (0.0, None)),
        (Body("b", mass=2 * P("x"), com=(0.3, 0, 0), inertia=TENSOR), (0.0, None)),
        (Body("b", mass=1 + P("x"), com=(0.3, 0, 0), inertia=TENSOR), None),
        (Body("b", mass=1.0, com=(P("x"), 0, 0), inertia=TENSOR), None),
        (Box("b", length=P("x"), width=0.1, density=1000), (TINY, None)),
        (Box("b", length=1.0, width=P("x"), density=1000), (TINY, None)),
        (Box("b", length=1.0, width=0.1, density=P("x")), (0.0, None)),
        (Box("b", length=1.0, width=0.1, mass=P("x")), (0.0, None)),
        (Cylinder("b", radius=0.1, inner_radius=P("x", 0.05), density=1e3), (0.0, None)),
    ],
)
def test_bodies(body, bounds):
    assert system_of(body).bounds == ({} if bounds is None else {"x": bounds})


def test_joints_and_forces():
    body = Body("b", mass=1.0, com=(0.3, 0, 0), inertia=TENSOR)
    found = system_of(
        body,
        RigidStop("stop", "j", lower=P("low", -1.0), upper=P("high"), restitution=P("e", 0.5)),
        CoulombFriction("dry", "j", sliding=P("mu")),
        JointStop("soft", "j", lower=-1.0, stiffness=P("k"), damping=P("c"), width=0.1),
        Fv=P("Fv"),
        Ia=P("Ia"),
    ).bounds
    assert found == {
        "e": (0.0, 1.0),
        "mu": (TINY, None),  # with the number 0 it holds nothing
        "k": (TINY, None),
        "c": (0.0, None),
        "Fv": (0.0, None),
        "Ia": (0.0, None),
    }


def test_the_bounds_are_those_that_assembly_has():
    for value, refused in ((-1e-6, True), (0.0, True), (TINY, False)):
        if refused:
            with pytest.raises(DescriptionError, match="give a length above zero"):
                Box("b", length=P("x", value), width=0.1, density=1000)
        else:
            body = Box("b", length=P("x", value), width=0.1, density=1000)
            assert system_of(body).bounds == {"x": (TINY, None)}


def test_a_component_bounds_its_parameter_wherever_it_stands():
    body = Box("b", length=P("x"), width=P("x"), mass=P("x"))
    assert system_of(body).bounds == {"x": (TINY, None)}


def test_numbers_that_become_symbols():
    system = symbolic(mbs.load("puma560").assemble(), ["masses", "inertias", "lengths", "friction"])
    names = {p.name for p in system.parameters}
    bounded = {name for name in names if name.startswith(("M", "XX", "YY", "ZZ", "Fv", "Fs"))}
    assert system.bounds == dict.fromkeys(bounded, (0.0, None))
    assert {"M2", "d3"} <= names
    assert pickle.loads(pickle.dumps(system.bounds)) == system.bounds
