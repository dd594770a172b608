"""The parameters in which the equations of motion are linear: names, units and present values."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypedDict

import casadi
import numpy as np
from casadi import DM, SX, Function
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.assembly.model_function import require_system
from mbs.assembly.tree import Link
from mbs.components.motion import Motion
from mbs.errors import ModelError
from mbs.messages import did_you_mean, quoted

INERTIAL = ("XX", "XY", "XZ", "YY", "YZ", "ZZ", "MX", "MY", "MZ", "M")
"""Kinds of the inertial parameters of a link, about the origin of its frame and in its axes."""

COUPLED = ("Iam", "Fvm", "Fsm")
"""Kinds of the parameters of a motor that turns with two joints: inertia and both frictions."""

_INERTIAL_UNITS = ("kg.m2",) * 6 + ("kg.m",) * 3 + ("kg",)
_TURNING = {
    **{kind: "kg.m2" for kind in ("Ia", "Iam", "Jm")},
    **{kind: "N.m.s/rad" for kind in ("Fv", "Fvm")},
    **{kind: "N.m" for kind in ("Fs", "Fsm", "offset")},
}
_SLIDING = {
    **{kind: "kg" for kind in ("Ia", "Iam")},
    **{kind: "N.s/m" for kind in ("Fv", "Fvm")},
    **{kind: "N" for kind in ("Fs", "Fsm", "offset")},
    "Jm": "kg.m2",
}

Joints = tuple[str | int, str | int]
"""Two joints of the tree, by name or by the number of their link, from 1."""


class ColumnChoice(TypedDict, total=False):
    """Which parameters to take; see `columns_of`."""

    rotors: bool
    friction: bool
    offsets: bool
    couplings: Sequence[Joints]


@dataclass(frozen=True, slots=True)
class Column:
    """A parameter in which the equations of motion are linear.

    Attributes:
        name: kind and number of the link, such as "XX3".
        kind: XX XY XZ YY YZ ZZ MX MY MZ M; Ia, Fv, Fs, offset of the joint of the link; Jm, the
            inertia of a rotor that spins with it; Iam, Fvm, Fsm of a motor of two joints.
        link: number of the link, from 1.
        unit: of the parameter.
        other: number of the link of the second joint of a motor of two joints, else 0.
    """

    name: str
    kind: str
    link: int
    unit: str
    other: int = 0

    @property
    def key(self) -> tuple[str, int, int]:
        """What it is the parameter of, whatever its name."""
        return self.kind, self.link, self.other


def columns_of(
    system: System,
    *,
    rotors: bool = True,
    friction: bool = True,
    offsets: bool = False,
    couplings: Sequence[Joints] = (),
) -> tuple[Column, ...]:
    """The parameters of a system, link by link, those of motors of two joints last.

    A link has the ten inertial parameters, also where they are zero. Passive joints have Ia, and
    free joints Ia and friction, only where the system gives them values that are not zero.

    Source: Khalil & Creusot 1997, section 2.2; Gautier, Janot & Vandanjon 2013 for motors of two
    joints.

    Args:
        system: open or closed.
        rotors: whether to take Ia of actuated joints, and Jm of rotors that spin with joints.
        friction: whether to take Fv and Fs of every joint.
        offsets: whether to take a constant effort of every joint of one degree of freedom.
        couplings: for each motor of two joints the joint it belongs to and the other; it turns
            with the sum of their velocities.

    Raises:
        ModelError: `system` is not a System, or a coupling does not name two joints of one degree
            of freedom and of one kind.
    """
    require_system(system)
    columns: list[Column] = []
    for number, link in enumerate(system.tree.links, start=1):
        kinds = [
            *(_rotor_kinds(system, link) if rotors else ()),
            *(_friction_kinds(link) if friction else ()),
            *(("offset",) if offsets and link.motion.nv == 1 else ()),
        ]
        columns += _inertial(number)
        columns += [Column(f"{kind}{number}", kind, number, _unit(link, kind)) for kind in kinds]
    for pair in couplings:
        columns += _coupled(system, pair)
    return tuple(columns)


def chosen_columns(
    system: System, columns: Sequence[Column] | None, choice: ColumnChoice
) -> tuple[Column, ...]:
    """The columns that are given, or those of `columns_of`.

    Args:
        system: open or closed.
        columns: in the order wanted, under any names; None to choose by options.
        choice: options of `columns_of`.

    Raises:
        ModelError: both were given, or a column is no parameter of the system or given twice.
    """
    if columns is None:
        return columns_of(system, **choice)
    require_system(system)
    if choice:
        raise ModelError(
            f"{system.name}: columns were given and {quoted(next(iter(choice)))} too; give the"
            " columns alone"
        )
    require_columns(system, columns)
    numbers_among(system, every_column(system, columns), columns)
    if len({column.key for column in columns}) < len(columns):
        twice = next(c for k, c in enumerate(columns) if c.key in {b.key for b in columns[:k]})
        raise ModelError(f"{system.name}: {quoted(twice.name)} is given twice; give it once")
    return tuple(columns)


def require_columns(system: System, columns: Sequence[Column]) -> None:
    """Refuse names, and objects that hold columns, in place of Columns.

    Raises:
        ModelError: with what was given.
    """
    rows = columns if isinstance(columns, list | tuple) else [columns]
    wrong = [row for row in rows if not isinstance(row, Column)]
    if wrong:
        raise ModelError(
            f"{system.name}: columns holds {quoted(wrong[0])}, which is no Column; give those of"
            " columns_of(system), or .kept of base parameters"
        )


def every_column(system: System, columns: Sequence[Column]) -> tuple[Column, ...]:
    """All parameters of the system of the kinds of some columns, in the order of `columns_of`."""
    return columns_of(
        system,
        offsets=any(column.kind == "offset" for column in columns),
        couplings=list(dict.fromkeys((c.link, c.other) for c in columns if c.other)),
    )


def numbers_among(system: System, every: Sequence[Column], columns: Sequence[Column]) -> list[int]:
    """Where some columns stand among all of them.

    Raises:
        ModelError: a column is not among them.
    """
    places = {column.key: k for k, column in enumerate(every)}
    for column in columns:
        if column.key not in places:
            known = did_you_mean(column.name, [c.name for c in every])
            raise ModelError(
                f"{system.name}: {quoted(column.name)} is no parameter of the system; {known}"
            )
    return [places[column.key] for column in columns]


def values_of(system: System, columns: Iterable[Column]) -> SX:
    """(n, 1) the parameters as the system has them: numbers, or expressions of its symbols.

    Offsets and motors of two joints are zero, since a system has none.
    """
    links = system.tree.links
    ten = [link.inertia.parameters for link in links]
    values = []
    for column in columns:
        link = links[column.link - 1]
        if column.kind in INERTIAL:
            values.append(ten[column.link - 1][INERTIAL.index(column.kind)])
        else:
            values.append(_joint_value(link, column.kind))
    return casadi.densify(casadi.vertcat(SX(0, 1), *values))


def numbers_of(
    system: System, columns: Iterable[Column], values: Mapping[str, float] | None = None
) -> NDArray[np.float64]:
    """(n,) the parameters as numbers.

    Args:
        system: open or closed.
        columns: the parameters.
        values: of symbols by name, the others at their defaults.

    Raises:
        ModelError: a symbol has no value, or there is no symbol of that name.
    """
    K = Function("K", [system.p], [values_of(system, columns)])
    return np.asarray(K(DM(system.parameter_values(values))), dtype=float).ravel()


def _joint_value(link: Link, kind: str) -> SX:
    if kind == "Jm":
        return link.rotor.inertia if link.rotor is not None else SX(0)
    known = {"Ia": link.Ia, "Fv": link.Fv, "Fs": link.Fs}
    return known.get(kind, SX(0))


def _inertial(number: int) -> list[Column]:
    pairs = zip(INERTIAL, _INERTIAL_UNITS, strict=True)
    return [Column(f"{kind}{number}", kind, number, unit) for kind, unit in pairs]


def _rotor_kinds(system: System, link: Link) -> list[str]:
    driven = system.speeds[link.v.start].actuated and link.rotor is None
    kinds = ["Ia"] if driven or not link.Ia.is_zero() else []
    return [*kinds, "Jm"] if link.rotor is not None else kinds


def _friction_kinds(link: Link) -> list[str]:
    given = {"Fv": link.Fv, "Fs": link.Fs}
    return [k for k, x in given.items() if link.motion is not Motion.FREE or not x.is_zero()]


def _unit(link: Link, kind: str) -> str:
    return (_SLIDING if link.motion is Motion.PRISMATIC else _TURNING)[kind]


def _coupled(system: System, pair: Joints) -> list[Column]:
    """The three parameters of a motor of two joints."""
    if not isinstance(pair, (tuple, list)) or len(pair) != 2:
        raise ModelError(
            f"{system.name}: the coupling {quoted(pair)} does not name two joints; give a pair such"
            " as ('j6', 'j5')"
        )
    number, other = (_joint(system, name) for name in pair)
    link, second = (system.tree.links[k - 1] for k in (number, other))
    if number == other or link.motion is not second.motion:
        raise ModelError(
            f"{system.name}: the coupling {quoted(tuple(pair))} joins {link.name!r}"
            f" ({link.motion.value}) and {second.name!r} ({second.motion.value}); name two joints"
            " that both turn or both slide"
        )
    return [Column(f"{k}{number}", k, number, _unit(link, k), other) for k in COUPLED]


def _joint(system: System, name: str | int) -> int:
    """Number of the link of a joint of one degree of freedom."""
    links = system.tree.links
    names = {link.name: k for k, link in enumerate(links, start=1) if link.motion.nv == 1}
    if isinstance(name, str) and name in names:
        return names[name]
    if isinstance(name, int) and not isinstance(name, bool) and name in names.values():
        return name
    raise ModelError(
        f"{system.name}: the coupling names {quoted(name)}, which is no joint of one degree of"
        f" freedom of the tree; {did_you_mean(name, names)}"
    )
