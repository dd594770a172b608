"""Inverse geometric model for a sequence of single poses, with one compiled call per pose."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbs.arguments import MadeOnce
from mbs.assembly import System
from mbs.assembly.model_function import require_system
from mbs.closed_forms.arm import Array
from mbs.closed_forms.arm_search import Nearest
from mbs.models.inverse_geometry._solve import chain_or_none, solve_rigid
from mbs.models.inverse_geometry.chain import target_pose
from mbs.models.inverse_geometry.closed_form import require_method
from mbs.models.inverse_geometry.draft import METHODS
from mbs.models.inverse_geometry.draft_compiled import CERTAIN, PoseKernel, kernel_of
from mbs.models.inverse_geometry.solutions import PoseDraft, Solutions


class PoseAnswer(PoseDraft):
    """All configurations for one pose.

    Attributes:
        q: (m, nq) configurations, angles in (-pi, pi] [rad or m].
        residual: (m,) largest absolute element of pose(q) - T [m or 1].
        labels: name of the branch of each configuration.
        singular: whether `solve` was used because the compiled call did not certify the result, as
            near a singular configuration. Copies are then merged, and `solutions` contains
            multiplicities and self-motions.
    """

    __slots__ = ("_T", "_solutions", "_solver")

    def __init__(
        self,
        q: Array,
        residual: Array,
        names: Mapping[int, str] | tuple[str, ...],
        branch: Any,
        solver: PoseSolver,
        T: Any,
        solutions: Solutions | None,
    ) -> None:
        """Store the results of a `PoseSolver`."""
        self.q, self.residual, self.certain = q, residual, solutions is None
        self.method, self.near = solver.used, None
        self._names, self._branch, self._solver, self._T = names, branch, solver, T
        self._solutions = solutions

    @property
    def singular(self) -> bool:
        """Whether `solve` computed the configurations; see the class."""
        return not self.certain

    @property
    def solutions(self) -> Solutions:
        """Result of `solve` for the pose (singular values, self-motions), computed on access."""
        if self._solutions is None:
            self._solutions = self._solver.solutions(self._T)
        return self._solutions

    @property
    def undecided(self) -> bool:
        """Whether double precision cannot decide the list of solutions; see `Solutions`."""
        return self.singular and self.solutions.undecided

    @property
    def reason(self) -> str:
        """Reason for an empty result, "" if configurations exist; computed on access."""
        return "" if len(self.q) else self.solutions.reason

    @property
    def nearest(self) -> Nearest | None:
        """Reachable pose nearest to the target, or None if there is a configuration."""
        return None if len(self.q) else self.solutions.nearest

    def __repr__(self) -> str:
        note = ", next to a singular configuration" if self.singular else ""
        return f"<PoseAnswer: {len(self)} configurations{note}>"


class PoseSolver(MadeOnce):
    """Solver for poses of a frame: ``solver(T)`` returns all configurations in microseconds.

    Attributes:
        system: robot.
        frame: frame whose pose is specified, None for the terminal frame.
        locked: positions of fixed joints, by name [rad or m].
        parameters: parameter values by name.
        method: requested method.
        used: method for regular poses; "search" if no other method applies.
        labels: names of all branches of the closed form, in order; empty without a closed form.
    """

    settings = ("system", "frame", "locked", "parameters", "method", "used", "labels")

    def __init__(
        self,
        system: System,
        frame: str | int | None,
        locked: Mapping[str, float] | None,
        parameters: Mapping[str, float] | None,
        method: str,
    ) -> None:
        """Derive and compile the solver; call `solver` instead."""
        self.system, self.frame, self.method = system, frame, method
        self.locked = None if locked is None else dict(locked)
        self.parameters = None if parameters is None else dict(parameters)
        require_method(system, method, METHODS)
        p = np.array(system.parameter_values(parameters))
        chain = chain_or_none(system, frame, locked)
        open_chain = None if chain is None or system.is_closed else chain
        self._kernel: PoseKernel | None = None
        if open_chain is not None:
            self._kernel = kernel_of(open_chain, p, method)
        self.used = self._kernel.method if self._kernel else "search"
        closed_form = self._kernel is not None and self.used != "general"
        self.labels = self._kernel.labels if self._kernel and closed_form else ()
        self._names = self._kernel.names if self._kernel else {}
        code = self._kernel.code() if self._kernel else None
        self._call = code.call if code else _decline
        self._data = code.solver if code else None
        turning = [c.kind == "revolute" for c in system.coordinates]
        self._turning: NDArray[np.bool_] = np.array(turning, dtype=bool)

    def __call__(self, T: Any) -> PoseAnswer:
        """Return all configurations for a pose.

        Args:
            T: (4, 4) pose of the frame relative to the base [m]: array of any type and memory
                order, or nested lists.

        Raises:
            ModelError: T is no rigid transform.
        """
        found = self._call(T, self._data)
        if found is not None:
            q, residual, branch, told = found
            count, state = told.tolist()
            if state == CERTAIN:
                m = int(count)
                own = np.array(T)  # the caller may write the next pose over it
                return PoseAnswer(q.T[:m], residual[:m], self._names, branch[:m], self, own, None)
        return self._in_python(target_pose(self.system, T))

    def _in_python(self, T: Array) -> PoseAnswer:
        """Solve without compiled code, or by `solve` if the result is not certified."""
        draft = self._kernel.draft(T) if self._kernel else None
        if draft is None or self._kernel is None or not draft.certain:
            found = self._solve(T)
            q = found.q
            turned = self._turning & (np.abs(q) > np.pi)
            q = np.where(turned, np.pi - np.mod(np.pi - q, 2 * np.pi), q)
            residual = np.array([s.residual for s in found])
            return PoseAnswer(q, residual, tuple(s.branch for s in found), None, self, T, found)
        q = np.empty((len(draft.q), self.system.nq))
        q[:] = self.system.position(self._kernel.chain.locked)
        q[:, list(self._kernel.chain.indices)] = draft.q
        return PoseAnswer(q, draft.residual, draft.labels, None, self, T, None)

    def solutions(self, T: Any) -> Solutions:
        """Return the result of `solve` for a pose T (4, 4) [m]."""
        return self._solve(target_pose(self.system, T))

    def _solve(self, T: Array) -> Solutions:
        return solve_rigid(
            self.system,
            T,
            self.frame,
            self.method,
            locked=self.locked,
            parameters=self.parameters,
        )

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the arguments only; the solver is compiled again on loading."""
        return _again, (self.system, self.frame, self.locked, self.parameters, self.method)

    def __repr__(self) -> str:
        return f"<PoseSolver {self.system.name}: {self.used}, {len(self.labels)} branches>"


