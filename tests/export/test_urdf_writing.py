"""URDF files that mbs writes: read again, the mechanism is the same to 1e-12."""

from dataclasses import replace

import casadi
import numpy as np
import pytest
from support.catalogue_systems import catalogue_system
from support.random_trees import random_tree

import mbs
from mbs.components import Body, Coupling, Free, Mechanism, Prismatic, Revolute, Spherical
from mbs.errors import ModelError
from mbs.expressions import to_float

CLOSE = 1e-12
"""Of the largest value: angles and tensors are computed anew from rotations, some 1e-16 each."""


def same(one, other, rng):
    """Names, inertia matrix, inverse dynamics and the poses of all bodies and frames."""
    names = [[c.name.replace(".", "_") for c in s.coordinates] for s in (one, other)]
    assert names[0] == names[1]
    q, (v, a) = rng.uniform(-1, 1, one.nq), rng.uniform(-1, 1, (2, one.nv))
    for k, coordinate in enumerate(one.coordinates):
        if coordinate.name.endswith("qw"):
            q[k : k + 4] /= np.linalg.norm(q[k : k + 4])
    M = [np.array(mbs.models.inertia_matrix(s)(q)) for s in (one, other)]
    assert M[1] == pytest.approx(M[0], abs=CLOSE * abs(M[0]).max())
    tau = [np.array(mbs.models.inverse_dynamics(s)(q, v, a)) for s in (one, other)]
    assert tau[1] == pytest.approx(tau[0], abs=CLOSE * abs(tau[0]).max())
    for name in one.frames:
        T = [np.array(mbs.models.transform(s, name)(q)) for s in (one, other)]
        assert T[1] == pytest.approx(T[0], abs=CLOSE * max(1, abs(T[0]).max()))


def again(system, tmp_path):
    path = tmp_path / "again.urdf"
    mbs.export.urdf(system, path)
    return mbs.load(path)


@pytest.mark.parametrize("name", ["puma560", "stanford", "scara", "rx90", "two_branch_tree"])
def test_robots_of_the_catalogue(tmp_path, name):
    system = catalogue_system(name)
    same(system, again(system, tmp_path).assemble(), np.random.default_rng(1))


@pytest.mark.parametrize("seed", range(8))
def test_random_trees(tmp_path, seed):
    rng = np.random.default_rng(seed)
    kinds = ("revolute", "prismatic", "universal", "cylindrical", "planar", "free")
    system = random_tree(seed, 5, kinds=kinds, aligned=bool(seed % 2)).mechanism.assemble()
    down = replace(system.tree, gravity=casadi.SX([0, 0, -9.81]))
    system = replace(system, tree=down, _cache={})
    same(system, again(system, tmp_path).assemble(), rng)


def arm():
    mechanism = Mechanism("arm")
    base = mechanism.add(Body("pedestal", mass=3, inertia=(0.1, 0.1, 0.1)))
    mechanism.connect(mechanism.world.at(0, 0, 1), base)
    link = mechanism.add(Body("link", mass=2, com=(0.1, 0, 0), inertia=(0.1, 0.2, 0.2)))
    joint = Revolute(
        "j", axis="y", limits=(-1, 2), velocity=3.0, effort=40.0, Fv=0.5, Fs=0.2, Ia=0.3
    )
    # The link's frame is not on the axis, and the pitch of a quarter turn is a singular one.
    mechanism.connect(
        base.at(0.1, 0.2, 0.3, rotation=[("y", "pi/2"), ("x", 0.3)]), joint, link.at(0.2, 0, 0.1)
    )
    slide = mechanism.add(Body("slide", mass=1, com=(0, 0.1, 0), inertia=(0.1, 0.1, 0.1)))
    mechanism.connect(link.at(0.5, 0, 0), Prismatic("s", axis=(0.6, 0, 0.8), actuated=False), slide)
    mechanism.add_frame("tool", slide.at(0, 0, 0.1, rotation=("z", 0.3)))
    return mechanism


def test_what_a_file_says_is_kept(tmp_path):
    mechanism = again(arm(), tmp_path)
    assert mechanism.notes == []
    same(arm().assemble(), mechanism.assemble(), np.random.default_rng(2))
    j, s = mechanism.joints()
    assert j.limits == (("", (-1.0, 2.0)),)
    assert (j.velocity, j.effort) == ((-3.0, 3.0), (-40.0, 40.0))
    assert [to_float(x) for x in (j.Fv, j.Fs, j.Ia)] == [0.5, 0.2, 0.3]
    assert (s.limits, s.velocity, s.effort) == ((), None, None)
    assert {body.name for body in mechanism.bodies()} >= {"pedestal", "link", "slide", "tool"}


def test_pinocchio_reads_what_is_written(tmp_path):
    pytest.importorskip("pinocchio")
    from robot_files import compared

    path = tmp_path / "arm.urdf"
    mbs.export.urdf(arm(), path)
    outcome = compared(path, False, 20)
    assert (outcome.kind, outcome.text) == ("equal", "")


def test_a_coupling_of_degree_one_is_a_mimic(tmp_path):
    mechanism = arm()
    mechanism.add(Coupling("c", driven="s", driver="j", coefficients=(0.1, 0.5)))
    one, other = mechanism.assemble(), again(mechanism, tmp_path).assemble()
    assert [len(s.active) for s in (one, other)] == [1, 1]
    q = [0.4, 0.1 + 0.5 * 0.4]
    tau = [float(mbs.models.inverse_dynamics(s)(q, [0.3], [0.7])) for s in (one, other)]
    assert tau[1] == pytest.approx(tau[0], rel=1e-12)


def test_what_urdf_cannot_say_is_refused(tmp_path):
    def refused(mechanism, message):
        with pytest.raises(ModelError) as error:
            mbs.export.urdf(mechanism, tmp_path / "x.urdf")
        assert message in str(error.value)

    refused(mbs.load("four_bar"), "closes a loop, which URDF cannot say")
    refused("puma560", "is a str; give a System or a Mechanism")
    ball = arm()
    ball.connect(ball.world, Spherical("ball"), ball.add(Body("b", mass=1, inertia=(1, 1, 1))))
    refused(ball, "ball is a ball joint")
    sprung = Mechanism("m")
    body = sprung.add(Body("b", mass=1, inertia=(1, 1, 1)))
    sprung.connect(sprung.world, Revolute("j", stiffness=2.0), body)
    refused(sprung, "j has a rotor or a spring")
    symbol = Mechanism("m")
    body = symbol.add(Body("b", mass="M", inertia=(1, 1, 1)))
    symbol.connect(symbol.world, Free("f"), body)
    refused(symbol, "M has no value, and URDF files have no symbols")
    symbol = Mechanism("m", gravity=(0, 0, 0))
    symbol.connect(symbol.world, Free("f"), symbol.add(Body("b", mass=1, inertia=(1, 1, 1))))
    refused(symbol, "gravity is [0.0, 0.0, 0.0]")
