"""The symbols of a model: positions, and velocities in tree or independent coordinates."""

from __future__ import annotations

from dataclasses import dataclass

import casadi
from casadi import SX

from mbs.assembly import System
from mbs.assembly.model_function import PostureCheck, require_system
from mbs.errors import ModelError
from mbs.loops.examine import LED
from mbs.loops.reduction import Reduction, reduction
from mbs.recursions.poses import LinkPose, link_poses
from mbs.recursions.tree_factorization import velocity_antecedents

COORDINATES = ("independent", "tree")


@dataclass(frozen=True, slots=True, eq=False)
class ModelSymbols:
    """Positions and velocities of a system, and how the tree follows the independent joints.

    Attributes:
        q: (nq, 1) positions of the tree; they close the loops.
        v: (m, 1) velocities that are the model's input.
        v_tree: (nv, 1) velocities of the tree that follow.
        suffix: "_a" where the inputs are the independent ones of a closed system.
        reduction: None in tree coordinates.
        poses: of every link with respect to its antecedent.
    """

    q: SX
    v: SX
    v_tree: SX
    suffix: str
    reduction: Reduction | None
    poses: list[LinkPose]

    @property
    def size(self) -> int:
        """Number of velocities that are input."""
        return int(self.v.numel())

    def tree_acceleration(self, a: SX) -> SX:
        """(nv, 1) accelerations of the tree for the accelerations a of the input coordinates."""
        if self.reduction is None:
            return a
        assert self.reduction.gamma is not None
        return casadi.mtimes(self.reduction.G, a) + self.reduction.gamma

    def reduced_effort(self, tau: SX) -> SX:
        """Efforts of the tree brought to the input coordinates: G' tau."""
        return tau if self.reduction is None else casadi.mtimes(self.reduction.G.T, tau)

    def reduced_matrix(self, A: SX) -> SX:
        """G' A G."""
        if self.reduction is None:
            return A
        G = self.reduction.G
        return casadi.mtimes(G.T, casadi.mtimes(A, G))

    def input(self, name: str) -> tuple[str, SX]:
        """An input in the same coordinates as the velocities, such as ("a_a", symbol)."""
        label = name + self.suffix
        return label, SX.sym(label, self.size)


def posture_check(system: System, coordinates: str) -> PostureCheck | None:
    """What refuses the postures that a model in these coordinates cannot take.

    Those of a reduced model close the loops, and its independent joints lead the others there.
    """
    require_system(system)
    return LED if is_reduced(system, coordinates) else None


def check_coordinates(system: System, coordinates: str) -> None:
    """Refuse a word that names no coordinates.

    Raises:
        ModelError: says which words there are.
    """
    if coordinates not in COORDINATES:
        raise ModelError(
            f"{system.name}: coordinates is {coordinates!r}; use 'independent' or 'tree'"
        )


def is_reduced(system: System, coordinates: str) -> bool:
    """Whether these are the coordinates of the independent joints of a closed system."""
    return system.is_closed and coordinates == "independent"


def symbols_of(system: System, coordinates: str = "independent") -> ModelSymbols:
    """Fresh symbols of a system.

    Args:
        system: any.
        coordinates: "independent" or "tree"; they are the same in an open chain.

    Raises:
        ModelError: another word was given.
    """
    check_coordinates(system, coordinates)
    q = SX.sym("q", system.nq)
    poses = link_poses(system.tree, q)
    if not is_reduced(system, coordinates):
        v = SX.sym("v", system.nv)
        return ModelSymbols(q, v, v, "", None, poses)
    v = SX.sym("v_a", len(system.active))
    reduced = reduction(system, q, v)
    # dense: joints of a sub-loop that cannot move have structural zeros in G, and `substitute`
    # takes vectors of one pattern only
    v_tree = casadi.densify(casadi.mtimes(reduced.G, v))
    return ModelSymbols(q, v, v_tree, "_a", reduced, poses)


def solution_order(system: System, s: ModelSymbols) -> list[int]:
    """For each velocity that is input, the one before it in A; see `factorized`."""
    if s.reduction is None:
        return velocity_antecedents(system.tree)
    return list(range(-1, s.size - 1))
