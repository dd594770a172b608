"""All poses of a platform on six legs of known lengths, by certified homotopy.

The pose is a unit quaternion e and the product g = p e, where p is the position of the platform.
The length of a leg from a on the ground to b on the platform is then a quadratic form in (e, g).
The forty complex poses of a stored platform are followed while its legs change to the given leg
ends, with complex lengths. This is done once for each platform. From there the poses are followed
to any leg lengths.

Source: Wampler 1996 for the equations; Dietmaier 1998 for forty real poses.
"""

from __future__ import annotations

import functools
import json
from dataclasses import dataclass
from importlib import resources
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mbs.closed_forms.roots import Roots
from mbs.errors import LoopError
from mbs.solvers import homotopy
from mbs.solvers.homotopy import TOLERANCE, solved

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]

# Equations: quadratic forms of x = (e, g), which are zero if the legs have their lengths.


LEGS = 6
_SIZE = 8
_ROWS = LEGS + 1


def _left_products(a: Complex) -> Complex:
    """Return the matrices (..., 4, 4) of the quaternion products a q, for vectors a (..., 3)."""
    x, y, z = np.moveaxis(a, -1, 0)
    o = np.zeros_like(x)
    rows = np.array([[o, -x, -y, -z], [x, o, -z, y], [y, z, o, -x], [z, -y, x, o]])
    product: Complex = np.moveaxis(rows, (0, 1), (-2, -1))
    return product


def _right_products(b: Complex) -> Complex:
    """Return the matrices (..., 4, 4) of quaternion products q b for vectors b (..., 3)."""
    signs = np.array([-1.0, 1.0, 1.0, 1.0])
    product: Complex = signs[:, None] * signs * np.swapaxes(_left_products(b), -1, -2)
    return product


@dataclass(frozen=True, slots=True, eq=False)
class PlatformLegs:
    """Six legs, with real or complex values.

    Attributes:
        a: (6, 3) ends of the legs on the ground.
        b: (6, 3) ends on the platform, in its frame.
        c: (6,) a.a + b.b minus the square of the length.
    """

    a: Complex
    b: Complex
    c: Complex

    def forms(self) -> Complex:
        """Return the symmetric matrices Q (7, 8, 8) of the equations x' Q x = 0 of x = (e, g).

        The first six fix the leg lengths. The last one makes the scalar part of p zero.
        """
        Q = np.zeros((_ROWS, _SIZE, _SIZE), dtype=np.complex128)
        Q[:LEGS, 4:, 4:] = np.eye(4)
        N = _right_products(self.b) - _left_products(self.a)
        Q[:LEGS, 4:, :4], Q[:LEGS, :4, 4:] = N, np.swapaxes(N, 1, 2)
        Q[:LEGS, :4, :4] = 2 * _left_products(self.a) @ _right_products(self.b)
        Q[:LEGS, :4, :4] += self.c[:, None, None] * np.eye(4)
        Q[LEGS, 4:, :4] = Q[LEGS, :4, 4:] = np.eye(4)
        return Q


_SEED = 20260302


# Path tracking of all roots at once while the legs change.


@dataclass(frozen=True, slots=True, eq=False)
class Homotopy:
    """Path from one platform to another: Q(t) = Q0 + t Q1 + t^2 Q2, or Q0 plus t times constants.

    Attributes:
        Q: (3, 7, 8, 8) coefficients of t; (1, 7, 8, 8) if the ends of the legs are constant.
        c: (7,) changes of the constants of the rows, used if the ends are constant.
    """

    Q: Complex
    c: Complex

    @staticmethod
    def between(start: PlatformLegs, end: PlatformLegs) -> Homotopy:
        """Return the path along the straight line of a, b and c from `start` to `end`."""
        c = np.append(end.c - start.c, 0)
        first, last = start.forms(), end.forms()
        if np.array_equal(start.a, end.a) and np.array_equal(start.b, end.b):
            return Homotopy(first[None], c)
        middle = PlatformLegs((start.a + end.a) / 2, (start.b + end.b) / 2, (start.c + end.c) / 2)
        bend = 2 * (first + last) - 4 * middle.forms()
        return Homotopy(np.array([first, last - first - bend, bend]), c)

    def slopes(self, x: Complex, t: Real) -> tuple[Complex, Complex]:
        """Return the derivatives of the equations by x, (r, 7, 8), and by t, (r, 7).

        x (r, 8) are points and t (r,) path parameters from 0 to 1.
        """
        Y = (x @ self.Q.reshape(-1, _SIZE).T).reshape(len(x), len(self.Q), _ROWS, _SIZE)
        J, e = Y[:, 0], x[:, :4]
        if len(self.Q) == 1:
            J[:, :, :4] += np.einsum("r,k,ri->rki", t, self.c, e)
            return 2 * J, np.einsum("k,ri,ri->rk", self.c, e, e)
        s = t[:, None, None]
        rate = np.einsum("rij,rj->ri", Y[:, 1] + 2 * s * Y[:, 2], x)
        return 2 * (J + s * (Y[:, 1] + s * Y[:, 2])), rate


