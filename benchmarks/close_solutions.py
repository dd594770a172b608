"""Completeness of the general inverse geometric model at poses with close solutions.

Random arms of six joints are brought to configurations beside singular ones, whose poses have two
close solutions. The list of each pose is compared with an independent search (Newton's method from
random configurations) and with the lists of poses that differ by rounding.

    python benchmarks/close_solutions.py --arms 1000 --poses 10 --seed 1
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import mbs
from mbs.closed_forms.arm import Arm
from mbs.models.inverse_geometry import chain as chains

Array = NDArray[np.float64]

GAPS = 1e-4, 1e-1
"""Distances of a configuration from a singular one [rad or arm lengths]: pairs of solutions are
twice as far apart."""
REGULAR = 1e-5
"""Smallest singular value of the Jacobian of solutions that are compared: a tenth of the smallest
gap. Lists of poses nearer to a singular one have a rule of their own."""
SAME = 1e-7
"""Largest difference of two lists of the same solutions: rounding of 1e-15 by singular values."""


@dataclass(frozen=True)
class Case:
    """An arm and a pose with two close solutions at least.

    Attributes:
        system: the arm.
        arm: its numbers.
        q: (6,) a configuration of the pose.
        T: (4, 4) the pose.
    """

    system: mbs.System
    arm: Arm
    q: Array
    T: Array


def random_arm(rng: np.random.Generator) -> mbs.System:
    """An arm of six joints, one or two of them prismatic in a third of the cases."""
    prismatic = set(rng.choice(6, rng.choice([0, 0, 0, 0, 1, 2]), replace=False).tolist())
    frames = []
    for j in range(6):
        alpha, d, theta, r = rng.uniform(-1, 1), *rng.uniform(-0.6, 0.6, 3)
        zero = rng.uniform(size=3) < 0.3
        values = dict(zip(("d", "theta", "r"), np.where(zero, 0, [d, theta, r]), strict=True))
        kind = "prismatic" if j in prismatic else "revolute"
        frames.append({"antecedent": j, "joint": kind, "alpha": alpha if j else 0.0, **values})
        frames[-1] = {k: float(v) if k in "dralphatheta" else v for k, v in frames[-1].items()}
    return mbs.load({"name": "arm", "frame": frames}).assemble()


def beside_singular(rng: np.random.Generator, arm: Arm) -> Array | None:
    """(6,) a configuration beside a singular one; None if none is found."""

    def det(q: Array) -> float:
        return float(np.linalg.det(arm.pose_and_jacobian(q)[1]))

    a, b = rng.uniform(-np.pi, np.pi, (2, 6)) * np.where(arm.prismatic, 0.3, 1.0)
    points = [a + t * (b - a) for t in np.linspace(0, 1, 40)]
    values = [det(q) for q in points]
    for k in range(39):
        if values[k] * values[k + 1] < 0:
            low, high = points[k], points[k + 1]
            for _ in range(60):
                middle = (low + high) / 2
                low, high = (middle, high) if det(middle) * values[k] > 0 else (low, middle)
            null = np.linalg.svd(arm.pose_and_jacobian(low)[1])[2][-1]
            size = 10 ** rng.uniform(*np.log10(GAPS))
            return low + size * null
    return None


def searched(rng: np.random.Generator, case: Case, starts: int) -> list[Array]:
    """Solutions that Newton's method reaches from random configurations."""
    found = list[Array]()
    for k in range(starts):
        q = case.q.copy() if k == 0 else rng.uniform(-np.pi, np.pi, 6)
        if 0 < k < starts // 4:
            q = case.q + 10 ** rng.uniform(-4, 0) * rng.standard_normal(6)
        for _ in range(40):
            T, J = case.arm.pose_and_jacobian(q)
            step, *_ = np.linalg.lstsq(J, twist(case.T, T), rcond=1e-12)
            q = q + step * min(1.0, 1.0 / max(np.abs(step).max(), 1e-300))
            if np.abs(step).max() < 1e-13:
                break
        if case.arm.residual(q, case.T) < 1e-12 and not any(same(case.arm, q, x) for x in found):
            found.append(q)
    return found


def twist(target: Array, T: Array) -> Array:
    """(6,) displacement and rotation from a pose to another one."""
    R = target[:3, :3] @ T[:3, :3].T
    axis = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / 2
    s = np.linalg.norm(axis)
    angle = np.arctan2(s, (np.trace(R) - 1) / 2)
    return np.concatenate([target[:3, 3] - T[:3, 3], axis * (angle / s if s > 1e-9 else 1.0)])


def same(arm: Arm, q: Array, other: Array) -> bool:
    """Whether two configurations are one solution."""
    return bool(np.abs(arm.wrapped(q - other)).max() < SAME)


def regular(arm: Arm, rows: list[Array]) -> list[Array]:
    """The configurations whose Jacobians are regular."""
    smallest = [np.linalg.svd(arm.pose_and_jacobian(q)[1], compute_uv=False)[-1] for q in rows]
    return [q for q, s in zip(rows, smallest, strict=True) if s > REGULAR]


def missing(arm: Arm, rows: list[Array], listed: list[Array]) -> list[Array]:
    """The configurations that a list lacks."""
    return [q for q in rows if not any(same(arm, q, x) for x in listed)]


def examine(case: Case, rng: np.random.Generator, starts: int) -> tuple[int, int, int]:
    """Number of regular solutions, of those that the list lacks, and of lists that differ."""
    listed = list(mbs.models.inverse_geometry.solve(case.system, case.T).q)
    found = regular(case.arm, searched(rng, case, starts))
    lost = missing(case.arm, found, listed)
    changed = 0
    for _ in range(3):
        T = case.T.copy()
        T[:3] += 1e-14 * rng.uniform(-1, 1, (3, 4))
        other = list(mbs.models.inverse_geometry.solve(case.system, T).q)
        pairs = (missing(case.arm, regular(case.arm, listed), other),)
        changed += any(pairs) or bool(missing(case.arm, regular(case.arm, other), listed))
    return len(found), len(lost), changed


def cases(seed: int, arms: int, poses: int) -> list[tuple[int, Case]]:
    """Arms and poses, with numbers that repeat them."""
    made = []
    for number in range(arms):
        rng = np.random.default_rng([seed, number])
        system = random_arm(rng)
        arm = chains.frame_chain(system).arm(np.zeros(0))
        for _ in range(poses):
            q = beside_singular(rng, arm)
            if q is not None:
                made.append((number, Case(system, arm, q, arm.pose(q))))
    return made


def main() -> None:
    """Examine the poses, and print what the lists lack."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--arms", type=int, default=20)
    parser.add_argument("--poses", type=int, default=10)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--starts", type=int, default=60)
    options = parser.parse_args()
    total = np.zeros(3, dtype=int)
    examined = cases(options.seed, options.arms, options.poses)
    for k, (number, case) in enumerate(examined):
        rng = np.random.default_rng([options.seed, number, k])
        found = examine(case, rng, options.starts)
        total += found
        if found[1] or found[2]:
            print(
                f"arm {number}: {found[1]} of {found[0]} missing, {found[2]} lists differ", case.q
            )
    print(
        f"{len(examined)} poses: {total[0]} solutions, {total[1]} missing, {total[2]} lists differ"
    )


if __name__ == "__main__":
    main()
