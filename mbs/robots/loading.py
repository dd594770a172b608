"""Loading a mechanism by its name in the catalogue, from a dict or from a file."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any

from mbs.components import Mechanism
from mbs.errors import DescriptionError
from mbs.expressions import Parameter
from mbs.formats import from_dict, read_mjcf, read_par, read_toml, read_urdf, to_mechanism
from mbs.text import did_you_mean

_READERS: Mapping[str, Callable[[str | Path], Mechanism]] = MappingProxyType(
    {
        ".toml": lambda path: to_mechanism(read_toml(path)),
        ".par": lambda path: to_mechanism(read_par(path)),
        ".urdf": read_urdf,
        ".xml": read_mjcf,
    }
)


@cache
def catalogue() -> Mapping[str, Callable[[], Mechanism]]:
    """Every mechanism of the catalogue: name -> function that builds it."""
    from mbs import robots  # the one list of them; it imports this module

    names = (name for name in robots.__all__ if name not in (catalogue.__name__, load.__name__))
    return MappingProxyType({name: getattr(robots, name) for name in names})


def load(
    source: str | Path | Mapping[str, Any], parameters: Mapping[str, float] | None = None
) -> Mechanism:
    """A mechanism from the catalogue, a dict of the TOML schema, or a file.

    Args:
        source: a name such as "puma560", a dict, or the path of a .toml, .par, .urdf or .xml
            (MJCF) file.
        parameters: values of the symbols that it uses.

    Raises:
        DescriptionError: the name or the suffix is unknown, the description is impossible, or a
            parameter is used nowhere.
    """
    mechanism = _mechanism(source)
    known = {parameter.name: parameter for parameter in mechanism.parameters()}
    for name, value in (parameters or {}).items():
        if name not in known:
            raise DescriptionError(
                f"{mechanism.name}: parameter {name!r} is not used; {did_you_mean(name, known)}"
            )
        mechanism.values[name] = Parameter(name, value)
    return mechanism


def _mechanism(source: str | Path | Mapping[str, Any]) -> Mechanism:
    if isinstance(source, Mapping):
        return to_mechanism(from_dict(source))
    if isinstance(source, str) and source in catalogue():
        return catalogue()[source]()
    if not isinstance(source, (str, Path)):
        raise DescriptionError(
            f"robot {source!r}: it is neither a name, a dict nor a path; give one of them"
        )
    suffix = Path(source).suffix.lower()
    if suffix in _READERS:
        return _READERS[suffix](source)
    if suffix or len(Path(source).parts) > 1:
        raise DescriptionError(
            f"{source}: files of this kind are not read; {did_you_mean(suffix, _READERS)}"
        )
    raise DescriptionError(
        f"robot {str(source)!r} is not in the catalogue; {did_you_mean(str(source), catalogue())}"
    )