def _with_patch(J: Complex, patch: Complex) -> Complex:
    """Append the row `patch` (r, 8) to J (r, 7, 8); it keeps the length of x constant."""
    return np.concatenate([J, patch.conj()[:, None, :]], axis=1)


def _newton_step_and_tangent(
    path: Homotopy, x: Complex, t: Real, patch: Complex
) -> tuple[Complex, Complex]:
    """Return Newton's step and the tangent dx/dt of a homotopy path at x, t, both (r, 8).

    `patch` (r, 8) is normal to both.
    """
    J, rate = path.slopes(x, t)
    sides = np.zeros((len(x), _SIZE, 2), dtype=np.complex128)
    sides[:, :_ROWS, 0], sides[:, :_ROWS, 1] = np.einsum("rij,rj->ri", J, x) / 2, rate
    step = -solved(_with_patch(J, patch), sides)
    return step[..., 0], step[..., 1]


def follow(path: Homotopy, x: Complex, tolerance: float = TOLERANCE) -> tuple[Complex, Real]:
    """Track homotopy paths from their start at t = 0.

    Args:
        path: homotopy.
        x: (r, 8) roots at t = 0.
        tolerance: largest relative error of a step.

    Returns:
        (r, 8) ends of length one, and (r,) reached t; 1 on a path that was followed completely.
    """
    return homotopy.follow(
        functools.partial(_newton_step_and_tangent, path), x, _in_patch, tolerance
    )


def _in_patch(x: Complex, slope: Complex) -> tuple[Complex, Complex]:
    """Return roots x (r, 8) scaled to length one, and slopes (r, 8) that keep it to first order."""
    size = np.linalg.norm(x, axis=1, keepdims=True)
    x, slope = x / size, slope / size
    return x, slope - np.sum(x.conj() * slope, axis=1, keepdims=True) * x


# Certificate: path ends that are regular and different roots.


_CERTAIN = 0.03
"""Largest |J^-1 F| |J^-1 H / 2| of a certified root: below 0.157 Newton's method converges
quadratically to one root; the margin is for rounding and for the norm of matrices."""
_APART = 1e-6
"""Distance, relative to |x| = 1, above which two roots are different: certified different roots
differ by more than ten times the last Newton step, 1e-12."""
_FLAT = 1e-6
"""Length of e, relative to |x| = 1, below which a root is at infinity."""


@dataclass(frozen=True, slots=True, eq=False)
class PathEnds:
    """Ends of the paths.

    Attributes:
        x: (r, 8) roots of length one.
        regular: (r,) whether an end is certified to be near a regular root that no other end has.
    """

    x: Complex
    regular: NDArray[np.bool_]


