"""All complex configurations of a six-joint arm at a pose, certified: a proof of completeness.

The elimination of `raghavan_roth` gives the complex angles of one joint as eigenvalues. The other
joints follow from null vectors, and Newton's method refines them. The number of configurations is
the same for almost all poses, sixteen at most, and no pose has more isolated configurations. If
this number is certified, no configuration is missing.

Source: Raghavan & Roth 1993; Primrose 1986 for sixteen; Ortega & Rheinboldt 1970, section 12.6, for
the theorem of Newton and Kantorovich; Sommese & Wampler 2005, chapter 7, for the count.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mbs.closed_forms.arm import Arm, Array, inverse, motion
from mbs.closed_forms.arm_search import General, general, random_configurations
from mbs.closed_forms.displacement_matrices import (
    KEPT_BY_SLIDE,
    KEPT_BY_TURN,
    frame_products,
    motion_parts,
    rho,
)
from mbs.closed_forms.raghavan_roth.numbers import (
    Arrangement,
    Prepared,
    at,
    complex_roots,
    for_poses,
    loop_length,
    middle_joints,
)
from mbs.closed_forms.roots import Roots
from mbs.solvers.homotopy import solved

Complex = NDArray[np.complex128]

# Candidates for configurations: from eigenvalues, with complex cosines and sines.


_FAR_ANGLE = 12.0
"""Imaginary part [rad] above which an angle counts as infinite: angles of random loops stay below
11, and the fourfold eigenvalues at infinity have 28 or more."""
_SHARED = 1e-7
"""Relative singular value that counts as zero at an eigenvalue: a simple eigenvalue leaves 1e-12,
an eigenvalue at a fold the root of 1e-15."""
_FLAT = 1e-6
"""Ratio of singular values below which joint 2 has two angles, because its axis and that of joint 1
intersect or are parallel: this is structural and leaves 1e-14."""


def complex_candidates(prepared: Prepared, T: Array) -> Complex:
    """Return complex configurations (m, 6) near which an arm may reach a pose [rad or m].

    They are approximate; `certified_roots` refines them.

    Args:
        prepared: arm prepared for the general method.
        T: (4, 4) target pose [m].
    """
    prepared = for_poses(prepared, T[None])[0][0]
    loop = prepared.arrangement
    transforms = loop.transforms_for(T[None])
    M = prepared.pencil.matrices(transforms)
    u = complex_roots(M)[0]
    u = u[np.abs(u.imag) < _FAR_ANGLE]
    matrices = at(np.repeat(M, len(u), axis=0), u)
    values = np.linalg.svd(matrices, compute_uv=False)
    shared = np.maximum(np.sum(values < _SHARED * values[:, :1], axis=1), 1)
    every = [np.zeros((0, 6), dtype=np.complex128)]
    with np.errstate(all="ignore"):  # angles without a configuration may be infinite
        for count in np.unique(shared):
            own = shared == count
            x4, x5 = middle_joints(matrices[own], prepared.pencil.elimination.grid, int(count))
            x3 = np.repeat(np.tan(u[own] / 2), count)
            x = np.column_stack([x3, x4.ravel(), x5.ravel()])
            middle = np.where(loop.prismatic[2:5], x, 2 * np.arctan(x.astype(complex)))
            every.append(
                _completed(transforms[0], loop, middle[np.all(np.isfinite(middle), axis=1)])
            )
    whole = np.concatenate(every)
    return whole[np.all(np.isfinite(whole), axis=1)]


def _completed(transforms: Array, loop: Arrangement, middle: Complex) -> Complex:
    """Return arm configurations (m, 6) for positions (n, 3) of joints 3, 4 and 5 of its loop.

    `transforms` (6, 4, 4) are the constant transforms of the loop.

    `loop` is the loop of the arm, `middle` are the positions (n, 3).
    """
    beyond, goal = (
        np.tile(transforms[1].astype(np.complex128), (len(middle), 1, 1)),
        inverse(transforms[5]),
    )
    for k in (2, 3, 4):
        beyond = beyond @ motion(middle[:, k - 2], bool(loop.prismatic[k])) @ transforms[k]
    number, second = _second_positions(transforms[0], loop.prismatic, beyond, goal)
    near = transforms[0] @ motion(second, bool(loop.prismatic[1])) @ beyond[number]
    first = _first_positions(bool(loop.prismatic[0]), near, goal)
    left = inverse(motion(first, bool(loop.prismatic[0])) @ near) @ goal
    sixth = _angle(left[:, 0, 0] + left[:, 1, 1], left[:, 1, 0] - left[:, 0, 1])
    whole = np.column_stack([first, second, middle[number], sixth])
    whole = loop.sign * (whole + loop.offsets)
    q = np.empty(whole.shape, dtype=np.complex128)
    q[:, loop.order] = np.where(loop.prismatic, whole * loop.length, whole)
    return q


def _angle(c: Complex, s: Complex) -> Complex:
    """Return the complex angle whose cosine and sine are c and s times one common factor."""
    q: Complex = -0.5j * np.log((c + 1j * s) / (c - 1j * s))
    # half the logarithm of a square is unique up to pi: the sign of the cosine decides
    size = np.where(np.abs(np.cos(q)) > np.abs(np.sin(q)), c / np.cos(q), s / np.sin(q))
    return np.where(np.real(size) < 0, q + np.pi, q)


def _first_positions(prismatic: bool, near: Complex, goal: Array) -> Complex:
    """Return positions (n,) of joint 1 that move origin and z axis of poses `near` to `goal`.

    `near` are poses (n, 4, 4), `goal` is the target pose; `prismatic` is the type of joint 1.
    """
    if prismatic:
        slide: Complex = goal[2, 3] - near[:, 2, 3]
        return slide
    x, y = near[:, 0, 2:], near[:, 1, 2:]
    X, Y = goal[0, 2:], goal[1, 2:]
    # X = c x - s y and Y = s x + c y, of a point and of a direction
    square = np.sum(x * x + y * y, axis=1)
    return _angle(np.sum(x * X + y * Y, axis=1) / square, np.sum(x * Y - y * X, axis=1) / square)


def _second_positions(
    way: Array, prismatic: NDArray[np.bool_], beyond: Complex, goal: Array
) -> tuple[NDArray[np.int64], Complex]:
    """Return row indices and positions of joint 2, for poses `beyond` (n, 4, 4) that it moves.

    `way` is the transform from joint 1 to joint 2, `goal` the target pose. A row has two positions
    if only one equation exists.
    """
    kept = KEPT_BY_SLIDE if prismatic[0] else KEPT_BY_TURN
    moved = np.einsum("iab,nb->nai", motion_parts(bool(prismatic[1])), frame_products(beyond))
    A = (rho(way) @ moved)[:, kept]
    A = np.where(np.all(np.isfinite(A), axis=(1, 2), keepdims=True), A, 0.0)
    U, s, Vh = np.linalg.svd(A[:, :, 1:], full_matrices=False)
    g = np.einsum("nai,na->ni", U.conj(), frame_products(goal)[kept] - A[:, :, 0])
    used = s > _FLAT * s[:, :1]
    flat = np.flatnonzero(~used[:, 1])
    g = np.where(used, g / np.where(used, s, 1.0), 0.0)
    f = np.einsum("nij,ni->nj", Vh.conj(), g)
    single = f[:, 0] if prismatic[1] else _angle(f[:, 0], f[:, 1])
    single[flat], other = _crossings(bool(prismatic[1]), Vh[flat, 0], g[flat, 0])
    return np.concatenate([np.arange(len(single)), flat]), np.concatenate([single, other])


def _crossings(prismatic: bool, n: Complex, g: Complex) -> tuple[Complex, Complex]:
    """Return both roots q of n0 cos q + n1 sin q = g, or of n0 q + n1 q^2 = g if prismatic.

    n (m, 2) are the factors and g (m,) the right sides.
    """
    if not prismatic:
        # (n0 - i n1) z^2 - 2 g z + n0 + i n1 = 0 with z = e^(i q)
        root, below = np.sqrt(g**2 - n[:, 0] ** 2 - n[:, 1] ** 2), n[:, 0] - 1j * n[:, 1]
        return -1j * np.log((g + root) / below), -1j * np.log((g - root) / below)
    root = np.sqrt(n[:, 0] ** 2 + 4 * n[:, 1] * g)
    root = np.where(np.real(n[:, 0].conj() * root) < 0, -root, root)
    larger = -0.5 * (n[:, 0] + root)
    low = -g / larger
    # a smaller n1 is rounding, and the second root is infinite
    return low, np.where(np.abs(n[:, 1]) > _FLAT * np.abs(n[:, 0]), larger / n[:, 1], low)


# Certificate: candidates with exactly one root near them.


_NEWTON = 4
"""Number of Newton steps: candidates are accurate to 1e-6, from where two or three steps suffice,
or they are no configurations."""
_CERTAIN = 0.03
"""Largest product of Newton's step, the norm of the inverse and the second derivative: below one
half one root is near; the margin is for rounding."""
_NEAR = 0.1
"""Largest |X - 1| and largest change of X: the bound of the second derivative is then below two,
and a rotation whose skew part vanishes is the identity."""
_ROUNDING = 1e-14
"""Rounding of a pose, in lengths of the loop: lower limit of Newton's step."""


