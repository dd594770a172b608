"""Signals that drive a mechanism, written as functions of time, positions and velocities."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import casadi
import numpy as np
from casadi import DM, SX, Function
from numpy.typing import NDArray

from mbs.arguments import names_given, values_given
from mbs.assembly import System
from mbs.assembly.variable_names import EFFORTS, by_coordinate
from mbs.errors import ModelError
from mbs.loops.balance import require_no_balance
from mbs.numbers import has_boolean, is_vector, numbers_given
from mbs.text import did_you_mean, error_text, quoted

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class LawArgument:
    """Argument of the user that drives a mechanism, such as tau.

    Attributes:
        name: name of the argument.
        noun: plural noun for its values in error messages, such as "efforts".
        elements: name of each value.
        short: indices of the values that models of a closed system take; a law may return only
            these values.
    """

    name: str
    noun: str
    elements: Sequence[str]
    short: Sequence[int] = ()


def signal_function(
    system: System,
    signal: LawArgument,
    given: SX | Function | Callable[[Any, Any, Any], Any],
    driven: Collection[str] | None = None,
) -> Function:
    """Return the Function `f(t, q, v, p)` of a signal with n values, (n, 1).

    Args:
        system: open or closed system.
        signal: description of the signal for checks and messages.
        given: expression of the values, or a function of (t, q, v) that returns all values in order
            or a dict by name. Values that are not in the dict are zero.
        driven: names of the elements with a motor. Other elements must be zero or named in a dict.
            None allows all elements.

    Raises:
        ModelError: the function cannot be traced, the number of values is wrong, a name is unknown,
            or an element without a motor has a value.
    """
    t, q, v = SX.sym("t"), SX.sym("q", system.nq), SX.sym("v", system.nv)
    if isinstance(given, SX):
        values, by_name = given, False
    else:
        values, by_name = _trace(system, signal, given, (t, q, v))
    size = len(signal.elements)
    if signal.short and values.numel() == len(signal.short) != size:
        whole = SX(size, 1)
        whole[list(signal.short)] = values
        values = whole
    if values.numel() != size:
        names, taken = signal.elements, ""
        if signal.short and len(signal.short) != size:
            taken = f", the models {len(signal.short)}: {', '.join(names[k] for k in signal.short)}"
        raise ModelError(
            f"{system.name}: {signal.name} has {values.numel()} values, the system has {size}:"
            f" {', '.join(names)}{taken}"
        )
    if driven is not None and not by_name:
        _require_driven(system, signal, values, driven)
    if driven is not None:
        acting = [k for k in range(size) if not casadi.densify(values)[k].is_zero()]
        require_no_balance(system, signal.name, velocities=acting)
    inputs = [t, q, v, system.p]
    result = Function(signal.name, inputs, [casadi.densify(values)], {"allow_free": True})
    if result.has_free():
        raise ModelError(
            f"{system.name}: {signal.name}(t, q, v) holds the symbols"
            f" {', '.join(result.get_free())}; make it of t, q, v and numbers"
        )
    return result


def _trace(
    system: System, signal: LawArgument, function: Callable[..., Any], point: tuple[SX, SX, SX]
) -> tuple[SX, bool]:
    """Return the values as an expression of t, q and v, and whether a dict was returned."""
    _check_inputs(system, signal, function, point)
    t, q, v = point
    if isinstance(function, Function) and function.numel_in(2) != v.numel():
        v = v[list(system.independent)]
    try:
        values = function(t, q, v)
    except Exception as error:
        raise untraceable(system, f"{signal.name}(t, q, v)", error) from error
    by_name = isinstance(values, Mapping)
    if by_name:
        values = _in_order(system, signal, values)
    if not is_vector(shape := _shape(values)):
        raise ModelError(
            f"{system.name}: {signal.name}(t, q, v) returns the shape {shape}; return"
            f" {len(signal.elements)} {signal.noun} in a list or a column:"
            f" {', '.join(signal.elements)}"
        )
    try:
        result = None if has_boolean(values) else _column(values)
    except Exception:
        result = None
    if result is None or (not casadi.symvar(result) and not casadi.evalf(result).is_regular()):
        raise ModelError(
            f"{system.name}: {signal.name}(t, q, v) returns {quoted(values)}; return"
            f" {len(signal.elements)} {signal.noun}, finite numbers or CasADi expressions of t, q"
            f" and v{'' if result is None else _SYMBOLS}"
        )
    if _has_nan(result):
        raise ModelError(
            f"{system.name}: {signal.name}(t, q, v) has a part that is not a number{_SYMBOLS}"
        )
    return result, by_name


def _shape(values: Any) -> tuple[int, ...]:
    """Shape of an array, of an expression, or of nested lists; empty for anything else."""
    if isinstance(values, (list, tuple)):
        widths = [len(row) for row in values if isinstance(row, (list, tuple))]
        return len(values), max(widths, default=1)
    shape: tuple[int, ...] = getattr(values, "shape", ())
    return shape


def _has_nan(value: SX) -> bool:
    """Whether an expression contains a constant that is not a number."""
    graph = Function("law", [casadi.vertcat(SX(0, 1), *casadi.symvar(value))], [value])
    constants = (
        graph.instruction_constant(k)
        for k in range(graph.n_instructions())
        if graph.instruction_id(k) == casadi.OP_CONST
    )
    return any(np.isnan(constant) for constant in constants)


def _in_order(system: System, signal: LawArgument, values: Mapping[str, Any]) -> list[Any]:
    """Return all elements of the signal in order; zero for elements without a value."""
    values = by_coordinate(system.name, values, signal.elements, [signal.name])
    for name in values:
        if name not in signal.elements:
            known = did_you_mean(str(name), signal.elements)
            raise ModelError(f"{system.name}: {signal.name}(t, q, v) names {quoted(name)}; {known}")
    return [values.get(name, 0) for name in signal.elements]


def _require_driven(
    system: System, signal: LawArgument, values: SX, driven: Collection[str]
) -> None:
    for name, value in zip(signal.elements, casadi.vertsplit(casadi.densify(values)), strict=True):
        if name not in driven and not value.is_zero():
            raise ModelError(
                f"{system.name}: {signal.name} drives {name!r}, which has no motor; make that joint"
                f" actuated=True, return zero for it, or return a dict that names it, as in"
                f" {{{name!r}: value}}"
            )


_SYMBOLS = (
    ": float(q[0]) and functions such as math.sin make NaN of symbols; build it from CasADi"
    " operations, such as casadi.sin and casadi.if_else"
)


def untraceable(system: System, what: str, error: Exception) -> ModelError:
    """Return the error of a user's function that raised one when called with CasADi symbols."""
    fault = f"raises {error_text(error)}"
    if not isinstance(error, _OF_SYMBOLS):
        return ModelError(f"{system.name}: {what} {fault}; correct the function")
    return ModelError(
        f"{system.name}: {what} could not be traced with CasADi symbols, it {fault}; build it from"
        " CasADi operations, such as casadi.sin and casadi.if_else"
    )


