"""Results of simulations and identifications: time, and named columns with units."""

import csv
import importlib
import io
import json
import math
import os
import zipfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from numbers import Real
from types import MappingProxyType
from typing import Any

import numpy as np
import numpy.typing as npt

from mbs.errors import ExportError, ModelError
from mbs.files import whole_file
from mbs.text import install_command, quoted

Array = npt.NDArray[np.float64]

_AT_ONCE = 1 << 26
"""Size of a result [bytes] above which its archive is written in pieces, since otherwise it would
be in memory twice."""

_QUANTITIES = {
    "1": "value",
    "s": "time",
    "rad": "angle",
    "rad/s": "angular velocity",
    "rad/s2": "angular acceleration",
    "m": "position",
    "m/s": "velocity",
    "m/s2": "acceleration",
    "kg": "mass",
    "N": "force",
    "N.m": "torque",
    "J": "energy",
    "A": "current",
    "V": "voltage",
    "W": "power",
}


@dataclass(frozen=True, slots=True)
class State:
    """State of a mechanism at one instant, from which a simulation can start.

    Attributes:
        q: all positions by coordinate name [rad or m].
        v: all velocities by coordinate name [rad/s or m/s].
        z: states of components by name, such as `motor.i`.
        modes: (k,) modes of rigid stops and of Coulomb friction.
        time: time [s].
        name: name of the mechanism.
    """

    q: Mapping[str, float]
    v: Mapping[str, float]
    z: Mapping[str, float] = field(default_factory=dict)
    modes: tuple[float, ...] = ()
    time: float = 0.0
    name: str = ""

    def __post_init__(self) -> None:
        for what in ("q", "v", "z"):
            values = {str(name): float(x) for name, x in getattr(self, what).items()}
            object.__setattr__(self, what, MappingProxyType(values))

    def __reduce__(self) -> tuple[Any, ...]:
        plain = dict(self.q), dict(self.v), dict(self.z), self.modes, self.time, self.name
        return type(self), plain

    def __repr__(self) -> str:
        shown = ", ".join(f"{name} = {x:.6g}" for name, x in self.q.items())
        return f"<State {self.name} at {self.time:g} s: {shown}>"


@dataclass(frozen=True, slots=True, eq=False)
class RecordedStates:
    """States of a motion at the times of the rows of a result.

    Attributes:
        names: names of positions, of velocities and of states of components.
        x: (n, nx) values of positions, velocities and states.
        modes: (n, k) modes of rigid stops and of Coulomb friction.
    """

    names: tuple[tuple[str, ...], tuple[str, ...], tuple[str, ...]]
    x: Array
    modes: Array

    def at(self, row: int, time: float, name: str) -> State:
        """Return the state of a row.

        Args:
            row: index of the row.
            time: time of the row [s].
            name: name of the mechanism.
        """
        values = iter(self.x[row].tolist())
        q, v, z = ({one: next(values) for one in names} for names in self.names)
        return State(q, v, z, tuple(self.modes[row].tolist()), time, name)


def state_of(given: Any) -> Any:
    """Return the last state of a `Result`; any other value is returned unchanged.

    Args:
        given: argument of a user: a `Result`, a `State` or another value.
    """
    return given.state() if isinstance(given, Result) else given


def positions_of(given: Any) -> Any:
    """Return the positions by name of a `State`, or of the last state of a `Result`.

    Any other value is returned unchanged.

    Args:
        given: argument of a user: a `Result`, a `State` or another value.
    """
    given = state_of(given)
    return given.q if isinstance(given, State) else given


def velocities_of(given: Any) -> Any:
    """Return the velocities by name of a `State`, or of the last state of a `Result`.

    Any other value is returned unchanged.

    Args:
        given: argument of a user: a `Result`, a `State` or another value.
    """
    given = state_of(given)
    return given.v if isinstance(given, State) else given


def device_states_of(given: Any) -> Any:
    """Return the states of components by name of a `State`, or of the last state of a `Result`.

    Any other value is returned unchanged.

    Args:
        given: argument of a user: a `Result`, a `State` or another value.
    """
    given = state_of(given)
    return given.z if isinstance(given, State) else given


