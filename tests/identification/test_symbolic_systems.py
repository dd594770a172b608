"""Systems with parameters, and with states and inputs of components, are identified or refused."""

import casadi
import numpy as np
import pytest

import mbs
from mbs import Mechanism
from mbs import identification as ident
from mbs.components import (
    Body,
    Custom,
    Revolute,
    custom,
)
from mbs.errors import ModelError

RATE = 200.0
TIME = np.arange(2400) / RATE


def tree(length, *parts):
    """An arm of three links, with parts on the point of the last."""
    m = Mechanism("robot", gravity=(0, -9.81, 0))
    before = m.world
    for k in range(3):
        link = m.add(Body(f"link{k}", mass=1.5, com=(0.1, 0.02, 0), inertia=(0.1, 0.2, 0.15)))
        m.connect(before, Revolute(f"j{k}", axis="zyy"[k], Ia=0.05), link)
        before = link.at(length, 0, 0)
    for part in parts:
        m.add(part("part", before))
    return m.assemble()


def four_bar(length):
    """A crank, a coupler and a rocker."""
    m = Mechanism("robot", gravity=(0, -9.81, 0))
    before = m.world
    for name, reach in zip(("crank", "coupler", "rocker"), (length, 0.9, 0.8), strict=True):
        link = m.add(Body(name, mass=1.2, com=(0.2, 0.03, 0), inertia=(0.1, 0.2, 0.15)))
        m.connect(before, Revolute(f"j_{name}", axis="z", actuated=name == "crank"), link)
        before = link.at(reach, 0, 0)
    end = Revolute("end", axis="z", actuated=False)
    m.connect(before, end, m.world.at(1.0, 0, 0))
    m.cut(end)
    return m.assemble(guess={"j_coupler": 1.0, "j_rocker": -2.0})


def symbol():
    return mbs.Parameter("L", 0.3, unit="m")


def record(system):
    """Efforts by the model along a motion of the independent joints, with a little noise."""
    w = np.array([2.0, 3.1, 4.3])[: len(system.independent), None]
    q, v, a = np.sin(w * TIME).T, (w * np.cos(w * TIME)).T, (-(w**2) * np.sin(w * TIME)).T
    idm = mbs.models.inverse_dynamics(system)
    whole = ident.leading.positions(system, q)
    tau = np.array([np.array(idm(*x)).ravel() for x in zip(whole, v, a, strict=True)])
    noise = np.random.default_rng(0).normal(0, 1e-3, tau.shape)
    return ident.Record(time=TIME, q=q, tau=tau + noise, v=v)


@pytest.mark.parametrize("describe", [tree, four_bar])
@pytest.mark.parametrize("equations", ["dynamic", "filtered", "energy"])
def test_a_system_with_parameters_is_identified_as_one_with_numbers(describe, equations):
    symbolic, numeric = describe(symbol()), describe(0.3)
    assert ([p.name for p in symbolic.parameters], numeric.parameters) == (["L"], ())
    data = record(numeric)
    found, expected = (
        ident.identify(system, data, bandwidth=8.0, equations=equations, quiet=True).estimate
        for system in (symbolic, numeric)
    )
    assert expected.residuals.total_percent < 1
    total = found.residuals.total_percent
    assert total == pytest.approx(expected.residuals.total_percent, rel=1e-6)


def test_instruments_and_excitation_of_a_system_with_parameters():
    symbolic, numeric = tree(symbol()), tree(0.3)
    data = record(numeric)
    found = [
        ident.identify(system, data, 8.0, method="instrumental", quiet=True).estimate
        for system in (symbolic, numeric)
    ]
    assert found[0].residuals.total_percent == pytest.approx(
        found[1].residuals.total_percent, rel=1e-6
    )
    series = ident.FourierSettings(period=4.0, harmonics=3, samples=20)
    limits = {"position": 1.5, "velocity": 4.0, "effort": 100.0}
    plane = ident.Plane("link2", (0.1, 0, 0), (0, 1, 0), -0.9)
    motions = [
        ident.excitation(
            system,
            ident.base_parameters(numeric),
            series=series,
            planes=[plane],
            starts=1,
            rounds=3,
            **limits,
        )
        for system in (symbolic, numeric)
    ]
    t = np.linspace(0, 4, 9)
    np.testing.assert_allclose(motions[0].series.q(t), motions[1].series.q(t), atol=1e-6)


class Thruster(Custom):
    """A force that an input commands."""

    point = custom.frame()
    command = custom.input("N")

    def loads(self, at):
        return {"point": custom.force(casadi.vertcat(0, at.command, 0))}


def test_inputs_of_components_are_no_part_of_a_record():
    data, driven = record(tree(0.3)), tree(0.3, Thruster)
    with pytest.raises(ModelError, match=r"\(part\.command\), which no record of a motion holds"):
        ident.identify(driven, data, bandwidth=8.0, quiet=True)
    with pytest.raises(ModelError, match=r"\(part\.command\), which no record of a motion holds"):
        ident.excitation(driven, ident.base_parameters(driven), position=1.0, effort=50.0)


def test_the_model_of_a_motion_is_that_at_the_defaults():
    system = tree(symbol())
    model = mbs.models.inverse_dynamics(system)
    along = ident.leading.motion_function(model)
    assert along.name_in() == ["q", "v", "a"]
    x = [[0.1, -0.4, 0.7], [1.0, 0.5, -0.3], [0.2, 0.4, 0.6]]
    np.testing.assert_allclose(along(*x), model(*x, [0.3]), 0, 1e-13)
