"""A measured motion: positions, efforts and perhaps velocities over time."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from mbs.assembly import Coordinate, System
from mbs.assembly.model_function import require_system
from mbs.assembly.tables import EFFORT_UNIT
from mbs.errors import ModelError
from mbs.identification.postures import active_places
from mbs.identification.records.rules import GAP, SHORTEST, check_record
from mbs.identification.records.table import column, columns, csv_table
from mbs.messages import quoted

Array = npt.NDArray[np.float64]
Limits = tuple[float, float] | None


@dataclass(frozen=True, slots=True, eq=False)
class Record:
    """What sensors gave during a motion, in SI units on the joint's side of the gears.

    The constructor refuses what cannot be a record of a robot; see `check_record`. Positions are
    those of all joints of the tree, or of the independent ones; efforts those of the independent
    joints.

    Attributes:
        time: (n,) [s], increasing, not necessarily in equal steps.
        q: (n, nq) positions [rad or m].
        tau: (n, m) efforts of the motors seen at the joints [N m or N].
        v: (n, nq) measured velocities [rad/s or m/s], or None.
        names: of the positions; q1, q2, ... by default.
        units: of the positions, "rad" or "m"; all "rad" by default.
        limits: range of each position, or None where it is not known.
        efforts: names of the efforts; those of the positions by default, or tau1, tau2, ... where
            there are less of them.
        effort_units: "N.m" or "N"; those that go with the positions by default.
        longest_gap: largest step of time that is bridged [s]; 20 times the usual step by default.
    """

    time: Array
    q: Array
    tau: Array
    v: Array | None = None
    names: tuple[str, ...] = ()
    units: tuple[str, ...] = ()
    limits: tuple[Limits, ...] = ()
    efforts: tuple[str, ...] = ()
    effort_units: tuple[str, ...] = ()
    longest_gap: float | None = None

    def __post_init__(self) -> None:
        for name in ("time", "q", "tau", "v"):
            if getattr(self, name) is not None or name != "v":
                object.__setattr__(self, name, _numbers(name, getattr(self, name)))
        for name in ("names", "units", "efforts", "effort_units"):
            if isinstance(getattr(self, name), str):
                raise ModelError(
                    f"record: {name} is the text {quoted(getattr(self, name))}; give a list with"
                    " one for each column"
                )
        width, m = (x.shape[1] if x.ndim == 2 else 0 for x in (self.q, self.tau))
        names = self.names or tuple(f"q{k + 1}" for k in range(width))
        efforts = names if m == width else tuple(f"tau{k + 1}" for k in range(m))
        units = self.units or ("rad",) * width
        like = tuple("N" if unit == "m" else "N.m" for unit in units)
        defaults = {
            "names": names,
            "units": units,
            "limits": (None,) * width,
            "efforts": efforts,
            "effort_units": like if m == width else ("N.m",) * m,
        }
        for key, value in defaults.items():
            object.__setattr__(self, key, tuple(getattr(self, key)) or value)
        check_record(self)

    def __repr__(self) -> str:
        span = self.time[-1] - self.time[0]
        return f"<Record: {len(self.time)} rows, {span:g} s, {', '.join(self.names)}>"

    @classmethod
    def of(
        cls, system: System, time: Any, q: Any, tau: Any, v: Any = None, **options: Any
    ) -> Record:
        """A record of a system: names, units and ranges of the joints are those of the system.

        Args:
            system: open or closed, its measured joints of one degree of freedom.
            time: (n,) [s].
            q: (n, nq) positions, or (n, m) those of the independent joints of a closed system,
                which the others follow.
            tau: (n, m) efforts of the independent joints; where motors are others than these, what
                `mbs.models.actuation_matrix` makes of theirs.
            v: velocities of the same joints, or None.
            **options: other attributes of the record.

        Raises:
            ModelError: the numbers are no record of this system.
        """
        require_system(system)
        width = np.shape(q)[1] if np.ndim(q) == 2 else system.nq
        alone = system.is_closed and width == len(system.active) != system.nq
        places = active_places(system) if alone else range(system.nq)
        joints = [system.coordinates[k] for k in places]
        _check_joints(system, joints, width)
        speeds = [system.speeds[k] for k in system.active]
        _check_efforts(system, [c.name for c in speeds], tau)
        described = {
            "names": tuple(c.name for c in joints),
            "units": tuple(c.unit for c in joints),
            "limits": tuple(c.limits for c in joints),
            "efforts": tuple(c.name for c in speeds),
            "effort_units": tuple(EFFORT_UNIT[c.unit] for c in speeds),
        }
        return cls(time, q, tau, v, **(described | options))

    @classmethod
    def from_table(
        cls,
        table: Any,
        q: Sequence[str],
        tau: Sequence[str],
        v: Sequence[str] | None = None,
        **options: Any,
    ) -> Record:
        """A record from named columns.

        Args:
            table: a pandas DataFrame, a `mbs.Result`, or a dict of columns; its time is the column
                "time", or the index of a DataFrame.
            q: names of the columns of positions.
            tau: names of the columns of efforts.
            v: names of the columns of velocities, or None.
            **options: other attributes of the record, or system=System to take them from there.

        Raises:
            ModelError: a column is missing or not of numbers, or the numbers are no record.
        """
        stamps = getattr(table, "time", None) if not hasattr(table, "keys") else None
        if stamps is None:
            stamps = column(table, "time")
        q_, tau_ = columns(table, "q", q), columns(table, "tau", tau)
        v_ = None if v is None else columns(table, "v", v)
        system = options.pop("system", None)
        if system is not None:
            _check_motors(system)
            record = cls.of(system, stamps, q_, tau_, v_, **options)
            for what, names, joints in (
                ("q", q, record.names),
                ("tau", tau, record.efforts),
                ("v", v or (), record.names),
            ):
                _check_order(what, names, joints)
            return record
        return cls(np.asarray(stamps, dtype=float), q_, tau_, v_, **options)

    @classmethod
    def from_csv(
        cls,
        path: str | os.PathLike[str],
        q: Sequence[str],
        tau: Sequence[str],
        v: Sequence[str] | None = None,
        **options: Any,
    ) -> Record:
        """A record from a text file: a header of names, one of them "time", then rows of numbers.

        Args:
            path: the file; commas between the columns.
            q: names of the columns of positions.
            tau: names of the columns of efforts.
            v: names of the columns of velocities, or None.
            **options: as for `from_table`.

        Raises:
            ModelError: the file cannot be read, or its numbers are no record.
        """
        return cls.from_table(csv_table(path), q, tau, v, **options)

    def between(self, start: float, stop: float) -> Record:
        """The rows from one instant to another [s]."""
        return self._rows((self.time >= start) & (self.time <= stop))

    def pieces(self, longest: float | None = None) -> list[Record]:
        """The records between the gaps, for `identify`; those of too few rows are left out.

        Args:
            longest: step of time that is no gap [s]; 20 times the usual step when left out.

        Raises:
            ModelError: no piece is long enough.
        """
        steps = np.diff(self.time)
        most = GAP * float(np.median(steps)) if longest is None else longest
        ends = [0, *(np.flatnonzero(steps > most) + 1), len(self.time)]
        at, found = np.arange(len(self.time)), []
        for first, last in pairwise(ends):
            if last - first >= SHORTEST:
                found.append(self._rows((at >= first) & (at < last)))
        if not found:
            raise ModelError(
                f"record: every piece between steps of more than {most:.3g} s has less than"
                f" {SHORTEST} rows; give a longer step, or a record with less gaps"
            )
        return found

    def _rows(self, keep: npt.NDArray[np.bool_]) -> Record:
        v = None if self.v is None else self.v[keep]
        return replace(self, time=self.time[keep], q=self.q[keep], tau=self.tau[keep], v=v)


def joint_side(N: Any, q_motor: Any, tau_motor: Any) -> tuple[Array, Array]:
    """Positions and efforts of joints from those of motors: q = N^-1 q_m and tau = N' tau_m.

    Source: Khalil & Dombre 2002 (transmissions); the gears lose no power.

    Args:
        N: (n,) ratios, or (n, n) matrix of motors that drive several joints: q_m = N q.
        q_motor: (rows, n) positions [rad].
        tau_motor: (rows, n) efforts on the motors' shafts [N m].

    Returns:
        (rows, n) positions and (rows, n) efforts of the joints.

    Raises:
        ModelError: N does not fit, or it has no inverse.
    """
    ratios = _numbers("N", N)
    matrix = np.diag(ratios) if ratios.ndim == 1 else ratios
    q, tau = _numbers("q_motor", q_motor), _numbers("tau_motor", tau_motor)
    width = q.shape[1] if q.ndim == 2 else 0
    if matrix.shape != (width, width) or tau.shape != q.shape:
        raise ModelError(
            f"transmission: N has the shape {matrix.shape}, positions {q.shape} and efforts"
            f" {tau.shape}; give (n, n), (rows, n) and (rows, n)"
        )
    if np.linalg.matrix_rank(matrix) < width:
        raise ModelError(
            "transmission: N has no inverse, so the motors do not tell where the joints are;"
            " give the ratio of every joint"
        )
    return np.asarray(np.linalg.solve(matrix, q.T).T, dtype=float), tau @ matrix


def _check_joints(system: System, joints: Sequence[Coordinate], width: int) -> None:
    turning = [c for c in joints if c.unit not in ("rad", "m")]
    if turning:
        remedy = ", or give the independent joints alone" if system.is_closed else ""
        raise ModelError(
            f"{system.name}: {turning[0].name} is a {turning[0].kind}; records are of revolute"
            f" and prismatic joints{remedy}"
        )
    if width != len(joints):
        names = ", ".join(c.name for c in joints)
        raise ModelError(
            f"{system.name}: q has {width} columns, the system has {len(joints)} joints: {names};"
            " give one column for each, in this order"
        )


def _check_motors(system: System) -> None:
    if system.motors != system.active:
        motors = ", ".join(system.speeds[k].name for k in system.motors)
        raise ModelError(
            f"{system.name}: its motors ({motors}) are not its independent joints; give Record.of"
            " the efforts that mbs.models.actuation_matrix makes of theirs"
        )


def _check_efforts(system: System, names: Sequence[str], tau: Any) -> None:
    """Refuse efforts of more or less than the independent joints."""
    if np.ndim(tau) == 2 and np.shape(tau)[1] != len(names):
        raise ModelError(
            f"{system.name}: tau has {np.shape(tau)[1]} columns, the system has {len(names)}"
            f" independent joints: {', '.join(names)}; give one column for each, in this order"
        )


def _check_order(what: str, given: Sequence[str], joints: Sequence[str]) -> None:
    """Refuse columns such as "q2.tau" in the place of another joint."""
    for name, joint in zip(given, joints, strict=False):
        stem = name if name in joints else name.rpartition(".")[0]
        if stem in joints and stem != joint:
            raise ModelError(
                f"record: the column {name!r} is given as {what} of joint {joint}; name the columns"
                f" in the order {', '.join(joints)}"
            )


def _numbers(name: str, values: Any) -> Array:
    try:
        array = np.array(values, dtype=float)
    except (TypeError, ValueError):
        raise ModelError(f"record: {name} is {quoted(values)}; give numbers") from None
    array.flags.writeable = False
    return array
