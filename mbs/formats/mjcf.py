"""MJCF model files, read through MuJoCo as mechanisms.

The file is compiled by MuJoCo, so that defaults, frames, angle units, orientations and inertias
from geoms are what MuJoCo makes of them; the mechanism is built from the compiled model. Geoms of
bodies whose inertia is given are taken out before, with the assets they use, so that meshes may
be missing. Contacts, cameras, sensors and keyframes are not read.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.polynomial import Polynomial

from mbs.components import (
    Body,
    Coupling,
    Fixed,
    Free,
    Joint,
    Mechanism,
    Point,
    Prismatic,
    Revolute,
    RigidBody,
    Spherical,
)
from mbs.errors import DescriptionError
from mbs.formats.files import component_name
from mbs.formats.urdf import parse_xml
from mbs.text import install_command

# What the flags of an MJCF file switch off.
#
# MuJoCo keeps two sets of bits in its options, `disableflags` and `enableflags`; the groups of
# `actuatorgroupdisable` are a third. Versions differ in their names: springs and dampers had one
# flag, `passive`, before they had one each.


_EFFECTIVE = {
    *("CONSTRAINT", "EQUALITY", "FRICTIONLOSS", "LIMIT", "GRAVITY", "CLAMPCTRL", "ACTUATION"),
    *("PASSIVE", "SPRING", "DAMPER"),
}
"""Disable flags that change what is read; `Flags` says how."""
_WITHOUT_EFFECT = {
    *("CONTACT", "FILTERPARENT", "MIDPHASE", "NATIVECCD", "MULTICCD"),  # contacts are not read
    *("REFSAFE", "WARMSTART", "ISLAND"),  # the solver of soft constraints; ours are exact
    *("EULERDAMP", "AUTORESET"),  # the integrator and what it does with bad states
    "SENSOR",  # sensors are not read
}
"""Disable flags that do not change the equations of motion, and why."""
_ENABLED_WITHOUT_EFFECT = {
    *("OVERRIDE", "MULTICCD", "IPC", "SPECULATIVE"),  # contacts are not read
    *("ISLAND", "DIAGEXACT", "SLEEP"),  # the solver of soft constraints, and what it skips
    *("ENERGY", "FWDINV"),  # further outputs
    "INVDISCRETE",  # how the inverse dynamics of MuJoCo take accelerations of a discrete step
}
"""Enable flags that do not change the equations of motion, and why."""


@dataclass(frozen=True, slots=True)
class Flags:
    """What acts in a compiled model.

    Attributes:
        gravity: weight.
        springs: springs of joints and tendons.
        dampers: viscous friction of joints and tendons.
        passive: the medium and gravity compensation, which stop when springs and dampers both do.
        friction: Coulomb friction of joints and tendons, which is a constraint in MuJoCo.
        limits: ranges of joints.
        equalities: closing joints, welds and couplings.
        actuation: actuators of all groups.
        control_ranges: whether controls stay in their ranges.
        disabled_groups: bits of the groups of actuators that do not act.
        unknown: names of flags that are set and that this reader does not know.
    """

    gravity: bool
    springs: bool
    dampers: bool
    passive: bool
    friction: bool
    limits: bool
    equalities: bool
    actuation: bool
    control_ranges: bool
    disabled_groups: int
    unknown: tuple[str, ...]

    @staticmethod
    def of(mujoco: Any, model: Any) -> Flags:
        """The flags of a compiled model."""
        disabled = set(_flag_names(mujoco.mjtDisableBit, "mjDSBL_", int(model.opt.disableflags)))
        enabled = set(_flag_names(mujoco.mjtEnableBit, "mjENBL_", int(model.opt.enableflags)))
        unknown = (disabled - _EFFECTIVE - _WITHOUT_EFFECT) | (enabled - _ENABLED_WITHOUT_EFFECT)
        springs = not disabled & {"SPRING", "PASSIVE"}
        dampers = not disabled & {"DAMPER", "PASSIVE"}
        return Flags(
            gravity="GRAVITY" not in disabled,
            springs=springs,
            dampers=dampers,
            passive=springs or dampers,
            friction=not disabled & {"FRICTIONLOSS", "CONSTRAINT"},
            limits=not disabled & {"LIMIT", "CONSTRAINT"},
            equalities=not disabled & {"EQUALITY", "CONSTRAINT"},
            actuation="ACTUATION" not in disabled,
            control_ranges="CLAMPCTRL" not in disabled,
            disabled_groups=int(model.opt.disableactuator),
            unknown=tuple(sorted(name.lower() for name in unknown)),
        )

    def drives(self, group: int) -> bool:
        """Whether actuators of a group act; groups that have no bit always do."""
        return self.actuation and not (0 <= group < 31 and self.disabled_groups >> group & 1)


def _flag_names(kinds: Any, prefix: str, bits: int) -> Iterator[str]:
    """Names of the bits that are set, `bit N` of those that have none."""
    known = {int(kind): name for name, kind in kinds.__members__.items() if name.startswith(prefix)}
    for k in range(bits.bit_length()):
        if bits >> k & 1:
            yield known.get(1 << k, f"bit {k}").removeprefix(prefix)


# A model that MuJoCo compiled, with names that components can bear.


@dataclass(frozen=True, slots=True)
class MjcfModel:
    """A compiled model.

    Attributes:
        mujoco: the module.
        data: the mujoco.MjModel.
        path: of the file, for messages.
        bodies, joints, sites, equalities: names, by MuJoCo's numbers.
        acting: numbers of the actuators that are not switched off and act on a joint.
        flags: what acts in the model.
    """

    mujoco: Any
    data: Any
    path: str
    bodies: tuple[str, ...]
    joints: tuple[str, ...]
    sites: tuple[str, ...]
    equalities: tuple[str, ...]
    acting: tuple[int, ...]
    flags: Flags

    @staticmethod
    def of(mujoco: Any, model: Any, path: str) -> MjcfModel:
        """The model with its names made fit for components, each of them used once."""
        bodies = _names((model.body(k).name for k in range(model.nbody)), "body")
        joints = tuple(
            component_name(model.joint(j).name) or _joint_name(model, j, bodies)
            for j in range(model.njnt)
        )
        bodies = tuple(_apart(name, {*joints, "base"}, "body") for name in bodies)
        sites = _names((model.site(k).name for k in range(model.nsite)), "site")
        taken = {*bodies, *joints, "base"}
        flags = Flags.of(mujoco, model)
        return MjcfModel(
            mujoco,
            model,
            path,
            bodies,
            joints,
            tuple(_apart(name, taken, "site") for name in sites),
            _names((model.eq(k).name for k in range(model.neq)), "equality"),
            tuple(
                k
                for k in range(model.nu)
                if int(model.actuator_trntype[k]) in joint_transmissions(mujoco)
                and flags.drives(int(model.actuator_group[k]))
            ),
            flags,
        )

    def actuators_of(self, j: int) -> list[int]:
        """Numbers of the actuators that act on joint j."""
        return [k for k in self.acting if int(self.data.actuator_trnid[k, 0]) == j]


def joint_transmissions(mujoco: Any) -> tuple[int, ...]:
    """The ways in which an actuator acts on a joint."""
    kinds = mujoco.mjtTrn
    return int(kinds.mjTRN_JOINT), int(kinds.mjTRN_JOINTINPARENT)


def placed(point: Point, pos: Sequence[float], quat: Sequence[float]) -> Point:
    """The frame at a position [m] and a quaternion (w, x, y, z) of a frame."""
    R = matrix_of(quat)
    turned = None if np.allclose(R, np.eye(3), rtol=0, atol=1e-15) else R.tolist()
    x, y, z = (float(value) for value in pos)
    return point.at(x, y, z, rotation=turned)


def matrix_of(quat: Sequence[float]) -> Any:
    """(3, 3) rotation of a quaternion (w, x, y, z) of any length but zero."""
    w, x, y, z = np.asarray(quat, dtype=float) / math.hypot(*quat)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def _names(names: Iterable[str], kind: str) -> tuple[str, ...]:
    return tuple(component_name(name) or f"{kind}{k}" for k, name in enumerate(names))


def _joint_name(model: Any, j: int, bodies: tuple[str, ...]) -> str:
    k = int(model.jnt_bodyid[j])
    alone = model.body_jntnum[k] == 1
    return f"{bodies[k]}_joint" if alone else f"{bodies[k]}_joint{j - model.body_jntadr[k] + 1}"


def _apart(name: str, taken: Iterable[str], kind: str) -> str:
    return f"{name}_{kind}" if name in taken else name


# What the actuators of a compiled MuJoCo model can give a joint.


_Range = tuple[float, float]


def effort_range(mjcf: MjcfModel, j: int) -> _Range | None:
    """(lower, upper) of the effort of joint j [N m or N], None where it is not limited.

    The sum of the forcerange of its actuators times their gear, within the actuatorfrcrange of the
    joint; a motor, which has no dynamics and no feedback, is limited by its ctrlrange too, unless
    the flag clampctrl is disabled.

    Args:
        mjcf: the model.
        j: number of a hinge or slide.
    """
    model = mjcf.data
    lower, upper = 0.0, 0.0
    acting = mjcf.actuators_of(j)
    for k in acting:
        gear = float(model.actuator_gear[k, 0])
        ends = sorted(gear * end for end in _force(mjcf, k)) if gear else (0.0, 0.0)
        lower, upper = lower + ends[0], upper + ends[1]
    if not acting:
        lower, upper = -math.inf, math.inf
    if model.jnt_actfrclimited[j]:
        least, largest = (float(end) for end in model.jnt_actfrcrange[j])
        lower, upper = max(lower, least), min(upper, largest)
    limited = math.isfinite(lower) or math.isfinite(upper)
    return (lower, upper) if limited and lower <= 0 <= upper and lower < upper else None


def _force(mjcf: MjcfModel, k: int) -> _Range:
    """What actuator k gives before its gear."""
    model, kinds = mjcf.data, mjcf.mujoco
    low, high = -math.inf, math.inf
    if model.actuator_forcelimited[k]:
        low, high = (float(end) for end in model.actuator_forcerange[k])
    plain = (
        int(model.actuator_gaintype[k]) == int(kinds.mjtGain.mjGAIN_FIXED)
        and int(model.actuator_biastype[k]) == int(kinds.mjtBias.mjBIAS_NONE)
        and int(model.actuator_dyntype[k]) == int(kinds.mjtDyn.mjDYN_NONE)
    )
    if plain and model.actuator_ctrllimited[k] and mjcf.flags.control_ranges:
        gain = float(model.actuator_gainprm[k, 0])
        ends = sorted(gain * float(end) for end in model.actuator_ctrlrange[k])
        low, high = max(low, ends[0]), min(high, ends[1])
    return low, high


# Joints of a compiled MuJoCo model.


def add_joints(mechanism: Mechanism, mjcf: MjcfModel, k: int, parent: Point) -> None:
    """Connect body k, which the mechanism has already, to its parent by its joints.

    A body without joints is welded. Several joints follow one another from the parent to the
    body, with a body without mass between any two of them.
    """
    model = mjcf.data
    body = mechanism.components[mjcf.bodies[k]]
    assert isinstance(body, RigidBody)
    point = placed(parent, model.body_pos[k], model.body_quat[k])
    first = int(model.body_jntadr[k])
    joints = range(first, first + int(model.body_jntnum[k]))
    if not joints:
        mechanism.connect(point, body)
    for j in joints:
        moved = body if j == joints[-1] else mechanism.add(_between(mjcf, k, j))
        joint = _joint(mjcf, j)
        if isinstance(joint, Free):
            mechanism.connect(parent, joint, moved)
        else:
            x, y, z = (float(value) for value in model.jnt_pos[j])
            mechanism.connect(_referred(mjcf, j, point.at(x, y, z)), joint, moved.at(x, y, z))
        point = moved.frame


def _between(mjcf: MjcfModel, k: int, j: int) -> Body:
    return Body(f"{mjcf.bodies[k]}_{mjcf.joints[j]}")


def _joint(mjcf: MjcfModel, j: int) -> Joint:
    model, kinds, flags = mjcf.data, mjcf.mujoco.mjtJoint, mjcf.flags
    kind, dof = kinds(int(model.jnt_type[j])), int(model.jnt_dofadr[j])
    driven = bool(mjcf.actuators_of(j))
    common: dict[str, Any] = {
        "name": mjcf.joints[j],
        "actuated": driven if model.nu else None,
        "Ia": float(model.dof_armature[dof]),
        "Fv": float(model.dof_damping[dof]) if flags.dampers else 0.0,
        "Fs": float(model.dof_frictionloss[dof]) if flags.friction else 0.0,
    }
    if kind == kinds.mjJNT_FREE:
        return Free(**{**common, "actuated": driven})
    if kind == kinds.mjJNT_BALL:
        return Spherical(**common)
    if model.jnt_limited[j] and flags.limits:
        common["limits"] = tuple(float(value) for value in model.jnt_range[j])
    common["effort"] = effort_range(mjcf, j)
    if model.jnt_stiffness[j] and flags.springs:
        common["stiffness"] = float(model.jnt_stiffness[j])
        common["rest"] = float(model.qpos_spring[model.jnt_qposadr[j]])
    axis = tuple(float(value) for value in model.jnt_axis[j])
    one_axis = Revolute if kind == kinds.mjJNT_HINGE else Prismatic
    return one_axis(axis=axis, **common)


def _referred(mjcf: MjcfModel, j: int, point: Point) -> Point:
    """The frame moved back by `ref`, the position that the joint has as it is drawn."""
    model, kinds = mjcf.data, mjcf.mujoco.mjtJoint
    kind = kinds(int(model.jnt_type[j]))
    if kind == kinds.mjJNT_BALL:
        return point
    ref = float(model.qpos0[model.jnt_qposadr[j]])
    axis = np.array(model.jnt_axis[j], dtype=float)
    if ref == 0:
        return point
    if kind == kinds.mjJNT_SLIDE:
        x, y, z = (float(value) for value in -ref * axis)
        return point.at(x, y, z)
    half = -ref / 2
    turn = matrix_of([math.cos(half), *(math.sin(half) * axis)])
    return point.at(rotation=turn.tolist())


# Equality constraints of a compiled MuJoCo model: closing joints and couplings.


def add_closures(
    mechanism: Mechanism, mjcf: MjcfModel, bodies: Sequence[Point], sites: Sequence[Point]
) -> None:
    """Add what the active equalities say, and open the loops there.

    Args:
        mechanism: with all bodies and joints of the model.
        mjcf: the model.
        bodies: the frames of the bodies, the world first.
        sites: the frames of the sites.

    Raises:
        DescriptionError: an equality is of a kind that mbs does not model.
    """
    model, kinds = mjcf.data, mjcf.mujoco.mjtEq
    if not mjcf.flags.equalities:
        return
    for k in range(model.neq):
        kind = kinds(int(model.eq_type[k]))
        if not model.eq_active0[k]:
            continue
        if kind == kinds.mjEQ_JOINT:
            mechanism.add(_coupling(mjcf, k))
        elif kind in (kinds.mjEQ_CONNECT, kinds.mjEQ_WELD):
            _close(mechanism, mjcf, k, bodies, sites)
        else:
            name = kind.name.removeprefix("mjEQ_").lower()
            _refuse(mjcf, k, f"it is of the kind {name}; only connect, weld and joint are read")


def _close(
    mechanism: Mechanism,
    mjcf: MjcfModel,
    k: int,
    bodies: Sequence[Point],
    sites: Sequence[Point],
) -> None:
    model, mujoco = mjcf.data, mjcf.mujoco
    one, two = int(model.eq_obj1id[k]), int(model.eq_obj2id[k])
    values = [float(value) for value in model.eq_data[k]]
    spherical = mujoco.mjtEq(int(model.eq_type[k])) == mujoco.mjtEq.mjEQ_CONNECT
    if int(model.eq_objtype[k]) == int(mujoco.mjtObj.mjOBJ_SITE):
        a, b = sites[one], sites[two]
    elif spherical:
        a, b = bodies[one].at(*values[:3]), bodies[two].at(*values[3:6])
    else:
        a, b = placed(bodies[one], values[3:6], values[6:10]), bodies[two].at(*values[:3])
    joint = (Spherical if spherical else Fixed)(mjcf.equalities[k], actuated=False)
    mechanism.connect(a, joint, b)
    mechanism.cut(joint)


def _coupling(mjcf: MjcfModel, k: int) -> Coupling:
    """Y - y0 = sum of a_k (x - x0)^k, about the positions in which the joints are drawn."""
    model, kinds = mjcf.data, mjcf.mujoco.mjtJoint
    driven, driver = int(model.eq_obj1id[k]), int(model.eq_obj2id[k])
    if driver < 0:
        _refuse(mjcf, k, f"it locks joint {mjcf.joints[driven]!r}; leave the joint out instead")
    for j in (driven, driver):
        if kinds(int(model.jnt_type[j])) not in (kinds.mjJNT_HINGE, kinds.mjJNT_SLIDE):
            _refuse(mjcf, k, f"joint {mjcf.joints[j]!r} has not one axis; couple hinges and slides")
    y0, x0 = (float(model.qpos0[model.jnt_qposadr[j]]) for j in (driven, driver))
    polynomial = Polynomial(model.eq_data[k, :5])(Polynomial([-x0, 1.0])) + y0
    coefficients = [float(c) for c in polynomial.trim().coef]
    return Coupling(
        mjcf.equalities[k], mjcf.joints[driven], mjcf.joints[driver], tuple(coefficients)
    )


def _refuse(mjcf: MjcfModel, k: int, reason: str) -> None:
    raise DescriptionError(f"{mjcf.path}: equality {mjcf.equalities[k]!r}: {reason}")


# What a compiled MuJoCo model may have that changes the motion and that mbs does not model.


def check_supported(mjcf: MjcfModel) -> None:
    """Refuse fluids, tendons that pull, springs that are not linear, and the like.

    What the flags of the file switch off may be there.

    Raises:
        DescriptionError: the first such thing, by its name.
    """
    for checks in (_model, _bodies, _joints, _tendons, _actuators):
        for complaint in checks(mjcf):
            raise DescriptionError(f"{mjcf.path}: {complaint}; take it out of the file")


def _model(mjcf: MjcfModel) -> Iterator[str]:
    model = mjcf.data
    for name in mjcf.flags.unknown:
        yield f"its flag {name!r} is set, which this reader does not know"
    if mjcf.flags.passive and (model.opt.density or model.opt.viscosity):
        yield "the medium has a density or viscosity, which mbs does not model"
    if model.nflex:
        yield "it has flexible objects (flex), which mbs does not model"
    if model.nplugin:
        yield "it has plugins, which mbs does not model"


def _bodies(mjcf: MjcfModel) -> Iterator[str]:
    model = mjcf.data
    compensated = mjcf.flags.passive and mjcf.flags.gravity
    for k, name in enumerate(mjcf.bodies):
        if model.body_gravcomp[k] and compensated:
            yield f"body {name!r} has gravity compensation, which mbs does not model"
        if model.body_mocapid[k] >= 0:
            yield f"body {name!r} is moved from outside (mocap), which mbs does not model"


def _joints(mjcf: MjcfModel) -> Iterator[str]:
    model, kinds = mjcf.data, mjcf.mujoco.mjtJoint
    on_axes = (int(kinds.mjJNT_HINGE), int(kinds.mjJNT_SLIDE))
    springs, dampers = mjcf.flags.springs, mjcf.flags.dampers
    for j, name in enumerate(mjcf.joints):
        if springs and model.jnt_stiffness[j] and int(model.jnt_type[j]) not in on_axes:
            yield f"ball or free joint {name!r} has a spring (stiffness), which mbs does not model"
        if springs and _any(model, "jnt_stiffnesspoly", j):
            yield f"joint {name!r} has a spring that is not linear, which mbs does not model"
        if dampers and _any(model, "dof_dampingpoly", int(model.jnt_dofadr[j])):
            yield f"joint {name!r} has damping that is not linear, which mbs does not model"


def _tendons(mjcf: MjcfModel) -> Iterator[str]:
    model, flags = mjcf.data, mjcf.flags
    acting = {"stiffness": flags.springs, "stiffnesspoly": flags.springs}
    acting |= {"damping": flags.dampers, "dampingpoly": flags.dampers}
    acting |= {"frictionloss": flags.friction}
    for k in range(model.ntendon):
        for what, acts in acting.items():
            if acts and _any(model, f"tendon_{what}", k):
                yield f"tendon {model.tendon(k).name!r} has {what}, which mbs does not model"
        if _any(model, "tendon_armature", k):
            yield f"tendon {model.tendon(k).name!r} has armature, which mbs does not model"


def _actuators(mjcf: MjcfModel) -> Iterator[str]:
    model = mjcf.data
    for k in range(model.nu):
        name = model.actuator(k).name
        if int(model.actuator_trntype[k]) not in joint_transmissions(mjcf.mujoco):
            yield f"actuator {name!r} does not act on a joint, which mbs does not model"
        for what in ("armature", "damping", "dampingpoly"):
            if _any(model, f"actuator_{what}", k):
                yield f"actuator {name!r} has {what}; give it to the joint"


def _any(model: Any, field: str, k: int) -> bool:
    """Whether a field, which older versions of MuJoCo may lack, is not zero at k."""
    values = getattr(model, field, None)
    return values is not None and bool(np.any(values[k]))


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
