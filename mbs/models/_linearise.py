"""Linear state-space equations of small motions about any state: A, B, C and D.

The states are small displacements of the free coordinates, then independent velocities, then states
of components. A quaternion joint has a rotation vector in its own axes. Loops stay closed.

Source: Haug 1989 for coordinates on a manifold; Meijaard, Papadopoulos, Ruina and Schwab 2007 for
rolling, where more positions are free than velocities.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi
import numpy as np
from casadi import DM, SX, Function
from numpy.typing import NDArray

from mbs.arguments import names_given, values_given
from mbs.assembly import System
from mbs.assembly.component_instances import Quantity
from mbs.assembly.model_function import Named, model_function, require_system
from mbs.assembly.tables import ACCELERATION_UNIT, EFFORT_UNIT
from mbs.assembly.tree import position_rate
from mbs.errors import ModelError
from mbs.loops.closure_equations import closure_rows, independent_closure
from mbs.loops.configuration import Guess, Start, Values
from mbs.loops.velocity import velocity_rows
from mbs.models._dae import driving, motors, start_values
from mbs.models._direct_dynamics import independent_dynamics
from mbs.models._joint_wrenches import shown_outputs
from mbs.models._measurements import readings, with_readings
from mbs.models.contacts import (
    KINDS,
    ContactEquations,
    contact_equations,
    contacts_of,
    require_lasting_rows,
    require_no_contacts,
)
from mbs.models.symbols import (
    ModelSymbols,
    derivatives_check,
    outputs_of,
    part_equations,
    surroundings,
    symbols_of,
)
from mbs.result import Result, State
from mbs.solvers.linear import solve_square
from mbs.text import did_you_mean, quoted

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class LinearModel:
    """Linear model dx/dt = A x + B u, y = C x + D u of small changes about a state.

    If the state is not an equilibrium, x is the difference between two motions near it.

    Attributes:
        A: (n, n) state matrix.
        B: (n, m) input matrix.
        C: (k, n) output matrix.
        D: (k, m) feedthrough matrix.
        x, u, y: name and unit of each state, input and output.
    """

    A: Array
    B: Array
    C: Array
    D: Array
    x: tuple[Quantity, ...]
    u: tuple[Quantity, ...]
    y: tuple[Quantity, ...]

    @property
    def eigenvalues(self) -> NDArray[np.complex128]:
        """(n,) eigenvalues of A [1/s], sorted by real part, then by imaginary part."""
        values = np.linalg.eigvals(self.A).astype(complex)
        return values[np.lexsort((values.imag, values.real))]


@dataclass(frozen=True, slots=True, eq=False)
class Linearisation:
    """Linear equations of a system as functions of the state; `at` evaluates them.

    Attributes:
        system: the linearised system.
        function: `linear(q, v, tau) -> A, B, C, D` on numbers or symbols. Component states z,
            component inputs u and parameters p are further inputs if the system has any; tau
            (nv, 1) are the joint efforts of the tree.
        x, u, y: name and unit of states, inputs and outputs.
        holds: Function (same inputs) -> zero (2 k, 1), positive (5 k, 1). The k contacts are in the
            requested mode if these are zero and positive. None for a system without contacts.
        contacts: description of each element of `zero` and of `positive`, for error messages.
    """

    system: System
    function: Function
    x: tuple[Quantity, ...]
    u: tuple[Quantity, ...]
    y: tuple[Quantity, ...]
    holds: Function | None = None
    contacts: tuple[tuple[str, ...], tuple[str, ...]] = ((), ())

    def at(
        self,
        q0: Start = None,
        v0: Start = None,
        tau0: Values = None,
        states: Mapping[str, float] | State | Result | None = None,
        inputs: Mapping[str, float] | None = None,
        parameters: Mapping[str, float] | None = None,
        guess: Guess = None,
    ) -> LinearModel:
        """Evaluate the linear model about one state.

        Args:
            q0: positions by name; other positions are as assembled, and the loops are closed. Or a
                `State`, which also supplies velocities and component states that are not given.
            v0: velocities by name; zero by default.
            tau0: efforts of motors by name; zero by default.
            states: component states by name, such as `motor.i`, or by component name if it has a
                single state. Other states have their described values.
            inputs: component inputs by name, such as `motor.voltage` or `motor`.
            parameters: values of symbols; other symbols have their defaults.
            guess: approximate positions of other joints, which select the assembly branch.

        Raises:
            ModelError: a name is unknown, a symbol has no value, or the contacts are not in the
                requested `mode` in this state.
            Unclosable: the loops cannot be closed at q0.
        """
        system = self.system
        point = start_values(system, q0, v0, tau0, states, inputs, parameters, guess)
        point["v_a"] = point["v"][list(system.independent)]
        if self.holds is not None:
            self._require_mode(*(point[name] for name in self.holds.name_in()))
        found = self.function(*(point[name] for name in self.function.name_in()))
        A, B, C, D = (np.array(value) for value in found)
        return LinearModel(A, B, C, D, self.x, self.u, self.y)

    def _require_mode(self, *point: Any) -> None:
        """Raise ModelError if the contacts at a state are not in the requested mode.

        `point` are the numeric inputs of `holds`.
        """
        assert self.holds is not None
        zero, positive = (np.array(value).ravel() for value in self.holds.call(point))
        still, kept = self.contacts
        for name, value in zip(still, zero, strict=True):
            if not abs(value) <= _STILL:
                raise ModelError(
                    f"{self.system.name}: {name} is {value:.6g} in this state, and zero in the mode"
                    " that was asked for; give another state or mode"
                )
        for name, value in zip(kept, positive, strict=True):
            if not value > -_STILL:
                raise ModelError(
                    f"{self.system.name}: in this state it happens at once that {name}; give"
                    " another state or mode"
                )


_STILL = 1e-6
"""Tolerance on the velocity of a sticking contact and on the distance from a limit [SI units]: a
user writes a state with six digits."""


def linearise(
    system: System,
    outputs: Sequence[str] | None = None,
    mode: Mapping[str, float] | None = None,
) -> Linearisation:
    """Return the linearised equations of motion as functions of the state.

    Loops and rolling constraints are included.

    A sticking contact keeps one velocity at zero, which adds a zero eigenvalue.

    Source: Haug 1989; Meijaard, Papadopoulos, Ruina and Schwab 2007 for rolling.

    Args:
        system: open or closed mechanism.
        outputs: names of y: positions "j1.q", velocities "j1.v", accelerations "j1.a", sensor
            signals such as "tip.p.x", component outputs such as "spring.force". By default the
            positions and velocities of all coordinates.
        mode: contact modes of rigid stops and dry frictions by name, such as "clutch" or
            "belt.grip", as in column `mode` of `mbs.simulate.run`. Friction: direction of sliding,
            0 if it sticks. Stop: -1 or 1 at a limit, 0 between. Default of each: 0.

    Raises:
        ModelError: an output or an element is unknown, or the system has contacts or events and
            `mode` is None.
    """
    require_system(system)
    if mode is None:
        require_no_contacts(system, "linearise without mode=")
    modes = _mode_numbers(system, values_given(f"{system.name}: mode", mode, '"clutch": 0'))
    known = _output_units(system)
    names = list(known)[: system.nq + system.nv]
    if outputs is not None:
        names = list(names_given(f"{system.name}: outputs", outputs, names[0]))
    for name in names:
        if name not in known:
            raise ModelError(
                f"{system.name}: there is no output {quoted(name)} to linearise;"
                f" {did_you_mean(str(name), known)}"
            )

    def build() -> tuple[Named, Named]:
        s = symbols_of(system)
        tau = SX.sym("tau", system.nv)
        A, B, C, D = _matrices(system, s, tau, names, modes)
        inputs = [("q", s.q), ("v" + s.suffix, s.v), ("tau", tau)]
        return inputs, [("A", A), ("B", B), ("C", C), ("D", D)]

    def held() -> tuple[Named, Named]:
        s = symbols_of(system)
        tau = SX.sym("tau", system.nv)
        found = _contact_in_modes(system, s, tau + part_equations(system, s.q, s.v_tree)[0], modes)
        assert found is not None
        contact, (positive, stuck) = found
        still = stuck * contact.state.velocity
        away = contact.contacts.distance(s.q, SX(DM(modes[: len(contact.contacts)])))
        inputs = [("q", s.q), ("v" + s.suffix, s.v), ("tau", tau)]
        return inputs, [("zero", casadi.vertcat(still, away)), ("positive", positive)]

    check = derivatives_check(system, "independent")
    function = model_function(system, ("linear", *modes, *names), build, check)
    holds: Function | None = None
    words: tuple[tuple[str, ...], tuple[str, ...]] = ((), ())
    if modes:
        holds = model_function(system, ("holds", *modes), held, check)
        words = _condition_texts(system)
    free = [system.velocity_coordinates[k] for k in system.chosen_coordinates]
    active = [system.velocity_coordinates[k] for k in system.independent]
    x = [(f"{row.name}.q", row.unit.removesuffix("/s")) for row in free]
    x += [(f"{row.name}.v", row.unit) for row in active]
    driven = [system.velocity_coordinates[k] for k in motors(system)]
    u = [(f"{row.name}.tau", EFFORT_UNIT[row.unit]) for row in driven]
    return Linearisation(
        system,
        function,
        (*x, *system.states),
        (*u, *system.inputs),
        tuple((name, known[name]) for name in names),
        holds,
        words,
    )


def _mode_numbers(system: System, mode: Mapping[str, float]) -> tuple[float, ...]:
    """Return the 2 k modes of the k contact rows: limits, then directions of sliding.

    `mode` is given by name; other modes are 0. Raise ModelError for unknown names or other values.
    """
    contacts = contacts_of(system)
    require_lasting_rows(system, contacts)
    names = [element.name for _, element in contacts.elements]
    for name, value in mode.items():
        if name not in names:
            raise ModelError(
                f"{system.name}: mode has {quoted(name)}, which is no rigid stop or dry friction;"
                f" {did_you_mean(str(name), names)}"
            )
        if value not in (-1, 0, 1):
            raise ModelError(f"{system.name}: the mode of {name} is {value!r}; give -1, 0 or 1")
    modes = [0.0] * (2 * len(contacts))
    for k, element in contacts.elements:
        modes[k] = float(mode.get(element.name, 0))
    return tuple(modes)


def _condition_texts(system: System) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return descriptions of the elements of `zero` and `positive` of `holds`, for messages."""
    contacts = contacts_of(system)
    still = [f"the velocity on which {name} acts" for name in contacts.names]
    still += [f"the distance of {name} from its limit" for name in contacts.names]
    told = {
        "lower": "is below a limit",
        "upper": "is above a limit",
        "pulled": "must pull, or hold more than it can",
        "pushed": "must push, or hold more than it can",
        "stopped": "slides the other way",
    }
    return tuple(still), tuple(f"{name} {told[kind]}" for kind in KINDS for name in contacts.names)


