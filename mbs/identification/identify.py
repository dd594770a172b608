"""From a record to base parameters, and to bodies that explain it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
import numpy.typing as npt
from casadi import DM, SX

from mbs.assembly import System
from mbs.errors import ModelError
from mbs.identification.base.application import with_parameters
from mbs.identification.base_parameters import BaseParameters, base_parameters
from mbs.identification.columns import Joints
from mbs.identification.consistent import HEAVIEST, consistent, consistent_weighted
from mbs.identification.estimate import Estimate, Estimator, held_out
from mbs.identification.filters import Samples, smoothed
from mbs.identification.least_squares import least_squares
from mbs.identification.observations import Observations, observe_filtered
from mbs.identification.record import Record
from mbs.identification.regressor import regressor
from mbs.identification.report import report
from mbs.identification.residuals import Residuals
from mbs.identification.robust import robust
from mbs.identification.weighted import reweighted, weighted
from mbs.messages import did_you_mean, quoted

Array = npt.NDArray[np.float64]

METHODS: Mapping[str, Estimator] = MappingProxyType(
    {
        "least_squares": least_squares,
        "weighted": weighted,
        "reweighted": reweighted,
        "robust": robust,
    }
)
"""Methods for base parameters by name."""


@dataclass(frozen=True, slots=True, eq=False)
class Identification:
    """What a record says of a system.

    Attributes:
        system: as it was described.
        base: its base parameters.
        observations: the equations in the full set of parameters.
        estimate: of the base parameters.
        bodies: the full set that bodies can have.
        validation: errors in the last quarter of base parameters found from the rest.
    """

    system: System
    base: BaseParameters
    observations: Observations
    estimate: Estimate
    bodies: Estimate
    validation: Residuals

    def identified_system(self) -> System:
        """The system with the identified bodies, rotors and friction, as `simulate` takes it."""
        values = SX(DM(self.bodies.values))
        return with_parameters(self.system, self.bodies.columns, values)

    def text(self) -> str:
        """Both sets of parameters, their deviations and errors, in plain lines."""
        tests = ("last quarter, from the rest", self.validation)
        return f"{report(self.estimate, tests)}\n\n{report(self.bodies)}"


def identify(
    system: System,
    record: Record,
    bandwidth: float,
    method: str = "weighted",
    *,
    smoothing: Callable[[Record, float], Samples] = smoothed,
    rotors: bool = True,
    offsets: bool = False,
    couplings: Sequence[Joints] = (),
    guess: Array | None = None,
    heaviest: float = HEAVIEST,
) -> Identification:
    """Identify a system from a record of its motion.

    Source: Khalil & Dombre 2002, chapter 12; Wensing, Kim & Slotine 2018 for bodies.

    Args:
        system: geometry and friction law; its inertial parameters and friction are not used.
        record: of all its joints.
        bandwidth: of the filters [Hz]; five to ten times the highest frequency of the motion.
        method: "least_squares", "weighted", "reweighted" or "robust", for the base parameters.
        smoothing: `smoothed`, or `smoothed_with_velocity` for measured velocities.
        rotors: see `columns_of`.
        offsets: see `columns_of`.
        couplings: see `columns_of`.
        guess: see `consistent`, in the order of the columns.
        heaviest: bound on the mass of a link [kg].

    Raises:
        ModelError: the method is unknown, or the record does not show every base parameter.
        SolverError: a search did not end.
    """
    if method not in METHODS:
        raise ModelError(
            f"{system.name}: the method is {quoted(method)}; {did_you_mean(method, METHODS)}"
        )
    estimator = METHODS[method]
    D = regressor(system, rotors=rotors, offsets=offsets, couplings=couplings)
    base = base_parameters(system, columns=D.columns)
    observations = observe_filtered(D, smoothing(record, bandwidth))
    grouped = observations.grouped(base)
    estimate = estimator(grouped)
    physical = consistent if method == "least_squares" else consistent_weighted
    bodies = physical(observations, guess, heaviest)
    validation = held_out(estimator, grouped, 0.75)
    return Identification(system, base, observations, estimate, bodies, validation)
