"""Bodies with given inertia, homogeneous solids, the world, and checks of inertias."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from mbs.components.component import (
    Component,
    ElementaryRotation,
    Point,
    Rotation,
    Step,
    SymbolTable,
    displacement,
)
from mbs.components.notes import ImportNote
from mbs.errors import DescriptionError
from mbs.expressions import Expression, Number, Scalar, expression, to_float, to_sx
from mbs.spatial import Inertia, vector
from mbs.spatial.inertia import TEN_PARAMETERS
from mbs.text import quoted

# Checks of masses and inertias, and conversion of the forms in which they may be given.


_TOLERANCE = 1e-6
"""Tolerance of negative moments of inertia relative to the largest moment, and relative tolerance
of equal elements of a tensor: files have six or seven digits."""
_LARGEST = 1e30
"""Largest mass, length or moment in SI units: a product of four of them is still finite."""
_ZERO = 1e-12
"""Element of a tensor [kg m^2] that counts as rounding of zero, as in a rotated symmetric tensor:
bodies that small are not described in kg and m."""


GROUPED = (
    "or grouped=True for base parameters, which are sums over several bodies (grouped = true in"
    " TOML, the comment (* grouped 3 = 1 *) for frame 3 in a .par file)"
)
"""Remedy in error messages about inertias: declare the values as base parameters."""


def check_mass(name: str, mass: Scalar) -> None:
    """Raise DescriptionError if a mass is a negative number; symbolic masses pass.

    Args:
        name: name of the body, for the message.
        mass: mass [kg].
    """
    value = to_float(mass)
    if value is not None and value < 0:
        raise DescriptionError(f"{name}: mass is {value:g} kg; give zero or more")


def _require_mass(name: str, kind: str, given: Scalar | None, other: str = "") -> Scalar:
    """Return `given`, the mass or density of a body. Raise DescriptionError if it is None.

    `name` and `kind` are name and class of the body and `other` the second possible field, for the
    message.
    """
    if given is None:
        ways = f"mass= [kg] or {other} [kg/m^3]" if other else "mass= [kg]"
        raise DescriptionError(
            f"{name}: this {kind} has no mass; give {ways}, or mass=0 for a frame without mass"
        )
    return given


def check_tensor(
    name: str, six: Iterable[Scalar], scale: float = 0.0, remedy: str = "give a positive tensor"
) -> None:
    """Raise DescriptionError if a principal moment of inertia is a negative number.

    Args:
        name: name of the body, for the message.
        six: Ixx Ixy Ixz Iyy Iyz Izz about the centre of mass [kg m^2].
        scale: magnitude of the terms from which `six` was subtracted, which sets the rounding
            error.
        remedy: end of the message.
    """
    low, _, high = _principal_moments(six)
    if low < -_TOLERANCE * max(abs(high), scale):
        raise DescriptionError(
            f"{name}: the inertia about the centre of mass has the negative principal moment"
            f" {low:g} kg m^2; {remedy}"
        )


def tensor_fault(six: Iterable[Scalar], scale: float = 0.0) -> str:
    """Return the reason why no body has these moments of inertia; empty if they are possible.

    Args:
        six: Ixx Ixy Ixz Iyy Iyz Izz about the centre of mass, without negative principal moments.
        scale: magnitude of the terms from which `six` was subtracted, which sets the rounding
            error.
    """
    low, middle, high = _principal_moments(six)
    if low + middle >= high - _TOLERANCE * max(abs(high), scale):
        return ""
    return (
        f"the principal moments {low:g}, {middle:g}, {high:g} kg m^2 break the triangle inequality"
    )


def _principal_moments(six: Iterable[Scalar]) -> tuple[float, float, float]:
    """Return the principal moments [kg m^2] in ascending order; zeros if an element is symbolic.

    `six` are Ixx Ixy Ixz Iyy Iyz Izz.
    """
    numbers = [value for value in map(to_float, six) if value is not None]
    if len(numbers) < 6:
        return 0.0, 0.0, 0.0
    low, middle, high = np.linalg.eigvalsh(tensor_matrix(numbers))
    return float(low), float(middle), float(high)


def tensor_matrix(six: list[float]) -> Any:
    """Return the symmetric (3, 3) matrix of the six elements Ixx Ixy Ixz Iyy Iyz Izz."""
    XX, XY, XZ, YY, YZ, ZZ = six
    return np.array([[XX, XY, XZ], [XY, YY, YZ], [XZ, YZ, ZZ]])


def three(values: Any, where: str) -> tuple[Expression, ...]:
    """Return the elements (x, y, z) of a vector as expressions.

    Args:
        values: three numbers, texts or expressions.
        where: name of the vector in messages.

    Raises:
        DescriptionError: there are not three values.
    """
    try:
        x, y, z = [] if isinstance(values, str) else list(values)
    except (TypeError, ValueError):
        raise DescriptionError(
            f"{where}: {quoted(values)} has not three values; give (x, y, z)"
        ) from None
    return tuple(expression(v, f"{where}, {n}") for n, v in zip("xyz", (x, y, z), strict=True))


def six_of(values: Any, where: str) -> tuple[Expression, ...]:
    """Return Ixx Ixy Ixz Iyy Iyz Izz [kg m^2] of an inertia in any of three forms.

    Args:
        values: three principal moments, six elements, or a symmetric (3, 3) matrix.
        where: name of the inertia in messages.

    Raises:
        DescriptionError: the value has none of these forms, or the matrix is not symmetric.
    """
    flat: list[Any] = []
    for value in values if hasattr(values, "__len__") and not isinstance(values, str) else [values]:
        nested = hasattr(value, "__len__") and not isinstance(value, str)
        flat.extend(value if nested else [value])
    elements = [expression(value, where) for value in flat]
    zero: Expression = Number(0.0)
    if len(elements) == 3:
        return elements[0], zero, zero, elements[1], zero, elements[2]
    if len(elements) == 6:
        return tuple(elements)
    if len(elements) == 9 and all(_equal(elements[a], elements[b]) for a, b in _TWINS):
        return tuple(elements[k] for k in (0, 1, 2, 4, 5, 8))
    raise DescriptionError(
        f"{where}: {quoted(values)} is not an inertia; give three principal moments,"
        " Ixx Ixy Ixz Iyy Iyz Izz, or a symmetric (3, 3) matrix"
    )


_TWINS = ((1, 3), (2, 6), (5, 7))


def _equal(a: Expression, b: Expression) -> bool:
    """Return whether two elements of a tensor are equal, with a tolerance if both are numbers."""
    if isinstance(a, Number) and isinstance(b, Number):
        return math.isclose(a.value, b.value, rel_tol=_TOLERANCE, abs_tol=_ZERO)
    return a == b


# Base class of bodies, and the two bodies without inertia: the world and a mount.


@dataclass(frozen=True, slots=True)
class RigidBody(Component):
    """Component with a reference frame, relative to which other frames are placed."""

    @property
    def frame(self) -> Point:
        """The reference frame of the body, as a point to connect."""
        return Point(self)

    def at(
        self, x: Scalar = 0, y: Scalar = 0, z: Scalar = 0, *, rotation: Rotation | None = None
    ) -> Point:
        """Return a frame that is displaced relative to the reference frame.

        Args:
            x: origin of the frame along x of the reference frame [m].
            y: origin along y [m].
            z: origin along z [m].
            rotation: rotation of its axes relative to the reference frame; none by default.
        """
        return self.frame.at(x, y, z, rotation=rotation)

    def at_khalil(self, **parameters: Scalar) -> Point:
        """Return a frame that is placed by Khalil parameters relative to the reference frame.

        Args:
            parameters: any of the angles gamma, alpha, theta [rad] and the lengths b, d, r [m];
                zero if left out.
        """
        return self.frame.at_khalil(**parameters)

    @property
    def inertia_fault(self) -> str:
        """Reason why no real body has this inertia; empty if it is possible.

        Assembling checks it for bodies that rotate about several axes.
        """
        return ""

    def inertial(self, symbols: SymbolTable) -> Inertia:
        """Return the inertia about the origin of the reference frame, in its axes (CasADi).

        Args:
            symbols: CasADi symbol of each parameter, by name.
        """
        raise NotImplementedError


@dataclass(frozen=True, slots=True)
class World(RigidBody):
    """The ground, in whose frame gravity is given.

    Attributes:
        gravity: gravity acceleration in the world frame [m/s^2].
    """

    name: str = "world"
    gravity: tuple[Scalar, ...] = (0.0, 0.0, -9.81)

    def __post_init__(self) -> None:
        Component.__post_init__(self)
        object.__setattr__(self, "gravity", three(self.gravity, f"{self.name}, gravity"))

    def inertial(self, symbols: SymbolTable) -> Inertia:
        """Return zero inertia: the world does not move.

        Args:
            symbols: CasADi symbol of each parameter, by name.
        """
        return Inertia.zero()


@dataclass(frozen=True, slots=True)
class Mount(RigidBody):
    """A massless frame: the ground of a nested mechanism, to be connected to a body."""

    def inertial(self, symbols: SymbolTable) -> Inertia:
        """Return zero inertia: a mount has no mass.

        Args:
            symbols: CasADi symbol of each parameter, by name.
        """
        return Inertia.zero()


@dataclass(frozen=True, slots=True)
class Body(RigidBody):
    """A body with mass, centre of mass and inertia.

    Attributes:
        mass: mass [kg]; `mass=0` for a massless frame.
        com: centre of mass in the reference frame [m].
        inertia: inertia about the centre of mass, in the axes of the reference frame [kg m^2]:
            three principal values, or Ixx Ixy Ixz Iyy Iyz Izz, or a (3, 3) symmetric matrix.
        checked: Whether mass and inertia are checked. False accepts physically impossible values,
            with which inverse dynamics and the inertia matrix are still defined. Only readers of
            files set it, together with a note.

    Raises:
        DescriptionError: mass is missing or negative, or a principal moment is negative. Principal
            moments that violate the triangle inequality raise an error at assembly, or give a note
            if the body rotates about one axis only.
    """

    mass: Scalar | None = None
    com: tuple[Scalar, ...] = (0.0, 0.0, 0.0)
    inertia: Any = (0.0, 0.0, 0.0)
    checked: bool = True

    def __post_init__(self) -> None:
        Component.__post_init__(self)
        mass = _require_mass(self.name, type(self).__name__, self.mass)
        self._normalise("mass")
        object.__setattr__(self, "com", three(self.com, f"{self.name}, com"))
        object.__setattr__(self, "inertia", six_of(self.inertia, f"{self.name}, inertia"))
        if self.checked:
            check_mass(self.name, mass)
            check_tensor(self.name, self.inertia)

    @property
    def inertia_fault(self) -> str:
        """Reason why no real body has this inertia: a violated triangle inequality.

        Empty if there is no fault or `checked` is False.
        """
        return tensor_fault(self.inertia) if self.checked else ""

    def inertial(self, symbols: SymbolTable) -> Inertia:
        """Return the inertia about the origin of the reference frame, in its axes (CasADi).

        Args:
            symbols: CasADi symbol of each parameter, by name.
        """
        com = vector(to_sx(value, symbols) for value in self.com)
        tensor = Inertia.from_parameters(
            vector([*(to_sx(value, symbols) for value in self.inertia), 0, 0, 0, 0])
        ).J
        return Inertia.about_com(to_sx(self.mass or 0, symbols), com, tensor)


@dataclass(frozen=True, slots=True)
class KhalilBody(RigidBody):
    """A body with ten inertial parameters about the origin of its frame, in its axes.

    Attributes:
        XX, XY, XZ, YY, YZ, ZZ: inertia about the origin of the frame [kg m^2].
        MX, MY, MZ: first moments, mass times centre of mass [kg m].
        M: mass [kg].
        grouped: Whether the values are base parameters (sums over several bodies). They are not
            checked, since no single body needs to have them.
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
            six, scale = self._inertia_about_com()
            check_tensor(
                self.name,
                six,
                scale,
                f"give a positive tensor, {GROUPED}",
            )

    @property
    def inertia_fault(self) -> str:
        """Reason why no real body has this inertia: a violated triangle inequality.

        Empty if there is no fault, or for grouped values.
        """
        return "" if self.grouped else tensor_fault(*self._inertia_about_com())

    def _inertia_about_com(self) -> tuple[list[Scalar], float]:
        """Return the inertia about the centre of mass, and the magnitude of its terms [kg m^2].

        The inertia is Ixx Ixy Ixz Iyy Iyz Izz, empty if a parameter has no value or the mass is
        zero. Raise DescriptionError if a value is above 1e30 in SI units.
        """
        values = [to_float(getattr(self, name)) for name in TEN_PARAMETERS]
        numbers = [value for value in values if value is not None]
        if len(numbers) < len(TEN_PARAMETERS) or numbers[-1] == 0:
            return [], 0.0
        J = tensor_matrix(numbers[:6])
        with np.errstate(over="ignore"):
            c = np.array(numbers[6:9]) / numbers[9]
        largest = float(np.abs([*numbers, *c]).max())
        if largest > _LARGEST:
            raise DescriptionError(
                f"{self.name}: its parameters, or first moments by mass, reach {largest:g};"
                f" {_LARGEST:g} in SI units are the most; check them and their units"
            )
        J -= numbers[9] * (c @ c * np.eye(3) - np.outer(c, c))
        upper = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
        return [float(J[at]) for at in upper], float(max(abs(np.array(numbers[:6]))))

    def inertial(self, symbols: SymbolTable) -> Inertia:
        """Return the inertia about the origin of the reference frame, in its axes (CasADi).

        Args:
            symbols: CasADi symbol of each parameter, by name.
        """
        return Inertia.from_parameters(
            vector(to_sx(getattr(self, name), symbols) for name in TEN_PARAMETERS)
        )