def _contact_in_modes(
    system: System, s: ModelSymbols, tau: SX, modes: Sequence[float]
) -> tuple[ContactEquations, tuple[SX, SX]] | None:
    """Return the contact equations with the mode symbols replaced by the numbers `modes`.

    The second result are the indicators that must be positive (5 k, 1) and the flags of stuck rows
    (k, 1). None for a system without contacts.
    """
    found = contact_equations(system, s.q, s.v_tree, tau, {})
    if found is None:
        return None
    values = [found.a, found.pushes, found.indicators, found.modes.stuck]
    a, pushes, indicators, stuck = casadi.substitute(values, [found.values], [SX(DM(modes))])
    return replace(found, a=a, pushes=pushes), (indicators, stuck)


def _output_units(system: System) -> dict[str, str]:
    """Return the unit of each possible output, by its name."""
    found = {f"{row.name}.q": row.unit for row in system.coordinates}
    found |= {f"{row.name}.v": row.unit for row in system.velocity_coordinates}
    found |= {f"{row.name}.a": ACCELERATION_UNIT[row.unit] for row in system.velocity_coordinates}
    found |= {name: unit for sensor in system.sensors for name, unit in sensor.columns}
    return found | dict(system.outputs)


def _matrices(
    system: System, s: ModelSymbols, tau: SX, names: Sequence[str], modes: Sequence[float]
) -> tuple[SX, SX, SX, SX]:
    """Return the matrices A, B, C and D of the linearised state equations and outputs.

    Args:
        system: mechanism.
        s: symbols of the model.
        tau: (nv, 1) symbols of joint efforts, to which component efforts are added.
        names: names of the requested outputs.
        modes: mode of each contact.
    """
    q, v_a, v = s.q, s.v, s.v_tree
    efforts, given, rates = driving(system, q, v, resolved=False)
    motor_efforts = efforts[: efforts.numel() - system.u.numel()]
    every = tau + given
    # the independent accelerations
    contact = _contact_in_modes(system, s, every, modes)
    if contact is None:
        pushed = s.reduced_effort(every) if s.reduction is not None else every
        (a_a,) = outputs_of(system, independent_dynamics(system), q, v_a, pushed)
    else:
        a_a, every = contact[0].a[list(system.independent)], every + contact[0].pushes
    a = s.tree_acceleration(a_a)
    (rates,) = with_readings(system, [rates], (q, v, a, every))
    # position change dq = T dxi for small displacements xi of the free coordinates
    speed = SX.sym("v", system.nv)
    N = casadi.jacobian(position_rate(system.tree, q, speed), speed)
    T = casadi.mtimes(N, _free_tangents(system, q))
    rate = position_rate(system.tree, q, v)
    back = _left_inverse(system, N)
    # T' xi + T xi' = d(rate)/dq T xi + d(rate)/dv_a dv_a, projected on the free coordinates
    turning = casadi.jtimes(casadi.vec(T), q, rate)
    A11 = casadi.mtimes(
        back, casadi.mtimes(casadi.jacobian(rate, q), T) - casadi.reshape(turning, *T.shape)
    )
    A12 = casadi.mtimes(back, casadi.jacobian(rate, v_a))

    def slopes(value: SX) -> tuple[SX, SX]:
        """Derivatives of an expression with respect to the states and to the inputs."""
        along = [
            casadi.mtimes(casadi.jacobian(value, q), T),
            casadi.jacobian(value, v_a),
            casadi.jacobian(value, system.component_states),
        ]
        inputs = [casadi.jacobian(value, motor_efforts), casadi.jacobian(value, system.u)]
        return casadi.horzcat(*along), casadi.horzcat(*inputs)

    A2, B2 = slopes(casadi.densify(a_a))
    A3, B3 = slopes(casadi.densify(rates))
    C, D = slopes(casadi.densify(_outputs(system, s, a, every, names)))
    first = casadi.horzcat(A11, A12, SX(A11.shape[0], system.component_states.numel()))
    A = casadi.vertcat(first, A2, A3)
    B = casadi.vertcat(SX(A11.shape[0], efforts.numel()), B2, B3)
    # tau contains the motor efforts; their symbols only served to differentiate
    zero = SX.zeros(*motor_efforts.shape)  # shape (1, 0) for a system without motors
    return tuple(  # type: ignore[return-value]
        SX(value) for value in casadi.substitute([A, B, C, D], [motor_efforts], [zero])
    )


