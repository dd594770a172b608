"""SDFormat files that mbs writes: read again, the mechanism is the same to 1e-12."""

import numpy as np
import pytest
from support.catalogue_systems import catalogue_system
from support.random_trees import random_tree
from support.written_files import (
    CLOSE,
    assert_coupling_is_kept,
    assert_same_tree,
    names_of,
    written_arm,
)

import mbs
from mbs import Mechanism
from mbs.components import (
    Body,
    Coupling,
    Free,
    JointStop,
    Revolute,
    Spherical,
    Universal,
)
from mbs.errors import ModelError
from mbs.expressions import to_float


def again(system, tmp_path):
    path = tmp_path / "again.sdf"
    mbs.export.sdf(system, path)
    return mbs.load(path)


@pytest.mark.parametrize("name", ["puma560", "stanford", "scara", "rx90", "two_branch_tree"])
def test_robots_of_the_catalogue(tmp_path, name):
    system = catalogue_system(name)
    found = again(system, tmp_path).assemble()
    assert set(names_of(row for row in system.bodies)) <= set(found.frames)
    assert_same_tree(system, found, np.random.default_rng(1))


@pytest.mark.parametrize("seed", range(8))
def test_random_trees(tmp_path, seed):
    kinds = ("revolute", "prismatic", "universal", "cylindrical", "planar")
    system = random_tree(seed, 5, kinds=kinds, aligned=bool(seed % 2)).mechanism.assemble()
    assert_same_tree(system, again(system, tmp_path).assemble(), np.random.default_rng(seed))


def arm():
    mechanism = written_arm((0.1, 0, -9), stiffness=7.0, rest=0.4)
    link = mechanism.components["link"]
    plate = mechanism.add(Body("plate", mass=1, com=(0, 0.1, 0), inertia=(0.1, 0.1, 0.1)))
    mechanism.connect(link.at(0.3, 0, 0), plate)
    return mechanism


def test_what_a_file_says_is_kept(tmp_path):
    mechanism = again(arm(), tmp_path)
    assert mechanism.notes == []
    found = mechanism.assemble()
    assert_same_tree(arm().assemble(), found, np.random.default_rng(2))
    assert {"pedestal", "link", "slide", "plate", "tool"} <= set(found.frames)
    j, s = mechanism.joints()
    assert j.limits == (("", (-1.0, 2.0)),)
    assert (j.velocity, j.effort) == ((-3.0, 3.0), (-40.0, 40.0))
    assert [to_float(x) for x in (j.Fv, j.Fs, j.Ia, j.stiffness, j.rest)] == [0.5, 0.2, 0.3, 7, 0.4]
    assert (s.limits, s.velocity, s.effort) == ((), None, None)
    assert (j.actuated, s.actuated) == (True, False)


def test_a_free_root_starts_where_it_was(tmp_path):
    mechanism = Mechanism("drone")
    body = mechanism.add(Body("hull", mass=3, com=(0.1, 0, 0.2), inertia=(0.1, 0.2, 0.15)))
    mechanism.connect(mechanism.world, Free("root_joint"), body)
    arm = mechanism.add(Body("arm", mass=1, inertia=(0.1, 0.1, 0.1)))
    mechanism.connect(body.at(0.3, 0, 0), Revolute("j", axis="x"), arm.at(0, 0.1, 0))
    turn = {"root_joint.qw": 0.6, "root_joint.qy": 0.8}
    mechanism.guess = {"root_joint.x": 0.3, "root_joint.z": 2.0, **turn}
    one, other = mechanism.assemble(), again(mechanism, tmp_path).assemble()
    assert other.configuration == pytest.approx(one.configuration, abs=CLOSE)
    assert_same_tree(one, other, np.random.default_rng(3))


def test_a_coupling_of_degree_one_is_a_mimic(tmp_path):
    assert_coupling_is_kept(arm(), lambda mechanism: again(mechanism, tmp_path))