def _decline(*_: Any) -> None:
    """Return None; substitute for the compiled call if there is no compiled code."""


def _again(system: System, frame: Any, locked: Any, parameters: Any, method: str) -> PoseSolver:
    return solver(system, frame, locked=locked, parameters=parameters, method=method)


def solver(
    system: System,
    frame: str | int | None = None,
    *,
    locked: Mapping[str, float] | None = None,
    parameters: Mapping[str, float] | None = None,
    method: str = "auto",
) -> PoseSolver:
    """Compile an inverse kinematics solver for control loops and planners.

    The closed form is derived and compiled once. A call of the result takes microseconds with a
    closed form, and a fraction of a millisecond for a general arm of six joints. Near singular
    configurations, and for robots with loops, a call uses `solve`, which takes milliseconds.
    Without a C compiler the results are equal, and a call takes a fraction of a millisecond.

    Args:
        system: serial robot, tree, or robot with closed loops.
        frame: name of a body or frame, index of a link, or None for the terminal frame.
        locked: positions of fixed joints, by name [rad or m].
        parameters: parameter values by name; default values for all others.
        method: "auto", "pieper", "paul", "general" or "search"; see `solve`.

    Returns:
        PoseSolver: callable with a pose; it can be pickled.

    Raises:
        ModelError: a name or a method is unknown, or more than six joints are free.
        NoClosedForm: method is "pieper" or "paul" and does not apply to the robot.
    """
    require_system(system)
    return PoseSolver(system, frame, locked, parameters, method)
