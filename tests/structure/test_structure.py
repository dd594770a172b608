"""What is chosen for a mechanism hangs on it alone: not on the processor, not on rounding."""

import os
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from casadi import DM
from fingerprint import differences, fingerprint, under
from support.catalogue_systems import CLOSED, catalogue_system
from support.sweeps import slow

import mbs
from mbs.loops import analysis
from mbs.robots import catalogue, n_four_bar
from mbs.solvers.rank import EQUAL, first_best, graded, independent_rows

NOISE = 1e-9
"""Of entries of the Jacobian: a choice by less than that is luck, or has a rule."""

KERNELS = (("Prescott", "1"), ("Haswell", "2"))
"""Rounding differs in all products of more than a few elements, and between numbers of threads."""


FEW = ("four_bar", "modelica_four_bar", "scara")
EVERY = (*CLOSED, "panda", "scara", "n_four_bar(20)")
"""Mechanisms with loops, arms whose numbers once differed, a long chain."""


@pytest.mark.parametrize("names", [FEW, slow(EVERY)], ids=["few", "every"])
def test_the_catalogue_is_the_same_under_other_kernels(names):
    with ThreadPoolExecutor(min(2, os.cpu_count() or 1)) as workers:
        one, other = workers.map(lambda at: under(*at, *names), KERNELS)
    assert list(differences(one, other)) == []
    assert tuple(one) == names
    assert one["modelica_four_bar"]["independent"] == ["j1"]
    if names == EVERY:
        assert one["n_four_bar(20)"]["independent"] == ["a0"]


def test_every_mechanism_with_loops_is_looked_at():
    assert tuple(n for n in catalogue() if catalogue_system(n).is_closed) == CLOSED


def test_differences_of_fingerprints_are_seen():
    found = fingerprint("four_bar")
    changed = {**found, "idm": {**found["idm"], "operations": "1/1"}}
    assert list(differences({"four_bar": found}, {"four_bar": changed})) == [
        f"four_bar / idm / operations: {found['idm']['operations']} | 1/1"
    ]


@pytest.fixture
def noisy(monkeypatch):
    """Jacobians and bases of what they leave free, each with noise of its own."""
    rng = np.random.default_rng(7)
    exact, basis = analysis.constraint_jacobian, analysis.null_space_of

    def near(values):
        values = np.array(values)
        return values + NOISE * rng.uniform(-1, 1, values.shape)

    def turned(matrix, dimension):
        rotation = np.linalg.qr(rng.standard_normal((dimension, dimension)))[0]
        return near(basis(matrix, dimension) @ rotation)

    monkeypatch.setattr(
        analysis, "constraint_jacobian", lambda system: lambda *at: DM(near(exact(system)(*at)))
    )
    monkeypatch.setattr(analysis, "null_space_of", turned)


def chosen(system):
    """What the analysis of the loops decides."""
    closure = system.closure
    return (
        closure.rows,
        closure.slips,
        closure.independent,
        closure.chosen_coordinates,
        closure.varies,
    )


@pytest.mark.sweep
@pytest.mark.parametrize("name", [*CLOSED, "n_four_bar(8)"])
def test_noise_changes_no_choice(name, request):
    many = name == "n_four_bar(8)"
    mechanism = n_four_bar(8) if many else mbs.load(name)
    exact = chosen(mechanism.assemble() if many else catalogue_system(name))
    request.getfixturevalue("noisy")
    for _ in range(3):
        assert chosen(mechanism.assemble()) == exact


def test_of_equal_scores_the_first_is_best():
    assert first_best([1.0, 3.0, 3.0 + 1e-9, 2.0]) == 1
    assert first_best([1.0, 3.0, 3.0 * (1 + 10 * EQUAL), 2.0]) == 2
    assert first_best([-np.inf, -2.0, -2.0 + 1e-9]) == 1
    assert graded(0.1 + 0.2) == graded(0.3) != graded(0.30001)


def test_of_rows_that_are_as_long_the_first_are_kept():
    rows = np.array([[1.0, 0, 0], [0, 1 + 1e-12, 0], [0, 0, 1 - 1e-12], [0, 1, 1]])
    assert independent_rows([rows[:3]], 2) == [0, 1]
    assert independent_rows([rows[[2, 1, 0]]], 1) == [0]
    assert independent_rows([rows], 1) == [3]
