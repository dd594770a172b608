"""Derivatives of dynamic models by states and inputs of components."""

import casadi
import numpy as np
import pytest
from casadi import MX

import mbs
from mbs import Mechanism
from mbs.components import (
    Body,
    Custom,
    Revolute,
    custom,
)
from mbs.errors import ModelError
from mbs.models import direct_dynamics_derivatives, inverse_dynamics_derivatives

FEW, MANY = 4, 12
"""Joints of trees whose derivatives are written out, and made column by column."""


class Thruster(Custom):
    """Force on a point of an input, a state and a parameter, in axes of the point."""

    point = custom.frame()
    gain = custom.parameter("1", min=0)
    thrust = custom.state("N", start=0.5)
    command = custom.input("N")

    def rates(self, at):
        return {"thrust": 5 * (at.command - at.thrust)}

    def loads(self, at):
        across = at.gain * at.thrust * at.command
        return {"point": custom.force(at.point.R @ casadi.vertcat(at.thrust**2, across, 0))}


def arm(joints, loop=False):
    m = Mechanism("arm", gravity=(0, -9.81, 0))
    before = m.world
    for k in range(joints):
        link = m.add(Body(f"link{k}", mass=1.5, com=(0.1, 0.2, 0), inertia=(0.1, 0.2, 0.15)))
        axis = "z" if loop else "xyz"[k % 3]
        m.connect(before.at(0.5, 0, 0), Revolute(f"j{k}", axis=axis), link)
        before = link
    if loop:
        end = Revolute("end", axis="z")
        m.connect(m.world.at(1.2, 0.1, 0), end, before.at(0.5, 0, 0))
        m.cut(end)
    m.add(Thruster("thruster", before, gain="G"))
    m.values["G"] = mbs.Parameter("G", 0.3, min=0)
    return m.assemble()


def differences(f, values, which, width=1e-6):
    columns = []
    for k in range(len(values[which])):
        sides = []
        for sign in (1, -1):
            moved = [np.array(value, float) for value in values]
            moved[which][k] += sign * width
            sides.append(np.array(f(*moved)))
        columns.append((sides[0] - sides[1]) / (2 * width))
    return np.hstack(columns)


@pytest.mark.parametrize(("joints", "loop"), [(FEW, False), (MANY, False), (3, True)])
@pytest.mark.parametrize("method", ["auto", "ad"])
def test_slopes_by_states_and_inputs(joints, loop, method):
    system = arm(joints, loop)
    names = ("u", "q", "z", "tau") if loop else ("u", "q", "p", "z", "tau")
    f = direct_dynamics_derivatives(system, method, with_respect_to=names)
    g = inverse_dynamics_derivatives(
        system, method, with_respect_to=[{"tau": "a"}.get(name, name) for name in names]
    )
    assert f.name_in()[-3:] == g.name_in()[-3:] == ["z", "u", "p"]
    rng = np.random.default_rng(1)
    m = len(system.chosen_coordinates)
    q = np.array(system.configuration) + (0 if loop else rng.uniform(-1, 1, system.nq))
    values = [q, rng.uniform(-1, 1, m), rng.uniform(-1, 1, m), [0.7], [0.4], [0.3]]
    for slopes, model in (
        (f, mbs.models.direct_dynamics(system)),
        (g, mbs.models.inverse_dynamics(system)),
    ):
        found = dict(zip(slopes.name_out(), slopes(*values), strict=True))
        for name, number in (("z", 3), ("u", 4), *(() if loop else (("p", 5),))):
            slope = next(np.array(found[key]) for key in found if key.endswith(f"_d{name}"))
            assert np.abs(slope).max() > 0.01
            np.testing.assert_allclose(slope, differences(model, values, number), 0, 1e-7)


def test_the_implicit_jacobian_has_columns_of_states_and_inputs():
    system = arm(MANY)
    ddm = mbs.models.direct_dynamics(system)
    model = mbs.models.with_implicit_jacobian(system, ddm)
    inputs = [MX.sym(name, model.size_in(name)) for name in model.name_in()]
    columns = casadi.jacobian(model(*inputs), casadi.vertcat(*inputs[3:]))
    slopes = casadi.Function("slopes", inputs, [columns])
    rng = np.random.default_rng(2)
    values = [*rng.uniform(-1, 1, (3, MANY)), [0.7], [0.4], [0.3]]
    expected = np.hstack([differences(ddm, values, number) for number in (3, 4, 5)])
    np.testing.assert_allclose(slopes(*values), expected, 0, 1e-7)


@pytest.mark.parametrize(("name", "words"), [("z", "states"), ("u", "inputs")])
def test_a_system_without_them(name, words):
    system = mbs.robots.planar_2r().assemble()
    for slopes in (direct_dynamics_derivatives, inverse_dynamics_derivatives):
        with pytest.raises(
            ModelError, match=f"it has no {words} of components; leave '{name}' out"
        ):
            slopes(system, with_respect_to=["q", name])
