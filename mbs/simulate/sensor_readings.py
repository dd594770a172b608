"""Sensor readings in a simulation."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.models._measurements import measurements

Array = NDArray[np.float64]


def sensor_values(system: System, motion: Mapping[str, Array]) -> Array:
    """Return the readings of all sensors at n instants, (n, k), in the order of the sensors.

    Args:
        system: system with sensors.
        motion: arrays with one column per instant: q (nq, n), v, a and tau (nv, n) of the whole
            tree, states z and inputs u of components, parameters p (np, n).
    """
    model = measurements(system, "tree")
    count = motion["q"].shape[1]
    read = model.map(count)(*(motion[name] for name in model.name_in()))
    values = read if isinstance(read, tuple) else (read,)
    return np.hstack([np.array(one).T.reshape(count, -1) for one in values])
