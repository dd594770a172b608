"""Records of measured motions: columns, consistency checks and zero-phase filtering."""

from __future__ import annotations

import csv
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
from mbs.identification.leading import active_indices
from mbs.result import optional_module
from mbs.text import did_you_mean, quoted

# Checks of a record: order of time, gaps, units and length.


Array = npt.NDArray[np.float64]

SHORTEST = 50
"""Minimum number of rows of a record."""

GAP = 20.0
"""Longest gap that is bridged by default, as a multiple of the median time step."""

FARTHEST_TURN = 4 * np.pi
"""Largest position that is accepted for a revolute joint [rad]."""

_RANGES = 3.0
"""Largest distance of a position from the middle of the joint range, in half ranges. Overshoot
and a range that is specified too narrow are below it. Positions in degrees (factor 57) and
positions on the motor side of a gear are above it."""
_SAME_MOTION = 0.9
"""Correlation of a position with the integral of its velocity below which columns are
considered swapped or of opposite sign. Noise and filter delay give higher correlations, the
velocity of another joint a lower correlation."""
_SAME_RATE = 0.3
"""Relative difference between the amplitudes of a position and of the integral of its velocity
above which the units or the sides of a gear differ. Noise causes some percent, degrees a factor
of 57, and gears of robots a factor of 3 or more."""
_STILL = 1e-9
"""Norm of the detrended positions [rad or m] below which a joint counts as not moving."""


def check_record(record: Record) -> None:
    """Raise if the data cannot be a record of joints in SI units.

    Args:
        record: record with all its attributes set.

    Raises:
        ModelError: the shapes do not match, a value is not finite, time does not increase or has a
            gap, positions are not in the unit or the range of their joint, or a velocity is not the
            derivative of its position. The message names the column, the row and the value.
    """
    _check_shapes(record)
    _check_names(record)
    _check_finite(record)
    _check_time(record)
    for k in range(record.q.shape[1]):
        _check_position(record, k)
        if record.v is not None:
            _check_rate(record, k)


def _check_shapes(record: Record) -> None:
    """Raise ModelError if the arrays of a record have wrong shapes or too few rows."""
    n = record.time.size
    wanted = {"q": record.q, "tau": record.tau, "v": record.v}
    if record.time.ndim != 1:
        raise ModelError(f"record: time has the shape {record.time.shape}; give (n,)")
    if n < SHORTEST:
        raise ModelError(
            f"record: it has {n} rows, which is too short; give {SHORTEST} or more, and some"
            " periods of the slowest motion"
        )
    for name, values in wanted.items():
        if values is None:
            continue
        if values.ndim != 2 or len(values) != n:
            raise ModelError(
                f"record: {name} has the shape {values.shape} for {n} instants; give a row for"
                " each instant and a column for each joint"
            )
    if record.v is not None and record.v.shape != record.q.shape:
        raise ModelError(
            f"record: v has the shape {record.v.shape} and q {record.q.shape}; give the velocity"
            " of every position"
        )
    widths = {
        "names": record.q,
        "units": record.q,
        "limits": record.q,
        "efforts": record.tau,
        "effort_units": record.tau,
    }
    for name, values in widths.items():
        given = len(getattr(record, name))
        if given != values.shape[1]:
            raise ModelError(
                f"record: {given} {name} are given for {values.shape[1]} columns; give one for each"
            )


def _check_names(record: Record) -> None:
    """Raise ModelError if names of a record are repeated or units of efforts are invalid."""
    for what, names in (("positions", record.names), ("efforts", record.efforts)):
        twice = [name for k, name in enumerate(names) if name in names[:k]]
        if twice:
            raise ModelError(
                f"record: two {what} are called {quoted(twice[0])}; give each its own name"
            )
    for name, unit in zip(record.efforts, record.effort_units, strict=True):
        if unit not in ("N.m", "N"):
            raise ModelError(
                f"record: the effort {name} is in {quoted(unit)}; convert it to 'N.m' or 'N'"
            )


