"""Simulation of open and closed systems, by compiled code if a C compiler is available.

A `Simulator` is one system with laws of efforts and motions, prepared once for many motions.
"""

from __future__ import annotations

import functools
import math
import pickle
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from casadi import Function
from numpy.typing import NDArray

from mbs.arguments import MadeOnce, names_given, values_given
from mbs.assembly import System
from mbs.assembly.model_function import require_system
from mbs.assembly.pickling import Packed, content_of, packed, unpacked
from mbs.assembly.variable_names import GUESSES, POSITIONS, like_degrees
from mbs.errors import Interrupted, ModelError
from mbs.loops.configuration import Guess, Start, Values, start, start_position, start_velocity
from mbs.models._inverse_dynamics import bias
from mbs.models.state.signals import (
    by_name,
    effort_function,
    given_inputs,
)
from mbs.models.state.tree import FullState, full_state
from mbs.options import arguments_of, group_values, method_arguments_of
from mbs.progress import progress
from mbs.result import (
    Result,
    State,
    device_states_of,
    state_of,
    velocities_of,
)
from mbs.simulate.arguments import count_steps, positive
from mbs.simulate.contact_motion import require_contacts_possible
from mbs.simulate.device_inputs import device_states, input_function
from mbs.simulate.equation_cache import cached_on_disk
from mbs.simulate.options import (
    InitialBranch,
    InitialMotion,
    IntegrationMethod,
    Laws,
    MotionArguments,
    ParameterValues,
    RunArguments,
    SimulatorArguments,
    Steps,
)
from mbs.simulate.prescribed import prescribed_motions, start_positions
from mbs.simulate.result_columns import ResultColumns, columns_of, require_state_of, result_of
from mbs.simulate.segments import integrate_segments, system_parameters
from mbs.simulate.tolerances import tolerances_of
from mbs.solvers.problem import METHODS
from mbs.text import quoted

Array = NDArray[np.float64]

_CACHE_SIZE = 8
"""Maximum number of cached state equations per system, enough for a script with a few laws; also
the maximum number of cached simulators, starts and sets of columns."""
_MIN_STEPS = 1000
"""Minimum number of steps of a motion under laws whose pulses cannot be located beforehand: a pulse
of one thousandth of the duration is not missed."""


def _is_opaque(law: Function | None) -> bool:
    """Return whether a law calls a Callback or an external function, whose code is opaque."""
    if law is None:
        return False
    names = [one.class_name() for one in (law, *law.find_functions())]
    return any("Callback" in name or "External" in name for name in names)


