"""What a user composes: bodies, joints, the world, and the mechanism that connects them."""

from mbs.components.bodies import Body, KhalilBody, PointMass
from mbs.components.component import Component, Point
from mbs.components.coupling import Coupling
from mbs.components.joints import (
    Cylindrical,
    Fixed,
    Free,
    Joint,
    Planar,
    Prismatic,
    Revolute,
    Spherical,
    Universal,
)
from mbs.components.mechanism import Mechanism
from mbs.components.placed import Placed
from mbs.components.rigid_body import RigidBody, World
from mbs.components.rotor import Rotor
from mbs.components.solids import Box, Cylinder

__all__ = [
    "Body",
    "Box",
    "Component",
    "Coupling",
    "Cylinder",
    "Cylindrical",
    "Fixed",
    "Free",
    "Joint",
    "KhalilBody",
    "Mechanism",
    "Placed",
    "Planar",
    "Point",
    "PointMass",
    "Prismatic",
    "Revolute",
    "RigidBody",
    "Rotor",
    "Spherical",
    "Universal",
    "World",
]
