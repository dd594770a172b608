"""A loop solved joint by joint: each step one equation, its roots told apart by signs."""

from mbs.loops.sequence.problem import Problem
from mbs.loops.sequence.sequence import Leaf, Sequence
from mbs.loops.sequence.step import Step, step

__all__ = ["Leaf", "Problem", "Sequence", "Step", "step"]
