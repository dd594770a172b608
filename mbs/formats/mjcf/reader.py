"""Reader of MJCF model files, compiled by MuJoCo.

The mechanism is built from the compiled model, so defaults, frames, angle units, orientations and
inertias from geoms are interpreted by MuJoCo. Elements without effect on the motion (meshes of
bodies with a given inertia, textures, sensors) are removed before compilation with all references
to them, so that their files may be missing. Contacts are not read.
"""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NoReturn
from xml.etree.ElementTree import Element

import numpy as np
from numpy.polynomial import Polynomial

from mbs.components import (
    Body,
    Coupling,
    Fixed,
    FixedTendon,
    Force,
    Free,
    Joint,
    Point,
    Prismatic,
    Revolute,
    RigidBody,
    Rod,
    Shape,
    Spherical,
    Spring,
)
from mbs.components.component import component_name
from mbs.components.locking import FREE_JOINT, Base
from mbs.errors import DescriptionError
from mbs.formats.files import Notes
from mbs.formats.meshes import MeshFiles
from mbs.formats.mjcf.shared import numbered_name
from mbs.formats.rotations import matrix_of_quaternion
from mbs.formats.xml import parse_xml
from mbs.mechanism import Mechanism
from mbs.text import install_command, quoted

# Effect of the flags of an MJCF file.

# MuJoCo has two sets of bits in its options, `disableflags` and `enableflags`; the groups of
# `actuatorgroupdisable` are a third set. The names depend on the version: older versions have one
# flag `passive` for springs and dampers, newer versions have one flag for each.


_EFFECTIVE = {
    *("CONSTRAINT", "EQUALITY", "FRICTIONLOSS", "LIMIT", "GRAVITY", "CLAMPCTRL", "ACTUATION"),
    *("PASSIVE", "SPRING", "DAMPER"),
}
"""Disable flags that change the mechanism; see `Flags`."""
_WITHOUT_EFFECT = {
    *("CONTACT", "FILTERPARENT", "MIDPHASE", "NATIVECCD", "MULTICCD"),  # contacts are not read
    *("REFSAFE", "WARMSTART", "ISLAND"),  # solver of soft constraints; constraints of mbs are exact
    *("EULERDAMP", "AUTORESET"),  # integrator and its reset after invalid states
    "SENSOR",  # sensors are not read
}
"""Disable flags without effect on the equations of motion, with the reason."""
_ENABLED_WITHOUT_EFFECT = {
    *("OVERRIDE", "MULTICCD", "IPC", "SPECULATIVE"),  # contacts are not read
    *("ISLAND", "DIAGEXACT", "SLEEP"),  # solver of soft constraints, and bodies that it skips
    *("ENERGY", "FWDINV"),  # additional outputs
    "INVDISCRETE",  # discrete-time accelerations in the inverse dynamics of MuJoCo
}
"""Enable flags without effect on the equations of motion, with the reason."""


