"""Identification from records: base parameters and physically consistent bodies."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from numbers import Real
from typing import Any

from casadi import DM, SX

from mbs.assembly import System
from mbs.assembly.model_function import require_system
from mbs.errors import ModelError, SolverError
from mbs.identification._base_parameters import BaseParameters, base_parameters, with_parameters
from mbs.identification.bodies import (
    Prior,
    bodies_table,
    consistent_links,
    consistent_weighted,
    physically_consistent,
)
from mbs.identification.estimate import (
    Estimate,
    Estimator,
    Residuals,
    cross_validated,
    holdout_residuals,
)
from mbs.identification.methods import LARGEST_PERCENT, METHODS, Essential, Setting, essential
from mbs.identification.observations import (
    EQUATIONS,
    Observations,
    excitation_quality,
    stacked,
    with_regular,
)
from mbs.identification.options import IdentifyArguments
from mbs.identification.record import Record
from mbs.identification.regressors import INERTIAL, regressor
from mbs.options import arguments_of
from mbs.progress import progress
from mbs.text import did_you_mean, quoted

# Text report of an identification.


POOR = 30.0
"""Relative standard deviation above which a parameter is marked as poorly identified [%]: three
deviations then include zero, so that even the sign is uncertain."""
_SURE = 3.0
"""Standard deviations below zero from which a value counts as negative: 99.9 % of normal errors
are smaller."""
_UNFIT = 20.0
"""Relative error of all efforts above which noise and friction laws are no explanation [%]."""

_MODEL_DONE, _EQUATIONS_DONE, _BODIES_DONE, _SOLVED = 0.1, 0.3, 0.7, 0.85
"""Completed fractions of the time after these steps, for a robot of six joints; used for the
progress bar."""


def report(estimate: Estimate, *tests: tuple[str, Residuals]) -> str:
    """Return a text report of parameters, standard deviations, residuals and excitation.

    Args:
        estimate: parameter values, covariance and residuals of any estimation method.
        *tests: pairs (title, residuals) of further tests, such as ("last quarter", held_out(...)).

    Returns:
        Lines of text. A * marks parameters with a standard deviation of more than 30 %.
    """
    observations = estimate.observations
    rows, m = observations.y.shape
    span = observations.time[-1] - observations.time[0]
    lines = [
        f"Identification by {estimate.method}: {len(estimate.names)} parameters from"
        f" {rows} instants of {m} efforts, {span:.4g} s",
        "",
        *_parameter_lines(estimate),
        "",
        *_residual_lines("Errors", estimate.residuals),
    ]
    for title, residuals in tests:
        lines += ["", *_residual_lines(f"Errors, {title}", residuals)]
    remarks = [
        *_misfit_remark(estimate.residuals),
        *_dropped_remark(observations),
        *_excitation_remark(estimate),
        *_consistency_remark(estimate),
        *_sign_remark(estimate),
    ]
    return "\n".join([*lines, "", *remarks])


def identification_report(
    estimate: Estimate, essential: Essential, bodies: Estimate | str, *tests: tuple[str, Residuals]
) -> str:
    """Return a text report of base parameters, essential parameters and bodies.

    Args:
        estimate: estimate of base parameters.
        essential: result of the reduction of `estimate` to its essential parameters.
        bodies: physically consistent estimate of the full parameter set, or the reason why there
            is none.
        *tests: pairs (title, residuals) of further tests of the base parameters.

    Returns:
        Lines of text.
    """
    few = essential.estimate
    lines = [
        f"Essential: {len(few.names)} of {len(estimate.names)} parameters, errors with them alone"
        f" {few.residuals.total_percent:.2f} %; {essential.reason}",
        f"Not needed: {', '.join(essential.dropped) or 'none'}",
    ]
    told = bodies if isinstance(bodies, str) else report(bodies)
    return "\n".join([report(estimate, *tests), "", *lines, "", told])


def _parameter_lines(estimate: Estimate) -> list[str]:
    """Return the lines of the table of parameters: name, value and standard deviation."""
    lines = [f"{'parameter':<12}{'value':>12}{'deviation':>12}{'%':>9}  unit"]
    rows = zip(
        estimate.columns, estimate.values, estimate.deviations, estimate.percent, strict=True
    )
    for column, value, deviation, percent in rows:
        share = f"{percent:.1f}" if percent < 1000 else "-"
        mark = " *" if percent > POOR else ""
        lines.append(
            f"{column.name:<12}{value:>12.5g}{deviation:>12.2g}{share:>9}  {column.unit}{mark}"
        )
    return lines


def _residual_lines(title: str, residuals: Residuals) -> list[str]:
    """Return the lines of a table of residuals: percentage, rms and independent rows per effort.

    `title` is printed in its first line.
    """
    lines = [
        f"{title}: {residuals.total_percent:.2f} % of all efforts",
        f"{'effort':<12}{'error':>10}{'rms':>12}  {'unit':<6}{'independent rows':>18}",
    ]
    rows = zip(
        residuals.efforts,
        residuals.percent,
        residuals.rms,
        residuals.effort_units,
        len(residuals.time) / residuals.repetition,
        strict=True,
    )
    return lines + [
        f"{name:<12}{percent:>8.2f} %{rms:>12.4g}  {unit:<6}{count:>18.0f}"
        for name, percent, rms, unit, count in rows
    ]


def _misfit_remark(residuals: Residuals) -> list[str]:
    """Return a remark as a list of one line if the residuals are too large to be noise, else []."""
    if not residuals.total_percent > _UNFIT:
        return []
    return [
        f"Fit: {residuals.total_percent:.0f} % of the efforts are not explained; check the order of"
        " the columns, units (rad, N m), gear ratios (joint_side) and signs"
    ]


def _dropped_remark(observations: Observations) -> list[str]:
    """Return a remark on instants near singular configurations missing in `observations`, or []."""
    if not observations.dropped:
        return []
    rows = len(observations.time)
    return [
        f"Loops: {observations.dropped} of {rows + observations.dropped} instants are left out,"
        " where the motion is next to a singular configuration or passes it"
    ]


def _excitation_remark(estimate: Estimate) -> list[str]:
    """Return a remark on the condition number, or on parameters that are not identifiable.

    [] for a full parameter set, which is never fully identifiable.
    """
    if _is_full(estimate):
        return []
    quality = excitation_quality(estimate.observations)
    if quality.sentence:
        return [f"Excitation: {quality.sentence}"]
    return [
        f"Excitation: condition number {quality.condition:.4g}, {quality.scaled_condition:.4g}"
        " with scaled columns"
    ]


def _consistency_remark(estimate: Estimate) -> list[str]:
    """Return a remark whether each link has a positive definite pseudo-inertia.

    [] unless all ten inertial parameters of every link are estimated.
    """
    if not _is_full(estimate):
        return []
    links = {c.link for c in estimate.columns if c.kind in INERTIAL}
    good = consistent_links(estimate.columns, estimate.values)
    bad = [str(link) for link in sorted(links) if link not in good]
    if not bad:
        return [f"Bodies: all {len(good)} pseudo-inertias are positive definite"]
    return [f"Bodies: no body has the parameters of link {', '.join(bad)}"]


def _is_full(estimate: Estimate) -> bool:
    """Whether all ten inertial parameters of every link are estimated."""
    inertial = [c for c in estimate.columns if c.kind in INERTIAL]
    return len(inertial) == len(INERTIAL) * len({c.link for c in inertial}) > 0


def _sign_remark(estimate: Estimate) -> list[str]:
    """Return a remark on friction or rotor inertias that are significantly negative, or []."""
    rows = zip(estimate.columns, estimate.values, estimate.deviations, strict=True)
    kinds = ("Ia", "Iam", "Jm", "Fv", "Fvm", "Fs", "Fsm")
    bad = [c.name for c, x, s in rows if c.kind in kinds and x < -_SURE * s]
    if not bad:
        return []
    return [f"Below zero: {', '.join(bad)}; check the signs of the efforts and the friction law"]


TRAINED = 0.75
"""Fraction of a record that is used for estimation. The remaining part is used for validation."""


@dataclass(frozen=True, slots=True, eq=False)
class Identification:
    """Result of the identification of a system from records.

    Attributes:
        system: system as described before the identification.
        base: base parameters of the system.
        bandwidth: bandwidth of the filters [Hz].
        observations: equations in the full set of parameters.
        estimator: estimation method, a function of equations in base parameters.
        estimate: estimate of the base parameters.
        bodies: physically consistent estimate of the full set, or None if its search did not
            converge.
        bodies_reason: reason why `bodies` is None, otherwise empty.
        validation: residuals in the last quarter of base parameters estimated from the first three
            quarters.
    """

    system: System
    base: BaseParameters
    bandwidth: float
    observations: Observations
    estimator: Estimator
    estimate: Estimate
    bodies: Estimate | None
    validation: Residuals
    bodies_reason: str = ""

    def __repr__(self) -> str:
        error = self.estimate.residuals.total_percent
        return (
            f"<Identification {self.system.name}: {self.base.count} base parameters of"
            f" {len(self.base.columns)}, {self.estimate.method}, error {error:.3g} %>"
        )

    def essential(self, largest_percent: float = LARGEST_PERCENT) -> Essential:
        """Return the estimate reduced to the essential base parameters.

        Args:
            largest_percent: relative standard deviation [%] at which the elimination ends; see
                `mbs.identification.essential`.
        """
        return essential(self.estimate, largest_percent)

    def cross_validated(self, count: int = 4) -> Residuals:
        """Return the residuals of each part of the record, with parameters from the other parts.

        Args:
            count: number of parts, at least two.
        """
        return cross_validated(self.estimator, self.estimate.observations, count)

    def identified_system(self) -> System:
        """Return the system with the identified bodies, rotors and friction, for use in `simulate`.

        Raises:
            ModelError: no bodies were found.
        """
        bodies = self._bodies()
        return with_parameters(self.system, bodies.columns, SX(DM(bodies.values)))

    def bodies_table(self) -> str:
        """Return a text table of mass, centre of mass and inertia of every body in its own frame.

        Raises:
            ModelError: no bodies were found.
        """
        bodies = self._bodies()
        return bodies_table(self.system, bodies.columns, bodies.values)

    def text(self) -> str:
        """Return a printable report of base parameters, essential parameters and bodies."""
        title = (
            f"{self.system.name}: {self.base.count} base parameters of {len(self.base.columns)},"
            f" bandwidth {self.bandwidth:g} Hz"
        )
        tests = (f"last {100 * (1 - TRAINED):g} %, found from the rest", self.validation)
        bodies = self.bodies or f"Bodies: none were found; {self.bodies_reason}"
        told = identification_report(self.estimate, self.essential(), bodies, tests)
        lines = [title, "", told]
        if self.bodies is not None:
            lines += ["", self.bodies_table()]
        return "\n".join(lines)

    def _bodies(self) -> Estimate:
        """Return the estimated bodies. Raise ModelError if none were found."""
        if self.bodies is None:
            raise ModelError(
                f"{self.system.name}: no bodies were found ({self.bodies_reason}); give a prior, or"
                " use the base parameters"
            )
        return self.bodies


@arguments_of(IdentifyArguments)
def identify(options: IdentifyArguments) -> Identification:
    """Identify the parameters of a system from one or more records of its motion.

    Each record is filtered separately and its ends are dropped; the equations of all records are
    stacked. If the search for bodies does not converge, `bodies` is None, except for the method
    "consistent", which requires them.

    Source: Khalil & Dombre 2002, chapter 12; Wensing, Kim & Slotine 2018 for bodies.

    Args:
        options: see `IdentifyArguments`.

    Raises:
        ModelError: the method is unknown, or a base parameter is not identifiable from the record.
        SolverError: the estimation of the base parameters did not converge.
    """
    system, bandwidth, method = options.system, options.bandwidth, options.method
    _check_choices(system, method, options.equations, options.smoothing)
    records = _record_tuple(system, options.record, bandwidth)
    known = options.prior or Prior()
    chosen: dict[str, Any] = {
        "rotors": options.rotors,
        "offsets": options.offsets,
        "couplings": options.couplings,
    }
    with progress(f"{system.name}: identification", 0.0, 1.0, quiet=options.quiet) as reached:
        D = regressor(system, **chosen)
        base = base_parameters(system, columns=D.columns)
        reached(_MODEL_DONE)
        samples = tuple(with_regular(D, options.smoothing(one, bandwidth)) for one in records)
        equations = EQUATIONS[options.equations]
        full = stacked([equations(system, s, bandwidth, chosen) for s in samples])
        grouped = full.grouped(base)
        reached(_EQUATIONS_DONE)
        physical = physically_consistent if method == "least_squares" else consistent_weighted
        watch = partial(_partial_progress, reached, _EQUATIONS_DONE, _BODIES_DONE)
        bodies, reason = _found_bodies(partial(physical, full, known, watch), method)
        reached(_BODIES_DONE)
        estimator = METHODS[method](Setting(D, base, samples, full, bodies, known))
        estimate = estimator(grouped)
        reached(_SOLVED)
        validation = holdout_residuals(estimator, grouped, TRAINED)
    return Identification(
        system, base, bandwidth, full, estimator, estimate, bodies, validation, reason
    )


def _found_bodies(search: Callable[[], Estimate], method: str) -> tuple[Estimate | None, str]:
    """Call `search`; return its estimate and "", or None and the message if it does not converge.

    The error is raised if the method is "consistent", which requires the bodies.
    """
    try:
        return search(), ""
    except SolverError as error:
        if method == "consistent":
            raise
        return None, str(error)


def _partial_progress(
    reached: Callable[[float], None], first: float, last: float, part: float
) -> None:
    """Call `reached` with the progress between `first` and `last` at fraction `part` (0 to 1)."""
    reached(first + part * (last - first))


def _record_tuple(
    system: System, record: Record | Sequence[Record], bandwidth: float
) -> tuple[Record, ...]:
    """Return one record or a list of records as a tuple.

    Raises ModelError for another type, an empty list, or a bandwidth that is not a number.
    """
    given = tuple(record) if isinstance(record, list | tuple) else (record,)
    for one in given:
        if not isinstance(one, Record):
            raise ModelError(
                f"{system.name}: the record is {quoted(one)}; give"
                " mbs.identification.Record.of(system, time, q, tau), or a list of such"
            )
    if not given:
        raise ModelError(f"{system.name}: the list of records is empty; give one or more")
    if isinstance(bandwidth, bool) or not isinstance(bandwidth, Real):
        raise ModelError(
            f"{system.name}: the bandwidth is {quoted(bandwidth)}; give a number in Hz"
        )
    return given


def _check_choices(system: System, method: str, equations: str, smoothing: object) -> None:
    """Raise ModelError if the method, the equations or the smoothing function is unknown."""
    require_system(system)
    if not callable(smoothing):
        raise ModelError(
            f"{system.name}: smoothing is {quoted(smoothing)}; give the function"
            " mbs.identification.smoothed, or smoothed_with_velocity"
        )
    choices = {"method": (method, METHODS), "equations": (equations, EQUATIONS)}
    for what, (given, known) in choices.items():
        if given not in known:
            raise ModelError(
                f"{system.name}: {what} is {quoted(given)}; {did_you_mean(given, known)}"
            )
    if method == "instrumental" and equations != "dynamic":
        raise ModelError(
            f"{system.name}: instruments are for the dynamic equations alone; use"
            " equations='dynamic', or another method"
        )