@dataclass(frozen=True, slots=True, eq=False)
class CertifiedRoots:
    """Complex configurations of an arm, each with exactly one root near it.

    Attributes:
        q: (r, 6) configurations [rad or lengths of the loop].
        radius: (r,) error bound of each position of the root.
    """

    q: Complex
    radius: Array

    @property
    def real(self) -> NDArray[np.bool_]:
        """Whether each root is real (r,): the conjugate root would lie within the same radius."""
        real: NDArray[np.bool_] = np.max(np.abs(self.q.imag), axis=1, initial=0.0) <= self.radius
        return real


def certified_roots(arm: Arm, T: Array, candidates: Complex) -> CertifiedRoots:
    """Return the roots of the pose equations that are certified to lie near candidates, each once.

    For a change d of a configuration, X = e^(S4 d4) e^(S5 d5) e^(S6 d6) X0 e^(S1 d1) e^(S2 d2)
    e^(S3 d3), where S are the joint twists relative to the middle of the arm. The second derivative
    of X is then at most |S_j| |S_k| e^(sum |S d|) |X0|. The equations are the position of X and the
    skew part of its rotation, which vanish near the identity only at a solution.

    Args:
        arm: arm of six joints.
        T: (4, 4) target pose [m].
        candidates: (m, 6) complex configurations [rad or m].
    """
    length = loop_length(arm)
    inner, target = _without_base_and_tool(arm, T, length)
    q = np.where(arm.prismatic, candidates / length, candidates)
    with np.errstate(all="ignore"):
        for _ in range(_NEWTON):
            rows, J, *_ = _pose_equations(inner, target, q)
            finite = np.all(np.isfinite(J), axis=(1, 2)) & np.all(np.isfinite(rows), axis=1)
            q, rows, J = q[finite], rows[finite], J[finite]
            q = q - solved(J, rows[..., None])[..., 0]
        # rounding may have spoilt one of two conjugate roots
        q = np.concatenate([q, q.conj()])
        rows, J, norms, gap = _pose_equations(inner, target, q)
        W = solved(J, np.broadcast_to(np.eye(6, dtype=np.complex128), J.shape))
        gain = np.sum(norms * np.linalg.norm(W, axis=2), axis=1)
        step = np.sum(norms * np.abs(np.einsum("mij,mj->mi", W, rows)), axis=1)
        # Newton's step, in the norm in which the second derivative is below e^(sum |S d|) |X0|
        radius = 2 * (step + gain * _ROUNDING * np.max(norms, axis=1, initial=0.0))
        certain = (gain * radius < _CERTAIN) & (radius < _NEAR) & (gap < _NEAR)
    q, radius = q[certain], radius[certain]
    kept = list[int]()
    for k in np.argsort(radius, kind="stable"):
        apart = q[k] - q[kept]
        turns = np.where(arm.prismatic, 0.0, np.round(apart.real / (2 * np.pi)) * 2 * np.pi)
        if np.all(np.max(np.abs(apart - turns), axis=1, initial=0.0) > radius[k] + radius[kept]):
            kept.append(int(k))
    return CertifiedRoots(q[kept], radius[kept])