@dataclass(frozen=True, slots=True)
class Flags:
    """Active parts of a compiled model.

    Attributes:
        gravity: whether gravity acts.
        springs: whether springs of joints and tendons act.
        dampers: whether viscous friction of joints and tendons acts.
        passive: whether the medium and gravity compensation act; they are disabled with both
            springs and dampers.
        friction: whether Coulomb friction of joints and tendons acts (a constraint in MuJoCo).
        limits: whether joint ranges are active.
        equalities: whether equality constraints (connect, weld, joint, tendon) are active.
        actuation: whether actuators act.
        control_ranges: whether controls are clamped to their ranges.
        disabled_groups: bit mask of disabled actuator groups.
        unknown: names of set flags that this reader does not support.
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
        """Return the active parts of a compiled MuJoCo model from its option flags.

        Args:
            mujoco: the mujoco module.
            model: the mujoco.MjModel.
        """
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

    def group_acts(self, group: int) -> bool:
        """Whether the actuators of an actuator group act.

        MuJoCo can disable groups 0 to 30; actuators of other groups always act, unless actuation as
        a whole is disabled.

        Args:
            group: number of the group.
        """
        return self.actuation and not (0 <= group < 31 and self.disabled_groups >> group & 1)


def _flag_names(kinds: Any, prefix: str, bits: int) -> Iterator[str]:
    """Yield the name of each set bit of a flag word, or "bit N" for a bit without a name.

    Args:
        kinds: MuJoCo enumeration of the bits.
        prefix: prefix of the names in the enumeration, which is removed.
        bits: flag word.
    """
    known = {int(kind): name for name, kind in kinds.__members__.items() if name.startswith(prefix)}
    for k in range(bits.bit_length()):
        if bits >> k & 1:
            yield known.get(1 << k, f"bit {k}").removeprefix(prefix)


# Compiled MuJoCo model with valid component names.


@dataclass(frozen=True, slots=True)
class MjcfModel:
    """Compiled MuJoCo model with valid and unique component names.

    Attributes:
        mujoco: the mujoco module.
        data: the mujoco.MjModel.
        notes: import notes of the file; `notes.path` is its path.
        bodies, joints, sites, equalities, tendons: component names, by MuJoCo index.
        acting: indices of the active actuators.
        flags: active parts of the model.
        locked: position [rad or m] of each joint that equalities lock, by joint index; 0 for free
            joints of roots that are fixed to the world.
    """

    mujoco: Any
    data: Any
    notes: Notes
    bodies: tuple[str, ...]
    joints: tuple[str, ...]
    sites: tuple[str, ...]
    equalities: tuple[str, ...]
    tendons: tuple[str, ...]
    acting: tuple[int, ...]
    flags: Flags
    locked: Mapping[int, float]

    @staticmethod
    def of(mujoco: Any, model: Any, notes: Notes) -> MjcfModel:
        """Return a compiled model with a valid component name for each element, used only once.

        Args:
            mujoco: the mujoco module.
            model: the mujoco.MjModel.
            notes: notes of the file, which receive a note for each changed name.

        Raises:
            DescriptionError: an equality cannot be satisfied.
        """
        taken = {"base", "world"}
        plain = _names((model.body(k).name for k in range(model.nbody)), "body")

        def distinct(kind: str, given: Sequence[str], wanted: Sequence[str]) -> tuple[str, ...]:
            found = tuple(_unique_name(name, taken, kind) for name in wanted)
            for old, new in zip(given, found, strict=True):
                if old and old != new:
                    notes.add("renamed", f"{kind} {quoted(old)}", f"its name here is {new!r}")
            return found

        def of_kind(kind: str, count: int, entry: Any) -> tuple[str, ...]:
            given = [entry(k).name for k in range(count)]
            return distinct(kind, given, _names(given, kind))

        given = [model.joint(j).name for j in range(model.njnt)]
        joints = distinct(
            "joint",
            given,
            [component_name(name) or _joint_name(model, j, plain) for j, name in enumerate(given)],
        )
        given = [model.body(k).name for k in range(1, model.nbody)]
        bodies = ("world", *distinct("body", given, plain[1:]))
        flags = Flags.of(mujoco, model)
        mjcf = MjcfModel(
            mujoco,
            model,
            notes,
            bodies,
            joints,
            of_kind("site", model.nsite, model.site),
            of_kind("equality", model.neq, model.eq),
            of_kind("tendon", model.ntendon, model.tendon),
            tuple(
                k
                for k in range(_actuators_in(model))
                if flags.group_acts(int(model.actuator_group[k]))
            ),
            flags,
            {},
        )
        return replace(mjcf, locked=_locked(mjcf))

    @property
    def path(self) -> str:
        """Path of the file, for error messages."""
        return self.notes.path

    def refuse(self, what: str, remedy: str = "take it out of the file") -> NoReturn:
        """Raise a DescriptionError with the path of the file.

        Args:
            what: fault of the file.
            remedy: what the user can do.
        """
        raise DescriptionError(f"{self.path}: {what}; {remedy}")

    def has_one_axis(self, j: int) -> bool:
        """Whether a joint is a hinge or slide, and so has one degree of freedom.

        Args:
            j: MuJoCo index of the joint.
        """
        kinds = self.mujoco.mjtJoint
        return int(self.data.jnt_type[j]) in (int(kinds.mjJNT_HINGE), int(kinds.mjJNT_SLIDE))

    def drawn(self, j: int) -> float:
        """Return the position of a hinge or slide in the initial configuration qpos0 [rad or m].

        Args:
            j: MuJoCo index of the joint.
        """
        return float(self.data.qpos0[self.data.jnt_qposadr[j]])

    def terms(self, k: int) -> dict[int, float] | None:
        """Return the coefficients of a fixed tendon: length = sum of coefficient times q.

        Args:
            k: index of the tendon.

        Returns:
            Coefficient by joint index; None if the tendon is spatial.
        """
        found: dict[int, float] = {}
        first = int(self.data.tendon_adr[k])
        for w in range(first, first + int(self.data.tendon_num[k])):
            if int(self.data.wrap_type[w]) != int(self.mujoco.mjtWrap.mjWRAP_JOINT):
                return None
            j = int(self.data.wrap_objid[w])
            found[j] = found.get(j, 0.0) + float(self.data.wrap_prm[w])
        return found

    def path_bodies(self, k: int) -> list[int]:
        """Return the MuJoCo indices of the bodies along the path of a spatial tendon.

        Args:
            k: MuJoCo index of the tendon.
        """
        kinds = self.mujoco.mjtWrap
        first = int(self.data.tendon_adr[k])
        found = []
        for w in range(first, first + int(self.data.tendon_num[k])):
            kind, number = int(self.data.wrap_type[w]), int(self.data.wrap_objid[w])
            if kind == int(kinds.mjWRAP_SITE):
                found.append(int(self.data.site_bodyid[number]))
            elif kind in (int(kinds.mjWRAP_SPHERE), int(kinds.mjWRAP_CYLINDER)):
                found.append(int(self.data.geom_bodyid[number]))
        return found

    def joints_above(self, k: int) -> set[int]:
        """Return the indices of the joints between the world and a body, without locked joints.

        Args:
            k: MuJoCo index of the body.
        """
        found: set[int] = set()
        while k:
            first = int(self.data.body_jntadr[k])
            found |= set(range(first, first + int(self.data.body_jntnum[k])))
            k = int(self.data.body_parentid[k])
        return found - self.locked.keys()


def placed(point: Point, pos: Sequence[float], quat: Sequence[float]) -> Point:
    """Return the frame at a position and quaternion relative to the frame `point`.

    Args:
        point: reference frame.
        pos: position (x, y, z) of the origin in the reference frame [m].
        quat: quaternion (w, x, y, z), not necessarily of unit length.
    """
    R = matrix_of_quaternion(quat)
    # larger than rounding errors of a normalised (1, 0, 0, 0), smaller than any rotation in files
    turned = None if np.allclose(R, np.eye(3), rtol=0, atol=1e-15) else R.tolist()
    x, y, z = (float(value) for value in pos)
    return point.at(x, y, z, rotation=turned)


def _names(names: Iterable[str], kind: str) -> tuple[str, ...]:
    """Return valid component names; unnamed elements are called `kind` and index, as in "site3"."""
    return tuple(component_name(name) or f"{kind}{k}" for k, name in enumerate(names))


def _joint_name(model: Any, j: int, bodies: tuple[str, ...]) -> str:
    """Return a name for joint j without a name: the name of its body with a suffix.

    `bodies` are the component names of the bodies, by index.
    """
    k = int(model.jnt_bodyid[j])
    alone = model.body_jntnum[k] == 1
    return f"{bodies[k]}_joint" if alone else f"{bodies[k]}_joint{j - model.body_jntadr[k] + 1}"


def _unique_name(name: str, taken: set[str], kind: str) -> str:
    """Return a unique component name and add it to `taken`.

    If the name is taken, the kind of the element and then a number are appended.
    """
    if name in taken:
        name = f"{name}_{kind}"
    found = numbered_name(name, taken)
    taken.add(found)
    return found


# Actuators of a compiled MuJoCo model: driven joints and effort limits.


_Range = tuple[float, float]


def _actuators_in(model: Any) -> int:
    """Return the number of actuators. From MuJoCo 4 an actuator may have several controls."""
    return int(getattr(model, "nactuator", model.nu))


def _first_of(model: Any, address: str, k: int) -> int:
    """Return the index of the first control or output of actuator k.

    `address` is "ctrladr" for controls and "outadr" for outputs. It is k before MuJoCo 4.
    """
    rows = getattr(model, f"actuator_{address}", None)  # MuJoCo before version 4 has one row each
    return k if rows is None else int(rows[k])


def joint_actuators(mjcf: MjcfModel) -> dict[int, dict[int, float | None]]:
    """Return for each joint its actuators, with the joint effort per unit of actuator force.

    A fixed tendon drives its joints with its coefficients. A spatial tendon and the rod of a
    slider-crank drive all joints between the bodies on their path, with factors that depend on the
    configuration and are None here. Forces on sites and bodies drive no joint. Import notes report
    properties of actuators that are not read.

    Args:
        mjcf: compiled model.

    Returns:
        For each index of a driven joint: joint effort per unit of actuator force, by actuator
            index.
    """
    model, kinds = mjcf.data, mjcf.mujoco.mjtTrn
    found: dict[int, dict[int, float | None]] = {}
    for k in mjcf.acting:
        kind, number = int(model.actuator_trntype[k]), int(model.actuator_trnid[k, 0])
        gear = float(model.actuator_gear[_first_of(model, "outadr", k), 0])
        shares: dict[int, float | None] = {}
        if kind in (int(kinds.mjTRN_JOINT), int(kinds.mjTRN_JOINTINPARENT)):
            shares = {number: gear}
        elif kind == int(kinds.mjTRN_TENDON):
            terms = mjcf.terms(number)
            if terms is None:
                shares = dict.fromkeys(_between_bodies(mjcf, mjcf.path_bodies(number)))
            else:
                shares = {j: gear * factor for j, factor in terms.items()}
        elif kind == int(kinds.mjTRN_SLIDERCRANK):
            sites = (int(site) for site in model.actuator_trnid[k])
            shares = dict.fromkeys(
                _between_bodies(mjcf, [int(model.site_bodyid[site]) for site in sites])
            )
        elif kind == getattr(kinds, "mjTRN_SO3", None) and int(model.actuator_trnid[k, 1]) < 0:
            shares = {number: None}  # actuates a ball joint; between two sites it drives no joint
        for j, share in shares.items():
            found.setdefault(j, {})[k] = share
        _note_actuator(mjcf, k, sorted(shares))
    return found


def _between_bodies(mjcf: MjcfModel, bodies: Sequence[int]) -> set[int]:
    """Return the joints that move some but not all of the bodies with these indices."""
    above = [mjcf.joints_above(k) for k in bodies]
    some: set[int] = set()
    return some.union(*above) - above[0].intersection(*above) if above else some


def _note_actuator(mjcf: MjcfModel, k: int, joints: Sequence[int]) -> None:
    """Add import notes about properties of actuator k that the mechanism does not include.

    `joints` are the indices of the joints that it drives.
    """
    model, kinds = mjcf.data, mjcf.mujoco.mjtTrn
    element = f"actuator {quoted(model.actuator(k).name or k)}"
    kind = int(model.actuator_trntype[k])
    names = ", ".join(repr(mjcf.joints[j]) for j in joints)
    if kind in (int(kinds.mjTRN_TENDON), int(kinds.mjTRN_SLIDERCRANK)):
        mjcf.notes.add(
            "ignored",
            element,
            f"it drives the joints {names} together; each of them has an effort of its own here",
        )
    elif not joints:
        mjcf.notes.add(
            "ignored",
            element,
            "it acts on a site or a body, not on a joint; give its force as f_ext of the models",
        )
    if not _is_plain(mjcf, k):
        mjcf.notes.add(
            "ignored",
            element,
            "its gain, bias and dynamics say how a command becomes an effort, which is the input"
            " here; write its law as tau of a simulation",
        )


def effort_range(
    mjcf: MjcfModel, j: int, acting: Mapping[int, float | None]
) -> tuple[float, float] | None:
    """Return the range (lower, upper) of the effort of joint j [N m or N]; None if unlimited.

    It is the sum of the forcerange of the actuators times their gear, limited to the
    actuatorfrcrange of the joint. A motor without dynamics and feedback is also limited by its
    ctrlrange, unless the flag clampctrl is disabled. A range that does not contain zero is treated
    as unlimited.

    Args:
        mjcf: compiled model.
        j: index of a hinge or slide.
        acting: joint effort per unit of actuator force, by actuator index; see `joint_actuators`.
    """
    model = mjcf.data
    lower, upper = (0.0, 0.0) if acting else (-math.inf, math.inf)
    for k, share in acting.items():
        if share is None:
            ends = [-math.inf, math.inf]
        else:
            ends = sorted(share * end for end in _force(mjcf, k)) if share else [0.0, 0.0]
        lower, upper = lower + ends[0], upper + ends[1]
    if model.jnt_actfrclimited[j]:
        least, largest = (float(end) for end in model.jnt_actfrcrange[j])
        lower, upper = max(lower, least), min(upper, largest)
    limited = math.isfinite(lower) or math.isfinite(upper)
    return (lower, upper) if limited and lower <= 0 <= upper and lower < upper else None


def _is_plain(mjcf: MjcfModel, k: int) -> bool:
    """Whether actuator k is a plain motor: its force is a constant times its control."""
    model, kinds = mjcf.data, mjcf.mujoco
    return (
        int(model.actuator_gaintype[k]) == int(kinds.mjtGain.mjGAIN_FIXED)
        and int(model.actuator_biastype[k]) == int(kinds.mjtBias.mjBIAS_NONE)
        and int(model.actuator_dyntype[k]) == int(kinds.mjtDyn.mjDYN_NONE)
    )


def _force(mjcf: MjcfModel, k: int) -> _Range:
    """Return the range (lower, upper) of the force of actuator k, before its gear."""
    model = mjcf.data
    low, high = -math.inf, math.inf
    if model.actuator_forcelimited[k]:
        low, high = (float(end) for end in model.actuator_forcerange[k])
    control = _first_of(model, "ctrladr", k)
    if _is_plain(mjcf, k) and model.actuator_ctrllimited[control] and mjcf.flags.control_ranges:
        gain = float(model.actuator_gainprm[k, 0])
        ends = sorted(gain * float(end) for end in model.actuator_ctrlrange[control])
        low, high = max(low, ends[0]), min(high, ends[1])
    return low, high


# Joints of a compiled MuJoCo model.


class Joints:
    """Builder that adds the joints of a MuJoCo model to a mechanism.

    Attributes:
        mechanism: mechanism under construction.
        mjcf: compiled model.
        base: "fixed" fixes free roots to the world, "free" adds free joints to roots without
            joints; None keeps the joints of the file.
        acting: actuators of each joint; see `joint_actuators`.
    """

    def __init__(self, mechanism: Mechanism, mjcf: MjcfModel, base: Base | None) -> None:
        self.mechanism, self.mjcf, self.base = mechanism, mjcf, base
        self.acting = joint_actuators(mjcf)

    def connect(self, k: int, parent: Point) -> None:
        """Connect body k, which is already in the mechanism, to its parent by its joints.

        A body without joints is fixed to its parent. Several joints are connected in series from
        the parent to the body, with a massless body between two joints.

        Args:
            k: MuJoCo index of the body.
            parent: frame of the parent body.
        """
        mjcf, mechanism = self.mjcf, self.mechanism
        model = mjcf.data
        body = mechanism.components[mjcf.bodies[k]]
        assert isinstance(body, RigidBody)
        point = placed(parent, model.body_pos[k], model.body_quat[k])
        first = int(model.body_jntadr[k])
        joints = range(first, first + int(model.body_jntnum[k]))
        if not joints and self.base == "free" and _is_root(mjcf, k):
            name = unused_name(mechanism, mjcf, FREE_JOINT)
            mechanism.connect(parent, Free(name, actuated=False), body)
            drawn = [*model.body_pos[k], *model.body_quat[k]]
            suffixes = (*"xyz", *_QUATERNION)
            mechanism.guess |= {
                f"{name}.{x}": float(value) for x, value in zip(suffixes, drawn, strict=True)
            }
            return
        if not joints:
            mechanism.connect(point, body)
        for j in joints:
            moved = body
            if j != joints[-1]:
                name = unused_name(mechanism, mjcf, f"{mjcf.bodies[k]}_{mjcf.joints[j]}")
                moved = mechanism.add(Body(name, mass=0))
            self._connect(j, parent, point, moved)
            point = moved.frame

    def _connect(self, j: int, parent: Point, point: Point, moved: RigidBody) -> None:
        """Connect joint j between the frame `point` of the body at qpos0 and the body `moved`.

        A free joint starts at the frame `parent` of the parent body; a locked joint becomes a rigid
        connection.
        """
        mjcf, mechanism = self.mjcf, self.mechanism
        if mjcf.mujoco.mjtJoint(int(mjcf.data.jnt_type[j])) == mjcf.mujoco.mjtJoint.mjJNT_FREE:
            if self.base == "fixed":
                mechanism.connect(point, moved)
            else:
                mechanism.connect(parent, self._joint(j), moved)
            return
        x, y, z = (float(value) for value in mjcf.data.jnt_pos[j])
        at, anchor = point.at(x, y, z), moved.at(x, y, z)
        if j in mjcf.locked:
            mechanism.connect(_displace(mjcf, j, at, mjcf.locked[j] - mjcf.drawn(j)), anchor)
        elif mjcf.has_one_axis(j):
            joint = self._joint(j)
            mechanism.connect(_displace(mjcf, j, at, -mjcf.drawn(j)), joint, anchor)
        else:
            mechanism.connect(at, self._joint(j), anchor)

    def _joint(self, j: int) -> Joint:
        """Return joint j as a component, with the friction, spring and limits that are active."""
        mjcf = self.mjcf
        model, kinds, flags = mjcf.data, mjcf.mujoco.mjtJoint, mjcf.flags
        kind, dof = kinds(int(model.jnt_type[j])), int(model.jnt_dofadr[j])
        acting = self.acting.get(j, {})
        common: dict[str, Any] = {
            "name": mjcf.joints[j],
            "actuated": bool(acting) if _actuators_in(model) else None,
            "Ia": float(model.dof_armature[dof]),
            "Fv": float(model.dof_damping[dof]) if flags.dampers else 0.0,
            "Fs": float(model.dof_frictionloss[dof]) if flags.friction else 0.0,
        }
        if kind == kinds.mjJNT_FREE:
            return Free(**{**common, "actuated": bool(acting)})
        limited = model.jnt_limited[j] and flags.limits
        if kind == kinds.mjJNT_BALL:
            if limited:
                mjcf.notes.add(
                    "ignored",
                    f"joint {common['name']!r}",
                    "it has a range, and a ball joint has not one position that it could limit",
                )
            return Spherical(**common)
        if limited:
            common["limits"] = tuple(float(value) for value in model.jnt_range[j])
        common["effort"] = effort_range(mjcf, j, acting)
        if model.jnt_stiffness[j] and flags.springs:
            common["stiffness"] = float(model.jnt_stiffness[j])
            common["rest"] = float(model.qpos_spring[model.jnt_qposadr[j]])
        axis = tuple(float(value) for value in model.jnt_axis[j])
        one_axis = Revolute if kind == kinds.mjJNT_HINGE else Prismatic
        return one_axis(axis=axis, **common)


def unused_name(mechanism: Mechanism, mjcf: MjcfModel, name: str) -> str:
    """Return the name, with a number appended if the mechanism or the file already uses it.

    Args:
        mechanism: mechanism under construction.
        mjcf: compiled model.
        name: desired component name.
    """
    known = {*mjcf.bodies, *mjcf.joints, *mjcf.sites, *mjcf.equalities, *mjcf.tendons}
    return numbered_name(name, known, mechanism.components)


def _free_joints(mjcf: MjcfModel) -> list[int]:
    """Return the indices of the free joints of the model."""
    free = int(mjcf.mujoco.mjtJoint.mjJNT_FREE)
    return [j for j in range(mjcf.data.njnt) if int(mjcf.data.jnt_type[j]) == free]


def _is_root(mjcf: MjcfModel, k: int) -> bool:
    """Whether body k is a child of the world and is not a mocap body."""
    return int(mjcf.data.body_parentid[k]) == 0 and int(mjcf.data.body_mocapid[k]) < 0


def _displace(mjcf: MjcfModel, j: int, point: Point, position: float) -> Point:
    """Return `point` displaced along slide j by `position` [m], or rotated about hinge j [rad]."""
    if position == 0:
        return point
    axis = np.array(mjcf.data.jnt_axis[j], dtype=float)
    kinds = mjcf.mujoco.mjtJoint
    if kinds(int(mjcf.data.jnt_type[j])) == kinds.mjJNT_SLIDE:
        x, y, z = (float(value) for value in position * axis)
        return point.at(x, y, z)
    half = position / 2
    turn = matrix_of_quaternion([math.cos(half), *(math.sin(half) * axis)])
    return point.at(rotation=turn.tolist())


# Equality constraints of a compiled MuJoCo model: closing joints, couplings, locked joints.


def _equalities(mjcf: MjcfModel) -> Iterator[tuple[int, Any]]:
    """Yield the index and the MuJoCo kind of each active equality constraint."""
    kinds = mjcf.mujoco.mjtEq
    for k in range(mjcf.data.neq if mjcf.flags.equalities else 0):
        if mjcf.data.eq_active0[k]:
            yield k, kinds(int(mjcf.data.eq_type[k]))


def _locked(mjcf: MjcfModel) -> dict[int, float]:
    """Return the positions [rad or m] of joints that equalities lock, by joint index.

    A joint is locked directly by an equality with a constant, or by a coupling to a locked joint.
    Raise a DescriptionError if a coupling has no solution.
    """
    kinds = mjcf.mujoco.mjtEq
    found: dict[int, float] = {}
    linear = [_linear(mjcf, k, kind) for k, kind in _equalities(mjcf)]
    couplings = [
        (mjcf.equalities[k], _polynomial(mjcf, k), *_joints_of(mjcf, k))
        for k, kind in _equalities(mjcf)
        if kind == kinds.mjEQ_JOINT and int(mjcf.data.eq_obj2id[k]) >= 0
    ]
    changed = True
    while changed:
        before = len(found)
        for row in linear:
            left = {j: c for j, c in (row.terms if row else {}).items() if j not in found}
            if row and len(left) == 1:
                ((j, factor),) = left.items()
                known = sum(c * found[i] for i, c in row.terms.items() if i in found)
                found[j] = (row.value - known) / factor
        for _, polynomial, driven, driver in couplings:
            if driver in found and driven not in found:
                found[driven] = float(polynomial(found[driver]))
        changed = len(found) > before
    for name, polynomial, driven, driver in couplings:
        if driven in found and driver not in found:
            near = mjcf.drawn(driver)
            roots = (polynomial - found[driven]).roots()
            real = [float(root.real) for root in roots if abs(root.imag) < _REAL]
            if not real:
                mjcf.refuse(f"equality {name!r} is met at no position of {mjcf.joints[driver]!r}")
            found[driver] = min(real, key=lambda root: abs(root - near))
    for j, value in found.items():
        mjcf.notes.add(
            "ignored",
            f"joint {mjcf.joints[j]!r}",
            f"an equality locks it at {value:.6g}; its two bodies are welded together there",
        )
    return found


_REAL = 1e-9
"""Largest imaginary part [rad or m] of a real root, which is a rounding error."""


@dataclass(frozen=True, slots=True)
class _Row:
    """Linear equation of joint positions q: the sum of factors times q equals a value.

    Attributes:
        terms: factor by joint index.
        value: right-hand side [rad or m].
    """

    terms: dict[int, float]
    value: float


def _linear(mjcf: MjcfModel, k: int, kind: Any) -> _Row | None:
    """Return equality k as a linear equation of joint positions.

    None if it is not linear, or if it is a coupling of two joints. `kind` is its MuJoCo kind.
    """
    model, kinds = mjcf.data, mjcf.mujoco.mjtEq
    one, two = int(model.eq_obj1id[k]), int(model.eq_obj2id[k])
    constant, slope, *higher = (float(value) for value in model.eq_data[k, :5])
    if kind == kinds.mjEQ_JOINT and two < 0:
        return _Row({one: 1.0}, constant + mjcf.drawn(one))
    if kind != kinds.mjEQ_TENDON:
        return None
    lengths = [float(value) for value in model.tendon_length0]
    terms, others = mjcf.terms(one), {} if two < 0 else mjcf.terms(two)
    if terms is None or others is None or (two >= 0 and any(higher)):
        return None
    for j, factor in others.items():
        terms[j] = terms.get(j, 0.0) - slope * factor
    value = lengths[one] + constant - (slope * lengths[two] if two >= 0 else 0.0)
    return _Row({j: factor for j, factor in terms.items() if factor}, value)


def add_closures(
    mechanism: Mechanism, mjcf: MjcfModel, bodies: Sequence[Point], sites: Sequence[Point]
) -> list[int]:
    """Add the active equalities to the mechanism, and cut loops at closing joints.

    Args:
        mechanism: mechanism with all bodies and joints of the model.
        mjcf: compiled model.
        bodies: frames of the bodies by MuJoCo index; the first is the world.
        sites: frames of the sites by MuJoCo index.

    Returns:
        Indices of the equalities that were added.

    Raises:
        DescriptionError: the kind of an equality is not supported.
    """
    kinds = mjcf.mujoco.mjtEq
    taken = []
    for k, kind in _equalities(mjcf):
        if kind == kinds.mjEQ_JOINT and int(mjcf.data.eq_obj2id[k]) >= 0:
            if not mjcf.locked.keys() & set(_joints_of(mjcf, k)):
                mechanism.add(_coupling(mjcf, k))
                taken.append(k)
        elif kind in (kinds.mjEQ_JOINT, kinds.mjEQ_TENDON):
            row = _linear(mjcf, k, kind)
            if row is None:
                a, rod, b = _rod(mjcf, k, sites)
                mechanism.connect(a, rod, b)
                taken.append(k)
            elif row.terms.keys() - mjcf.locked.keys():
                mechanism.add(_linear_coupling(mjcf, k, row))
                taken.append(k)
        elif kind in (kinds.mjEQ_CONNECT, kinds.mjEQ_WELD):
            if _close(mechanism, mjcf, k, bodies, sites):
                taken.append(k)
        else:
            name = kind.name.removeprefix("mjEQ_").lower()
            mjcf.refuse(
                f"equality {mjcf.equalities[k]!r}: it is of the kind {name}; only connect, weld,"
                " joint and tendon are read"
            )
    return taken


def _rod(mjcf: MjcfModel, k: int, sites: Sequence[Point]) -> tuple[Point, Rod, Point]:
    """Return a rod and its two end frames, for equality k of a spatial tendon between two sites.

    `sites` are the frames of the sites. Raise a DescriptionError for another tendon.
    """
    model, name = mjcf.data, mjcf.equalities[k]
    tendon = int(model.eq_obj1id[k])
    ends = _two_sites(mjcf, tendon) if mjcf.terms(tendon) is None else None
    if int(model.eq_obj2id[k]) >= 0 or ends is None:
        mjcf.refuse(
            f"equality {name!r} is not linear, or ties spatial tendons that are more than a line"
            " between two sites, which mbs does not model"
        )
    length = float(model.tendon_length0[tendon]) + float(model.eq_data[k, 0])
    if length <= 0:
        mjcf.refuse(f"equality {name!r} keeps a tendon at the length {length:g} m")
    return sites[ends[0]], Rod(name, length=length), sites[ends[1]]


def _close(
    mechanism: Mechanism,
    mjcf: MjcfModel,
    k: int,
    bodies: Sequence[Point],
    sites: Sequence[Point],
) -> bool:
    """Close a loop by the connect or weld equality k, and cut the loop there.

    Return False, with an import note, if the equality closes no loop. `bodies` and `sites` are
    frames by index.
    """
    model, mujoco = mjcf.data, mjcf.mujoco
    one, two = int(model.eq_obj1id[k]), int(model.eq_obj2id[k])
    values = [float(value) for value in model.eq_data[k]]
    of_sites = int(model.eq_objtype[k]) == int(mujoco.mjtObj.mjOBJ_SITE)
    joined = [int(model.site_bodyid[i]) if of_sites else i for i in (one, two)]
    is_weld = mujoco.mjtEq(int(model.eq_type[k])) == mujoco.mjtEq.mjEQ_WELD
    element = f"equality {mjcf.equalities[k]!r}"
    for i in joined:
        if _is_moved(mjcf, i):
            mjcf.notes.add(
                "ignored",
                element,
                f"it ties a body to {mjcf.bodies[i]!r}, which is moved from outside (mocap)",
            )
            return False
    if not set.symmetric_difference(*(mjcf.joints_above(i) for i in joined)):
        mjcf.notes.add("ignored", element, "it joins two bodies that never move apart")
        return False
    # a weld with zero torquescale has no rotational equations
    spherical = not is_weld or values[10] == 0
    if of_sites:
        a, b = sites[one], sites[two]
    elif is_weld:
        a, b = placed(bodies[one], values[3:6], values[6:10]), bodies[two].at(*values[:3])
        if spherical:
            a = bodies[one].at(*values[3:6])
    else:
        a, b = bodies[one].at(*values[:3]), bodies[two].at(*values[3:6])
    joint = (Spherical if spherical else Fixed)(mjcf.equalities[k], actuated=False)
    mechanism.connect(a, joint, b)
    mechanism.cut(joint)
    return True


def _is_moved(mjcf: MjcfModel, k: int) -> bool:
    """Whether the motion of body k is prescribed from outside (its root is a mocap body)."""
    return int(mjcf.data.body_mocapid[mjcf.data.body_rootid[k]]) >= 0 and k > 0


def _joints_of(mjcf: MjcfModel, k: int) -> tuple[int, int]:
    """Return the indices of the driven and the driving joint of joint equality k."""
    return int(mjcf.data.eq_obj1id[k]), int(mjcf.data.eq_obj2id[k])


def _polynomial(mjcf: MjcfModel, k: int) -> Polynomial:
    """Return the position of the driven joint as a polynomial of the driving position.

    It is y - y0 = sum of a_k (x - x0)^k, where x0 and y0 are the positions at qpos0 [rad or m].
    """
    y0, x0 = (mjcf.drawn(j) for j in _joints_of(mjcf, k))
    return Polynomial(mjcf.data.eq_data[k, :5])(Polynomial([-x0, 1.0])) + y0


def _coupling(mjcf: MjcfModel, k: int) -> Coupling:
    """Return the joint equality k as a polynomial coupling of two joints."""
    driven, driver = (mjcf.joints[j] for j in _joints_of(mjcf, k))
    coefficients = tuple(float(c) for c in _polynomial(mjcf, k).trim().coef)
    return Coupling(mjcf.equalities[k], driven, driver, coefficients)


def _linear_coupling(mjcf: MjcfModel, k: int, row: _Row) -> Coupling:
    """Return linear equality k as a coupling whose driven joint has the largest factor.

    `row` is the equation. Locked joints enter with their constant positions.
    """
    value = row.value - sum(c * mjcf.locked[j] for j, c in row.terms.items() if j in mjcf.locked)
    moving = {j: c for j, c in row.terms.items() if j not in mjcf.locked}
    driven = max(moving, key=lambda j: abs(moving[j]))
    scale = moving.pop(driven)
    ratios = [(mjcf.joints[j], -factor / scale) for j, factor in moving.items()]
    (driver, ratio), *others = ratios
    return Coupling(
        mjcf.equalities[k],
        mjcf.joints[driven],
        driver,
        (value / scale, ratio),
        others=tuple(others),
    )


# Forces of a compiled MuJoCo model: tendons and gravity compensation.


def add_forces(
    mechanism: Mechanism, mjcf: MjcfModel, bodies: Sequence[Point], sites: Sequence[Point]
) -> None:
    """Add tendons with springs, damping or friction, and forces for gravity compensation.

    Args:
        mechanism: mechanism with all bodies and joints of the model.
        mjcf: compiled model.
        bodies: frames of the bodies by MuJoCo index; the first is the world.
        sites: frames of the sites by MuJoCo index.

    Raises:
        DescriptionError: a spatial tendon with forces is not a straight line between two sites, or
            only some actuators of a body compensate gravity.
    """
    for k, name in enumerate(mjcf.tendons):
        _add_tendon(mechanism, mjcf, k, name, sites)
    if mjcf.flags.passive and mjcf.flags.gravity:
        for k in range(1, mjcf.data.nbody):
            _add_compensation(mechanism, mjcf, k, bodies[k])


def _add_tendon(
    mechanism: Mechanism, mjcf: MjcfModel, k: int, name: str, sites: Sequence[Point]
) -> None:
    """Add tendon k, named `name`, as a spring or fixed tendon, if it exerts a force.

    `sites` are the frames of the sites. Raise a DescriptionError for a spatial tendon that exerts
    forces and is not a linear spring between two sites.
    """
    model, flags = mjcf.data, mjcf.flags
    if model.tendon_limited[k] and flags.limits:
        mjcf.notes.add(
            "ignored", f"tendon {name!r}", "it has a range, and only joints have limits here"
        )
    stiffness = float(model.tendon_stiffness[k]) if flags.springs else 0.0
    # scalar before MuJoCo 3.7, first coefficient of a polynomial in later versions
    damping = float(np.ravel(model.tendon_damping[k])[0]) if flags.dampers else 0.0
    friction = float(model.tendon_frictionloss[k]) if flags.friction else 0.0
    if not (stiffness or damping or friction):
        return
    low, high = (float(value) for value in model.tendon_lengthspring[k])
    terms = mjcf.terms(k)
    if terms is None:
        ends = _two_sites(mjcf, k)
        if ends is None or friction or (stiffness and low != high):
            mjcf.refuse(
                f"spatial tendon {name!r} pulls (stiffness, damping or frictionloss), and is more"
                " than a line between two sites or goes slack, which mbs does not model"
            )
        a, b = (sites[end] for end in ends)
        if a.owner is not b.owner:
            mechanism.add(Spring(name, a, b, stiffness=stiffness, length=low, damping=damping))
        return
    slack = sum(c * mjcf.locked[j] for j, c in terms.items() if j in mjcf.locked)
    moving = {mjcf.joints[j]: c for j, c in terms.items() if c and j not in mjcf.locked}
    if moving:
        mechanism.add(
            FixedTendon(
                name,
                levers=tuple(moving.items()),
                stiffness=stiffness,
                length=(low - slack, high - slack),
                damping=damping,
                friction=friction,
            )
        )


def _two_sites(mjcf: MjcfModel, k: int) -> tuple[int, int] | None:
    """Return the indices of the end sites of straight spatial tendon k; None for other tendons."""
    model, site = mjcf.data, int(mjcf.mujoco.mjtWrap.mjWRAP_SITE)
    first, count = int(model.tendon_adr[k]), int(model.tendon_num[k])
    kinds = [int(model.wrap_type[w]) for w in range(first, first + count)]
    if kinds != [site, site]:
        return None
    return int(model.wrap_objid[first]), int(model.wrap_objid[first + 1])


def _add_compensation(mechanism: Mechanism, mjcf: MjcfModel, k: int, body: Point) -> None:
    """Add the force that compensates the weight of body k (gravcomp) at its centre of mass.

    `body` is the frame of the body. Nothing is added if the body cannot move or has no weight.
    Raise a DescriptionError if only some of its joints compensate gravity by their actuators.
    """
    model = mjcf.data
    share, joints = float(model.body_gravcomp[k]), mjcf.joints_above(k)
    gravity = [float(value) for value in model.opt.gravity]
    if not (share and joints and any(gravity) and model.body_mass[k]):
        return
    by_motors = {j for j in joints if model.jnt_actgravcomp[j]}
    element = f"body {mjcf.bodies[k]!r}"
    if by_motors == joints:
        mjcf.notes.add(
            "ignored", element, "its gravcomp is a part of what its actuators give, the input here"
        )
        return
    if by_motors:
        mjcf.refuse(
            f"{element} has gravity compensation by some of its joints' actuators and not by others"
        )
    scale = -share * float(model.body_mass[k])
    x, y, z = (float(value) for value in model.body_ipos[k])
    name = unused_name(mechanism, mjcf, f"{mjcf.bodies[k]}_gravcomp")
    mechanism.add(Force(name, body.at(x, y, z), force=tuple(scale * g for g in gravity)))


# Initial configuration: keyframes and qpos0 of the file.


_CLOSED_AS_WRITTEN = 1e-2
"""Largest loop error [m or rad] of a configuration of the file that counts as closed: keyframes
have few digits and are states of soft constraints."""


def starting_configuration(mechanism: Mechanism, mjcf: MjcfModel, closures: Sequence[int]) -> None:
    """Set the initial guess of the mechanism to a configuration of the file.

    It is the first configuration that closes the loops, in the order: keyframe `home`, first
    keyframe, qpos0. If none of them closes the loops, it is the configuration with the smallest
    loop error.

    Args:
        mechanism: mechanism with all joints of the model; its guess is set.
        mjcf: compiled model.
        closures: indices of the equalities in the mechanism.
    """
    model = mjcf.data
    keys = [model.key(k) for k in range(model.nkey)]
    named = [key for key in keys if key.name.lower() == "home"]
    candidates = [np.array(key.qpos, dtype=float).ravel() for key in (*named, *keys)[:2]]
    candidates.append(np.array(model.qpos0, dtype=float))
    openings = [_opening(mjcf, qpos, closures) for qpos in candidates]
    closed = [k for k, opening in enumerate(openings) if opening < _CLOSED_AS_WRITTEN]
    qpos = candidates[closed[0] if closed else int(np.argmin(openings))]
    for j, joint in enumerate(mjcf.joints):
        component = mechanism.components.get(joint)
        if isinstance(component, Joint):
            mechanism.guess |= _positions(mjcf, j, qpos, bool(closures))


def _opening(mjcf: MjcfModel, qpos: Any, closures: Sequence[int]) -> float:
    """Return the largest residual of the equalities `closures` at a configuration [m or rad].

    Infinite if `qpos`, the MuJoCo position vector, is not finite.
    """
    if not closures or not np.all(np.isfinite(qpos)):
        return 0.0 if np.all(np.isfinite(qpos)) else math.inf
    mujoco, model = mjcf.mujoco, mjcf.data
    flags = int(model.opt.disableflags)
    try:
        model.opt.disableflags = flags | int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
        data = mujoco.MjData(model)
        data.qpos[:] = qpos
        mujoco.mj_fwdPosition(model, data)
    finally:
        model.opt.disableflags = flags
    equality = int(mujoco.mjtConstraint.mjCNSTR_EQUALITY)
    rows = (np.array(data.efc_type) == equality) & np.isin(data.efc_id, list(closures))
    return float(np.max(np.abs(np.array(data.efc_pos)[rows]), initial=0.0))


_QUATERNION = ("qw", "qx", "qy", "qz")


def _positions(mjcf: MjcfModel, j: int, qpos: Any, all_of_them: bool) -> dict[str, float]:
    """Return the positions of joint j in the MuJoCo vector `qpos`, by coordinate name.

    Empty if all are zero, unless `all_of_them` is True.
    """
    kinds = mjcf.mujoco.mjtJoint
    kind, at = kinds(int(mjcf.data.jnt_type[j])), int(mjcf.data.jnt_qposadr[j])
    name = mjcf.joints[j]
    if mjcf.has_one_axis(j):
        values = {name: float(qpos[at])}
    else:
        shift = {}
        if kind == kinds.mjJNT_FREE:
            shift = {f"{name}.{x}": float(qpos[at + i]) for i, x in enumerate("xyz")}
            at += 3
        quaternion = np.array(qpos[at : at + 4], dtype=float)
        length = float(np.linalg.norm(quaternion))
        quaternion = quaternion / length if length else np.array([1.0, 0, 0, 0])
        turn = {f"{name}.{x}": float(v) for x, v in zip(_QUATERNION, quaternion, strict=True)}
        values = shift | turn
    return values if all_of_them or any(values.values()) else {}


# Shapes of bodies for pictures: their geoms.


_SEEN_GROUPS = (0, 1, 2)
"""Geom groups that the viewer of MuJoCo shows by default; files put collision geoms in other
groups."""
_DEFAULT_COLOUR = (0.5, 0.5, 0.5, 1.0)
"""Default colour of geoms in MuJoCo; for geoms with this colour, the colour of the material
counts."""


@dataclass(frozen=True, slots=True)
class MeshAssets:
    """Mesh files of a model and the scale factors of their lengths along x, y and z.

    Attributes:
        of_meshes: file and scale factors, by mesh name.
        of_geoms: file and scale factors, by name of the geoms that were replaced by spheres.
        others: names of meshes that are not drawn, since they differ from a file.
    """

    of_meshes: dict[str, tuple[str, tuple[float, ...]]]
    of_geoms: dict[str, tuple[str, tuple[float, ...]]]
    others: list[str]


def _mesh_assets(spec: Any) -> MeshAssets:
    """Return the meshes of a model specification that are used unchanged from their files."""
    found, others = {}, []
    for mesh in spec.meshes:
        moved = any(mesh.refpos) or tuple(mesh.refquat) != (1.0, 0.0, 0.0, 0.0)
        if mesh.file and not moved:
            file = Path(mesh.file).name if getattr(spec, "strippath", False) else mesh.file
            place = (Path(spec.meshdir or "") / file).as_posix()
            scale = tuple(float(factor) for factor in mesh.scale)
            found[mesh.name or Path(mesh.file).stem] = (place, scale)
        else:
            others.append(mesh.name)
    return MeshAssets(found, {}, others)


def add_shapes(
    mechanism: Mechanism,
    mjcf: MjcfModel,
    points: Sequence[Point],
    assets: MeshAssets,
    meshes: MeshFiles,
) -> None:
    """Add the geoms of the bodies as shapes of the mechanism, for pictures.

    Args:
        mechanism: mechanism that receives the shapes.
        mjcf: compiled model.
        points: frames of the bodies by MuJoCo index.
        assets: mesh files and scale factors.
        meshes: search for the mesh files.
    """
    model = mjcf.data
    groups = [int(group) for group in model.geom_group]
    usual = any(
        group in _SEEN_GROUPS and int(model.geom_bodyid[g]) for g, group in enumerate(groups)
    )
    for g, group in enumerate(groups):
        if usual and group not in _SEEN_GROUPS:
            continue
        colour = _geom_colour(mjcf, g)
        if colour[3] == 0:
            continue  # it is intentionally invisible
        made = _geom_shape(mjcf, g, colour[:3], assets, meshes)
        if made is not None:
            point = placed(points[model.geom_bodyid[g]], model.geom_pos[g], model.geom_quat[g])
            mechanism.shapes.append((_file_frame(mjcf, g, point), made))


def _geom_colour(mjcf: MjcfModel, g: int) -> tuple[float, ...]:
    """Return the colour (red, green, blue, opacity) of geom g, each between 0 and 1."""
    model = mjcf.data
    colour, material = tuple(map(float, model.geom_rgba[g])), int(model.geom_matid[g])
    if np.allclose(colour, _DEFAULT_COLOUR) and material >= 0:  # MuJoCo stores single precision
        colour = tuple(map(float, model.mat_rgba[material]))
    return tuple(min(max(part, 0.0), 1.0) for part in colour)


def _geom_shape(
    mjcf: MjcfModel,
    g: int,
    colour: tuple[float, ...],
    assets: MeshAssets,
    meshes: MeshFiles,
) -> Shape | None:
    """Return geom g as a shape of the given colour; None if it cannot be drawn.

    `assets` gives the file of a mesh, which `meshes` searches.
    """
    model, kinds = mjcf.data, mjcf.mujoco.mjtGeom
    asset = assets.of_geoms.get(model.geom(g).name)
    kind = int(model.geom_type[g])
    if kind == int(kinds.mjGEOM_MESH):
        asset = assets.of_meshes.get(model.mesh(int(model.geom_dataid[g])).name)
    rgb = (colour[0], colour[1], colour[2])
    if asset is not None:
        path = meshes.find(asset[0])
        return None if path is None else Shape("mesh", asset[1], rgb, path)
    a, b, c = (float(length) for length in model.geom_size[g])
    if kind == int(kinds.mjGEOM_BOX):
        return Shape("box", (2 * a, 2 * b, 2 * c), rgb)
    if kind == int(kinds.mjGEOM_SPHERE):
        return Shape("sphere", (a,), rgb)
    if kind == int(kinds.mjGEOM_CYLINDER):
        return Shape("cylinder", (a, 2 * b), rgb)
    if kind == int(kinds.mjGEOM_CAPSULE):
        return Shape("capsule", (a, 2 * b), rgb)
    if kind == int(kinds.mjGEOM_ELLIPSOID):
        return Shape("ellipsoid", (a, b, c), rgb)
    return None


def _file_frame(mjcf: MjcfModel, g: int, point: Point) -> Point:
    """Return the frame in which a mesh file of geom g is drawn; other geoms keep the frame `point`.

    MuJoCo moves the points of a mesh to its centre of mass and principal axes.
    """
    model = mjcf.data
    if int(model.geom_type[g]) != int(mjcf.mujoco.mjtGeom.mjGEOM_MESH):
        return point
    mesh = int(model.geom_dataid[g])
    R = matrix_of_quaternion(model.mesh_quat[mesh]).T
    return placed(point, -R @ model.mesh_pos[mesh], model.mesh_quat[mesh] * [1, -1, -1, -1])


# Unsupported elements of a compiled MuJoCo model that change the motion.


def check_supported(mjcf: MjcfModel) -> None:
    """Raise if the model has fluids, flexible bodies, nonlinear springs or similar elements.

    Elements that are disabled by flags of the file are allowed.

    Args:
        mjcf: compiled model.

    Raises:
        DescriptionError: an unsupported element was found; the message names it.
    """
    for checks in (_model_faults, _joint_faults, _tendon_faults, _actuator_faults):
        for complaint in checks(mjcf):
            mjcf.refuse(complaint)


def _model_faults(mjcf: MjcfModel) -> Iterator[str]:
    """Yield an error message for each unsupported property of the model as a whole."""
    model = mjcf.data
    for name in mjcf.flags.unknown:
        yield f"its flag {name!r} is set, which this reader does not know"
    if mjcf.flags.passive and (model.opt.density or model.opt.viscosity):
        yield "the medium has a density or viscosity, which mbs does not model"
    if model.nflex:
        yield "it has flexible objects (flex), which mbs does not model"
    if model.nplugin:
        yield "it has plugins, which mbs does not model"


def _joint_faults(mjcf: MjcfModel) -> Iterator[str]:
    """Yield an error message for each unsupported property of a joint."""
    model = mjcf.data
    springs, dampers = mjcf.flags.springs, mjcf.flags.dampers
    for j, name in enumerate(mjcf.joints):
        if springs and model.jnt_stiffness[j] and not mjcf.has_one_axis(j):
            yield f"ball or free joint {name!r} has a spring (stiffness), which mbs does not model"
        if springs and _is_nonzero(model, "jnt_stiffnesspoly", j):
            yield f"joint {name!r} has a spring that is not linear, which mbs does not model"
        if dampers and _is_nonzero(model, "dof_dampingpoly", int(model.jnt_dofadr[j])):
            yield f"joint {name!r} has damping that is not linear, which mbs does not model"


def _tendon_faults(mjcf: MjcfModel) -> Iterator[str]:
    """Yield an error message for each unsupported property of a tendon."""
    model, flags = mjcf.data, mjcf.flags
    acting = {"stiffnesspoly": flags.springs, "dampingpoly": flags.dampers, "armature": True}
    for k, name in enumerate(mjcf.tendons):
        for what, acts in acting.items():
            if acts and _is_nonzero(model, f"tendon_{what}", k):
                yield f"tendon {name!r} has {what}, which mbs does not model"


def _actuator_faults(mjcf: MjcfModel) -> Iterator[str]:
    """Yield an error message for each unsupported property of an actuator."""
    model = mjcf.data
    for k in mjcf.acting:
        for what in ("armature", "damping", "dampingpoly"):
            if _is_nonzero(model, f"actuator_{what}", k):
                yield f"actuator {model.actuator(k).name!r} has {what}; give it to the joint"


def _is_nonzero(model: Any, field: str, k: int) -> bool:
    """Whether the array `field` of a model is nonzero at index k.

    False if this version of MuJoCo does not have the field.
    """
    values = getattr(model, field, None)
    return values is not None and bool(np.any(values[k]))


# Reader of complete files.


_LONGEST_REASON = 400
"""Maximum number of characters of a MuJoCo message that are quoted; it may contain long names."""


def read_mjcf(
    path: str | Path, base: Base | None = None, strict: bool = False, other_files: bool = True
) -> Mechanism:
    """Read an MJCF file as a mechanism.

    Bodies, joints and sites keep their names, with blanks, dots and quotes replaced by underscores.
    Joints without a name are named after their body, and the kind of the element is appended to
    names that are already used. Several joints of a body become a chain with massless bodies. A
    closing `connect` becomes a spherical joint and a `weld` a fixed joint, at which the loop is
    cut. An equality of joints or of fixed tendons becomes a coupling; an equality that locks a
    joint fixes its bodies to each other. Joint positions are the qpos of MuJoCo, with `ref` taken
    into account. The `guess` of the mechanism is the first configuration that closes the loops, in
    the order: keyframe `home`, first keyframe, qpos0.

    Only the driven joints of actuators are read; if the file has actuators, joints without an
    actuator are passive. The inputs of the models are joint efforts. Gear, kp, ctrlrange and
    dynamics of actuators are not part of the mechanism, and a position or velocity servo must be
    modelled as a controller.

    Elements that are disabled by flags or actuator groups of the file are left out: springs,
    dampers, Coulomb friction, gravity, equalities, ranges of joints and controls, actuators.

    Pictures show the geoms of groups 0 to 2, as the viewer of MuJoCo does by default, or all geoms
    if no body has a geom of these groups. Planes and height fields are not drawn.

    Args:
        path: path of the file.
        base: "free" adds a Free joint (`root_joint`, ...) to every root body without joints;
            "fixed" fixes roots with a free joint to the world at their pose in the file.
        strict: whether to raise an error instead of adding a note.
        other_files: whether to read the mesh files for pictures; set to False for files from
            untrusted sources.

    Returns:
        The mechanism. Its `notes` list ignored and renamed elements.

    Raises:
        DescriptionError: mujoco is not installed, the file is missing or malformed, or it contains
            an unsupported element that changes the motion. In strict mode, also for each note.
    """
    if base not in (None, "fixed", "free"):
        raise DescriptionError(f"{path}: base is {quoted(base)}; give 'fixed', 'free' or None")
    name = _model_name(path)
    mujoco = _mujoco()
    notes = Notes(str(path), strict)
    model, assets = _compile(mujoco, str(path), notes)
    mjcf = MjcfModel.of(mujoco, model, notes)
    if base == "fixed":
        mjcf = replace(mjcf, locked={**mjcf.locked, **dict.fromkeys(_free_joints(mjcf), 0.0)})
    check_supported(mjcf)
    mechanism = Mechanism(
        name,
        gravity=_gravity(mjcf),
        source=f"MJCF file {Path(path).name}",
    )
    points: list[Point] = [mechanism.world.frame]
    joints = Joints(mechanism, mjcf, base)
    for k in range(1, model.nbody):
        if int(model.body_mocapid[k]) >= 0:
            notes.add(
                "ignored",
                f"body {mjcf.bodies[k]!r}",
                "it is moved from outside (mocap); here it stands still where it is drawn",
            )
        body = mechanism.add(_body(mjcf, k))
        joints.connect(k, points[model.body_parentid[k]])
        points.append(body.frame)
    sites = [
        placed(points[model.site_bodyid[k]], model.site_pos[k], model.site_quat[k])
        for k in range(model.nsite)
    ]
    for name, point in zip(mjcf.sites, sites, strict=True):
        mechanism.add_frame(name, point)
    closures = add_closures(mechanism, mjcf, points, sites)
    add_forces(mechanism, mjcf, points, sites)
    starting_configuration(mechanism, mjcf, closures)
    meshes = MeshFiles(Path(path).resolve().parent if other_files else None)
    add_shapes(mechanism, mjcf, points, assets, meshes)
    meshes.note(notes)
    if assets.others:
        text = "not drawn: it has a reference frame, or its points stand in the description"
        names = f"{quoted(assets.others[0])}" + (" and others" if assets.others[1:] else "")
        notes.add("ignored", f"mesh {names}", text)
    mechanism.notes.extend(notes.taken)
    return mechanism


def _model_name(path: str | Path) -> str:
    """Return a component name for the model in a file: its attribute `model`, or the file name.

    Raise a DescriptionError if the file is not MJCF or generates too many copies of an element.
    """
    root = parse_xml(path)
    if root.tag != "mujoco":
        raise DescriptionError(
            f"{path}: the root element is <{root.tag}>, not <mujoco>; give an MJCF file, or read a"
            " URDF file with read_urdf"
        )
    _refuse_many_copies(path, root, 1)
    return component_name(root.get("model") or Path(path).stem)


_MOST_COPIES = 10_000
"""Maximum number of copies of an element: models of crowds have hundreds, and MuJoCo would
generate any number, for hours."""


def _refuse_many_copies(path: str | Path, element: Element, copies: int) -> None:
    """Raise a DescriptionError if nested counts multiply an element to more than `_MOST_COPIES`.

    `copies` is the number of copies that the enclosing elements generate.
    """
    if element.tag in ("replicate", "composite", "flexcomp"):
        counts = [int(count) for count in re.findall(r"\d{1,18}", element.get("count", ""))]
        copies *= math.prod(counts)
        if copies > _MOST_COPIES:
            raise DescriptionError(
                f"{path}: a <{element.tag}> makes {copies} copies, and {_MOST_COPIES} are the most;"
                " write fewer"
            )
    for child in element:
        _refuse_many_copies(path, child, copies)


def _mujoco() -> Any:
    """Return the module mujoco; raise a DescriptionError if it is not installed."""
    try:
        import mujoco
    except ImportError:
        raise DescriptionError(
            "MJCF files are read by mujoco, which is not installed; run: "
            + install_command("import")
        ) from None
    return mujoco


def _compile(mujoco: Any, path: str, notes: Notes) -> tuple[Any, MeshAssets]:
    """Compile a model file, and return the mujoco.MjModel and its mesh files.

    Elements without effect on the motion are removed first; if this fails, the complete model is
    compiled. Raise a DescriptionError with the message of MuJoCo if both fail.
    """
    reasons: list[str] = []
    for stripped in (True, False):
        with warnings.catch_warnings(record=True) as heard:
            warnings.simplefilter("always")
            try:
                spec = _spec(mujoco, path)
                assets = _mesh_assets(spec)
                if stripped:
                    _remove_unneeded(mujoco, spec, assets)
                model = spec.compile()
            except (ValueError, RuntimeError) as error:
                reasons.append(_sentence(error))
                continue
        for text in dict.fromkeys(_sentence(warning.message) for warning in heard):
            notes.add("doubted", "the model", f"mujoco says: {text}")
        return model, assets
    raise DescriptionError(f"{path}: mujoco refuses the file: {reasons[0]}; correct it")


def _sentence(said: object) -> str:
    """Return a MuJoCo message on one line, cut to `_LONGEST_REASON` characters in the middle."""
    text = " ".join(str(said).removeprefix("Error: ").split())
    half = _LONGEST_REASON // 2
    return text if len(text) <= _LONGEST_REASON else f"{text[:half]} ... {text[-half:]}"


def _spec(mujoco: Any, path: str) -> Any:
    """Return the specification of a model file, with all bodies and visual geoms kept."""
    spec = mujoco.MjSpec.from_file(path)
    spec.compiler.fusestatic = False
    spec.compiler.discardvisual = False
    return spec


def _remove_unneeded(mujoco: Any, spec: Any, assets: MeshAssets) -> None:
    """Remove elements from a model specification that do not affect the motion.

    `mujoco` is the module, `spec` the MjSpec, which is changed. A mesh without effect on the
    inertia is replaced by a sphere, which keeps its pose, and is recorded in `assets`.
    """
    for kind in ("sensors", "pairs", "excludes", "skins", "cameras", "lights", "tuples"):
        for element in list(getattr(spec, kind)):
            spec.delete(element)
    for number, geom in enumerate(list(_geoms_without_inertia(mujoco, spec))):
        asset = assets.of_meshes.get(geom.meshname)
        if asset is None or geom.type == mujoco.mjtGeom.mjGEOM_SDF:
            spec.delete(geom)
            continue
        geom.name = geom.name or f"mesh of the picture {number}"
        assets.of_geoms[geom.name] = asset
        # size and mass have no effect, since the inertia of the body is given
        geom.type, geom.meshname, geom.size, geom.mass = (
            mujoco.mjtGeom.mjGEOM_SPHERE,
            "",
            [1] * 3,
            0,
        )
    meshes = {geom.meshname for geom in spec.geoms}
    fields = {geom.hfieldname for geom in spec.geoms}
    for material in spec.materials:
        material.textures = [""] * len(material.textures)
    unused = [mesh for mesh in spec.meshes if mesh.name not in meshes]
    unused += [hfield for hfield in spec.hfields if hfield.name not in fields]
    for asset in [*unused, *spec.textures]:
        spec.delete(asset)


def _geoms_without_inertia(mujoco: Any, spec: Any) -> Iterator[Any]:
    """Yield geoms of an MjSpec with mesh or height-field files that have no effect on inertias."""
    always = mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE
    kinds = mujoco.mjtGeom
    with_assets = (kinds.mjGEOM_MESH, kinds.mjGEOM_HFIELD, kinds.mjGEOM_SDF)
    from_geoms = int(spec.compiler.inertiafromgeom) == int(always)
    for body in spec.bodies:
        if body.name == "world" or (body.explicitinertial and not from_geoms):
            for geom in body.geoms:
                if geom.type in with_assets or geom.meshname:
                    yield geom


def _gravity(mjcf: MjcfModel) -> tuple[float, ...]:
    """Return the acceleration of gravity (3,) in the world [m/s^2]; zero if it is disabled."""
    if not mjcf.flags.gravity:
        return (0.0, 0.0, 0.0)
    return tuple(float(value) for value in mjcf.data.opt.gravity)


def _body(mjcf: MjcfModel, k: int) -> Body:
    """Return body k with its mass, centre of mass and inertia about the centre of mass."""
    model, kinds = mjcf.data, mjcf.mujoco.mjtSameFrame
    # MuJoCo treats frames that differ by 1e-8 as equal, and computes with equal frames
    same = int(model.body_sameframe[k])
    turned = same not in (int(kinds.mjSAMEFRAME_BODY), int(kinds.mjSAMEFRAME_BODYROT))
    R = matrix_of_quaternion(model.body_iquat[k]) if turned else np.eye(3)
    tensor = R @ np.diag(model.body_inertia[k]) @ R.T
    at_origin = same == int(kinds.mjSAMEFRAME_BODY)
    com = (0.0, 0.0, 0.0) if at_origin else tuple(float(value) for value in model.body_ipos[k])
    return Body(
        mjcf.bodies[k],
        mass=float(model.body_mass[k]),
        com=com,
        inertia=((tensor + tensor.T) / 2).tolist(),
    )
