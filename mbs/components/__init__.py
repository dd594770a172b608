"""What a user composes: bodies, joints, the world, and the mechanism that connects them."""

from mbs.components.bodies import Body, KhalilBody, PointMass
from mbs.components.component import Component, Point
from mbs.components.constraints import (
    ConstantVelocity,
    PointOnLine,
    PointOnPlane,
    Rod,
)
from mbs.components.coupling import Coupling
from mbs.components.forces import ForceElement
from mbs.components.forces_bushing import Bushing
from mbs.components.forces_joint import JointFriction, JointStop
from mbs.components.forces_line import Attraction, Damper, Spring
from mbs.components.forces_source import Force, Torque
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
from mbs.components.transmissions import Gear, RackAndPinion, Screw

__all__ = [
    "Attraction",
    "Body",
    "Box",
    "Bushing",
    "Component",
    "ConstantVelocity",
    "Coupling",
    "Cylinder",
    "Cylindrical",
    "Damper",
    "Fixed",
    "Force",
    "ForceElement",
    "Free",
    "Gear",
    "Joint",
    "JointFriction",
    "JointStop",
    "KhalilBody",
    "Mechanism",
    "Placed",
    "Planar",
    "Point",
    "PointMass",
    "PointOnLine",
    "PointOnPlane",
    "Prismatic",
    "RackAndPinion",
    "Revolute",
    "RigidBody",
    "Rod",
    "Rotor",
    "Screw",
    "Spherical",
    "Spring",
    "Torque",
    "Universal",
    "World",
]
