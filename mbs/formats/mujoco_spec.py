"""MJCF model files, read through MuJoCo as mechanisms.

The file is compiled by MuJoCo, so that defaults, frames, angle units, orientations and inertias
from geoms are what MuJoCo makes of them; the mechanism is built from the compiled model. Geoms of
bodies whose inertia is given are taken out before, with the assets they use, so that meshes may
be missing. Contacts, cameras, sensors and keyframes are not read.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from mbs.components import Body, Mechanism, Point
from mbs.errors import DescriptionError
from mbs.formats.files import component_name
from mbs.formats.mujoco_checks import check_supported
from mbs.formats.mujoco_closures import add_closures
from mbs.formats.mujoco_joints import add_joints
from mbs.formats.mujoco_model import MjcfModel, matrix_of, placed
from mbs.formats.urdf import parse_xml
from mbs.messages import install_command


def read_mjcf(path: str | Path) -> Mechanism:
    """The mechanism in an MJCF file.

    Bodies, joints and sites keep their names, with blanks, dots and quotes replaced by
    underscores; joints without a name are called after their body. Several joints in a body
    become a chain over bodies without mass. A closing `connect` becomes a spherical joint and a
    `weld` a fixed one, where the loop is then opened; an equality of joints becomes a coupling.
    Joint positions are MuJoCo's qpos: `ref` is taken into account.

    Of actuators only the joints that they drive are read, those without one are passive then. The
    inputs of the models are joint efforts; gear, kp, ctrlrange and the dynamics of an actuator
    belong to what commands it, and a position or velocity servo to a controller.

    What the flags of the file and its groups of actuators switch off is left out: springs, dampers,
    Coulomb friction, gravity, equalities, ranges of joints and of controls, actuators.

    Raises:
        DescriptionError: mujoco is not installed, the file is missing or malformed, or it has
            something that changes the motion and that mbs does not model.
    """
    name = _model_name(path)
    mujoco = _mujoco()
    model = _compiled(mujoco, str(path))
    mjcf = MjcfModel.of(mujoco, model, str(path))
    check_supported(mjcf)
    mechanism = Mechanism(
        name,
        gravity=_gravity(mjcf),
        source=f"MJCF file {Path(path).name}",
    )
    points: list[Point] = [mechanism.world.frame]
    for k in range(1, model.nbody):
        body = mechanism.add(_body(mjcf, k))
        add_joints(mechanism, mjcf, k, points[model.body_parentid[k]])
        points.append(body.frame)
    sites = [
        placed(points[model.site_bodyid[k]], model.site_pos[k], model.site_quat[k])
        for k in range(model.nsite)
    ]
    for name, point in zip(mjcf.sites, sites, strict=True):
        mechanism.add_frame(name, point)
    add_closures(mechanism, mjcf, points, sites)
    return mechanism


def _model_name(path: str | Path) -> str:
    root = parse_xml(path)
    if root.tag != "mujoco":
        raise DescriptionError(
            f"{path}: the root element is <{root.tag}>, not <mujoco>; give an MJCF file, or read a"
            " URDF file with read_urdf"
        )
    return component_name(root.get("model") or Path(path).stem)


def _mujoco() -> Any:
    try:
        import mujoco
    except ImportError:
        raise DescriptionError(
            "MJCF files are read by mujoco, which is not installed; run: "
            + install_command("import")
        ) from None
    return mujoco


def _compiled(mujoco: Any, path: str) -> Any:
    try:
        spec = mujoco.MjSpec.from_file(path)
        spec.compiler.fusestatic = False
        spec.compiler.discardvisual = False
        _strip(mujoco, spec)
        return spec.compile()
    except (ValueError, RuntimeError) as error:
        reason = " ".join(str(error).removeprefix("Error: ").split())
        raise DescriptionError(f"{path}: mujoco refuses the file: {reason}; correct it") from None


def _strip(mujoco: Any, spec: Any) -> None:
    """Take out what has no part in the motion, and may name files that are missing."""
    for kind in ("sensors", "keys", "pairs", "excludes", "skins", "cameras", "lights", "tuples"):
        for element in list(getattr(spec, kind)):
            spec.delete(element)
    from_geoms = spec.compiler.inertiafromgeom
    always = int(from_geoms) == int(mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE)
    for body in spec.bodies:
        is_world = body.name == "world" and body.parent is None
        if is_world or (body.explicitinertial and not always):
            for geom in list(body.geoms):
                spec.delete(geom)
    meshes = {geom.meshname for geom in spec.geoms}
    fields = {geom.hfieldname for geom in spec.geoms}
    for geom in spec.geoms:
        geom.material = ""
    unused = [mesh for mesh in spec.meshes if mesh.name not in meshes]
    unused += [hfield for hfield in spec.hfields if hfield.name not in fields]
    for asset in [*unused, *spec.materials, *spec.textures]:
        spec.delete(asset)


def _gravity(mjcf: MjcfModel) -> tuple[float, ...]:
    if not mjcf.flags.gravity:
        return (0.0, 0.0, 0.0)
    return tuple(float(value) for value in mjcf.data.opt.gravity)


def _body(mjcf: MjcfModel, k: int) -> Body:
    model = mjcf.data
    R = matrix_of(model.body_iquat[k])
    tensor = R @ np.diag(model.body_inertia[k]) @ R.T
    return Body(
        mjcf.bodies[k],
        mass=float(model.body_mass[k]),
        com=tuple(float(value) for value in model.body_ipos[k]),
        inertia=((tensor + tensor.T) / 2).tolist(),
    )