@dataclass(frozen=True, slots=True)
class PointMass(RigidBody):
    """A point mass at the origin of its reference frame.

    Attributes:
        mass: mass [kg].
    """

    mass: Scalar | None = None

    def __post_init__(self) -> None:
        Component.__post_init__(self)
        mass = _require_mass(self.name, type(self).__name__, self.mass)
        self._normalise("mass")
        check_mass(self.name, mass)

    def inertial(self, symbols: SymbolTable) -> Inertia:
        """Return mass only: no first moments and no moments of inertia about the origin.

        Args:
            symbols: CasADi symbol of each parameter, by name.
        """
        zero = Inertia.zero()
        return Inertia(zero.J, zero.ms, to_sx(self.mass or 0, symbols))


# Homogeneous solids along x: their inertia follows from dimensions and density.


@dataclass(frozen=True, slots=True)
class _Bar(RigidBody):
    """Base of solids along x from a left to a right end; the reference frame is at the left end.

    Either density or mass is given; `mass=0` makes a massless solid.
    """

    length: Scalar = 1.0

    @property
    def left(self) -> Point:
        """Frame at the left end, x = 0: the reference frame."""
        return self.frame

    @property
    def right(self) -> Point:
        """Frame at the right end, x = length, with axes of the reference frame."""
        return self.at(self.length)

    @property
    def center(self) -> Point:
        """Frame at the centre of mass, x = length / 2, with axes of the reference frame."""
        return self.at(expression(self.length) / 2)

    def _check_solid(self, positive: Iterable[str]) -> None:
        """Raise DescriptionError if a numeric field in `positive` is zero or negative."""
        for name in positive:
            value = to_float(getattr(self, name))
            if value is not None and value <= 0:
                raise DescriptionError(
                    f"{self.name}: {name} is {value:g}; give a length above zero"
                )

    def _mass(self, mass: Scalar | None, density: Scalar | None, volume: Expression) -> Expression:
        """Return the mass [kg] of a solid: `mass`, or density [kg/m^3] times volume [m^3].

        Raise DescriptionError unless exactly one of mass and density is given.
        """
        if mass is not None and density is not None:
            raise DescriptionError(
                f"{self.name}: both mass and density are given; give only one of them"
            )
        if mass is not None:
            return expression(mass)
        given = _require_mass(self.name, type(self).__name__, density, "density=")
        return expression(given) * volume

    def _solid_inertia(
        self, symbols: SymbolTable, mass: Expression, radii: list[Expression]
    ) -> Inertia:
        """Return the inertia about the left end, in axes of the reference frame (CasADi).

        `mass` [kg] is that of the solid, `radii` are the squared radii of gyration about x, y, z at
        the centre of mass [m^2], and `symbols` the CasADi symbols of parameters by name.
        """
        com = vector([to_sx(expression(self.length) / 2, symbols), 0, 0])
        Ixx, Iyy, Izz = (to_sx(mass * radius, symbols) for radius in radii)
        tensor = Inertia.from_parameters(vector([Ixx, 0, 0, Iyy, 0, Izz, 0, 0, 0, 0])).J
        return Inertia.about_com(to_sx(mass, symbols), com, tensor)


