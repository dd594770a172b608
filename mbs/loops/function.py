"""Positions of the whole tree as an explicit Function of the independent ones, on one branch."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from casadi import DM, SX, Function

from mbs.assembly import System
from mbs.assembly.model_function import ModelFunction, Named, model_function
from mbs.errors import ModelError, Unclosable
from mbs.loops.closed_form.places import extent, independent_places
from mbs.loops.closed_form.plan import plan
from mbs.loops.closed_form.stage import Stage
from mbs.loops.closing import Vector, closure_parameters
from mbs.loops.independent import (
    Given,
    independent_names,
    independent_positions,
)
from mbs.loops.reach import reachable
from mbs.messages import did_you_mean, quoted

Branch = str | Sequence[str] | None
"""Labels such as "j3:+", in one text with commas or as a sequence; None for the assembled one."""


class LoopFunction(ModelFunction):
    """A closed form; where it gives no posture a call says what the joints can reach."""

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        """Evaluate it as any model.

        Raises:
            Unclosable: no posture has these positions on this branch.
            ModelError: an argument does not fit.
        """
        try:
            return super().__call__(*args, **kwargs)
        except ModelError:
            given = self._numbers(args, kwargs)
            if given is None:
                raise
            raise Unclosable(self._refusal(*given)) from None

    def _numbers(
        self, args: tuple[Any, ...], kwargs: dict[str, Any]
    ) -> tuple[Vector, Vector] | None:
        """q_a and p where they are finite numbers of the right size for which there is no q."""
        try:
            given = self._given(args, kwargs)
            q_a = np.array(DM(given["q_a"]), dtype=float).ravel()
            p = np.array(DM(given.get("p", [])), dtype=float).ravel()
        except (ModelError, NotImplementedError, TypeError, ValueError):
            return None
        sizes = len(self.system.free), len(self.system.parameters)
        fits = (q_a.size, p.size) == sizes
        return (q_a, p) if fits and np.all(np.isfinite(q_a)) and np.all(np.isfinite(p)) else None

    def _refusal(self, q_a: Vector, p: Vector) -> str:
        names = independent_names(self.system)
        at = ", ".join(f"{name} = {value:.4g}" for name, value in zip(names, q_a, strict=True))
        return f"{self.system.name}: no posture on this branch has {at}; " + reachable(
            self.system, self, q_a, p
        )


def function(system: System, branch: Branch = None) -> Function:
    """``loops(q_a) -> q``: the posture for positions of the independent joints, without iteration.

    It can be differentiated as often as one likes. Angles that a loop gives are
    within half a turn of zero.

    Args:
        system: the assembled mechanism.
        branch: labels of `mbs.loops.modes`, such as "j3:+"; a loop that no label names stays as
            it was assembled.

    Returns:
        Function of q_a (m, 1) and the parameters p where there are any; q (nq, 1) [rad or m].
        Called with numbers that no posture of the branch has, it raises Unclosable and says what
        can be reached; within symbols and maps q is NaN there.

    Raises:
        NoClosedForm: a loop is solved by iteration only.
        ModelError: there is no such branch.
    """
    stages = plan(system)
    ways = _ways(system, stages, branch)

    def build() -> tuple[Named, Named]:
        q_a = SX.sym("q_a", len(system.free))
        return [("q_a", q_a)], [("q", _posture(system, stages, ways, q_a))]

    def make() -> Function:
        return LoopFunction(model_function(system, ("loops", ways), build), system)

    made: Function = system.cached(("closed form", ways), make)
    return made


def posture_on(
    system: System, q_active: Given, branch: Branch, parameters: Mapping[str, float] | None
) -> Vector:
    """The posture (nq,) of a branch, from positions as a user gives them.

    Raises:
        Unclosable: no posture of the branch has these positions.
        NoClosedForm: a loop is solved by iteration only.
        ModelError: a name is unknown, or a value is not finite.
    """
    loops = function(system, branch)
    p = closure_parameters(system, parameters)
    q_a = independent_positions(system, q_active)
    q = loops(q_a, p) if system.parameters else loops(q_a)
    return np.array(q).ravel()


def _posture(system: System, stages: Sequence[Stage], ways: Sequence[int], q_a: SX) -> SX:
    q = SX.zeros(extent(system))
    q[independent_places(system)] = q_a
    for stage, way in zip(stages, ways, strict=True):
        q[list(stage.places)] = stage.values(q, system.p)[:, way]
    return q[: system.nq]


def _ways(system: System, stages: Sequence[Stage], branch: Branch) -> tuple[int, ...]:
    """The number of the way in which each loop closes."""
    labels = _labels(system, branch)
    known = [label for stage in stages for label in stage.labels if label]
    for label in labels:
        if label not in known:
            raise ModelError(
                f"{system.name}: there is no branch {quoted(label)}; {did_you_mean(label, known)}"
            )
    return tuple(_way(system, stage, labels) for stage in stages)


def _labels(system: System, branch: Branch) -> list[str]:
    if branch is None:
        return []
    given = branch.split(",") if isinstance(branch, str) else branch
    try:
        return [label.strip() for label in given]
    except (AttributeError, TypeError):
        raise ModelError(
            f"{system.name}: branch is {quoted(branch)}; give labels such as 'j3:+', as"
            " mbs.loops.modes lists them"
        ) from None


def _way(system: System, stage: Stage, labels: Sequence[str]) -> int:
    named = [k for k, label in enumerate(stage.labels) if label and label in labels]
    if len(named) > 1:
        raise ModelError(
            f"{system.name}: {' and '.join(stage.labels[k] for k in named)} are two ways to close"
            f" the loop of {stage.name}; name one"
        )
    return named[0] if named else stage.chosen
