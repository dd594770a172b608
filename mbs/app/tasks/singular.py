"""Singular configurations of a frame: factors of the determinant of its Jacobian, in words."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import casadi
import numpy as np
from casadi import SX, Function
from numpy.typing import NDArray

from mbs.app.tasks.equations import entry
from mbs.assembly import System
from mbs.loops.closing import Closing, difference
from mbs.models import singularities
from mbs.models._singularities import SingularFactor
from mbs.solvers.least_squares import gauss_newton

# Condition under which a factor of a determinant is zero, in words.


_SHORT = re.compile(r"([SC])(\d+)")
_CALLED = re.compile(r"(sin|cos)\(([^()]*)\)")
_BLOCK = re.compile(r"determinant of the (\d+ x \d+) block of (.*)")


def condition(text: str, coordinates: Sequence[tuple[str, bool]]) -> str:
    """Return a sentence that gives the condition under which a factor is zero.

    An example is "q3 is -pi/2 or pi/2 (C3 = 0)".

    Args:
        text: text of the factor; S23 is sin(q2 + q3).
        coordinates: name of each position, and whether it is the angle of a revolute joint.
    """
    block = _BLOCK.fullmatch(text)
    if block:
        return f"the {block[1]} block of {block[2]} is singular"
    found = _angle(text, [name for name, turns in coordinates if turns])
    if found is not None:
        kind, angle = found
        zeros = "0 or pi" if kind == "s" else "-pi/2 or pi/2"
        return f"{angle} is {zeros} ({text} = 0)"
    if text in [name for name, _ in coordinates]:
        return f"{text} is 0"
    return f"{text} = 0"


def _angle(text: str, turning: Sequence[str]) -> tuple[str, str] | None:
    """Return ("s" or "c", angle) if a text is a single sine or cosine of an angle; else None.

    `turning` are the names of the revolute joints.
    """
    short = _SHORT.fullmatch(text)
    if short:
        names = [f"q{digit}" for digit in short[2]]
        return (short[1].lower(), " + ".join(names)) if set(names) <= set(turning) else None
    called = _CALLED.fullmatch(text)
    return (called[1][0], called[2]) if called else None


Array = NDArray[np.float64]

_NO_OPTIONS: Mapping[str, Any] = MappingProxyType({})
_TRIES, _SEED = 12, 20260111
_REACH = 1.0
"""Maximum distance of initial guesses from the present configuration, per position [rad or m]."""
_NUDGE = 1e-3
"""Perturbation of each position [rad or m]: derivatives that vanish by symmetry do not vanish
there, and the nearest zero is still the nearest."""
_OPEN = 1e-9
"""Largest residual of a configuration that is shifted by full rotations: somewhat above the
tolerance of the iteration, 1e-12. A shifted configuration of a gear has residuals of tenths."""


@dataclass(frozen=True, slots=True)
class DeterminantFactor:
    """Factor of the determinant.

    Attributes:
        text: text of the factor with its power.
        power: power of the factor.
        condition: condition under which it is zero, in words.
        configuration: (nq,) configuration with closed loops near the given one where the factor
            is zero [rad or m]; None if none was found.
        determinant: determinant at that configuration.
    """

    text: str
    power: int
    condition: str
    configuration: tuple[float, ...] | None
    determinant: float | None


@dataclass(frozen=True, slots=True)
class Singular:
    """Singular configurations of the Jacobian of a frame.

    Attributes:
        system: name of the mechanism.
        frame: frame of the Jacobian.
        rows, columns: names of the rows and columns of its square part.
        determinant: constant and factors in one line.
        constant: factor that does not depend on positions.
        factors: factors that depend on positions.
        verdict: sentence that gives the condition of singularity.
    """

    system: str
    frame: str | int
    rows: tuple[str, ...]
    columns: tuple[str, ...]
    determinant: str
    constant: str
    factors: tuple[DeterminantFactor, ...]
    verdict: str


def singular(
    system: System,
    options: Mapping[str, Any] = _NO_OPTIONS,
    near: Sequence[float] | None = None,
) -> Singular:
    """Factor the determinant of a square part of a Jacobian, and find zeros of the factors.

    Args:
        system: open or closed system.
        options: options of the model "determinant": frame, expressed_in, coordinates, rows,
            columns.
        near: (nq,) configuration near which singular configurations are searched. Default: the
            assembled configuration.

    Raises:
        ModelError: the frame, a row or a column is unknown, or the part is not square.
    """
    chosen = entry("determinant").choices(system, **options)
    found = singularities(system, **chosen)
    start = np.array(system.position(near))
    factors = tuple(_factor(system, one, found.determinant, start) for one in found.factors)
    return Singular(
        system=system.name,
        frame=chosen["frame"],
        rows=tuple(chosen["rows"]),
        columns=tuple(chosen["columns"]),
        determinant=f"det J = {found}",
        constant=found.constant,
        factors=factors,
        verdict=_verdict(found.constant, factors),
    )


def _verdict(constant: str, factors: Sequence[DeterminantFactor]) -> str:
    """Return the sentence that gives the condition of singularity.

    The determinant is the product of the text `constant` and `factors`.
    """
    if constant == "0":
        return "The determinant is zero in every configuration; name other rows or columns."
    if not factors:
        return f"The determinant is {constant} in every configuration; none is singular."
    return "Singular where " + ", or where ".join(one.condition for one in factors) + "."


def _factor(
    system: System, one: SingularFactor, determinant: Function, start: Array
) -> DeterminantFactor:
    """Return a factor of a determinant and a configuration near `start` that makes it zero."""
    names = [(c.name, c.kind == "revolute") for c in system.coordinates]
    configuration = _zero(system, one.function, start)
    value: float | None = None
    if configuration is not None:
        p = [system.p_default] if system.parameters else []
        value = float(Function.__call__(determinant, configuration, *p))
    return DeterminantFactor(
        text=str(one),
        power=one.power,
        condition=condition(one.text, names),
        configuration=configuration,
        determinant=value,
    )


def _zero(system: System, function: Function, start: Array) -> tuple[float, ...] | None:
    """Return the zero of a function of q nearest to `start`, with closed loops; None if not found.

    The search starts from random configurations around `start` (nq,).
    """
    residual = _residual(system, function)
    rng = np.random.default_rng(_SEED)
    found = list[Array]()
    matter = np.abs(residual(start + _NUDGE)[1]).max(axis=0) > 0
    for reach in (0.0, _NUDGE, *[_REACH] * _TRIES):
        root = gauss_newton(residual, start + matter * rng.uniform(-reach, reach, start.size))
        if root.converged:
            near = start + difference(system, root.x, start)
            found.append(near if np.max(np.abs(residual(near)[0]), initial=0.0) < _OPEN else root.x)
    closing = Closing(system, np.array(system.p_default)) if system.is_closed else None
    fitting = [q for q in found if closing is None or closing.faces(q)]
    if not fitting:
        return None
    nearest = min(fitting, key=lambda q: float(np.linalg.norm(q - start)))
    return tuple(float(x) for x in nearest)


def _residual(system: System, function: Function) -> Callable[[Array], tuple[Array, Array]]:
    """Return q -> function value and loop residuals (m,), and their Jacobian (m, nq)."""
    p = np.array(system.p_default)
    slope = _value_and_slope(system, function)
    closing = Closing(system, p) if system.is_closed else None

    def residual(q: Array) -> tuple[Array, Array]:
        value, gradient = (np.array(m) for m in slope(q, p))
        if closing is None:
            return value.ravel(), gradient
        r, J = closing.rows(q)
        return np.concatenate([r, value.ravel()]), np.vstack([J, gradient])

    return residual


def _value_and_slope(system: System, function: Function) -> Function:
    """Return the Function (q, p) -> value of a function and its gradient (1, nq)."""
    q = SX.sym("q", system.nq)
    inputs = [q, system.p] if system.parameters else [q]
    value = Function.__call__(function, *inputs)
    return Function("zero", [q, system.p], [value, casadi.densify(casadi.jacobian(value, q))])