@dataclass(frozen=True, slots=True)
class Box(_Bar):
    """A homogeneous cuboid along x.

    Attributes:
        length, width, height: sides along x, y and z [m]. The default of the height is the width.
        density: density [kg/m^3].
        mass: mass [kg], instead of the density.
    """

    width: Scalar = 0.1
    height: Scalar | None = None
    density: Scalar | None = None
    mass: Scalar | None = None

    def __post_init__(self) -> None:
        Component.__post_init__(self)
        if self.height is None:
            object.__setattr__(self, "height", self.width)
        self._normalise(*_given_fields(self, "length", "width", "height", "density", "mass"))
        self._check_solid(("length", "width", "height"))
        check_mass(self.name, self.solid_mass)

    @property
    def solid_mass(self) -> Expression:
        """Mass [kg]: `mass`, or density times volume."""
        volume = expression(self.length) * self.width * expression(self.height or 0)
        return self._mass(self.mass, self.density, volume)

    def inertial(self, symbols: SymbolTable) -> Inertia:
        """Return the inertia about the left end, in axes of the reference frame (CasADi).

        Args:
            symbols: CasADi symbol of each parameter, by name.
        """
        l2, w2, h2 = (expression(side or 0) ** 2 for side in (self.length, self.width, self.height))
        radii = [(w2 + h2) / 12, (l2 + h2) / 12, (l2 + w2) / 12]
        return self._solid_inertia(symbols, self.solid_mass, radii)


