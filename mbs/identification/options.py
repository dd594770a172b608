"""Arguments of an identification as a frozen dataclass."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from mbs.assembly import System
from mbs.identification.bodies import Prior
from mbs.identification.methods import METHODS
from mbs.identification.observations import EQUATIONS
from mbs.identification.record import Record, Samples, smoothed
from mbs.identification.regressors import Joints
from mbs.options import described


@dataclass(frozen=True, slots=True)
class IdentifyArguments:
    """Arguments of `mbs.identification.identify`."""

    system: System = field(
        metadata=described(
            "geometry and friction law. Its inertial and friction parameters are not used."
        )
    )
    record: Record | Sequence[Record] = field(
        metadata=described(
            "record of all joints, or of the independent joints of a closed system; or a list of"
            " records of the same joints."
        )
    )
    bandwidth: float = field(
        metadata=described(
            "bandwidth of the filters [Hz], five to ten times the highest frequency of the motion."
        )
    )
    method: str = field(
        default="weighted",
        metadata=described(
            'estimation method of the base parameters: "least_squares", "weighted", "reweighted",'
            ' "robust", "instrumental" or "consistent".',
            dict.fromkeys(METHODS, ""),
            command="--method",
            in_form=True,
        ),
    )
    equations: str = field(
        default="dynamic",
        kw_only=True,
        metadata=described(
            'identification model: "dynamic" (efforts), "filtered" or "energy". The last two need'
            " no accelerations.",
            dict.fromkeys(EQUATIONS, ""),
            command="--equations",
            command_text="identification model; filtered and energy need no accelerations.",
            in_form=True,
        ),
    )
    smoothing: Callable[[Record, float], Samples] = field(
        default=smoothed,
        kw_only=True,
        metadata=described("`smoothed`, or `smoothed_with_velocity` to use measured velocities."),
    )
    rotors: bool = field(
        default=True,
        kw_only=True,
        metadata=described(
            "whether to estimate the inertias of rotors, as in `columns_of`.",
            command="--rotors",
            command_text="whether to estimate the inertias of rotors.",
            in_form=True,
        ),
    )
    offsets: bool = field(
        default=False,
        kw_only=True,
        metadata=described(
            "whether to estimate a constant effort of each joint, as in `columns_of`.",
            command="--offsets",
            command_text="estimate a constant effort of each joint, too.",
            in_form=True,
        ),
    )
    couplings: Sequence[Joints] = field(
        default=(),
        kw_only=True,
        metadata=described("pairs of joints of coupled motors, as in `columns_of`."),
    )
    prior: Prior | None = field(
        default=None,
        kw_only=True,
        metadata=described(
            "prior knowledge of the bodies; its guess is in the order of the columns."
        ),
    )
    quiet: bool = field(
        default=False,
        kw_only=True,
        metadata=described("whether to hide the progress bar."),
    )
