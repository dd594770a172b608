"""Which closed form solves a chain: Pieper's, Paul's, or the cheaper of both."""

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
"""The methods that give steps, the quicker one first."""

Numbers: TypeAlias = NDArray[np.float64] | None
"""(np,) values of the parameters; None where they stay symbols."""

_FEW = 8


def sequence_of(chain: FrameChain, method: str = "auto", p: Numbers = None) -> StepSequence:
    """The steps that give the joints of a chain from the pose of its frame.

    It is kept on the system: the next call with the same arguments is free.

    Args:
        chain: what is solved for.
        method: "pieper", "paul", or "auto": Pieper's where it fits without a quartic, else the
            one with the fewest branches, and of equals the one with the fewest operations.
        p: (np,) numbers in the place of the parameters; symbols stay symbols when left out.

    Returns:
        StepSequence of the loop `chain.problem(p)`.

    Raises:
        NoClosedForm: the message says what stood in the way of each method.
        ModelError: there is no such method.
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
    """Refuse a method that is not known.

    Raises:
        ModelError: the message names those that are.
    """
    if method not in known:
        raise ModelError(
            f"{system.name}: method is {quoted(method)}, which is not known here;"
            f" {did_you_mean(method, known)}"
        )


def given_of(chain: FrameChain, T: SX, p: Numbers = None) -> SX:
    """What a sequence for p, of symbolic parameters where left out, takes for a pose T, (4, 4)."""
    parameters = chain.system.p if p is None else SX(0, 1)
    return SX(casadi.vertcat(parameters, chain.symbols, casadi.vec(T[:3, :])))


def _keep(chain: FrameChain, method: str, p: Numbers) -> StepSequence | str:
    """The steps by one method, or why there are none; kept on the system."""

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
    """Whether no other sequence is worth looking for.

    A wrist leaves no method fewer branches than Pieper's; Paul's, which takes longer to find its
    steps, is asked where that one fails or solves quartics.
    """
    return sequence.branches <= _FEW and all(one.kind != "quartic" for one in sequence.steps)


def _price(chain: FrameChain, sequence: StepSequence, p: Numbers) -> tuple[int, int]:
    """Number of branches, then of operations for all of them; kept on the system."""

    def counted() -> int:
        given = chain.problem(p).given
        every = casadi.horzcat(*(leaf.x for leaf in sequence.leaves(given)))
        return count(Function("leaves", [given], [SX(every)])).total

    operations: int = chain.system.cached(("operations", sequence), counted)
    return sequence.branches, operations


# The characteristic matrix of the general method as a Function of the pose.


class CharacteristicFunction(ModelFunction):
    """``igm_characteristic(T) -> M0, M1, M2``, and the joint whose positions it gives.

    M0 + M1 cos q + M2 sin q of a joint that turns, M0 + M1 q + M2 q^2 of one that slides, is
    singular at every solution for T.
    """

    def __init__(self, function: Function, system: System, found: Characteristic) -> None:
        super().__init__(function, system)
        self._found = found

    @property
    def joint(self) -> str:
        """The name of the joint."""
        return self._found.joint

    @property
    def prismatic(self) -> bool:
        """Whether it slides."""
        return self._found.prismatic


def characteristic_function(chain: FrameChain) -> Function:
    """The matrices of a chain of six joints.

    Source: Raghavan & Roth 1993; Manocha & Canny 1994.

    Returns:
        CharacteristicFunction of T (4, 4) [m]; M0, M1, M2 (n, n), M2 missing where the matrix is
        linear in a joint that slides.

    Raises:
        NoClosedForm: the chain has not six joints, or the matrix is singular at every
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


# How far configurations are from the target pose: the forward model of a chain on symbols.


def forward(chain: FrameChain, x: SX, p: NDArray[np.float64] | None = None) -> Pose:
    """The pose of the frame for positions x, (n, 1), of the free joints.

    Args:
        chain: from the base to the frame.
        x: positions [rad or m].
        p: (np,) numbers in the place of the parameters; symbols stay symbols when left out.
    """
    return transforms(chain.at(p), x)[-1]


