"""Functions from independent positions to all tree positions, in closed form or by Newton steps."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import casadi
import numpy as np
from casadi import DM, MX, SX, Function

from mbs.assembly import System
from mbs.assembly.model_function import ModelFunction, Named, model_function
from mbs.closed_forms.ring import extent, independent_indices
from mbs.errors import ModelError, NoClosedForm, Unclosable
from mbs.loops.closing import (
    LARGEST_MOVE,
    Vector,
    closure_parameters,
    mechanism_size,
    relative_rows,
    row_sizes,
)
from mbs.loops.closure_equations import facing, square_closure
from mbs.loops.plan import Stage, plan
from mbs.numbers import has_boolean
from mbs.text import did_you_mean, quoted

# Independent positions as user input: by name, or in the order of the independent joints.


Given = Mapping[str, float] | Sequence[float] | None


def independent_names(system: System) -> list[str]:
    """Return the names of the independent joints, in the order of `system.chosen_coordinates`.

    Args:
        system: assembled mechanism.
    """
    return [system.velocity_coordinates[k].name for k in system.chosen_coordinates]


def fixed_positions(system: System, values: Given) -> dict[str, float]:
    """Return positions of the user as a dict from coordinate name to value.

    Args:
        system: assembled mechanism.
        values: positions by name, or those of the independent joints in order [rad or m]; None for
            none.

    Raises:
        ModelError: a sequence does not fit the independent joints.
    """
    names = independent_names(system)
    if values is None or isinstance(values, Mapping):
        return dict(values or {})
    given = _numbers(values)
    if given is None:
        raise ModelError(
            f"{system.name}: q_active is {quoted(values)}; give numbers for {', '.join(names)}"
        )
    if len(given) != len(names):
        raise ModelError(
            f"{system.name}: q_active has {len(given)} values, the independent joints are"
            f" {len(names)}: {', '.join(names)}"
        )
    return dict(zip(names, given, strict=True))


def _numbers(values: Any) -> list[float] | None:
    """Return the elements of the sequence `values` as floats; None if an element is no number."""
    try:
        return None if has_boolean(values) else [float(x) for x in values]
    except (TypeError, ValueError):
        return None


def independent_positions(system: System, values: Given) -> list[float]:
    """Return positions (m,) of all independent joints; missing ones are those of the assembly.

    Args:
        system: assembled mechanism.
        values: positions by name, or in the order of `system.chosen_coordinates` [rad or m].

    Raises:
        ModelError: a joint is not independent, or a value is not finite.
    """
    fixed, names = fixed_positions(system, values), independent_names(system)
    indices = dict(zip(names, independent_indices(system), strict=True))
    spins = {name: x for name, x in fixed.items() if indices.get(name, 0) >= system.nq}
    whole = system.position({name: x for name, x in fixed.items() if name not in spins})
    spin = system.velocity(spins)
    for name in fixed:
        if not names:
            raise ModelError(
                f"{system.name}: {name} is given, but the loops leave no motion (mobility 0); leave"
                " q_active out"
            )
        if name not in names:
            raise ModelError(
                f"{system.name}: {name} follows from the loops once a branch is named; give"
                f" positions of the independent joints {', '.join(names)}"
            )
    return [
        whole[index] if index < system.nq else spin[k]
        for k, index in zip(system.chosen_coordinates, indices.values(), strict=True)
    ]


# Ranges of positions that an independent joint can reach on a branch with other joints locked.


_POINTS = 721
_HALVINGS = 40
_LEAST_STROKE = 1.0
_DOUBLINGS = 10


def reachable(system: System, loops: Function, q_a: Vector, p: Vector) -> str:
    """Return text on the reachable range of each independent joint for fixed values of the others.

    Args:
        system: mechanism with the loops.
        loops: closed form (q_a, p) -> q, NaN if q_a is unreachable.
        q_a: (m,) positions that cannot be reached.
        p: (np,) parameters.

    Returns:
        Text such as "j1 can be -1.2 to 1.2 rad".
    """
    texts = []
    for number, k in enumerate(independent_indices(system)):
        if k >= system.nq:
            continue
        is_reached = _test(loops, q_a, p, number)
        intervals = _intervals(is_reached, *_span(system, k, q_a[number], is_reached))
        unit = system.coordinates[k].unit
        if intervals:
            ranges = " or ".join(f"{low:.4g} to {high:.4g}" for low, high in intervals)
            texts.append(f"{system.coordinates[k].name} can be {ranges} {unit}")
    held = (
        ", the other positions as they are" if texts and len(system.chosen_coordinates) > 1 else ""
    )
    return "; ".join(texts) + held if texts else "change several positions, the branch or lengths"


def _test(loops: Function, q_a: Vector, p: Vector, number: int) -> Callable[[float], bool]:
    """Return a predicate: whether loops close with independent position `number` at a value.

    The other independent positions are taken from q_a (m,).
    """
    arguments = [p] if p.size else []

    def is_reached(value: float) -> bool:
        trial = q_a.copy()
        trial[number] = value
        return bool(np.all(np.isfinite(np.array(loops.call([trial, *arguments])[0]))))

    return is_reached


def _span(
    system: System, k: int, value: float, is_reached: Callable[[float], bool]
) -> tuple[float, float]:
    """Return the interval to search for reachable positions of coordinate k [rad or m].

    It is a full rotation for an angle. For a length it is symmetric about the assembled value and
    grows until both of its ends are unreachable.
    """
    if system.coordinates[k].unit == "rad":
        return -np.pi, np.pi
    middle = system.configuration[k]
    stroke = max(_LEAST_STROKE, abs(value - middle))
    for _ in range(_DOUBLINGS):
        if not is_reached(middle - stroke) and not is_reached(middle + stroke):
            break
        stroke *= 2
    return middle - stroke, middle + stroke


def _intervals(
    is_reached: Callable[[float], bool], low: float, high: float
) -> list[tuple[float, float]]:
    """Return the intervals (low, high) of reachable positions between `low` and `high`.

    `is_reached` returns whether the loops close at a position.
    """
    points = np.linspace(low, high, _POINTS)
    inside = np.array([is_reached(float(x)) for x in points])
    changes = np.flatnonzero(inside[1:] != inside[:-1])
    edges = [_edge(is_reached, float(points[k]), float(points[k + 1])) for k in changes]
    edges = [low] * bool(inside[0]) + edges + [high] * bool(inside[-1])
    return list(zip(edges[::2], edges[1::2], strict=True))


def _edge(is_reached: Callable[[float], bool], low: float, high: float) -> float:
    """Return the limit of reachability between two positions, one reachable and one not.

    `is_reached` returns whether the loops close at a position.

    One of the positions `low` and `high` is reachable. The interval is halved repeatedly.
    """
    first = is_reached(low)
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        if is_reached(middle) == first:
            low = middle
        else:
            high = middle
    return (low + high) / 2


Branch = str | Sequence[str] | None
"""Labels such as "j3:+", as comma-separated text or a sequence; None for the assembled branch."""


class LoopFunction(ModelFunction):
    """Closed form of the loops as a model. A numeric call without a solution raises Unclosable."""

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        """Evaluate the closed form.

        Raises:
            Unclosable: no configuration on this branch has these positions.
            ModelError: an argument is invalid.
        """
        try:
            return super().__call__(*args, **kwargs)
        except ModelError:
            given = self._numbers(args, kwargs)
            if given is None or self.system.parameter_fault(given[1]):
                raise
            raise Unclosable(self._refusal(*given)) from None

    def _numbers(
        self, args: tuple[Any, ...], kwargs: dict[str, Any]
    ) -> tuple[Vector, Vector] | None:
        """Return finite numeric q_a and p of the right size; None for any other arguments."""
        try:
            given = self._given(args, kwargs)
            q_a = np.array(DM(given["q_a"]), dtype=float).ravel()
            p = np.array(DM(given.get("p", [])), dtype=float).ravel()
        except (ModelError, NotImplementedError, TypeError, ValueError):
            return None
        sizes = len(self.system.chosen_coordinates), len(self.system.parameters)
        fits = (q_a.size, p.size) == sizes
        return (q_a, p) if fits and np.all(np.isfinite(q_a)) and np.all(np.isfinite(p)) else None

    def _refusal(self, q_a: Vector, p: Vector) -> str:
        """Return the error message for positions q_a (m,) that cannot be reached.

        It contains the reachable ranges of each joint at parameters p (np,).
        """
        names = independent_names(self.system)
        at = ", ".join(f"{name} = {value:.4g}" for name, value in zip(names, q_a, strict=True))
        return f"{self.system.name}: no configuration on this branch has {at}; " + reachable(
            self.system, self, q_a, p
        )


def function(system: System, branch: Branch = None) -> Function:
    """Return ``loops(q_a) -> q``: the configuration for independent positions, in closed form.

    The Function can be differentiated any number of times. Angles that a loop determines are within
    half a rotation of zero.

    Args:
        system: assembled mechanism.
        branch: labels from `mbs.loops.assembly_modes`, such as "j3:+". A loop without a label
            keeps its assembled branch.

    Returns:
        Function of q_a (m, 1) and, if the system has parameters, p; q (nq, 1) [rad or m]. A numeric
        call without a solution on the branch raises Unclosable with the reachable ranges. In
        symbolic graphs and maps, q is NaN instead.

    Raises:
        NoClosedForm: a loop can be solved by iteration only.
        ModelError: the branch does not exist.
    """
    stages = plan(system)
    ways = _ways(system, stages, branch)

    def build() -> tuple[Named, Named]:
        q_a = SX.sym("q_a", len(system.chosen_coordinates))
        return [("q_a", q_a)], [("q", _configuration(system, stages, ways, q_a))]

    def make() -> Function:
        return LoopFunction(model_function(system, ("loops", ways), build), system)

    made: Function = system.cached(("closed form", ways), make)
    return made


def configuration_on(
    system: System, q_active: Given, branch: Branch, parameters: Mapping[str, float] | None
) -> Vector:
    """Return the configuration (nq,) on a branch for independent positions of the user.

    Args:
        system: assembled mechanism.
        q_active: positions of the independent joints, by name or in order [rad or m].
        branch: labels of branches; loops without a label keep their assembled branch.
        parameters: values of symbols by name.

    Raises:
        Unclosable: no configuration on the branch has these positions.
        NoClosedForm: a loop can be solved by iteration only.
        ModelError: a name is unknown, or a value is not finite.
    """
    loops = function(system, branch)
    p = closure_parameters(system, parameters)
    q_a = independent_positions(system, q_active)
    q = loops(q_a, p) if system.parameters else loops(q_a)
    return np.array(q).ravel()


def _configuration(system: System, stages: Sequence[Stage], ways: Sequence[int], q_a: SX) -> SX:
    """Return q (nq, 1) from q_a by solving all loops in order on the given branches.

    Args:
        system: assembled mechanism.
        stages: closed form of each loop, in the order of solution.
        ways: branch index of each stage.
        q_a: (m, 1) independent positions.
    """
    q = SX.zeros(extent(system))
    q[independent_indices(system)] = q_a
    for stage, way in zip(stages, ways, strict=True):
        q[list(stage.indices)] = stage.values(q, system.p)[:, way]
    return q[: system.nq]


def _ways(system: System, stages: Sequence[Stage], branch: Branch) -> tuple[int, ...]:
    """Return the branch index of each stage; loops without a label keep their assembled branch.

    Raises ModelError for an unknown label.

    `stages` are the solution steps of the loops; `branch` is the label of a branch.
    """
    labels = _labels(system, branch)
    known = [label for stage in stages for label in stage.labels if label]
    for label in labels:
        if label not in known:
            raise ModelError(
                f"{system.name}: there is no branch {quoted(label)}; {did_you_mean(label, known)}"
            )
    return tuple(_way(system, stage, labels) for stage in stages)


def _labels(system: System, branch: Branch) -> list[str]:
    """Return the branch labels of the user, such as "j3:+", as a list; empty for None.

    Raises ModelError for another type.
    """
    if branch is None:
        return []
    given = branch.split(",") if isinstance(branch, str) else branch
    try:
        return [label.strip() for label in given]
    except (AttributeError, TypeError):
        raise ModelError(
            f"{system.name}: branch is {quoted(branch)}; give labels such as 'j3:+', as"
            " mbs.loops.assembly_modes lists them"
        ) from None


def _way(system: System, stage: Stage, labels: Sequence[str]) -> int:
    """Return the branch index of a stage: that of its label in `labels`, else of the assembly.

    Raises ModelError if `labels` contains two of its branches.
    """
    named = [k for k, label in enumerate(stage.labels) if label and label in labels]
    if len(named) > 1:
        raise ModelError(
            f"{system.name}: {' and '.join(stage.labels[k] for k in named)} are two ways to close"
            f" the loop of {stage.name}; name one"
        )
    return named[0] if named else stage.chosen


# All tree positions from the independent positions, as a CasADi graph.


_STAGES = 128
_OPEN = 1e-9
"""Sum of all absolute rows, in sizes of the mechanism, above which Newton's method has failed: it
leaves 1e-13 if it converges, and much more if it does not."""


def follow_active(system: System) -> Function:
    """Return ``follow(q_a, p) -> q``: the configuration at the end of a straight line of q_a.

    The independent positions and the parameters move from their assembled and default values in
    small equal stages. Newton's method closes each stage from a linear prediction, so that the
    branch of the assembled configuration is kept. The Function is differentiable (implicit function
    theorem). q is NaN if the line leaves the reachable positions.

    Args:
        system: mechanism with closed loops.

    Returns:
        Function of q_a (m, 1) and p (np, 1); q (nq, 1).

    Raises:
        NoClosedForm: an independent velocity belongs to a quaternion, so that no element of q is
            its position.
    """

    def build() -> Function:
        active = independent_indices(system)
        if any(index >= system.nq for index in active):
            raise NoClosedForm(
                f"{system.name}: a rod spins about its line, which no position of q follows; use a"
                " configuration of mbs.loops.solve"
            )
        passive = [k for k in range(system.nq) if k not in active]
        q_a, p = MX.sym("q_a", len(active)), MX.sym("p", system.p.numel())
        q_start = DM([system.configuration[k] for k in active])
        p_start = DM(closure_parameters(system))
        stage = _stage(system, active, passive)
        z = before = MX(DM([system.configuration[k] for k in passive]))
        good: MX = MX(1)
        for number in range(1, _STAGES + 1):
            part = number / _STAGES
            q_k, p_k = q_start + part * (q_a - q_start), p_start + part * (p - p_start)
            led = 2 * z - before
            before = z
            z, closed = stage(led, q_k, p_k)
            good = good * closed
        q = _merge(system, active, passive)(z, q_a)
        return Function("follow", [q_a, p], [casadi.if_else(good, q, DM.nan(system.nq))])

    function: Function = system.cached("follow", build)
    return function


def _merge(system: System, active: list[int], passive: list[int]) -> Function:
    """Return Function (z, q_a) -> q that merges passive positions z and independent positions q_a.

    `active` and `passive` are their indices in q.
    """
    z, q_a = SX.sym("z", len(passive)), SX.sym("q_a", len(active))
    q = SX.zeros(system.nq)
    q[passive], q[active] = z, q_a
    return Function("merged", [z, q_a], [q])


def _newton(system: System, active: list[int], passive: list[int]) -> Function:
    """Return the Function ``(z, q_a, p) -> z`` of Newton's method on the loops.

    z are passive positions; `active` and `passive` are indices in q. A result that has not
    converged is not marked.
    """
    q, z, q_a = (
        SX.sym(n, k) for n, k in zip("qza", (system.nq, len(passive), len(active)), strict=True)
    )
    merged = _merge(system, active, passive)(z, q_a)
    rows = square_closure(system, q, passive)
    if system.closure is not None and not system.closure.varies:
        own = row_sizes(system)[list(system.closure.rows)]
        rows = casadi.vertcat(rows[: own.numel(), 0] / own, rows[own.numel() :, 0])
    residual = casadi.substitute(rows, q, merged)
    equations = Function("phi", [z, q_a, system.p], [residual])
    # Tolerance in sizes of the mechanism: a tenth of that of other iterations, at no extra cost.
    # A prediction that needs more than 30 iterations does not converge.
    options = {"abstol": 1e-13, "max_iter": 30, "error_on_fail": False}
    return casadi.rootfinder("newton", "fast_newton", equations, options)


def _stage(system: System, active: list[int], passive: list[int]) -> Function:
    """Return ``stage(led, q_a, p) -> z, good``: passive positions z by Newton's method.

    Args:
        system: mechanism with closed loops.
        active: indices in q of the independent positions.
        passive: indices in q of the passive positions.

    Returns:
        Function with the predicted passive positions `led` as start. good is 1 if the loops close
        near the prediction, else 0.
    """
    led, q_a = MX.sym("led", len(passive)), MX.sym("q_a", len(active))
    p = MX.sym("p", system.p.numel())
    z = _newton(system, active, passive)(led, q_a, p)
    q = _merge(system, active, passive)(z, q_a)
    size = mechanism_size(system)
    scales = [size if system.coordinates[k].unit.startswith("m") else SX(1) for k in passive]
    measures = Function("measures", [system.p], [casadi.vertcat(SX(0, 1), *scales)])
    near = casadi.norm_inf((z - led) / measures(p)) < LARGEST_MOVE
    good = casadi.logic_and(_closed(system)(q, p), near)
    return Function("stage", [led, q_a, p], [z, good])


def _closed(system: System) -> Function:
    """Return ``closed(q, p)``: 1 if all loops are closed and no axis is opposed, else 0.

    It is 0 also if q has NaN.
    """
    q = SX.sym("q", system.nq)
    openness = casadi.sum1(casadi.fabs(relative_rows(system, q)))  # a maximum would drop NaN
    cosines = facing(system, q)
    faces = casadi.mmin(cosines) > 0 if cosines.numel() else SX(1)
    return Function("closed", [q, system.p], [casadi.logic_and(openness < _OPEN, faces)])
