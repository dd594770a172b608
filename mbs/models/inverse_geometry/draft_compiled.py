"""Compiled draft of one pose: certified solutions of a closed form or the general method."""

from __future__ import annotations

import ctypes
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from casadi import SX, Function
from numpy.typing import NDArray

import mbs.closed_forms.arm_core as core
from mbs.closed_forms.arm import Array
from mbs.closed_forms.arm_search import General
from mbs.closed_forms.sequence import StepSequence
from mbs.loops.pose import pose_numbers
from mbs.models.inverse_geometry.branches import branch_labels
from mbs.models.inverse_geometry.chain import FrameChain
from mbs.models.inverse_geometry.closed_form import (
    bounds_of,
    closed_form_name,
    plain_branches,
    sequence_or_none,
)
from mbs.models.inverse_geometry.draft import regular_general
from mbs.models.inverse_geometry.draft_many import MANY, closed_form_draft, general_draft
from mbs.models.inverse_geometry.solutions import PoseDraft
from mbs.models.inverse_geometry.target import NEARLY_SINGULAR
from mbs.native._compiled import MachineCode, machine_code
from mbs.native.array_calls import array_builtin

CERTAIN, DOUBTFUL, NOT_RIGID, FAILED = range(4)
"""Status codes of the compiled solver, defined in `pose.h`."""

_CANDIDATES = 144
"""Maximum number of configurations of the general method for one pose: ROTH_CONFIGURATIONS in C."""


class PoseKernel:
    """Solver for single poses of a chain with numeric parameters.

    Attributes:
        chain: chain that is solved for.
        p: (np,) parameter values.
        arm: numeric geometry of the chain.
        method: "pieper", "paul" or "general".
        labels: names of the branches; "1", "2", ... for the general method.
        names: the same by index of the branch, which compiled code returns as a double: doubles are
            equal to integers as keys.
    """

    def __init__(
        self, chain: FrameChain, p: Array, method: str, solves: StepSequence | General
    ) -> None:
        """Store the closed form or general method; call `kernel_of` to select one."""
        self.chain, self.p, self.method = chain, p, method
        self._solves, self.arm = solves, chain.arm(p)
        if isinstance(solves, General):
            self.labels = tuple(str(k + 1) for k in range(_CANDIDATES))
        else:
            self.labels = branch_labels(chain, solves, p)
        self.names = dict(enumerate(self.labels))
        self._c_arm = core.c_arm_of(self.arm)
        self._lock = threading.Lock()
        self._code: _PoseCode | None = None
        self._buffers: _Buffers | None = None
        self._indices, self._asked = list(chain.indices), 0
        self._plain = self._indices == list(range(chain.system.nq))

    def code(self) -> _PoseCode | None:
        """Return the compiled solver, or None if it cannot be compiled."""
        with self._lock:
            if self._code is None:
                self._code = _pose_code(self.chain, self.p, self._solves)
            return self._code

    def draft(self, T: Array) -> PoseDraft:
        """Solve a rigid transform T (4, 4), which is not projected again."""
        return self._by_code(T) or self._by_arrays(T)

    def draft_of(self, T: Any) -> PoseDraft | None:
        """Solve a pose T (4, 4) of any array type; None if it is no rigid transform."""
        draft = self._by_code(T)
        if draft is not None:
            return draft
        library, numbers = core.core_of(self.arm), pose_numbers(T)
        if numbers is None or numbers.shape != (4, 4):
            return None
        pose = core.rounded_by(library, numbers)
        return None if pose is None else self._by_arrays(pose)

    def _by_code(self, T: Any) -> PoseDraft | None:
        """Solve by the compiled solver; None without one or if it rejects T."""
        self._asked += 1
        code = self._code
        if code is None and (isinstance(self._solves, General) or self._asked > MANY):
            code = self.code()  # the general method needs only the compiled core
        return None if code is None else self._read(code.call(T, code.solver))

    def _read(self, found: Any) -> PoseDraft | None:
        """Convert the result of the compiled solver; None if it rejected the pose."""
        if found is None:
            return None
        q, residual, branch, told = found
        count, state = told.tolist()
        if state in (FAILED, NOT_RIGID):
            return None
        m = int(count)
        own = q.T[:m] if self._plain else q.T[:m, self._indices]
        return self._draft(own, residual[:m], branch[:m], state == CERTAIN)

    def _draft(self, q: Array, residual: Array, branch: NDArray[Any], certain: bool) -> PoseDraft:
        return PoseDraft(q, residual, self.names, branch, certain, self.method)

    def _by_arrays(self, T: Array) -> PoseDraft:
        """Solve a rigid transform T (4, 4) without machine code of the closed form."""
        library = core.core_of(self.arm)
        if isinstance(self._solves, StepSequence):
            return self._settled(library, T, self._solves)
        if isinstance(self._solves, General):
            draft = general_draft(self._solves, T[None])
        else:
            draft = closed_form_draft(self.chain, self._solves, self.p, T[None], np.zeros((1, 0)))
        valid = np.flatnonzero(draft.valid[0])
        q = draft.q[0, valid]
        turned = np.where(self.arm.prismatic | (np.abs(q) <= np.pi), q, self.arm.wrapped(q))
        return self._draft(turned, draft.residual[0, valid], valid, not draft.searched[0])

    def _settled(self, library: ctypes.CDLL, T: Array, sequence: StepSequence) -> PoseDraft:
        """Evaluate the closed form by the CasADi interpreter, then refine by the compiled core."""
        with self._lock:
            if self._buffers is None:
                self._buffers = _Buffers(plain_branches(self.chain, sequence, self.p))
            every = self._buffers.values(T)
        found = core.settled_by(library, self._c_arm, T, every, bounds_of(sequence))
        return self._draft(*found)