def residual(pose: Pose, T: SX) -> SX:
    """The largest difference of an element between a pose and T (4, 4), in m and 1."""
    return relative_residual(pose, T, SX(1))


def relative_residual(pose: Pose, T: SX, length: SX) -> SX:
    """The same with positions in multiples of a length [m]."""
    turned = casadi.vec(pose.R - T[:3, :3])
    return SX(casadi.mmax(casadi.fabs(casadi.vertcat(turned, (pose.p - T[:3, 3]) / length))))


def size(chain: FrameChain, p: NDArray[np.float64] | None = None) -> SX:
    """A length of the chain's size [m], 1 where all its ways are turns alone."""
    lengths = [casadi.norm_2(gap.p) for gap in chain.at(p).between if not gap.p.is_zero()]
    return SX(sum(lengths, SX(0))) if lengths else SX(1)


# The inverse geometric model as a Function of the pose and the number of a branch.


METHODS = ("auto", *CLOSED_FORMS, "general")

_ROUNDING = 1e-9
"""Of radicands, free of units, and of the residual in sizes of the chain."""


class InverseGeometry(ModelFunction):
    """A closed form ``igm(T, branch) -> q, valid``, and how its branches and steps are called."""

    def __init__(
        self, function: Function, chain: FrameChain, sequence: StepSequence, annotate: Any
    ):
        super().__init__(function, chain.system, annotate)
        self._chain, self._sequence = chain, sequence

    @property
    def branches(self) -> int:
        """How many branches there are: `branch` is 0 .. branches - 1."""
        return self._sequence.branches

    @property
    def labels(self) -> tuple[str, ...]:
        """The name of every branch, as in the answers of `solve`.

        They are those of shoulder, elbow and wrist of an arm that has them, else `signs`; with
        symbols among its lengths, on which names may depend, always `signs`.
        """
        from mbs.models.inverse_geometry.branches import branch_labels  # which samples branches

        if self.system.parameters:
            return self.signs
        return branch_labels(self._chain, self._sequence, np.zeros(0))

    @property
    def signs(self) -> tuple[str, ...]:
        """The signs of every branch, such as "q3:+ q2:- q5:+"."""
        return tuple(self._sequence.label(b) for b in range(self.branches))

    @property
    def steps(self) -> tuple[SequenceStep, ...]:
        """The equations in the order in which they are solved."""
        return tuple(self._sequence.steps)

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        """Evaluate it as any model; a branch and a pose given in numbers must be such."""
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
    """A closed form ``igm_all(T) -> q, valid`` of all branches, a column each.

    Next to singular configurations rounding of T decides whether branches are valid: see `certain`.
    """

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        """Evaluate it as any model; a pose given in numbers must be one."""
        _require_pose(self.system, args, kwargs)
        return ModelFunction.__call__(self, *args, **kwargs)

    def certain(
        self, T: Any, parameters: Mapping[str, float] | None = None
    ) -> bool | NDArray[np.bool_]:
        """Return whether rounding of a pose cannot change which branches are valid.

        It may next to a singular configuration: branches meet there, or a joint is left
        undetermined. `solve` and `solve_many` list all configurations there.

        Args:
            T: (4, 4) pose, or (N, 4, 4) poses [m].
            parameters: values of symbols, the others at their defaults.

        Returns:
            One value for one pose, else (N,).

        Raises:
            ModelError: a matrix is no rigid transform, or a symbol has no value.
        """
        from mbs.models.inverse_geometry.many import draft_solutions  # which calls closed forms

        one = np.ndim(T) == 2
        poses = target_poses(self.system, [T] if one else T)
        p, none = np.array(self.system.parameter_values(parameters)), np.zeros((len(poses), 0))
        found = ~draft_solutions(self._chain, self._sequence, p, poses, none).searched
        return bool(found[0]) if one else found