def certify(legs: PlatformLegs, x: Complex, t: Real) -> PathEnds:
    """Return the ends of paths, refined by Newton's method, with certificates.

    Source: Blum, Cucker, Shub & Smale 1998, chapter 8; in floating point, with room for rounding.

    Args:
        legs: legs at the ends of the paths.
        x: (r, 8) ends of the paths, changed in place.
        t: (r,) reached path parameters; ends below 1 are not certified.
    """
    path = Homotopy.between(legs, legs)
    regular = t >= 1
    for _ in range(3):
        now = np.flatnonzero(regular)
        if len(now):
            y = x[now] + _newton_step_and_tangent(path, x[now], t[now], x[now])[0]
            regular[now] = np.all(np.isfinite(y), axis=1)
            with np.errstate(invalid="ignore"):
                y /= np.linalg.norm(y, axis=1, keepdims=True)
            x[now] = np.where(regular[now, None], y, x[now])
    number = np.flatnonzero(regular)
    y, zero = x[number], np.zeros(len(number))
    J, _ = path.slopes(y, zero)
    unit = np.broadcast_to(np.eye(_SIZE, dtype=np.complex128), (len(y), _SIZE, _SIZE))
    W = solved(_with_patch(J, y), unit)[..., :_ROWS]
    newton = np.einsum("rij,rj->ri", W, np.einsum("rij,rj->ri", J, y) / 2)
    bend = np.linalg.norm(W @ path.Q[0].reshape(_ROWS, _SIZE * _SIZE), axis=(1, 2))
    certain = np.linalg.norm(newton, axis=1) * bend < _CERTAIN
    along = y @ y.conj().T
    same = np.linalg.norm(y[:, None] - along[..., None] * y, axis=2) < _APART
    alone = ~np.any(np.tril(same & certain, -1), axis=1)
    regular[number] = certain & alone & (np.linalg.norm(y[:, :4], axis=1) > _FLAT)
    return PathEnds(x, regular)


# Stored platform with forty roots, and its computation by monodromy.


@dataclass(frozen=True, slots=True, eq=False)
class StartSystem:
    """Platform with complex legs, and its roots.

    Attributes:
        legs: legs of the platform.
        x: (40, 8) roots; fewer for special ends of the legs.
    """

    legs: PlatformLegs
    x: Complex


DEGREE = 40


def random_legs(rng: np.random.Generator) -> PlatformLegs:
    """Return six random complex legs whose ends have their means at the origin, of unit size.

    Args:
        rng: random number generator.
    """

    def drawn(*shape: int) -> Complex:
        z = rng.normal(size=shape) + 1j * rng.normal(size=shape)
        return np.asarray(z / np.sqrt(2), np.complex128)

    return _centred(PlatformLegs(drawn(LEGS, 3), drawn(LEGS, 3), drawn(LEGS)))


def _centred(legs: PlatformLegs) -> PlatformLegs:
    """Return the legs with the mean of the points a and the mean of the points b at the origin."""
    return PlatformLegs(legs.a - legs.a.mean(axis=0), legs.b - legs.b.mean(axis=0), legs.c)


def monodromy(seed: int, most: int = 200) -> StartSystem:
    """Return all roots of random legs, by tracking known roots along closed paths of other legs.

    Args:
        seed: seed of the random numbers.
        most: maximum number of closed paths. Fewer than 40 roots may be found.
    """
    rng = np.random.default_rng(seed)
    legs = random_legs(rng)
    e, p = (
        rng.normal(size=4) + 1j * rng.normal(size=4),
        rng.normal(size=3) + 1j * rng.normal(size=3),
    )
    first = np.concatenate([e, _left_products(p) @ e])
    # constants for which `first` is a root
    rest = np.einsum("i,kij,j->k", first, legs.forms()[:LEGS], first)
    legs = PlatformLegs(legs.a, legs.b, legs.c - rest / (e @ e))
    x = first[None] / np.linalg.norm(first)
    for _ in range(most):
        if len(x) >= DEGREE:
            break
        ways = [legs, random_legs(rng), random_legs(rng), legs]
        y, done = x, np.ones(len(x), dtype=bool)
        for begin, end in pairwise(ways):
            y, t = follow(Homotopy.between(begin, end), y)
            done &= t >= 1
        every = np.concatenate([x, y[done]])
        ends = certify(legs, every, np.ones(len(every)))
        x = ends.x[ends.regular]
    return StartSystem(legs, x)


def text_of(start: StartSystem) -> str:
    """Return a platform and its roots as JSON text for a file, which `stored_start` reads.

    Args:
        start: platform and roots.
    """
    parts = {"a": start.legs.a, "b": start.legs.b, "c": start.legs.c, "x": start.x}
    return json.dumps({name: [z.real.tolist(), z.imag.tolist()] for name, z in parts.items()})


