"""What hangs on no convention: signs of symbols, parallel axes, fixed frames, and the proof."""

import casadi
import numpy as np
import pytest
from support.random_trees import random_rotation

import mbs
import mbs.assembly.open_system
import mbs.models
from mbs.assembly import symbolic
from mbs.components import Body, Box, Prismatic, Revolute
from mbs.components.component import ElementaryRotation, angle_expression
from mbs.errors import AssemblyError
from mbs.export.languages.header import tables
from mbs.expressions import Number

INERTIAL = dict(mass=1.0, com=(0.1, 0.2, 0.3), inertia=(0.1, 0.1, 0.1))


def two_links(axis=(0, 0, 1), rotation=None, kind=Revolute):
    m = mbs.Mechanism("arm")
    a, b = (m.add(Body(name, **INERTIAL)) for name in "ab")
    m.connect(m.world, Revolute("j1"), a)
    m.connect(a.at(0.1, 0.2, 0.3, rotation=rotation), kind("j2", axis=axis), b)
    return m.assemble()


@pytest.mark.sweep
@pytest.mark.parametrize("default", [-0.5, 0.5, 0.0])
@pytest.mark.parametrize("value", [-0.5, 0.5, 0.0, 2.5, -2.0])
@pytest.mark.parametrize("axis", "xyz")
@pytest.mark.parametrize(("before", "after"), [(0, 0), (0.3, 0), (0, 0.3), (-0.7, 2.9)])
def test_a_symbol_as_an_angle_is_the_number(axis, before, after, value, default):
    def turned(angle):
        return two_links(rotation=[("z", before), (axis, angle), ("z", after)])

    named, plain = turned(mbs.Parameter("al", default)), turned(value)
    q, v, a = [0.2, 0.4], [1.0, -2.0], [0.3, 0.7]
    for model in (mbs.models.inverse_dynamics, mbs.models.direct_dynamics):
        ours = np.array(model(named)(q, v, a, [value]))
        np.testing.assert_allclose(ours, np.array(model(plain)(q, v, a)), rtol=1e-12, atol=1e-13)


@pytest.mark.sweep
@pytest.mark.parametrize(
    "tilt", [0.0, *(sign * 10.0**-k for k in range(1, 16) for sign in (1, -1))]
)
@pytest.mark.parametrize("kind", [Revolute, Prismatic])
def test_nearly_parallel_axes_by_hand(tilt, kind):
    """A row of the inertia matrix from the velocities of two points, in numpy."""
    axis = np.array([tilt, 0, 1]) / np.hypot(tilt, 1)
    system = two_links(axis=tuple(axis), kind=kind)
    A = np.array(mbs.models.inertia_matrix(system)([0.0, 0.0]))
    c = np.array([0.1, 0.2, 0.3])
    at = np.array([0.1, 0.2, 0.3])
    z = np.array([0.0, 0, 1])
    own, far = np.cross(z, c), np.cross(z, at + c)
    if kind is Revolute:
        moved, turned = np.cross(axis, c), axis
    else:
        moved, turned = axis, np.zeros(3)
    expected = [
        [own @ own + far @ far + 0.2, far @ moved + 0.1 * z @ turned],
        [far @ moved + 0.1 * z @ turned, moved @ moved + 0.1 * turned @ turned],
    ]
    np.testing.assert_allclose(A, expected, rtol=0, atol=1e-14)
    for link in system.tree.links:
        for frame in link.frames:
            assert all(abs(float(x)) < 3 for x in (frame.b, frame.d, frame.r))


