"""Inverse geometric model as a CasADi Function of one branch or of all configurations."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import casadi
import numpy as np
from casadi import DM, SX, Function
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.assembly.model_function import ModelFunction, Named, model_function, require_system
from mbs.closed_forms.arm_core import general_function
from mbs.closed_forms.sequence import Leaf, SequenceStep, StepSequence
from mbs.errors import ModelError, NoClosedForm
from mbs.models.inverse_geometry.branches import branch_labels
from mbs.models.inverse_geometry.chain import FrameChain, frame_chain, target_pose, target_poses
from mbs.models.inverse_geometry.closed_form import (
    CLOSED_FORMS,
    all_branches,
    characteristic_function,
    forward,
    given_of,
    relative_residual,
    require_method,
    sequence_of,
    signs_of,
    size,
    whole_configuration,
)
from mbs.models.inverse_geometry.draft import regular_general
from mbs.models.inverse_geometry.draft_many import closed_form_draft
from mbs.models.inverse_geometry.target import NEARLY_SINGULAR
from mbs.text import joint_label, quoted

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
        one = np.ndim(T) == 2
        poses = target_poses(self.system, [T] if one else T)
        p, none = np.array(self.system.parameter_values(parameters)), np.zeros((len(poses), 0))
        found = ~closed_form_draft(self._chain, self._sequence, p, poses, none).searched
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
    system = chain.system
    if symbols := [parameter.name for parameter in system.parameters]:
        raise ModelError(
            f"{system.name}: {', '.join(symbols)} are symbols, and the general method is made for"
            " an arm in numbers; give them as numbers, or use mbs.models.inverse_geometry.solver"
        )

    def make() -> AllConfigurations:
        ready = regular_general(chain, np.zeros(0))
        if ready is None:
            raise NoClosedForm(
                f"{system.name}: the general method does not hold for {', '.join(chain.names)}, it"
                " is for six joints of which one turns, in a regular arrangement; use"
                " mbs.models.inverse_geometry.solve"
            )
        others = np.array(system.position(chain.locked))
        code = general_function("mbs_igm_all", ready.c_loop, chain.indices, others, NEARLY_SINGULAR)
        T = casadi.MX.sym("T", 4, 4)
        names = [code.name_out(k) for k in range(code.n_out())]
        return AllConfigurations(Function("igm_all", [T], code.call([T]), ["T"], names), chain)

    made: AllConfigurations = system.cached(("all configurations", *chain.key), make)
    return made


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