@functools.cache
def stored_start(number: int) -> StartSystem:
    """Return a platform with its forty roots from a file of this package.

    Args:
        number: 0 or 1, the index of the file.
    """
    file = resources.files("mbs.closed_forms") / "hexapod_starts" / f"{number}.json"
    told = json.loads(file.read_text(encoding="utf-8"))
    parts = {name: np.array(told[name][0]) + 1j * np.array(told[name][1]) for name in "abcx"}
    a, b, c, x = (np.asarray(parts[name], dtype=np.complex128) for name in "abcx")
    return StartSystem(PlatformLegs(a, b, c), x)


@functools.lru_cache(maxsize=16)
def platform_start(a: bytes, b: bytes) -> StartSystem:
    """Return all roots of a platform for random complex leg lengths, as start for any lengths.

    Special ends of the legs have fewer than forty roots: 28 for semi-regular hexagons, 16 for legs
    that meet in pairs. The roots are regular, because lengths with singular roots form no open set.
    Both stored starts must give the same roots. If they do not, monodromy around other lengths
    is repeated until three closed paths find no new root.

    Args:
        a: bytes of (6, 3) ends on the ground, in sizes of the platform about their mean.
        b: bytes of (6, 3) ends on the platform, in the same form.
    """
    ends = [np.frombuffer(told).reshape(LEGS, 3).astype(complex) for told in (a, b)]
    rng = np.random.default_rng(_SEED)
    legs, second, third = (PlatformLegs(ends[0], ends[1], _random_lengths(rng)) for _ in range(3))
    x, counts = np.zeros((0, _SIZE), dtype=complex), list[int]()
    for number in (0, 1):
        kept = stored_start(number)
        y, t = follow(Homotopy.between(kept.legs, legs), kept.x)
        own = certify(legs, y, t)
        counts.append(int(np.sum(own.regular)))
        x = _distinct_roots(legs, np.concatenate([x, own.x[own.regular]]))
    idle = 0 if {*counts} != {len(x)} else _IDLE
    while idle < _IDLE:
        y = x
        for begin, end in ((legs, second), (second, third), (third, legs)):
            y, t = follow(Homotopy.between(begin, end), y)
            y = y[t >= 1]
        known, x = len(x), _distinct_roots(legs, np.concatenate([x, y]))
        idle = idle + 1 if len(x) == known else 0
        second, third = (PlatformLegs(ends[0], ends[1], _random_lengths(rng)) for _ in range(2))
    return StartSystem(legs, x)


_IDLE = 3
"""Number of closed paths without new roots after which the roots count as complete."""


def _random_lengths(rng: np.random.Generator) -> Complex:
    """Return random complex constants c (6,) of `PlatformLegs`: they set the lengths of legs."""
    return rng.normal(size=LEGS) + 1j * rng.normal(size=LEGS)


def _distinct_roots(legs: PlatformLegs, x: Complex) -> Complex:
    """Return the roots among x (r, 8) that are certified as regular, each once."""
    ends = certify(legs, x.copy(), np.ones(len(x)))
    return ends.x[ends.regular]


# Real poses of a platform.


_RIGID = 1e-9
"""Smallest relative singular value of the lines of the legs, below which the legs hold the platform
at no pose: similar hexagons leave 1e-15."""
_POSES = 4
_REAL = 1e-6
"""Largest imaginary part, relative to |x| = 1, of a root that may be real; Newton's method on real
numbers decides."""
_NEARLY_REAL = 0.1
"""Largest imaginary part if a path stopped before its end, at a root where two roots meet: t misses
1 by some hundredths there, and the root by about the square root of that."""
_CLOSED = 1e-11
"""Largest error of squared leg lengths at a solution, in sizes: Newton's method leaves 1e-15, and
at a fold, where it is slow, 1e-13."""
_REFINEMENTS = 60
"""Maximum number of Newton steps: at a fold each step halves the distance, and a double has sixteen
digits."""
_NEARLY, _HALF, _LEAST = 1e-13, 0.3, 1e-4
"""Error of squares below which the step is halved at most once, because only rounding remains;
smallest fraction of a step there; smallest fraction of a step for larger errors."""
_EXACT, _LOOSE = 1e-16, 1e-12
"""Error of squared lengths that are exact up to rounding, and relative singular value of directions
along which a pose is not moved, as at folds."""
_SAME = 1e-6
"""Distance of e, and of p in sizes, below which two real roots are the same: a fold that is reached
from both sides."""
_FOLD = 1e-2
"""Largest distance of t from 1 at the end of a path where two roots meet."""


