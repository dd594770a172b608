"""Rank of sampled columns: rounding, scales, order."""

import numpy as np
import pytest

from mbs.identification.grouping.numeric import dependence


@pytest.fixture
def columns():
    """Two independent columns, their sum, one of rounding, one small and independent."""
    rng = np.random.default_rng(3)
    a, b, c = rng.standard_normal((3, 30))
    return np.column_stack([a, b, a + 2 * b, 1e-15 * c, 1e-5 * c])


def test_rounding_is_no_column_and_small_ones_are(columns):
    found = dependence(columns, range(5))
    assert found.independent == (0, 1, 4)
    assert found.dependent == (2, 3)
    assert found.factors == pytest.approx(np.array([[1, 0], [2, 0], [0, 0]]), abs=1e-9)
    assert found.gap > 1e12


def test_the_order_says_which_columns_stay(columns):
    found = dependence(columns, [2, 1, 4, 3, 0])
    assert found.independent == (2, 1, 4)
    assert found.factors[:, 0] == pytest.approx([1, -2, 0], abs=1e-9)


def test_nothing_depends_when_no_gap_shows():
    W = np.random.default_rng(4).standard_normal((20, 4))
    found = dependence(W, range(4))
    assert found.independent == (0, 1, 2, 3)
    assert found.gap == np.inf
    assert dependence(np.zeros((3, 2)), range(2)).independent == ()
