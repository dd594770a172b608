from dataclasses import replace

import numpy as np
import pytest
from support.measured_arm import equations, noisy_samples

from mbs.identification import (
    holdout_residuals,
    observe,
    physically_consistent,
    plot_residuals,
    report,
    weighted,
)


def full():
    return observe(equations()[0], noisy_samples(np.array([0.3, 0.1, 0.5])))


def test_the_report_says_values_deviations_errors_and_excitation():
    observations = full().grouped(equations()[1])
    estimate = weighted(observations)
    text = report(estimate, ("last quarter", holdout_residuals(weighted, observations)))
    lines = text.splitlines()
    head = f"weighted least squares: {len(estimate.names)} parameters from 500 instants of 3 eff"
    assert head in lines[0]
    row = next(line.split() for line in lines if line.startswith("Fv1"))
    assert float(row[1]) == pytest.approx(estimate["Fv1"], rel=1e-4)
    assert float(row[2]) == pytest.approx(estimate.deviations[estimate.names.index("Fv1")], rel=0.1)
    assert row[4] == "N.m.s/rad"
    total = estimate.residuals.total_percent
    assert f"Errors: {total:.2f} % of all efforts" in text
    assert "Errors, last quarter: " in text
    assert sum(line.startswith("q3 ") for line in lines) == 2
    assert "condition number" in lines[-1]
    marked = [line.split()[0] for line in lines if line.endswith(" *")]
    assert marked == [n for n, p in zip(estimate.names, estimate.percent, strict=True) if p > 30]


def test_the_report_of_a_full_set_speaks_of_bodies():
    text = report(physically_consistent(full()))
    assert "Bodies: all 3 pseudo-inertias are positive definite" in text
    assert "cannot be told apart" not in text


def test_a_bad_fit_is_told():
    samples = noisy_samples(np.array([0.3, 0.1, 0.5]))
    swapped = replace(samples, tau=samples.tau[:, ::-1])
    estimate = weighted(observe(equations()[0], swapped).grouped(equations()[1]))
    share = estimate.residuals.total_percent
    assert share > 25
    assert f"Fit: {share:.0f} % of the efforts are not explained; check the order" in report(
        estimate
    )
    assert "Fit:" not in report(weighted(full().grouped(equations()[1])))


def test_residuals_are_drawn_for_each_joint(tmp_path):
    pytest.importorskip("matplotlib")
    residuals = weighted(full().grouped(equations()[1])).residuals
    figure = plot_residuals(residuals, tmp_path / "errors.png", "arm")
    assert (tmp_path / "errors.png").stat().st_size > 1000
    assert len(figure.axes) == 3
    drawn = figure.axes[1].lines[2].get_ydata()
    assert np.array_equal(drawn, residuals.measured[:, 1] - residuals.predicted[:, 1])
    assert f"{residuals.percent[1]:.1f} %" in figure.axes[1].get_title()
