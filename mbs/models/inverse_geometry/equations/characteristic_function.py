"""The characteristic matrix of the general method as a Function of the pose."""

from __future__ import annotations

from typing import TYPE_CHECKING

from casadi import SX, Function

from mbs.assembly import System
from mbs.assembly.model_function import ModelFunction, Named, model_function
from mbs.models.inverse_geometry.chain import Chain
from mbs.models.inverse_geometry.equations.closed_form import given_of

if TYPE_CHECKING:
    from mbs.models.inverse_geometry.raghavan_roth.characteristic import Characteristic


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
    def slides(self) -> bool:
        """Whether it slides."""
        return self._found.slides


def characteristic_function(way: Chain) -> Function:
    """The matrices of a chain of six joints.

    Source: Raghavan & Roth 1993; Manocha & Canny 1994.

    Returns:
        CharacteristicFunction of T (4, 4) [m]; M0, M1, M2 (n, n), M2 missing where the matrix is
        linear in a joint that slides.

    Raises:
        NoClosedForm: the chain has not six joints, or the matrix is singular at every posture.
    """
    from mbs.models.inverse_geometry.raghavan_roth.characteristic import characteristic

    def make() -> Function:
        problem = way.problem()
        found = characteristic(problem)

        def build() -> tuple[Named, Named]:
            T = SX.sym("T", 4, 4)
            parts = Function("parts", [problem.given], list(found.matrices))
            every = parts.call([given_of(way, T)])
            return [("T", T)], [(f"M{k}", part) for k, part in enumerate(every)]

        plain = model_function(way.system, ("igm_characteristic", *way.key), build)
        return CharacteristicFunction(Function(plain), way.system, found)

    made: Function = way.system.cached(("characteristic matrix", *way.key), make)
    return made
