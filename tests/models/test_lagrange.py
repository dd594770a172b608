"""Renaud's recursion against the derivatives of the inertia matrix."""

import numpy as np
import pytest
from support.catalogue_systems import catalogue_system
from support.closed_mechanisms import closed_chain
from support.driven_trees import driven_tree
from support.messages import refused
from support.random_trees import random_state, random_tree

import mbs.models
from mbs.errors import ModelError
from mbs.operations import count

SPATIAL = ("puma560", "rx90", "stanford", "two_branch_tree")
PLANAR = ("scara", "cart_pole", "planar_2r")
AXES = ("revolute", "prismatic", "universal", "cylindrical", "planar")


def same(one, other):
    for a, b in zip(map(np.array, one), map(np.array, other), strict=True):
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-11 * max(1, np.abs(b).max(initial=0)))


def both(system, *state, coordinates="independent"):
    return [
        mbs.models.lagrange(system, method, coordinates)(*state)
        for method in ("renaud", "christoffel")
    ]


@pytest.mark.parametrize("seed", range(3))
def test_christoffel_symbols_of_random_trees(seed):
    system = random_tree(seed, n=4, kinds=AXES, aligned=seed == 2).mechanism.assemble()
    q, v, _ = random_state(system, np.random.default_rng(seed))
    same(*both(system, q, v))


@pytest.mark.parametrize("seed", range(3))
def test_christoffel_symbols_with_rotors(seed):
    system = driven_tree(seed, n=5, kinds=("revolute", "prismatic")).assemble()
    q, v, _ = random_state(system, np.random.default_rng(seed))
    same(*both(system, q, v))


@pytest.mark.parametrize("name", [*SPATIAL, *PLANAR])
def test_cheaper_method_is_taken(name):
    system = catalogue_system(name)
    q, v, _ = random_state(system, np.random.default_rng(1))
    same(*both(system, q, v))
    taken = [
        count(mbs.models.lagrange(system, method)) for method in ("auto", "renaud", "christoffel")
    ]
    auto, renaud, christoffel = (c.mul + c.add + c.div for c in taken)
    assert auto == min(renaud, christoffel)
    if name in SPATIAL:
        assert renaud < 0.8 * christoffel


def test_closed_system():
    mechanism, guess = closed_chain(3, "revolute")
    system = mechanism.assemble(guess=guess)
    rng = np.random.default_rng(2)
    v = rng.uniform(-1, 1, len(system.independent))
    same(*both(system, list(system.configuration), v))
    v = rng.uniform(-1, 1, system.nv)
    same(*both(system, list(system.configuration), v, coordinates="tree"))


@pytest.mark.parametrize("method", ["euler", None, "Renaud"])
def test_other_methods_are_refused(method):
    system = catalogue_system("planar_2r")
    refused(
        ModelError,
        f"planar_2r: method is {method!r}; use one of auto, renaud, christoffel",
        by=lambda: mbs.models.lagrange(system, method),
    )
