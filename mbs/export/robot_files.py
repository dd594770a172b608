"""Export of mechanisms as robot files: URDF, SDFormat, MJCF of MuJoCo, and .par of SYMORO.

Each function checks that the format supports all parts of the system, and collects the tables from
which the file is written.
"""

from __future__ import annotations

import os
from collections.abc import Mapping

from mbs.assembly import System
from mbs.components.description import OUTER_WORLD
from mbs.components.joints import Motion
from mbs.errors import ModelError
from mbs.export.robot_tables import (
    MjcfTables,
    Numbers,
    SdfTables,
    UrdfTables,
    base_pose,
    numbers_without_symbols,
    robot_table,
)
from mbs.files import path_of
from mbs.formats import write_par
from mbs.formats.mjcf.writer import refusal as mjcf_refusal
from mbs.formats.mjcf.writer import write_mjcf
from mbs.formats.sdf.writer import CLOSING, write_sdf
from mbs.formats.sdf.writer import refusal as sdf_refusal
from mbs.formats.urdf.writer import write_urdf
from mbs.mechanism import Mechanism
from mbs.text import quoted


def urdf(system: System | Mechanism, path: str | os.PathLike[str]) -> None:
    """Write a mechanism without loops as a URDF file, with symbols at their default values.

    Every body becomes a link of the same name, every named frame a link without mass, and every
    motion a joint. Of bodies that are fixed to each other, one body has the total inertia.
    Couplings of degree one become mimics, and rotor inertia Ia becomes the motor inertia of a
    transmission of ratio one. The format does not contain the actuated joints and the width of
    Coulomb friction. If a mount rotates the base, the frame "outer_world" is the world of the file.

    Args:
        system: mechanism with revolute, prismatic and free motions. A Mechanism is assembled first.
        path: path of the .urdf file.

    Raises:
        ModelError: system has another type, loops, a spherical joint, springs, rotors, force
            elements, effort or velocity limits that differ by direction, a gravity other than
            9.81 m/s^2 along -z, or a symbol without value.
        ExportError: the file cannot be written.
    """
    system = system_of(system)
    _check_urdf(system)
    number = numbers_without_symbols(system, "URDF")
    write_urdf(UrdfTables(system, number).table(), path, shapes_left_out(system))


def sdf(system: System | Mechanism, path: str | os.PathLike[str]) -> None:
    """Write a mechanism as an SDFormat file, symbols at their default values.

    Every link of the tree becomes a link with the name and frame of its first body and the total
    inertia of its bodies. Other bodies and named frames become frames. Joints that close loops are
    joints whose child link has a second parent. In an SDF file all joint positions are zero in the
    drawn configuration. Mechanisms with loops are drawn in `system.configuration`, and their joint
    positions are relative to it. Other mechanisms are drawn at zero positions. Free links start in
    `system.configuration`; `mbs.load` gives them the free joint `root_joint`. Couplings of degree
    one become mimics, and Ia becomes the rotor inertia of Drake. A joint without a motor has an
    effort limit of zero.

    Args:
        system: mechanism with revolute, prismatic, spherical and free motions. A Mechanism is
            assembled first.
        path: path of the .sdf file.

    Raises:
        ModelError: system has another type, rotors, force elements, a drive line, a free joint that
            is not on the world, couplings of a higher degree, or a loop closed by a joint other
            than fixed, revolute, prismatic, spherical or universal. A symbol has no value.
        ExportError: the file cannot be written.
    """
    system = system_of(system)
    _check_sdf(system)
    number = numbers_without_symbols(system, "SDF")
    write_sdf(SdfTables(system, number).table(), path, shapes_left_out(system))


def mjcf(
    system: System | Mechanism,
    path: str | os.PathLike[str],
    parameters: Mapping[str, float] | None = None,
) -> None:
    """Write a mechanism as a model file of MuJoCo.

    Every link becomes a body, a child of its antecedent. The body has the name of the first body on
    the link and the total inertia. Other bodies become massless child bodies. q equals qpos of
    MuJoCo, and the assembled configuration is the keyframe `home`. Only spherical and free joints
    with the
    child body on frame_a differ: their qpos is the pose of the child body in the parent body. A
    loop becomes a connect or weld constraint, which is soft in MuJoCo. Couplings become equalities
    of joints or fixed tendons, and springs and dampers between points become spatial tendons.
    Actuated joints have motors of gear 1.

    The file does not contain symbols (only their values), velocity limits, and the width of Coulomb
    friction, which is a constraint in MuJoCo. Zero masses and moments of moving bodies become
    2e-15, because MuJoCo requires positive values. The moments of the first link across its
    revolute axis have no effect, and robot tables omit them. They are increased to values that a
    rigid body can have.

    Args:
        system: any mechanism. A Mechanism is assembled first.
        path: path of the .xml file.
        parameters: dict of values of symbols. Other symbols have their default values.

    Raises:
        ModelError: system has another type, or the format does not support a part of it.
        ExportError: the file cannot be written.
    """
    system = system_of(system)
    number = Numbers(system, parameters)
    _check_mjcf(system)
    write_mjcf(MjcfTables(system, number).table(), path, shapes_left_out(system))


def par(system: System | Mechanism, path: str | os.PathLike[str]) -> None:
    """Write a mechanism as a robot file of SYMORO.

    Link j of the system becomes frame j of the file, with joint variable q<j>. Fixed frames on the
    path to a link come before it and increase its index. Bodies that are fixed to each other are
    one link. Symbols are kept; their values are in comments that `mbs.load` reads. Names of joints
    and bodies, and limits, are not in the file. A mount becomes the vector Z, with symbols at their
    default values.

    Args:
        system: mechanism with revolute and prismatic motions, also of the cut joints. A Mechanism
            is assembled first.
        path: path of the .par file.

    Raises:
        ModelError: system has another type, or the format does not support a motion or coupling.
        DescriptionError: a symbol has the name of a joint variable of the format.
        ExportError: the file cannot be written.
    """
    system = system_of(system)
    note = " ".join(filter(None, (shapes_left_out(system), mount_left_out(system))))
    write_par(robot_table(system), path_of(path), note=note)