class _Buffers:
    """Closed form of all branches, evaluated by the CasADi interpreter into arrays."""

    def __init__(self, plain: Function) -> None:
        buffer: Any
        buffer, self._evaluate = plain.buffer()
        self._buffer = buffer  # must outlive the evaluations
        n, branches = plain.size_out(0)
        self._T = np.empty((4, 4))  # transpose of T in C order: T in column-major order
        self._values = (np.empty((branches, n)), *(np.empty(branches) for _ in range(4)))
        buffer.set_arg(0, self._T.data)
        for k, value in enumerate(self._values):
            buffer.set_res(k, value.data)

    def values(self, T: Array) -> tuple[Array, ...]:
        """Evaluate the closed form at T (4, 4); return the arguments of `core.settled_by`."""
        self._T[:] = T.T
        self._evaluate()
        return tuple(value.copy() for value in self._values[:4])


def kernel_of(chain: FrameChain, p: Array, method: str = "auto") -> PoseKernel | None:
    """Return the solver for single poses of a chain, cached on the system.

    Args:
        chain: chain that is solved for.
        p: (np,) parameter values.
        method: "pieper", "paul", "general", "search", or "auto" for a closed form, else the
            general method.

    Returns:
        Solver, or None if only the search or other slow methods apply.

    Raises:
        NoClosedForm: method is "pieper" or "paul" and does not apply to the chain.
    """

    def made() -> PoseKernel | None:
        sequence = sequence_or_none(chain, method, p)
        if sequence is not None:
            return PoseKernel(chain, p, closed_form_name(chain, sequence, p), sequence)
        general = None if method == "search" else regular_general(chain, p)
        return None if general is None else PoseKernel(chain, p, "general", general)

    kernel: PoseKernel | None = chain.system.cached(
        ("pose kernel", method, *chain.key, p.tobytes()), made
    )
    return kernel


# Compiled solver: one builtin C function for all robots, with the data of a robot as an argument.


@dataclass(frozen=True, slots=True, eq=False)
class _PoseCode:
    """Compiled solver of a kernel.

    Attributes:
        call: function (T, solver) -> q (nq, room), residual (room,), branch (room,) and
            (count, state), or None for an invalid T.
        solver: C struct `pose_solver`, passed as an array of doubles.
        holds: objects that the struct points to, kept alive.
    """

    call: Callable[..., Any]
    solver: Array
    holds: tuple[Any, ...]


def _pose_code(chain: FrameChain, p: Array, solves: StepSequence | General) -> _PoseCode | None:
    arm, nq = chain.arm(p), chain.system.nq
    library = core.core_of(arm)
    plain = chain.indices == tuple(range(nq))
    indices = np.array(chain.indices, dtype=np.int64)
    others = np.array(chain.system.position(chain.locked))
    end = (nq, None if plain else indices.ctypes.data, others.ctypes.data)
    machine: MachineCode | None = None
    if isinstance(solves, General):
        c_arm, room, work = solves.c_loop.arm, _CANDIDATES, _CANDIDATES
        own = core.SolverStruct(
            c_arm.address, solves.c_loop.address, *[None] * 3, *[0] * 5, 0.0, NEARLY_SINGULAR, *end
        )
    else:
        machine, c_arm = machine_code(plain_branches(chain, solves, p)), core.c_arm_of(arm)
        if machine is None:
            return None
        arguments, results, integers, reals = machine.work
        room = solves.branches
        work = arguments + results + integers + reals + 3 * room
        addresses = (machine.evaluate, machine.checkout, machine.release)
        sizes = (room, arguments, results, integers, reals)
        own = core.SolverStruct(c_arm.address, None, *addresses, *sizes, *bounds_of(solves), *end)
    solver = np.frombuffer(memoryview(own).cast("B"), dtype=np.float64)
    inputs = [SX.sym("T", 4, 4), SX.sym("solver", solver.size)]
    room = max(room, 2)  # a single column would be returned as a vector
    outputs = [SX.zeros(nq, room), SX.zeros(room), SX.zeros(room), SX.zeros(2)]
    signature = Function("mbs_pose", inputs, outputs)
    call = array_builtin(signature, core.path_of(library), finite=False, more=work)
    if call is None:
        return None
    return _PoseCode(call, solver, (own, c_arm, indices, others, machine, solves))