class AllConfigurations(ModelFunction):
    """The general method ``igm_all(T) -> q, valid, count, certain``, a column a configuration.

    Columns that no configuration fills are NaN, `valid` 0; they come last.
    """

    may_be_nan = ("q",)

    def __init__(self, function: Function, chain: FrameChain) -> None:
        super().__init__(function, chain.system)
        self._chain = chain

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        """Evaluate it as any model; a pose given in numbers must be one."""
        _require_pose(self.system, args, kwargs)
        return super().__call__(*args, **kwargs)

    def example(self, name: str) -> NDArray[np.float64] | None:
        """A pose that the arm has."""
        q = 0.3 + 0.2 * np.sin(np.arange(len(self._chain.names)))  # where no joint is special
        return np.array(self._chain.arm(np.zeros(0)).pose(q)) if name == "T" else None

    def __reduce__(self) -> tuple[Any, ...]:
        """A pickle holds what it was made of, and is compiled where it is read."""
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
    """``igm(T, branch) -> q, valid``: the joint positions of one branch, without iteration.

    One graph serves all branches; with ``branches="all"`` it is ``igm_all(T) -> q, valid``, a
    column for each, which share their common steps. It can be differentiated with respect to T and
    to the parameters wherever the configuration is not singular.

    Where an arm of six joints has no closed form, and with method="general", ``branches="all"``
    gives ``igm_all(T) -> q, valid, count, certain`` of C code: all configurations, up to 16, by the
    general method. It can be differentiated once, with respect to T.

    Source: Pieper 1968; Paul 1981; Khalil & Creusot 1997, section 3.3; Raghavan & Roth 1993.

    Args:
        system: open; a closed one is solved by `mbs.models.inverse_geometry.solve`.
        method: "pieper", "paul", "auto" for the cheaper of them, or "general" for the matrices
            ``igm_characteristic(T) -> M0, M1, M2`` of the method of Raghavan and Roth, and with
            branches="all" for its configurations.
        frame: a body, a named frame, the number of a link, or None for the terminal frame.
        locked: positions of joints that stay where they are, by name [rad or m].
        branches: "one", whose number is an input, or "all" in one call.

    Returns:
        InverseGeometry, a Function of T (4, 4) [m], the pose of the frame seen from the base, and
        of the number of the branch; q (nq, 1) [rad or m], finite for every T, joints outside the
        chain as in the assembled configuration; valid, 1 where q gives T back within 1e-9 of the
        size of the robot, else 0. AllBranches has no number; q (nq, branches), valid (branches, 1);
        its method `certain(T)` is False where rounding of T may change which branches are valid.
        AllConfigurations: q (nq, 16), each residual at most 1e-12 of max(1 m, the length), columns
        from `count` on NaN; valid (16, 1), 1 for the columns before; certain, 0 where a
        configuration may be missing, next to a singular one, or T is no rigid transform.

    Raises:
        NoClosedForm: no closed form is known; the message says what stood in the way.
        ModelError: there is no such method, frame or joint, more than six joints are free, or
            the system is closed; or the general method holds for its numbers alone, and some are
            symbols.
        CompilerError: all configurations of the general method are asked for, and there is no C
            compiler.
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


_SIX = 6  # joints that the general method is for


def steps_or_all(chain: FrameChain, method: str) -> StepSequence | AllConfigurations:
    """The steps of a closed form; where there is none, all configurations by the general method.

    Args:
        chain: what is solved for.
        method: as of `sequence_of`, or "general".

    Raises:
        NoClosedForm, ModelError, CompilerError: as of `sequence_of` and `all_configurations`.
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
    """``igm_all(T) -> q, valid, count, certain`` of a chain of six joints; kept on the system.

    Raises:
        NoClosedForm: the general method does not hold for the arm.
        ModelError: it has not six joints, or some length is a symbol.
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
    """(signs, 1) +1 or -1: the bits of the number of a branch, from the highest on."""
    count = len(sequence.signs)
    halves = [casadi.floor((branch + 0.5) / 2**k) for k in range(count + 1)]
    bits = [halves[k] - 2 * halves[k + 1] for k in reversed(range(count))]
    return SX(casadi.vertcat(*(1 - 2 * bit for bit in bits)))


def whole_configuration(chain: FrameChain, x: SX) -> SX:
    """(nq, 1) positions of all joints: x of the chain's, the others locked or as assembled."""
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
    """The scalars that text names: signs, sines and cosines of the joints, coefficients."""
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
    """Whether it is the opposite of an expression, which then stands in the equations alone."""
    return bool(value.op() == casadi.OP_NEG)


