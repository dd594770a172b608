"""Closed-form inverse geometric models: selection of Pieper's or Paul's method, and Functions."""

from __future__ import annotations

import functools
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

import casadi
import numpy as np
from casadi import DM, SX, Function
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.assembly.model_function import ModelFunction, Named, model_function, require_system
from mbs.closed_forms.arm_core import general_function
from mbs.closed_forms.sequence import Leaf, Problem, SequenceStep, StepSequence
from mbs.errors import ModelError, NoClosedForm
from mbs.models.inverse_geometry.chain import FrameChain, frame_chain, target_pose, target_poses
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


METHODS = ("auto", *CLOSED_FORMS, "general")

_ROUNDING = 1e-9
"""Tolerance of rounding errors: of dimensionless radicands, and of the residual relative to the
size of the chain."""


class InverseGeometry(ModelFunction):
    """Closed form ``igm(T, branch) -> q, valid`` with the names of its branches and its steps."""

    def __init__(
        self, function: Function, chain: FrameChain, sequence: StepSequence, annotate: Any
    ):
        super().__init__(function, chain.system, annotate)
        self._chain, self._sequence = chain, sequence

    @property
    def branches(self) -> int:
        """Number of branches: the input `branch` is 0 .. branches - 1."""
        return self._sequence.branches

    @property
    def labels(self) -> tuple[str, ...]:
        """Names of the branches, as in the results of `solve`.

        The names describe shoulder, elbow and wrist if the arm has them. Otherwise, and for
        symbolic parameters, on which names may depend, they are `signs`.
        """
        from mbs.models.inverse_geometry.branches import branch_labels  # avoids a circular import

        if self.system.parameters:
            return self.signs
        return branch_labels(self._chain, self._sequence, np.zeros(0))

    @property
    def signs(self) -> tuple[str, ...]:
        """Signs of each branch, such as "q3:+ q2:- q5:+"."""
        return tuple(self._sequence.label(b) for b in range(self.branches))

    @property
    def steps(self) -> tuple[SequenceStep, ...]:
        """Steps of the closed form in the order of solution."""
        return tuple(self._sequence.steps)

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        """Evaluate the Function; numeric values of T and branch are checked first."""
        _require_pose(self.system, args, kwargs)
        branch = kwargs.get("branch", args[1] if len(args) > 1 else None)
        if isinstance(branch, (int, float, np.ndarray, np.generic)):
            self._require_branch(np.asarray(branch))
        return super().__call__(*args, **kwargs)

    def _require_branch(self, branch: Any) -> None:
        known = (branch == np.floor(branch)) & (branch >= 0) & (branch < self.branches)
        if not np.all(known):
            raise ModelError(
                f"{self._title}: branch {branch[~known][0]:g} does not exist; the branches are 0"
                f" to {self.branches - 1}"
            )


class AllBranches(InverseGeometry):
    """Closed form ``igm_all(T) -> q, valid`` of all branches, one column per branch.

    Near singular configurations rounding of T decides which branches are valid: see `certain`.
    """

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        """Evaluate the Function; a numeric T must be a rigid transform."""
        _require_pose(self.system, args, kwargs)
        return ModelFunction.__call__(self, *args, **kwargs)

    def certain(
        self, T: Any, parameters: Mapping[str, float] | None = None
    ) -> bool | NDArray[np.bool_]:
        """Return whether the set of valid branches is independent of rounding of the pose.

        The result is False near a singular configuration, where branches meet or a joint is
        undetermined. `solve` and `solve_many` compute all configurations there.

        Args:
            T: (4, 4) pose, or (N, 4, 4) poses [m].
            parameters: parameter values by name; default values for all others.

        Returns:
            bool for one pose, array (N,) for N poses.

        Raises:
            ModelError: a matrix is no rigid transform, or a parameter has no value.
        """
        from mbs.models.inverse_geometry.many import draft_solutions  # avoids a circular import

        one = np.ndim(T) == 2
        poses = target_poses(self.system, [T] if one else T)
        p, none = np.array(self.system.parameter_values(parameters)), np.zeros((len(poses), 0))
        found = ~draft_solutions(self._chain, self._sequence, p, poses, none).searched
        return bool(found[0]) if one else found


