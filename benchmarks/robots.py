"""The robots that are timed, each as one description that every library reads.

Arms of the catalogue come from their tables. The others are URDF texts made here:

- iiwa: lengths, masses and inertias (diagonal, as usual) of descriptions of the KUKA LBR iiwa 14.
- panda_like: the joint frames of the Franka Emika Panda, seeded inertias with all ten parameters.
- quadruped: free base and 12 joints, lengths and masses near those of small electric quadrupeds,
  seeded full inertias.
- humanoid: free base and 32 joints (legs 6, torso 2, arms 7, grippers 1, head 2), near the size
  of a 95 kg adult humanoid, seeded full inertias.
- chain<n>: n revolute joints about x, y and z in turn, seeded lengths and full inertias.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from math import pi
from pathlib import Path

import casadi
import numpy as np

import mbs
from mbs.assembly import System

CATALOGUE = ("puma560", "rx90", "stanford")
AXES = {"x": "1 0 0", "y": "0 1 0", "z": "0 0 1"}


@dataclass(frozen=True, slots=True)
class Link:
    """A body and the joint that carries it; `axis` is x, y, z or "free"."""

    name: str
    parent: str
    axis: str
    xyz: tuple[float, float, float]
    mass: float
    com: tuple[float, ...]
    inertia: tuple[float, ...]
    rpy: tuple[float, float, float] = (0.0, 0.0, 0.0)


def urdf(name: str, links: list[Link]) -> str:
    """URDF text of links on a base called world."""
    parts = [f'<robot name="{name}">', '<link name="world"/>']
    for link in links:
        keys = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
        inertia = " ".join(f'{k}="{x!r}"' for k, x in zip(keys, link.inertia, strict=True))
        parts.append(
            f'<link name="{link.name}"><inertial><origin xyz="{_text(link.com)}" rpy="0 0 0"/>'
            f'<mass value="{link.mass!r}"/><inertia {inertia}/></inertial></link>'
        )
        axis = f'<axis xyz="{AXES[link.axis]}"/>' if link.axis in AXES else ""
        if axis:
            axis += '<limit lower="-3" upper="3" effort="1000" velocity="100"/>'
        kind = "revolute" if axis else "floating"
        parts.append(
            f'<joint name="{link.name}_joint" type="{kind}"><parent link="{link.parent}"/>'
            f'<child link="{link.name}"/>{axis}'
            f'<origin xyz="{_text(link.xyz)}" rpy="{_text(link.rpy)}"/></joint>'
        )
    return "\n".join([*parts, "</robot>"])


def _text(values: tuple[float, ...]) -> str:
    return " ".join(repr(float(x)) for x in values)


def iiwa() -> list[Link]:
    """Seven joints, 0.1575 .. 0.081 m between them."""
    half = pi / 2
    rows = [
        ((0, 0, 0.1575), (0, 0, 0), 4.0, (0, -0.03, 0.12), (0.1, 0.09, 0.02)),
        ((0, 0, 0.2025), (half, 0, pi), 4.0, (0.0003, 0.059, 0.042), (0.05, 0.018, 0.044)),
        ((0, 0.2045, 0), (half, 0, pi), 3.0, (0, 0.03, 0.13), (0.08, 0.075, 0.01)),
        ((0, 0, 0.2155), (half, 0, 0), 2.7, (0, 0.067, 0.034), (0.03, 0.01, 0.029)),
        ((0, 0.1845, 0), (-half, pi, 0), 1.7, (0.0001, 0.021, 0.076), (0.02, 0.018, 0.005)),
        ((0, 0, 0.2155), (half, 0, 0), 1.8, (0, 0.0006, 0.0004), (0.005, 0.0036, 0.0047)),
        ((0, 0.081, 0), (-half, pi, 0), 0.3, (0, 0, 0.02), (0.001, 0.001, 0.001)),
    ]
    return [
        Link(
            f"l{k + 1}",
            f"l{k}" if k else "world",
            "z",
            xyz,
            mass,
            com,
            (inertia[0], 0.0, 0.0, inertia[1], 0.0, inertia[2]),
            rpy,
        )
        for k, (xyz, rpy, mass, com, inertia) in enumerate(rows)
    ]


def panda_like() -> list[Link]:
    """Seven joints with offsets at elbow and wrist."""
    half = pi / 2
    rows = [
        ((0, 0, 0.333), (0, 0, 0), 4.97),
        ((0, 0, 0), (-half, 0, 0), 0.65),
        ((0, -0.316, 0), (half, 0, 0), 3.23),
        ((0.0825, 0, 0), (half, 0, 0), 3.59),
        ((-0.0825, 0.384, 0), (-half, 0, 0), 1.23),
        ((0, 0, 0), (half, 0, 0), 1.67),
        ((0.088, 0, 0), (half, 0, 0), 0.74),
    ]
    seeded = _bodies(7)
    return [
        Link(f"l{k + 1}", f"l{k}" if k else "world", "z", xyz, *next(seeded)(mass, 0.15), rpy)
        for k, (xyz, rpy, mass) in enumerate(rows)
    ]


def quadruped() -> list[Link]:
    """Free base, four legs of three joints."""
    seeded = _bodies(12)
    links = [Link("base", "world", "free", (0, 0, 0), *next(seeded)(6.9, 0.3))]
    for leg, x, y in (("fl", 1, 1), ("fr", 1, -1), ("rl", -1, 1), ("rr", -1, -1)):
        rows = [
            ("hip", "x", (0.1934 * x, 0.0465 * y, 0), 0.68, 0.08),
            ("thigh", "y", (0, 0.0955 * y, 0), 1.15, 0.2),
            ("calf", "y", (0, 0, -0.213), 0.24, 0.2),
        ]
        links += _limb(leg, "base", rows, seeded)
    return links


def humanoid() -> list[Link]:
    """Free base, 32 joints."""
    seeded = _bodies(32)
    links = [Link("base", "world", "free", (0, 0, 0), *next(seeded)(15.0, 0.3))]
    torso = [("1", "z", (0, 0, 0.07), 4.5, 0.2), ("2", "y", (0, 0, 0), 17.0, 0.4)]
    links += _limb("torso", "base", torso, seeded)
    head = [("1", "y", (0.02, 0, 0.32), 0.7, 0.1), ("2", "z", (0, 0, 0.03), 1.4, 0.15)]
    links += _limb("head", "torso_2", head, seeded)
    for side, y in (("left", 1), ("right", -1)):
        leg = [
            ("1", "z", (-0.02, 0.085 * y, -0.27), 1.8, 0.15),
            ("2", "x", (0, 0, 0), 1.4, 0.15),
            ("3", "y", (0, 0, 0), 6.2, 0.38),
            ("4", "y", (0, 0, -0.38), 3.8, 0.33),
            ("5", "y", (0, 0, -0.325), 1.3, 0.12),
            ("6", "x", (0, 0, 0), 1.6, 0.2),
        ]
        links += _limb(f"{side}_leg", "base", leg, seeded)
        arm = [
            ("1", "z", (0, 0.1575 * y, 0.232), 2.7, 0.18),
            ("2", "x", (0.005, 0.1365 * y, 0.047), 2.4, 0.15),
            ("3", "z", (0, 0, 0), 2.2, 0.2),
            ("4", "y", (0.02, 0, -0.273), 0.9, 0.12),
            ("5", "z", (-0.02, 0, -0.2643), 1.9, 0.15),
            ("6", "x", (0, 0, 0), 0.4, 0.06),
            ("7", "y", (0, 0, 0), 0.6, 0.08),
            ("gripper", "x", (0, 0, -0.12), 0.3, 0.08),
        ]
        links += _limb(f"{side}_arm", "torso_2", arm, seeded)
    return links


def chain(size: int) -> list[Link]:
    """Joints about x, y, z in turn, 5 to 15 cm apart."""
    rng, seeded = np.random.default_rng(size), _bodies(size)
    return [
        Link(
            f"l{k + 1}",
            f"l{k}" if k else "world",
            "zyx"[k % 3],
            (float(rng.uniform(-0.03, 0.03)), 0.0, float(rng.uniform(0.05, 0.15))),
            *next(seeded)(0.5, 0.1),
        )
        for k in range(size)
    ]


def _limb(name, parent, rows, seeded) -> list[Link]:  # type: ignore[no-untyped-def]
    links = []
    for part, axis, xyz, mass, size in rows:
        links.append(Link(f"{name}_{part}", parent, axis, xyz, *next(seeded)(mass, size)))
        parent = f"{name}_{part}"
    return links


def _bodies(seed: int) -> Iterator[Callable[[float, float], tuple[float, tuple, tuple]]]:
    """Bodies, each a function of mass and length: a cuboid in a seeded direction and place."""
    rng = np.random.default_rng(seed)

    def body(mass: float, length: float) -> tuple[float, tuple[float, ...], tuple[float, ...]]:
        sides = np.array([0.4, 0.5, 1.0]) * length * rng.uniform(0.8, 1.2, 3)
        R, _ = np.linalg.qr(np.eye(3) + 0.3 * rng.standard_normal((3, 3)))
        moments = mass / 12 * (sides @ sides - sides**2)
        J = R @ np.diag(moments) @ R.T
        com = tuple(float(x) for x in rng.uniform(-0.2, 0.2, 3) * length)
        upper = tuple(float(J[a, b]) for a in range(3) for b in range(a, 3))
        return mass, com, upper

    while True:
        yield body


LINKS: dict[str, Callable[[], list[Link]]] = {
    "iiwa": iiwa,
    "panda_like": panda_like,
    "quadruped": quadruped,
    "humanoid": humanoid,
    "chain10": lambda: chain(10),
    "chain30": lambda: chain(30),
    "chain100": lambda: chain(100),
}


def frictionless(name: str, folder: Path) -> System:
    """A robot by its name, without friction, which pinocchio's algorithms do not have.

    Args:
        name: of the catalogue, a key of `LINKS`, or "chain" and a number.
        folder: for its URDF.
    """
    if name in CATALOGUE:
        system = mbs.load(name).assemble()
    else:
        file = folder / f"{name}.urdf"
        links = LINKS[name]() if name in LINKS else chain(int(name.removeprefix("chain")))
        file.write_text(urdf(name, links), encoding="utf-8")
        system = mbs.load(file).assemble()
    none = casadi.SX(0)
    free = tuple(replace(link, Fv=none, Fs=none) for link in system.tree.links)
    return replace(system, tree=replace(system.tree, links=free), _cache={})
