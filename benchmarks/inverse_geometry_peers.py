"""Other inverse geometric solvers behind one call: all configurations of an arm for a pose.

An adapter is made of an arm in plain numbers (`support.arm_search.PlainArm`) and raises `Refused`
where the solver does not take such an arm. Its answer is compared with the forward model by
whoever asks; nothing is left out of it here.
"""

from __future__ import annotations

import importlib
import importlib.metadata
import itertools
from collections.abc import Callable
from typing import Any, Protocol

import numpy as np
from support.arm_search import PlainArm

Array = np.ndarray[Any, Any]
_PREBUILT = {
    "puma560": "unimation.puma560_ik",
    "kr6": "kuka.kr6_r900_ik",
    "irb120": "abb.irb120_ik",
    "ur5": "universal_robots.ur5_ik",
    "crx10": "fanuc.crx10ia_ik",
}
"""Robots for which ssik ships machine code, in frames of its own."""


class Refused(Exception):
    """The solver does not take this arm, and why."""


class Peer(Protocol):
    """A solver made for one arm."""

    def solve(self, T: Array) -> tuple[Array, Array]:
        """(m, n) configurations for a pose (4, 4), and (m,) which are not marked as approximate."""

    def many(self, T: Array) -> Callable[[], Any]:
        """What to time: all poses (N, 4, 4), in the form in which the solver likes them."""


class Eaik:
    """EAIK: subproblems in C++; some rows it marks as least squares, right and wrong ones."""

    def __init__(self, arm: PlainArm) -> None:
        from eaik.IK_Homogeneous import HomogeneousRobot

        if np.any(arm.slides):
            raise Refused("prismatic joints")
        self._size = len(arm.slides)
        self._robot = HomogeneousRobot(_at_zero(arm))
        if "Unknown" in self._robot.getKinematicFamily():
            raise Refused("unknown class")

    def solve(self, T: Array) -> tuple[Array, Array]:
        """See Peer."""
        answer = self._robot.IK(T)
        q = np.array(answer.Q).reshape(-1, self._size)
        return q, ~np.array(answer.is_LS, dtype=bool).ravel()[: len(q)]

    def many(self, T: Array) -> Callable[[], Any]:
        """See Peer."""
        poses = list(T)
        return lambda: self._robot.IK_batched(poses, 1)


class EaikOneByOne(Eaik):
    """EAIK, called once for each pose."""

    def many(self, T: Array) -> Callable[[], Any]:
        """See Peer."""
        poses, solve = list(T), self._robot.IK
        return lambda: [solve(pose) for pose in poses]


class Ikdh:
    """ikdh: Husty and Pfurner's method in C++, on standard Denavit-Hartenberg parameters."""

    def __init__(self, arm: PlainArm) -> None:
        import ikdh

        if np.any(arm.slides) or len(arm.slides) != 6:
            raise Refused("six revolute joints only")
        table, self._before, self._behind = _standard(arm)
        self._solver = ikdh.Solver(ikdh.DHTable(*(list(column) for column in table.T)))

    def solve(self, T: Array) -> tuple[Array, Array]:
        """See Peer."""
        wanted = self._before @ T @ self._behind
        q = np.radians(np.array(self._solver.solve(wanted))).reshape(-1, 6)
        return q, np.ones(len(q), dtype=bool)

    def many(self, T: Array) -> Callable[[], Any]:
        """See Peer."""
        poses, solve = list(self._before @ T @ self._behind), self._solver.solve
        return lambda: [solve(pose) for pose in poses]


class Ssik:
    """ssik on an arm described to it; for a general arm its preparation takes a minute."""

    def __init__(self, arm: PlainArm) -> None:
        import ssik

        if np.any(arm.slides) or len(arm.slides) != 6:
            raise Refused("six revolute joints here")
        self._arm = ssik.Manipulator.from_transforms(arm.gaps)
        if self._arm.solver_name == "ikgeo.general_6r":
            raise Refused("preparation too long")

    def solve(self, T: Array) -> tuple[Array, Array]:
        """See Peer."""
        q = np.array([s.q for s in self._answer(T)]).reshape(-1, 6)
        return q, np.ones(len(q), dtype=bool)

    def many(self, T: Array) -> Callable[[], Any]:
        """See Peer."""
        poses = list(T)
        return lambda: [self._answer(pose) for pose in poses]

    def _answer(self, T: Array) -> Any:
        return self._arm.solve(T, respect_limits=False, enumerate_windings=False)