def _check_finite(record: Record) -> None:
    """Raise ModelError if the time or a value of a record is not finite."""
    names = {"q": record.names, "tau": record.efforts, "v": record.names}
    if not np.isfinite(record.time).all():
        row = int(np.argmin(np.isfinite(record.time)))
        raise ModelError(f"record: the time of row {row + 1} is {record.time[row]}; drop the row")
    for kind, labels in names.items():
        values = getattr(record, kind)
        if values is None or np.isfinite(values).all():
            continue
        row, k = np.argwhere(~np.isfinite(values))[0]
        raise ModelError(
            f"record: {kind} of {labels[k]} is {values[row, k]} at {record.time[row]:g} s; drop"
            " such rows, or cut the record there"
        )


def _check_time(record: Record) -> None:
    """Raise ModelError if the times of a record do not increase, or if a time step is too long.

    The longest accepted step is `longest_gap` of the record, by default 20 times the median step.
    """
    steps = np.diff(record.time)
    if (steps <= 0).any():
        row = int(np.argmax(steps <= 0))
        raise ModelError(
            f"record: time goes from {record.time[row]:.6g} to {record.time[row + 1]:.6g} s at row"
            f" {row + 2}; sort the rows, and keep one for each instant"
        )
    usual = float(np.median(steps))
    longest = GAP * usual if record.longest_gap is None else record.longest_gap
    if steps.max() > longest:
        row = int(np.argmax(steps))
        raise ModelError(
            f"record: nothing was measured from {record.time[row]:.6g} to"
            f" {record.time[row + 1]:.6g} s, the usual step being {usual:.3g} s; give the two"
            " sides as two records, identify(system, [r1, r2], ...), or give longest_gap, and the"
            " list record.pieces()"
        )


def _check_position(record: Record, k: int) -> None:
    """Raise ModelError if position column k has an invalid unit or is far beyond its limits."""
    name, unit, limits, q = record.names[k], record.units[k], record.limits[k], record.q[:, k]
    if unit not in ("rad", "m"):
        raise ModelError(f"record: {name} is in {unit!r}; convert it to 'rad' or 'm'")
    largest = float(np.abs(q).max())
    remedy = (
        "convert degrees by numpy.radians, and positions of motors by joint_side"
        if unit == "rad"
        else "convert it to m on the joint's side of the gear"
    )
    if unit == "rad" and largest > FARTHEST_TURN:
        raise ModelError(
            f"record: {name} goes to {largest:.4g} rad, more than two turns of a joint; {remedy}"
        )
    if limits is None:
        return
    low, high = limits
    middle, half = (low + high) / 2, (high - low) / 2
    if np.isfinite(half) and half > 0 and float(np.abs(q - middle).max()) > _RANGES * half:
        raise ModelError(
            f"record: {name} goes from {q.min():.4g} to {q.max():.4g} {unit}, far beyond its range"
            f" {low:.4g} .. {high:.4g} {unit}; {remedy}"
        )


def _check_rate(record: Record, k: int) -> None:
    """Raise ModelError if position column k does not match the integral of its velocity.

    Both are detrended; their correlation and the ratio of their norms are compared.
    """
    assert record.v is not None
    v, steps = record.v[:, k], np.diff(record.time)
    travelled = np.concatenate([[0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) * steps)])
    moved, by_rate = (_detrend(record.time, x) for x in (record.q[:, k], travelled))
    size = float(np.linalg.norm(moved))
    if size <= _STILL or np.linalg.norm(by_rate) <= _STILL:
        return
    alike = float(moved @ by_rate) / (size * float(np.linalg.norm(by_rate)))
    factor = float(np.linalg.norm(by_rate)) / size
    name, unit = record.names[k], record.units[k]
    if alike < _SAME_MOTION:
        raise ModelError(
            f"record: v of {name} is not the rate of its q (correlation {alike:.2f}); check the"
            " order of the columns and their signs"
        )
    if abs(factor - 1) > _SAME_RATE:
        raise ModelError(
            f"record: v of {name} is {factor:.4g} times the rate of its q; give both in {unit} on"
            " the joint's side of the gear (57.3 is degrees, a gear ratio the motor's side)"
        )


