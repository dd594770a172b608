"""Loading a mechanism by its name in the catalogue, from a dict or from a file."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

from mbs.components import Mechanism
from mbs.errors import DescriptionError
from mbs.expressions import Parameter
from mbs.formats import from_dict, read_mjcf, read_par, read_toml, read_urdf, to_mechanism
from mbs.messages import did_you_mean
from mbs.robots.akr3000 import akr3000
from mbs.robots.andrews_squeezer import andrews_squeezer
from mbs.robots.bricard import bricard
from mbs.robots.cart_pole import cart_pole
from mbs.robots.crx10 import crx10
from mbs.robots.delta import delta
from mbs.robots.differential_wrist import differential_wrist
from mbs.robots.five_bar import five_bar
from mbs.robots.flyball_governor import flyball_governor
from mbs.robots.four_bar import four_bar
from mbs.robots.gantry import gantry
from mbs.robots.irb120 import irb120
from mbs.robots.kr6 import kr6
from mbs.robots.manseur_doty import manseur_doty
from mbs.robots.modelica_four_bar import modelica_four_bar
from mbs.robots.modelica_rod_four_bar import modelica_rod_four_bar
from mbs.robots.n_four_bar import n_four_bar
from mbs.robots.panda import panda
from mbs.robots.planar_2r import planar_2r
from mbs.robots.puma560 import puma560
from mbs.robots.rx90 import rx90
from mbs.robots.scara import scara
from mbs.robots.simple_pendulum import simple_pendulum
from mbs.robots.single_cylinder_engine import single_cylinder_engine
from mbs.robots.slider_crank import slider_crank
from mbs.robots.sr400 import sr400
from mbs.robots.stanford import stanford
from mbs.robots.stewart_platform import stewart_platform
from mbs.robots.two_branch_tree import two_branch_tree
from mbs.robots.tx90 import tx90
from mbs.robots.ur5 import ur5
from mbs.robots.whipple_bicycle import whipple_bicycle
from mbs.robots.youbot import youbot

_CATALOGUE: Mapping[str, Callable[[], Mechanism]] = MappingProxyType(
    {
        robot.__name__: robot
        for robot in (
            puma560,
            stanford,
            rx90,
            tx90,
            kr6,
            irb120,
            ur5,
            crx10,
            panda,
            youbot,
            manseur_doty,
            gantry,
            scara,
            planar_2r,
            cart_pole,
            two_branch_tree,
            sr400,
            five_bar,
            four_bar,
            whipple_bicycle,
            slider_crank,
            single_cylinder_engine,
            modelica_four_bar,
            modelica_rod_four_bar,
            simple_pendulum,
            n_four_bar,
            andrews_squeezer,
            bricard,
            flyball_governor,
            akr3000,
            delta,
            stewart_platform,
            differential_wrist,
        )
    }
)
_READERS: Mapping[str, Callable[[str | Path], Mechanism]] = MappingProxyType(
    {
        ".toml": lambda path: to_mechanism(read_toml(path)),
        ".par": lambda path: to_mechanism(read_par(path)),
        ".urdf": read_urdf,
        ".xml": read_mjcf,
    }
)


def catalogue() -> Mapping[str, Callable[[], Mechanism]]:
    """Every mechanism of the catalogue: name -> function that builds it."""
    return _CATALOGUE


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
    if isinstance(source, str) and source in _CATALOGUE:
        return _CATALOGUE[source]()
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
        f"robot {str(source)!r} is not in the catalogue; {did_you_mean(str(source), _CATALOGUE)}"
    )
