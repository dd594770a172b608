"""Rules of trees, against Newton and Euler in plain numpy."""

import copy

import casadi
import numpy as np
import pytest
from casadi import SX
from support.base_robots import HALF, random_table, row, table
from support.base_trees import KINDS, grouped_tree
from support.plain_newton_euler import plain_efforts

import mbs
from mbs.identification import base_parameters
from mbs.identification.grouping.rules import lambda_transform
from mbs.spatial import Khalil


def plain_regressor(rows, columns, rng, states):
    """Efforts of unit parameters, one column each."""
    count, blank = len(rows["frame"]), copy.deepcopy(rows)
    for body in blank["body"]:
        body.update(dict.fromkeys(KINDS, 0.0))
    parts = []
    for _ in range(states):
        q, v, a = rng.uniform(-3, 3, (3, count))
        part = []
        for column in columns:
            body = blank["body"][column.link - 1]
            body[column.kind] = 1.0
            part.append(plain_efforts(blank, q, v, a))
            body[column.kind] = 0.0
        parts.append(np.array(part).T)
    return np.vstack(parts)


@pytest.mark.sweep
@pytest.mark.parametrize("first", range(1000, 1060, 10))
def test_efforts_are_the_same_and_the_count_is_the_rank(first):
    for seed in range(first, first + 10):
        base, error, _ = grouped_tree(seed)
        assert error < 1e-9, seed
        assert base.check.agrees, f"{seed}: {base.check.text}"
        assert base.count == base.check.rank, seed


@pytest.mark.parametrize("seed", [1, 9, 21])
def test_rank_of_plain_columns(seed):
    rows = random_table(seed)
    base = base_parameters(mbs.load(rows).assemble())
    columns = [c for c in base.columns if c.kind in KINDS]
    W = plain_regressor(
        rows, columns, np.random.default_rng(seed), 2 * len(columns) // len(rows["frame"])
    )
    kept = [k for k, c in enumerate(columns) if c in base.kept]
    singular = np.linalg.svd(W, compute_uv=False)
    assert np.sum(singular > 1e-9 * singular[0]) == len(kept)
    assert np.linalg.matrix_rank(W[:, kept], tol=1e-9 * singular[0]) == len(kept)


def test_lambda_is_the_table_of_the_book_for_revolute_joints():
    alpha, d, r = (SX.sym(name) for name in ("alpha", "d", "r"))
    matrix = lambda_transform(Khalil(SX(0), SX(0), alpha, d, SX(0), r).pose())
    S, C = casadi.sin(alpha), casadi.cos(alpha)
    YY = [1, 0, 0, C * C, C * S, S * S, 0, 0, 0, 0]
    MZ = [2 * r, d * S, -d * C, 2 * r * C * C, 2 * r * C * S, 2 * r * S * S, 0, -S, C, 0]
    M = [
        *(r * r, d * r * S, -d * r * C, d * d + r * r * C * C, r * r * C * S),
        *(d * d + r * r * S * S, d, -r * S, r * C, 1),
    ]
    found = casadi.horzcat(matrix[:, 0] + matrix[:, 3], matrix[:, 8], matrix[:, 9])
    expected = casadi.horzcat(*(casadi.vertcat(*column) for column in (YY, MZ, M)))
    error = casadi.Function("error", [alpha, d, r], [casadi.densify(found - expected)])
    assert np.max(np.abs(np.array(error(0.7, 0.3, -0.4)))) < 1e-15


def test_a_sliding_joint_across_the_first_axis_loses_the_moment_along_it():
    frames = [row(0), row(1, "prismatic", alpha=HALF), row(2, alpha=HALF)]
    base = base_parameters(mbs.load(table("rpr", frames)).assemble())
    names = [column.name for column in base.eliminated]
    assert "MY2" in names
    assert "MX2" not in names
    turned = [row(0), row(1, "prismatic", alpha=HALF, theta=HALF), row(2, alpha=HALF)]
    base = base_parameters(mbs.load(table("rpr", turned)).assemble())
    names = [column.name for column in base.eliminated]
    assert "MX2" in names
    assert "MY2" not in names


def test_axes_that_meet_away_from_the_origin_need_no_gravity():
    frames = [row(0), row(1, alpha=HALF), row(2, alpha=-HALF, r=0.3), row(3, alpha=0.7)]
    base = base_parameters(mbs.load(table("wrist", frames, (0, 0, 0))).assemble())
    assert {"MX3", "MY3"} <= {column.name for column in base.eliminated}
    assert base.check.agrees, base.check.text


@pytest.mark.parametrize(("alpha", "leaves"), [("pi/2 + A", "MY2"), ("A", "MZ2")])
def test_the_moment_that_leaves_has_a_factor_at_the_defaults(alpha, leaves):
    frames = [row(0), row(1, "prismatic", alpha=alpha), row(2, alpha=HALF)]
    rows = table("rpr", frames) | {"parameters": {"A": 0.0}}
    base = base_parameters(mbs.load(rows).assemble())
    assert np.isfinite(base.matrix).all()
    assert base.check.error < 1e-9
    assert leaves in {column.name for column in base.eliminated}
