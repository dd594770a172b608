"""Mechanisms at the edge of what models can be made of."""

import numpy as np
import pytest

import mbs
import mbs.models
from mbs import Mechanism
from mbs.components import (
    Body,
    Box,
    Cylindrical,
    Free,
    PointMass,
    Prismatic,
    Revolute,
)
from mbs.errors import AssemblyError, DescriptionError, ModelError
from mbs.expressions import Parameter


def test_a_light_pendulum_on_a_heavy_cart_has_accelerations():
    m = Mechanism("crane")
    cart = m.add(Body("cart", mass=1000))
    bob = m.add(PointMass("bob", mass=1e-3))
    rod = m.add(Body("rod", mass=0))
    m.connect(m.world, Prismatic("s", axis="x"), cart)
    m.connect(cart, Revolute("j", axis="y"), rod)
    m.connect(rod.at(0, 0, -0.05), bob)
    system = m.assemble()
    q, v, a = np.array([0.1, 0.2]), np.array([0.3, 0.4]), np.array([0.5, 0.6])
    tau = mbs.models.inverse_dynamics(system)(q, v, a)
    np.testing.assert_allclose(
        np.array(mbs.models.direct_dynamics(system)(q, v, tau)).ravel(), a, rtol=1e-6
    )


def test_a_joint_that_moves_nothing_is_named():
    m = Mechanism("loose")
    m.connect(m.world, Revolute("j"), m.add(Body("b", mass=0)))
    with pytest.raises(ModelError, match="loose: j can move without moving any inertia"):
        mbs.models.direct_dynamics(m.assemble())


def test_friction_by_a_symbol_of_value_zero_stays_in_the_equations():
    m = mbs.Mechanism("four", gravity=(0, -9.81, 0))
    a, b, c = (m.add(Box(n, length=x, mass=1)) for n, x in (("a", 0.4), ("b", 1.0), ("c", 0.9)))
    m.connect(m.world, Revolute("j1", actuated=True), a.left)
    m.connect(a.right, Revolute("j2", Fv=0.1), b.left)
    m.connect(b.right, Revolute("j3", Fv=Parameter("F", 0.0)), c.right)
    m.connect(m.world.at(0.8), Revolute("j4", Fv=0.1), c.left)
    system = m.assemble(guess={"j2": 1.0})
    q = mbs.loops.solve(system, {"j1": 0.5})
    idm = mbs.models.inverse_dynamics(system)
    assert float(idm(q, 1.0, 0.0, [50.0])) > float(idm(q, 1.0, 0.0, [0.0])) + 1


def test_dry_friction_width_by_a_symbol_of_value_zero():
    m = Mechanism("m", gravity=(0, 0, 0))
    b = m.add(Body("b", mass=1, inertia=(1, 1, 1)))
    m.connect(m.world, Revolute("j", Fs=2.0, Fs_width=Parameter("w", 0.0)), b)
    idm = mbs.models.inverse_dynamics(m.assemble())
    assert [float(idm([0], [v], [0])) for v in (-1, 0, 3)] == [-2, 0, 2]
    assert float(idm([0], [0.5], [0], [0.5])) == pytest.approx(2 * np.tanh(1))


def test_rotor_inertia_of_a_free_body_is_a_mass():
    """Ia on a Free joint adds to the kinetic energy of V and of w, in any motion."""
    m = Mechanism("free", gravity=(0, 0, 0))
    b = m.add(Body("b", mass=2, inertia=(1, 2, 2.5), com=(0.1, 0.2, 0)))
    m.connect(m.world, Free("f", Ia=0.7), b)
    system = m.assemble()
    rng = np.random.default_rng(0)
    q = np.array([0.1, 0.2, 0.3, 0.5, 0.5, 0.5, 0.5])
    v, a = rng.uniform(-1, 1, (2, 6))
    A, B, Q = (np.array(x) for x in mbs.models.lagrange(system)(q, v))
    tau = np.array(mbs.models.inverse_dynamics(system)(q, v, a)).ravel()
    np.testing.assert_allclose(A @ a + B @ v + Q.ravel(), tau, atol=1e-12)


def test_terminal_frame_moves_though_a_body_stands_on_the_ground():
    m = Mechanism("arm")
    pedestal, link = m.add(Body("pedestal", mass=5)), m.add(Box("link", length=1, mass=1))
    m.connect(m.world, pedestal)
    m.connect(pedestal.at(0, 0, 1), Revolute("j"), link.left)
    system = m.assemble()
    T = np.array(mbs.models.direct_geometry(system)([np.pi / 2]))
    np.testing.assert_allclose(T[:3, 0], [0, 1, 0], atol=1e-15)
    m.add_frame("tip", link.right)
    T = np.array(mbs.models.direct_geometry(m.assemble())([np.pi / 2]))
    np.testing.assert_allclose(T[:3, 3], [0, 1, 1], atol=1e-15)


def test_nested_mechanism_moves_in_the_gravity_of_the_outer_one():
    inner = Mechanism("arm", gravity=(0, "-g", 0), parameters={"g": 3.0})
    b = inner.add(PointMass("bob", mass=2))
    inner.connect(inner.world, Prismatic("s", axis="z"), b)
    outer = Mechanism("outer", gravity=(0, 0, -9.81))
    outer.connect(outer.world, outer.add(inner).base)
    system = outer.assemble()
    assert system.parameters == ()
    assert float(mbs.models.gravity_effort(system)([0])) == pytest.approx(2 * 9.81)


@pytest.mark.parametrize("A", [0.0, 1e-9, -0.4])
def test_axis_that_a_symbol_may_make_parallel(A):
    def tilted(angle, **parameters):
        m = Mechanism("tilt", parameters=parameters)
        a, b = (m.add(Body(n, mass=1, com=(0.1, 0, 0), inertia=(1, 1, 1))) for n in "ab")
        m.connect(m.world, Revolute("j1"), a)
        m.connect(a.at(0.2, 0.1, 0, rotation=("x", angle)), Revolute("j2"), b)
        return mbs.models.inverse_dynamics(m.assemble())

    given = [0.3, 0.4], [1.0, -2.0], [0.5, 0.6]
    efforts = np.array(tilted("A", A=0.0)(*given, [A]))
    np.testing.assert_allclose(efforts, np.array(tilted(A)(*given)), rtol=0, atol=1e-14)


@pytest.mark.parametrize(
    ("component", "message"),
    [
        (Body("b", mass="x"), "b: mass is -2 kg; give zero or more"),
        (Box("b", length="x", mass=1), "b: length is -2; give a length above zero"),
        (Body("b", mass=1, inertia=("x", 1, 1)), "negative principal moment -2"),
    ],
)
def test_values_of_symbols_are_checked_at_assembly(component, message):
    m = Mechanism("m", parameters={"x": -2.0})
    m.connect(m.world, Revolute("j"), m.add(component))
    with pytest.raises(DescriptionError, match=message):
        m.assemble()


def test_two_coordinates_of_one_name_are_refused():
    inner = Mechanism("a")
    inner.connect(inner.world, Prismatic("s"), inner.add(PointMass("p", mass=1)))
    outer = Mechanism("outer")
    placed = outer.add(inner)
    outer.connect(outer.world, Cylindrical("a"), placed.base)
    with pytest.raises(AssemblyError, match=r"outer: two coordinates are named 'a\.s'; rename"):
        outer.assemble()
