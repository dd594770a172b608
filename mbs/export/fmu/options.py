"""Options of the export of a mechanism as an FMU."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from mbs.assembly import System
from mbs.assembly._symbolic import GROUPS
from mbs.errors import ExportError
from mbs.export.fmu.controller import Law
from mbs.export.fmu.description import Experiment, Origin, check_options, printable
from mbs.export.fmu.interface import KINDS
from mbs.export.fmu.pack import FACES, require_version
from mbs.files import PathLike
from mbs.options import described

_OUTPUTS = tuple(shown.group for shown in KINDS.values() if shown.group)


@dataclass(frozen=True, kw_only=True)
class FmuVersion:
    """Version of FMI."""

    __slots__ = ()

    fmi: str = field(
        default="2.0",
        metadata=described(
            'version of FMI, "2.0" or "3.0".',
            dict.fromkeys(FACES, ""),
            label="FMI",
            command="--fmi",
            in_form=True,
        ),
    )


@dataclass(frozen=True, kw_only=True)
class Contents:
    """Variables of an FMU, its controller and the C files of the controller."""

    __slots__ = ()

    inputs: Sequence[str] = field(
        default=(),
        metadata=described(
            'names of further inputs. "j1.a": acceleration of a joint. "j1.q": position of a joint,'
            " with its derivatives as inputs `j1.v` and `j1.a`. Both replace the effort, which"
            ' becomes an output. "tool.wrench": force and moment on a frame at its origin,'
            " expressed in the base, `tool.fx` .. `tool.mz`.",
            example="{joint}.q, {joint}.a or tool.wrench",
            command="--input",
            in_form=True,
        ),
    )
    outputs: Sequence[str] = field(
        default=(),
        metadata=described(
            'names of further outputs. "sensors": values of the sensors, such as `tip.p.x`.'
            ' "energy": `energy.kinetic` and `energy.potential`. "closure": largest closure'
            ' residual. "poses": frames of all bodies. "cut_forces": wrenches that joints'
            ' transmit, `j1.f.x` .. `j1.m.z`. Single outputs: "sensor:tip", "pose:arm",'
            ' "motion:arm", "wrench:j2".',
            label="outputs in addition to the motion of joints and tool",
            offered=_OUTPUTS,
            example="pose:tool or wrench:{joint}",
            command="--output",
            in_form=True,
        ),
    )
    parameters: Sequence[str] = field(
        default=(),
        metadata=described(
            "numeric values to convert to parameters, as in `mbs.assembly.symbolic`:"
            ' "masses", "inertias", "lengths", "friction", "M3", "d4".',
            label="numeric values to convert to parameters",
            offered=tuple(GROUPS),
            example="M3 or d4, or the name of a body",
            command="--symbolic",
            command_text='numeric values to convert to parameters: "masses", "inertias", "lengths",'
            ' "friction", "M3", "d4".',
            in_form=True,
        ),
    )
    fixed: Sequence[str] = field(
        default=(),
        metadata=described(
            "names of parameters that are constant after the initialization. All other parameters"
            " are tunable.",
            command="--fixed",
        ),
    )
    flanges: Sequence[str] = field(
        default=(),
        metadata=described(
            "names of frames at which another part of a mechanism is coupled. Their poses,"
            " velocities and accelerations are outputs, and the wrenches on them are inputs. In"
            " FMI 3.0 each flange is a terminal.",
            command="--flange",
        ),
    )
    controller: Law = field(
        default=None,
        metadata=described(
            "control law that computes the efforts, which are then no inputs. Either a function of"
            " (t, q, v) as in `mbs.simulate.run`, or a casadi.Function, whose further inputs become"
            " inputs of the FMU, or a C function of `sources` by its name or as a `CController`."
        ),
    )
    sources: Sequence[PathLike] = field(
        default=(),
        metadata=described(
            "C files and headers of the controller, which are compiled with the FMU."
        ),
    )


@dataclass(frozen=True, kw_only=True)
class Platforms:
    """Target platforms of an FMU."""

    __slots__ = ()

    platforms: Sequence[str] | None = field(
        default=None,
        metadata=described(
            'names of target platforms, such as ["x86_64-linux", "x86_64-windows"], compiled with'
            " ziglang. By default this computer, with its own compiler.",
            command="--platform",
            command_text='name of a target platform, such as "x86_64-windows", compiled with'
            " ziglang. By default this computer, with its own compiler.",
        ),
    )


@dataclass(frozen=True, kw_only=True)
class Additions:
    """Reference results, arrays and description of an FMU."""

    __slots__ = ()

    reference: bool = field(
        default=False,
        metadata=described(
            "whether to include the results of the default experiment.",
            command="--reference",
            command_text="include the results of the default experiment.",
        ),
    )
    arrays: bool = field(
        default=False,
        metadata=described(
            "whether positions, velocities, accelerations and efforts of the joints are the arrays"
            " q, v, a and tau of FMI 3.0. Dependent joints are in `q_dependent` and so on.",
            command="--arrays",
            command_text="write motion and efforts of the joints as the arrays q, v, a and tau of"
            " FMI 3.0.",
        ),
    )
    description: str = field(
        default="",
        metadata=described(
            "one-line description. By default the first line of the report of the system.",
            check=lambda label, value: printable(label, value) if value else "",
            command="--description",
        ),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class FmuOptions(Origin, Additions, Experiment, Platforms, Contents, FmuVersion):
    """Options of an FMU, in the order of the signature of `mbs.export.fmu`.

    A dataclass takes the fields of its last base first.
    """

    def check(self, name: str) -> None:
        """Check the options that do not depend on the system.

        Args:
            name: name of the system, for error messages.

        Raises:
            ExportError: an option is invalid, or does not fit the others.
        """
        require_version(name, self.fmi)
        if self.arrays and self.fmi != "3.0":
            raise ExportError(
                f"{name}: arrays are variables of FMI 3.0, and fmi is {self.fmi!r}; use fmi='3.0'"
                " or leave arrays out"
            )
        check_options(self, name)


@dataclass(frozen=True, slots=True)
class FmuArguments(FmuOptions):
    """Arguments of `mbs.export.fmu`."""

    system: System = field(metadata=described("assembled mechanism, open or closed."))
    path: PathLike = field(metadata=described("file to write."))


# Inverse geometric model of an arm.


@dataclass(frozen=True, kw_only=True)
class ArmPose:
    """Method, frame and first configuration of an inverse geometric model."""

    __slots__ = ()

    method: str = field(
        default="auto",
        metadata=described(
            '"pieper", "paul", "general", or "auto". "auto" takes the cheaper of the first two'
            " closed forms, or the general method if both fail."
        ),
    )
    frame: str | int | None = field(
        default=None,
        metadata=described("body, named frame, index of a link, or None for the terminal frame."),
    )
    locked: Mapping[str, float] | None = field(
        default=None, metadata=described("fixed positions of joints, by name [rad or m].")
    )
    start: Mapping[str, float] | Sequence[float] | None = field(
        default=None,
        metadata=described(
            "configuration at the start, (nq,) or by name. By default the assembled one."
        ),
    )


@dataclass(frozen=True, slots=True)
class InverseGeometryFmuArguments(Platforms, FmuVersion, ArmPose):
    """Arguments of `mbs.export.inverse_geometry_fmu`."""

    system: System = field(
        metadata=described("open chain that has a closed form, or six joints without symbols.")
    )
    path: PathLike = field(metadata=described("file to write."))
