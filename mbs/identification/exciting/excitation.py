"""Motions of a robot that show its dynamic parameters as well as its limits allow."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import numpy.typing as npt
from casadi import DM, SX

from mbs.assembly import System
from mbs.assembly.model_function import require_system
from mbs.errors import ModelError, SolverError
from mbs.identification.base.base_parameters import BaseParameters, base_parameters
from mbs.identification.exciting.criterion import CRITERIA
from mbs.identification.exciting.instant import instant
from mbs.identification.exciting.limits import (
    Bound,
    Margin,
    MotionLimit,
    MotionLimits,
    Plane,
    limits_of,
)
from mbs.identification.exciting.programme import Programme
from mbs.identification.exciting.trajectory import Trajectory
from mbs.identification.follower import Watch
from mbs.identification.leading import leads_of
from mbs.identification.postures import positions
from mbs.identification.regressors.columns import Column, require_columns
from mbs.messages import did_you_mean, quoted
from mbs.progress import progress

Array = npt.NDArray[np.float64]

_FINE = 8
_TRIES = 4
_FIRST_ROUNDS = 60
_SIGN_PART = 0.02
_ALLOWED = 1e-6


@dataclass(frozen=True, slots=True)
class Series:
    """The form of the motion and how it is sampled.

    Attributes:
        period: [s].
        harmonics: of 1/period; two or more.
        samples: of one period, at which the criterion and the limits are computed.
    """

    period: float = 10.0
    harmonics: int = 5
    samples: int = 100

    def __post_init__(self) -> None:
        if not (np.isfinite(self.period) and self.period > 0):
            raise ModelError(f"excitation: the period is {self.period:g} s; give a positive time")
        for name in ("harmonics", "samples"):
            number = getattr(self, name)
            if not isinstance(number, int):
                raise ModelError(f"excitation: {name} is {quoted(number)}; give a whole number")
        if self.harmonics < 2:
            raise ModelError(
                f"excitation: {self.harmonics} harmonics cannot start and end at rest; give 2 or"
                " more"
            )
        if self.samples < 4 * self.harmonics:
            raise ModelError(
                f"excitation: {self.samples} samples are too few for {self.harmonics} harmonics;"
                f" give {4 * self.harmonics} or more"
            )


def excitation(
    system: System,
    columns: BaseParameters | Sequence[Column] | None = None,
    *,
    series: Series | None = None,
    position: Bound = None,
    velocity: Bound = None,
    acceleration: Bound = None,
    effort: Bound = None,
    planes: Sequence[Plane] = (),
    objective: str = "log_det",
    starts: int = 3,
    rounds: int = 150,
    seed: int = 1,
    quiet: bool = False,
) -> Trajectory:
    """A periodic motion from rest to rest that shows the parameters well within the limits.

    The coefficients of Fourier series of the independent joints minimise a criterion of the
    regressor at all samples, by IPOPT with exact gradients. Efforts are those of the parameters
    that the system has. Ranges of positions, velocities and accelerations hold at every instant;
    those of efforts and planes, at instants eight times as dense as the samples. Closed systems
    keep clear of postures at which the independent joints do not lead the others.

    The sign of velocities is smoothed over a fiftieth of the largest velocity while the motion is
    sought; the condition numbers of the answer are of the regressor as it is.

    Source: Swevers, Ganseman, Tukel, Schutter & Brussel 1997.

    Args:
        system: open or closed, its independent joints revolute or prismatic.
        columns: what is to be identified: base parameters, or columns that do not depend on each
            other; `base_parameters(system)` when left out.
        series: period, harmonics and samples.
        position: limits of the m independent joints [rad or m]; the ranges of the joints when
            left out. A number is meant as +-; a sequence gives each joint its own; a dict names
            joints, those that follow the independent ones included.
        velocity: likewise [rad/s or m/s], those that the joints describe when left out; None in
            a sequence or dict is no limit.
        acceleration: likewise [rad/s2 or m/s2], none when left out.
        effort: likewise [N m or N], those that the joints describe when left out.
        planes: that points must not pass.
        objective: "log_det" (smallest volume of the parameters' uncertainty), "condition" (of the
            regressor in SI units) or "scaled_condition" (with columns of length one).
        starts: random motions that are improved; the best goes on.
        rounds: largest number of steps of the last search.
        seed: of the random motions.
        quiet: no progress bar.

    Raises:
        ModelError: a limit, a name or a number has no sense.
        SolverError: no motion within the limits was found, or none tells the columns apart.
    """
    require_system(system)
    _check(system, objective, starts, rounds)
    limits = limits_of(
        system,
        position,
        velocity=velocity,
        acceleration=acceleration,
        effort=effort,
        planes=planes,
    )
    form = _form(series)
    chosen = _columns(system, columns)
    smooth = _smoothed(system, limits, form)
    function = instant(smooth, chosen, limits)
    programme = Programme(
        form.period, form.harmonics, form.samples, function, CRITERIA[objective], limits
    )
    measured = partial(_measured, system, chosen, programme)
    steps = _FIRST_ROUNDS * (starts if starts > 1 else 0)
    with progress(f"{system.name}: excitation", 0.0, steps + rounds, quiet=quiet) as reached:
        x = _best(programme, np.random.default_rng(seed), starts, reached)
        found = _within(programme, measured, x, rounds, lambda part: reached(steps + part * rounds))
    return replace(found, objective=objective)


def _best(programme: Programme, rng: np.random.Generator, starts: int, reached: Watch) -> Array:
    """Variables of the random motion that leads furthest in a short search.

    Args:
        programme: to be solved.
        rng: of the random motions.
        starts: how many there are.
        reached: is told the steps that are over.
    """
    x = [programme.start(rng) for _ in range(starts)]
    if starts == 1:
        return x[0]
    still = np.zeros(len(programme.limits.of_models))
    found = []
    for number, first in enumerate(x):
        found.append(programme.improve(first, still, _FIRST_ROUNDS))
        reached(_FIRST_ROUNDS * (number + 1))
    return min(found, key=lambda answer: (answer.violation > _ALLOWED, answer.value)).x


def _within(
    programme: Programme,
    measured: Callable[[Array], Trajectory],
    x: Array,
    rounds: int,
    watch: Watch,
) -> Trajectory:
    """The motion at the minimum near x, efforts and planes kept between samples too."""
    narrowed = np.zeros(len(programme.limits.of_models))
    fixed = len(programme.limits.of_rates)
    for _ in range(_TRIES):
        answer = programme.improve(x, narrowed, rounds, watch)
        trajectory = measured(answer.x)
        excess = np.array([max(-margin.worst, 0.0) for margin in trajectory.margins[fixed:]])
        parts = np.array([margin.part for margin in trajectory.margins])
        if (parts >= -_ALLOWED).all():
            return replace(trajectory, status=answer.status, steps=answer.steps)
        narrowed, x = narrowed + 1.2 * excess, answer.x
    worst = min(trajectory.margins, key=lambda margin: margin.part)
    raise SolverError(
        f"{trajectory.system.name}: the {worst.limit.quantity} of {worst.limit.name} passes its"
        f" limit by {-worst.worst:.3g} {worst.limit.unit} in the best motion that was found; give"
        " wider limits, a longer period or more rounds"
    )


def _measured(
    system: System, columns: tuple[Column, ...], programme: Programme, x: Array
) -> Trajectory:
    """The motion with its condition numbers and margins, of the system as it is."""
    motion, limits = programme.series(x), programme.limits
    exact = instant(system, columns, limits)
    n = _FINE * programme.samples
    t = np.arange(n) * programme.period / n
    rates = motion.q(t), motion.v(t), motion.a(t)
    values = [np.array(value) for value in exact.map(n)(*(DM(x.T) for x in rates))]
    if limits.leading:
        values[1][-1] = leads_of(system, positions(system, rates[0]))
    quantities = [*np.hstack(rates).T, *values[1]]
    names: list[MotionLimit] = [*limits.of_rates, *limits.of_models]
    margins = tuple(
        Margin(limit, float(row.min()), float(row.max()))
        for limit, row in zip(names, quantities, strict=True)
    )
    W = values[0].reshape(len(columns), -1)
    lengths = np.linalg.norm(W, axis=1)
    return Trajectory(
        system=system,
        columns=columns,
        series=motion,
        condition=_condition(W),
        scaled_condition=_condition(W / lengths[:, None]),
        margins=margins,
    )


def _form(series: Series | None) -> Series:
    if series is None:
        return Series()
    if not isinstance(series, Series):
        raise ModelError(
            f"excitation: the series is {quoted(series)}; give"
            " mbs.identification.Series(period=, harmonics=, samples=)"
        )
    return series


def _columns(
    system: System, columns: BaseParameters | Sequence[Column] | None
) -> tuple[Column, ...]:
    if columns is None:
        return tuple(base_parameters(system).kept)
    chosen = tuple(columns if isinstance(columns, Sequence) else columns.kept)
    require_columns(system, chosen)
    if not chosen:
        raise ModelError(f"{system.name}: no column is to be identified; give one or more")
    return chosen


def _smoothed(system: System, limits: MotionLimits, form: Series) -> System:
    """The system with dry friction that changes sign over a part of the largest velocity."""
    widths = {}
    rows = zip(system.active, limits.position, limits.velocity, strict=True)
    for k, position, velocity in rows:
        span = np.pi * (position.upper - position.lower) / form.period
        fastest = velocity.upper if velocity.is_finite else span
        widths[system.speeds[k].name] = SX(_SIGN_PART * fastest)
    links = tuple(
        replace(link, Fs_width=widths.get(link.name, link.Fs_width)) for link in system.tree.links
    )
    return replace(system, tree=replace(system.tree, links=links), _cache={})


def _check(system: System, objective: str, starts: int, rounds: int) -> None:
    if objective not in CRITERIA:
        raise ModelError(
            f"excitation: there is no objective {objective!r}; {did_you_mean(objective, CRITERIA)}"
        )
    for name, number in {"starts": starts, "rounds": rounds}.items():
        if number < 1:
            raise ModelError(f"excitation: {number} {name} give no motion; give 1 or more")
    if tuple(system.free) != tuple(system.active):
        raise ModelError(
            f"{system.name}: some independent joints have velocities alone, such as discs that"
            " roll; excitation is for positions that are independent too"
        )


def _condition(W: Array) -> float:
    values = np.linalg.svd(W, compute_uv=False)
    return float(values[0] / values[-1])