def _detrend(time: Array, values: Array) -> Array:
    """Return `values` (n,) minus their least-squares line over `time` (n,)."""
    basis = np.column_stack([np.ones_like(time), time - time.mean()])
    line = basis @ np.linalg.lstsq(basis, values, rcond=None)[0]
    return np.asarray(values - line, dtype=float)


# Columns of numbers from tables and text files.


def column(table: Any, name: str) -> Array:
    """Return a column (n,) of a table as an array of floats.

    Args:
        table: pandas DataFrame, `mbs.Result` or dict.
        name: name of the column. The name "time" is also the index of a DataFrame that has no such
            column.

    Raises:
        ModelError: the table has no column of this name, or the column contains a value that is not
            a number.
    """
    known = [str(key) for key in table.keys()] if hasattr(table, "keys") else list(table.names)  # noqa: SIM118
    if name not in known:
        if name == "time" and hasattr(table, "index") and not isinstance(table, dict):
            return np.asarray(table.index, dtype=float)
        raise ModelError(f"record: there is no column {name!r}; {did_you_mean(name, known)}")
    try:
        return np.asarray(table[name], dtype=float)
    except (TypeError, ValueError):
        raise ModelError(
            f"record: the column {name!r} does not hold numbers alone; it starts with"
            f" {quoted(list(table[name])[:3])}"
        ) from None


def columns(table: Any, what: str, names: Sequence[str]) -> Array:
    """Return columns of a table as an array (n, k).

    Args:
        table: DataFrame, `mbs.Result` or dict, as for `column`.
        what: kind of the columns, for error messages.
        names: one or more column names.

    Raises:
        ModelError: `names` is empty, or the errors of `column`.
    """
    if isinstance(names, str) or not len(names):
        raise ModelError(
            f"record: the columns of {what} are {quoted(names)}; give a list of one name or more"
        )
    return np.column_stack([column(table, name) for name in names])


def csv_table(path: str | os.PathLike[str]) -> dict[str, Array]:
    """Read a CSV file into a dict from column name to array (n,).

    Args:
        path: path of a file with comma-separated columns; its first row contains the names.

    Raises:
        ModelError: the file cannot be read, the number of fields of a row differs from the header,
            or a field is not a number. The message names the row.
    """
    try:
        with open(path, newline="", encoding="utf-8-sig") as stream:
            rows = [row for row in csv.reader(stream) if row]
    except (OSError, TypeError, UnicodeDecodeError, csv.Error) as error:
        raise ModelError(f"record: {quoted(str(path))} cannot be read ({error})") from error
    if len(rows) < 2:
        raise ModelError(f"record: {quoted(str(path))} has no rows; it needs names, then numbers")
    header = [name.strip() for name in rows[0]]
    _check_header(path, header)
    values = np.empty((len(rows) - 1, len(header)))
    for number, row in enumerate(rows[1:], start=2):
        if len(row) != len(header):
            raise ModelError(
                f"record: row {number} of {quoted(str(path))} has {len(row)} fields, the header has"
                f" {len(header)}; write one number for each name"
            )
        try:
            values[number - 2] = [float(field) for field in row]
        except ValueError:
            raise ModelError(
                f"record: row {number} of {quoted(str(path))} holds {quoted(row)};"
                " write numbers alone"
            ) from None
    return {name: values[:, k] for k, name in enumerate(header)}


def _check_header(path: str | os.PathLike[str], header: Sequence[str]) -> None:
    """Raise ModelError if the first row of the CSV file at `path` does not consist of column names.

    Its separator may not be a comma, or the row may contain numbers.
    """
    for mark in (";", "\t"):
        if len(header) == 1 and mark in header[0]:
            raise ModelError(
                f"record: {quoted(str(path))} has {quoted(mark)} between its columns; write"
                " commas, and points in the numbers"
            )
    if all(_is_number(name) for name in header):
        raise ModelError(
            f"record: the first row of {quoted(str(path))} is {quoted(list(header))}, which are"
            " numbers; write the names of the columns above them"
        )


