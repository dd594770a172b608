"""Descriptions of sensors: names of readings, what is refused, what stays as it was."""

import numpy as np
import pytest
from support.closed_mechanisms import planar_loop
from support.messages import refused

import mbs
import mbs.models
from mbs.components import (
    AbsoluteSensor,
    Body,
    DistanceSensor,
    JointSensor,
    PowerSensor,
    RelativeSensor,
    Revolute,
    WrenchSensor,
)
from mbs.errors import AssemblyError, DescriptionError, ModelError


def test_names_inside_a_mechanism():
    inner = mbs.Mechanism("inner")
    b = inner.add(Body("b", mass=1.0, com=(0.1, 0, 0), inertia=(1, 1, 1)))
    inner.connect(inner.world, Revolute("j", axis="y"), b)
    inner.add(AbsoluteSensor("tip", b.at("h"), quantities=("p",)))
    inner.add(WrenchSensor("pin-1", "j"))
    inner.add(JointSensor("2nd", "j"))
    inner.values = {"h": mbs.Parameter("h", 0.3)}
    outer = mbs.Mechanism("outer")
    for name, x in (("left", 0.0), ("right", 1.0)):
        outer.connect(outer.world.at(x), outer.add(inner, name).base)
    system = outer.assemble()
    names = mbs.models.measurements(system).name_out()
    assert names[:7] == [
        *("left_tip_p", "left_pin_1_f", "left_pin_1_m", "left_2nd_q", "left_2nd_v", "left_2nd_a"),
        "right_tip_p",
    ]
    assert mbs.models.measurements(inner.assemble()).name_out()[3] == "sensor_2nd_q"
    p = [mbs.models.measurements(system)([0, 0], [0, 0], [0, 0])[k] for k in (0, 6)]
    np.testing.assert_allclose([np.array(x).ravel() for x in p], [[0.3, 0, 0], [1.3, 0, 0]])
    assert "WrenchSensor left.pin-1 reads f, m of left.j." in system.report()
    assert system.sensors[0].columns[0] == ("left.tip.p.x", "m")


def bar():
    m = mbs.Mechanism("m")
    b = m.add(Body("b", mass=1.0, inertia=(1, 1, 1)))
    m.connect(m.world, Revolute("j"), b)
    return m, b


@pytest.mark.parametrize(
    ("make", "parts"),
    [
        (lambda m, b: AbsoluteSensor("s", "b"), ["s: point is 'b'; give a body"]),
        (lambda m, b: AbsoluteSensor("s", b, axes="a"), ["s: axes is 'a'; use 'world', or 'body'"]),
        (lambda m, b: RelativeSensor("s", b, m.world, axes="c"), ["axes is 'c'; use 'a', 'b'"]),
        (
            lambda m, b: AbsoluteSensor("s", b, quantities=("p", "vel")),
            ["s: there is no quantity 'vel'", "p, R, v, w, a, wd"],
        ),
        (lambda m, b: AbsoluteSensor("s", b, quantities="p"), ["s: quantities is 'p'; give some"]),
        (lambda m, b: RelativeSensor("s", b, b, quantities=()), ["s: quantities is ()"]),
        (lambda m, b: DistanceSensor("s", b, 3), ["s: b is 3; give a body"]),
        (lambda m, b: JointSensor("s", b), ["s: joint is Body", "give the name of a joint"]),
        (lambda m, b: WrenchSensor("s", "j", axes="x"), ["s: axes is 'x'"]),
    ],
)
def test_descriptions_refused(make, parts):
    m, b = bar()
    refused(DescriptionError, *parts, by=lambda: make(m, b))


@pytest.mark.parametrize(
    ("make", "parts"),
    [
        (
            lambda m, b: [AbsoluteSensor("s", Body("x", mass=0))],
            ["s: it is on 'x', which is not part of m"],
        ),
        (lambda m, b: [JointSensor("s", "k")], ["s: there is no coordinate 'k'", "j"]),
        (lambda m, b: [WrenchSensor("s", "k")], ["s: there is no joint 'k'"]),
        (lambda m, b: [PowerSensor("s", "b")], ["s: there is no joint 'b'"]),
        (
            lambda m, b: [AbsoluteSensor("t-p", b), AbsoluteSensor("t_p", b)],
            ["t_p: what it reads would be named 't_p_p', which is the name of a reading of t-p"],
        ),
        (
            lambda m, b: [AbsoluteSensor("v", b)],
            ["v: what it reads would be named 'v_a', which is the name of an input of the models"],
        ),
    ],
)
def test_assemblies_refused(make, parts):
    m, b = bar()
    for sensor in make(m, b):
        m.add(sensor)
    refused(AssemblyError, *parts, by=m.assemble)


def test_systems_without_sensors():
    refused(
        ModelError,
        "m: there is no sensor; add one to the mechanism",
        by=lambda: mbs.models.measurements(bar()[0].assemble()),
    )


def test_sensors_change_nothing():
    """Neither the choice of the cut joint nor a model."""
    mechanism, guess = planar_loop(1)
    plain = mechanism.assemble(guess=guess)
    cut = plain.cuts[0].edge.joint.name
    mechanism.add(JointSensor("s", cut))
    mechanism.add(WrenchSensor("w", cut))
    observed = mechanism.assemble(guess=guess)
    assert [row.edge.joint.name for row in observed.cuts] == [cut]
    models = [mbs.models.inverse_dynamics(s) for s in (plain, observed)]
    assert models[0].n_instructions() == models[1].n_instructions()