class Simulator(MadeOnce):
    """Simulator of one system under fixed laws, prepared once and called many times.

    The first call derives the state equation and compiles it. Both are cached with the system and
    on disk, so that another process reads them. A simulator can be pickled, and can be called from
    several threads at once.

    `simulator(duration, q0=..., inputs={"j1.tau": 2.0})` simulates one motion, as `run` does.
    """

    settings = ("system",)

    @method_arguments_of(SimulatorArguments)
    def __init__(self, options: SimulatorArguments) -> None:
        """Check and store the arguments that are common to all motions.

        Args:
            options: see `SimulatorArguments`.

        Raises:
            ModelError: `system` is not a System, a name is unknown, or a law has the wrong form.
        """
        system, method, outputs = options.system, options.method, options.outputs
        require_system(system)
        self.system = system
        self._motions = prescribed_motions(system, options.motion)
        require_contacts_possible(system, self._motions)
        self._effort = effort_function(system, options.tau)
        self._inputs = input_function(system, options.u)
        self._given = given_inputs(system, options.inputs)
        if not isinstance(method, str) or method not in METHODS:
            raise ModelError(
                f"{system.name}: method is {quoted(method)}; use {', or '.join(map(repr, METHODS))}"
            )
        self._method = method
        self._outputs = None
        if outputs is not None:
            self._outputs = names_given(f"{system.name}: outputs", outputs, "j1.q")
        columns = partial(columns_of, system, self._outputs)
        self._columns: ResultColumns = system.memoised(
            "columns", self._outputs, columns, _CACHE_SIZE
        )

    @property
    def inputs(self) -> tuple[str, ...]:
        """Full names of the inputs whose values can be set in a call."""
        return tuple(one.name for one in self._given)

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the columns of results."""
        return tuple(self._columns.units)

    def __repr__(self) -> str:
        return f"<Simulator {self.system.name}: {len(self.outputs)} signals>"

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the system and the laws. The derived equations are cached on disk."""
        laws = self._effort, self._inputs, tuple(self._motions)
        plain = self._given, self._outputs, self._method
        return _unpickled_simulator, packed((self.system, laws, plain))

    @method_arguments_of(MotionArguments)
    def __call__(self, options: MotionArguments) -> Result:
        """Simulate one motion.

        Args:
            options: see `MotionArguments`.

        Raises:
            ModelError, CompilerError, Unclosable, SolverError, Interrupted: as in `run`.
        """
        system, motions = self.system, self._motions
        duration = positive(options.duration, "duration [s]", system.name)
        allowed = tolerances_of(system, options.tolerance)
        longest = math.inf
        if options.max_step is not None:
            longest = positive(options.max_step, "max_step [s]", system.name)
        elif self._has_opaque_laws:
            longest = duration / _MIN_STEPS
        steps = count_steps(duration, positive(options.step, "step [s]", system.name), system.name)
        own = system.parameter_values(options.parameters)
        p = np.array([*own, *self._values(options.inputs)])
        begin, modes = 0.0, None
        q0, guess = state_of(options.q0), state_of(options.guess)
        speeds, devices = velocities_of(options.v0), device_states_of(options.z0)
        if isinstance(q0, State):
            require_state_of(system, q0)
            begin, modes = q0.time, np.array(q0.modes)
            devices = dict(q0.z) if devices is None else devices
        note = _degrees_note(system, q0, guess)
        z = device_states(system, devices)
        placed = start_positions(system, motions, q0, speeds, z, own, begin)
        x0 = np.concatenate([*_consistent_start(system, *placed, p, guess), z])
        times = np.linspace(begin, begin + duration, steps + 1)
        rtol, atol, sizes = allowed.of_step()
        with progress(f"simulating {system.name}", 0.0, duration, quiet=options.quiet) as reached:
            segments, stop = integrate_segments(
                system,
                self._equations,
                x0,
                times,
                p,
                modes,
                method=self._method,
                rtol=rtol,
                atol=atol,
                sizes=sizes,
                max_step=longest,
                progress=reached,
            )
        if motions and segments[0].first_slope is not None:
            H = _start_bias(system, x0, self._inputs, system_parameters(system, p))
            driven = tuple(motion.velocity for motion in motions)
            segments[0] = replace(segments[0], driven=driven, first_bias=H)
        result = partial(result_of, system, segments, p, stop, self._columns, allowed, note)
        if isinstance(stop, Interrupted):  # deferred: slow laws make the rows slow
            stop.compute = result
            raise stop
        if stop is not None:
            stop.result = result()
            raise stop
        return result()

    def _values(self, inputs: Mapping[str, float] | None) -> list[float]:
        """Return the values of `self.inputs`, in order; defaults if no value is given."""
        inputs = values_given(f"{self.system.name}: inputs", inputs, '"j1.tau": 2.0')
        if not inputs:
            return [one.default for one in self._given]
        quantities = [(one.name, "") for one in self._given]
        if not quantities:
            raise ModelError(
                f"{self.system.name}: inputs are given, but the simulator has none; name them when"
                f" it is made: Simulator(system, inputs=[{quoted(next(iter(inputs)))}])"
            )
        defaults = [one.default for one in self._given]
        return list(by_name(self.system, "inputs", inputs, quantities, defaults))

    @functools.cached_property
    def _has_opaque_laws(self) -> bool:
        """Whether pulses of the laws cannot be located beforehand."""
        return _is_opaque(self._effort) or _is_opaque(self._inputs)

    @functools.cached_property
    def _key(self) -> Packed | None:
        """Cache key of the laws; None if they contain machine code, which has no text form."""
        return content_of((self._effort, self._inputs, tuple(self._motions), self._given))

    def content(self) -> bytes:
        """Return a cache key of system and laws that is the same in every process.

        If the laws or components contain user-defined Python code, it is the pickled equation.
        """
        known = self.system.fingerprint(), self._key
        if None not in known:
            return repr(known).encode()
        return pickle.dumps(replace(self._equations(self.system), prepared={}))

    def _equations(self, system: System) -> FullState:
        """Return the state equation of the system, or of a copy with other independent rows."""
        laws = self._effort, self._inputs, self._motions, self._given
        if self._key is None:
            return full_state(system, *laws)

        def build() -> FullState:
            return cached_on_disk(system, self._key, lambda: full_state(system, *laws))

        found: FullState = system.memoised("state equations", self._key, build, _CACHE_SIZE)
        return found


def _unpickled_simulator(*state: Any) -> Simulator:
    """Restore a pickled simulator."""
    system, (effort, inputs, motions), (given, outputs, method) = unpacked(*state)
    made = Simulator(system, [one.name for one in given], outputs, method=method)
    made._effort, made._inputs, made._motions = effort, inputs, list(motions)
    return made