class SsikPrebuilt:
    """The machine code that ssik ships for some robots; poses are those of its own description."""

    def __init__(self, robot: str) -> None:
        if robot not in _PREBUILT:
            raise Refused("not shipped")
        self._code = importlib.import_module(f"ssik.prebuilt.{_PREBUILT[robot]}")
        self._configurations = np.random.default_rng(0).uniform(-np.pi, np.pi, (64, 6))

    def worst(self) -> float:
        """The largest element of its own pose of its answers less the wanted pose."""
        gaps = [
            np.max(np.abs(self._code.fk(s.q) - T)) for T in self._poses(8) for s in self._answer(T)
        ]
        return float(max(gaps))

    def many(self, T: Array) -> Callable[[], Any]:
        """As many poses, reached by its own forward model."""
        poses = self._poses(len(T))
        return lambda: [self._answer(pose) for pose in poses]

    def _poses(self, count: int) -> list[Array]:
        return [self._code.fk(q) for q in np.resize(self._configurations, (count, 6))]

    def _answer(self, T: Array) -> Any:
        return self._code.solve(T, respect_limits=False, enumerate_windings=False)


PEERS: dict[str, Callable[[PlainArm], Peer]] = {"EAIK": Eaik, "ikdh": Ikdh, "ssik": Ssik}


def versions() -> dict[str, str]:
    """The version of each peer, "absent" where it is not installed."""
    found = {}
    for name in PEERS:
        try:
            found[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            found[name] = "absent"
    return found


def _at_zero(arm: PlainArm) -> Array:
    """(n + 1, 4, 4) frames of the joints and of the tool in the base, all joints at zero."""
    frames = [arm.gaps[0]]
    for gap in arm.gaps[1:]:
        frames.append(frames[-1] @ gap)
    return np.array(frames)


def _standard(arm: PlainArm) -> tuple[Array, Array, Array]:
    """Rows a, d, alpha, theta of Rz(theta + q) Tz(d) Tx(a) Rx(alpha), and what stands around.

    The pose is before^-1 times the product of the rows times behind^-1.
    """
    parts = [_common_perpendicular(gap) for gap in arm.gaps]
    before = _screw_z(parts[0][0], parts[0][1]) @ _screw_x(parts[0][2], parts[0][3])
    rows = []
    for first, second in itertools.pairwise(parts):
        rows.append([second[3], first[5] + second[1], second[2], first[4] + second[0]])
    behind = _screw_z(parts[-1][4], parts[-1][5])
    return np.array(rows), np.linalg.inv(before), np.linalg.inv(behind)


def _common_perpendicular(T: Array) -> tuple[float, float, float, float, float, float]:
    """gamma, b, alpha, d, theta, r of Rz(gamma) Tz(b) Rx(alpha) Tx(d) Rz(theta) Tz(r)."""
    R, p = T[:3, :3], T[:3, 3]
    sine = np.hypot(R[0, 2], R[1, 2])
    alpha = np.arctan2(sine, R[2, 2])
    gamma = np.arctan2(R[0, 2], -R[1, 2]) if sine > 1e-9 else np.arctan2(p[1], p[0])
    c, s = np.cos(gamma), np.sin(gamma)
    d, side = c * p[0] + s * p[1], c * p[1] - s * p[0]
    r = -side / sine if sine > 1e-9 else 0.0
    b = p[2] - r * np.cos(alpha)
    rest = (_screw_z(gamma, 0) @ _screw_x(alpha, 0))[:3, :3].T @ R
    return gamma, b, alpha, d, np.arctan2(rest[1, 0], rest[0, 0]), r


def _screw_z(angle: float, shift: float) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, shift], [0, 0, 0, 1]])


def _screw_x(angle: float, shift: float) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1, 0, 0, shift], [0, c, -s, 0], [0, s, c, 0], [0, 0, 0, 1]])