def _free_tangents(system: System, q: SX) -> SX:
    """Return tree velocities (nv, m) for unit rates of the free coordinates, with closed loops."""
    free = list(system.chosen_coordinates)
    if system.closure is None:
        return SX(DM.eye(system.nv))
    others = [k for k in range(system.nv) if k not in free]
    phi = closure_rows(system, q) if system.closure.varies else independent_closure(system, q)
    J = velocity_rows(system, q, phi)
    T = SX.zeros(system.nv, len(free))
    T[free, :] = SX(DM.eye(len(free)))
    if others:
        left = J[:, others]
        mixed = left.T if system.closure.varies else SX(DM.eye(J.shape[0]))
        T[others, :] = -solve_square(
            casadi.mtimes(mixed, left), casadi.mtimes(mixed, casadi.densify(J[:, free]))
        )
    return T


def _left_inverse(system: System, N: SX) -> SX:
    """Return a left inverse (m, nq) of N: maps dq/dt to the rates of the m free coordinates."""
    # columns of N are orthogonal; the columns of a quaternion have the squared length 1/4
    sizes = casadi.sum1(N * N)
    inverse = casadi.mtimes(casadi.diag(1 / sizes.T), N.T)
    return inverse[list(system.chosen_coordinates), :]


def _outputs(system: System, s: ModelSymbols, a: SX, tau: SX, names: Sequence[str]) -> SX:
    """Return the expressions (k, 1) of the outputs `names`.

    `a` (nv, 1) are the accelerations and `tau` (nv, 1) the joint efforts of the tree.
    """
    values: dict[str, SX] = {}
    for k, coordinate in enumerate(system.coordinates):
        values[f"{coordinate.name}.q"] = s.q[k]
    for k, row in enumerate(system.velocity_coordinates):
        values[f"{row.name}.v"], values[f"{row.name}.a"] = s.v_tree[k], a[k]
    if any(name not in values for name in names):
        if system.sensors:
            in_tree = tau if system.is_closed else None
            read = dict(readings(system, s, a, in_tree, surroundings(system)))
            for sensor in system.sensors:
                columns = iter(sensor.columns)
                for output, quantity in sensor.outputs:
                    elements = casadi.vertsplit(casadi.vec(casadi.densify(read[output])))
                    for element in elements[: len(quantity.elements)]:
                        values[next(columns)[0]] = element
        *_, parts = part_equations(system, s.q, s.v_tree)
        shown = casadi.vertsplit(shown_outputs(system, parts, a, tau))
        values |= dict(zip((name for name, _ in system.outputs), shown, strict=True))
    return casadi.vertcat(SX(0, 1), *(values[name] for name in names))