def test_parallel_axes_with_symbols_behind_a_fixed_frame():
    """Both lengths are symbols, so that no angle to the next axis is known; zero is a value too."""

    def arm(L, h):
        frames = [
            {"antecedent": 0, "gamma": 0.0},
            {"antecedent": 1, "joint": "fixed", "gamma": 0.3, "d": L, "theta": -0.3, "b": 0.1},
            {"antecedent": 2, "gamma": 1.1, "d": h, "theta": 0.2},
        ]
        body = dict.fromkeys(("XX", "YY", "ZZ"), 0.1) | {"MX": 0.1, "MY": -0.2, "M": 1.0}
        bodies = [{"frame": k, **body} for k in (1, 3)]
        parameters = {x: 0.4 for x in (L, h) if isinstance(x, str)}
        return mbs.load(
            {"name": "t", "frame": frames, "body": bodies, "parameters": parameters}
        ).assemble()

    q, v, a = [0.2, 0.4], [1.0, -2.0], [0.3, 0.7]
    idm = mbs.models.inverse_dynamics(arm("L", "h"))
    for L, h in ((0.4, 0.4), (-0.4, 0.3), (0.0, 0.0), (0.0, -0.2)):
        expected = np.array(mbs.models.inverse_dynamics(arm(L, h))(q, v, a))
        np.testing.assert_allclose(np.array(idm(q, v, a, [L, h])), expected, rtol=0, atol=1e-13)
    tau, p = casadi.SX.sym("v", 2), casadi.SX.sym("p", 2)
    slopes = casadi.Function("J", [tau, p], [casadi.jacobian(idm(q, tau, a, p), p)])
    assert slopes([1.0, -2.0], [0.0, 0.0]).is_regular()


@pytest.mark.parametrize("value", [-0.8, 0.8, 0.0, 1e-7])
def test_a_loop_whose_axes_a_symbol_tilts(value):
    """The plane of a four-bar turns about two axes: its dynamics follow the number."""

    def four_bar(al):
        m = mbs.Mechanism("four_bar", gravity=(0.3, -9.81, 0.4))
        bars = [
            m.add(Box(name, length=length, width=0.05, density=2700))
            for name, length in (("a", 0.4), ("b", 1.0), ("c", 0.9))
        ]
        a, b, c = bars
        ground = m.world.at(0, 0, 0, rotation=[("z", 0.3), ("x", al), ("y", al)])
        m.connect(ground, Revolute("j1", actuated=True), a.left)
        m.connect(a.right, Revolute("j2"), b.left)
        m.connect(b.right, Revolute("j3"), c.right)
        m.connect(ground.at(0.8, 0, 0), Revolute("j4"), c.left)
        return m.assemble(guess={"j2": 1.0})

    named, plain = four_bar(mbs.Parameter("al", 0.5)), four_bar(value)
    assert named.independent == plain.independent
    q = mbs.loops.solve(plain, {"j1": 0.3})
    twin = mbs.loops.solve(named, {"j1": 0.3}, parameters={"al": value})
    np.testing.assert_allclose(twin, q, atol=1e-10)
    ddm = [mbs.models.direct_dynamics(system) for system in (named, plain)]
    ours = float(ddm[0](twin, [1.5], [2.0], [value]))
    assert ours == pytest.approx(float(ddm[1](q, [1.5], [2.0])), rel=1e-9)


def test_fixed_frames_are_written_and_read_again(tmp_path):
    system = two_links(axis=(1e-6, 0, 1))
    assert [len(link.via) for link in system.tree.links] == [0, 1]
    row = system.links[1]
    assert len(row.via) == 1
    mbs.export.par(system, tmp_path / "arm.par")
    text = (tmp_path / "arm.par").read_text()
    assert "sigma = {0,2,0}" in text
    again = mbs.load(tmp_path / "arm.par").assemble()
    q, v, a = [0.2, 0.4], [1.0, -2.0], [0.3, 0.7]
    expected = np.array(mbs.models.inverse_dynamics(system)(q, v, a))
    np.testing.assert_allclose(
        np.array(mbs.models.inverse_dynamics(again)(q, v, a)), expected, rtol=0, atol=1e-14
    )
    rows = [line.split() for line in tables(mbs.models.inverse_dynamics(system))[3:]]
    assert [row[:3] for row in rows] == [
        ["j", "ant", "sigma"],
        ["1", "0", "0"],
        ["2.1", "1", "2"],
        ["2", "2.1", "0"],
    ]


