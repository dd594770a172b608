"""Closed form of any loop of revolute and prismatic joints, by Paul's method.

Source: Paul 1981, section 3.7; Khalil & Dombre 2002, section 4.4.
"""

from __future__ import annotations

import math
from dataclasses import replace

import casadi
from casadi import DM, SX

from mbs.closed_forms.paul import paul
from mbs.closed_forms.ring import closed_samples
from mbs.closed_forms.roots import LoopBranches
from mbs.closed_forms.sequence import Leaf, Problem, SequenceStep, StepSequence
from mbs.components.joints import Motion
from mbs.errors import NoClosedForm
from mbs.recursions.chain import ChainJoint, Gap, Ring
from mbs.spatial import Pose

_MOST = 6
_ENOUGH = 3
_AXES = Pose.rotation(SX(DM([[1, 0, 0], [0, 0, -1], [0, 1, 0]])))


def split(ring: Ring, q: SX, p: SX) -> LoopBranches | str:
    """Return the branches of the revolute and prismatic joints of a loop, by Paul's method.

    A spherical joint is replaced by three revolute joints, whose positions are not returned. The
    label of a branch has the signs of all steps with several roots, each named after its joint.

    Args:
        ring: loop chain.
        q: symbols of positions, cut joints included.
        p: symbols of parameters.

    Returns:
        Branches, or text that describes why the method fails.
    """
    simple = _without_spherical(ring)
    if len(simple.joints) > _MOST:
        return f"a loop determines {_MOST} revolute and prismatic joints at most"
    if all(joint.index is None for joint in simple.joints):
        return "nothing but spherical joints is unknown"
    problem = _problem(simple, q, p)
    if isinstance(problem, str):
        return problem
    try:
        sequence = paul(problem)
    except NoClosedForm as error:
        return str(error)
    return _branches_of(simple, problem, sequence)


def _without_spherical(ring: Ring) -> Ring:
    """Return the loop with each spherical joint replaced by three revolute joints."""
    joints, gaps = list[ChainJoint](), list[Gap]()
    for joint, gap in zip(ring.joints, ring.gaps, strict=True):
        gaps.append(gap)
        if joint.motion is not Motion.SPHERICAL:
            joints.append(joint)
            continue
        turn = ChainJoint(joint.name, Motion.REVOLUTE, None, 1)
        joints += [replace(turn, name=f"{joint.name}{k}") for k in (1, 2, 3)]
        gaps += [Gap(_AXES)] * 2
    return Ring(tuple(joints), tuple(gaps))


def _problem(ring: Ring, q: SX, p: SX) -> Problem | str:
    """Return the loop as a problem with joint indices from zero.

    Text on the reason instead, if the known quantities do not determine its joints.
    """
    gaps = SX(casadi.vertcat(*(casadi.vec(gap.pose.matrix) for gap in ring.gaps)))
    symbols = {symbol.name() for symbol in casadi.symvar(gaps)}
    every = [*casadi.vertsplit(q), *casadi.vertsplit(p)]
    given = SX(casadi.vertcat(SX(0, 1), *(s for s in every if s.name() in symbols)))
    samples, n = closed_samples(ring, given, p), len(ring.joints)
    if max((sample.rank for sample in samples), default=n) < n:
        return "they can move while all that is known stays"
    if len(samples) < _ENOUGH:
        return "no configuration that closes it was found"
    joints = tuple(replace(joint, index=k) for k, joint in enumerate(ring.joints))
    names = [joint.name for joint in joints] + [f"x{k + 1}" for k in range(n)]
    x = casadi.vertcat(*map(SX.sym, names))
    own = replace(ring, joints=joints)
    return Problem(own, x, given, [(sample.x, sample.given) for sample in samples])


def _branches_of(ring: Ring, problem: Problem, sequence: StepSequence) -> LoopBranches:
    """Return the branches of a loop from the sequence of steps that solves `problem`."""
    indices = {k: joint.index for k, joint in enumerate(ring.joints) if joint.index is not None}
    needed = _first_steps(sequence, set(indices))
    branches = dict[str, dict[int, SX]]()
    for branch, leaf in enumerate(needed.leaves(problem.given)):
        x = _nan_unless_real(leaf)
        branches[needed.label(branch)] = {index: SX(x[k]) for k, index in indices.items()}
    return LoopBranches(branches)


def _first_steps(sequence: StepSequence, target: set[int]) -> StepSequence:
    """Return the first steps of a sequence that solve the joints with indices `target`."""
    steps = list[SequenceStep]()
    for step in sequence.steps:
        if target:
            steps.append(step)
            target = target - set(step.indices)
    return replace(sequence, steps=tuple(steps))


def _nan_unless_real(leaf: Leaf) -> SX:
    """Return the positions (n, 1) of a branch; NaN if a radicand is negative."""
    real = leaf.real
    if real.numel() == 0:
        return leaf.x
    return SX(casadi.if_else(casadi.mmin(real) >= 0, leaf.x, math.nan))
