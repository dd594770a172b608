"""Bodies: their inertia against textbooks and sums of small masses, and what they refuse."""

import math

import casadi
import numpy as np
import pytest
from casadi import DM, SX
from support.messages import refused
from support.random_trees import random_rotation

import mbs
from mbs.components import (
    Body,
    Box,
    Cylinder,
    Free,
    KhalilBody,
    PointMass,
    Prismatic,
    Revolute,
    Spherical,
    Universal,
    World,
)
from mbs.errors import DescriptionError, ExpressionError, ModelError
from mbs.expressions import Parameter, parameters_of
from mbs.spatial.inertia import TEN_PARAMETERS


def ten(body, **values):
    """The ten parameters of a body, its symbols at these values."""
    symbols = {name: SX.sym(name) for name in values}
    f = casadi.Function("f", list(symbols.values()), [body.inertial(symbols).parameters])
    return np.array(f.call([casadi.DM(v) for v in values.values()])[0]).ravel()


def ten_of_points(masses, points):
    J = np.einsum("k,kij->ij", masses, np.einsum("ka,ka,ij->kij", points, points, np.eye(3)))
    J -= np.einsum("k,ka,kb->ab", masses, points, points)
    return np.array(
        [J[0, 0], J[0, 1], J[0, 2], J[1, 1], J[1, 2], J[2, 2], *(masses @ points), masses.sum()]
    )


def gauss(n, low, high):
    x, w = np.polynomial.legendre.leggauss(n)
    return (high + low) / 2 + (high - low) / 2 * x, w * (high - low) / 2


def grid(*axes):
    points = np.stack(
        [g.ravel() for g in np.meshgrid(*(x for x, _ in axes), indexing="ij")], axis=1
    )
    weights = np.prod(
        [g.ravel() for g in np.meshgrid(*(w for _, w in axes), indexing="ij")], axis=0
    )
    return points, weights


def test_box_against_integration():
    points, volume = grid(gauss(4, 0, 0.7), gauss(4, -0.1, 0.1), gauss(4, -0.15, 0.15))
    box = Box("b", length=0.7, width=0.2, height=0.3, density=2700)
    np.testing.assert_allclose(
        ten(box), ten_of_points(2700 * volume, points), rtol=1e-12, atol=1e-12
    )
    assert float(str(box.solid_mass)) == pytest.approx(2700 * 0.7 * 0.2 * 0.3)


@pytest.mark.parametrize("inner", [0.0, 0.03])
def test_cylinder_against_integration(inner):
    xr, phi = grid(gauss(4, 0, 0.8), gauss(6, inner, 0.05)), 2 * np.pi * np.arange(8) / 8
    points = np.concatenate(
        [
            np.column_stack([xr[0][:, 0], xr[0][:, 1] * np.cos(a), xr[0][:, 1] * np.sin(a)])
            for a in phi
        ]
    )
    volume = np.tile(xr[1] * xr[0][:, 1] * 2 * np.pi / 8, 8)
    cylinder = Cylinder("c", length=0.8, radius=0.05, inner_radius=inner, density=7800)
    np.testing.assert_allclose(
        ten(cylinder), ten_of_points(7800 * volume, points), rtol=1e-12, atol=1e-12
    )


def test_mass_and_density_describe_the_same_solid():
    for shape, volume in (
        (lambda **k: Box("b", length=0.7, width=0.2, height=0.3, **k), 0.7 * 0.2 * 0.3),
        (lambda **k: Cylinder("b", length=0.7, radius=0.2, **k), 0.7 * np.pi * 0.04),
    ):
        np.testing.assert_allclose(
            ten(shape(density=100)), ten(shape(mass=100 * volume)), rtol=1e-14
        )
    np.testing.assert_array_equal(ten(Box("b", mass=0)), np.zeros(10))


def test_symbolic_dimensions():
    box = Box("b", length="L", width="W", density=Parameter("rho", 1000.0))
    number = Box("b", length=0.7, width=0.2, density=900)
    np.testing.assert_allclose(ten(box, L=0.7, W=0.2, rho=900.0), ten(number), rtol=1e-13)
    cylinder = Cylinder("c", length="2*L", radius="R", inner_radius="R/2", mass="m")
    number = Cylinder("c", length=1.4, radius=0.2, inner_radius=0.1, mass=3)
    np.testing.assert_allclose(ten(cylinder, L=0.7, R=0.2, m=3.0), ten(number), rtol=1e-13)
    assert {p.name for e in cylinder.expressions() for p in parameters_of(e)} == {"L", "R", "m"}


def test_ends_of_a_bar():
    bar = Box("b", length="L", mass=0)
    assert bar.left.placement.steps == ()
    symbols = {"L": SX(0.6)}
    assert DM(bar.right.placement.pose(symbols).p).full().ravel().tolist() == [0.6, 0, 0]
    assert DM(bar.center.placement.pose(symbols).p).full().ravel().tolist() == [0.3, 0, 0]