def _without_base_and_tool(arm: Arm, T: Array, length: float) -> tuple[Arm, Array]:
    """Return the arm from its first to its last joint, and its target, in units of `length`.

    T (4, 4) is the target pose of the whole arm [m].
    """
    first, last = inverse(arm.gaps[0]), inverse(arm.gaps[-1])
    gaps, target = arm.gaps.copy(), first @ T @ last
    gaps[0], gaps[-1] = np.eye(4), np.eye(4)
    gaps[:, :3, 3] /= length
    target[:3, 3] /= length
    return Arm(arm.names, arm.prismatic, gaps), target


def _pose_equations(arm: Arm, target: Array, q: Complex) -> tuple[Complex, Complex, Array, Array]:
    """Return equations (m, 6), derivatives (m, 6, 6), norms of twists (m, 6), and |X - 1| (m,).

    X is the pose error at q (m, 6). The reference is the middle of the arm, where complex angles
    increase the twists least.
    """
    moved = [motion(q[:, k], bool(prismatic)) for k, prismatic in enumerate(arm.prismatic)]
    half = moved[0] @ arm.gaps[1] @ moved[1] @ arm.gaps[2] @ moved[2] @ arm.gaps[3]
    before = inverse(half)
    frames = [before, before @ moved[0] @ arm.gaps[1]]
    frames.append(frames[1] @ moved[1] @ arm.gaps[2])
    frames.append(np.broadcast_to(np.eye(4), half.shape))
    for k in (3, 4, 5):
        frames.append(frames[k] @ moved[k] @ arm.gaps[k + 1])
    X = frames[6] @ inverse(target) @ half
    twists = np.zeros((6, len(q), 4, 4), dtype=np.complex128)
    for k, frame in enumerate(frames[:6]):
        axis, origin = frame[..., :3, 2], frame[..., :3, 3]
        if arm.prismatic[k]:
            twists[k, :, :3, 3] = axis
        else:
            twists[k, :, :3, :3] = _skew(axis)
            twists[k, :, :3, 3] = np.cross(origin, axis)
    slopes = np.concatenate([X @ twists[:3], twists[3:] @ X])
    norms = np.linalg.norm(twists, axis=(2, 3)).T
    gap = np.linalg.norm(X - np.eye(4), axis=(1, 2))
    return _position_and_skew(X), np.moveaxis(_position_and_skew(slopes), 0, -1), norms, gap


