"""Arguments of simulations as frozen dataclasses.

The options of a motion are `MotionOptions`. The command line and the form of the app are derived
from them. Initial values, laws and parameters are no options but the content of a simulation. They
are fields here, because they are arguments of the same functions, but the command line and the form
have their own texts for them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from mbs.assembly import System
from mbs.loops.configuration import Guess, Start
from mbs.models.state.signals import Effort
from mbs.options import described
from mbs.simulate.prescribed import Motion
from mbs.simulate.tolerances import DEFAULT, Tolerance
from mbs.solvers.problem import METHODS, Method

# Groups of arguments, for classes that have slots for them. The last base of a class is the first
# group of its signature.


@dataclass(frozen=True, kw_only=True)
class InitialMotion:
    """Initial positions and velocities."""

    __slots__ = ()

    q0: Start = field(
        default=None,
        metadata=described(
            "initial positions by coordinate name [rad or m]. The other coordinates are as in the"
            " assembled configuration. In a closed system the independent positions are kept and"
            " the loops are closed; a complete configuration is used unchanged. A `State` of"
            " `Result.state` continues that motion with its time, velocities, component states and"
            " modes. A `Result` is replaced by its last state."
        ),
    )
    v0: Start = field(
        default=None,
        metadata=described(
            "initial velocities by name [rad/s or m/s]; the others are zero. In a closed system"
            " they may be of any joints, and the others follow. A `State` or `Result` is also"
            " accepted."
        ),
    )


@dataclass(frozen=True, kw_only=True)
class Laws:
    """Laws of efforts, motions and inputs."""

    __slots__ = ()

    tau: Effort = field(
        default=None,
        metadata=described(
            "joint efforts [N m or N]: dict of constants by motor name, or a function of (t, q, v)"
            " made of CasADi operations, or a casadi.Function. A function returns efforts (nv, 1),"
            " zero for joints without motor, or a dict by joint name, also of joints without motor."
        ),
    )
    motion: Motion = field(
        default=None,
        metadata=described(
            'prescribed motions by name: "j1.q" for a position, "j1.v" for a velocity, "j1.a" for'
            " an acceleration. Each law is a number, a smooth function of t made of CasADi"
            ' operations, or a signal of a component (the Signal or its name, such as "filter.q")'
            " that depends on component states and parameters only. The column `j1.tau` is the"
            " total effort, including the effort of the drive."
        ),
    )
    u: Effort = field(
        default=None,
        metadata=described(
            "inputs of the devices of drive lines, such as voltages: dict of constants by device"
            " name, or a function of (t, q, v) as for tau. The default is `system.u_default`. The"
            " efforts of the devices are added to tau."
        ),
    )


@dataclass(frozen=True, kw_only=True)
class InitialBranch:
    """Initial states of devices, and the branch of the loops."""

    __slots__ = ()

    z0: Start = field(
        default=None,
        metadata=described(
            "initial states of devices by name, such as `motor.i`; the others have their default."
            " A `State` or `Result` is also accepted."
        ),
    )
    guess: Guess = field(
        default=None,
        metadata=described(
            "approximate initial positions of other joints, which select the branch on which the"
            " loops are closed."
        ),
    )


@dataclass(frozen=True, kw_only=True)
class InputValues:
    """Values of the inputs of a simulator."""

    __slots__ = ()

    inputs: Mapping[str, float] | None = field(
        default=None,
        metadata=described(
            "values of `Simulator.inputs` by name. An input without value has its default."
        ),
    )


@dataclass(frozen=True, kw_only=True)
class ParameterValues:
    """Values of the parameters of a system."""

    __slots__ = ()

    parameters: Mapping[str, float] | None = field(
        default=None,
        metadata=described("values of parameters by name; the others have their defaults."),
    )


@dataclass(frozen=True, kw_only=True)
class Steps:
    """Rows of the result, and accuracy of the integration."""

    __slots__ = ()

    step: float = field(
        default=0.01,  # [s] a hundred rows per second, enough for a smooth plot
        metadata=described(
            "time between the rows of the result. It does not change the accuracy.",
            unit="s",
            label="row every",
            command="--step",
            in_form=True,
        ),
    )
    tolerance: Tolerance = field(
        default=DEFAULT,
        metadata=described(
            "expected error of the motion [rad, m, rad/s or m/s]. The error of one step is limited"
            " to 1/25 of this value, and to 1/1000 relative to large coordinates. A dict sets"
            ' tolerances by unit, such as "rad" and "m/s", and by name, such as "j1.q"; "others" is'
            " for the other states. A pair is an absolute and a relative tolerance."
            ' `result.info["note"]` names positions that move by less than 100 tolerances, and'
            " starts that look like degrees.",
            command="--tolerance",
            command_text="expected error of the motion in rad, m, rad/s or m/s.",
            in_form=True,
        ),
    )
    max_step: float | None = field(
        default=None,
        metadata=described(
            "longest integration step. By default error control, the times at which laws jump, and"
            " short laws limit the steps. If a law calls a Callback or an external function, whose"
            " jumps cannot be located, the default is duration / 1000. Set it if a law is smooth"
            " and short in space, such as a narrow potential well.",
            unit="s",
            label="longest step",
            command="--max-step",
            command_text="longest integration step. By default errors and laws limit the steps.",
            in_form=True,
        ),
    )


@dataclass(frozen=True, kw_only=True)
class IntegrationMethod:
    """Integration method."""

    __slots__ = ()

    method: Method = field(
        default="dopri5",
        metadata=described(
            '"dopri5", the explicit pair of Dormand and Prince, or "rodas", the linearly implicit'
            " RODAS5P for stiff systems.",
            dict(zip(METHODS, ("explicit", "for stiff systems"), strict=True)),
            command="--method",
            command_text="explicit dopri5, or rodas for stiff systems.",
            in_form=True,
        ),
    )


# Arguments of the functions.


@dataclass(frozen=True, kw_only=True)
class MotionOptions(IntegrationMethod, Steps):
    """Options of a motion: rows of the result, accuracy, and integration method."""

    __slots__ = ()


@dataclass(frozen=True, slots=True)
class SimulatorArguments(IntegrationMethod, Laws):
    """Arguments of `Simulator`: the laws, and what all motions have in common."""

    system: System = field(metadata=described("open or closed system."))
    inputs: Sequence[str] = field(
        default=(),
        metadata=described(
            "names of efforts and component inputs whose constant value is set in each call, such"
            ' as "j1.tau" and "motor.voltage". The values replace those of `tau` and `u`.'
        ),
    )
    outputs: Sequence[str] | None = field(
        default=None,
        metadata=described(
            'names of the columns of results, such as "j1.q"; all columns by default.'
            " Accelerations, efforts, energies and sensors without column are not computed."
        ),
    )


_QUIET = "whether to hide the progress bar."


@dataclass(frozen=True, slots=True)
class MotionArguments(Steps, ParameterValues, InputValues, InitialBranch, InitialMotion):
    """Arguments of a call of a `Simulator`."""

    duration: float = field(metadata=described("duration.", unit="s"))
    quiet: bool = field(default=True, kw_only=True, metadata=described(_QUIET))


@dataclass(frozen=True, slots=True)
class RunArguments(MotionOptions, ParameterValues, InitialBranch, Laws, InitialMotion):
    """Arguments of `mbs.simulate.run`."""

    system: System = field(metadata=described("open or closed system."))
    duration: float = field(metadata=described("duration.", unit="s"))
    quiet: bool = field(default=False, kw_only=True, metadata=described(_QUIET))