def test_body_forms_of_inertia():
    rng = np.random.default_rng(1)
    R, com, m = random_rotation(rng), rng.uniform(-1, 1, 3), 2.5
    J = R @ np.diag([0.3, 0.4, 0.5]) @ R.T  # symmetric up to rounding only
    six = (J[0, 0], J[0, 1], J[0, 2], J[1, 1], J[1, 2], J[2, 2])
    about_origin = J + m * (com @ com * np.eye(3) - np.outer(com, com))
    wanted = [*about_origin[np.triu_indices(3)], *(m * com), m]
    for inertia in (J, J.tolist(), six):
        np.testing.assert_allclose(ten(Body("b", m, tuple(com), inertia)), wanted, rtol=1e-12)
    principal = ten(Body("b", 1, (0, 0, 0), (1, 2, 2.5)))
    assert principal.tolist() == [1, 0, 0, 2, 0, 2.5, 0, 0, 0, 1]
    symbolic = Body("b", "m", ("c", 0, 0), ("A", "2*A", "A + B"))
    values = ten(symbolic, m=2.0, c=0.5, A=1.0, B=0.25)
    assert values.tolist() == [1, 0, 0, 2.5, 0, 1.75, 1, 0, 0, 2]


def test_point_mass_and_khalil_body():
    assert ten(PointMass("p", 3)).tolist() == [0] * 9 + [3]
    values = dict(zip(TEN_PARAMETERS, (3, 0.1, 0.2, 4, 0.3, 5, 0.4, 0.5, 0.6, 2), strict=True))
    assert ten(KhalilBody("k", **values)).tolist() == list(values.values())
    of_texts = KhalilBody("k", **{name: name for name in values})
    assert ten(of_texts, **values).tolist() == list(values.values())


def test_khalil_body_of_a_body_is_accepted_far_from_its_centre():
    body = Body("b", 3.0, (5, -4, 2), (0.1, 0.2, 0.3))
    values = ten(body)
    again = KhalilBody("k", **dict(zip(TEN_PARAMETERS, map(float, values), strict=True)))
    np.testing.assert_allclose(ten(again), values)


def test_grouped_bodies_are_not_checked():
    assert ten(KhalilBody("k", XX=-3, M=1, grouped=True))[0] == -3


@pytest.mark.parametrize(
    ("make", "parts"),
    [
        (lambda: Body("arm", -1), ["arm: mass is -1 kg", "give zero or more"]),
        (lambda: Body("arm", "2-5"), ["arm: mass is -3 kg", "give zero or more"]),
        (lambda: Body("arm", Parameter("m", -2.0)), ["arm: mass is -2 kg", "give zero or more"]),
        (lambda: PointMass("p", -0.5), ["p: mass is -0.5 kg", "give"]),
        (lambda: KhalilBody("k", M=-1), ["k: mass is -1 kg", "give"]),
        (lambda: Body("arm", None), ["arm: this Body has no mass", "give mass= [kg], or mass=0"]),
        (lambda: Body("arm", math.nan), ["arm, mass: nan is not a finite number", "give"]),
        (lambda: Body("arm", True), ["arm, mass: True is not a finite number", "give"]),
        (
            lambda: Body("arm", 1, inertia=(-1, 1, 1)),
            ["arm: ", "negative principal moment -1 kg m^2", "give"],
        ),
        (
            lambda: Body("arm", 1, inertia=(1, 2, 0, 1, 0, 1)),
            ["arm: ", "negative principal moment -1", "give"],
        ),
        (
            lambda: Body("arm", 1, inertia=(1, 2)),
            ["arm, inertia: (1, 2) is not an inertia", "give three"],
        ),
        (lambda: Body("arm", 1, inertia=3), ["arm, inertia: 3 is not an inertia", "give three"]),
        (
            lambda: Body("arm", 1, inertia="abc"),
            ["arm, inertia: 'abc' is not an inertia", "give three"],
        ),
        (
            lambda: Body("arm", 1, inertia=[[1, 0.1, 0], [0.2, 1, 0], [0, 0, 1]]),
            ["arm, inertia: ", "symmetric"],
        ),
        (
            lambda: Body("arm", 1, inertia=np.array([[1, 0.1, 0], [0.2, 1, 0], [0, 0, 1]])),
            ["symmetric"],
        ),
        (
            lambda: Body("arm", 1, com=(1, 2)),
            ["arm, com: (1, 2) has not three values", "give (x, y, z)"],
        ),
        (
            lambda: Body("arm", 1, com="abc"),
            ["arm, com: 'abc' has not three values", "give (x, y, z)"],
        ),
        (
            lambda: Body("arm", 1, com=None),
            ["arm, com: None has not three values", "give (x, y, z)"],
        ),
        (
            lambda: Body("arm", 1, com=(0, "1+", 0)),
            ["arm, com, y: cannot read '1+'", "write numbers"],
        ),
        (lambda: KhalilBody("k", MX=1e200, M=1.0), ("k", "reach 1e+200", "check them")),
        (lambda: KhalilBody("k", XX=1e200, M=1e-300), ("k", "reach 1e+200", "check them")),
        (
            lambda: KhalilBody("k", XX=1, YY=1, ZZ=1, MX=5, M=1),
            ["k: ", "negative principal moment", "give"],
        ),
        (lambda: Box("b", length=-1, mass=0), ["b: length is -1", "above zero"]),
        (lambda: Box("b", width=0, mass=0), ["b: width is 0", "above zero"]),
        (
            lambda: Box("b", height=Parameter("h", -0.1), mass=0),
            ["b: height is -0.1", "above zero"],
        ),
        (
            lambda: Box("b", mass=1, density=1),
            ["b: both mass and density are given", "give only one"],
        ),
        (lambda: Box("b", density=-1000), ["b: mass is -10 kg", "give zero or more"]),
        (lambda: Cylinder("c", radius=0, mass=0), ["c: radius is 0", "above zero"]),
        (
            lambda: Cylinder("c", radius=0.1, inner_radius=0.1, mass=0),
            ["c: inner_radius is 0.1", "give 0 <="],
        ),
        (
            lambda: Cylinder("c", inner_radius=-0.1, mass=0),
            ["c: inner_radius is -0.1", "give 0 <="],
        ),
        (
            lambda: World(gravity=(0, 9.81)),
            ["world, gravity: (0, 9.81) has not three values", "give"],
        ),
        (
            lambda: Body("upper arm", mass=0),
            ["Body 'upper arm': ", "no blanks", "choose another name"],
        ),
        (lambda: Body("", mass=0), ["Body '': ", "choose another name"]),
        (lambda: Body("a.", mass=0), ["Body 'a.': ", "empty parts", "choose another name"]),
        (lambda: Box(7, mass=0), ["Box 7: ", "choose another name"]),
    ],
)
def test_impossible_bodies(make, parts):
    refused(DescriptionError, *parts, by=make)


