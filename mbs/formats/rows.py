"""Rows of a table of frames: plain data, checked by `mbs.formats.table.RobotTable`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from mbs.components import KhalilBody, Rotor
from mbs.errors import DescriptionError
from mbs.expressions import Number, Scalar, expression, to_float
from mbs.spatial.inertia import TEN_PARAMETERS

GEOMETRY = ("gamma", "b", "alpha", "d", "theta", "r")
"""The six parameters of a frame, in the order in which the displacements are made."""

DRIVE = ("Ia", "Fv", "Fs", "stiffness")
"""Rotor inertia, friction and spring of the joint of a body row, zero where there are none."""

BODY_SCALARS = (*TEN_PARAMETERS, *DRIVE, "Fs_width", "rest")
"""The scalars of a body row."""

JOINTS = ("revolute", "prismatic", "fixed")
"""Names of the joint types sigma = 0, 1, 2."""

LOOP_JOINTS = (*JOINTS, "cylindrical", "universal", "spherical", "planar")
"""Names of the joint types that may close a loop."""


@dataclass(frozen=True, slots=True)
class FrameRow:
    """Frame j and the joint that moves it with respect to its antecedent.

    Attributes:
        antecedent: number of the frame it is placed on, 0 for the base.
        sigma: 0 revolute, 1 prismatic, 2 fixed.
        actuated: whether a motor drives the joint (mu); None leaves the choice to the assembly.
        gamma, b, alpha, d, theta, r: Khalil parameters [rad, m]; the joint variable is added to
            theta of a revolute joint and to r of a prismatic one.
        limits: (lower, upper) of the joint variable [rad or m].
        name: of the joint, q<j> when empty.
        velocity: (lower, upper) of its rate, or the largest in both directions [rad/s or m/s].
        effort: likewise of its motor [N m or N].
    """

    antecedent: int
    sigma: int = 0
    actuated: bool | None = None
    gamma: Scalar = 0.0
    b: Scalar = 0.0
    alpha: Scalar = 0.0
    d: Scalar = 0.0
    theta: Scalar = 0.0
    r: Scalar = 0.0
    limits: tuple[float, float] | None = None
    name: str = ""
    velocity: tuple[float, float] | float | None = None
    effort: tuple[float, float] | float | None = None

    @property
    def geometry(self) -> dict[str, Scalar]:
        """The six Khalil parameters by name."""
        return {key: getattr(self, key) for key in GEOMETRY}


@dataclass(frozen=True, slots=True)
class InertiaRow:
    """The body fixed on frame j and the drive of joint j.

    Attributes:
        frame: number of the frame.
        XX, XY, XZ, YY, YZ, ZZ: inertia about the origin of the frame, in its axes [kg m^2].
        MX, MY, MZ: first moments [kg m].
        M: mass [kg].
        Ia: inertia of the rotor seen at the joint [kg m^2 or kg].
        Fv, Fs: viscous [N m s/rad or N s/m] and dry friction [N m or N].
        Fs_width: velocity over which dry friction changes sign [rad/s or m/s], 0 for a step.
        stiffness: of the spring of the joint [N m/rad or N/m].
        rest: position at which the spring is at rest [rad or m].
        rotor: that spins with the joint, on the antecedent of the frame; its axis, where given,
            is in the axes of frame j at the zero position.
        name: of the body, link<j> when empty.
        grouped: the values are base parameters, which need not belong to a single body.
    """

    frame: int
    XX: Scalar = 0.0
    XY: Scalar = 0.0
    XZ: Scalar = 0.0
    YY: Scalar = 0.0
    YZ: Scalar = 0.0
    ZZ: Scalar = 0.0
    MX: Scalar = 0.0
    MY: Scalar = 0.0
    MZ: Scalar = 0.0
    M: Scalar = 0.0
    Ia: Scalar = 0.0
    Fv: Scalar = 0.0
    Fs: Scalar = 0.0
    Fs_width: Scalar = 1e-3
    stiffness: Scalar = 0.0
    rest: Scalar = 0.0
    rotor: Rotor | None = None
    name: str = ""
    grouped: bool = False

    @property
    def is_body(self) -> bool:
        """Whether its inertial parameters are those of a body; symbols leave it open."""
        values: dict[str, Any] = {name: expression(getattr(self, name)) for name in TEN_PARAMETERS}
        if not all(isinstance(value, Number) for value in values.values()):
            return False
        try:
            KhalilBody("body", **values)
        except DescriptionError:
            return False
        return True

    @property
    def drive(self) -> list[str]:
        """Names of what acts on the joint and is not zero."""
        given = [name for name in DRIVE if to_float(expression(getattr(self, name))) != 0]
        return [*given, *(["rotor"] if self.rotor is not None else [])]


@dataclass(frozen=True, slots=True)
class CutRow:
    """A loop that is opened at a joint, which then has a frame on either side.

    Attributes:
        cut: (k, k+B): frame k carries the variable of the cut joint, frame k+B is fixed on the
            other side; they coincide when the loop is closed.
        joint: type of the cut joint.
    """

    cut: tuple[int, int]
    joint: str = "revolute"