def closed_values(system):
    """Efforts, accelerations and poses by name, at a closed state, and the mobility."""
    q = system.configuration
    names = names_of(system.velocity_coordinates)
    active, motors = ([names[k] for k in ks] for ks in (system.independent, system.motors))
    rng = np.random.default_rng(4)
    v, a, u = (dict(zip(sorted(names), rng.uniform(-1, 1, len(names)), strict=True)) for _ in "vau")
    speeds = [v[name] for name in active]
    tau = mbs.models.inverse_dynamics(system)(q, speeds, [a[name] for name in active])
    found = mbs.models.direct_dynamics(system)(q, speeds, [u[name] for name in motors])
    efforts = dict(zip(motors, np.array(tau).ravel(), strict=True))
    accelerations = dict(zip(active, np.array(found).ravel(), strict=True))
    poses = {name: np.array(mbs.models.transform(system, name)(q)) for name in system.frames}
    return efforts, accelerations, poses, system.closure.mobility


def same_loops(one, other):
    (efforts, accelerations, poses, mobility), found = map(closed_values, (one, other))
    assert found[3] == mobility
    # 1e-11: the loops are closed by Newton's method anew, which the reduction amplifies
    for mine, its in ((efforts, found[0]), (accelerations, found[1])):
        size = max(1, *map(abs, mine.values()))
        assert its == pytest.approx(mine, abs=1e-11 * size)
    for name in set(poses) & set(found[2]):
        assert found[2][name] == pytest.approx(
            poses[name], abs=CLOSE * max(1, abs(poses[name]).max())
        )


CLOSED = ["four_bar", "five_bar", "slider_crank", "sr400", "akr3000", "bricard", "n_four_bar"]


@pytest.mark.parametrize("name", CLOSED)
def test_loops_are_joints_with_a_second_parent(tmp_path, name):
    one = catalogue_system(name)
    active = [one.velocity_coordinates[k].name.replace(".", "_") for k in one.independent]
    other = again(one, tmp_path).assemble(active=active)
    assert other.closure.residual < CLOSE
    assert {c.edge.joint.name for c in other.cuts} == {c.edge.joint.name for c in one.cuts}
    assert max(map(abs, other.configuration)) < CLOSE
    assert name == "bricard" or max(map(abs, one.configuration)) > 0.1
    same_loops(one, other)


def test_a_loop_of_a_universal_joint_at_the_world(tmp_path):
    m = Mechanism("m", guess={"j": 0.3, "k": 0.2})
    one = m.add(Body("one", mass=1, com=(0.2, 0, 0), inertia=(0.1, 0.2, 0.2)))
    two = m.add(Body("two", mass=2, com=(0, 0.1, 0), inertia=(0.3, 0.2, 0.2)))
    m.connect(m.world, Revolute("j", axis="z", limits=(-1, 1), actuated=True), one)
    mid = m.add(Body("mid", mass=0.5, inertia=(0.1, 0.1, 0.1)))
    m.connect(one.at(0.1, 0, 0), Revolute("k", axis="y", actuated=False), mid)
    m.connect(mid.at(0.4, 0, 0), Spherical("s"), two)
    closing = Universal("u", axes=("z", "x"))
    m.connect(two.at(0.4, 0.3, 0, rotation=("z", 0.4)), closing, m.world.at(0.9, 0.3, 0))
    m.cut(closing)
    one_s, other_s = m.assemble(), again(m, tmp_path).assemble()
    assert other_s.cuts[0].edge.joint.name == "u"
    same_loops(one_s, other_s)


