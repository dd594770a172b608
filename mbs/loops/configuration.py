"""Configurations that close the loops, and initial positions and velocities of a motion."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence

import numpy as np

from mbs.assembly import System
from mbs.assembly.model_function import require_system
from mbs.assembly.validity import plain_fault
from mbs.assembly.variable_names import GUESSES, POSITIONS, VELOCITIES, like_degrees
from mbs.errors import LoopError, ModelError, Unclosable
from mbs.loops._function import configuration_on, fixed_positions, independent_names
from mbs.loops.balance import GROUP
from mbs.loops.closing import (
    OPEN,
    Closed,
    Closing,
    Vector,
    closure_parameters,
    distance_units,
    follow_configuration,
    unwound,
)
from mbs.loops.closure_equations import position_rows
from mbs.loops.cut_positions import cut_positions_and_slopes
from mbs.loops.guess_target import GuessTarget
from mbs.loops.nearest import nearest_configuration
from mbs.loops.velocity import closure_jacobian, constraint_drift_at
from mbs.result import Result, State, positions_of, state_of, velocities_of
from mbs.solvers.least_squares import smallest_solution
from mbs.solvers.rank import RELATIVE_GAP, null_space
from mbs.text import did_you_mean, quoted

Values = Mapping[str, float] | Sequence[float] | None
"""Positions or velocities by name, or all of them in order."""

Start = Values | State | Result
"""Positions or velocities, or a state. For a `Result`, the last state is used."""

Guess = Mapping[str, float] | State | Result | None
"""Approximate positions by name, or a state with positions."""

_RESTARTS = 60
_SEED = 20260101
_LARGEST_ANGLE = np.pi


def solve(
    system: System,
    q_active: Start = None,
    *,
    guess: Guess = None,
    branch: str | Sequence[str] | None = None,
    parameters: Mapping[str, float] | None = None,
) -> Vector:
    """Return a configuration that closes the loops and has the given positions.

    If all positions are given by name and close the loops, they are returned unchanged. Without a
    guess, the given positions move on a straight line from the assembled configuration, and the
    others follow on the constraint manifold, in steps that keep the branch. With a guess, the
    nearest configuration is returned. If the guess contains all positions and closes the loops, the
    path starts from it. With a branch, closed forms are used (`mbs.loops.function`).

    Args:
        system: assembled mechanism.
        q_active: positions of the independent joints in the order of
            `system.chosen_coordinates`, or positions of any joints by name, or a `State`. Missing
            independent joints keep their assembled positions. If all independent joints are given,
            further joints select the branch and are checked.
        guess: approximate positions of other joints, cut joints included, which select the branch.
            The joints keep these values if the loops leave a motion for that.
        branch: labels from `mbs.loops.assembly_modes`, such as "j3:+", instead of a guess. A loop
            without a label keeps its assembled branch. Only independent joints can be given then.
        parameters: values of symbols by name. Missing symbols have their default values.

    Returns:
        q (nq,) [rad or m].

    Raises:
        Unclosable: no configuration was found, or the branch ends before the given positions. The
            message lists the configurations that have these positions.
        LoopError: all positions are given and leave the loops open.
        NoClosedForm: a branch is given, but a loop can be solved by iteration only.
        ModelError: a name is unknown, a value is not finite, or guess and branch are both given.
    """
    require_system(system)
    given: Values = system.plain_names(positions_of(q_active), POSITIONS)
    guess = system.plain_names(positions_of(guess), GUESSES)
    if not isinstance(guess, Mapping | None):
        raise ModelError(
            f"{system.name}: guess is {quoted(guess)}; give a dict of coordinate names to values"
        )
    if branch is not None:
        if guess:
            raise ModelError(f"{system.name}: guess and branch both choose the branch; give one")
        return configuration_on(system, given, branch, parameters)
    fixed = fixed_positions(system, given)
    try:
        return _closed(system, fixed, guess or {}, parameters)
    except Unclosable as error:
        rows = [*system.coordinates, *system.cut_coordinates]
        note = like_degrees(rows, {**(guess or {}), **fixed})
        raise (Unclosable(f"{error}; {note}") if note else error) from None


def _closed(
    system: System,
    fixed: dict[str, float],
    guess: Mapping[str, float],
    parameters: Mapping[str, float] | None,
) -> Vector:
    """Return the closed configuration (nq,) for positions by name; implementation of `solve`.

    Args:
        system: assembled mechanism.
        fixed: positions that the result must have, by coordinate name.
        guess: approximate positions by coordinate name, cut joints included.
        parameters: values of symbols by name.
    """
    p = closure_parameters(system, parameters)
    at_cut = system.positions_at_cuts(guess)
    own = {name: value for name, value in guess.items() if name not in at_cut}
    known = [row.name for row in (*system.coordinates, *system.cut_coordinates)]
    for name in own:
        if name not in known:
            raise ModelError(
                f"{system.name}: there is no coordinate {name!r}; {did_you_mean(name, known)}"
            )
    target = np.array(system.position({**own, **fixed}))
    if not system.is_closed:
        return target
    if len(fixed) == system.nq:
        _require_joined(Closing(system, p), target)
        return target
    names = independent_names(system)
    if all(name in names for name in fixed):
        fixed = {**dict.fromkeys(names, 0.0), **fixed}
    elif set(names) <= set(fixed):
        return _with_dependent_positions(system, target, fixed, {**guess, **at_cut}, p)
    locked = tuple(_indices(system, fixed))
    if not guess:
        return follow_configuration(system, target, locked, p)
    if set(_coordinate_names(system)) <= set(guess):
        origin = np.array(system.position(own))
        if Closing(system, p).openness(origin) <= OPEN:
            return follow_configuration(system, target, locked, p, (origin, p))
    named = {name: x for name, x in guess.items() if name not in fixed}
    return _guessed_configuration(Closing(system, p, locked), target, {**named, **at_cut})


def _coordinate_names(system: System) -> list[str]:
    """Return the names of the coordinates of the tree, in the order of q."""
    return [coordinate.name for coordinate in system.coordinates]


def _indices(system: System, names: Collection[str]) -> list[int]:
    """Return the indices in q of named coordinates."""
    return [k for k, c in enumerate(system.coordinates) if c.name in names]


def _with_dependent_positions(
    system: System,
    target: Vector,
    fixed: Mapping[str, float],
    guess: Mapping[str, float],
    p: Vector,
) -> Vector:
    """Return the configuration for all independent and some dependent positions, which are checked.

    Raises:
        Unclosable: the loops give the dependent joints other positions.

    Args:
        system: mechanism with closed loops.
        target: (nq,) required and approximate positions.
        fixed: required positions by name.
        guess: approximate positions by name, cut joints included.
        p: (np,) parameters.
    """
    names = independent_names(system)
    independent, surplus = _indices(system, names), [name for name in fixed if name not in names]
    closing = Closing(system, p, tuple(independent))
    given_names = {**guess, **{name: fixed[name] for name in surplus}}
    q = _guessed_configuration(closing, target, given_names)
    given = _indices(system, surplus)
    missed = np.abs(q - target)[given]
    scales = distance_units((system.coordinates[k].unit for k in given), closing.size)
    wrong = [k for k, x in zip(given, missed / scales, strict=True) if x > OPEN]
    if wrong:
        required, found = (
            ", ".join(f"{system.coordinates[k].name} = {values[k]:.6g}" for k in wrong)
            for values in (target, q)
        )
        locked = closing.locked_positions(q)
        raise Unclosable(
            f"{system.name}: {f'with {locked} ' if locked else ''}the loops do not close with"
            f" {required}, the nearest is {found}; leave positions out, or give them as a guess"
        )
    exact = Closing(system, p, tuple(_indices(system, fixed))).nearest(
        _with_positions(q, target, given)
    )
    return exact.q if exact.is_closed else q


def _with_positions(q: Vector, target: Vector, indices: Sequence[int]) -> Vector:
    """Return a copy of q with the positions at `indices` of `target`; all are (nq,)."""
    result = q.copy()
    result[list(indices)] = target[list(indices)]
    return result


def _guessed_configuration(closing: Closing, start: Vector, guess: Mapping[str, float]) -> Vector:
    """Return the closed configuration (nq,) whose guessed positions are nearest to their guesses.

    The target of a cut joint without a guess is its position in the assembled configuration.

    Args:
        closing: closure rows and the locked positions.
        start: (nq,) locked positions, and start values of the others.
        guess: approximate positions by name.
    """
    system, p = closing.system, closing.p
    cut = cut_positions_and_slopes(system)(np.array(system.configuration), p)[0].ravel()
    found = nearest_configuration(closing, GuessTarget.of(system, p, start, guess, cut))
    if found is not None:
        return found.q
    return unwound(closing, closed_configuration(closing, start), start)


def closed_configuration(closing: Closing, start: Vector, restarts: int = _RESTARTS) -> Vector:
    """Return a configuration near `start` (nq,), found by Gauss-Newton with restarts.

    Args:
        closing: closure rows and the locked positions.
        start: (nq,) first guess.
        restarts: number of further starts.

    Raises:
        Unclosable: no configuration was found. The message contains the smallest closure error.
    """
    best: Closed | None = None
    for q in starts(start, closing.free, restarts):
        found = closing.nearest(q)
        if found.is_closed:
            return found.q
        if best is None or found.residual < best.residual:
            best = found
    assert best is not None
    at = closing.locked_positions(start)
    raise Unclosable(
        f"{closing.system.name}: the loop cannot be closed{' with ' + at if at else ''}; the best"
        f" configuration found leaves {closing.gap(best.q)}; change lengths or guesses"
    )


def starts(first: Vector, free: list[int], restarts: int = _RESTARTS) -> Iterator[Vector]:
    """Yield start configurations: `first` (nq,), then random ones at increasing distances from it.

    The sequence is the same at every call.

    Args:
        first: (nq,) first guess.
        free: indices in q of the positions that may differ.
        restarts: number of random starts.
    """
    rng = np.random.default_rng(_SEED)
    yield first
    for k in range(restarts):
        reach = _LARGEST_ANGLE * min(1.0, (k + 2) / 8)
        q = first.copy()
        q[free] += rng.uniform(-reach, reach, len(free))
        yield q


def require_closed(
    system: System, q: Vector, parameters: Mapping[str, float] | None = None
) -> None:
    """Raise if a configuration does not close the loops.

    Args:
        system: mechanism with closed loops.
        q: (nq,) positions.
        parameters: values of symbols by name.

    Raises:
        LoopError: the loops are open. The message contains the closure error.
    """
    _require_joined(Closing(system, closure_parameters(system, parameters)), q)


def _require_joined(closing: Closing, q: Vector) -> None:
    """Raise LoopError if the configuration q (nq,) leaves the loops open or an axis opposed."""
    name = closing.system.name
    if closing.openness(q) > OPEN:
        missed = np.abs(closing.rows(q)[0])
        row = int(np.argmax(missed / closing.sizes))
        groups = position_rows(closing.system)
        if row < len(groups) and groups[row][0] == GROUP:
            node = groups[row][1]
            raise LoopError(
                f"{name}: the forces on {node}, which moves no mass, are not balanced at"
                f" {node} = {q[_coordinate_names(closing.system).index(node)]:.6g}; leave {node}"
                " out, so that it follows from the other positions"
            )
        worst = float(np.max(missed, initial=0.0))
        raise LoopError(
            f"{name}: the configuration leaves the loops open by {worst:.3g};"
            " use mbs.loops.solve to get one that closes them, or give the independent positions"
            " alone"
        )
    if not closing.faces(q):
        raise LoopError(
            f"{name}: an axis of a closing joint points the opposite way in this configuration;"
            " use mbs.loops.solve to get one that closes the loops"
        )


# Initial state of a motion: positions that close the loops, and velocities that keep them closed.


_FITS, _SLOW = 1e-6, 1e-9
"""Relative and absolute [rad/s or m/s] error of velocities that satisfy the request: velocities
that the loops forbid have errors of their own size, others have rounding errors."""
_REFINEMENTS = 3
"""Number of summed solutions: the second one corrects the first, the third one changes nothing."""


def start(
    system: System,
    q0: Start,
    v0: Start,
    parameters: Mapping[str, float] | None,
    guess: Guess = None,
) -> tuple[Vector, Vector]:
    """Return initial positions (nq,) that close the loops and velocities (nv,) that fit them.

    Args:
        system: open or closed mechanism.
        q0: positions by coordinate name [rad or m], or a `State`. Missing positions are those of
            the assembled configuration. A closed system is closed with the given independent
            positions.
        v0: velocities by name [rad/s or m/s]. Missing velocities are zero. In a closed system any
            joints may be given, and the others follow. The default is the velocity of the state.
        parameters: values of symbols by name. Missing symbols have their default values.
        guess: approximate positions of other joints, which select the branch.

    Raises:
        Unclosable: the loops cannot be closed at these positions.
        LoopError: q0 contains all positions and leaves the loops open.
        ModelError: a name is unknown, a quaternion is not of unit length, or the loops allow no
            motion with these velocities.
    """
    at, velocities = state_of(q0), velocities_of(v0)
    if isinstance(at, State) and v0 is None:
        velocities = at.v
    q = start_position(system, at, parameters, guess)
    return q, start_velocity(system, q, velocities, parameters)


def start_position(
    system: System,
    q0: Start,
    parameters: Mapping[str, float] | None,
    guess: Guess = None,
) -> Vector:
    """Return initial positions (nq,) that close the loops.

    Args:
        system: open or closed mechanism.
        q0: positions by name [rad or m], or a `State`; see `start`.
        parameters: values of symbols by name.
        guess: approximate positions of other joints, which select the branch.

    Raises:
        Unclosable: the loops cannot be closed at these positions.
        LoopError: q0 contains all positions and leaves the loops open.
        ModelError: an argument is invalid.
    """
    given: Values = system.plain_names(positions_of(q0), POSITIONS)
    if guess is not None and not isinstance(given, Mapping | None):
        raise ModelError(
            f"{system.name}: a guess is given beside all positions; leave it out, or give q0 by"
            " name"
        )
    q = np.array(system.position(given))
    if fault := plain_fault(system, q, None):
        raise ModelError(f"{system.name}: {fault}")
    if system.is_closed and (isinstance(given, Mapping) or given is None):
        complete = len(given or {}) == system.nq
        if not complete:
            return solve(system, dict(given or {}), guess=guess, parameters=parameters)
    if system.is_closed:
        require_closed(system, q, parameters)
    return q


def start_velocity(
    system: System, q: Vector, v0: Values, parameters: Mapping[str, float] | None
) -> Vector:
    """Return initial velocities (nv,) that keep the loops closed.

    They are the smallest velocities that agree with v0. Joints with springs stay at rest if the
    loops allow it.

    Args:
        system: open or closed mechanism.
        q: (nq,) positions that close the loops.
        v0: velocities by name [rad/s or m/s], or all of them; see `start`.
        parameters: values of symbols by name.

    Raises:
        ModelError: the loops allow no motion with these velocities.
    """
    v0 = system.plain_names(v0, VELOCITIES)
    if not system.is_closed:
        return np.array(system.velocity(v0))
    p = [system.parameter_values(parameters)] if system.parameters else []
    J = np.array(closure_jacobian(system)(q, *p))
    own = node_velocities(system, J, q, np.array(system.parameter_values(parameters)))
    if isinstance(v0, Mapping) and v0:
        at_rest = dict.fromkeys(_spring_speeds(system), 0.0)
        v, missed = (J, "none")
        if at_rest:
            v, missed = smallest_velocity(system, J, {**at_rest, **v0}, own)
        if not missed:
            return v
    v, missed = smallest_velocity(system, J, v0, own)
    if missed:
        names = ", ".join(system.velocity_coordinates[k].name for k in system.independent)
        remedy = f"give those of independent joints: {names}" if names else "leave them out"
        raise ModelError(
            f"{system.name}: the loops allow no motion with the velocities {missed}; {remedy}"
        )
    return v


def _spring_speeds(system: System) -> list[str]:
    """Return names of the velocities of one-freedom joints with springs, without massless nodes."""
    return [
        system.velocity_coordinates[link.v.start].name
        for link in system.tree.links
        if link.v.stop - link.v.start == 1
        and not link.stiffness.is_zero()
        and link.v.start not in {velocity for _, velocity in system.nodes}
    ]


def node_velocities(system: System, J: Vector, q: Vector, p: Vector) -> Vector | None:
    """Return velocities (nv,) of damped massless nodes if all other velocities are zero.

    They solve J v + g = 0. None if the system has no such nodes.

    Args:
        system: open or closed mechanism.
        J: (m, nv) all constraint rows.
        q: (nq,) positions.
        p: (np,) parameters.
    """
    drift = constraint_drift_at(system)
    if drift is None:
        return None
    v, nodes = np.zeros(system.nv), [velocity for _, velocity in system.nodes]
    v[nodes] = np.linalg.lstsq(J[:, nodes], -np.array(drift(q, p)).ravel(), rcond=None)[0]
    return v


def smallest_velocity(
    system: System, J: Vector, v0: Values, own: Vector | None = None
) -> tuple[Vector, str]:
    """Return the smallest velocities with J v = 0 that agree with v0.

    Args:
        system: open or closed mechanism.
        J: (m, nv) constraint rows, dependent rows included.
        v0: velocities by name [rad/s or m/s], or all of them.
        own: (nv,) offset: v - own satisfies J (v - own) = 0 and is the smallest.

    Returns:
        v (nv,), and the velocities of v0 as text if no v agrees with them, else an empty text.
    """
    target = np.array(system.velocity(v0))
    if own is not None:
        v, missed = smallest_velocity(system, J, _less(system, v0, own))
        return v + own, missed
    names = [speed.name for speed in system.velocity_coordinates]
    named = v0 is None or isinstance(v0, Mapping)
    rows = [k for k, name in enumerate(names) if not named or name in (v0 or {})]
    v = _refine(J, rows, target[rows])
    closed = np.all(np.abs(J @ v) <= _FITS * np.linalg.norm(J, axis=1) * np.linalg.norm(v))
    if closed and _fit(v[rows], target[rows]):
        return v, ""
    # for nearly dependent rows, test the velocities in the null space of J
    free = null_space(J)
    near: Vector = free @ np.linalg.lstsq(free[rows], target[rows], rcond=None)[0]
    if _fit(near[rows], target[rows]):
        return v, ""
    return near, ", ".join(f"{names[k]} = {target[k]:g}" for k in rows)


def _less(system: System, v0: Values, own: Vector) -> Values:
    """Return velocities v0, by name or as a list, minus `own` (nv,), in the same format.

    None stays None.
    """
    less = np.array(system.velocity(v0)) - own
    if v0 is None:
        return None
    if not isinstance(v0, Mapping):
        return list(map(float, less))
    return {
        s.name: float(x)
        for s, x in zip(system.velocity_coordinates, less, strict=True)
        if s.name in v0
    }


def _fit(v: Vector, target: Vector) -> bool:
    """Whether velocities v agree with `target`, up to 1e-6 of the target and 1e-9 rad/s or m/s."""
    return bool(np.all(np.abs(v - target) <= _SLOW + _FITS * np.abs(target)))


def _refine(J: Vector, rows: list[int], target: Vector) -> Vector:
    """Return the smallest v (nv,) with J v = 0 and v[rows] = target, if one exists.

    The result is bit-identical on all processors. A solution by a basis of the null space of J has
    noise of 1e-14, which depends on the processor.
    """
    K = np.vstack([J, np.eye(J.shape[1])[rows]])
    goal = np.concatenate([np.zeros(len(J)), target])
    v = np.zeros(J.shape[1])
    for _ in range(_REFINEMENTS):
        v += smallest_solution(K, goal - np.sum(K * v, axis=1), RELATIVE_GAP)
    return v
