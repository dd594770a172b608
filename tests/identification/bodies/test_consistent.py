from dataclasses import replace

import numpy as np
import pytest
from support.measured_arm import (
    arm,
    equations,
    mbs_values,
    motion,
    noisy_samples,
    true_efforts,
)

from mbs.errors import ModelError
from mbs.identification import (
    Prior,
    Record,
    consistent_links,
    consistent_weighted,
    full_parameters,
    least_squares,
    observe,
    observe_filtered,
    physically_consistent,
    regressor,
    smoothed,
)
from mbs.identification.bodies import pseudo_inertias, unconstrained_error

DEVIATIONS = np.array([0.3, 0.1, 0.02])


def full_observations(deviation=DEVIATIONS, seed=0):
    return observe(equations()[0], noisy_samples(deviation, seed))


def at_base(estimate):
    return equations()[1].matrix @ estimate.values


def test_bodies_explain_the_efforts_as_well_as_base_parameters():
    full, (_, base, truth) = full_observations(), equations()
    bodies = consistent_weighted(full)
    free = least_squares(full.grouped(base))
    assert consistent_links(bodies.columns, bodies.values) == [1, 2, 3]
    assert bodies.residuals.total_percent < 1.01 * free.residuals.total_percent
    deviations = np.sqrt(np.diag(base.matrix @ bodies.covariance @ base.matrix.T))
    assert (np.abs(at_base(bodies) - truth) / deviations).max() < 4
    assert unconstrained_error(full) == pytest.approx(free.residuals.error, abs=1e-8)


def test_a_good_guess_is_kept_where_the_record_says_nothing():
    truth = np.array(mbs_values(equations()[0].columns))
    bodies = physically_consistent(full_observations(0.05), Prior(guess=truth))
    assert bodies["M1"] == pytest.approx(6.0, rel=0.05)
    assert bodies["MZ2"] == pytest.approx(truth[bodies.names.index("MZ2")], abs=0.05)
    assert bodies.residuals.rms == pytest.approx([0.05] * 3, rel=0.1)
    errors = (bodies.values - truth) / bodies.deviations
    assert np.abs(errors).max() < 4


def test_negative_friction_and_impossible_bodies_are_avoided():
    full = full_observations(0.0)
    names = list(full.names)
    pulled = full.y.copy()
    for name, change in (("Fv2", -1.0), ("Ia3", -0.5), ("XX3", -0.2), ("YY3", -0.2)):
        pulled += change * full.W[:, :, names.index(name)]
    wrong = replace(full, y=pulled)
    bodies = physically_consistent(wrong)
    assert bodies["Fv2"] == pytest.approx(0.0, abs=1e-4)
    assert bodies["Ia3"] >= 0
    assert consistent_links(bodies.columns, bodies.values) == [1, 2, 3]
    free = least_squares(wrong.grouped(equations()[1]))
    assert free["Fv2"] == pytest.approx(-0.2, abs=1e-6)
    assert free.residuals.total_percent < bodies.residuals.total_percent


def test_masses_are_bounded():
    free, bounded = (
        physically_consistent(full_observations(), Prior(heaviest=m))
        for m in (100.0, (1.5, 1.5, 1.5))
    )
    assert max(free[f"M{j}"] for j in (1, 2, 3)) > 1.6
    assert all(bounded[f"M{j}"] <= 1.5 + 1e-6 for j in (1, 2, 3))


def test_a_guess_that_is_no_number_is_refused():
    with pytest.raises(ModelError, match="a number of the guess is not finite"):
        Prior(guess=[1.0, float("nan")])


def test_friction_that_base_parameters_do_not_show_stays_near_nothing():
    D, base, _ = equations()
    estimate = least_squares(full_observations().grouped(base))
    matrix = base.matrix.copy()
    matrix[:, D.names.index("Fs3")] = 0.0
    found = full_parameters(estimate, D.columns, matrix)
    assert np.isfinite(found.values).all()


def test_deviations_know_that_errors_repeat_from_row_to_row():
    _, base, truth = equations()
    exact, errors = full_observations(0.0), []
    for seed in range(5):
        noise = 0.1 * np.random.default_rng(seed).normal(size=exact.y.shape)
        for k in range(1, len(noise)):
            noise[k] += 0.8 * noise[k - 1]
        found = consistent_weighted(replace(exact, y=exact.y + noise))
        deviations = np.sqrt(np.diag(base.matrix @ found.covariance @ base.matrix.T))
        errors.append((base.matrix @ found.values - truth) / deviations)
    assert 0.5 < np.sqrt(np.mean(np.square(errors))) < 1.3


def test_a_total_mass_that_was_weighed_is_kept():
    full = full_observations()
    free, weighed = physically_consistent(full), physically_consistent(full, Prior(total_mass=12.0))
    masses = [sum(found[f"M{j}"] for j in (1, 2, 3)) for found in (free, weighed)]
    assert masses[1] == pytest.approx(12.0, abs=1e-6)
    assert abs(masses[0] - 12.0) > 1.0
    assert weighed.residuals.rms == pytest.approx(free.residuals.rms, rel=0.02)


def test_the_search_tells_how_far_it_is():
    parts = []
    full = full_observations()
    watched = physically_consistent(full, watch=parts.append)
    assert 5 < len(parts) < 500
    assert parts == pytest.approx(np.arange(1, len(parts) + 1) / 500)
    assert watched.values == pytest.approx(physically_consistent(full).values, abs=1e-9)