def system_of(system: object) -> System:
    """Return the argument of a user as a System; a Mechanism is assembled.

    Args:
        system: System or Mechanism.

    Raises:
        ModelError: the argument has another type.
    """
    if isinstance(system, Mechanism):
        return system.assemble()
    if not isinstance(system, System):
        raise ModelError(
            f"{quoted(system)} is a {type(system).__name__}; give a System or a Mechanism"
        )
    return system


def shapes_left_out(system: System) -> str:
    """Return a note about the shapes of a system, which robot files do not contain.

    Args:
        system: mechanism to write.

    Returns:
        The note; empty if there are no shapes.
    """
    if not system.shapes:
        return ""
    names = {-1: "the base", **{j: link.name for j, link in enumerate(system.tree.links)}}
    owners = ", ".join(dict.fromkeys(names[row.link] for row in system.shapes))
    return f"Shapes that are not in this file: {len(system.shapes)}, on {owners}."


def mount_left_out(system: System) -> str:
    """Return a note about a mount that the file does not contain.

    Args:
        system: mechanism to write.

    Returns:
        The note; empty without a mount, or if the mount has numeric values.
    """
    lost = OUTER_WORLD in system.frames and base_pose(system) is None
    return (
        "The mount of the base has symbols without a value; it is not in this file." if lost else ""
    )


# Checks of what a format supports.


def _check_urdf(system: System) -> None:
    """Raise a ModelError if URDF does not support a part of the system."""

    def fail(what: str) -> None:
        raise ModelError(f"{system.name}: {what}, which URDF cannot say; take it away first")

    if system.cuts:
        fail(f"{system.cuts[0].edge.joint.name} closes a loop")
    if system.parts or system.shafts:
        fail("it has force elements or a drive line")
    _check_backward_drives(system, "URDF")
    for link in system.tree.links:
        if link.motion is Motion.SPHERICAL:
            fail(f"{link.name} is a spherical joint")
        if link.rotor is not None or not (link.stiffness.is_zero() and link.rest.is_zero()):
            fail(f"{link.name} has a rotor or a spring")
    for coupling in system.couplings:
        if len(coupling.coefficients) > 2:
            fail(f"{coupling.name} is a coupling of a higher degree than one")
        if coupling.others:
            fail(f"{coupling.name} is a coupling of more than two joints")


def _check_sdf(system: System) -> None:
    """Raise a ModelError if SDF does not support a part of the system."""
    if system.parts or system.shafts:
        raise sdf_refusal(system.name, "it has force elements or a drive line")
    for link in system.tree.links:
        if link.motion is Motion.FREE and link.antecedent >= 0:
            raise sdf_refusal(system.name, f"{link.name} is a free joint that is not on the world")
        if link.rotor is not None:
            raise sdf_refusal(system.name, f"{link.name} has a rotor with an axis of its own")
        acts = (link.Fv, link.Fs, link.Ia)
        if link.motion.nv > 1 and not all(value.is_zero() for value in acts):
            raise sdf_refusal(
                system.name, f"{link.name} has friction or a rotor about several axes"
            )
    _check_sdf_loops(system)


def _check_sdf_loops(system: System) -> None:
    """Raise a ModelError if SDF does not support a coupling or a joint that closes a loop."""
    driven = set()
    for coupling in system.couplings:
        if len(coupling.coefficients) > 2 or coupling.others:
            raise sdf_refusal(system.name, f"{coupling.name} is not a line between two joints")
        if coupling.driven in driven:
            raise sdf_refusal(
                system.name, f"{coupling.name} drives a joint that another coupling drives"
            )
        driven.add(coupling.driven)
    for cut in system.cuts:
        joint = cut.edge.joint
        if not cut.welded and type(joint) not in CLOSING:
            raise sdf_refusal(
                system.name, f"a {type(joint).__name__} closes the loop at {joint.name}"
            )


def _check_mjcf(system: System) -> None:
    """Raise a ModelError if MJCF does not support a part of the system."""
    _check_backward_drives(system, "MJCF")
    for part in [*(row.name for row in system.shafts), *(row.name for row in system.devices)]:
        raise mjcf_refusal(
            system.name,
            f"{part}: an MJCF file has no drive lines",
            "give Ia and effort to the joint",
        )
    for link in system.tree.links:
        if link.rotor is not None:
            raise mjcf_refusal(
                system.name,
                f"{link.name}: an MJCF file has no rotor about an axis of its own",
                "give its inertia seen at the joint as Ia",
            )
        if link.motion is Motion.FREE and link.antecedent >= 0:
            raise mjcf_refusal(
                system.name,
                f"{link.name}: in an MJCF file a free joint is on the world",
                "connect it from the world",
            )


def _check_backward_drives(system: System, file: str) -> None:
    """Raise a ModelError for drives or friction of joints whose child body is on frame_a.

    For these free and spherical joints the file has other velocities. `file` is the format, for the
    error message.
    """
    for link in system.tree.links:
        acting = (link.Fv, link.Fs, link.Ia) if link.motion is Motion.FREE else (link.Fs,)
        if link.backward and not all(value.is_zero() for value in acting):
            raise ModelError(
                f"{system.name}/{link.name}: its friction or rotor inertia acts on velocities of"
                f" the inner body relative to the outer one, which {file} files do not have;"
                " connect the inner body first"
            )