@dataclass(frozen=True, slots=True)
class Cylinder(_Bar):
    """A homogeneous round bar or tube along x.

    Attributes:
        length: length along x [m].
        radius: outer radius [m].
        inner_radius: radius of the bore [m].
        density: density [kg/m^3].
        mass: mass [kg], instead of the density.
    """

    radius: Scalar = 0.05
    inner_radius: Scalar = 0.0
    density: Scalar | None = None
    mass: Scalar | None = None

    def __post_init__(self) -> None:
        Component.__post_init__(self)
        self._normalise(*_given_fields(self, "length", "radius", "inner_radius", "density", "mass"))
        self._check_solid(("length", "radius"))
        inner, outer = to_float(self.inner_radius), to_float(self.radius)
        if inner is not None and (inner < 0 or (outer is not None and inner >= outer)):
            raise DescriptionError(
                f"{self.name}: inner_radius is {inner:g}; give 0 <= inner_radius < radius"
            )
        check_mass(self.name, self.solid_mass)

    @property
    def solid_mass(self) -> Expression:
        """Mass [kg]: `mass`, or density times volume without the bore."""
        area = (expression(self.radius) ** 2 - expression(self.inner_radius) ** 2) * math.pi
        return self._mass(self.mass, self.density, area * self.length)

    def inertial(self, symbols: SymbolTable) -> Inertia:
        """Return the inertia about the left end, in axes of the reference frame (CasADi).

        Args:
            symbols: CasADi symbol of each parameter, by name.
        """
        squares = expression(self.radius) ** 2 + expression(self.inner_radius) ** 2
        across = squares / 4 + expression(self.length) ** 2 / 12
        return self._solid_inertia(symbols, self.solid_mass, [squares / 2, across, across])