def test_lengths_of_fixed_frames_become_symbols_too():
    system = two_links(axis=(1e-6, 0, 1))
    lengths = symbolic(system, ["lengths"])
    names = [parameter.name for parameter in lengths.parameters]
    assert [name for name in names if "_1" in name] == ["d2_1"]
    q, v, a = [0.2, 0.4], [1.0, -2.0], [0.3, 0.7]
    expected = np.array(mbs.models.inverse_dynamics(system)(q, v, a))
    idm = mbs.models.inverse_dynamics(lengths)
    np.testing.assert_allclose(np.array(idm(q, v, a)), expected, rtol=0, atol=1e-14)
    other = dict(zip(names, lengths.p_default, strict=True)) | {"d2_1": 0.9}
    assert np.abs(np.array(idm(q, v, a, list(other.values()))) - expected).max() > 0.1


def wrong_frames(*given):
    """What a mistake in the choice of frames would do: one link a hair away."""
    from dataclasses import replace

    from mbs.assembly.khalil_frames import khalil_frames

    framed = khalil_frames(*given)
    *links, last = framed.tree.links
    moved = replace(last, placement=last.placement.shift(casadi.SX(1e-9)))
    return replace(framed, tree=replace(framed.tree, links=(*links, moved)))


def test_an_assembly_that_misplaces_a_link_by_a_nanometre_fails(monkeypatch):
    monkeypatch.setattr(mbs.assembly.open_system, "khalil_frames", wrong_frames)
    with pytest.raises(AssemblyError, match=r"arm: the assembled tree puts .* away from where"):
        two_links(rotation=("x", 0.3))
    with pytest.raises(AssemblyError, match=r"described at al = "):
        two_links(rotation=("x", mbs.Parameter("al", 0.2)))


@pytest.mark.parametrize("sign", [1, -1])
def test_the_proof_walks_joints_that_run_backwards(sign):
    """Every kind of joint, frame_b nearer to the world, several freedoms, turned axes."""
    from mbs.components import Cylindrical, Free, Planar, Spherical, Universal

    rng = np.random.default_rng(4)
    axis = tuple(rng.uniform(-1, 1, 3))
    kinds = [
        Revolute("r", axis=axis),
        Prismatic("p", axis=axis),
        Cylindrical("c", axis=axis),
        Planar("s", axis=axis),
        Universal("u", axes=("-x", "y")),
        Spherical("b"),
        Free("f"),
    ]
    m = mbs.Mechanism("kinds")
    before = m.world
    for joint in kinds:
        body = m.add(Body(f"of_{joint.name}", **INERTIAL))
        near = before.at(*rng.uniform(-1, 1, 3), rotation=random_rotation(rng).tolist())
        far = body.at(*rng.uniform(-1, 1, 3), rotation=random_rotation(rng).tolist())
        m.connect(*((near, joint, far) if sign > 0 else (far, joint, near)))
        before = body
    assert m.assemble().nv == 1 + 1 + 2 + 3 + 2 + 3 + 6


@pytest.mark.parametrize(
    ("written", "read"),
    [
        (1.57079632679, np.pi / 2),
        (-1.5707963268, -np.pi / 2),
        (3.14159265359, np.pi),
        (1.570796326795, np.pi / 2),
        (4.71238898038, 3 * np.pi / 2),
        (1.570796327, 1.570796327),
        (1.5708, 1.5708),
        (1.570796326793, 1.570796326793),
        (np.pi / 2 + 1e-12, np.pi / 2 + 1e-12),
        (1e-12, 1e-12),
        (0.0, 0.0),
    ],
)
def test_a_quarter_turn_that_a_file_wrote_in_digits(written, read):
    value = angle_expression(written, "here")
    assert isinstance(value, Number)
    assert value.value == read
    point = Body("b", mass=0).at(rotation=("x", written))
    (step,) = point.placement.steps
    assert isinstance(step, ElementaryRotation)
    assert step.angle.value == read
    placed = Body("b", mass=0).at_khalil(alpha=written, d=written).placement.steps[0]
    assert (placed.alpha.value, placed.d.value) == (read, written)