@dataclass(frozen=True, slots=True, eq=False)
class Result:
    """Signals over time: `result["j1.q"]` is the signal (n,) of a variable.

    Attributes:
        time: (n,) times [s], never decreasing (an event repeats its instant).
        values: (n, k), a column for each signal, in the order of `units`.
        units: dict from signal name to unit name, in the order of the columns.
        name: name of the simulated system.
        info: further data of the run, such as the tolerance.
        events: time [s], name of the affected component, and description of each event.
        system: simulated mechanism, if known. It is not saved and not pickled.
        stopped: time [s] and reason of an early stop after the last row. None if complete.
        states: states of the rows, for the method `state`. They are not saved.
    """

    time: Array
    values: Array
    units: Mapping[str, str]
    name: str = ""
    info: Mapping[str, object] = field(default_factory=dict)
    events: tuple[tuple[float, str, str], ...] = ()
    system: object | None = field(default=None, repr=False)
    stopped: tuple[float, str] | None = None
    states: RecordedStates | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        time = _freeze(self.time)
        values = _freeze(self.values)
        if time.ndim != 1 or values.shape != (len(time), len(self.units)):
            raise ModelError(
                f"result {self.name!r}: time has shape {time.shape} and values {values.shape} for "
                f"{len(self.units)} names; give (n,) and (n, number of names)"
            )
        if (time[1:] < time[:-1]).any():
            raise ModelError(f"result {self.name!r}: time goes backwards; sort the rows by time")
        object.__setattr__(self, "time", time)
        object.__setattr__(self, "values", values)
        object.__setattr__(self, "units", MappingProxyType(dict(self.units)))
        object.__setattr__(self, "info", MappingProxyType(dict(self.info)))

    def __repr__(self) -> str:
        rows, columns = self.values.shape
        span = f", {self.time[0]:g} to {self.time[-1]:g} s" if rows else ""
        end = "" if self.stopped is None else f", stopped at {self.stopped[0]:g} s"
        return f"<Result {self.name}: {columns} signals, {rows} rows{span}{end}>"

    def __reduce__(self) -> tuple[Any, ...]:
        plain = dict(self.units), self.name, dict(self.info), self.events, None, self.stopped
        return type(self), (self.time, self.values, *plain, self.states)

    def state(self, t: float | None = None) -> State:
        """Return the state of a row, from which a motion, a linear model or an FMU can start.

        Args:
            t: time of the row [s]; its last row if an event repeats it. The default is the last
                row.

        Raises:
            ModelError: there is no row at this time, or the result has no states, such as a result
                that was read from a file.
        """
        if self.states is None or not len(self.time):
            raise ModelError(
                f"result {self.name!r}: it keeps no states; take the state from the result that"
                " mbs.simulate.run returned"
            )
        row = len(self.time) - 1
        if t is not None and not (isinstance(t, Real) and math.isfinite(t)):
            raise ModelError(f"result {self.name!r}: t [s] is {quoted(t)}; give the time of a row")
        if t is not None:
            row = int(np.searchsorted(self.time, float(t), side="right")) - 1
            near = min(
                (k for k in (row, row + 1) if 0 <= k < len(self.time)), key=self._distance_from(t)
            )
            # times are sums of steps, with rounding errors
            if self._distance_from(t)(near) > 1e-9 * max(1.0, abs(float(t))):
                raise ModelError(
                    f"result {self.name!r}: there is no row at {float(t)!r} s, the nearest is at"
                    f" {float(self.time[near])!r} s; take this one, or give run another step"
                )
            row = int(np.flatnonzero(self.time == self.time[near])[-1])
        return self.states.at(row, float(self.time[row]), self.name)

    def _distance_from(self, t: float) -> Callable[[int], float]:
        """Return a function from a row index to the distance [s] of its time from t."""
        return lambda row: abs(float(self.time[row]) - float(t))

    @classmethod
    def from_structured(
        cls, array: npt.NDArray[Any], units: Mapping[str, str], name: str = ""
    ) -> "Result":
        """Create a result from a structured array whose first field is time, as fmpy returns it.

        Args:
            array: (n,) structured array with one number per field.
            units: unit of each field. The default of a field is "1".
            name: name of the simulated system.

        Returns:
            result with the same numbers.
        """
        fields = array.dtype.names or ()
        columns = fields[1:]
        values = np.empty((len(array), len(columns)))
        for k, column in enumerate(columns):
            values[:, k] = array[column]
        return cls(array[fields[0]], values, {c: units.get(c, "1") for c in columns}, name)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the signals, in the order of the columns."""
        return tuple(self.units)

    def __getitem__(self, name: str) -> Array:
        return self.values[:, self._index(name)]

    def __contains__(self, name: object) -> bool:
        return name in self.units

    def __len__(self) -> int:
        return len(self.time)

    def at(self, time: float) -> dict[str, float]:
        """Return the value of every signal at one instant, by linear interpolation between rows.

        Args:
            time: time [s] within the result.

        Returns:
            dict from signal name to value, in the unit of the signal.

        Raises:
            ModelError: the time is outside the result.
        """
        if not len(self) or not self.time[0] <= time <= self.time[-1]:
            span = f"{self.time[0]:g} to {self.time[-1]:g} s" if len(self) else "nothing"
            raise ModelError(f"time {time:g} s is outside the result, which covers {span}")
        return {n: float(np.interp(time, self.time, self[n])) for n in self.names}

    def to_csv(self, path: str | os.PathLike[str]) -> None:
        """Write a CSV file: a header of names, then a row per instant, in full precision.

        Args:
            path: file to write. It is replaced completely or not at all.

        Raises:
            ExportError: the file cannot be written.
        """
        rows = np.column_stack([self.time, self.values]).tolist()
        with whole_file(path) as scratch, scratch.open("w", newline="", encoding="utf-8") as stream:
            writer = csv.writer(stream)
            writer.writerow(("time", *self.names))
            writer.writerows([repr(v) for v in row] for row in rows)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the result without `info` and `system` to a NumPy archive, for `load`.

        Args:
            path: file to write, such as run.npz. It is replaced completely or not at all.

        REPLACE_RAISES
        """
        rest = {
            "name": self.name,
            "units": dict(self.units),
            "events": self.events,
            "stopped": self.stopped,
        }
        with whole_file(path) as scratch:
            # writing one block is faster than writing many small pieces of an archive
            stream = io.BytesIO() if self.values.nbytes < _AT_ONCE else scratch.open("wb")
            with stream:
                np.savez(stream, time=self.time, values=self.values, rest=json.dumps(rest))
                if isinstance(stream, io.BytesIO):
                    scratch.write_bytes(stream.getbuffer())

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> "Result":
        """Return the result in a file of `save`.

        Args:
            path: path of the file.

        Raises:
            ModelError: the file was not written by `save`.
        """
        try:
            with open(path, "rb") as stream, np.load(stream, allow_pickle=False) as archive:
                rest = json.loads(str(archive["rest"]))
                events = tuple((t, name, words) for t, name, words in rest["events"])
                time, values = archive["time"], archive["values"]
                stopped = (float(s[0]), str(s[1])) if (s := rest.get("stopped")) else None
                return cls(
                    time, values, rest["units"], rest["name"], events=events, stopped=stopped
                )
        except (OSError, EOFError, KeyError, TypeError, ValueError, zipfile.BadZipFile) as error:
            raise ModelError(
                f"{path} is no saved result ({error}); give a file that Result.save wrote"
            ) from error

    def to_pandas(self) -> Any:
        """Return the signals as a pandas DataFrame indexed by time.

        Units are in `.attrs["units"]`, and the reason of an early stop is in `.attrs["stopped"]`.

        Raises:
            ModelError: pandas is not installed.
        """
        pandas = optional_module("pandas", "tables")
        index = pandas.Index(self.time, name="time")
        frame = pandas.DataFrame(self.values.copy(), index=index, columns=list(self.names))
        frame.attrs["units"] = dict(self.units)
        if self.stopped is not None:
            frame.attrs["stopped"] = self.stopped
        return frame

    def to_xarray(self) -> Any:
        """Return the signals as an xarray Dataset over time, each with its unit as attribute.

        Raises:
            ModelError: xarray is not installed.
        """
        xarray = optional_module("xarray", "tables")
        signals = {n: ("time", self[n].copy(), {"units": u}) for n, u in self.units.items()}
        stop = {} if self.stopped is None else {"stopped": self.stopped[1]}
        return xarray.Dataset(
            signals,
            coords={"time": ("time", self.time.copy(), {"units": "s"})},
            attrs={"name": self.name, **self.info, **stop},
        )

    def plot(
        self,
        names: str | Sequence[str] | None = None,
        path: str | os.PathLike[str] | None = None,
    ) -> Any:
        """Plot signals over time, with one panel per unit.

        Args:
            names: signals to plot. The default is all of them.
            path: file to save the picture to, in the format of its ending.

        Returns:
            matplotlib Figure.

        Raises:
            ModelError: matplotlib is missing or a name is unknown.
            ExportError: the file cannot be written.
        """
        chosen = (names,) if isinstance(names, str) else self.names if names is None else names
        groups: dict[str, list[str]] = {}
        for n in chosen:
            self._index(n)
            groups.setdefault(self.units[n], []).append(n)
        figure = _figure(len(groups), shown=path is None)
        if self.name:
            figure.suptitle(self.name)
        axes = figure.subplots(max(len(groups), 1), 1, sharex=True, squeeze=False)[:, 0]
        for axis, (unit, members) in zip(axes, groups.items(), strict=False):
            for n in members:
                axis.plot(self.time, self[n], label=n)
            axis.set_ylabel(_label(unit))
            axis.grid(True, alpha=0.3)  # less opaque than the lines
            axis.legend(loc="upper right", fontsize="small")
        axes[-1].set_xlabel("time [s]")
        if path is not None:
            _save(figure, path)
        return figure

    def _index(self, name: str) -> int:
        """Return the column of the signal `name`; raise ModelError if it is unknown."""
        if not isinstance(name, str) or name not in self.units:
            raise ModelError(
                f"result {self.name!r} has no signal {name!r}; it has {', '.join(self.names)}"
            )
        return self.names.index(name)