def _is_number(text: str) -> bool:
    """Whether a text is a floating-point number."""
    try:
        float(text)
    except ValueError:
        return False
    return True


# Measured motion: positions, efforts and optional velocities over time.


Limits = tuple[float, float] | None


@dataclass(frozen=True, slots=True, eq=False)
class Record:
    """Measured motion of a robot, in SI units on the joint side of the gears.

    The constructor raises if the data are inconsistent; see `check_record`. Positions are of all
    joints of the tree or of the independent joints; efforts are of the independent joints.

    Attributes:
        time: (n,) increasing instants [s]; the steps may vary.
        q: (n, nq) positions [rad or m].
        tau: (n, m) motor efforts, converted to the joint side [N m or N].
        v: (n, nq) measured velocities [rad/s or m/s], or None.
        names: names of the positions; q1, q2, ... by default.
        units: units of the positions, "rad" or "m"; all "rad" by default.
        limits: range of each position, or None if it is unknown.
        efforts: names of the efforts. The defaults are the names of the positions, or tau1, tau2,
            ... if the number of efforts differs from the number of positions.
        effort_units: "N.m" or "N" for each effort; by default according to the units of the
            positions.
        longest_gap: longest time step that is bridged [s]; 20 times the median step by default.
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
                object.__setattr__(self, name, _read_only(name, getattr(self, name)))
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
        """Return a record with the joint names, units and ranges of a system.

        Args:
            system: open or closed; its measured joints have one degree of freedom.
            time: (n,) instants [s].
            q: (n, nq) positions of all joints, or (n, m) positions of the independent joints of a
                closed system, from which the other positions are computed.
            tau: (n, m) efforts of the independent joints. If other joints are actuated, convert
                their efforts with `mbs.models.actuation_matrix`.
            v: velocities of the same joints as q, or None.
            **options: other attributes of the record.

        Raises:
            ModelError: the data are not a valid record of this system.
        """
        require_system(system)
        width = np.shape(q)[1] if np.ndim(q) == 2 else system.nq
        alone = system.is_closed and width == len(system.independent) != system.nq
        indices = active_indices(system) if alone else range(system.nq)
        joints = [system.coordinates[k] for k in indices]
        _check_joints(system, joints, width)
        speeds = [system.velocity_coordinates[k] for k in system.independent]
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
        """Return a record from named columns of a table.

        Args:
            table: pandas DataFrame, `mbs.Result` or dict of columns. The time is the column "time",
                or the index of a DataFrame.
            q: names of the position columns.
            tau: names of the effort columns.
            v: names of the velocity columns, or None.
            **options: other attributes of the record, or system=System to use the attributes of the
              system.

        Raises:
            ModelError: a column is missing or not numeric, or the data are not a valid record.
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
        """Return a record from a CSV file with a header row of names, one of which is "time".

        Args:
            path: path of the file, with comma-separated columns.
            q: names of the position columns.
            tau: names of the effort columns.
            v: names of the velocity columns, or None.
            **options: options of `from_table`.

        Raises:
            ModelError: the file cannot be read, or the data are not a valid record.
        """
        return cls.from_table(csv_table(path), q, tau, v, **options)

    def between(self, start: float, stop: float) -> Record:
        """Return the part of the record between two instants.

        Args:
            start: first instant that is included [s].
            stop: last instant that is included [s].
        """
        return self._selected((self.time >= start) & (self.time <= stop))

    def pieces(self, longest: float | None = None) -> list[Record]:
        """Split the record at its gaps, as input of `identify`.

        Pieces of less than 50 rows are dropped.

        Args:
            longest: longest time step that is not a gap [s]; 20 times the median step by default.

        Raises:
            ModelError: no piece is long enough.
        """
        steps = np.diff(self.time)
        most = GAP * float(np.median(steps)) if longest is None else longest
        ends = [0, *(np.flatnonzero(steps > most) + 1), len(self.time)]
        at, found = np.arange(len(self.time)), []
        for first, last in pairwise(ends):
            if last - first >= SHORTEST:
                found.append(self._selected((at >= first) & (at < last)))
        if not found:
            raise ModelError(
                f"record: every piece between steps of more than {most:.3g} s has less than"
                f" {SHORTEST} rows; give a longer step, or a record with less gaps"
            )
        return found

    def _selected(self, keep: npt.NDArray[np.bool_]) -> Record:
        """Return the record with the rows at which the mask `keep` (n,) is True."""
        v = None if self.v is None else self.v[keep]
        return replace(self, time=self.time[keep], q=self.q[keep], tau=self.tau[keep], v=v)


