"""Hybrid dynamics: prescribed accelerations come out, and the drive's effort is that of the idm."""

import numpy as np
import pytest
from support.catalogue_systems import catalogue_system
from support.closed_mechanisms import closed_chain
from support.messages import refused
from support.random_trees import random_tree

import mbs
from mbs.errors import ModelError


@pytest.mark.parametrize("seed", range(5))
def test_an_open_tree_needs_the_efforts_of_the_inverse_model(seed):
    system = random_tree(seed, n=6).mechanism.assemble()
    rng = np.random.default_rng(seed)
    names = [speed.name for speed in system.velocity_coordinates]
    held = list(rng.choice(names, size=2, replace=False))
    numbers = [names.index(name) for name in held]
    q = np.array(system.configuration)
    v, tau = rng.normal(size=system.nv), rng.normal(size=system.nv)
    wanted = rng.normal(size=2)
    a, added = (
        np.array(x).ravel() for x in mbs.models.hybrid_dynamics(system, held)(q, v, tau, wanted)
    )
    assert a[numbers] == pytest.approx(wanted, abs=1e-9)
    needed = np.array(mbs.models.inverse_dynamics(system)(q, v, a)).ravel()
    tau[numbers] += added
    assert tau == pytest.approx(needed, rel=1e-8, abs=1e-8)


@pytest.mark.parametrize("closing", ["revolute", "spherical", "universal"])
def test_a_closed_chain_moves_as_with_the_effort_that_was_found(closing):
    mechanism, guess = closed_chain(3, closing)
    system = mechanism.assemble(guess=guess)
    name = system.velocity_coordinates[system.independent[0]].name
    rng = np.random.default_rng(1)
    G = np.array(mbs.loops.reduction_matrix(system)(system.configuration))
    v, tau = G @ rng.normal(size=len(system.independent)), rng.normal(size=system.nv)
    hybrid = mbs.models.hybrid_dynamics(system, [name])
    a, added, lam = (np.array(x).ravel() for x in hybrid(system.configuration, v, tau, [1.7]))
    k = system.independent[0]
    assert a[k] == pytest.approx(1.7, abs=1e-9)
    tau[k] += added[0]
    direct = mbs.models.direct_dynamics(system, coordinates="tree")
    again, lam_again = (np.array(x).ravel() for x in direct(system.configuration, v, tau))
    assert a == pytest.approx(again, rel=1e-7, abs=1e-7)
    assert lam == pytest.approx(lam_again, rel=1e-6, abs=1e-6)


def test_one_prescribed_joint_of_a_four_bar_fixes_the_motion():
    system = catalogue_system("four_bar")
    closure = mbs.models.acceleration_closure(system)
    q, v_a = np.array(system.configuration), [1.3]
    G = np.array(mbs.loops.reduction_matrix(system)(q))
    bias = np.array(closure(q, v_a)[2]) @ v_a
    hybrid = mbs.models.hybrid_dynamics(system, ["j1"])
    a = np.array(hybrid(q, G @ v_a, np.zeros(system.nv), [0.4])[0]).ravel()
    assert a == pytest.approx((G @ [0.4]).ravel() + bias.ravel(), abs=1e-9)


@pytest.mark.parametrize(
    ("names", "told"),
    [
        (["j1", "j4"], "j1, j4 cannot all be prescribed, since the loops tie them (mobility 1)"),
        (["j9"], "there is no velocity 'j9' to prescribe"),
        (["j1", "j1"], "a velocity is prescribed twice"),
        ("j1", "give a list of names, such as ['j1']"),
        ([], "give names of velocities"),
    ],
)
def test_impossible_prescriptions_are_refused(names, told):
    system = catalogue_system("four_bar")
    refused(ModelError, told, by=lambda: mbs.models.hybrid_dynamics(system, names))