def test_it_is_the_answer_of_a_conic_solver():
    """With little weight on the guess: the least error over positive semi-definite matrices."""
    clarabel = pytest.importorskip("clarabel")
    full = full_observations(0.05)
    wrong = replace(full, y=full.y - 0.3 * full.W[:, :, [full.names.index("XX3")]][:, :, 0])
    least = least_by_cones(clarabel, wrong)
    free = float(np.linalg.norm(least_squares(wrong.grouped(equations()[1])).residuals.error))
    ours = physically_consistent(wrong, Prior(emphasis=1e-3))
    found = float(np.linalg.norm(ours.residuals.error))
    assert least > 1.01 * free
    assert least * (1 - 1e-4) <= found <= least * 1.001


def least_by_cones(clarabel, full):
    """Norm of the errors at the optimum, masses up to 100 kg, by an interior-point conic solver."""
    from scipy import sparse

    W, y = full.rows
    k = W.shape[1]
    R, scale = np.linalg.qr(np.column_stack([W, y]), mode="r"), np.linalg.norm(y)
    b, cones, rows = [], [], []
    columns = full.columns
    for j in (1, 2, 3):
        basis = [
            pseudo_inertias(columns, np.eye(k)[n])[j] if columns[n].link == j else np.zeros((4, 4))
            for n in range(k)
        ]
        upper = [(r, c) for c in range(4) for r in range(c + 1)]
        rows += [[-(P[r, c] * (1 if r == c else np.sqrt(2))) for P in basis] for r, c in upper]
        b += [0.0] * 10
        cones.append(clarabel.PSDTriangleConeT(4))
    signs = [n for n, c in enumerate(columns) if c.kind in ("Ia", "Fv", "Fs")]
    rows += [[-float(n == s) for n in range(k)] for s in signs]
    masses = [n for n, c in enumerate(columns) if c.kind == "M"]
    rows += [[float(n == s) for n in range(k)] for s in masses]
    b += [0.0] * len(signs) + [100.0] * len(masses)
    cones.append(clarabel.NonnegativeConeT(len(signs) + len(masses)))
    A, r = R[:, :-1] / scale, R[:, -1] / scale
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    P = sparse.csc_matrix(np.triu(A.T @ A))
    problem = clarabel.DefaultSolver(
        P, -A.T @ r, sparse.csc_matrix(np.array(rows)), np.array(b), cones, settings
    )
    x = np.array(problem.solve().x)
    return float(np.linalg.norm(W @ x - y))


def test_what_cannot_be_a_full_set_is_refused():
    full, (_, base, _) = full_observations(), equations()
    with pytest.raises(ModelError, match="give the observations of the full set"):
        physically_consistent(full.grouped(base))
    with pytest.raises(ModelError, match=r"heaviest is 0\.0 kg and emphasis 1; give more"):
        Prior(heaviest=0.0)
    with pytest.raises(ModelError, match="total mass is -1 kg"):
        Prior(total_mass=-1.0)
    with pytest.raises(ModelError, match="2 bounds on masses are given for 3 links"):
        physically_consistent(full, Prior(heaviest=[1.0, 2.0]))
    with pytest.raises(ModelError, match="total mass is 9 kg and the links may have 6 kg"):
        physically_consistent(full, Prior(heaviest=2.0, total_mass=9.0))
    with pytest.raises(ModelError, match="guess for link 1 is no body"):
        physically_consistent(full, Prior(guess=np.zeros(len(full.columns))))
    with pytest.raises(ModelError, match=r"the guess has the shape \(3,\) for 39 columns"):
        physically_consistent(full, Prior(guess=np.ones(3)))
    W = full.W.copy()
    W[:, :, full.names.index("Fv2")] = 0.0
    with pytest.raises(ModelError, match="Fv2 cannot be seen in this record; move the joint"):
        physically_consistent(replace(full, W=W))


def test_pseudo_inertia_of_a_ball():
    columns = equations()[0].columns[:10]
    second = 0.4 * 2 * 0.1**2
    ball = np.array([second, 0, 0, second, 0, second, 0, 0, 0, 2.0])
    P = pseudo_inertias(columns, ball)[1]
    assert pytest.approx(np.diag([second / 2] * 3 + [2.0])) == P
    assert consistent_links(columns, ball) == [1]
    assert consistent_links(columns, ball - np.eye(10)[0] * 2.5 * second) == []


def test_full_set_from_base_parameters():
    D, base, _ = equations()
    estimate = least_squares(full_observations().grouped(base))
    found = full_parameters(estimate, D.columns, base.matrix)
    assert consistent_links(found.columns, found.values) == [1, 2, 3]
    assert np.abs(found.misfit).max() < 3
    expected = (base.matrix @ found.values - estimate.values) / estimate.deviations
    assert found.misfit == pytest.approx(expected)
    assert found["Fv1"] == pytest.approx(0.8, abs=4 * found.deviations[found.names.index("Fv1")])
    truth = np.array(mbs_values(D.columns))
    near = full_parameters(estimate, D.columns, base.matrix, Prior(guess=truth))
    assert near["M1"] == pytest.approx(6.0, rel=0.05)
    with pytest.raises(ModelError, match="no parameter 'M9'"):
        found["M9"]
    with pytest.raises(ModelError, match="give that of the base parameters identified"):
        full_parameters(estimate, D.columns[:5], base.matrix)


def test_a_record_without_noise_has_bodies_too():
    time, q, v, a = motion()
    record = Record.of(arm(), time, q, true_efforts(q, v, a))
    found = consistent_weighted(observe_filtered(regressor(arm()), smoothed(record, 8.0)))
    assert found.residuals.total_percent < 0.02
    assert consistent_links(found.columns, found.values) == [1, 2, 3]