_OF_SYMBOLS = (RuntimeError, TypeError, ValueError, NotImplementedError, AttributeError)
"""Errors of operations that do not take CasADi symbols, such as math.sin and `if`."""


def _column(values: Any) -> SX:
    if isinstance(values, np.ndarray):
        values = list(values.ravel())
    if isinstance(values, (list, tuple)):
        return SX(casadi.vertcat(*values))
    return casadi.vec(SX(values))


def _check_inputs(
    system: System, signal: LawArgument, function: Callable[..., Any], point: tuple[SX, SX, SX]
) -> None:
    if isinstance(function, Function):
        sizes = [function.numel_in(k) for k in range(function.n_in())]
        expected = [symbol.numel() for symbol in point]
        independent = [*expected[:2], len(system.independent)]
        if sizes not in (expected, independent) or function.n_out() != 1:
            other = "" if independent == expected else f" or {independent}"
            raise ModelError(
                f"{system.name}: {signal.name} has inputs of sizes {sizes} and {function.n_out()}"
                f" outputs; give a Function of (t, q, v), of sizes {expected}{other}, with one"
                " output"
            )
        return
    try:
        inspect.signature(function).bind(*point)
    except TypeError:
        raise ModelError(
            f"{system.name}: {signal.name} does not take three arguments; give a function of"
            " (t, q, v)"
        ) from None
    except ValueError:  # no signature is known: the call will report it
        return