def joint_label(name: str) -> str:
    """What stands for a coordinate in other names: 2 for q2, the name itself for others."""
    return name[1:] if re.fullmatch(r"q\d+", name) else name


# All branches of the inverse geometric model at once, in one graph without sines of angles.


_SEED = 20260111
_OUTPUTS = ("q", "residual", "real", "regular", "mark")


def all_branches(
    chain: FrameChain, sequence: StepSequence, p: NDArray[np.float64] | None = None
) -> Function:
    """``igm_all(T) -> q, residual, real, regular, mark``: a column for every branch.

    Args:
        chain: what is solved for; positions of its varied joints are the last input r.
        sequence: its steps, for the same p.
        p: (np,) numbers in the place of the parameters; else they are a second input p.

    Returns:
        Function of T (4, 4); q (n, branches) of the chain's joints [rad or m], finite; residual
        (branches, 1), the largest difference of an element between the forward model and T, in m
        and 1; real and regular (branches, 1), the smallest of each kind in `Leaf`; mark
        (branches, 1), a number that is the same for equal configurations, and hardly for others.
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
    """What `all_branches` gives for N poses.

    Attributes:
        q: (N, branches, n) positions of the chain's joints [rad or m].
        residual, real, regular, mark: (N, branches).
    """

    q: NDArray[np.float64]
    residual: NDArray[np.float64]
    real: NDArray[np.float64]
    regular: NDArray[np.float64]
    mark: NDArray[np.float64]


def plain_branches(chain: FrameChain, sequence: StepSequence, p: NDArray[np.float64]) -> Function:
    """`all_branches` for numbers p, (np,); kept on the system."""
    key = ("igm_all", sequence, *chain.key, p.tobytes())
    plain: Function = chain.system.cached(key, lambda: all_branches(chain, sequence, p))
    return plain


def at_poses(
    plain: Function, T: NDArray[np.float64], r: NDArray[np.float64] | None = None
) -> PoseBatch:
    """What `all_branches` gives for poses, by the interpreter, which needs no compiler first.

    Args:
        plain: `all_branches`.
        T: (N, 4, 4) the poses [m].
        r: (N, k) positions of varied joints [rad or m], where there are any.
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
    """A generic combination of slides and of sines and cosines of turns."""
    weights = np.random.default_rng(_SEED).uniform(0.5, 1.0, (len(chain.names), 2))
    mark = SX(0)
    for k, (a, b) in enumerate(weights):
        mark += a * x[k] if chain.prismatic[k] else a * casadi.sin(x[k]) + b * casadi.cos(x[k])
    return mark


def _larger(a: SX, b: SX) -> SX:
    """The larger number, in operations that processors have in vectors."""
    return SX(0.5 * (a + b + casadi.fabs(a - b)))


def _smallest(values: SX) -> SX:
    """The smallest of numbers, and 1."""
    return functools.reduce(_smaller, casadi.vertsplit(values), SX(1))


def _smaller(a: SX, b: SX) -> SX:
    return SX(0.5 * (a + b - casadi.fabs(a - b)))


def without_sines(graph: Graph) -> Graph:
    """The same Function with y/hypot(x, y) and x/hypot(x, y) in the place of sin, cos of atan2.

    Where x and y both vanish it has zeros.
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
