"""Closed-form inverse geometric models: selection of the method and symbolic solutions."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

import casadi
import numpy as np
from casadi import DM, SX, Function
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.assembly.model_function import ModelFunction, Named, model_function
from mbs.closed_forms.sequence import Leaf, Problem, StepSequence
from mbs.errors import ModelError, NoClosedForm
from mbs.models.inverse_geometry.chain import FrameChain
from mbs.models.inverse_geometry.target import NEARLY_SINGULAR, SINGULAR
from mbs.numbers import NONZERO
from mbs.operations.counts import count
from mbs.operations.graph import Graph, Node, function_of, graph_of
from mbs.recursions.chain import transforms
from mbs.spatial import Pose
from mbs.text import did_you_mean, quoted

if TYPE_CHECKING:
    from mbs.closed_forms.raghavan_roth.expressions import Characteristic


CLOSED_FORMS = ("pieper", "paul")
"""Names of the closed-form methods, the faster derivation first."""

Numbers: TypeAlias = NDArray[np.float64] | None
"""Parameter values (np,), or None to keep parameters symbolic."""

_FEW = 8
"""Number of branches of an arm with a spherical wrist, which no method can reduce."""


def sequence_of(chain: FrameChain, method: str = "auto", p: Numbers = None) -> StepSequence:
    """Return the closed form of a chain: steps from the pose of its frame to the joint positions.

    The result is cached on the system.

    Args:
        chain: chain that is solved for.
        method: "pieper", "paul" or "auto". "auto" selects Pieper's method if it applies without a
            quartic, else the sequence with the fewest branches, then the fewest operations.
        p: (np,) parameter values; symbolic parameters if None.

    Returns:
        StepSequence of the loop `chain.problem(p)`.

    Raises:
        NoClosedForm: no method applies; the message gives the reason for each method.
        ModelError: the method is unknown.
    """
    require_method(chain.system, method, ("auto", *CLOSED_FORMS))
    found, reasons = list[StepSequence](), list[str]()
    for name in CLOSED_FORMS if method == "auto" else (method,):
        steps = _keep(chain, name, p)
        if isinstance(steps, str):
            reasons.append(f"{name}: {steps}")
            continue
        found.append(steps)
        if _is_short(steps):
            break
    if not found:
        raise NoClosedForm(
            f"{chain.system.name}: no closed form gives {', '.join(chain.names)} from the pose of"
            f" frame {chain.frame!r} ({'; '.join(reasons)}); use"
            " mbs.models.inverse_geometry.solve, which needs none"
        )
    return found[0] if len(found) == 1 else min(found, key=lambda steps: _price(chain, steps, p))


def sequence_or_none(chain: FrameChain, method: str, p: Numbers) -> StepSequence | None:
    """Return the closed form of a chain, or None if it has none or the method is another.

    Raises:
        NoClosedForm: method is "pieper" or "paul" and does not apply to the chain.
    """
    if method not in (*CLOSED_FORMS, "auto"):
        return None
    try:
        return sequence_of(chain, method, p)
    except NoClosedForm:
        if method != "auto":
            raise
        return None


def require_method(system: System, method: str, known: tuple[str, ...]) -> None:
    """Raise if a method is unknown.

    Raises:
        ModelError: the method is unknown; the message suggests a known method.
    """
    if method not in known:
        raise ModelError(
            f"{system.name}: method is {quoted(method)}, which is not known here;"
            f" {did_you_mean(method, known)}"
        )


def given_of(chain: FrameChain, T: SX, p: Numbers = None) -> SX:
    """Return the input vector of a closed form for pose T (4, 4).

    It contains the parameters if p is None, varied joint positions, and rows 1 to 3 of T by column.
    """
    parameters = chain.system.p if p is None else SX(0, 1)
    return SX(casadi.vertcat(parameters, chain.symbols, casadi.vec(T[:3, :])))


def _keep(chain: FrameChain, method: str, p: Numbers) -> StepSequence | str:
    """Return the cached closed form by one method, or the reason if there is none."""

    def solve() -> StepSequence | str:
        try:
            return _solver(method)(chain.problem(p))
        except NoClosedForm as error:
            return str(error)

    steps: StepSequence | str = chain.system.cached(("steps", method, *_key(chain, p)), solve)
    return steps


def _key(chain: FrameChain, p: Numbers) -> tuple[object, ...]:
    return *chain.key, None if p is None else np.asarray(p, dtype=float).tobytes()


def _solver(method: str) -> Callable[[Problem], StepSequence]:
    if method == "pieper":
        from mbs.closed_forms.pieper import pieper

        return pieper
    from mbs.closed_forms.paul import paul

    return paul


def _is_short(sequence: StepSequence) -> bool:
    """Whether a sequence has at most 8 branches and no quartic, so that no other method is tried.

    With a spherical wrist no method has fewer branches than Pieper's. Paul's method takes longer
    to derive, and is tried if Pieper's fails or contains a quartic.
    """
    return sequence.branches <= _FEW and all(one.kind != "quartic" for one in sequence.steps)


def _price(chain: FrameChain, sequence: StepSequence, p: Numbers) -> tuple[int, int]:
    """Return (number of branches, cached number of operations of all branches)."""

    def counted() -> int:
        given = chain.problem(p).given
        every = casadi.horzcat(*(leaf.x for leaf in sequence.leaves(given)))
        return count(Function("leaves", [given], [SX(every)])).total

    operations: int = chain.system.cached(("operations", sequence), counted)
    return sequence.branches, operations


def closed_form_name(chain: FrameChain, sequence: StepSequence, p: NDArray[np.float64]) -> str:
    """Return the name of the closed form of a sequence: "pieper" or "paul"."""
    try:
        return "pieper" if sequence is sequence_of(chain, "pieper", p) else "paul"
    except NoClosedForm:
        return "paul"


_SUSPECT = 1e-9
"""Radicands and regularity (squared, dimensionless) above which the two roots of an equation are
farther apart than 1e-5, for any singular value."""


def bounds_of(sequence: StepSequence) -> tuple[float, float]:
    """Return the bounds of the test for missing solutions near singular configurations.

    Returns:
        Value of `real` and `regular` above which the Jacobian is not checked, and singular value
        below which solutions may be missing. Equations with two roots lose no solution until the
        roots count as one. Quartics lose solutions as the general method does.
    """
    if any(step.kind == "quartic" for step in sequence.steps):
        return np.inf, NEARLY_SINGULAR
    return _SUSPECT, SINGULAR


# Characteristic matrix of the general method as a Function of the pose.


class CharacteristicFunction(ModelFunction):
    """Function ``igm_characteristic(T) -> M0, M1, M2`` for one joint with position q.

    The matrix M0 + M1 cos q + M2 sin q of a revolute joint, or M0 + M1 q + M2 q^2 of a prismatic
    joint, is singular at every solution for the pose T.
    """

    def __init__(self, function: Function, system: System, found: Characteristic) -> None:
        super().__init__(function, system)
        self._found = found

    @property
    def joint(self) -> str:
        """Name of the joint with position q."""
        return self._found.joint

    @property
    def prismatic(self) -> bool:
        """Whether the joint is prismatic."""
        return self._found.prismatic


def characteristic_function(chain: FrameChain) -> Function:
    """Return the characteristic matrices of a chain of six joints.

    Source: Raghavan & Roth 1993; Manocha & Canny 1994.

    Returns:
        CharacteristicFunction of T (4, 4) [m] with outputs M0, M1, M2 (n, n). M2 is missing if the
        matrix is linear in the position of a prismatic joint.

    Raises:
        NoClosedForm: the number of joints is not six, or the matrix is singular at every
            configuration.
    """
    from mbs.closed_forms.raghavan_roth.expressions import characteristic

    def make() -> Function:
        problem = chain.problem()
        found = characteristic(problem)

        def build() -> tuple[Named, Named]:
            T = SX.sym("T", 4, 4)
            parts = Function("parts", [problem.given], list(found.matrices))
            every = parts.call([given_of(chain, T)])
            return [("T", T)], [(f"M{k}", part) for k, part in enumerate(every)]

        plain = model_function(chain.system, ("igm_characteristic", *chain.key), build)
        return CharacteristicFunction(Function(plain), chain.system, found)

    made: Function = chain.system.cached(("characteristic matrix", *chain.key), make)
    return made


# Pose error of configurations: symbolic forward kinematics of a chain.


def forward(chain: FrameChain, x: SX, p: NDArray[np.float64] | None = None) -> Pose:
    """Return the symbolic pose of the end frame of a chain in the base.

    Args:
        chain: chain from the base to the frame.
        x: (n, 1) positions of the free joints [rad or m].
        p: (np,) parameter values; symbolic parameters if None.
    """
    return transforms(chain.at(p), x)[-1]


def residual(pose: Pose, T: SX) -> SX:
    """Return the largest absolute difference of elements of a pose and T (4, 4), in m and 1."""
    return relative_residual(pose, T, SX(1))


def relative_residual(pose: Pose, T: SX, length: SX) -> SX:
    """Return the largest difference of elements of a pose and T, positions divided by a length."""
    turned = casadi.vec(pose.R - T[:3, :3])
    return SX(casadi.mmax(casadi.fabs(casadi.vertcat(turned, (pose.p - T[:3, 3]) / length))))


def size(chain: FrameChain, p: NDArray[np.float64] | None = None) -> SX:
    """Return a reference length of the chain: sum of its link lengths [m], or 1 if all are zero."""
    lengths = [casadi.norm_2(gap.p) for gap in chain.at(p).between if not gap.p.is_zero()]
    return SX(sum(lengths, SX(0))) if lengths else SX(1)


# Inverse geometric model as a Function of the pose and the index of a branch.


def signs_of(sequence: StepSequence, branch: SX) -> SX:
    """Return the signs (signs, 1), +1 or -1: bits of the branch index, highest bit first."""
    count = len(sequence.signs)
    halves = [casadi.floor((branch + 0.5) / 2**k) for k in range(count + 1)]
    bits = [halves[k] - 2 * halves[k + 1] for k in reversed(range(count))]
    return SX(casadi.vertcat(*(1 - 2 * bit for bit in bits)))


def whole_configuration(chain: FrameChain, x: SX) -> SX:
    """Return all joint positions (nq, 1): x for the chain, other joints locked or as assembled."""
    q = SX(DM(chain.system.position(chain.locked)))
    q[list(chain.indices)] = x
    return q


# All branches of the inverse geometric model in one graph, without sines of computed angles.


_SEED = 20260111
_OUTPUTS = ("q", "residual", "real", "regular", "mark")


def all_branches(
    chain: FrameChain, sequence: StepSequence, p: NDArray[np.float64] | None = None
) -> Function:
    """Return ``igm_all(T) -> q, residual, real, regular, mark`` of all branches of a closed form.

    Args:
        chain: chain that is solved for; positions of its varied joints are the last input r.
        sequence: closed form of the chain, for the same p.
        p: (np,) parameter values; None adds a second input p.

    Returns:
        Function of T (4, 4) [m]. q (n, branches) are joint positions of the chain [rad or m],
        always finite. residual (branches, 1) is the largest absolute difference of an element of
        the forward kinematics and T, in m and 1. real and regular (branches, 1) are the smallest
        radicand and the smallest quantity that must not vanish (see `Leaf`). mark (branches, 1) is
        equal for equal configurations, and usually different for different configurations.
    """
    T = SX.sym("T", 4, 4)
    given = given_of(chain, T, p)
    leaves = sequence.leaves(given)
    columns = [_column(chain, leaf, T, p) for leaf in leaves]
    values = [casadi.horzcat(*(leaf.x for leaf in leaves))]
    values += [casadi.vertcat(*column) for column in zip(*columns, strict=True)]
    inputs = {"T": T} | ({"p": chain.system.p} if p is None and chain.system.parameters else {})
    inputs |= {"r": chain.symbols} if chain.varied else {}
    outputs = {name: casadi.densify(v) for name, v in zip(_OUTPUTS, values, strict=True)}
    every = [*inputs.values()], [*outputs.values()], [*inputs], [*outputs]
    return function_of(without_sines(graph_of(Function("igm_all", *every, {"cse": True}))))


@dataclass(frozen=True, slots=True, eq=False)
class PoseBatch:
    """Outputs of `all_branches` for N poses.

    Attributes:
        q: (N, branches, n) joint positions of the chain [rad or m].
        residual, real, regular, mark: (N, branches) outputs as in `all_branches`.
    """

    q: NDArray[np.float64]
    residual: NDArray[np.float64]
    real: NDArray[np.float64]
    regular: NDArray[np.float64]
    mark: NDArray[np.float64]


def plain_branches(chain: FrameChain, sequence: StepSequence, p: NDArray[np.float64]) -> Function:
    """Return `all_branches` for parameter values p (np,), cached on the system."""
    key = ("igm_all", sequence, *chain.key, p.tobytes())
    plain: Function = chain.system.cached(key, lambda: all_branches(chain, sequence, p))
    return plain


def at_poses(
    plain: Function, T: NDArray[np.float64], r: NDArray[np.float64] | None = None
) -> PoseBatch:
    """Evaluate `all_branches` at N poses by the CasADi interpreter, without compilation.

    Args:
        plain: Function from `all_branches`.
        T: (N, 4, 4) poses [m].
        r: (N, k) positions of varied joints [rad or m], if there are any.
    """
    n, branches = plain.size_out(0)
    count = len(T)
    if not count:
        rows = [np.empty((0, branches)) for _ in range(4)]
        return PoseBatch(np.empty((0, branches, n)), *rows)
    columns = np.swapaxes(T, 1, 2).reshape(-1, 4).T
    varied = [DM(r.T)] if r is not None and r.shape[1] else []
    q, *parts = (np.array(part) for part in plain.map(count)(columns, *varied))
    return PoseBatch(q.T.reshape(-1, branches, n), *(part.T for part in parts))


def _column(chain: FrameChain, leaf: Leaf, T: SX, p: NDArray[np.float64] | None) -> list[SX]:
    pose = forward(chain, leaf.x, p)
    differences = casadi.vertcat(casadi.vec(pose.R - T[:3, :3]), pose.p - T[:3, 3])
    largest = functools.reduce(_larger, casadi.vertsplit(casadi.fabs(differences)))
    return [
        largest,
        _smallest(leaf.real),
        _smallest(casadi.fabs(leaf.regular)),
        _mark(chain, leaf.x),
    ]


def _mark(chain: FrameChain, x: SX) -> SX:
    """Return a generic linear combination of displacements, sines and cosines of the joints."""
    weights = np.random.default_rng(_SEED).uniform(0.5, 1.0, (len(chain.names), 2))
    mark = SX(0)
    for k, (a, b) in enumerate(weights):
        mark += a * x[k] if chain.prismatic[k] else a * casadi.sin(x[k]) + b * casadi.cos(x[k])
    return mark


def _larger(a: SX, b: SX) -> SX:
    """Return the maximum of two numbers, by operations with vector instructions."""
    return SX(0.5 * (a + b + casadi.fabs(a - b)))


def _smallest(values: SX) -> SX:
    """Return the minimum of 1 and all values."""
    return functools.reduce(_smaller, casadi.vertsplit(values), SX(1))


def _smaller(a: SX, b: SX) -> SX:
    return SX(0.5 * (a + b - casadi.fabs(a - b)))


def without_sines(graph: Graph) -> Graph:
    """Replace sin and cos of atan2(y, x) in a graph by y/hypot(x, y) and x/hypot(x, y).

    The replacements are zero at x = y = 0.
    """
    nodes: list[Node] = []
    new: list[int] = []
    scales: dict[int, int] = {}

    def add(op: int, *args: int, value: float = 0.0) -> int:
        nodes.append(Node(op, args, value))
        return len(nodes) - 1

    for number, node in enumerate(graph.nodes):
        operands = graph.operands(number)
        angle = operands[0] if operands else -1
        of = graph.nodes[angle]
        if node.op not in (casadi.OP_SIN, casadi.OP_COS) or of.op != casadi.OP_ATAN2:
            args = tuple(new[k] for k in operands) if operands else node.args
            nodes.append(Node(node.op, args, node.value))
            new.append(len(nodes) - 1)
            continue
        y, x = (new[k] for k in of.args)
        if angle not in scales:
            square = add(casadi.OP_ADD, add(casadi.OP_SQ, x), add(casadi.OP_SQ, y))
            tiny = add(casadi.OP_CONST, value=NONZERO)
            scales[angle] = add(
                casadi.OP_INV, add(casadi.OP_SQRT, add(casadi.OP_ADD, square, tiny))
            )
        new.append(add(casadi.OP_MUL, y if node.op == casadi.OP_SIN else x, scales[angle]))
    return graph.with_nodes(nodes, [[new[k] for k in result] for result in graph.results])
