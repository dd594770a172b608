"""SDFormat files that mbs writes: read again, the mechanism is the same to 1e-12."""

import numpy as np
import pytest
from support.random_trees import random_tree

import mbs
from mbs.components import (
    Body,
    Coupling,
    Free,
    JointStop,
    Mechanism,
    Planar,
    Prismatic,
    Revolute,
    Spherical,
    Universal,
)
from mbs.errors import ModelError
from mbs.expressions import to_float

CLOSE = 1e-12
"""Of the largest value: angles and tensors are computed anew from rotations, some 1e-16 each."""


def again(system, tmp_path):
    path = tmp_path / "again.sdf"
    mbs.export.sdf(system, path)
    return mbs.load(path)


def names_of(rows):
    return [row.name.replace(".", "_").replace("::", "_") for row in rows]


def same(one, other, rng, zero=None):
    """Inertia matrix, inverse dynamics and poses at random positions of a tree.

    Args:
        one: the system that was written.
        other: what was read; coordinates may stand in another order.
        rng: of the state.
        zero: positions from which those of the other one count.
    """
    q, (v, a) = rng.uniform(-1, 1, one.nq), rng.uniform(-1, 1, (2, one.nv))
    for k, coordinate in enumerate(one.coordinates):
        if coordinate.name.endswith("qw"):
            q[k : k + 4] /= np.linalg.norm(q[k : k + 4])
    at_q = [names_of(one.coordinates).index(name) for name in names_of(other.coordinates)]
    at_v = [names_of(one.speeds).index(name) for name in names_of(other.speeds)]
    M, N = (np.array(mbs.models.inertia_matrix(s)(x)) for s, x in ((one, q), (other, q[at_q])))
    assert N == pytest.approx(M[np.ix_(at_v, at_v)], abs=CLOSE * abs(M).max())
    tau = np.array(mbs.models.inverse_dynamics(one)(q, v, a)).ravel()[at_v]
    found = np.array(mbs.models.inverse_dynamics(other)(q[at_q], v[at_v], a[at_v])).ravel()
    assert found == pytest.approx(tau, abs=CLOSE * abs(tau).max())
    for name in set(one.frames) & set(other.frames):
        T = np.array(mbs.models.transform(one, name)(q))
        found = np.array(mbs.models.transform(other, name)(q[at_q]))
        assert found == pytest.approx(T, abs=CLOSE * max(1, abs(T).max()))


@pytest.mark.parametrize("name", ["puma560", "stanford", "scara", "rx90", "two_branch_tree"])
def test_robots_of_the_catalogue(tmp_path, name):
    system = mbs.load(name).assemble()
    found = again(system, tmp_path).assemble()
    assert set(names_of(row for row in system.bodies)) <= set(found.frames)
    same(system, found, np.random.default_rng(1))


@pytest.mark.parametrize("seed", range(8))
def test_random_trees(tmp_path, seed):
    kinds = ("revolute", "prismatic", "universal", "cylindrical", "planar", "spherical")
    system = random_tree(seed, 5, kinds=kinds, aligned=bool(seed % 2)).mechanism.assemble()
    same(system, again(system, tmp_path).assemble(), np.random.default_rng(seed))


def arm():
    mechanism = Mechanism("arm", gravity=(0.1, 0, -9))
    base = mechanism.add(Body("pedestal", mass=3, inertia=(0.1, 0.1, 0.1)))
    mechanism.connect(mechanism.world.at(0, 0, 1), base)
    link = mechanism.add(Body("link", mass=2, com=(0.1, 0, 0), inertia=(0.1, 0.2, 0.2)))
    joint = Revolute(
        "j",
        axis="y",
        limits=(-1, 2),
        velocity=3.0,
        effort=40.0,
        Fv=0.5,
        Fs=0.2,
        Ia=0.3,
        stiffness=7.0,
        rest=0.4,
    )
    # The link's frame is not on the axis, and the pitch of a quarter turn is a singular one.
    mechanism.connect(
        base.at(0.1, 0.2, 0.3, rotation=[("y", "pi/2"), ("x", 0.3)]), joint, link.at(0.2, 0, 0.1)
    )
    slide = mechanism.add(Body("slide", mass=1, com=(0, 0.1, 0), inertia=(0.1, 0.1, 0.1)))
    mechanism.connect(link.at(0.5, 0, 0), Prismatic("s", axis=(0.6, 0, 0.8), actuated=False), slide)
    plate = mechanism.add(Body("plate", mass=1, com=(0, 0.1, 0), inertia=(0.1, 0.1, 0.1)))
    mechanism.connect(link.at(0.3, 0, 0), plate)
    mechanism.add_frame("tool", slide.at(0, 0, 0.1, rotation=("z", 0.3)))
    return mechanism


