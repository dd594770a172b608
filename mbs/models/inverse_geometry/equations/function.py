"""The inverse geometric model as a Function of the pose and the number of a branch."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

import casadi
import numpy as np
from casadi import DM, SX, Function

from mbs.assembly import System
from mbs.assembly.model_function import (
    ModelFunction,
    Named,
    model_function,
    require_system,
)
from mbs.errors import ModelError
from mbs.loops.sequence import Leaf, Sequence, Step
from mbs.models.inverse_geometry.chain import Chain, chain
from mbs.models.inverse_geometry.equations.characteristic_function import characteristic_function
from mbs.models.inverse_geometry.equations.closed_form import (
    CLOSED_FORMS,
    given_of,
    require_method,
    sequence_of,
)
from mbs.models.inverse_geometry.equations.forward import forward, relative_residual, size
from mbs.models.inverse_geometry.pose_input import wanted_pose

METHODS = ("auto", *CLOSED_FORMS, "general")

_ROUNDING = 1e-9
"""Of radicands, free of units, and of the residual in sizes of the chain."""


class InverseGeometry(ModelFunction):
    """A closed form ``igm(T, branch) -> q, valid``, and how its branches and steps are called."""

    def __init__(self, function: Function, system: System, sequence: Sequence, annotate: Any):
        super().__init__(function, system, annotate)
        self._sequence = sequence

    @property
    def branches(self) -> int:
        """How many branches there are: `branch` is 0 .. branches - 1."""
        return self._sequence.branches

    @property
    def labels(self) -> tuple[str, ...]:
        """The signs of every branch, such as "q3:+ q2:- q5:+"."""
        return tuple(self._sequence.label(b) for b in range(self.branches))

    @property
    def steps(self) -> tuple[Step, ...]:
        """The equations in the order in which they are solved."""
        return tuple(self._sequence.steps)

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        """Evaluate it as any model; a branch and a pose given in numbers must be such."""
        T = kwargs.get("T", args[0] if args else None)
        if isinstance(T, (DM, np.ndarray, list, tuple)) and np.shape(np.array(T)) == (4, 4):
            wanted_pose(self.system, T)
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


def function(
    system: System,
    method: str = "auto",
    frame: str | int | None = None,
    locked: Mapping[str, float] | None = None,
) -> Function:
    """``igm(T, branch) -> q, valid``: the joint positions of one branch, without iteration.

    One graph serves all branches. It can be differentiated with respect to T and to the
    parameters wherever the posture is not singular.

    Source: Pieper 1968; Paul 1981; Khalil & Creusot 1997, section 3.3.

    Args:
        system: open; a closed one is solved by `mbs.models.inverse_geometry.solve`.
        method: "pieper", "paul", "auto" for the cheaper of them, or "general" for the matrices
            ``igm_characteristic(T) -> M0, M1, M2`` of the method of Raghavan and Roth.
        frame: a body, a named frame, the number of a link, or None for the terminal frame.
        locked: positions of joints that stay where they are, by name [rad or m].

    Returns:
        InverseGeometry, a Function of T (4, 4) [m], the pose of the frame seen from the base, and
        of the number of the branch; q (nq, 1) [rad or m], finite for every T, joints outside the
        chain as in the assembled posture; valid, 1 where q gives T back within 1e-9 of the size
        of the robot, else 0.

    Raises:
        NoClosedForm: no closed form is known; the message says what stood in the way.
        ModelError: there is no such method, frame or joint, more than six joints are free, or
            the system is closed.
    """
    require_system(system)
    require_method(system, method, METHODS)
    way = chain(system, frame, locked)
    if method == "general":
        return characteristic_function(way)
    _require_open(system)
    sequence = sequence_of(way, method)

    def make() -> Function:
        key = ("igm", method, *way.key)
        plain: Any = model_function(system, key, lambda: _built(way, sequence))
        return InverseGeometry(Function(plain), system, sequence, plain.annotated)

    made: Function = system.cached(("inverse geometry", method, *way.key), make)
    return made


def _require_open(system: System) -> None:
    if system.is_closed:
        raise ModelError(
            f"{system.name}: its loops must be closed too, and no Function does both; use"
            " mbs.models.inverse_geometry.solve"
        )


def _built(way: Chain, sequence: Sequence) -> tuple[Named, Named, Named]:
    T, branch = SX.sym("T", 4, 4), SX.sym("branch")
    leaf = sequence.leaf(given_of(way, T), signs_of(sequence, branch))
    q = whole_posture(way, leaf.x)
    outputs: Named = [("q", q), ("valid", _valid(way, sequence, leaf, T, branch))]
    return [("T", T), ("branch", branch)], outputs, _names(way, sequence, leaf, branch)


def signs_of(sequence: Sequence, branch: SX) -> SX:
    """(signs, 1) +1 or -1: the bits of the number of a branch, from the highest on."""
    count = len(sequence.signs)
    halves = [casadi.floor((branch + 0.5) / 2**k) for k in range(count + 1)]
    bits = [halves[k] - 2 * halves[k + 1] for k in reversed(range(count))]
    return SX(casadi.vertcat(*(1 - 2 * bit for bit in bits)))


def whole_posture(way: Chain, x: SX) -> SX:
    """(nq, 1) positions of all joints: x of the chain's, the others locked or as assembled."""
    q = SX(DM(way.system.position(way.locked)))
    q[list(way.places)] = x
    return q


def _valid(way: Chain, sequence: Sequence, leaf: Leaf, T: SX, branch: SX) -> SX:
    error = relative_residual(forward(way, leaf.x), T, size(way))
    real = casadi.mmin(casadi.vertcat(leaf.real, SX(1)))
    known = casadi.logic_and(branch >= 0, branch <= sequence.branches - 1)
    good = casadi.logic_and(real >= -_ROUNDING, error <= _ROUNDING)
    return SX(casadi.logic_and(known, good))


def _names(way: Chain, sequence: Sequence, leaf: Leaf, branch: SX) -> Named:
    """The scalars that text names: signs, sines and cosines of the joints, coefficients."""
    signs = casadi.vertsplit(signs_of(sequence, branch)) if sequence.signs else []
    named = [(f"sign_{name}", sign) for name, sign in zip(sequence.signs, signs, strict=True)]
    for k, name in enumerate(way.names):
        if not way.prismatic[k]:
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