def _degrees_note(system: System, q0: Start, guess: Guess) -> str:
    """Return a note on starts and guesses that look like degrees; empty text if q0 is a state."""
    if isinstance(q0, State | Result):
        return ""
    given: dict[str, float] = {}
    if isinstance(guess, Mapping):
        given.update(system.plain_names(guess, GUESSES))
    if isinstance(q0, Mapping):
        given.update(system.plain_names(q0, POSITIONS))
    elif q0 is not None:
        names = (coordinate.name for coordinate in system.coordinates)
        given.update(zip(names, system.position(q0), strict=True))
    return like_degrees([*system.coordinates, *system.cut_coordinates], given)


def _consistent_start(
    system: System,
    q0: Start,
    v0: Values,
    p: Array,
    guess: Guess,
) -> tuple[Array, Array]:
    """Return the initial positions and velocities; the last few results are cached.

    Positions are also cached alone: starts that differ in velocities close the loops once.
    """
    own = system_parameters(system, p)
    named = dict(zip((one.name for one in system.parameters), own, strict=True))
    if guess is not None or isinstance(q0, State):
        return start(system, q0, v0, named, guess)
    try:
        positions, velocities = (
            tuple(sorted(dict(given).items())) if isinstance(given, Mapping) else given
            for given in (q0, v0)
        )
        hash((positions, velocities))
    except (TypeError, NotImplementedError):  # lists, arrays, DM and invalid values
        return start(system, q0, v0, named)

    def position() -> Array:
        return start_position(system, q0, named)

    def build() -> tuple[Array, Array]:
        q: Array = system.memoised("start positions", (positions, *own), position, _CACHE_SIZE)
        return q, start_velocity(system, q, v0, named)

    key = (positions, velocities, *own)
    found: tuple[Array, Array] = system.memoised("starts", key, build, _CACHE_SIZE)
    return found


@arguments_of(RunArguments)
def run(options: RunArguments) -> Result:
    """Simulate a system from initial positions and velocities under joint efforts and motions.

    The forward dynamics are integrated by a one-step method with error control. After every step,
    positions and velocities are projected onto the independent closure rows, so that the loops do
    not drift. A step is accepted if all closure rows are satisfied.

    An error or control-C during the integration raises an exception with the attribute `result`:
    a `Result` of the rows before the stop. Its `stopped` contains the time and the error message.

    Args:
        options: see `RunArguments`.

    Returns:
        Result with `name.q`, `name.v`, `name.a` and `name.tau` of every coordinate, and
        `kinetic_energy`, `potential_energy`, `closure_residual`. Every device has its input, states
        and outputs, such as `motor.voltage`, `motor.i`, `motor.tau`, `motor.w`; every sensor has
        its readings, such as `tip.p.x`. A rigid stop or Coulomb friction has `name.mode` and
        `name.effort`, and `events` lists the times of its changes.

    Raises:
        ModelError: `system` is not a System, a name is unknown or has no motor, or an argument has
            the wrong type or size.
        CompilerError: the compiler named by the environment variable CC does not start.
        Unclosable: the loops cannot be closed at these positions.
        SolverError: the integration cannot continue. The message contains the time and the reason,
            `result` the rows that were reached.
        Interrupted: control-C was pressed. It is a KeyboardInterrupt; `result` contains the rows
            that were reached.
    """
    simulator = simulator_of(options.system, **group_values(options, Laws, IntegrationMethod))
    given = group_values(options, InitialMotion, InitialBranch, ParameterValues, Steps)
    return simulator(options.duration, **given, quiet=options.quiet)


def simulator_of(system: System, inputs: Sequence[str] = (), **laws: Any) -> Simulator:
    """Return a simulator for these laws; simulators of constant laws are cached.

    Args:
        system: open or closed system.
        inputs: names of inputs, as in `Simulator`.
        laws: keyword arguments tau, motion, u and method of `Simulator`.
    """

    def build() -> Simulator:
        return Simulator(system, inputs, **laws)

    require_system(system)
    key = list(names_given(f"{system.name}: inputs", inputs, "j1.tau"))
    for name, law in laws.items():
        if law is None or type(law) is str:
            key.append(f"{name} {law}")
            continue
        # a function may return another value in the next call
        if type(law) is not dict or any(type(value) not in (int, float) for value in law.values()):
            return build()
        key.append(f"{name} {law}")  # with all digits, and the signs of zeros
    found: Simulator = system.memoised("simulators", tuple(key), build, _CACHE_SIZE)
    return found


def _start_bias(system: System, x0: Array, inputs: Function | None, p: Array) -> Array:
    """Return the efforts of gravity and velocities (bias) at the start, (nv,)."""
    n = system.nq + system.nv
    q, v = x0[: system.nq], x0[system.nq : n]
    u = system.u_default if inputs is None else np.array(inputs(0, q, v, p)).ravel()
    point = {"q": q, "v": v, "z": x0[n:], "u": u, "p": p}
    found = bias(system, "tree")
    return np.array(found(*(point[name] for name in found.name_in())))[:, 0]
