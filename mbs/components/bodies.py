"""Bodies by their numbers: mass and inertia, the ten parameters, or a point mass."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from mbs.components.component import Component
from mbs.components.inertia_rules import check_mass, check_tensor, six_of, tensor_matrix, three
from mbs.components.placement import SymbolTable
from mbs.components.rigid_body import RigidBody
from mbs.expressions import Number, Scalar, to_float, to_sx
from mbs.spatial import Inertia, vector
from mbs.spatial.inertia import TEN_PARAMETERS


@dataclass(frozen=True, slots=True)
class Body(RigidBody):
    """A body of given mass, centre of mass and inertia.

    Attributes:
        mass: [kg], zero for a frame without mass.
        com: centre of mass in the reference frame [m].
        inertia: about the centre of mass, in the axes of the reference frame [kg m^2]: three
            principal values, or Ixx Ixy Ixz Iyy Iyz Izz, or a (3, 3) symmetric matrix.

    Raises:
        DescriptionError: negative mass, or moments of inertia that no body has.
    """

    mass: Scalar = 0.0
    com: tuple[Scalar, ...] = (0.0, 0.0, 0.0)
    inertia: Any = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        Component.__post_init__(self)
        self._normalise("mass")
        object.__setattr__(self, "com", three(self.com, f"{self.name}, com"))
        object.__setattr__(self, "inertia", six_of(self.inertia, f"{self.name}, inertia"))
        check_mass(self.name, self.mass)
        check_tensor(self.name, self.inertia)

    def inertial(self, symbols: SymbolTable) -> Inertia:
        """Inertia about the origin of the reference frame."""
        com = vector(to_sx(value, symbols) for value in self.com)
        tensor = Inertia.from_parameters(
            vector([*(to_sx(value, symbols) for value in self.inertia), 0, 0, 0, 0])
        ).J
        return Inertia.about_com(to_sx(self.mass, symbols), com, tensor)


@dataclass(frozen=True, slots=True)
class KhalilBody(RigidBody):
    """A body by the ten inertial parameters about the origin of its frame, and in its axes.

    Attributes:
        XX, XY, XZ, YY, YZ, ZZ: inertia about the origin of the frame [kg m^2].
        MX, MY, MZ: first moments, mass times centre of mass [kg m].
        M: mass [kg].
        grouped: the values are base parameters (sums over several bodies), which need not
            belong to any single body, so that nothing is checked.
    """

    XX: Scalar = 0.0
    XY: Scalar = 0.0
    XZ: Scalar = 0.0
    YY: Scalar = 0.0
    YZ: Scalar = 0.0
    ZZ: Scalar = 0.0
    MX: Scalar = 0.0
    MY: Scalar = 0.0
    MZ: Scalar = 0.0
    M: Scalar = 0.0
    grouped: bool = False

    def __post_init__(self) -> None:
        Component.__post_init__(self)
        self._normalise(*TEN_PARAMETERS)
        if not self.grouped:
            check_mass(self.name, self.M)
            self._check_about_com()

    def _check_about_com(self) -> None:
        values = [to_float(getattr(self, name)) for name in TEN_PARAMETERS]
        numbers = [value for value in values if value is not None]
        if len(numbers) < len(TEN_PARAMETERS) or numbers[-1] == 0:
            return
        J = tensor_matrix(numbers[:6])
        c = np.array(numbers[6:9]) / numbers[9]
        J -= numbers[9] * (c @ c * np.eye(3) - np.outer(c, c))
        check_tensor(
            self.name,
            [Number(float(J[k, m])) for k, m in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))],
            scale=float(max(abs(np.array(numbers[:6])))),
        )

    def inertial(self, symbols: SymbolTable) -> Inertia:
        """Inertia about the origin of the reference frame."""
        return Inertia.from_parameters(
            vector(to_sx(getattr(self, name), symbols) for name in TEN_PARAMETERS)
        )


@dataclass(frozen=True, slots=True)
class PointMass(RigidBody):
    """A mass without extent at its reference frame.

    Attributes:
        mass: [kg].
    """

    mass: Scalar = 0.0

    def __post_init__(self) -> None:
        Component.__post_init__(self)
        self._normalise("mass")
        check_mass(self.name, self.mass)

    def inertial(self, symbols: SymbolTable) -> Inertia:
        """Inertia about the reference frame: only a mass."""
        zero = Inertia.zero()
        return Inertia(zero.J, zero.ms, to_sx(self.mass, symbols))
