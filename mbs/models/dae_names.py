"""Name and unit of every element of differential-algebraic equations."""

from __future__ import annotations

from collections.abc import Mapping

from mbs.assembly import System
from mbs.assembly.rates import quaternion_slices
from mbs.assembly.tables import ACCELERATION_UNIT, EFFORT_UNIT, RATE_UNIT
from mbs.loops.rolling import SLIPS
from mbs.models.dae_forms import motors

Elements = tuple[tuple[str, str], ...]
"""Name and unit of each element of a vector."""

_RATE_OF_RATE = {"m": "m/s2", "rad": "rad/s2", "1": "1/s2"}
_EFFORT = {"m": "N", "rad": "N.m", "1": "N.m"}


def elements_of(
    system: System, form: str, standing: tuple[Elements, Elements] = ((), ())
) -> Mapping[str, Elements]:
    """For x, z, u, p, alg and invariants of a form, the name and unit of each element.

    Args:
        system: open or closed.
        form: "open", "closed form" or "carried" for the three kinds of "reduced", "phase" for that
            of a contact phase, else as in `mbs.models.dae`.
        standing: of points that touch, the rows that bind positions and those that bind velocities
            alone.
    """
    q, v, a, tau = _coordinates(system)
    norms = tuple(
        (f"{system.coordinates[part.start].joint}: unit quaternion", "1")
        for part in quaternion_slices(system.tree)
    )
    fixed = {
        "u": tuple(tau[k] for k in motors(system)),
        "p": tuple((parameter.name, parameter.unit) for parameter in system.parameters),
    }
    v_a = tuple(v[k] for k in system.active)
    phi, slips = (a + b for a, b in zip(_rows(system), standing, strict=True))
    rows = phi + slips
    speeds = _of("der", rows, RATE_UNIT)
    explicit = {
        "open": (q + v, norms),
        "closed form": (tuple(q[k] for k in system.active) + v_a, ()),
        "carried": (q + v_a, phi + norms),
        "phase": (q + v, phi + speeds + norms),
    }
    if form in explicit:
        x, invariants = explicit[form]
        return {**fixed, "x": x, "z": (), "alg": (), "invariants": invariants}
    kept = {
        "index1": _of("der(der", rows, _RATE_OF_RATE, "))"),
        "index2": speeds,
        "index3": phi + _of("der", slips, RATE_UNIT),
        "ggl": phi + speeds,
    }[form]
    mu = _of("mu", phi, dict.fromkeys(RATE_UNIT, "1")) if form == "ggl" else ()
    return {
        **fixed,
        "x": q + v,
        "z": a + _of("lam", rows, _EFFORT) + mu,
        "alg": tau + kept,
        "invariants": phi + speeds + norms,
    }


def _coordinates(system: System) -> tuple[Elements, Elements, Elements, Elements]:
    """Of q, v, a and tau, under the names that results of simulations have."""
    q = tuple((f"{c.name}.q", c.unit) for c in system.coordinates)
    v = tuple((f"{s.name}.v", s.unit) for s in system.speeds)
    a = tuple((f"{s.name}.a", ACCELERATION_UNIT[s.unit]) for s in system.speeds)
    tau = tuple((f"{s.name}.tau", EFFORT_UNIT[s.unit]) for s in system.speeds)
    return q, v, a, tau


def _rows(system: System) -> tuple[Elements, Elements]:
    """Of the independent rows of positions and of velocities alone, these as if integrated."""
    if system.closure is None:
        return (), ()
    driven = {c.name: system.coordinates[c.driven].unit for c in system.couplings}
    every = [
        (label, (f"{loop.name}: {label}", driven.get(loop.name, _row_unit(label))))
        for loop in system.loops
        for label in loop.rows
    ]
    positions = [row for label, row in every if label not in SLIPS]
    slips = [row for label, row in every if label in SLIPS]
    kept = system.closure
    return tuple(positions[k] for k in kept.rows), tuple(slips[k] for k in kept.slips)


def _row_unit(label: str) -> str:
    return "1" if label.startswith("moment") else "m"


def _of(what: str, rows: Elements, unit: Mapping[str, str], end: str = ")") -> Elements:
    return tuple((f"{what}({name}{end}", unit[u]) for name, u in rows)
