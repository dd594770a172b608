"""Assembly of a mechanism into a System whose loops are not yet analysed."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import casadi
from casadi import SX

from mbs.assembly.component_instances import (
    ComponentInstance,
    attached_parts,
    coordinates_needed,
    symbols_in_order,
    with_unknowns,
)
from mbs.assembly.drive_line import drive_line, shaft_rows
from mbs.assembly.graph import BodyGraph, connection_graph, spanning_tree
from mbs.assembly.khalil_frames import Cut, KhalilTree, khalil_frames
from mbs.assembly.parameter_bounds import bounded_fields, inertia_notes, parameter_bounds
from mbs.assembly.pose_check import check_poses
from mbs.assembly.system import System
from mbs.assembly.tables import (
    BodyRow,
    Coordinate,
    CoordinateCoupling,
    LoopRow,
    Places,
    ShapeRow,
    attached_sensors,
    joint_rows,
    position_coordinates,
    velocity_coordinates,
)
from mbs.assembly.tree import zero_position
from mbs.components import Box, Component, Cylinder, Description, Free, Joint
from mbs.components.bodies import Mount, RigidBody
from mbs.components.description import OUTER_WORLD
from mbs.errors import AssemblyError
from mbs.expressions import Parameter, expression, to_float, to_sx
from mbs.spatial import Pose


def open_system(mechanism: Description, guessed: Collection[str] = ()) -> System:
    """Return the System with tree, cut joints and tables of a mechanism, without loop analysis.

    Args:
        mechanism: components and connections.
        guessed: coordinates whose joints should stay in the tree.

    Raises:
        AssemblyError: the components do not form a mechanism.
        DescriptionError: a body that may rotate about several axes has an impossible inertia.
    """
    parameters = mechanism.parameters()
    known = {p.name: p.default for p in parameters if p.default is not None}
    checked = [component.check_values(known) for component in mechanism.components.values()]
    faulty = [body for body in checked if isinstance(body, RigidBody) and body.inertia_fault]
    described = [c for c in mechanism.components.values() if c.parameters()]
    bounds = parameter_bounds(described, parameters)
    line = drive_line(mechanism)
    notes = mechanism.notes
    mechanism = with_unknowns(line.mechanism)
    symbols = {parameter.name: SX.sym(parameter.name) for parameter in parameters}
    graph = connection_graph(mechanism, symbols, _trial_values(parameters))
    coupled = [name for c in mechanism.couplings() for name in c.coordinates]
    spanning = spanning_tree(
        mechanism.name,
        graph,
        need=_owners(mechanism, (*coupled, *coordinates_needed(mechanism, line.turns))),
        keep=_owners(mechanism, guessed),
        cut=mechanism.cuts,
        given_order=mechanism.keep_order,
    )
    framed = khalil_frames(mechanism, graph, spanning, symbols)
    places = _places(graph, framed)
    check_poses(mechanism, framed, places, symbols, _trial_values(parameters))
    on_links = [(body, places[body.name, ""][0]) for body in faulty]
    notes += [note for note in inertia_notes(framed.tree, on_links) if note not in notes]
    joints = {joint.name: joint for joint in mechanism.joints()}
    looped = {name for cut in framed.cuts for name in _loop_joints(framed, cut)}
    in_loops = looped | _driven_joints(mechanism)
    moving_links = [
        (link.motion, link.name, joints[name])
        for link, name in zip(framed.tree.links, framed.joints, strict=True)
    ]
    actuated = [_is_actuated(joint, in_loops) for _, _, joint in moving_links]
    coordinates = position_coordinates(moving_links, actuated)
    _check_names(mechanism, coordinates)
    speeds = velocity_coordinates(moving_links, actuated)
    cut = _cut_coordinates(framed.cuts)
    frames = _frames(mechanism, places, symbols)
    joints_found = joint_rows(mechanism, places, framed.cuts, symbols)
    tables = coordinates, speeds, cut
    sensors = attached_sensors(mechanism, places, joints_found, tables, symbols)
    parts = attached_parts(mechanism, places, tables, symbols, line.turns, sensors)
    return System(
        name=mechanism.name,
        source=mechanism.source,
        tree=framed.tree,
        cuts=framed.cuts,
        couplings=_couplings(mechanism, coordinates, symbols),
        parameters=parameters,
        bounds=bounds,
        bounded=tuple(bounded_fields(described, symbols)),
        parameterised_components=tuple(described),
        p=casadi.vertcat(*symbols.values()) if symbols else SX(0, 1),
        coordinates=coordinates,
        velocity_coordinates=speeds,
        cut_coordinates=cut,
        bodies=_bodies(mechanism, graph, framed),
        frames=frames,
        named_frames=tuple(mechanism.frames),
        numbered=_number(mechanism, frames, len(framed.tree.links)),
        loops=_loop_rows(mechanism, framed, parts),
        configuration=tuple(zero_position(framed.tree)),
        parts=parts,
        component_states=symbols_in_order(
            symbol for part in parts for symbol in part.states.values()
        ),
        u=symbols_in_order(
            given for part in parts for given in part.inputs.values() if isinstance(given, SX)
        ),
        joints=joints_found,
        sensors=sensors,
        shafts=shaft_rows(line, symbols),
        shapes=_shapes(mechanism, places, symbols),
    )


def _trial_values(parameters: Sequence[Parameter]) -> dict[str, float]:
    """Return a value of every parameter: its default, or an irregular number."""
    return {
        # irregular numbers near 1, so that no relation between parameters holds by chance
        p.name: 0.731 + 0.217 * number if p.default is None else p.default
        for number, p in enumerate(parameters)
    }


def _check_names(mechanism: Description, coordinates: Sequence[Coordinate]) -> None:
    """Raise AssemblyError if two coordinates have the same name."""
    names = [coordinate.name for coordinate in coordinates]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise AssemblyError(
            f"{mechanism.name}: two coordinates are named {twice!r}; rename one of the joints"
        )


def _owners(mechanism: Description, coordinates: Collection[str]) -> set[str]:
    """Return the names of the joints to which coordinates with these names belong."""
    return {
        joint.name
        for joint in mechanism.joints()
        for name in coordinates
        if name == joint.name or name.startswith(f"{joint.name}.")
    }


def _is_actuated(joint: Joint, in_loops: set[str]) -> bool:
    """Whether a joint has a motor; by default not in loops (`in_loops`) and not if it is free."""
    if joint.actuated is None:
        return joint.name not in in_loops and not isinstance(joint, Free)
    return joint.actuated


def _loop_joints(framed: KhalilTree, cut: Cut) -> list[str]:
    """Return the names of the joints in the loop of a cut, in the order of the links."""
    a, b = (set(framed.tree.path(link)) for link in (cut.link_a, cut.link_b))
    names = [framed.joints[j] for j in sorted(a ^ b)]
    return list(dict.fromkeys(names))


def _driven_joints(mechanism: Description) -> set[str]:
    """Return the names of the joints whose coordinate is the driven one of a coupling."""
    driven = [coupling.driven for coupling in mechanism.couplings()]
    return _owners(mechanism, driven)


def _loop_rows(
    mechanism: Description, framed: KhalilTree, parts: Sequence[ComponentInstance]
) -> tuple[LoopRow, ...]:
    """Return the table of loops: cut joints, couplings, and components that constrain velocities.

    `framed` is the tree with its cut joints, and `parts` are the equation-based components.
    """
    loops = [
        LoopRow(
            name=cut.edge.joint.name,
            closing="weld" if cut.welded else type(cut.edge.joint).__name__.lower(),
            joints=tuple(_loop_joints(framed, cut)),
            rows=(),
        )
        for cut in framed.cuts
    ]
    couplings = [LoopRow(c.name, "coupling", c.coordinates, ()) for c in mechanism.couplings()]
    binding = [
        LoopRow(part.name, type(part.element).__name__.lower(), _bound_joints(framed, part), ())
        for part in sorted(parts, key=lambda part: not part.element.has("rows"))
        if part.element.binds
    ]
    return (*loops, *couplings, *binding)


def _bound_joints(framed: KhalilTree, part: ComponentInstance) -> tuple[str, ...]:
    """Return the names of the joints that move the ports of a component.

    `framed` is the tree with its frames.
    """
    links = [k for link, _ in part.frames for k in framed.tree.path(link)]
    names = [framed.joints[k] for k in sorted(set(links))]
    return tuple(dict.fromkeys([*names, *(lever.name for lever in part.levers)]))


def _cut_coordinates(cuts: Sequence[Cut]) -> tuple[Coordinate, ...]:
    """Return the coordinates of the cut joints that are not elements of q."""
    rows: list[Coordinate] = []
    for cut in cuts:
        joint = cut.edge.joint
        if not cut.welded:
            for freedom in joint.freedoms:
                name = freedom.coordinate_of(joint.name)
                rows.extend(
                    position_coordinates([(freedom.motion, name, joint)], [False], cut=True)
                )
    return tuple(rows)


def _bodies(mechanism: Description, graph: BodyGraph, framed: KhalilTree) -> tuple[BodyRow, ...]:
    """Return the moving bodies, in the order of their links."""
    homes = {
        name: framed.homes[number][0]
        for number, node in enumerate(graph.nodes)
        for name, port in node.members
        if not port
    }
    values = {p.name: p.default for p in mechanism.parameters() if p.default is not None}
    rows: list[BodyRow] = []
    for body in mechanism.bodies():
        if homes[body.name] >= 0 and not isinstance(body, Mount):
            mass = _mass(body, values)
            solid = body if isinstance(body, (Box, Cylinder)) else None
            rows.append(BodyRow(body.name, homes[body.name] + 1, mass, solid))
    return tuple(sorted(rows, key=lambda row: row.link))


def _mass(body: Component, values: Mapping[str, float]) -> float | None:
    """Return the mass [kg] of a body at parameter values; None without a value, 0 without mass."""
    for attribute in ("solid_mass", "mass", "M"):
        scalar = getattr(body, attribute, None)
        if scalar is not None:
            return to_float(expression(scalar), values)
    return 0.0


def _places(graph: BodyGraph, framed: KhalilTree) -> Places:
    """Return link and pose of every body and joint frame, by component and port."""
    return {
        port: (link, pose @ inside)
        for node, (link, pose) in zip(graph.nodes, framed.homes, strict=True)
        for port, inside in node.members.items()
    }


def _frames(
    mechanism: Description, places: Places, symbols: Mapping[str, SX]
) -> dict[str, tuple[int, Pose]]:
    """Return the base, the reference frames of bodies, and named frames, by name."""
    frames = {"base": places[mechanism.world.name, ""]}
    for body in (mechanism.world, *mechanism.bodies()):
        link, pose = frames[body.name] = places[body.name, ""]
        if body.name == "base" and (link >= 0 or not pose.is_identity()):
            raise AssemblyError(
                f"{mechanism.name}: the body 'base' is not the frame of the world, which has this"
                " name; rename the body"
            )
    for name, point in mechanism.frames.items():
        link, pose = places[point.owner.name, point.port]
        frames[name] = link, pose @ point.placement.pose(symbols)
    if mechanism.mount.steps:
        if OUTER_WORLD in frames:
            raise AssemblyError(
                f"{mechanism.name}: the frame or body {OUTER_WORLD!r} has the name of the frame in"
                " which the mount is given; rename it"
            )
        link, pose = frames["base"]
        frames[OUTER_WORLD] = link, pose @ mechanism.mount.inverse().pose(symbols)
    return frames


def _shapes(
    mechanism: Description, places: Places, symbols: Mapping[str, SX]
) -> tuple[ShapeRow, ...]:
    """Return the shapes with the links that carry them, for pictures."""
    rows = []
    for point, shape in mechanism.shapes:
        link, pose = places[point.owner.name, point.port]
        rows.append(ShapeRow(link, pose @ point.placement.pose(symbols), shape))
    return tuple(rows)


def _number(
    mechanism: Description, frames: Mapping[str, tuple[int, Pose]], links: int
) -> dict[int, str]:
    """Return the body of each frame number of the table from which the mechanism was made.

    Empty if the numbers are those of the `links`.
    """
    same = len(mechanism.numbered) == links and all(
        frames[name][0] == number - 1 and frames[name][1].is_identity()
        for number, name in mechanism.numbered.items()
    )
    return {} if same else dict(mechanism.numbered)


def _couplings(
    mechanism: Description, coordinates: Sequence[Coordinate], symbols: Mapping[str, SX]
) -> tuple[CoordinateCoupling, ...]:
    """Return the relations between coordinates by their indices in q.

    Raises AssemblyError if a coordinate is not in the tree.

    `coordinates` are the elements of q.
    """
    numbers = {coordinate.name: number for number, coordinate in enumerate(coordinates)}
    result = []
    for coupling in mechanism.couplings():
        for name in coupling.coordinates:
            if name not in numbers:
                raise AssemblyError(
                    f"{coupling.name}: there is no coordinate {name!r} in the tree; the coordinates"
                    f" are {', '.join(numbers)}"
                )
        driven, driver, *_ = (numbers[name] for name in coupling.coordinates)
        terms = tuple(to_sx(c, symbols) for c in coupling.coefficients)
        others = tuple((numbers[name], to_sx(c, symbols)) for name, c in coupling.others)
        result.append(CoordinateCoupling(coupling.name, driven, driver, terms, others))
    return tuple(result)