def test_expression_errors_are_description_errors():
    assert issubclass(ExpressionError, DescriptionError)


WHEEL = Body("wheel", mass=1, com=(0.5, 0, 0), inertia=(0.001, 0.001, 0.01))
"""The moment about one axis is known, the others are guessed."""


def test_an_inertia_that_rotates_about_one_axis_is_noted():
    m = mbs.Mechanism("m")
    slide, wheel = m.add(Body("slide", mass=2)), m.add(WHEEL)
    m.connect(m.world.at(rotation=("x", 0.3)), Prismatic("s", axis="x"), slide)
    m.connect(slide.at(rotation=("y", -0.2)), Revolute("j", axis="z"), wheel)
    system = m.assemble()
    m.assemble()
    assert [str(note) for note in m.notes] == [
        "body 'wheel': the principal moments 0.001, 0.001, 0.01 kg m^2 break the triangle"
        " inequality; it rotates about one axis only"
    ]
    assert float(mbs.models.inertia_matrix(system)([0, 0])[1, 1]) == pytest.approx(0.01 + 0.25)


def test_an_inertia_of_symbols_is_looked_at_with_their_values():
    m = mbs.Mechanism("m", parameters={"J": 3.0})
    b = m.add(Body("b", mass=1, inertia=(1, 1, "J")))
    m.connect(m.world, Spherical("s"), b)
    with pytest.raises(DescriptionError, match=r"b: the principal moments 1, 1, 3 kg m\^2"):
        m.assemble()
    m.values["J"] = Parameter("J", 1.0)
    with pytest.raises(ModelError, match=r"b: the principal moments 1, 1, 3 kg m\^2"):
        m.assemble().parameter_values({"J": 3.0})


@pytest.mark.parametrize(
    "joint", [Spherical("k"), Free("k"), Revolute("k", axis=(1e-6, 0, 1)), Universal("k")]
)
def test_an_inertia_that_rotates_about_several_axes_is_refused(joint):
    m = mbs.Mechanism("m")
    arm, wheel = m.add(Body("arm", mass=2, inertia=(1, 1, 1))), m.add(WHEEL)
    m.connect(m.world, joint, arm)
    m.connect(arm, Revolute("j", axis="z"), wheel)
    with pytest.raises(DescriptionError, match=r"wheel: the principal .* triangle inequality; the"):
        m.assemble()


def test_base_parameters_have_a_flag():
    with pytest.raises(DescriptionError, match=r"k: .*negative principal.*grouped=True.*\.par"):
        KhalilBody("k", XX=1, YY=-1, ZZ=1, M=1)
    m = mbs.Mechanism("m")
    k = m.add(KhalilBody("k", XX=1, YY=1, ZZ=3, M=1))
    m.connect(m.world, Spherical("s"), k)
    with pytest.raises(DescriptionError, match=r"k: the principal moments.*grouped=True"):
        m.assemble()


def test_readers_may_leave_an_inertia_unchecked():
    """It is kept as it is, and what is computed with it is that of the formula."""
    m = mbs.Mechanism("m")
    b = m.add(Body("b", mass=1, com=(0.5, 0, 0), inertia=(1, 1, -3), checked=False))
    m.connect(m.world, Revolute("j", axis="z"), b)
    system = m.assemble()
    assert float(mbs.models.inertia_matrix(system)([0.3])) == pytest.approx(-3 + 0.25)
    assert float(mbs.models.direct_dynamics(system)([0.3], [0], [5.5])) == pytest.approx(-2.0)
