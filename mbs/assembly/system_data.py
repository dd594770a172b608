"""The data of an assembled mechanism and the properties that follow from them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from casadi import SX

from mbs.assembly.component_instances import ComponentInstance, Quantity
from mbs.assembly.drive_line import ShaftRow
from mbs.assembly.khalil_frames import Cut
from mbs.assembly.parameter_bounds import BoundedField, Bounds
from mbs.assembly.tables import (
    AttachedSensor,
    Balance,
    BodyRow,
    Closure,
    Coordinate,
    CoordinateCoupling,
    JointRow,
    LinkRow,
    LoopRow,
    ShapeRow,
    link_rows,
)
from mbs.assembly.tree import Tree
from mbs.components import Component
from mbs.expressions import Parameter
from mbs.spatial import Pose


@dataclass(frozen=True, slots=True, eq=False)
class SystemData:
    """Tables and symbols of an assembled mechanism.

    Attributes:
        name: name of the mechanism.
        source: origin of the data.
        tree: links with frames and inertias.
        cuts: joints that were cut to open the loops.
        couplings: relations between coordinates.
        parameters: parameters in the order of the input p of the Functions.
        p: (np, 1) symbols of the parameters.
        coordinates: elements of q.
        velocity_coordinates: elements of v, and of efforts and accelerations.
        cut_coordinates: coordinates of the cut joints. They are not elements of q.
        bodies: moving bodies of the description, in the order of external wrenches.
        frames: link (-1 for the base) and pose in the frame of the link, by name of the frame.
        named_frames: names of the frames that the description added by `add_frame`.
        loops: one row for each loop or coupling.
        configuration: (nq,) position that closes the loops. It is zero in an open chain without
            guess.
        closure: constraints of the loops on velocities; None in an open chain.
        parts: force elements, drives and all other components by their equations.
        joints: all joints and constraints of the tree and of the cuts.
        sensors: sensors, which do not change the motion.
        shafts: inertias and rigid gears of drive lines, with the coordinates of their rotation.
        component_states: (nz, 1) symbols of the states of parts.
        u: (nu, 1) symbols of the inputs of parts.
        bounds: lower and upper bound of parameters, by name of the parameter.
        bounded: quantities that are computed from parameters and have bounds.
        parameterised_components: components that contain parameters, as in the description.
        numbered: name of the body of each frame of the table from which the mechanism was made, by
            the number in the table; empty if the numbers are those of the links.
        shapes: shapes of the links and of the base.
        nodes: coordinates that move no mass, which the balance of forces determines: index in q
            and index in v.
        balances: balances of the forces on the nodes. Balances of positions come first.
    """

    name: str
    source: str
    tree: Tree
    cuts: tuple[Cut, ...]
    couplings: tuple[CoordinateCoupling, ...]
    parameters: tuple[Parameter, ...]
    p: SX
    coordinates: tuple[Coordinate, ...]
    velocity_coordinates: tuple[Coordinate, ...]
    cut_coordinates: tuple[Coordinate, ...]
    bodies: tuple[BodyRow, ...]
    frames: Mapping[str, tuple[int, Pose]]
    named_frames: tuple[str, ...]
    loops: tuple[LoopRow, ...]
    configuration: tuple[float, ...]
    closure: Closure | None = None
    parts: tuple[ComponentInstance, ...] = ()
    joints: tuple[JointRow, ...] = ()
    sensors: tuple[AttachedSensor, ...] = ()
    shafts: tuple[ShaftRow, ...] = ()
    component_states: SX = field(default_factory=lambda: SX(0, 1))
    u: SX = field(default_factory=lambda: SX(0, 1))
    bounds: Mapping[str, Bounds] = field(default_factory=dict)
    bounded: tuple[BoundedField, ...] = ()
    parameterised_components: tuple[Component, ...] = ()
    numbered: Mapping[int, str] = field(default_factory=dict)
    shapes: tuple[ShapeRow, ...] = ()
    nodes: tuple[tuple[int, int], ...] = ()
    balances: tuple[Balance, ...] = ()

    @property
    def nq(self) -> int:
        """Number of positions."""
        return self.tree.nq

    @property
    def nv(self) -> int:
        """Number of velocities."""
        return self.tree.nv

    @property
    def devices(self) -> tuple[ComponentInstance, ...]:
        """Motors and torques that drive shafts."""
        return tuple(part for part in self.parts if part.element.drives)

    @property
    def states(self) -> tuple[Quantity, ...]:
        """Names and units of the elements of `component_states`."""
        return tuple(row for part in self.parts for row in part.state_quantities)

    @property
    def inputs(self) -> tuple[Quantity, ...]:
        """Names and units of the elements of u, the inputs of parts."""
        return tuple(row for part in self.parts for row in part.input_quantities)

    @property
    def outputs(self) -> tuple[Quantity, ...]:
        """Names and units of the outputs of parts: forces, speeds and others."""
        return tuple(row for part in self.parts for row in part.output_quantities)

    @property
    def component_start(self) -> list[float]:
        """(nz,) start values of `component_states` from the components."""
        return [getattr(part.element, name) for part in self.parts for name in part.states]

    @property
    def u_default(self) -> list[float]:
        """(nu,) default values of u."""
        return [
            float(part.element.declared[name].default)
            for part in self.parts
            for name, given in part.inputs.items()
            if isinstance(given, SX)
        ]

    @property
    def links(self) -> tuple[LinkRow, ...]:
        """Links of the tree with the Khalil parameters of their frames."""
        return link_rows(self.tree)

    @property
    def is_closed(self) -> bool:
        """Whether loops or couplings constrain the coordinates."""
        return self.closure is not None

    @property
    def independent(self) -> tuple[int, ...]:
        """Indices of the independent velocities. All velocities of an open chain are independent.

        These are the velocities that models of a closed system take. `actuated` has the velocities
        with motors.
        """
        return self.closure.independent if self.closure else tuple(range(self.nv))

    @property
    def actuated(self) -> tuple[int, ...]:
        """Indices of the velocities whose joints have motors."""
        return tuple(k for k, speed in enumerate(self.velocity_coordinates) if speed.actuated)

    @property
    def chosen_coordinates(self) -> tuple[int, ...]:
        """Indices of the velocities whose positions may be chosen independently.

        They equal `independent`, unless discs roll without slip: then more positions than
        velocities are independent.
        """
        return self.closure.chosen_coordinates if self.closure else tuple(range(self.nv))

    @property
    def node_frictions(self) -> frozenset[str]:
        """Names of the components whose dry friction acts on massless nodes."""
        return frozenset(name for balance in self.balances for name in balance.frictions)

    @property
    def motors(self) -> tuple[int, ...]:
        """Indices of the velocities whose efforts are inputs and outputs of the dynamic models.

        They equal `independent` unless there are more motors or motors depend on each other.
        """
        return self.closure.motors if self.closure else tuple(range(self.nv))

    @property
    def symbol_table(self) -> dict[str, SX]:
        """Symbols of the parameters by name."""
        return {parameter.name: self.p[k] for k, parameter in enumerate(self.parameters)}

    @property
    def p_default(self) -> list[float]:
        """(np,) default values of the parameters. NaN means that a parameter has no value."""
        return [float("nan") if p.default is None else p.default for p in self.parameters]
