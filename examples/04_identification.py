"""A motion that shows the parameters of a PUMA 560, and the parameters found from it.

Run it with `python examples/04_identification.py [folder]`; files go to `build/identification` if
no folder is named. It needs matplotlib (`pip install "casadi-mbs[plot]"`).
"""

# %% What can be identified: the base parameters with rotor inertias and friction
import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import mbs
from mbs.identification import (
    FourierSettings,
    Prior,
    Record,
    base_parameters,
    excitation,
    identify,
    numeric_parameters,
    observe_filtered,
    plot_residuals,
    regressor,
    smoothed,
)

system = mbs.load("puma560").assemble()
folder = Path(sys.argv[1] if len(sys.argv) > 1 else "build/identification")
folder.mkdir(parents=True, exist_ok=True)
base = base_parameters(system)
print(f"{base.count} base parameters of {len(base.columns)}, such as {base.equations[0]}")

# %% Two motions within the limits: one to identify, one to validate
series = FourierSettings(period=10.0, harmonics=5, samples=40)
limits = {"velocity": 2.0, "acceleration": 6.0, "effort": [100, 120, 60, 10, 10, 10]}
first, second = (
    excitation(system, base, series=series, starts=1, rounds=60, seed=seed, quiet=True, **limits)
    for seed in (1, 2)
)
print(first.text())
first.table(rate=100).to_csv(folder / "motion.csv")

# %% A robot with friction, measured for three periods with noise on positions and efforts
D = regressor(system)
friction = {"Fv": 2.0, "Fs": 1.5}
K = np.array(numeric_parameters(system, D.columns), dtype=float)
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


def on_other(estimate, observations):
    """Errors in percent of an estimate in fewer parameters."""
    return estimate.residuals_on(observations.select(estimate.names)).total_percent


# %% Identify: base parameters, the essential ones among them, and bodies
bandwidth = 5.0
found = identify(system, measured(first), bandwidth, prior=Prior(heaviest=30.0), quiet=True)
(folder / "report.txt").write_text(found.text(), encoding="utf-8")
print("\n".join(found.text().splitlines()[:12]), "\n... the rest is in report.txt")

# %% Compare with the truth, in standard deviations
true = base.matrix @ K
error = (found.estimate.values - true) / found.estimate.deviations
print(f"\nLargest error of a parameter: {np.abs(found.estimate.values - true).max():.4f}")
print(f"Errors of the parameters: {np.sqrt(np.mean(error**2)):.2f} deviations in the mean,")
print(f"{np.abs(error).max():.1f} at most; {np.sum(found.estimate.percent < 10)} are known to 10 %")
few = found.essential()
print(f"Essential parameters: {len(few.estimate.names)} of {base.count}; {few.reason}")

# %% Validate: parts of the same record, then the other motion
unknown = observe_filtered(D, smoothed(measured(second), bandwidth)).grouped(base)
residuals = found.estimate.residuals_on(unknown)
print(f"\nResidual on the same motion: {found.estimate.residuals.total_percent:.3f} %")
print(
    f"Residual of parts that were left out in turn: {found.cross_validated().total_percent:.3f} %"
)
print(f"Residual on the other motion: {residuals.total_percent:.3f} %")
print(f"The same with the essential parameters alone: {on_other(few.estimate, unknown):.3f} %")
plot_residuals(residuals, folder / "residuals.png", "Other motion, filtered efforts")

# %% Draw the motion, the errors of the parameters and how sure they are
figure = Figure(figsize=(9, 9), layout="constrained")
motion, rates, values = figure.subplots(3, 1)
t = np.linspace(0, 10, 501)
motion.plot(t, first.q(t), label=[c.name for c in system.coordinates])
motion.set(ylabel="position [rad]", title="Motion to identify", xlim=(0, 10))
motion.legend(ncols=6, fontsize="small", loc="upper right")
rates.plot(t, first.v(t))
rates.set(xlabel="time [s]", ylabel="velocity [rad/s]", xlim=(0, 10))
numbers = np.arange(base.count)
values.bar(numbers, error, color=np.where(found.estimate.percent < 10, "C0", "C1"))
values.axhspan(-2, 2, color="C2", alpha=0.2, zorder=0)
values.set_xticks(numbers, found.estimate.names, rotation=90, fontsize="x-small")
values.set(ylabel="error [deviations]", xlim=(-1, base.count))
values.set_title("Errors of base parameters; orange: deviation over 10 %, green: two deviations")
for axes in (motion, rates, values):
    axes.grid(alpha=0.3)
figure.savefig(folder / "identification.png", dpi=90)
print(f"\nFiles in {folder}: {', '.join(sorted(p.name for p in folder.iterdir()))}")
