"""Checks of the equations of components when a mechanism is assembled.

They cover shapes, names and symbols of the returned values, consistency of loads with the energy,
and the sign of the dissipation. Errors name the component and the method.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import casadi
import numpy as np
from casadi import SX, Function
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.assembly.component_instances import ComponentInstance, WireSource
from mbs.assembly.tree import position_rate, quaternion_slices
from mbs.components.custom import (
    Approach,
    At,
    Event,
    FlangeAt,
    FrameLoad,
    Friction,
    OneWay,
    Row,
    Signal,
    Stop,
)
from mbs.errors import AssemblyError, ExpressionError, MbsError
from mbs.expressions import Expression
from mbs.numbers import NONZERO
from mbs.recursions.parts import PartsAt, later_signal, later_sources
from mbs.text import did_you_mean, one_line, quoted

Array = NDArray[np.float64]

_PROBES, _SEED = 4, 20261123
"""Number and seed of random states at which powers are compared: a wrong law fails at almost all
states."""
_SAME = 1e-8
"""Tolerance on the difference of powers relative to the largest: correct formulas agree to 1e-12,
errors are of order one, and laws with steep slopes lose some digits."""
_NEGATIVE = 1e-9
"""Rounding tolerance on a negative dissipation, relative to the largest power."""
_COLUMNS = ("q", "v", "a", "tau")  # suffixes of the columns of a coordinate in results
_FROM_AT = "take what is declared from at, such as at.k, and not from self"
_NO_TRUTH = (
    "write casadi.if_else, casadi.fmax and casadi.logic_and where if, max and `and` ask a symbol"
)


def check_parts(system: System) -> None:
    """Raise if the equations of a component contradict its declarations or each other.

    Args:
        system: open system, or closed system before the analysis of its loops.

    Raises:
        AssemblyError: the message names the component, the method and the remedy.
    """
    if not system.parts:
        return
    q, v = SX.sym("q", system.nq), SX.sym("v", system.nv)
    at = PartsAt(system, q, v)
    taken = {
        f"{c.name}.{x}"
        for c in (*system.coordinates, *system.velocity_coordinates)
        for x in _COLUMNS
    }
    for name, _ in (*system.states, *system.inputs, *system.outputs):
        if name in taken:
            raise AssemblyError(
                f"{system.name}: {name} is a state, input or output of a component, and a column of"
                " a coordinate; rename the component"
            )
    for part in system.parts:
        for given in part.inputs.values():
            if isinstance(given, WireSource):
                at.signal(given)
        _require_state_between(system, part, at)
        if not type(part.element).__module__.startswith("mbs."):  # tests check own components
            check_part(system, part, at)


_AT_ONCE = ("loads", "energy", "rows", "velocity_rows", "frictions", "stops", "events", "crossings")
"""Methods whose results determine accelerations, or are evaluated before the accelerations."""


def _require_state_between(system: System, part: ComponentInstance, at: PartsAt) -> None:
    """Raise AssemblyError if an input that may change accelerations depends on them.

    This is the case if the component `part` has a method of `_AT_ONCE`, and an input is wired to a
    signal of accelerations or forces.
    """
    later = casadi.vertcat(SX(0, 1), *(later_signal(system, one) for one in later_sources(system)))
    if not later.numel() or not part.element.has(*_AT_ONCE):
        return
    for name, given in part.inputs.items():
        if isinstance(given, WireSource) and casadi.depends_on(at.signal(given), later):
            raise AssemblyError(
                f"a wire from {given} to {part.name}.{name} follows from the accelerations or"
                " forces of the motion itself; put a block with a state between them, such as a"
                " FirstOrder, or wire what positions and velocities give"
            )


def check_part(system: System, part: ComponentInstance, at: PartsAt) -> None:
    """Check one component; see `check_parts`.

    Args:
        system: system with the component.
        part: component to check.
        at: all components at symbols of positions and velocities.

    Raises:
        AssemblyError: the message names the component, the method and the remedy.
    """
    assert at.v is not None
    _Check(system, part, at, at.q, at.v).run()


class _Check:
    """Checks of one component.

    Args:
        system: system with the component.
        part: component to check.
        at: all components at the symbols q and v.
        q, v: symbols of positions and velocities.
    """

    def __init__(self, system: System, part: ComponentInstance, at: PartsAt, q: SX, v: SX) -> None:
        self.system, self.part, self.at, self.q, self.v = system, part, at, q, v
        self.element = part.element
        # inputs are free symbols, so that the checks are independent of the wires
        self.inputs = {name: SX.sym(name) for name in part.inputs}
        self.seen = at.with_inputs(part, self.inputs)

    def run(self) -> None:
        """Run all checks. Raise AssemblyError at the first fault."""
        energy, heat = self._scalar("energy"), self._scalar("dissipation")
        if energy is not None:
            self._require_free_of(energy, "energy", self.v, "velocities")
        loads = self._loads()
        modes = self.element.names_of("mode")
        rates = self._named("rates", [name for name in self.part.states if name not in modes])
        self._events(modes)
        self._rows()
        self._contacts()
        self._limits()
        if self.element.has("crossings"):
            self._crossings()
        self._figures()
        self._outputs()
        if loads and (energy is not None or heat is not None):
            self._compare_powers(loads, energy, heat, rates)

    # Checks of the returned values.

    def _result_of(self, method: str, at: At | None = None) -> Any:
        """Return the result of a method of the component, called with the symbolic motion `at`.

        An exception of the method becomes an AssemblyError that names it.
        """
        try:
            return getattr(self.element, method)(self.seen if at is None else at)
        except ExpressionError as error:  # a parameter self.k, not at.k, multiplies a symbol
            fault = one_line(str(error)).split(";")[0]
            raise AssemblyError(
                f"{self._title}: {method} raises {type(error).__name__}: {fault}; {_FROM_AT}"
            ) from error
        except MbsError:
            raise
        except Exception as error:
            remedy = _NO_TRUTH if "truth value" in str(error) else "correct it"
            raise AssemblyError(
                f"{self._title}: {method} raises {type(error).__name__}: {one_line(str(error))};"
                f" {remedy}"
            ) from error

    def _mapping(self, method: str, at: At | None = None) -> Mapping[str, Any]:
        """Return the dict that a method of the component returns.

        Raise AssemblyError if it is no dict.
        """
        found = self._result_of(method, at)
        if not isinstance(found, Mapping):
            raise AssemblyError(
                f"{self._title}: {method} returns {_value_text(found)}; return a dict by name"
            )
        return found

    def _loads(self) -> Mapping[str, Any]:
        """Return the loads of the component by port; raise AssemblyError if they are not valid.

        Without a method `loads` they are minus the derivatives of its energy. Empty if the
        component exerts no load.
        """
        if not self.element.acts:
            return {}
        if not self.element.has("loads"):
            return self.at.slopes(self.part, lambda at: -SX(self.element.energy(at)), self.inputs)
        found = self._mapping("loads")
        ports = [*self.element.frames, *self.part.coordinates]
        for port, load in found.items():
            if port not in ports:
                raise AssemblyError(
                    f"{self._title}: loads names {quoted(port)}, which is no port;"
                    f" {did_you_mean(str(port), ports)}"
                )
            if port in self.element.frames:
                self._require_wrench(port, load)
            else:
                self._value(f"loads at {port}", load)
        return found

    def _require_wrench(self, port: str, load: Any) -> None:
        """Raise AssemblyError unless the load of a frame port is a force and a moment (3, 1)."""
        if not isinstance(load, FrameLoad):
            raise AssemblyError(
                f"{self._title}: loads gives {_value_text(load)} at the frame {port}; give"
                " custom.force(...), custom.torque(...) or what custom.pull(...) returns"
            )
        for what, value in (("force", load.force), ("moment", load.moment)):
            if SX(value).shape != (3, 1):
                raise AssemblyError(
                    f"{self._title}: the {what} at {port} has the shape {SX(value).shape}; give"
                    " (3, 1)"
                )
            self._require_known(SX(value), f"loads at {port}")

    def _named(self, method: str, names: Iterable[str]) -> Mapping[str, SX]:
        """Return the values of a method of the component by name.

        Raise AssemblyError unless it returns exactly one value for each of `names`.
        """
        wanted = list(names)
        if not wanted and not self.element.has(method):
            return {}
        found = self._mapping(method)
        for name in wanted:
            if name not in found:
                raise AssemblyError(
                    f"{self._title}: {method} gives nothing for {name!r}; return one value for"
                    f" each of {', '.join(wanted)}"
                )
        for name in found:
            if name not in wanted:
                raise AssemblyError(
                    f"{self._title}: {method} gives {quoted(name)}, which is not declared;"
                    f" {did_you_mean(str(name), wanted) if wanted else 'declare it'}"
                )
        return {name: self._value(f"{method} of {name}", found[name]) for name in wanted}

    def _outputs(self) -> Mapping[str, SX]:
        """Return the outputs by name; raise AssemblyError unless each name has one value."""
        self.seen.__dict__["lam"] = self.at.row_efforts().get(self.part.name, {})
        return self._named("outputs", self.element.output_names)

    def _figures(self) -> None:
        """Raise AssemblyError if the drawing cannot be evaluated at default parameters."""
        known = {p.name: p.default for p in self.system.parameters if p.default is not None}
        try:
            self.element.drawn(known)
        except MbsError as error:
            raise AssemblyError(str(error)) from error
        except Exception as error:
            raise AssemblyError(
                f"{self._title}: figures raises {type(error).__name__}: {one_line(str(error))};"
                " make Shapes of numbers, such as Shape('sphere', (at.r,))"
            ) from error

    def _rows(self) -> None:
        """Check unit, symbols and number of the constraint rows; raise AssemblyError for a fault.

        Velocity rows must be linear in velocities. Rows must determine all unknowns.
        """
        count, bound = 0, list[SX]()
        for method in ("rows", "velocity_rows"):
            if not self.element.has(method):
                continue
            found = self._mapping(method)
            if not found:
                raise AssemblyError(f"{self._title}: {method} returns no row; give one by a label")
            for label, row in found.items():
                unit = row.unit if isinstance(row, Row) else "m"
                if unit not in ("m", "1"):
                    raise AssemblyError(
                        f"{self._title}: the row {label!r} has the unit {quoted(unit)}; use 'm' or"
                        " '1'"
                    )
                value = self._value(f"row {label!r}", row.value if isinstance(row, Row) else row)
                bound.append(value)
                signals = casadi.vertcat(self.system.component_states, *self.inputs.values())
                self._require_free_of(value, f"the row {label!r}", signals, "states or inputs")
                if method == "rows":
                    self._require_free_of(value, f"the row {label!r}", self.v, "velocities")
                else:
                    self._require_linear(label, value)
            count += len(found)
        unknowns = self.element.names_of("unknown")
        for name in unknowns if count else ():
            place = self.part.coordinates[name][0].position
            if place is not None and not casadi.depends_on(casadi.vertcat(*bound), self.q[place]):
                raise AssemblyError(
                    f"{self._title}: no row depends on the unknown {name!r}, which rows must"
                    " determine; use it in one, or leave it out"
                )
        if len(unknowns) > count:
            raise AssemblyError(
                f"{self._title}: the number of unknowns is {len(unknowns)} and that of rows"
                f" {count}, which do not determine them; give a row for each at least"
            )

    def _events(self, modes: Sequence[str]) -> None:
        """Check types and labels of events, and the states that they set.

        Raise AssemblyError for a fault. `modes` are the states that are modes; an event must set
        each of them.
        """
        set_somewhere: set[str] = set()
        for label, event in (self._mapping("events") if self.element.has("events") else {}).items():
            if not isinstance(event, Event):
                raise AssemblyError(
                    f"{self._title}: events gives {_value_text(event)} for {label!r}; give"
                    " custom.Event(when, {state: value})"
                )
            self._value(f"when of the event {label!r}", event.when)
            if not isinstance(event.then, Mapping):
                raise AssemblyError(
                    f"{self._title}: the event {label!r} sets {_value_text(event.then)}; give a"
                    " dict of states and modes, which may be empty"
                )
            for name, value in event.then.items():
                if name not in self.part.states:
                    raise AssemblyError(
                        f"{self._title}: the event {label!r} sets {quoted(name)}, which is no"
                        f" state or mode; {did_you_mean(str(name), self.part.states)}"
                    )
                self._value(f"{name} after the event {label!r}", value)
                set_somewhere.add(name)
        for name in modes:
            if name not in set_somewhere:
                raise AssemblyError(
                    f"{self._title}: no event sets the mode {name!r}; write events, or declare it"
                    " as a parameter"
                )

    def _contacts(self) -> None:
        """Check the labels and laws of frictions and stops; raise AssemblyError for a fault."""
        labels = dict[str, str]()
        for method, kinds, give in (
            ("stops", (Stop, OneWay), "custom.Stop(gap) or custom.OneWay(velocity)"),
            ("frictions", (Friction,), "custom.Friction(slip, limit)"),
        ):
            for label, law in (self._mapping(method) if self.element.has(method) else {}).items():
                if not isinstance(label, str):
                    raise AssemblyError(
                        f"{self._title}: {method} has the label {quoted(label)}; give a text"
                    )
                if not isinstance(law, kinds):
                    raise AssemblyError(
                        f"{self._title}: {method} gives {_value_text(law)} for {label!r};"
                        f" give {give}"
                    )
                if label in labels:
                    raise AssemblyError(
                        f"{self._title}: {labels[label]} and {method} have both the label"
                        f" {label!r}; choose another one"
                    )
                labels[label] = method
                self._contact(label, law)

    def _limits(self) -> None:
        """Raise AssemblyError unless `limits` returns pairs of constant expressions."""
        found = self._mapping("limits") if self.element.has("limits") else {}
        for port, pair in found.items():
            if port not in self.part.coordinates:
                raise AssemblyError(
                    f"{self._title}: limits names {quoted(port)}, which is no coordinate;"
                    f" {did_you_mean(str(port), self.part.coordinates)}"
                )
            if not isinstance(pair, (tuple, list)) or len(pair) != 2:
                raise AssemblyError(
                    f"{self._title}: limits gives {_value_text(pair)} for {port}; give (lower,"
                    " upper), None for no limit"
                )
            every = casadi.vertcat(
                self.q, self.v, self.system.component_states, *self.inputs.values()
            )
            for given in pair:
                if given is not None:
                    value = self._value(f"a limit of {port}", given)
                    self._require_free_of(value, f"a limit of {port}", every, "the motion")

    def _contact(self, label: str, law: Friction | Stop | OneWay) -> None:
        """Check the law of a stop, a friction or a one-way element, called `label`.

        Raise AssemblyError for a fault.
        """
        own = {*self.element.output_names, *self.part.states, *self.part.inputs}
        for column in ("mode", "effort"):
            if not label and column in own:
                raise AssemblyError(
                    f"{self._title}: {column!r} is a column of what has the empty label, and a"
                    " state, input or output; write a label"
                )
        if law.unit not in (None, "N", "N.m"):
            raise AssemblyError(
                f"{self._title}: the effort{_of_label(label)} has the unit {quoted(law.unit)}; use"
                " 'N' or 'N.m'"
            )
        if isinstance(law, Friction):
            self._contact_velocity("slip", label, law.slip)
            limit = self._value(f"limit{_of_label(label)}", law.limit)
            sticking = limit
            if law.sticking is not None:
                sticking = self._value(f"sticking{_of_label(label)}", law.sticking)
            remedy = "friction is a finite effort, never below zero; write casadi.fmax"
            self._require_range(f"the limit{_of_label(label)}", limit, 0.0, np.inf, remedy)
            remedy = "at rest friction holds at least its limit, so make it larger"
            at_rest = self._without_slip(law.slip, limit)
            sticking = self._without_slip(law.slip, sticking)
            self._require_range(f"sticking{_of_label(label)}", sticking, at_rest, np.inf, remedy)
        elif isinstance(law, OneWay):
            self._contact_velocity("velocity", label, law.velocity)
        else:
            self._stop(label, law)

    def _contact_velocity(self, what: str, label: str, given: Any) -> None:
        """Raise AssemblyError unless the contact velocity `given` is linear in v.

        Its constant term may depend on parameters only. `what` and `label` name it in the message.
        """
        name = f"the {what}{_of_label(label)}"
        value = self._value(name, given)
        signals = casadi.vertcat(self.system.component_states, self.system.u, *self.inputs.values())
        self._require_free_of(value, name, signals, "states or inputs")
        slopes = casadi.jacobian(value, self.v)
        if not slopes.nnz():
            raise AssemblyError(
                f"{self._title}: {name} does not depend on velocities; give a velocity, such as"
                " at.shaft.speed"
            )
        rest = casadi.simplify(casadi.substitute(value, self.v, SX.zeros(self.v.numel())))
        if casadi.depends_on(slopes, self.v) or casadi.depends_on(rest, self.q):
            raise AssemblyError(
                f"{self._title}: {name} is not linear in velocities, or follows at rest from"
                " positions; write a sum of velocities, each with a factor"
            )

    def _without_slip(self, slip: SX, value: SX) -> SX:
        """Return the expression `value` at the velocities nearest to v at which `slip` is zero."""
        slip = SX(slip)
        slopes = casadi.jacobian(slip, self.v).T
        nearest = self.v - slopes * slip / (casadi.sumsqr(slopes) + NONZERO)
        return casadi.substitute(value, self.v, nearest)

    def _stop(self, label: str, law: Stop) -> None:
        """Raise AssemblyError unless the gap of a stop depends on positions.

        Its limits may depend on parameters only. `label` names the stop in the message.
        """
        name = f"the gap{_of_label(label)}"
        gap = self._value(name, law.gap)
        signals = casadi.vertcat(self.system.component_states, self.system.u, *self.inputs.values())
        self._require_free_of(gap, name, signals, "states or inputs")
        self._require_free_of(gap, name, self.v, "velocities")
        if not casadi.depends_on(gap, self.q):
            raise AssemblyError(f"{self._title}: {name} does not depend on positions; give a gap")
        if law.lower is None and law.upper is None:
            raise AssemblyError(
                f"{self._title}: {name} has neither lower nor upper; give one limit or both"
            )
        every = casadi.vertcat(self.q, self.v, signals)
        values = {}
        for field in ("lower", "upper", "restitution", "rest_speed"):
            given = getattr(law, field)
            if given is not None:
                values[field] = self._value(f"{field}{_of_label(label)}", given)
                self._require_free_of(
                    values[field], f"{field}{_of_label(label)}", every, "the motion"
                )
        remedy = "give a number between 0 and 1"
        self._require_range(
            f"restitution{_of_label(label)}", values["restitution"], 0.0, 1.0, remedy
        )
        remedy, slowest = "give more than zero", values["rest_speed"]
        self._require_range(f"rest_speed{_of_label(label)}", slowest, NONZERO, np.inf, remedy)
        if "lower" in values and "upper" in values:
            remedy, high = "give more than lower", values["upper"]
            self._require_range(f"upper{_of_label(label)}", high, values["lower"], np.inf, remedy)

    def _require_range(
        self, what: str, value: SX, least: SX | float, greatest: SX | float, remedy: str
    ) -> None:
        """Raise AssemblyError if a value is not between `least` and `greatest` at a random state.

        It must also be finite. `what` is its name and `remedy` the remedy in the message.
        """
        symbols = casadi.vertcat(self.system.component_states, *self.inputs.values())
        given = [self.q, self.v, symbols, self.system.p]
        found = Function("range", given, [value, SX(least), SX(greatest)])
        for point in self._probes():
            x, low, high = (float(one) for one in found(*point))
            if not np.isfinite(x) or not low <= x <= high:
                raise AssemblyError(f"{self._title}: {what} is {x:.6g} at a random state; {remedy}")

    def _crossings(self) -> None:
        """Raise AssemblyError if an event indicator has unknown symbols or depends on inputs."""
        for label, given in self._mapping("crossings", self.at.at(self.part)).items():
            what, value = f"the crossing {label!r}", given
            if isinstance(given, Approach):
                value = given.value
                self._value(f"the pace of {what}", given.pace)
                if given.speed is not None:
                    self._value(f"the speed of {what}", given.speed)
            self._require_free_of(self._value(what, value), what, self.system.u, "inputs")

    def _scalar(self, method: str) -> SX | None:
        """Return the scalar expression of a method; None if the component has no such method."""
        if not self.element.has(method):
            return None
        return self._value(method, self._result_of(method))

    def _value(self, what: str, value: Any) -> SX:
        """Return a value as an expression (1, 1) of known symbols.

        Raise AssemblyError if it is none. `what` is its name in the message.
        """
        try:
            found = SX(value)
        except Exception:
            found = SX(0, 0)
        if found.shape != (1, 1):
            shape = "" if found.shape == (0, 0) else f" of the shape {found.shape}"
            of_self = isinstance(value, (Expression, Signal))
            raise AssemblyError(
                f"{self._title}: {what} is {_value_text(value)}{shape};"
                f" {_FROM_AT if of_self else 'give one number or expression'}"
            )
        self._require_known(found, what)
        return found

    # Checks of the symbols in expressions.

    def _require_known(self, value: SX, what: str) -> None:
        """Raise AssemblyError if an expression has symbols or operations that models do not accept.

        `what` is its name in the message.
        """
        known = casadi.vertcat(
            self.q,
            self.v,
            self.system.component_states,
            self.system.u,
            self.system.p,
            self.at.effort_symbols,
            *self.inputs.values(),
        )
        names = {symbol.element_hash() for symbol in casadi.vertsplit(known)}
        for symbol in casadi.symvar(value):
            if symbol.element_hash() not in names:
                raise AssemblyError(
                    f"{self._title}: {what} holds the symbol {symbol.name()!r}, which is none of"
                    " the component; declare it as a parameter, state or input"
                )
        graph = Function("asked", [known], [value])
        for k in range(graph.n_instructions()):
            if graph.instruction_id(k) == casadi.OP_CALL:
                raise AssemblyError(
                    f"{self._title}: {what} calls another Function, such as an interpolant, which"
                    " models do not take; write it by operations, such as casadi.pw_lin"
                )
            if graph.instruction_id(k) == casadi.OP_CONST and np.isnan(
                graph.instruction_constant(k)
            ):
                raise AssemblyError(
                    f"{self._title}: {what} holds a constant that is not a number; look for what"
                    " turns symbols into floats, such as math.sin, and write casadi.sin"
                )

    def _require_free_of(self, value: SX, what: str, symbols: SX, name: str) -> None:
        """Raise AssemblyError if a value depends on `symbols`.

        `what` and `name` are the names of the value and of the symbols in the message.
        """
        if symbols.numel() and casadi.depends_on(value, symbols):
            remedy = "; use velocity_rows" if "row" in what and name == "velocities" else ""
            raise AssemblyError(
                f"{self._title}: {what} depends on {name}, on which it must not depend{remedy}"
            )

    def _require_linear(self, label: str, value: SX) -> None:
        """Raise AssemblyError unless the velocity row `label` is linear in v and zero at rest."""
        slopes = casadi.jacobian(value, self.v)
        rest = casadi.substitute(value, self.v, SX.zeros(self.v.numel()))
        if casadi.depends_on(slopes, self.v) or not casadi.simplify(rest).is_zero():
            raise AssemblyError(
                f"{self._title}: the row {label!r} of velocity_rows is not linear in velocities"
                " alone, or does not vanish at rest; write a sum of velocities, each with a factor"
            )

    # Consistency of loads, energy and dissipation.

    def _compare_powers(
        self,
        loads: Mapping[str, Any],
        energy: SX | None,
        heat: SX | None,
        rates: Mapping[str, SX],
    ) -> None:
        """Check the power balance P = -dE/dt - D at random states; raise AssemblyError for a fault.

        P is the power of `loads` on the ports, E the `energy`, and D (`heat`) the dissipation.
        `rates` are the rates of the states of the component.
        """
        system, symbols = (
            self.system,
            casadi.vertcat(self.system.component_states, *self.inputs.values()),
        )
        E = SX(0) if energy is None else energy
        rate = casadi.jtimes(E, self.q, position_rate(system.tree, self.q, self.v))
        for name, value in rates.items():
            rate += casadi.gradient(E, self.part.states[name]) * value
        D = SX(0) if heat is None else heat
        powers = casadi.vertcat(self._power(loads), rate, D)
        given = [self.q, self.v, symbols, system.p]
        found = Function("powers", given, [casadi.densify(powers)])
        for q, v, s, p in self._probes():
            P, dE, heat_at = np.array(found(q, v, s, p))[:, 0]
            back = np.array(found(q, -v, s, p))[:, 0]
            sizes = np.abs([P, dE, heat_at])
            if not np.all(np.isfinite([*sizes, *back])):
                continue
            if heat_at < -_NEGATIVE * sizes.max():
                raise AssemblyError(
                    f"{self._title}: dissipation is {heat_at:.6g} W at a random state; what turns"
                    " into heat is never negative, so correct its sign"
                )
            if heat is not None and not self.part.inputs:
                self._require_balance(P, dE, heat_at, sizes.max())
            elif energy is not None and not self.part.states and not self.inputs:
                # for reversed velocities the power of friction and damping is equal, the power of
                # the energy is opposite
                self._require_balance((P - back[0]) / 2, (dE - back[1]) / 2, 0.0, sizes.max())

    def _require_balance(self, P: float, dE: float, heat: float, size: float) -> None:
        """Raise AssemblyError unless P + dE + heat is zero, relative to `size`; all in W."""
        if abs(P + dE + heat) > _SAME * size:
            raise AssemblyError(
                f"{self._title}: its loads have the power {P:.6g} W at a random state, but its"
                f" energy and dissipation say {-dE - heat:.6g} W; make them agree, or leave loads"
                " out, which then follow from the energy"
            )

    def _power(self, loads: Mapping[str, Any]) -> SX:
        """Return the power [W] of all loads of the component, for the velocities of its ports."""
        total = SX(0)
        for port, load in loads.items():
            seen = getattr(self.seen, port)
            if isinstance(load, FrameLoad):
                R = seen.R if load.own_axes else SX.eye(3)
                total += casadi.dot(casadi.mtimes(R, load.force), seen.v)
                total += casadi.dot(casadi.mtimes(R, load.moment), seen.w)
            elif isinstance(seen, SX):  # an unknown
                lever = self.part.coordinates[port][0]
                total += load * self.v[lever.velocity]
            else:
                total += load * (seen.speed if isinstance(seen, FlangeAt) else seen.v)
        return total

    def _probes(self) -> Iterable[tuple[Array, Array, Array, Array]]:
        """Yield four random (q, v, states of components followed by inputs, parameters)."""
        system, rng = self.system, np.random.default_rng(_SEED)
        p = np.array([1.0 if x.default is None else x.default for x in system.parameters])
        for _ in range(_PROBES):
            q = rng.uniform(-1.0, 1.0, system.nq)
            for part in quaternion_slices(system.tree):
                q[part] /= np.linalg.norm(q[part])
            states = np.array(system.component_start) + rng.uniform(
                -1.0, 1.0, len(system.component_start)
            )
            inputs = rng.uniform(-1.0, 1.0, len(self.inputs))
            v = rng.uniform(-1.0, 1.0, system.nv)
            yield q, v, np.concatenate([states, inputs]), p

    @property
    def _title(self) -> str:
        """Name and class of the component, for error messages."""
        return f"{self.part.name} ({type(self.element).__name__})"


def _of_label(label: str) -> str:
    """Return " of 'label'" for error messages; empty if the label is empty."""
    return f" of {label!r}" if label else ""


def _value_text(value: Any) -> str:
    """Return a short description of a value for error messages."""
    if value is None:
        return "nothing"
    if isinstance(value, SX):
        return "an expression"
    return f"a {type(value).__name__}" if not isinstance(value, (int, float)) else quoted(value)
