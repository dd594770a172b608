"""Models at the samples of a record: the motion that they take, and what they give."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
from casadi import DM, Function

from mbs.assembly import System
from mbs.errors import ModelError
from mbs.identification.observations.singular import led_rows, on_lines
from mbs.identification.postures import positions
from mbs.identification.records.filters import Samples
from mbs.identification.regressors.dynamic import known_efforts

Array = npt.NDArray[np.float64]

_BATCH = 500


def known_of(regressor: Any, samples: Samples) -> Array:
    """(n, m) efforts of springs and force elements, which have no column [N m or N]."""
    system: System = regressor.system
    if not _has_elements(system):
        return np.zeros(samples.tau.shape)
    q, v, _ = motion_of(regressor, samples)
    known = known_efforts(system, "independent" if _is_reduced(regressor) else "tree")
    pairs = zip(q, v, strict=True)
    return np.array([DM(known(*state)).full()[:, 0] for state in pairs])


def motion_of(model: Any, samples: Samples) -> tuple[Array, Array, Array]:
    """Positions (n, nq), velocities and accelerations (n, m) that a model takes.

    The other joints of a closed system follow from the independent ones where the samples are of
    those alone.

    Args:
        model: of the independent or tree coordinates of `model.system`.
        samples: of all joints, or of the independent ones.

    Raises:
        ModelError: the samples have not the coordinates of the model.
    """
    system: System = model.system
    width, m = samples.q.shape[1], int(model.size1_in(1))
    if samples.tau.shape[1] == m:
        if width == system.nq == system.nv:
            chosen = list(system.active) if _is_reduced(model) else list(range(m))
            return samples.q, samples.v[:, chosen], samples.a[:, chosen]
        if width == m and _is_reduced(model):
            return positions(system, samples.q), samples.v, samples.a
    also = f" or {m}" if _is_reduced(model) else ""
    raise ModelError(
        f"observations: the samples have {width} positions and {samples.tau.shape[1]} efforts, the"
        f" model takes {system.nq}{also} and {m}; give every joint of the tree or the independent"
        " ones, and the efforts of the independent ones"
    )


def led_samples(model: Any, samples: Samples) -> npt.NDArray[np.bool_]:
    """(n,) instants at which the independent joints of a closed system lead the others.

    Raises:
        ModelError: they are less than half of all.
    """
    if samples.led is not None:
        return samples.led
    if not _is_reduced(model):
        return np.ones(len(samples.time), dtype=bool)
    return led_rows(model.system, motion_of(model, samples)[0])


def with_led(model: Any, samples: Samples) -> Samples:
    """The samples with `led` found, so that other motions near them keep the same instants."""
    return replace(samples, led=led_samples(model, samples))


def _is_reduced(model: Any) -> bool:
    """Whether a model is in the independent velocities of a closed system."""
    return bool(model.system.is_closed and int(model.size1_in(1)) == len(model.system.active))


def _has_elements(system: System) -> bool:
    springs = any(not link.stiffness.is_zero() for link in system.tree.links)
    return springs or bool(system.forces)


def evaluated(model: Any, samples: Samples) -> list[Array]:
    """(n, rows, columns) every output of a model of (q, v) or (q, v, a) at every sample.

    Next to singular postures of closed systems, straight lines take the place of the model.

    Args:
        model: of the independent or tree coordinates of `model.system`.
        samples: of all joints, or of the independent ones.

    Raises:
        ModelError: the samples have not the coordinates of the model.
    """
    states = motion_of(model, samples)[: model.n_in()]
    n = len(samples.time)
    size = min(_BATCH, n)
    many = Function(model).map(size)  # measured positions close no loop exactly
    found = [np.empty((n, *model.size_out(k))) for k in range(model.n_out())]
    for start in [*range(0, n - size, size), n - size]:
        rows = slice(start, start + size)
        values = many(*(DM(x[rows].T) for x in states))
        for whole, part in zip(found, values if len(found) > 1 else [values], strict=True):
            m, k = whole.shape[1:]
            whole[rows] = np.asarray(part).reshape(m, size, k).transpose(1, 0, 2)
    return [on_lines(whole, led_samples(model, samples)) for whole in found]