def _given_fields(component: Component, *names: str) -> list[str]:
    """Return the names of fields of a component that are not None."""
    return [name for name in names if getattr(component, name) is not None]


# Mount of the base of a mechanism in the world: its position and its rotation.


Mounting = Rotation | Mapping[str, Any]
"""Rotation of a base, or a dict with its "position" (x, y, z) [m] and its "rotation"."""


def mount_of(mount: Any, where: str) -> tuple[tuple[Step, ...], Rotation | None]:
    """Return the displacement steps from the world to a mounted base, and its rotation.

    Args:
        mount: rotation, or a dict with "position" and "rotation", one of which may be left out.
        where: name of the mount in error messages.

    Raises:
        DescriptionError: the dict has other entries, or values that are no position or rotation.
    """
    if not isinstance(mount, Mapping):
        return displacement(where, 0.0, 0.0, 0.0, mount), mount
    known = ("position", "rotation")
    if not mount or not set(mount) <= set(known):
        raise DescriptionError(
            f"{where} is {quoted(dict(mount))}; give a rotation, or a dict with"
            " 'position': (x, y, z) and 'rotation': ('x', 'pi')"
        )
    x, y, z = three(mount.get("position", (0.0, 0.0, 0.0)), f"{where}, position")
    rotation = mount.get("rotation")
    return displacement(where, x, y, z, rotation), rotation


_REVOLUTION = 2 * math.pi
"""Angle [rad] above which a mount angle is noted as possible degrees: a mount needs no more."""


def notes_on_degrees(steps: Iterable[Step]) -> list[ImportNote]:
    """Return a note "doubted" for each rotation by more than one revolution.

    Its angle is probably in degrees.

    Args:
        steps: displacement steps of a mount.
    """
    angles = [
        (step.axis, to_float(step.angle)) for step in steps if isinstance(step, ElementaryRotation)
    ]
    return [
        ImportNote("doubted", "mount", f"{axis} = {angle:g} rad may be degrees; give radians")
        for axis, angle in angles
        if angle is not None and abs(angle) > _REVOLUTION
    ]
