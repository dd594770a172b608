"""Loading a mechanism by its name in the catalogue, from a dict or from a file."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from types import MappingProxyType
from typing import Any

from mbs.arguments import values_given
from mbs.components.bodies import Mounting
from mbs.components.component import component_name
from mbs.components.locking import Base, fix_root, free_root
from mbs.errors import DescriptionError
from mbs.expressions import Scalar
from mbs.formats import from_dict, read_mjcf, read_par, read_sdf, read_toml, read_urdf, to_mechanism
from mbs.mechanism import Mechanism
from mbs.text import did_you_mean, quoted

_READERS: Mapping[str, Callable[[str | Path], Mechanism]] = MappingProxyType(
    {
        ".toml": lambda path: to_mechanism(read_toml(path)),
        ".par": lambda path: to_mechanism(read_par(path)),
    }
)
_URDF, _SDF, _MJCF = (".urdf", ".xacro"), (".sdf", ".world"), ".xml"


@cache
def catalogue() -> Mapping[str, Callable[[], Mechanism]]:
    """Return the functions that build the mechanisms of the catalogue, by name.

    Each function has default values for its arguments. The module `_name` of this package contains
    the function `name`.
    """
    modules = (module.name for module in iter_modules([str(Path(__file__).parent)]))
    names = sorted(module[1:] for module in modules if module.startswith("_"))
    return MappingProxyType(
        {name: getattr(import_module(f"{__package__}._{name}"), name) for name in names}
    )


def load(
    source: str | Path | Mapping[str, Any],
    parameters: Mapping[str, float] | None = None,
    *,
    base: Base | None = None,
    lock: Mapping[str, Any] | None = None,
    strict: bool = False,
    xacro: Mapping[str, object] | None = None,
    packages: Mapping[str, str | Path] | None = None,
    gravity: Sequence[Scalar] | None = None,
    mount: Mounting | None = None,
) -> Mechanism:
    """Load a mechanism from the catalogue, from a dict of the TOML schema or from a file.

    `mechanism.notes` lists the changes, ignored parts, doubts and additions of the reader.

    Args:
        source: name in the catalogue such as "puma560", a dict, or the path of a .toml, .par,
            .urdf, .xacro, .sdf, .world or .xml (MJCF) file.
        parameters: values of the symbols of the mechanism, by name.
        base: connection of the root body to the world. None: as in the file. "free": a Free joint
            "root_joint", with positions root_joint.x .y .z .qw .qx .qy .qz and velocities
            root_joint.vx .vy .vz .wx .wy .wz in the axes of the body. "fixed": a root that is free
            in the file is welded at its position in the file. In an SDFormat file, a root is free
            if no joint connects it to the world. A table of frames (dict, .toml, .par) contains no
            inertia of the base, so that its base cannot be free.
        lock: positions by joint name [rad or m] at which joints are welded, as in `Mechanism.lock`.
        strict: whether to raise an error instead of adding a note.
        xacro: values of the arguments of a xacro file, by name.
        packages: folders by package name, for xacro files and `package://` paths.
        gravity: gravity acceleration in the world frame [m/s^2]. It replaces that of the file.
        mount: rotation of the base in the world, such as ("x", "pi") for a robot that hangs from
            the ceiling, or {"position": (0, 0, 2.5), "rotation": ("x", "pi")}. Gravity is rotated
            into the axes of the base. Poses, and the coordinates of a free root, stay relative to
            the base. The frame "outer_world" is the world: `mbs.models.transform(system, "tool",
            "outer_world")` is a pose in the world.

    Returns:
        the mechanism, before its assembly.

    Raises:
        DescriptionError: the name or the file ending is unknown, the description is invalid, a
            parameter is not used, the base cannot be free, a joint of `lock` does not exist, or
            strict is true and there is a note.
    """
    if base not in (None, "fixed", "free"):
        raise DescriptionError(f"base is {quoted(base)}; give 'fixed', 'free' or None")
    mechanism = _mechanism(source, base, strict, xacro, packages)
    if strict and mechanism.notes:
        raise DescriptionError(
            f"{mechanism.name}: {mechanism.notes[0]}; correct the file or load it not strictly"
        )
    if base == "free":
        free_root(mechanism)
    elif base == "fixed":
        fix_root(mechanism)
    if gravity is not None or mount is not None:
        mechanism.change_gravity(gravity, mount)
    if lock:
        mechanism.lock(_joint_names(mechanism, lock))
    known = {parameter.name: parameter for parameter in mechanism.parameters()}
    given = values_given(f"{mechanism.name}: parameters", parameters, '"L1": 0.3', DescriptionError)
    for name, value in given.items():
        if name not in known:
            raise DescriptionError(
                f"{mechanism.name}: parameter {name!r} is not used; {did_you_mean(name, known)}"
            )
        mechanism.values[name] = replace(known[name], default=value)
    return mechanism


def _joint_names(mechanism: Mechanism, lock: Mapping[str, Any]) -> dict[str, Any]:
    """Return the positions of `lock` by component name; names may be spelt as in the file.

    Raise a DescriptionError if `lock` is not a dict.
    """
    if not isinstance(lock, Mapping):
        raise DescriptionError(
            f"{mechanism.name}: lock is {quoted(lock)}; give a dict of joints to positions"
        )
    return {
        name if name in mechanism.components else component_name(str(name)): position
        for name, position in lock.items()
    }


def _mechanism(
    source: str | Path | Mapping[str, Any],
    base: Base | None,
    strict: bool,
    xacro: Mapping[str, object] | None,
    packages: Mapping[str, str | Path] | None,
) -> Mechanism:
    """Return the mechanism of a name, dict or file; see `load` for the arguments.

    Raise a DescriptionError if the source is of no known kind.
    """
    if isinstance(source, Mapping):
        return to_mechanism(from_dict(source))
    if isinstance(source, str) and source in catalogue():
        return catalogue()[source]()
    if not isinstance(source, (str, Path)):
        raise DescriptionError(
            f"robot {quoted(source)}: it is neither a name, a dict nor a path; give one of them"
        )
    suffix = Path(source).suffix.lower()
    if suffix in _URDF:
        return read_urdf(source, base=base, strict=strict, xacro=xacro, packages=packages)
    if suffix in _SDF:
        return read_sdf(source, base=base, strict=strict)
    if suffix == _MJCF:
        return read_mjcf(source, base=base, strict=strict)
    if suffix in _READERS:
        return _READERS[suffix](source)
    if suffix or len(Path(source).parts) > 1:
        raise DescriptionError(
            f"{quoted(str(source))[1:-1]}: files of this kind are not read;"
            f" {did_you_mean(suffix, [*_READERS, *_URDF, *_SDF, _MJCF])}"
        )
    raise DescriptionError(
        f"robot {quoted(str(source))} is not in the catalogue;"
        f" {did_you_mean(str(source), catalogue())}"
    )
