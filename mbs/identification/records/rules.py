"""What a record may not be: out of order, with holes, in other units, too short."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from mbs.errors import ModelError
from mbs.messages import quoted

if TYPE_CHECKING:
    from mbs.identification.records.record import Record

Array = npt.NDArray[np.float64]

SHORTEST = 50
"""Rows that a record needs at least."""

GAP = 20.0
"""Usual steps of time that are bridged by default."""

FARTHEST_TURN = 4 * np.pi
"""Positions beyond it are not taken for those of a revolute joint [rad]."""

_RANGES = 3.0
_SAME_MOTION = 0.9
_SAME_RATE = 0.3
_STILL = 1e-9


def check_record(record: Record) -> None:
    """Refuse what cannot be a record of joints in SI units.

    Raises:
        ModelError: which column and row, what value, and what to do.
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
    """Compare the change of a position with the integral of its velocity, both without trend."""
    assert record.v is not None
    v, steps = record.v[:, k], np.diff(record.time)
    travelled = np.concatenate([[0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) * steps)])
    moved, by_rate = (_detrended(record.time, x) for x in (record.q[:, k], travelled))
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


def _detrended(time: Array, values: Array) -> Array:
    """Without the straight line that fits best."""
    basis = np.column_stack([np.ones_like(time), time - time.mean()])
    line = basis @ np.linalg.lstsq(basis, values, rcond=None)[0]
    return np.asarray(values - line, dtype=float)
