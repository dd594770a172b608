"""What the flags of an MJCF file switch off.

MuJoCo keeps two sets of bits in its options, `disableflags` and `enableflags`; the groups of
`actuatorgroupdisable` are a third. Versions differ in their names: springs and dampers had one
flag, `passive`, before they had one each.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

_EFFECTIVE = {
    *("CONSTRAINT", "EQUALITY", "FRICTIONLOSS", "LIMIT", "GRAVITY", "CLAMPCTRL", "ACTUATION"),
    *("PASSIVE", "SPRING", "DAMPER"),
}
"""Disable flags that change what is read; `Flags` says how."""
_WITHOUT_EFFECT = {
    *("CONTACT", "FILTERPARENT", "MIDPHASE", "NATIVECCD", "MULTICCD"),  # contacts are not read
    *("REFSAFE", "WARMSTART", "ISLAND"),  # the solver of soft constraints; ours are exact
    *("EULERDAMP", "AUTORESET"),  # the integrator and what it does with bad states
    "SENSOR",  # sensors are not read
}
"""Disable flags that do not change the equations of motion, and why."""
_ENABLED_WITHOUT_EFFECT = {
    *("OVERRIDE", "MULTICCD", "IPC", "SPECULATIVE"),  # contacts are not read
    *("ISLAND", "DIAGEXACT", "SLEEP"),  # the solver of soft constraints, and what it skips
    *("ENERGY", "FWDINV"),  # further outputs
    "INVDISCRETE",  # how the inverse dynamics of MuJoCo take accelerations of a discrete step
}
"""Enable flags that do not change the equations of motion, and why."""


@dataclass(frozen=True, slots=True)
class Flags:
    """What acts in a compiled model.

    Attributes:
        gravity: weight.
        springs: springs of joints and tendons.
        dampers: viscous friction of joints and tendons.
        passive: the medium and gravity compensation, which stop when springs and dampers both do.
        friction: Coulomb friction of joints and tendons, which is a constraint in MuJoCo.
        limits: ranges of joints.
        equalities: closing joints, welds and couplings.
        actuation: actuators of all groups.
        control_ranges: whether controls stay in their ranges.
        disabled_groups: bits of the groups of actuators that do not act.
        unknown: names of flags that are set and that this reader does not know.
    """

    gravity: bool
    springs: bool
    dampers: bool
    passive: bool
    friction: bool
    limits: bool
    equalities: bool
    actuation: bool
    control_ranges: bool
    disabled_groups: int
    unknown: tuple[str, ...]

    @staticmethod
    def of(mujoco: Any, model: Any) -> Flags:
        """The flags of a compiled model."""
        disabled = set(_names(mujoco.mjtDisableBit, "mjDSBL_", int(model.opt.disableflags)))
        enabled = set(_names(mujoco.mjtEnableBit, "mjENBL_", int(model.opt.enableflags)))
        unknown = (disabled - _EFFECTIVE - _WITHOUT_EFFECT) | (enabled - _ENABLED_WITHOUT_EFFECT)
        springs = not disabled & {"SPRING", "PASSIVE"}
        dampers = not disabled & {"DAMPER", "PASSIVE"}
        return Flags(
            gravity="GRAVITY" not in disabled,
            springs=springs,
            dampers=dampers,
            passive=springs or dampers,
            friction=not disabled & {"FRICTIONLOSS", "CONSTRAINT"},
            limits=not disabled & {"LIMIT", "CONSTRAINT"},
            equalities=not disabled & {"EQUALITY", "CONSTRAINT"},
            actuation="ACTUATION" not in disabled,
            control_ranges="CLAMPCTRL" not in disabled,
            disabled_groups=int(model.opt.disableactuator),
            unknown=tuple(sorted(name.lower() for name in unknown)),
        )

    def drives(self, group: int) -> bool:
        """Whether actuators of a group act; groups that have no bit always do."""
        return self.actuation and not (0 <= group < 31 and self.disabled_groups >> group & 1)


def _names(kinds: Any, prefix: str, bits: int) -> Iterator[str]:
    """Names of the bits that are set, `bit N` of those that have none."""
    known = {int(kind): name for name, kind in kinds.__members__.items() if name.startswith(prefix)}
    for k in range(bits.bit_length()):
        if bits >> k & 1:
            yield known.get(1 << k, f"bit {k}").removeprefix(prefix)