# Joint efforts from the user: constants, dict by name, or function.


Effort = Mapping[str, float] | Sequence[float] | Function | Callable[[Any, Any, Any], Any] | None


def effort_function(system: System, tau: Effort) -> Function | None:
    """Return joint efforts as a Function `tau(t, q, v, p) -> tau`, (nv, 1).

    Args:
        system: open or closed system.
        tau: constants by motor name, a list of all constants, a function of (t, q, v), or None. A
            function may return a dict by joint name, also for joints without a motor. For a closed
            system, the values are of all joints of the tree, or of the joints whose efforts its
            models take (`System.motors`).

    Returns:
        Function, or None without efforts.

    Raises:
        ModelError: a name is unknown, a joint without a motor has an effort, or the efforts are not
            (nv, 1) numbers.
    """
    if tau is None:
        return None
    names = [speed.name for speed in system.velocity_coordinates]
    signal = LawArgument("tau", "efforts", names, system.motors)
    driven = [speed.name for speed in system.velocity_coordinates if speed.actuated]
    if callable(tau):
        return signal_function(system, signal, tau, driven)
    given = system.plain_names(tau, EFFORTS)
    if not isinstance(tau, Mapping):
        array, short = numbers_given(tau), len(system.motors)
        if (
            not isinstance(array, str)
            and array.ndim
            and is_vector(array.shape)
            and array.size == short != system.nv
        ):
            motors = (names[k] for k in system.motors)
            given = dict(zip(motors, array.ravel().tolist(), strict=True))
    values = SX(DM(system.effort(given)))
    if isinstance(given, Mapping):
        _require_motors(system, given, driven)
    return signal_function(system, signal, values, driven)


def _require_motors(system: System, tau: Mapping[str, float], driven: Sequence[str]) -> None:
    for name in tau:
        if name not in driven:
            raise ModelError(
                f"{system.name}: tau names {name!r}, which has no motor; make that joint"
                f" actuated=True, or use one of {', '.join(driven) or '(none)'}"
            )


# Efforts and inputs that are constants of each simulation run.


@dataclass(frozen=True, slots=True)
class GivenInput:
    """Joint effort or component input that is constant during a simulation run.

    Attributes:
        name: name, such as "j1.tau" or "motor.voltage".
        is_effort: whether it is an element of tau; otherwise it is an element of u.
        index: index in tau or u.
        default: value if a run specifies none.
    """

    name: str
    is_effort: bool
    index: int
    default: float