def motor_to_joint(N: Any, q_motor: Any, tau_motor: Any) -> tuple[Array, Array]:
    """Convert motor positions and efforts to joints: q = N^-1 q_m and tau = N' tau_m.

    Source: Khalil & Dombre 2002 (transmissions). The gears are assumed lossless.

    Args:
        N: (n,) gear ratios, or (n, n) matrix of a coupled transmission, with q_m = N q.
        q_motor: (rows, n) motor positions [rad].
        tau_motor: (rows, n) efforts on the motor shafts [N m].

    Returns:
        Joint positions (rows, n) and joint efforts (rows, n).

    Raises:
        ModelError: the shape of N does not match the data, or N is singular.
    """
    ratios = _read_only("N", N)
    matrix = np.diag(ratios) if ratios.ndim == 1 else ratios
    q, tau = _read_only("q_motor", q_motor), _read_only("tau_motor", tau_motor)
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
    """Raise ModelError unless `joints` are revolute or prismatic, and their number is `width`."""
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
    """Raise ModelError unless the motors of a system are at its independent joints."""
    if system.motors != system.independent:
        motors = ", ".join(system.velocity_coordinates[k].name for k in system.motors)
        raise ModelError(
            f"{system.name}: its motors ({motors}) are not its independent joints; give Record.of"
            " the efforts that mbs.models.actuation_matrix makes of theirs"
        )


def _check_efforts(system: System, names: Sequence[str], tau: Any) -> None:
    """Raise ModelError if the array `tau` does not have one column for each independent joint.

    `names` are the names of the independent joints.
    """
    if np.ndim(tau) == 2 and np.shape(tau)[1] != len(names):
        raise ModelError(
            f"{system.name}: tau has {np.shape(tau)[1]} columns, the system has {len(names)}"
            f" independent joints: {', '.join(names)}; give one column for each, in this order"
        )


def _check_order(what: str, given: Sequence[str], joints: Sequence[str]) -> None:
    """Raise ModelError if a column that is named after a joint is used for another joint.

    `given` are column names such as "q2.tau" and `joints` the joints they are used for; `what` is
    q, v or tau.
    """
    for name, joint in zip(given, joints, strict=False):
        stem = name if name in joints else name.rpartition(".")[0]
        if stem in joints and stem != joint:
            raise ModelError(
                f"record: the column {name!r} is given as {what} of joint {joint}; name the columns"
                f" in the order {', '.join(joints)}"
            )


def _read_only(name: str, values: Any) -> Array:
    """Return `values` as a read-only array of floats.

    Raises ModelError for other types; `name` is the argument name in its message.
    """
    try:
        array = np.array(values, dtype=float)
    except (TypeError, ValueError):
        raise ModelError(f"record: {name} is {quoted(values)}; give numbers") from None
    array.flags.writeable = False
    return array


# Resampling of a record, with the same zero-phase filter on positions and efforts.


ORDER = 4
"""Order of the Butterworth filter, which is applied once forwards and once backwards."""

WORKING_RATE = 20.0
"""Samples that are kept for the regressor, per period of the bandwidth."""

_SLOW = 10.0
"""Sampling rate [Hz] below which the error message suggests that the time unit may be wrong."""

DROPPED = 5.0
"""Periods of the bandwidth that are dropped at both ends because of filter transients."""


@dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """Positions, velocities, accelerations and efforts at equal time steps.

    Attributes:
        time: (n,) instants [s].
        q: (n, nq) positions [rad or m].
        v: (n, nq) velocities [rad/s or m/s].
        a: (n, nq) accelerations [rad/s2 or m/s2].
        tau: (n, m) efforts [N m or N].
        efforts: names of the efforts.
        effort_units: units of the efforts.
        bandwidth: bandwidth of the filter [Hz], or None if the samples are not filtered.
        regular: (n,) mask of the samples at which a closed system is not close to a singular
            configuration; None if not yet computed.
    """

    time: Array
    q: Array
    v: Array
    a: Array
    tau: Array
    efforts: tuple[str, ...]
    effort_units: tuple[str, ...]
    bandwidth: float | None = None
    regular: npt.NDArray[np.bool_] | None = None

    def __post_init__(self) -> None:
        n = len(self.time)
        shapes = [x.shape for x in (self.q, self.v, self.a)]
        if len(set(shapes)) != 1 or shapes[0][0] != n or len(self.tau) != n:
            raise ModelError(
                f"samples: q, v, a and tau have the shapes {shapes[0]}, {shapes[1]}, {shapes[2]}"
                f" and {self.tau.shape} for {n} instants; give a row for each instant"
            )

    @property
    def rate(self) -> float:
        """Sampling rate [Hz]."""
        return _rate(self.time)


def resampled(record: Record, rate: float | None = None) -> Record:
    """Return the record at equal time steps, by linear interpolation between its rows.

    No filter is applied: a lower rate than that of the record causes aliasing of noise.

    Args:
        record: record with any time steps.
        rate: sampling rate [Hz]; by default the inverse of the median time step of the record.

    Raises:
        ModelError: the rate is not positive.
    """
    usual = 1.0 / float(np.median(np.diff(record.time)))
    wanted = usual if rate is None else rate
    span = float(record.time[-1] - record.time[0])
    if not wanted > 0:
        raise ModelError(f"resampling: the rate is {wanted:g} Hz; give more than zero")
    # keep the last row in spite of the rounding of span and rate
    time = record.time[0] + np.arange(int(span * wanted * (1 + 1e-12)) + 1) / wanted

    def at_times(values: Array) -> Array:
        columns = (np.interp(time, record.time, x) for x in values.T)
        return np.column_stack(list(columns))

    v = None if record.v is None else at_times(record.v)
    described = (record.names, record.units, record.limits, record.efforts, record.effort_units)
    return Record(time, at_times(record.q), at_times(record.tau), v, *described)


