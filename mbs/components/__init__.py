"""What a user composes: bodies, joints, the world, and the mechanism that connects them."""

from mbs.components.bodies import (
    Body,
    Box,
    Cylinder,
    KhalilBody,
    PointMass,
    RigidBody,
    World,
)
from mbs.components.component import Component, Point
from mbs.components.joints import (
    Coupling,
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
from mbs.components.mechanism import Mechanism, Placed

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
    "Spherical",
    "Universal",
    "World",
]