def given_inputs(system: System, names: Sequence[str]) -> tuple[GivenInput, ...]:
    """Resolve names of efforts and inputs, such as "j1.tau" and "motor.voltage".

    Raises:
        ModelError: a name is unknown or repeated, or a joint has no motor.
    """
    names = names_given(f"{system.name}: inputs", names, "j1.tau")
    efforts = [f"{speed.name}.tau" for speed in system.velocity_coordinates]
    inputs = [name for name, _ in system.inputs]
    found: dict[str, GivenInput] = {}
    for given in names:
        name = full_name(str(given), system.inputs)
        if name not in efforts and name not in inputs:
            known = did_you_mean(str(given), [*efforts, *inputs])
            raise ModelError(f"{system.name}: inputs names {quoted(given)}; {known}")
        if name in found:
            raise ModelError(f"{system.name}: inputs names {name} twice; name it once")
        if name in inputs:
            index = inputs.index(name)
            found[name] = GivenInput(name, False, index, float(system.u_default[index]))
        else:
            index = efforts.index(name)
            if not system.velocity_coordinates[index].actuated:
                driven = ", ".join(
                    f"{s.name}.tau" for s in system.velocity_coordinates if s.actuated
                )
                raise ModelError(
                    f"{system.name}: inputs names {name}, but that joint has no motor; make it"
                    f" actuated=True, or use one of {driven or '(none)'}"
                )
            found[name] = GivenInput(name, True, index, 0.0)
    return tuple(found.values())


# Motions that are prescribed as functions of time, or by signals.


@dataclass(frozen=True, slots=True, eq=False)
class Prescribed:
    """Coordinate with a prescribed motion.

    Attributes:
        name: name of the velocity.
        velocity: index of the velocity in v.
        position: index in q of a prescribed position, None if the position is free.
        holds_speed: whether the velocity is prescribed; it is free if only the acceleration is.
        laws: `laws(t, z, p)` -> position, velocity and acceleration, for the time [s], the states
            of components (nz, 1) and the parameters (np, 1); free quantities are zero.
    """

    name: str
    velocity: int
    position: int | None
    holds_speed: bool
    laws: Function

    @property
    def order(self) -> int:
        """Lowest prescribed derivative: 0 for position, 1 for velocity, 2 for acceleration."""
        return 0 if self.position is not None else 1 if self.holds_speed else 2

    def law(self, t: SX, z: SX, p: SX) -> tuple[SX, SX, SX]:
        """Return position, velocity and acceleration for time, component states and parameters."""
        position, velocity, acceleration = self.laws.call([t, z, p])
        return SX(position), SX(velocity), SX(acceleration)


# Values of states and inputs of components by name.


def full_name(name: str, quantities: Sequence[tuple[str, str]]) -> str:
    """Return the full name of a quantity, also for the name of a component with one quantity."""
    names = [full for full, _ in quantities]
    owned = [full for full in names if full.rpartition(".")[0] == name]
    return owned[0] if name not in names and len(owned) == 1 else name


def by_name(
    system: System,
    what: str,
    values: Mapping[str, float] | None,
    quantities: Sequence[tuple[str, str]],
    otherwise: Sequence[float],
) -> Array:
    """Return the values of states or inputs by name, with `otherwise` as default values.

    Raises:
        ModelError: a name is unknown, or a value is no finite number.
    """
    names, result = [name for name, _ in quantities], np.array(otherwise, dtype=float)
    example = f'"{names[0]}": 0.5' if names else '"motor.i": 0.5'
    for given, value in values_given(f"{system.name}: {what}", values, example).items():
        name = full_name(str(given), quantities)
        if name not in names:
            owners = [full.rpartition(".")[0] for full in names]
            known = [*(one for one in owners if owners.count(one) == 1), *names]
            raise ModelError(
                f"{system.name}: {what} names {quoted(given)}; {did_you_mean(str(given), known)}"
            )
        number = numbers_given(value)
        if isinstance(number, str) or number.size != 1 or not np.isfinite(number).all():
            raise ModelError(
                f"{system.name}: {what} gives {quoted(value)} for {name}; give a finite number"
            )
        result[names.index(name)] = float(number.ravel()[0])
    return result


def with_inputs(system: System, values: Sequence[SX], u: SX) -> list[SX]:
    """Substitute values u (nu, 1) for the input symbols of components in expressions."""
    if not system.u.numel():
        return [SX(value) for value in values]
    dense = [casadi.densify(SX(value)) for value in values]
    return [SX(value) for value in casadi.substitute(dense, [system.u], [casadi.densify(u)])]
