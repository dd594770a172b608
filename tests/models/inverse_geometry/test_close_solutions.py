"""Lists at poses with close solutions: complete, and the same at poses that differ by rounding."""

import close_solutions
import numpy as np
import pytest
from support.sweeps import slow

import mbs
from mbs.models.inverse_geometry import chain as chains

ROWS = [
    (0, 0, 0, -0.193801251389844),
    (0.26726944904098926, 0, 0, 0),
    (-0.7427679294531, 0.5416739416917072, 0.3, 0),
    (-0.30117298405600024, 0.08857203786884078, 0, -0.14045522804268779),
    (0.22907748811376094, 0, 0, 0),
    (0.6916139314938943, 0.05893198056604335, 0, -0.2861567104123352),
]
"""alpha, d, theta and r of six frames; the third joint is prismatic."""
SOLUTIONS = np.array(
    [
        (-2.30028, 0.89959, 2.31668, 1.98747, -1.94216, -0.0661),
        (-2.2023, 0.80896, 2.30913, -1.41881, 2.03177, -0.79992),
        (-1.12472, 0.03164, 2.30796, -1.85096, 2.33914, -1.04866),
        (-1.02609, -0.02385, 2.31212, 2.26205, -2.30537, -0.44762),
    ]
)


@pytest.fixture(scope="module")
def arm():
    frames = [
        {
            "antecedent": j,
            "joint": "prismatic" if j == 2 else "revolute",
            **dict(zip(("alpha", "d", "theta", "r"), row, strict=True)),
        }
        for j, row in enumerate(ROWS)
    ]
    return mbs.load({"name": "arm", "frame": frames}).assemble()


@pytest.mark.parametrize("ways", ["solve", "solve_many", "solver", "function"])
def test_no_loop_from_one_joint_holds_at_every_pose(arm, ways):
    """The matrix of the loop that is best for the arm is nearly singular at this pose."""
    T = chains.frame_chain(arm).arm(np.zeros(0)).pose(SOLUTIONS[0])
    igm = mbs.models.inverse_geometry
    rng = np.random.default_rng(1)
    for size in (0.0, 1e-15, 1e-13, 1e-10, 1e-7):
        target = T.copy()
        target[:3] += size * rng.uniform(-1, 1, (3, 4))
        if ways == "solve_many":
            found = igm.solve_many(arm, target[None]).q[0]
        elif ways == "solver":
            found = np.array(igm.solver(arm)(target).q)
        elif ways == "function":
            q, valid, *_ = igm.function(arm, branches="all")(target)
            found = q.full().T[valid.full().ravel() == 1]
        else:
            found = igm.solve(arm, target).q
        found = found[np.argsort(found[:, 0])]
        assert found.shape == (4, 6)
        np.testing.assert_allclose(found[0], SOLUTIONS[0], rtol=0, atol=1e-5)
        np.testing.assert_allclose(found, SOLUTIONS, rtol=0, atol=3e-4)


@pytest.mark.parametrize(("arms", "poses"), [(2, 2), slow(8, 3)])
def test_lists_beside_singular_configurations_are_complete(arms, poses):
    """As benchmarks/close_solutions.py measures it on a thousand arms."""
    examined = close_solutions.cases(3, arms, poses)
    total = np.zeros(3, dtype=int)
    for number, case in examined:
        rng = np.random.default_rng(number)
        total += close_solutions.examine(case, rng, starts=20)
    assert len(examined) > 0.6 * arms * poses
    assert total[0] > 2 * len(examined)
    assert total[1:].tolist() == [0, 0]