def _freeze(values: npt.ArrayLike) -> Array:
    """Return a read-only copy of values as an array of floats."""
    array = np.array(values, dtype=float)
    array.flags.writeable = False
    return array


def _label(unit: str) -> str:
    """Return the axis label of a unit: quantity and unit, such as "torque [N.m]"."""
    quantity = _QUANTITIES.get(unit, "value")
    return quantity if unit == "1" else f"{quantity} [{unit}]"


def optional_module(module: str, extra: str) -> Any:
    """Return a module of an optional dependency of this package, imported at this call.

    Args:
        module: name of the module.
        extra: extra of this package that installs the module.

    Raises:
        ModelError: the module is not installed. The message has the command to install the extra.
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise ModelError(f"{module} is not installed; run: {install_command(extra)}") from error


def _figure(rows: int, *, shown: bool) -> Any:
    """Return a new matplotlib Figure for `rows` panels; with pyplot if it is shown.

    Raise ModelError if matplotlib is missing.
    """
    # inches: width of a text page, flat panels, and space for the title and the time axis
    size = (8.0, 1.0 + 2.5 * max(rows, 1))
    optional_module("matplotlib", "plot")
    if shown:
        return optional_module("matplotlib.pyplot", "plot").figure(
            figsize=size, layout="constrained"
        )
    return optional_module("matplotlib.figure", "plot").Figure(figsize=size, layout="constrained")


def _save(figure: Any, path: str | os.PathLike[str]) -> None:
    """Write a figure to a file, in the format of its ending; raise ExportError if it fails."""
    remedy = "give a .png, .svg or .pdf file in a folder that you may write"
    with whole_file(path, remedy) as scratch:
        try:
            figure.savefig(scratch)
        except ValueError as error:
            raise ExportError(f"picture {path} could not be written ({error}); {remedy}") from error