def _skew(axis: Complex) -> Complex:
    """Return the matrices (..., 3, 3) of the cross product with axes (..., 3)."""
    x, y, z = np.moveaxis(axis, -1, 0)
    o = np.zeros_like(x)
    return np.moveaxis(np.array([[o, -z, y], [z, o, -x], [-y, x, o]]), (0, 1), (-2, -1))


def _position_and_skew(X: Complex) -> Complex:
    """Return positions and skew parts of rotations (..., 6) of matrices X (..., 4, 4)."""
    R = X[..., :3, :3]
    turned = [R[..., 2, 1] - R[..., 1, 2], R[..., 0, 2] - R[..., 2, 0], R[..., 1, 0] - R[..., 0, 1]]
    return np.concatenate([X[..., :3, 3], 0.5 * np.stack(turned, axis=-1)], axis=-1)


# All real configurations, with the proof of completeness.


_POSES, _SEED = 4, 20260411
"""Number of random poses, of which the largest root count is taken, because a root may be too far
away to be certified; and seed of the random numbers."""


@dataclass(frozen=True, slots=True, eq=False)
class CertifiedArm:
    """Arm prepared for the general method, with its number of complex configurations.

    Attributes:
        general: prepared arm.
        count: number of complex configurations at almost all poses.
    """

    general: General
    count: int


def certified_arm(arm: General) -> CertifiedArm:
    """Return a prepared arm with its number of complex configurations.

    It is the largest number of certified roots at some random poses.

    Args:
        arm: arm prepared for the general method.
    """
    q = random_configurations(arm.arm, np.eye(4), _POSES, _SEED)
    return CertifiedArm(
        arm,
        max(
            len(certified_roots(arm.arm, T, complex_candidates(arm.prepared, T)).q)
            for T in arm.arm.pose(q)
        ),
    )


def certified_configurations(arm: CertifiedArm, T: Array) -> Roots:
    """Return the real configurations that reach a pose, with a certificate of completeness.

    Args:
        arm: prepared arm with its number of complex configurations.
        T: (4, 4) target pose [m].
    """
    own, found = arm.general.arm, general(arm.general, T)
    candidates = np.concatenate([complex_candidates(arm.general.prepared, T), found])
    roots = certified_roots(own, T, candidates)
    real = np.where(own.prismatic, roots.q.real * loop_length(own), roots.q.real)[roots.real]
    q, alone = list(found), len(found)
    for root in real:
        gaps = [np.max(np.abs(own.wrapped(root - other)), initial=0.0) for other in found]
        if min(gaps, default=np.inf) < _SAME:
            alone -= 1
        else:
            q.append(own.wrapped(root))
    # uncertified configurations are double roots, which count twice
    certain = len(roots.q)
    # an arm without certified roots at general poses (count 0) has no certificate
    complete = certain + 2 * alone == arm.count > 0
    meet = f", and {2 * alone} where configurations meet" if alone and complete else ""
    proof = f"the general inverse geometric model, certified: {certain} of {arm.count} roots{meet}"
    return Roots(np.array(q).reshape(-1, 6), proof, complete)


_SAME = 1e-6
"""Largest difference [rad or m] between a certified root and the same configuration from
elimination: both are accurate to 1e-9, except close to double roots."""
