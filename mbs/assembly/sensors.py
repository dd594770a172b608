"""Where the sensors of a mechanism are, and how what they read is named."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from casadi import SX

from mbs.assembly.attached import require_part
from mbs.assembly.joint_rows import JointRow
from mbs.assembly.tables import ACCELERATION_UNIT, RATE_UNIT, Coordinate, Places
from mbs.assembly.tree import Frame
from mbs.components import Mechanism
from mbs.components.sensors import AbsoluteSensor, Quantity, RelativeSensor, Sensor
from mbs.components.sensors_joint import JointSensor, OnJoint
from mbs.errors import AssemblyError
from mbs.messages import did_you_mean

_INPUTS = ("q_a", "v_a", "a_a", "tau_a")
"""Names of inputs of models that could be those of a quantity as well."""


@dataclass(frozen=True, slots=True, eq=False)
class AttachedSensor:
    """A sensor and where it is.

    Attributes:
        sensor: its description.
        frames: link (-1 for the base) and pose in the link's frame, of each of its points, or of
            frame_a and frame_b of its joint.
        coordinate: name of the coordinate that it reads, or nothing.
        joint: number of its joint in `system.joints`, None where it is on none.
        quantities: what it reads.
        where: the components that it is on, in words.
    """

    sensor: Sensor
    frames: tuple[Frame, ...]
    coordinate: str
    joint: int | None
    quantities: tuple[Quantity, ...]
    where: str

    @property
    def sentence(self) -> str:
        """What it is, what it reads and where."""
        names = ", ".join(quantity.name for quantity in self.quantities)
        return f"{type(self.sensor).__name__} {self.sensor.name} reads {names} of {self.where}."

    @property
    def outputs(self) -> tuple[tuple[str, Quantity], ...]:
        """The name that each quantity has as an output of a Function: tip_p of the sensor tip.

        What CasADi does not take in a name becomes an underscore, as the dot in arm.tip does.
        """
        stem = re.sub(r"[^A-Za-z0-9]+", "_", self.sensor.name).strip("_")
        stem = stem if stem[:1].isalpha() else f"sensor_{stem}".rstrip("_")
        return tuple((f"{stem}_{quantity.name}", quantity) for quantity in self.quantities)

    @property
    def columns(self) -> tuple[tuple[str, str], ...]:
        """Name and unit of every element in a result: tip.p.x of the sensor tip."""
        return tuple(
            (".".join(filter(None, (self.sensor.name, quantity.name, element))), quantity.unit)
            for quantity in self.quantities
            for element in quantity.elements
        )


def sensors_of(mechanism: Mechanism) -> Iterator[Sensor]:
    """Every sensor, in the order added."""
    return (c for c in mechanism.components.values() if isinstance(c, Sensor))


def attached_sensors(
    mechanism: Mechanism,
    places: Places,
    joints: Sequence[JointRow],
    tables: tuple[Sequence[Coordinate], ...],
    symbols: Mapping[str, SX],
) -> tuple[AttachedSensor, ...]:
    """Every sensor with the links of its points, or its joint.

    Args:
        mechanism: the components.
        places: where bodies and joints are.
        joints: of the system.
        tables: the coordinates of q, of v, and of cut joints.
        symbols: CasADi symbol of every parameter.

    Raises:
        AssemblyError: one is on nothing that is there, or two readings have the same name.
    """
    found: list[AttachedSensor] = []
    for sensor in sensors_of(mechanism):
        if isinstance(sensor, JointSensor):
            found.append(_on_coordinate(sensor, tables))
        elif isinstance(sensor, OnJoint):
            found.append(_on_joint(mechanism, sensor, joints))
        else:
            found.append(_on_points(mechanism, sensor, places, symbols))
    _require_names(found, tables)
    return tuple(found)


def _on_points(
    mechanism: Mechanism, sensor: Sensor, places: Places, symbols: Mapping[str, SX]
) -> AttachedSensor:
    frames = []
    for point in sensor.points:
        require_part(mechanism, sensor, point, "is on")
        link, pose = places[point.owner.name, point.port]
        frames.append((link, pose @ point.placement.pose(symbols)))
    names = [point.owner.name for point in sensor.points]
    if isinstance(sensor, AbsoluteSensor):
        where = names[0]
    elif isinstance(sensor, RelativeSensor):
        where = f"{names[1]} seen from {names[0]}"
    else:
        where = " and ".join(names)
    return AttachedSensor(sensor, tuple(frames), "", None, sensor.measured, where)


def _on_joint(mechanism: Mechanism, sensor: OnJoint, joints: Sequence[JointRow]) -> AttachedSensor:
    names = [row.name for row in joints]
    if sensor.joint not in names:
        known = {joint.name for joint in mechanism.joints()}
        if sensor.joint in known:
            raise AssemblyError(
                f"{sensor.name}: joint {sensor.joint!r} closes a ring of welds, where rigid bodies"
                " do not say what it transmits; take another weld of the ring away"
            )
        raise AssemblyError(
            f"{sensor.name}: there is no joint {sensor.joint!r};"
            f" {did_you_mean(sensor.joint, names)}"
        )
    number = names.index(sensor.joint)
    frames = joints[number].frame_a, joints[number].frame_b
    return AttachedSensor(sensor, frames, "", number, sensor.measured, sensor.joint)


def _on_coordinate(sensor: JointSensor, tables: tuple[Sequence[Coordinate], ...]) -> AttachedSensor:
    q, v, cut = ({row.name: row for row in table} for table in tables)
    name = sensor.joint
    if name in cut and cut[name].kind not in ("revolute", "prismatic"):
        raise AssemblyError(
            f"{sensor.name}: the joint of {name!r} is cut to open a loop and turns in all"
            " directions; put a RelativeSensor between its frame_a and frame_b"
        )
    if not any(name in table for table in (q, v, cut)):
        known = dict.fromkeys([*q, *v, *cut])
        raise AssemblyError(
            f"{sensor.name}: there is no coordinate {name!r}; {did_you_mean(name, known)}"
        )
    quantities = [Quantity("q", table[name].unit) for table in (q, cut) if name in table]
    rates = [v[name].unit] if name in v else [RATE_UNIT[cut[name].unit]] if name in cut else []
    for unit in rates:
        quantities += [Quantity("v", unit), Quantity("a", ACCELERATION_UNIT[unit])]
    return AttachedSensor(sensor, (), name, None, tuple(quantities), name)


def _require_names(
    sensors: Sequence[AttachedSensor], tables: tuple[Sequence[Coordinate], ...]
) -> None:
    """Refuse two readings of one name, in Functions or in results."""
    owners = dict.fromkeys(_INPUTS, "an input of the models")
    columns = {
        f"{row.name}.{kind}": f"coordinate {row.name}"
        for table, kinds in zip(tables, (("q",), ("v", "a"), ()), strict=True)
        for row in table
        for kind in kinds
    }
    for attached in sensors:
        name = attached.sensor.name
        for known, names in (
            (owners, [output for output, _ in attached.outputs]),
            (columns, [column for column, _ in attached.columns]),
        ):
            taken = next((n for n in names if n in known), None)
            if taken is not None:
                raise AssemblyError(
                    f"{name}: what it reads would be named {taken!r}, which is the name of"
                    f" {known[taken]}; rename the {type(attached.sensor).__name__}"
                )
            known.update(dict.fromkeys(names, f"a reading of {name}"))
