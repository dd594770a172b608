"""Mechanisms that are written to robot files, and whether what is read back is the same."""

import numpy as np
import pytest

import mbs
from mbs import Mechanism
from mbs.components import (
    Body,
    Coupling,
    Prismatic,
    Revolute,
)

CLOSE = 1e-12
"""Of the largest value: angles and tensors are computed anew from rotations, some 1e-16 each."""


def names_of(rows):
    """Names as formats spell them that have no dots and colons."""
    return [row.name.replace(".", "_").replace("::", "_") for row in rows]


def assert_same_tree(one, other, rng):
    """Inertia matrix, inverse dynamics and poses are equal at random positions.

    Args:
        one: the system that was written, a tree.
        other: what was read; coordinates may stand in another order.
        rng: of the state.
    """
    q, (v, a) = rng.uniform(-1, 1, one.nq), rng.uniform(-1, 1, (2, one.nv))
    for k, coordinate in enumerate(one.coordinates):
        if coordinate.name.endswith("qw"):
            q[k : k + 4] /= np.linalg.norm(q[k : k + 4])
    assert sorted(names_of(other.coordinates)) == sorted(names_of(one.coordinates))
    at_q = [names_of(one.coordinates).index(name) for name in names_of(other.coordinates)]
    at_v = [
        names_of(one.velocity_coordinates).index(name)
        for name in names_of(other.velocity_coordinates)
    ]
    M, N = (np.array(mbs.models.inertia_matrix(s)(x)) for s, x in ((one, q), (other, q[at_q])))
    assert pytest.approx(M[np.ix_(at_v, at_v)], abs=CLOSE * abs(M).max()) == N
    tau = np.array(mbs.models.inverse_dynamics(one)(q, v, a)).ravel()[at_v]
    found = np.array(mbs.models.inverse_dynamics(other)(q[at_q], v[at_v], a[at_v])).ravel()
    assert found == pytest.approx(tau, abs=CLOSE * abs(tau).max())
    for name in set(one.frames) & set(other.frames):
        T = np.array(mbs.models.transform(one, name)(q))
        found = np.array(mbs.models.transform(other, name)(q[at_q]))
        assert found == pytest.approx(T, abs=CLOSE * max(1, abs(T).max()))


def written_arm(gravity=(0, 0, -9.81), **of_the_joint):
    """An arm of a revolute joint `j` and a prismatic one `s`, on a pedestal, with a tool frame.

    Args:
        gravity: of the mechanism.
        of_the_joint: parameters of `j`, beside its limits, friction and rotor.
    """
    mechanism = Mechanism("arm", gravity=gravity)
    base = mechanism.add(Body("pedestal", mass=3, inertia=(0.1, 0.1, 0.1)))
    mechanism.connect(mechanism.world.at(0, 0, 1), base)
    link = mechanism.add(Body("link", mass=2, com=(0.1, 0, 0), inertia=(0.1, 0.2, 0.2)))
    acting = dict(velocity=3.0, effort=40.0, Fv=0.5, Fs=0.2, Ia=0.3, **of_the_joint)
    joint = Revolute("j", axis="y", limits=(-1, 2), **acting)
    # The link's frame is not on the axis, and the pitch of a quarter turn is a singular one.
    mechanism.connect(
        base.at(0.1, 0.2, 0.3, rotation=[("y", "pi/2"), ("x", 0.3)]), joint, link.at(0.2, 0, 0.1)
    )
    slide = mechanism.add(Body("slide", mass=1, com=(0, 0.1, 0), inertia=(0.1, 0.1, 0.1)))
    mechanism.connect(link.at(0.5, 0, 0), Prismatic("s", axis=(0.6, 0, 0.8), actuated=False), slide)
    mechanism.add_frame("tool", slide.at(0, 0, 0.1, rotation=("z", 0.3)))
    return mechanism


def assert_coupling_is_kept(mechanism, read_again):
    """A coupling of the joints of `written_arm` acts as in the mechanism that is read again."""
    mechanism.add(Coupling("c", driven="s", driver="j", coefficients=(0.1, 0.5)))
    one, other = mechanism.assemble(), read_again(mechanism).assemble()
    assert [len(s.independent) for s in (one, other)] == [1, 1]
    q = [0.4, 0.1 + 0.5 * 0.4]
    tau = [float(mbs.models.inverse_dynamics(s)(q, [0.3], [0.7])) for s in (one, other)]
    assert tau[1] == pytest.approx(tau[0], rel=CLOSE)