def test_a_coupling_in_a_loop_and_a_limit_of_a_cut(tmp_path):
    """Positions count from where the loop is drawn, and so do offsets, springs and limits."""
    m = Mechanism("m", guess={"a": 0.7, "b": 1.5})
    bars = [m.add(Body(n, mass=1, com=(0.3, 0, 0), inertia=(0.1, 0.1, 0.1))) for n in "uvw"]
    crank = Revolute("a", limits=(0.1, 1.2), stiffness=3, rest=0.2, actuated=True, effort=9)
    m.connect(m.world, crank, bars[0])
    m.connect(m.world.at(1), Revolute("b"), bars[1])
    m.connect(bars[0].at(0.5), Revolute("c"), bars[2])
    closing = Revolute("d", axis="-z", limits=(-2, 2.5))
    m.connect(bars[2].at(0.9), closing, bars[1].at(0.8))
    m.cut(closing)
    wheel = m.add(Body("wheel", mass=1, inertia=(0.1, 0.1, 0.1)))
    m.connect(m.world.at(0, 0, 1), Revolute("e"), wheel)
    m.add(Coupling("gear", driven="e", driver="a", coefficients=(0.25, -3)))
    one, mechanism = m.assemble(), again(m, tmp_path)
    other = mechanism.assemble(active=["a"])
    q = dict(zip(names_of(one.coordinates), one.configuration, strict=True))
    a = mechanism.components["a"]
    assert a.limits[0][1] == pytest.approx((0.1 - q["a"], 1.2 - q["a"]), abs=CLOSE)
    assert to_float(a.rest) == pytest.approx(0.2 - q["a"], abs=CLOSE)
    # the turn of the cut joint about -z: that of the rocker less those of crank and coupler
    turned = -(q["b"] - q["a"] - q["c"])
    turned = np.arctan2(np.sin(turned), np.cos(turned))
    assert mechanism.components["d"].limits[0][1] == pytest.approx((-2 - turned, 2.5 - turned))
    same_loops(one, other)


def test_a_cut_joint_with_friction_stays_and_its_end_is_welded(tmp_path):
    m = Mechanism("m", guess={"a": 0.7, "b": 1.5})
    bars = [m.add(Body(n, mass=1, com=(0.3, 0, 0), inertia=(0.1, 0.1, 0.1))) for n in "uvw"]
    m.connect(m.world, Revolute("a", actuated=True), bars[0])
    m.connect(m.world.at(1), Revolute("b"), bars[1])
    m.connect(bars[0].at(0.5), Revolute("c"), bars[2])
    closing = Revolute("d", Fv=0.4)
    m.connect(bars[2].at(0.9), closing, bars[1].at(0.8))
    m.cut(closing)
    one, other = m.assemble(active=["a"]), again(m, tmp_path).assemble(active=["a"])
    assert one.cuts[0].welded
    assert [c.edge.joint.name for c in other.cuts] == ["d_weld"]
    same_loops(one, other)


def test_a_ball_joint(tmp_path):
    m = arm()
    ball = m.add(Body("bob", mass=1, com=(0.1, 0, 0.3), inertia=(0.1, 0.2, 0.15)))
    m.connect(m.components["link"].at(0, 0.3, 0, rotation=("x", 1)), Spherical("sph"), ball.at(0.1))
    assert_same_tree(m.assemble(), again(m, tmp_path).assemble(), np.random.default_rng(5))


def test_what_sdf_cannot_say_is_refused(tmp_path):
    def refused(mechanism, message):
        with pytest.raises(ModelError) as error:
            mbs.export.sdf(mechanism, tmp_path / "x.sdf")
        assert message in str(error.value)

    refused("puma560", "is a str; give a System or a Mechanism")
    stopped = arm()
    stopped.add(JointStop("stop", "j", upper=1, stiffness=10, width=0.01))
    refused(stopped, "it has force elements or a drive line, which SDF cannot say")
    bent = arm()
    bent.add(Coupling("c", driven="s", driver="j", coefficients=(0, 1, 2)))
    refused(bent, "c is not a line between two joints")
    flying = arm()
    flying.connect(
        flying.components["link"], Free("f"), flying.add(Body("b", mass=1, inertia=(1, 1, 1)))
    )
    refused(flying, "f is a free joint that is not on the world")
    refused(mbs.load("delta"), "a Rod closes the loop at rod1a")