class AllConfigurations(ModelFunction):
    """General method ``igm_all(T) -> q, valid, count, certain``, one column per configuration.

    Unused columns come last; they are NaN, with `valid` 0.
    """

    may_be_nan = ("q",)

    def __init__(self, function: Function, chain: FrameChain) -> None:
        super().__init__(function, chain.system)
        self._chain = chain

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        """Evaluate the Function; a numeric T must be a rigid transform."""
        _require_pose(self.system, args, kwargs)
        return super().__call__(*args, **kwargs)

    def example(self, name: str) -> NDArray[np.float64] | None:
        """Return a reachable pose as example of input T, None for other inputs."""
        q = 0.3 + 0.2 * np.sin(np.arange(len(self._chain.names)))  # regular for usual arms
        return np.array(self._chain.arm(np.zeros(0)).pose(q)) if name == "T" else None

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the chain only; the Function is compiled again on loading."""
        chain = self._chain
        return _all_again, (chain.system, chain.frame, dict(chain.locked))


def _all_again(system: System, frame: str | int, locked: dict[str, float]) -> Function:
    return function(system, "general", frame, locked, branches="all")


def _require_pose(system: System, args: tuple[Any, ...], kwargs: dict[str, Any]) -> None:
    T = kwargs.get("T", args[0] if args else None)
    if isinstance(T, (DM, np.ndarray, list, tuple)) and np.shape(np.array(T)) == (4, 4):
        target_pose(system, T)


def function(
    system: System,
    method: str = "auto",
    frame: str | int | None = None,
    locked: Mapping[str, float] | None = None,
    *,
    branches: str = "one",
) -> Function:
    """Return the closed-form inverse kinematics ``igm(T, branch) -> q, valid`` as a Function.

    ``branches="all"`` returns ``igm_all(T) -> q, valid`` with one column per branch, whose common
    steps are shared. Both are differentiable with respect to T and the parameters, except at
    singular configurations.

    With method="general", or for an arm of six joints without a closed form, ``branches="all"``
    returns ``igm_all(T) -> q, valid, count, certain`` in C code: all configurations, up to 16, by
    the general method. It can be differentiated once, with respect to T.

    Source: Pieper 1968; Paul 1981; Khalil & Creusot 1997, section 3.3; Raghavan & Roth 1993.

    Args:
        system: open system. For a closed system use `mbs.models.inverse_geometry.solve`.
        method: "pieper", "paul", "auto" for the cheaper of both, or "general" for the method of
            Raghavan and Roth: its matrices ``igm_characteristic(T) -> M0, M1, M2``, or with
            branches="all" its configurations.
        frame: name of a body or frame, index of a link, or None for the terminal frame.
        locked: positions of fixed joints, by name [rad or m].
        branches: "one" for a Function with the index of the branch as an input, or "all".

    Returns:
        InverseGeometry: Function of T (4, 4) [m], the pose of the frame relative to the base, and
        the index of the branch. q (nq, 1) [rad or m] is finite for every T; joints outside the
        chain are as assembled. valid is 1 if the pose of q equals T within 1e-9 of the size of
        the robot, else 0. AllBranches: Function of T with q (nq, branches), valid (branches, 1);
        its method `certain(T)` is False if rounding of T may change which branches are valid.
        AllConfigurations: q (nq, 16) with residuals of at most 1e-12 of max(1 m, length), NaN
        from column `count` on. valid (16, 1) is 1 for the columns before. certain is 0 if T is no
        rigid transform, or near a singular configuration, if a configuration may be missing.

    Raises:
        NoClosedForm: no closed form is known; the message gives the reason.
        ModelError: the method, frame or joint is unknown, more than six joints are free, the
            system is closed, or the general method requires numeric parameters.
        CompilerError: all configurations of the general method are requested without a C compiler.
    """
    require_system(system)
    require_method(system, method, METHODS)
    _require_branches(system, method, branches)
    chain = frame_chain(system, frame, locked)
    if method == "general" and branches == "one":
        return characteristic_function(chain)
    _require_open(system)
    solves = sequence_of(chain, method) if branches == "one" else steps_or_all(chain, method)
    if isinstance(solves, Function):
        return solves
    sequence = solves

    def make() -> Function:
        if branches == "all":
            key: tuple[object, ...] = ("igm_all", method, *chain.key)
            found: Any = model_function(system, key, lambda: _all_built(chain, sequence))
            return AllBranches(Function(found), chain, sequence, found.annotated)
        key = ("igm", method, *chain.key)
        plain: Any = model_function(system, key, lambda: _built(chain, sequence))
        return InverseGeometry(Function(plain), chain, sequence, plain.annotated)

    made: Function = system.cached(("inverse geometry", method, branches, *chain.key), make)
    return made


def _require_branches(system: System, method: str, branches: object) -> None:
    if branches not in ("one", "all"):
        raise ModelError(f"{system.name}: branches is {quoted(branches)}; use 'one' or 'all'")


def _require_open(system: System) -> None:
    if system.is_closed:
        raise ModelError(
            f"{system.name}: its loops must be closed too, and no Function does both; use"
            " mbs.models.inverse_geometry.solve"
        )


def _built(chain: FrameChain, sequence: StepSequence) -> tuple[Named, Named, Named]:
    T, branch = SX.sym("T", 4, 4), SX.sym("branch")
    leaf = sequence.leaf(given_of(chain, T), signs_of(sequence, branch))
    q = whole_configuration(chain, leaf.x)
    outputs: Named = [("q", q), ("valid", _valid(chain, sequence, leaf, T, branch))]
    return [("T", T), ("branch", branch)], outputs, _names(chain, sequence, leaf, branch)


def _all_built(chain: FrameChain, sequence: StepSequence) -> tuple[Named, Named]:
    T = SX.sym("T", 4, 4)
    every = all_branches(chain, sequence)
    q, residual, real = every.call([T, chain.system.p][: every.n_in()])[:3]
    columns = [whole_configuration(chain, x) for x in casadi.horzsplit(q)]
    reached = casadi.logic_and(real >= -_ROUNDING, residual <= _ROUNDING * size(chain))
    outputs: Named = [("q", casadi.horzcat(*columns)), ("valid", SX(reached))]
    return [("T", T)], outputs


_SIX = 6  # number of joints that the general method requires


def steps_or_all(chain: FrameChain, method: str) -> StepSequence | AllConfigurations:
    """Return the closed form of a chain, or the general method as a Function if there is none.

    Args:
        chain: chain that is solved for.
        method: argument of `sequence_of`, or "general".

    Raises:
        NoClosedForm, ModelError, CompilerError: errors of `sequence_of` and `all_configurations`.
    """
    if method == "general":
        return all_configurations(chain)
    try:
        return sequence_of(chain, method)
    except NoClosedForm:
        if method != "auto" or len(chain.names) != _SIX:
            raise
        return all_configurations(chain)


def all_configurations(chain: FrameChain) -> AllConfigurations:
    """Return the general method ``igm_all(T) -> q, valid, count, certain``, cached on the system.

    Raises:
        NoClosedForm: the general method does not apply to the arm.
        ModelError: the system has symbolic parameters.
        CompilerError: there is no C compiler.
    """
    from mbs.models.inverse_geometry.gathering import ILL_CONDITIONED, general_ready
    from mbs.models.inverse_geometry.target import NEARLY_SINGULAR

    system = chain.system
    if symbols := [parameter.name for parameter in system.parameters]:
        raise ModelError(
            f"{system.name}: {', '.join(symbols)} are symbols, and the general method is made for"
            " an arm in numbers; give them as numbers, or use mbs.models.inverse_geometry.solver"
        )

    def make() -> AllConfigurations:
        ready = general_ready(chain, np.zeros(0))
        if ready is None or ready.prepared.regularity < ILL_CONDITIONED:
            raise NoClosedForm(
                f"{system.name}: the general method does not hold for {', '.join(chain.names)}, it"
                " is for six joints of which one turns, in a regular arrangement; use"
                " mbs.models.inverse_geometry.solve"
            )
        others = np.array(system.position(chain.locked))
        code = general_function("mbs_igm_all", ready.handed, chain.indices, others, NEARLY_SINGULAR)
        T = casadi.MX.sym("T", 4, 4)
        names = [code.name_out(k) for k in range(code.n_out())]
        return AllConfigurations(Function("igm_all", [T], code.call([T]), ["T"], names), chain)

    made: AllConfigurations = system.cached(("all configurations", *chain.key), make)
    return made


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


def _valid(chain: FrameChain, sequence: StepSequence, leaf: Leaf, T: SX, branch: SX) -> SX:
    error = relative_residual(forward(chain, leaf.x), T, size(chain))
    real = casadi.mmin(casadi.vertcat(leaf.real, SX(1)))
    known = casadi.logic_and(branch >= 0, branch <= sequence.branches - 1)
    good = casadi.logic_and(real >= -_ROUNDING, error <= _ROUNDING)
    return SX(casadi.logic_and(known, good))


def _names(chain: FrameChain, sequence: StepSequence, leaf: Leaf, branch: SX) -> Named:
    """Return named scalars for printed equations: signs, sines, cosines and coefficients."""
    signs = casadi.vertsplit(signs_of(sequence, branch)) if sequence.signs else []
    named = [(f"sign_{name}", sign) for name, sign in zip(sequence.signs, signs, strict=True)]
    for k, name in enumerate(chain.names):
        if not chain.prismatic[k]:
            label = joint_label(name)
            named += [(f"S{label}", casadi.sin(leaf.x[k])), (f"C{label}", casadi.cos(leaf.x[k]))]
    named += leaf.coefficients.items()
    changing = [(name, value) for name, value in named if not value.is_constant()]
    opposite = [(f"minus_{name}", -value) for name, value in changing if _is_negative(value)]
    return [*changing, *opposite]


def _is_negative(value: SX) -> bool:
    """Whether an expression is a negation, whose operand is used in the equations."""
    return bool(value.op() == casadi.OP_NEG)


def joint_label(name: str) -> str:
    """Return the suffix of names derived from a coordinate: "2" for q2, else the name itself."""
    return name[1:] if re.fullmatch(r"q\d+", name) else name


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