def zero_phase(values: Array, rate: float, bandwidth: float, order: int = ORDER) -> Array:
    """Apply a low-pass Butterworth filter forwards and backwards, without phase delay.

    Source: Gautier 1997 (filtering of positions and efforts); Gustafsson 1996 (two passes).

    Args:
        values: (n, ...) samples at equal time steps.
        rate: sampling rate [Hz].
        bandwidth: frequency at which the gain of each pass is 0.71 [Hz].
        order: order of each pass.

    Returns:
        (n, ...) filtered samples.

    Raises:
        ModelError: the bandwidth is not between zero and half the sampling rate, or there are too
            few samples for the filter.
    """
    if not 0 < bandwidth < rate / 2:
        hint = "; time is in s, is that of the record in ms?" if rate < _SLOW else ""
        raise ModelError(
            f"filter: the bandwidth is {bandwidth:g} Hz for {rate:g} samples in a second; give more"
            f" than zero and less than {rate / 2:g} Hz{hint}"
        )
    padding = 3 * (2 * ((order + 1) // 2) + 1)
    if len(values) <= padding:
        raise ModelError(
            f"filter: {len(values)} samples are too few for it; give a record of more than"
            f" {padding} samples"
        )
    signal = optional_module("scipy.signal", "identify")
    sections = signal.butter(order, bandwidth, fs=rate, output="sos")
    return np.asarray(signal.sosfiltfilt(sections, values, axis=0), dtype=float)


def central_difference(values: Array, rate: float) -> Array:
    """Return time derivatives by five-point central differences of fourth order.

    Args:
        values: (n, k) samples at equal time steps, with n of five or more.
        rate: sampling rate [Hz].

    Returns:
        (n, k) derivatives; the first two and last two rows are of second order.
    """
    slope = np.gradient(values, 1.0 / rate, axis=0, edge_order=2)
    wide = 8 * (values[3:-1] - values[1:-3]) - (values[4:] - values[:-4])
    slope[2:-2] = wide * (rate / 12)
    return np.asarray(slope, dtype=float)


def smoothed(record: Record, bandwidth: float, order: int = ORDER) -> Samples:
    """Return samples for a regressor, with velocities and accelerations differentiated from q.

    Positions and efforts pass the same filter. The samples are decimated to the rate that the
    bandwidth requires. The filter transients at both ends are dropped.

    Source: Gautier 1997; Khalil & Dombre 2002, chapter 12.

    Args:
        record: record with any time steps.
        bandwidth: bandwidth of the filter [Hz], five to ten times the highest frequency of the
            motion.
        order: order of one pass of the filter.

    Raises:
        ModelError: the bandwidth does not match the sampling rate, or the record is too short.
    """
    even = _without_gaps(record, bandwidth)
    rate = _rate(even.time)
    q = zero_phase(even.q, rate, bandwidth, order)
    return _trim(even, q, central_difference(q, rate), bandwidth, order)


def smoothed_with_velocity(record: Record, bandwidth: float, order: int = ORDER) -> Samples:
    """Return samples as `smoothed`, but with measured velocities and their differences as a.

    Args:
        record: record with velocities.
        bandwidth: bandwidth of the filter [Hz].
        order: order of one pass of the filter.

    Raises:
        ModelError: the record has no velocities. Also the errors of `smoothed`.
    """
    if record.v is None:
        raise ModelError("record: no velocities were measured; use smoothed(), or give v")
    even = _without_gaps(record, bandwidth)
    assert even.v is not None
    rate = _rate(even.time)
    q, v = (zero_phase(x, rate, bandwidth, order) for x in (even.q, even.v))
    return _trim(even, q, v, bandwidth, order)


def _without_gaps(record: Record, bandwidth: float) -> Record:
    """Return the record resampled at equal time steps.

    Raises ModelError if a time step exceeds half a period of the bandwidth [Hz], so that linear
    interpolation would change the motion.
    """
    steps = np.diff(record.time)
    longest = float(steps.max())
    usual = float(np.median(steps))
    if longest > max(0.5 / bandwidth, 2 * usual) and bandwidth > 0:
        start = float(record.time[int(np.argmax(steps))])
        raise ModelError(
            f"record: nothing was measured for {longest:.3g} s from {start:.6g} s, which is more"
            f" than half a period of the bandwidth of {bandwidth:g} Hz; give identify the"
            f" list record.pieces({0.5 / bandwidth:.3g}), or a bandwidth that is lower"
        )
    return resampled(record)


def _rate(time: Array) -> float:
    """Return the mean sampling rate [Hz] of instants `time` (n,) [s]."""
    return (len(time) - 1) / float(time[-1] - time[0])


def _trim(even: Record, q: Array, v: Array, bandwidth: float, order: int) -> Samples:
    """Return the samples of a resampled record `even` and its filtered positions and velocities.

    Accelerations are differences of v, efforts pass the same filter, the ends with filter
    transients are dropped and the rows are decimated. Raises ModelError if too few rows remain.

    `bandwidth` [Hz] and `order` are those of the filter.
    """
    rate = _rate(even.time)
    a = central_difference(v, rate)
    tau = zero_phase(even.tau, rate, bandwidth, order)
    ends = int(np.ceil(DROPPED * rate / bandwidth))
    step = max(int(rate / (WORKING_RATE * bandwidth)), 1)
    keep = slice(ends, len(even.time) - ends, step)
    time = even.time[keep]
    if len(time) < 2 * WORKING_RATE:
        raise ModelError(
            f"record: {even.time[-1] - even.time[0]:.3g} s are too short for a bandwidth of"
            f" {bandwidth:g} Hz, which takes {DROPPED / bandwidth:.3g} s at each end; give a longer"
            " record"
        )
    q, v, a, tau = (x[keep] for x in (q, v, a, tau))
    return Samples(time, q, v, a, tau, even.efforts, even.effort_units, bandwidth)