def test_what_a_file_says_is_kept(tmp_path):
    mechanism = again(arm(), tmp_path)
    assert mechanism.notes == []
    found = mechanism.assemble()
    same(arm().assemble(), found, np.random.default_rng(2))
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
    same(one, other, np.random.default_rng(3))


def test_a_coupling_of_degree_one_is_a_mimic(tmp_path):
    mechanism = arm()
    mechanism.add(Coupling("c", driven="s", driver="j", coefficients=(0.1, 0.5)))
    one, other = mechanism.assemble(), again(mechanism, tmp_path).assemble()
    assert [len(s.active) for s in (one, other)] == [1, 1]
    q = [0.4, 0.1 + 0.5 * 0.4]
    tau = [float(mbs.models.inverse_dynamics(s)(q, [0.3], [0.7])) for s in (one, other)]
    assert tau[1] == pytest.approx(tau[0], rel=1e-12)


def closed_values(system, q):
    """Accelerations by the names of velocities, and the height of every body, at a closed state."""
    active = [system.speeds[k].name for k in system.active]
    v = [0.3 + 0.1 * k for k in range(len(active))]
    motors = len(system.motors)
    tau = np.array(mbs.models.inverse_dynamics(system)(q, v, [0.5] * len(active))).ravel()
    acceleration = mbs.models.direct_dynamics(system)(q, v, [0.7] * motors)
    poses = {row.name: np.array(mbs.models.transform(system, row.name)(q)) for row in system.bodies}
    return active, tau, np.array(acceleration[0] if isinstance(acceleration, tuple) else acceleration), poses


CLOSED = ["four_bar", "five_bar", "slider_crank", "sr400", "akr3000", "bricard", "delta"]


@pytest.mark.parametrize("name", CLOSED)
def test_loops_are_joints_with_a_second_parent(tmp_path, name):
    one = mbs.load(name).assemble()
    mechanism = again(one, tmp_path)
    active = [one.speeds[k].name for k in one.active]
    other = mechanism.assemble(active=[a.replace(".", "_") for a in active])
    assert other.closure.mobility == one.closure.mobility
    assert other.closure.residual < CLOSE
    assert names_of(other.coordinates) == names_of(one.coordinates)
    zero = [
        k for k, c in enumerate(other.coordinates) if c.kind in ("revolute", "prismatic")
    ]
    assert abs(np.array(other.configuration)[zero]).max() < CLOSE
    found, wanted = closed_values(other, other.configuration), closed_values(one, one.configuration)
    assert found[0] == [a.replace(".", "_") for a in wanted[0]]
    for x, y in zip(found[1:3], wanted[1:3], strict=True):
        # 1e-11: loops are closed by Newton's method anew, which the reduction amplifies
        assert x.ravel() == pytest.approx(y.ravel(), abs=1e-11 * max(1, abs(y).max()))
    for body, T in wanted[3].items():
        if body in found[3]:
            assert found[3][body] == pytest.approx(T, abs=CLOSE * max(1, abs(T).max()))


def test_a_loop_of_a_universal_joint_at_the_world(tmp_path):
    m = Mechanism("m")
    one = m.add(Body("one", mass=1, com=(0.2, 0, 0), inertia=(0.1, 0.2, 0.2)))
    two = m.add(Body("two", mass=2, com=(0, 0.1, 0), inertia=(0.3, 0.2, 0.2)))
    m.connect(m.world, Revolute("j", axis="z", limits=(-1, 1), actuated=True), one)
    m.connect(one.at(0.5, 0, 0), Spherical("s"), two)
    closing = Universal("u", axes=("z", "x"))
    m.connect(two.at(0.4, 0.3, 0, rotation=("z", 0.4)), closing, m.world.at(0.9, 0.3, 0))
    m.cut(closing)
    one_s, other_s = m.assemble(), again(m, tmp_path).assemble()
    assert other_s.cuts[0].edge.joint.name == "u"
    assert other_s.closure.mobility == one_s.closure.mobility
    x, y = (closed_values(s, s.configuration) for s in (one_s, other_s))
    assert y[1].ravel() == pytest.approx(x[1].ravel(), abs=1e-11)


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
    loop = arm()
    closing = Planar("p")
    loop.connect(loop.components["slide"], closing, loop.world)
    loop.cut(closing)
    refused(loop, "a Planar closes the loop at p")
