"""What sensors read in the course of a simulation."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.models.measurements import measurements

Array = NDArray[np.float64]


def sensor_columns(system: System, motion: Mapping[str, Array]) -> Iterator[tuple[str, str, Array]]:
    """Name, unit and values of every element that the sensors read.

    Args:
        system: with or without sensors.
        motion: a column for each instant of q (nq, n), v, a and tau (nv, n) of the whole tree, and
            of the parameters p (np, n).
    """
    if not system.sensors:
        return
    model = measurements(system, "tree")
    count = motion["q"].shape[1]
    inputs = [motion[name] for name in model.name_in()]
    read = model.map(count)(*inputs)
    outputs = iter(read if isinstance(read, tuple) else (read,))
    for attached in system.sensors:
        columns = iter(attached.columns)
        for _ in attached.quantities:
            values = np.array(next(outputs)).T.reshape(count, -1)
            for element in values.T:
                name, unit = next(columns)
                yield name, unit, element