def poses(a: Real, b: Real, length: Real) -> Roots:
    """Return all poses of a platform in which six legs have given lengths.

    Args:
        a: (6, 3) ends of the legs on the ground [m].
        b: (6, 3) ends on the platform, in its frame [m].
        length: (6,) lengths of the legs [m].

    Returns:
        Positions [m] of the platform frame, then unit quaternions with a first element that is not
        negative, (r, 7).

    Raises:
        LoopError: the platform can move for constant leg lengths at every pose.
    """
    middle, own, size = a.mean(axis=0), b.mean(axis=0), _platform_size(a, b)
    a0, b0 = (a - middle) / size, (b - own) / size
    if not is_rigid(a, b):
        raise LoopError(
            "the ends of its six legs lie so that they hold the platform at no pose, as on similar"
            " hexagons"
        )
    square = (length / size) ** 2
    c = np.sum(a0**2, axis=1) + np.sum(b0**2, axis=1) - square
    legs = PlatformLegs(a0.astype(complex), b0.astype(complex), c.astype(complex))
    start = platform_start(a0.tobytes(), b0.tobytes())
    path, expected = Homotopy.between(start.legs, legs), len(start.x)
    for tolerance in (TOLERANCE, TOLERANCE / 10, TOLERANCE / 100):
        x, t = follow(path, start.x, tolerance)
        ends = certify(legs, x, t)
        found = _real_roots(a0, b0, square, ends, t)
        certain = int(np.sum(ends.regular))
        # a double root is the end of two paths
        complete = certain + 2 * found.folds == expected
        if complete:
            break
    meet = f", and {2 * found.folds} where poses meet" if found.folds else ""
    proof = f"homotopy, certified: {certain} of {expected} paths{meet}"
    p = found.p * size + middle - _rotations(found.e) @ own
    return Roots(np.concatenate([p, found.e], axis=1), proof, complete)


def _rotations(e: Real) -> Real:
    """Return the rotation matrices (r, 3, 3) of unit quaternions e (r, 4), scalar part first."""
    w, x, y, z = e.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1)) if len(e) else np.zeros((0, 3, 3))


def _slopes(a: Real, b: Real, e: Real, p: Real) -> tuple[Real, Real]:
    """Return squared leg lengths (r, 6), and half their derivatives by [p; rotation], (r, 6, 6).

    a, b (6, 3) are the leg ends, e (r, 4) and p (r, 3) the poses of the platform.
    """
    arm = np.einsum("rij,kj->rki", _rotations(e), b)
    way = p[:, None, :] + arm - a
    return np.sum(way**2, axis=2), np.concatenate([way, np.cross(arm, way)], axis=2)


def _platform_size(a: Real, b: Real) -> float:
    """Return the root mean square distance of leg ends a, b (6, 3) from their means [m].

    1 if it is zero.
    """
    return float(np.sqrt(np.mean(np.var(a, axis=0)) + np.mean(np.var(b, axis=0)))) or 1.0


def is_rigid(a: Real, b: Real) -> bool:
    """Whether six legs determine the pose of the platform locally at a generic pose.

    False if the platform can move for constant leg lengths at every pose.

    Args:
        a: (6, 3) ends of the legs on the ground [m].
        b: (6, 3) ends on the platform, in its frame [m].
    """
    a, b = (a - a.mean(axis=0)) / _platform_size(a, b), (b - b.mean(axis=0)) / _platform_size(a, b)
    rng = np.random.default_rng(_SEED)
    e = rng.normal(size=(_POSES, 4))
    e /= np.linalg.norm(e, axis=1, keepdims=True)
    values = np.linalg.svd(_slopes(a, b, e, rng.normal(size=(_POSES, 3)))[1], compute_uv=False)
    return bool(np.max(values[:, -1] / values[:, 0]) > _RIGID)


class _RealRoots(NamedTuple):
    """Real roots: quaternions e (r, 4), positions p (r, 3) in sizes, and number of double roots."""

    e: Real
    p: Real
    folds: int


