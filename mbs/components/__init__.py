"""What a user composes: bodies, joints, the world, and the mechanism that connects them."""

from mbs.components.bodies import Body, KhalilBody, PointMass
from mbs.components.component import Component, Point
from mbs.components.constraints import (
    ConstantVelocity,
    PointOnLine,
    PointOnPlane,
    Rod,
)
from mbs.components.contacts_joint import CoulombFriction, RigidStop
from mbs.components.coupling import Coupling
from mbs.components.drive_elastic import ElasticGear, ElasticShaft, ShaftDamper
from mbs.components.drive_flange import Flange
from mbs.components.drive_motor import DCMotor, TorqueSource
from mbs.components.drive_shafts import IdealGear, ShaftInertia
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
from mbs.components.rolling import RollingDisc
from mbs.components.rotor import Rotor
from mbs.components.sensors import AbsoluteSensor, DistanceSensor, RelativeSensor, Sensor
from mbs.components.sensors_joint import JointSensor, PowerSensor, WrenchSensor
from mbs.components.solids import Box, Cylinder
from mbs.components.transmissions import Gear, RackAndPinion, Screw

__all__ = [
    "AbsoluteSensor",
    "Attraction",
    "Body",
    "Box",
    "Bushing",
    "Component",
    "ConstantVelocity",
    "CoulombFriction",
    "Coupling",
    "Cylinder",
    "Cylindrical",
    "DCMotor",
    "Damper",
    "DistanceSensor",
    "ElasticGear",
    "ElasticShaft",
    "Fixed",
    "Flange",
    "Force",
    "ForceElement",
    "Free",
    "Gear",
    "IdealGear",
    "Joint",
    "JointFriction",
    "JointSensor",
    "JointStop",
    "KhalilBody",
    "Mechanism",
    "Placed",
    "Planar",
    "Point",
    "PointMass",
    "PointOnLine",
    "PointOnPlane",
    "PowerSensor",
    "Prismatic",
    "RackAndPinion",
    "RelativeSensor",
    "Revolute",
    "RigidBody",
    "RigidStop",
    "Rod",
    "RollingDisc",
    "Rotor",
    "Screw",
    "Sensor",
    "ShaftDamper",
    "ShaftInertia",
    "Spherical",
    "Spring",
    "Torque",
    "TorqueSource",
    "Universal",
    "World",
    "WrenchSensor",
]
