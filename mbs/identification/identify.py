"""From a record to base parameters, and to bodies that explain it."""

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
from mbs.identification.base.application import with_parameters
from mbs.identification.base.base_parameters import BaseParameters, base_parameters
from mbs.identification.bodies.body_frames import bodies_table
from mbs.identification.bodies.consistent import consistent, consistent_weighted
from mbs.identification.bodies.prior import Prior
from mbs.identification.estimation.essential import LARGEST_PERCENT, Essential, essential
from mbs.identification.estimation.estimate import Estimate, Estimator, cross_validated, held_out
from mbs.identification.estimation.methods import METHODS, Setting
from mbs.identification.estimation.residuals import Residuals
from mbs.identification.observations.equations import EQUATIONS
from mbs.identification.observations.evaluated import with_led
from mbs.identification.observations.observations import Observations, stacked
from mbs.identification.records.filters import Samples, smoothed
from mbs.identification.records.record import Record
from mbs.identification.regressors.columns import Joints
from mbs.identification.regressors.dynamic import regressor
from mbs.identification.report import identification_report
from mbs.messages import did_you_mean, quoted
from mbs.progress import progress

TRAINED = 0.75
"""Part of a record from which parameters are found that the rest tests."""


@dataclass(frozen=True, slots=True, eq=False)
class Identification:
    """What a record says of a system.

    Attributes:
        system: as it was described.
        base: its base parameters.
        bandwidth: of the filters [Hz].
        observations: the equations in the full set of parameters.
        estimator: the method, a function of equations in base parameters.
        estimate: of the base parameters.
        bodies: the full set that bodies can have, or None where the search for it did not end.
        bodies_reason: why there are none, else empty.
        validation: errors in the last quarter of base parameters found from the rest.
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
        """The base parameters that the record needs; see `essential`."""
        return essential(self.estimate, largest_percent)

    def cross_validated(self, count: int = 4) -> Residuals:
        """Errors of every part of the record, of parameters found from the other parts."""
        return cross_validated(self.estimator, self.estimate.observations, count)

    def identified_system(self) -> System:
        """The system with the identified bodies, rotors and friction, as `simulate` takes it.

        Raises:
            ModelError: no bodies were found.
        """
        bodies = self._bodies()
        return with_parameters(self.system, bodies.columns, SX(DM(bodies.values)))

    def bodies_table(self) -> str:
        """Mass, centre of mass and inertia of every body in its own frame, in plain lines.

        Raises:
            ModelError: no bodies were found.
        """
        bodies = self._bodies()
        return bodies_table(self.system, bodies.columns, bodies.values)

    def text(self) -> str:
        """Both sets of parameters, their deviations and errors, in plain lines."""
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
        if self.bodies is None:
            raise ModelError(
                f"{self.system.name}: no bodies were found ({self.bodies_reason}); give a prior, or"
                " use the base parameters"
            )
        return self.bodies


def identify(
    system: System,
    record: Record | Sequence[Record],
    bandwidth: float,
    method: str = "weighted",
    *,
    equations: str = "dynamic",
    smoothing: Callable[[Record, float], Samples] = smoothed,
    rotors: bool = True,
    offsets: bool = False,
    couplings: Sequence[Joints] = (),
    prior: Prior | None = None,
    quiet: bool = False,
) -> Identification:
    """Identify a system from a record of its motion, or from several.

    Each record is filtered by itself and loses its ends; the equations of all come together. A
    search for bodies that does not end leaves `bodies` None, but for the method that needs them.

    Source: Khalil & Dombre 2002, chapter 12; Wensing, Kim & Slotine 2018 for bodies.

    Args:
        system: geometry and friction law; its inertial parameters and friction are not used.
        record: of all its joints, or of the independent ones of a closed system; or a list of
            records of the same joints.
        bandwidth: of the filters [Hz]; five to ten times the highest frequency of the motion.
        method: "least_squares", "weighted", "reweighted", "robust", "instrumental" or
            "consistent", for the base parameters.
        equations: "dynamic" (efforts), "filtered" or "energy"; the last two take no accelerations.
        smoothing: `smoothed`, or `smoothed_with_velocity` for measured velocities.
        rotors: see `columns_of`.
        offsets: see `columns_of`.
        couplings: see `columns_of`.
        prior: what is known of the bodies; a guess is in the order of the columns.
        quiet: no progress bar.

    Raises:
        ModelError: the method is unknown, or the record does not show every base parameter.
        SolverError: a search for the base parameters did not end.
    """
    _check(system, method, equations, smoothing)
    records = _records(system, record, bandwidth)
    known, options = prior or Prior(), _options(rotors, offsets, couplings)
    with progress(f"{system.name}: identification", 0.0, 1.0, quiet=quiet) as reached:
        D = regressor(system, **options)
        base = base_parameters(system, columns=D.columns)
        reached(0.1)
        samples = tuple(with_led(D, smoothing(one, bandwidth)) for one in records)
        full = stacked([EQUATIONS[equations](system, s, bandwidth, options) for s in samples])
        grouped = full.grouped(base)
        reached(0.3)
        physical = consistent if method == "least_squares" else consistent_weighted
        watch = partial(_between, reached, 0.3, 0.7)
        bodies, reason = _found_bodies(partial(physical, full, known, watch), method)
        reached(0.7)
        estimator = METHODS[method](Setting(D, base, samples, full, bodies, known))
        estimate = estimator(grouped)
        reached(0.85)
        validation = held_out(estimator, grouped, TRAINED)
    return Identification(
        system, base, bandwidth, full, estimator, estimate, bodies, validation, reason
    )


def _found_bodies(search: Callable[[], Estimate], method: str) -> tuple[Estimate | None, str]:
    """The bodies, or None and why not where the method does without them."""
    try:
        return search(), ""
    except SolverError as error:
        if method == "consistent":
            raise
        return None, str(error)


def _between(reached: Callable[[float], None], first: float, last: float, part: float) -> None:
    reached(first + part * (last - first))


def _records(
    system: System, record: Record | Sequence[Record], bandwidth: float
) -> tuple[Record, ...]:
    """The records as a tuple."""
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


def _options(rotors: bool, offsets: bool, couplings: Sequence[Joints]) -> dict[str, Any]:
    return {"rotors": rotors, "offsets": offsets, "couplings": couplings}


def _check(system: System, method: str, equations: str, smoothing: object) -> None:
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
