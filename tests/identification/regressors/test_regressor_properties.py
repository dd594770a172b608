"""The three models against each other on random trees, floating and closed mechanisms."""

import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from support.closed_mechanisms import planar_loop
from support.random_trees import KINDS, random_tree
from support.regressor_states import Motion, state_of, system_of

from mbs.identification import (
    energy_regressor,
    filtered_regressor,
    numeric_parameters,
    power_regressor,
    regressor,
)

COMMON = dict(deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))


def agree(system, seed):
    """d/dt(h K) is v' D K less what friction takes, and dD1/dt + D2 is D."""
    options = {"offsets": True}
    motion, state = Motion(system), state_of(system, seed)
    q, v, a = motion.q, motion.v, motion.a
    model = regressor(system, **options)
    D, (D1, D2) = model(q, v, a), filtered_regressor(system, **options)(q, v)
    taken = v.T @ D - power_regressor(system, **options)(q, v)
    rate = motion.rate(energy_regressor(system, **options)(q, v))
    largest = motion.largest(D, state)
    assert motion.largest(motion.rate(D1) + D2 - D, state) < 1e-10 * largest
    assert motion.largest(rate - taken, state) < 1e-10 * largest
    K = numeric_parameters(system, model.columns)
    assert motion.largest((rate - taken) @ K, state) < 1e-10 * largest * np.abs(K).max()


@settings(max_examples=8, **COMMON)
@given(st.integers(0, 10**6), st.sampled_from((*KINDS, "free")), st.booleans())
def test_random_trees(seed, kind, aligned):
    """A joint in two is free where `kind` is."""
    kinds = (kind, "revolute", "prismatic") if kind != "free" else (kind, "revolute")
    agree(random_tree(seed, n=3, kinds=kinds, aligned=aligned).mechanism.assemble(), seed)


@settings(max_examples=6, **COMMON)
@given(st.integers(0, 10**6), st.integers(3, 5))
def test_planar_loops(seed, links):
    mechanism, guess = planar_loop(seed, links)
    agree(mechanism.assemble(guess=guess), seed)


@settings(max_examples=4, **COMMON)
@given(st.integers(0, 10**6), st.sampled_from(("bricard", "delta", "differential_wrist")))
def test_spatial_loops(seed, name):
    agree(system_of(name), seed)
