"""A motion that shows the parameters of a PUMA 560, and the parameters found from it.

Run it with `python examples/04_identification.py [folder]`; files go to `build/identification` if
no folder is named. It needs matplotlib (`pip install "mbs[plot]"`).
"""

# %% What can be identified: the base parameters with rotor inertias and friction
import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import mbs
from mbs.identification import numbers_of, regressor
from mbs.identification.base_parameters import base_parameters
from mbs.identification.excitation import Series, excitation
from mbs.identification.filters import smoothed
from mbs.identification.observations import observe_filtered
from mbs.identification.record import Record
from mbs.identification.weighted import weighted

system = mbs.load("puma560").assemble()
folder = Path(sys.argv[1] if len(sys.argv) > 1 else "build/identification")
folder.mkdir(parents=True, exist_ok=True)
base = base_parameters(system)
print(f"{base.count} base parameters of {len(base.columns)}, such as {base.equations[0]}")

# %% Two motions within the limits: one to identify, one to validate
series = Series(period=10.0, harmonics=5, samples=40)
limits = {"velocity": 2.0, "acceleration": 6.0, "effort": [100, 120, 60, 10, 10, 10]}
first, second = (
    excitation(system, base, series=series, starts=1, rounds=30, seed=seed, **limits)
    for seed in (1, 2)
)
print(first.text())
first.table(rate=100).to_csv(folder / "motion.csv")

# %% A robot with friction, measured for three periods with noise on positions and efforts
D = regressor(system)
friction = {"Fv": 2.0, "Fs": 1.5}
K = np.array(numbers_of(system, D.columns), dtype=float)
K += [friction.get(c.kind, 0.0) / (1 + 4 * (c.link > 3)) for c in D.columns]
rng, rate = np.random.default_rng(7), 500.0
deviation = np.array([0.5, 0.5, 0.5, 0.05, 0.05, 0.05])


def measured(motion):
    """What sensors would give during a motion."""
    t = np.arange(0.0, 30.0, 1 / rate)
    q, v, a = motion.q(t), motion.v(t), motion.a(t)
    W = np.array(D.map(len(t))(q.T, v.T, a.T)).reshape(6, len(t), len(K))
    tau = (W @ K).T + deviation * rng.standard_normal((len(t), 6))
    return Record.of(system, t, q + 1e-5 * rng.standard_normal(q.shape), tau)


bandwidth = 5.0
known, unknown = (
    observe_filtered(D, smoothed(measured(motion), bandwidth)).grouped(base)
    for motion in (first, second)
)

# %% Identify, and validate on the other motion
estimate = weighted(known)
true = base.matrix @ K
error = np.abs(estimate.values - true)
print(f"\n{'parameter':<10} {'true':>9} {'found':>9} {'sd':>9}")
for name, x, y, s in zip(estimate.names, true, estimate.values, estimate.deviations, strict=True):
    print(f"{name:<10} {x:9.4f} {y:9.4f} {s:9.4f}")
print(f"\nLargest error of a parameter: {error.max():.4f}")
residuals = estimate.residuals_on(unknown)
print(f"Residual on the same motion: {estimate.residuals.total_percent:.3f} %")
print(f"Residual on the other motion: {residuals.total_percent:.3f} %")

# %% Draw the motion and the efforts that were predicted
figure = Figure(figsize=(10, 8), layout="constrained")
motion, *efforts = figure.subplots(4, 1, sharex=True)
t = np.linspace(0, 10, 501)
motion.plot(t, first.q(t), label=[c.name for c in system.coordinates])
motion.set(ylabel="q [rad]", title="Motion to identify")
motion.legend(ncols=6, fontsize="small")
shown = residuals.time < residuals.time[0] + 10
for axes, k in zip(efforts, (1, 2, 4), strict=True):
    t = residuals.time[shown] - residuals.time[0]
    axes.plot(t, residuals.measured[shown, k], "k", linewidth=1, label="measured")
    axes.plot(t, residuals.predicted[shown, k], "--", label="predicted")
    axes.plot(t, residuals.error[shown, k], linewidth=1, label="difference")
    axes.set(ylabel=f"{residuals.efforts[k]} [{residuals.effort_units[k]}]")
    axes.grid(alpha=0.3)
efforts[0].set_title("Other motion, filtered efforts")
efforts[0].legend(ncols=3, fontsize="small")
efforts[-1].set_xlabel("time [s]")
figure.savefig(folder / "identification.png", dpi=90)
print(f"\nFiles in {folder}: {', '.join(sorted(p.name for p in folder.iterdir()))}")