def _real_roots(a: Real, b: Real, square: Real, ends: PathEnds, t: Real) -> _RealRoots:
    """Return the real roots among the ends of paths that reached t (r,).

    a, b (6, 3) are the leg ends, `square` (6,) the squared lengths, all in sizes of the platform.
    """
    near = t > 1 - _FOLD
    near &= np.linalg.norm(ends.x[:, :4], axis=1) > _FLAT**0.5
    order = np.argsort(~ends.regular[near], kind="stable")
    x, regular = ends.x[near][order], ends.regular[near][order]
    lead = x[np.arange(len(x)), np.argmax(np.abs(x[:, :4]), axis=1)]
    x = x * (np.abs(lead) / lead)[:, None] if len(x) else x
    limit = np.where(regular, _REAL, _NEARLY_REAL)
    candidate = np.max(np.abs(x.imag), axis=1, initial=0.0) < limit
    x, regular = x[candidate].real, regular[candidate]
    e = x[:, :4] / np.linalg.norm(x[:, :4], axis=1, keepdims=True)
    g = x[:, 4:] / np.linalg.norm(x[:, :4], axis=1, keepdims=True)
    # p = g e*: its vector part
    p = -g[:, :1] * e[:, 1:] + e[:, :1] * g[:, 1:] - np.cross(g[:, 1:], e[:, 1:])
    e, p, error = _refined_poses(a, b, square, e, p)
    kept = list[int]()
    for k in np.flatnonzero(error < _CLOSED):
        if not any(_is_same(e[k], p[k], e[other], p[other]) for other in kept):
            kept.append(int(k))
    e = np.where(e[:, :1] < 0, -e, e)
    return _RealRoots(e[kept], p[kept], int(np.sum(~regular[kept])))


def _is_same(e: Real, p: Real, other_e: Real, other_p: Real) -> bool:
    """Whether the poses (e, p) and (other_e, other_p) are equal; e and -e are one orientation."""
    turn = min(np.max(np.abs(e - other_e)), np.max(np.abs(e + other_e)))
    return bool(max(turn, np.max(np.abs(p - other_p))) < _SAME)


def _refined_poses(a: Real, b: Real, square: Real, e: Real, p: Real) -> tuple[Real, Real, Real]:
    """Refine real poses by Newton's method; return e, p, and errors of squared lengths (r,).

    Steps without improvement are halved, because their length has no bound at a fold.

    e (r, 4) are quaternions, p (r, 3) positions; a, b (6, 3) are the leg ends and `square` (6,) the
    squared lengths.
    """
    share = np.ones(len(e))
    value, J = _slopes(a, b, e, p)
    worst = np.max(np.abs(value - square), axis=1, initial=0.0)
    for _ in range(_REFINEMENTS):
        going = (worst > _EXACT) & (share > np.where(worst < _NEARLY, _HALF, _LEAST))
        if not np.any(going):
            break
        step = -np.linalg.pinv(2 * J, rcond=_LOOSE) @ (value - square)[..., None]
        step = share[:, None] * step[..., 0]
        turn = np.concatenate([np.ones((len(e), 1)), step[:, 3:] / 2], axis=1)
        tried = _hamilton_products(turn, e)
        tried /= np.linalg.norm(tried, axis=1, keepdims=True)
        place = p + step[:, :3]
        other, slope = _slopes(a, b, tried, place)
        error = np.max(np.abs(other - square), axis=1, initial=0.0)
        better = error < worst
        e, p = np.where(better[:, None], tried, e), np.where(better[:, None], place, p)
        value, J = (
            np.where(better[:, None], other, value),
            np.where(better[:, None, None], slope, J),
        )
        worst = np.where(better, error, worst)
        share = np.where(better, np.minimum(2 * share, 1), share / 2)
    return e, p, worst


def _hamilton_products(e: Real, other: Real) -> Real:
    """Return the Hamilton products (r, 4) of quaternions e and `other`."""
    scalar = e[:, :1] * other[:, :1] - np.sum(e[:, 1:] * other[:, 1:], axis=1, keepdims=True)
    vector = e[:, :1] * other[:, 1:] + other[:, :1] * e[:, 1:] + np.cross(e[:, 1:], other[:, 1:])
    return np.concatenate([scalar, vector], axis=1)
