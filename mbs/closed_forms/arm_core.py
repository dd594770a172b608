"""Arm algorithms of the compiled run-time library, as functions of numpy arrays."""

from __future__ import annotations

import ctypes
import functools
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypeAlias

import numpy as np
from casadi import SX, Function
from numpy.typing import NDArray

from mbs.closed_forms.arm import Arm, Array
from mbs.closed_forms.raghavan_roth.numbers import Prepared
from mbs.core import core_files, core_library
from mbs.errors import ModelError
from mbs.native.handwritten import handwritten

Hits: TypeAlias = NDArray[np.int64]

_PAIRS = ("rigid", "arm", "arm_search", "pair", "dense", "eigenvalues", "raghavan_roth", "pose")
_SOURCES = (
    "arm_descend.c",
    "raghavan_roth_roots.c",
    "raghavan_roth_middle.c",
    "raghavan_roth_rest.c",
    "raghavan_roth_solve.c",
)
_JOINTS = 64  # largest number of joints, ARM_JOINTS of arm.h

_pointer, _real, _integer = ctypes.c_void_p, ctypes.c_double, ctypes.c_longlong
_SIGNATURES: dict[str, tuple[Any, tuple[Any, ...]]] = {
    "mbs_polish": (
        None,
        (_pointer, _pointer, _integer, _integer, _pointer, _pointer),
    ),
    "mbs_search": (
        _integer,
        (_pointer, _pointer, _integer, ctypes.c_ulonglong, _pointer, _pointer, _pointer),
    ),
    "mbs_merge": (_integer, (_pointer, _pointer, _integer, _pointer, _pointer, _pointer)),
    "mbs_general": (
        _integer,
        (_pointer, _pointer, _pointer, _integer, _integer, _pointer, _pointer, _pointer, _pointer),
    ),
    "mbs_candidates": (_integer, (_pointer, _pointer, _pointer)),
    "mbs_correct": (
        None,
        (_pointer, _pointer, _integer, _integer, _pointer, _pointer, ctypes.c_int, _pointer),
    ),
    "mbs_residual": (None, (_pointer, _pointer, _integer, _integer, _pointer, _pointer)),
    "mbs_examine": (None, (_pointer, _pointer, _integer, _integer, *[_pointer] * 3)),
    "mbs_walk": (
        _integer,
        (_pointer, _pointer, _pointer, _real, _integer, ctypes.c_int, _pointer, _pointer),
    ),
    "mbs_singular": (None, (_pointer, _real, _integer, _pointer, _pointer)),
    "mbs_settle": (
        ctypes.c_int,
        (_pointer, _pointer, _integer, *[_pointer] * 4, _real, _real, _pointer, _pointer),
    ),
    "mbs_reach_sphere": (None, (_pointer, _pointer, _pointer, _real, _integer, _pointer)),
    "mbs_reduced": (ctypes.c_int, (_pointer, _pointer, _pointer, _integer, *[_pointer] * 3)),
    "mbs_round": (ctypes.c_int, (_pointer,)),
    "mbs_nearest": (_real, (_pointer, _pointer, _integer, ctypes.c_ulonglong, _pointer)),
}


class _ArmStruct(ctypes.Structure):
    """C structure `arm` of arm.h: joints and constant transforms of an `Arm`."""

    _fields_ = (
        ("n", ctypes.c_int),
        ("gaps", ctypes.c_void_p),
        ("slides", ctypes.c_void_p),
        ("length", ctypes.c_double),
    )


def core_of(arm: Arm) -> ctypes.CDLL:
    """Return the run-time library, after a check of the number of joints of the arm.

    Args:
        arm: arm of at most 64 joints.

    Raises:
        ModelError: the arm has too many joints.
        CompilerError: the library is missing and cannot be built.
    """
    if arm.size > _JOINTS:
        raise ModelError(
            f"the arm {arm.names[0]} ... {arm.names[-1]} has {arm.size} joints; inverse geometry"
            f" takes {_JOINTS} at most, lock some of them"
        )
    return core()


def path_of(library: ctypes.CDLL) -> Path:
    """Return the path of the file from which a library was loaded.

    Args:
        library: library loaded by ctypes.
    """
    return Path(library._name)


def _files(sources: tuple[str, ...]) -> dict[str, str]:
    """Return the texts of the C files `sources` and of all files that they need, by name."""
    return core_files([*(name + end for name in _PAIRS for end in (".c", ".h")), *sources])


@functools.cache
def core() -> ctypes.CDLL:
    """Return the run-time library, with the signatures of its arm functions.

    Raises:
        CompilerError: the library is missing and cannot be built.
    """
    return library_at(core_library().__file__)


def library_at(path: str) -> ctypes.CDLL:
    """Load the run-time library from a file and set the signatures of its arm functions.

    Args:
        path: path of the shared library.
    """
    library = ctypes.CDLL(path)
    for name, (result, arguments) in _SIGNATURES.items():
        function = getattr(library, name)
        function.restype, function.argtypes = result, arguments
    return library


def polished_by(library: ctypes.CDLL, arm: Arm, T: Array, q: Array) -> tuple[Array, Array]:
    """Return configurations refined by Newton's method (m, n), and their residuals (m,) [m or 1].

    Args:
        library: run-time library.
        arm: arm of the configurations.
        T: (4, 4) target pose of all, or (m, 4, 4) of each.
        q: (m, n) configurations [rad or m].
    """
    own, residual, _ = _output_arrays(len(q), arm.size)
    own[:] = q
    target = _targets(T, len(q))
    stride, c_arm = 16 if target.ndim == 3 else 0, c_arm_of(arm)
    library.mbs_polish(
        c_arm.address, _address(target), stride, len(q), _address(own), _address(residual)
    )
    return own, residual


def found_by(
    library: ctypes.CDLL, arm: Arm, T: Array, starts: int, seed: int
) -> tuple[Array, Hits]:
    """Return solutions of multi-start Levenberg-Marquardt from random configurations.

    Args:
        library: run-time library.
        arm: arm of the configurations.
        T: (4, 4) target pose [m].
        starts: number of random configurations.
        seed: seed of the random numbers.

    Returns:
        (m, n) distinct solutions [rad or m], and (m,) number of starts that converged to each.
    """
    target = _c_array(T, 4, 4)
    q, residual, hits = _output_arrays(starts, arm.size)
    c_arm = c_arm_of(arm)
    count = library.mbs_search(
        c_arm.address,
        _address(target),
        starts,
        seed,
        _address(q),
        _address(residual),
        hits.ctypes.data,
    )
    return q[:count].copy(), hits[:count].copy()


def merged_by(library: ctypes.CDLL, arm: Arm, T: Array, q: Array) -> tuple[Array, Hits]:
    """Return the distinct configurations among solutions of one pose, and the copies of each (m,).

    Args:
        library: run-time library.
        arm: arm of the configurations.
        T: (4, 4) target pose [m].
        q: (m, n) solutions [rad or m].
    """
    target = _c_array(T, 4, 4)
    own, residual, hits = _output_arrays(len(q), arm.size)
    own[:] = q
    c_arm = c_arm_of(arm)
    count = library.mbs_merge(
        c_arm.address,
        _address(target),
        len(q),
        _address(own),
        _address(residual),
        hits.ctypes.data,
    )
    return own[:count].copy(), hits[:count].copy()


def nearest_by(library: ctypes.CDLL, arm: Arm, T: Array, starts: int, seed: int) -> Array:
    """Return the configuration (n,) whose pose is nearest to a target, from random starts.

    Args:
        library: run-time library.
        arm: arm of the configurations.
        T: (4, 4) target pose [m].
        starts: number of random configurations.
        seed: seed of the random numbers.
    """
    target, q = _c_array(T, 4, 4), np.empty(arm.size)
    c_arm = c_arm_of(arm)
    library.mbs_nearest(c_arm.address, _address(target), starts, seed, _address(q))
    return q


def singular_by(library: ctypes.CDLL, arm: Arm, q: Array, bound: float) -> NDArray[np.bool_]:
    """Return a mask (m,) of the configurations whose Jacobian has a singular value below a bound.

    Args:
        library: run-time library.
        arm: arm of the configurations.
        q: (m, n) configurations [rad or m].
        bound: bound of the singular value, with lengths in arm lengths.
    """
    own, singular = _c_array(q, len(q), arm.size), np.empty(len(q), dtype=bool)
    c_arm = c_arm_of(arm)
    library.mbs_singular(c_arm.address, bound, len(q), _address(own), singular.ctypes.data)
    return singular


def corrected_by(
    library: ctypes.CDLL, arm: Arm, T: Array, x: Array, held: Array, value: Array, iterations: int
) -> Array:
    """Return solutions (m, n) near first guesses that also satisfy a linear constraint.

    Unknowns are x = q / unit, with the unit of each joint: 1 rad or the length of the arm. The
    constraint is held . x = value.

    Args:
        library: run-time library.
        arm: arm of the configurations.
        T: (4, 4) target pose of all, or (m, 4, 4) of each.
        x: (m, n) first guesses.
        held: (m, n) or (n,) coefficients of the constraint.
        value: (m,) right sides of the constraint.
        iterations: maximum number of iterations.
    """
    m, n = len(x), arm.size
    own = np.array(np.broadcast_to(x, (m, n)), dtype=float, order="C")
    target = _targets(T, m)
    stride, c_arm = 16 if target.ndim == 3 else 0, c_arm_of(arm)
    rows, right = _c_array(held, m, n), _c_array(value, m)
    library.mbs_correct(
        c_arm.address,
        _address(target),
        stride,
        m,
        _address(rows),
        _address(right),
        iterations,
        _address(own),
    )
    return own


def residual_by(library: ctypes.CDLL, arm: Arm, T: Array, q: Array) -> Array:
    """Return the largest element of |pose(q) - T| (m,) [m or 1].

    Args:
        library: run-time library.
        arm: arm of the configurations.
        T: (4, 4) target pose of all, or (m, 4, 4) of each.
        q: (m, n) configurations [rad or m].
    """
    own, target, residual = _c_array(q, *q.shape), _targets(T, len(q)), np.empty(len(q))
    c_arm = c_arm_of(arm)
    stride = 16 if target.ndim == 3 else 0
    library.mbs_residual(
        c_arm.address, _address(target), stride, len(q), _address(own), _address(residual)
    )
    return residual


def examined_by(library: ctypes.CDLL, arm: Arm, T: Array, q: Array) -> tuple[Array, Array]:
    """Return displacements (m, 6) to target poses and Jacobians (m, 6, n), lengths in arm lengths.

    A displacement is a translation and a rotation vector, as of `gap_to`.

    Args:
        library: run-time library.
        arm: arm of the configurations.
        T: (4, 4) target pose of all, or (m, 4, 4) of each.
        q: (m, n) configurations [rad or m].
    """
    m, n = q.shape
    own, target = _c_array(q, m, n), _targets(T, m)
    gap, J = np.empty((m, 6)), np.empty((m, n, 6))
    c_arm = c_arm_of(arm)
    stride = 16 if target.ndim == 3 else 0
    library.mbs_examine(
        c_arm.address, _address(target), stride, m, _address(own), _address(gap), _address(J)
    )
    return gap, np.swapaxes(J, 1, 2)


def on_sphere_by(
    library: ctypes.CDLL, arm: Arm, T: Array, centre: Array, radius: float, x: Array
) -> Array:
    """Return configurations x = q / unit (m, n) with a given pose and distance from a centre.

    Args:
        library: run-time library.
        arm: arm of the configurations.
        T: (4, 4) target pose.
        centre: (n,) centre of the sphere in x.
        radius: distance from the centre.
        x: (m, n) first guesses.
    """
    own, middle = np.array(x, dtype=float, order="C"), _c_array(centre, arm.size)
    target, c_arm = _c_array(T, 4, 4), c_arm_of(arm)
    library.mbs_reach_sphere(
        c_arm.address, _address(target), _address(middle), radius, len(own), _address(own)
    )
    return own


class _ReductionStruct(ctypes.Structure):
    """C structure `arm_reduction` of arm_reduce.h."""

    _fields_ = (
        ("corank", ctypes.c_int),
        *((name, ctypes.c_void_p) for name in ("centre", "solved", "left", "null")),
    )


def reduced_by(
    library: ctypes.CDLL, arm: Arm, T: Array, parts: tuple[Array, Array, Array, Array], h: Array
) -> tuple[Array, Array, bool]:
    """Return points of the Lyapunov-Schmidt reduction at a singular configuration.

    Args:
        library: run-time library.
        arm: arm of the configurations.
        T: (4, 4) target pose.
        parts: reduction at a singular configuration: centre (n,), solved directions of equations
            (rank, 6), remaining directions (6 - rank, 6), null directions of x (corank, n).
        h: (m, corank) coordinates along the null directions.

    Returns:
        Configurations x = q / unit (m, n) that satisfy the solved equations, values (m, 6 - rank)
        of the remaining equations, and whether all iterations converged.
    """
    count, corank = h.shape
    held = [np.ascontiguousarray(part, dtype=float) for part in parts]
    own = _ReductionStruct(corank, *map(_address, held))
    x, g = np.empty((count, arm.size)), np.empty((count, len(held[2])))
    target, given, c_arm = _c_array(T, 4, 4), _c_array(h, count, corank), c_arm_of(arm)
    found = library.mbs_reduced(
        c_arm.address,
        _address(target),
        ctypes.addressof(own),
        count,
        _address(given),
        _address(x),
        _address(g),
    )
    return x, g, bool(found)


def walked_by(
    library: ctypes.CDLL,
    arm: Arm,
    T: Array,
    start: Array,
    tangent: Array,
    limit: float,
    most: int,
    sided: bool,
) -> tuple[Array, bool]:
    """Return points (k, n) of a self-motion in x = q / unit, and whether it is a closed curve.

    Args:
        library: run-time library.
        arm: arm of the configurations.
        T: (4, 4) pose that is kept.
        start: (n,) first point.
        tangent: (n,) direction of the curve at the first point.
        limit: largest residual of a point.
        most: maximum number of points.
        sided: whether the path must stay on one of two curves that pass close by each other.
    """
    points, target = np.empty((most + 1, arm.size)), _c_array(T, 4, 4)
    points[0] = start
    along, closed, c_arm = _c_array(tangent, arm.size), ctypes.c_int(0), c_arm_of(arm)
    count = library.mbs_walk(
        c_arm.address,
        _address(target),
        _address(along),
        limit,
        most,
        sided,
        _address(points),
        ctypes.addressof(closed),
    )
    return points[:count].copy(), bool(closed.value)


def rounded_by(library: ctypes.CDLL, T: Array) -> Array | None:
    """Return the rigid transform (4, 4) nearest to a matrix; None if it is not rigid within 1e-6.

    Args:
        library: run-time library.
        T: (4, 4) matrix.
    """
    own = np.array(T, dtype=float, order="C")
    return own if library.mbs_round(_address(own)) else None


def settled_by(
    library: ctypes.CDLL,
    c_arm: CArm,
    T: Array,
    every: tuple[Array, ...],
    bounds: tuple[float, float],
) -> tuple[Array, Array, Array, bool]:
    """Return the solutions among the branches of a closed form for one pose.

    Args:
        library: run-time library.
        c_arm: arm as a C structure.
        T: (4, 4) rigid transform [m].
        every: q (branches, n) and residual (branches,), both overwritten; real and regular
            (branches,).
        bounds: value of real and regular from which the Jacobian is not examined, and singular
            value of the Jacobian below which solutions may be missing.

    Returns:
        (m, n) configurations, (m,) residuals, (m,) branch indices, and whether the solutions are
        certainly complete.
    """
    q, residual = every[:2]
    number, count = np.empty(len(residual)), ctypes.c_longlong(0)
    target = _c_array(T, 4, 4)
    doubtful = library.mbs_settle(
        c_arm.address,
        _address(target),
        len(residual),
        *map(_address, every),
        *bounds,
        _address(number),
        ctypes.addressof(count),
    )
    m = count.value
    return q[:m], residual[:m], number[:m], not doubtful


class CArm:
    """C structure of an arm, and the arrays that it points to.

    Attributes:
        address: memory address of the structure.
    """

    def __init__(self, arm: Arm) -> None:
        self.gaps = np.ascontiguousarray(arm.gaps, dtype=float)
        self.slides = np.ascontiguousarray(arm.prismatic, dtype=np.uint8)
        self.arm = _ArmStruct(arm.size, self.gaps.ctypes.data, self.slides.ctypes.data, arm.length)
        self.address = ctypes.addressof(self.arm)


@functools.lru_cache(maxsize=256)
def c_arm_of(arm: Arm) -> CArm:
    """Return the C structure of an arm, cached, because an arm is immutable.

    Args:
        arm: numeric arm.
    """
    return CArm(arm)


def _c_array(T: Array, *shape: int) -> Array:
    """Return T as a C-contiguous array of doubles of this shape, for a C function.

    Raises ValueError if T cannot be broadcast to the shape, since C code does not check it.
    """
    if type(T) is np.ndarray and T.shape == shape and T.dtype == np.float64:
        return T if T.flags.c_contiguous else np.ascontiguousarray(T)
    return np.ascontiguousarray(np.broadcast_to(np.asarray(T, dtype=float), shape))


def _targets(T: Array, count: int) -> Array:
    """Return target poses as an array for C: (4, 4) for all configurations, or (count, 4, 4).

    T is one pose (4, 4) or the poses (count, 4, 4).
    """
    return _c_array(T, *((4, 4) if np.ndim(T) == 2 else (count, 4, 4)))


def _output_arrays(count: int, n: int) -> tuple[Array, Array, Hits]:
    """Return uninitialised arrays for `count` configurations of n joints, residuals and hits."""
    return np.empty((count, n)), np.empty(count), np.empty(count, dtype=np.int64)


def _address(array: Array) -> int:
    """Return the memory address of the data of an array."""
    return int(array.ctypes.data)


# Structures of the compiled general method, and its calls.


Numbers: TypeAlias = NDArray[np.int64]

_ROOM = 4096  # largest number of configurations that one call returns
_CANDIDATES = 144  # ROTH_CONFIGURATIONS of raghavan_roth.h: most candidates of a pose

_int, _double = ctypes.c_int, ctypes.c_double


class _LoopStruct(ctypes.Structure):
    """C structure `roth_loop` of raghavan_roth.h: an arm prepared for the general method."""

    _fields_ = (
        ("order", _int * 6),
        ("sign", _int),
        ("slides", _int * 6),
        ("offsets", _double * 6),
        ("transforms", _double * 16 * 6),
        ("place", _int),
        ("after", _double * 16),
        ("length", _double),
        ("count", _int),
        ("elements", _int * 15),
        ("powers", _int * 5),
        ("raised", _int),
        ("rank", _int),
        ("size", _int),
        ("mix", ctypes.c_void_p),
        ("next", ctypes.c_void_p),
    )


class CLoop:
    """C structure of an arm prepared for the general method, and the arrays that it points to.

    Attributes:
        address: memory address of the structure.
        next: structure of an alternative elimination, or None.
    """

    def __init__(self, arm: Arm, prepared: Prepared) -> None:
        loop, pencil = prepared.arrangement, prepared.pencil
        elimination = pencil.elimination
        self.arm = c_arm_of(arm)
        self.next: CLoop | None = None
        if prepared.others:
            first, *others = prepared.others
            self.next = CLoop(arm, replace(first, others=tuple(others)))
        self.mix = np.ascontiguousarray(pencil.mix, dtype=float)
        square = self.mix.shape[0] == self.mix.shape[1]
        parts = ("first", "second", "third", "fourth", "fifth")
        elements = [*elimination.elements.tolist(), *[0] * 15][:15]
        self.loop = _LoopStruct(
            (_int * 6)(*loop.order.tolist()),
            loop.sign,
            (_int * 6)(*map(int, loop.prismatic)),
            (_double * 6)(*loop.offsets.tolist()),
            (_double * 16 * 6)(*((_double * 16)(*way.ravel().tolist()) for way in loop.transforms)),
            loop.index,
            (_double * 16)(*loop.after.ravel().tolist()),
            loop.length,
            len(elimination.elements),
            (_int * 15)(*elements),
            (_int * 5)(*(len(getattr(elimination, part)) for part in parts)),
            elimination.raised,
            pencil.rank,
            elimination.size,
            None if square else self.mix.ctypes.data,
            None if self.next is None else self.next.address,
        )
        self.address: int = ctypes.addressof(self.loop)


def solved_by(library: ctypes.CDLL, c_loop: CLoop, T: Array) -> tuple[Numbers, Array]:
    """Return the solutions of the general method (Raghavan and Roth) for many poses.

    Args:
        library: run-time library.
        c_loop: arm prepared for the general method.
        T: (N, 4, 4) target poses [m].

    Returns:
        (m,) indices of the poses, ascending, and (m, 6) configurations for them.
    """
    target = np.ascontiguousarray(T, dtype=float)
    room = min(_ROOM, _CANDIDATES * len(target))
    q, start, done = np.empty((room, 6)), 0, ctypes.c_longlong(0)
    number, hits = np.empty(room, dtype=np.int64), np.empty(room, dtype=np.int64)
    found = list[tuple[Numbers, Array]]()
    while start < len(target) or not found:
        count = library.mbs_general(
            c_loop.arm.address,
            c_loop.address,
            target[start:].ctypes.data,
            len(target) - start,
            room,
            q.ctypes.data,
            number.ctypes.data,
            hits.ctypes.data,
            ctypes.addressof(done),
        )
        found.append((number[:count] + start, q[:count].copy()))
        start += done.value
    if len(found) == 1:
        return found[0]
    numbers, configurations = zip(*found, strict=True)
    return np.concatenate(numbers), np.concatenate(configurations)


def candidates_by(library: ctypes.CDLL, c_loop: CLoop, T: Array) -> Array:
    """Return configurations (m, 6) that may reach a pose, neither polished nor checked.

    Args:
        library: run-time library.
        c_loop: arm prepared for the general method.
        T: (4, 4) target pose [m].
    """
    target, q = _c_array(T, 4, 4), np.empty((_CANDIDATES, 6))
    return q[: library.mbs_candidates(c_loop.address, _address(target), _address(q))].copy()


# General method of an arm as a Function with C code that contains the numbers of the arm.


COLUMNS = 16
"""Number of configurations that `general_function` returns, POSE_COLUMNS of pose.h."""

_TABLES = """\
#include <math.h>
#include <string.h>
#include "pose.h"

static const double FUNCTION_gaps[] = {gaps};
static const unsigned char FUNCTION_prismatic[] = {slides};
static const arm FUNCTION_arm = {arm};
{loops}static const long long FUNCTION_indices[] = {indices};
static const double FUNCTION_others[] = {others};
static const pose_solver FUNCTION_solver = {solver};

EXPORT int FUNCTION(const double **arg, double **res, long long *iw, double *w, int mem) {{
    (void)iw;
    (void)mem;
    return pose_all(&FUNCTION_solver, arg, res, w);
}}

EXPORT int jac_FUNCTION(const double **arg, double **res, long long *iw, double *w, int mem) {{
    (void)iw;
    (void)w;
    (void)mem;
    return pose_all_jacobian(&FUNCTION_solver, arg, res);
}}
"""


class SolverStruct(ctypes.Structure):
    """C structure `pose_solver` of pose.h: inverse geometry of an arm in generated C code."""

    _fields_ = (
        *((name, ctypes.c_void_p) for name in ("robot", "loop", "evaluate", "checkout", "release")),
        *((name, ctypes.c_longlong) for name in ("branches", "arguments", "results")),
        *((name, ctypes.c_longlong) for name in ("integers", "reals")),
        ("suspect", ctypes.c_double),
        ("nearly", ctypes.c_double),
        ("nq", ctypes.c_longlong),
        *((name, ctypes.c_void_p) for name in ("indices", "others")),
    )


def general_function(
    name: str, c_loop: CLoop, indices: Sequence[int], others: Array, nearly: float
) -> Function:
    """Return the Function ``name(T) -> q, valid, count, certain`` of the general method, in C.

    Args:
        name: prefix of the name of the function.
        c_loop: arm prepared for the general method.
        indices: (6,) indices of the joints of the arm among the coordinates.
        others: (nq,) positions of all coordinates [rad or m]. Joints of the arm are ignored.
        nearly: singular value of the Jacobian below which configurations may be missing.

    Raises:
        CompilerError: no C compiler was found.

    Returns:
        Function of the target pose T (4, 4): configurations q (nq, 16), mask valid (16, 1), number
        count of configurations, and certain, which is 0 if configurations may be missing.
    """
    nq, arm = len(others), c_loop.arm
    solver = SolverStruct(nearly=nearly, nq=nq)
    of_arm = {"gaps": "FUNCTION_gaps", "slides": "FUNCTION_prismatic"}
    of_solver = {"robot": "&FUNCTION_arm", "loop": "&FUNCTION_loop0"}
    of_solver |= {"indices": "FUNCTION_indices", "others": "FUNCTION_others"}
    own = _TABLES.format(
        gaps=_initializer(arm.gaps.ravel()),
        slides=_initializer(arm.slides),
        arm=_initializer(arm.arm, of_arm),
        loops=_loop_tables(c_loop),
        indices=_initializer(indices),
        others=_initializer(others),
        solver=_initializer(solver, of_solver),
    )
    T, outputs = SX.sym("T", 4, 4), {"q": (nq, COLUMNS), "valid": (COLUMNS, 1)}
    outputs |= {"count": (1, 1), "certain": (1, 1)}
    values = [SX.zeros(*shape) for shape in outputs.values()]
    signature = Function(name, [T], values, ["T"], [*outputs])
    given = [T, *(SX.sym(f"out_{key}", *shape) for key, shape in outputs.items())]
    slopes = [SX.ones(COLUMNS * nq, 16), *(SX(n, 16) for n in (COLUMNS, 1, 1))]
    jacobian = Function(
        f"jac_{name}",
        given,
        slopes,
        ["T", *(f"out_{key}" for key in outputs)],
        [f"jac_{key}_T" for key in outputs],
    )
    work = _CANDIDATES * (nq + 3)
    return handwritten(signature, jacobian, own, _files(_SOURCES), work)


def _loop_tables(c_loop: CLoop, number: int = 0) -> str:
    """Return the C text of a prepared loop with index `number`, after those of its alternatives."""
    owned, text = dict[str, str](), ""
    if c_loop.next is not None:
        text += _loop_tables(c_loop.next, number + 1)
        owned["next"] = f"&FUNCTION_loop{number + 1}"
    if c_loop.loop.mix:
        mix = _initializer(c_loop.mix.ravel())
        text += f"static const double FUNCTION_mix{number}[] = {mix};\n"
        owned["mix"] = f"FUNCTION_mix{number}"
    loop = _initializer(c_loop.loop, owned)
    return f"{text}static const roth_loop FUNCTION_loop{number} = {loop};\n"


def _initializer(value: Any, owned: Mapping[str, str] = MappingProxyType({})) -> str:
    """Return the C initializer of a number, an array or a structure.

    `owned` maps the names of pointers of the structure to C names; other pointers are null.
    """
    if isinstance(value, ctypes.Structure):
        pairs = [(field[0], field[1]) for field in value._fields_]
        texts = (
            owned.get(name, "0") if kind is _pointer else _initializer(getattr(value, name))
            for name, kind in pairs
        )
        return f"{{{', '.join(texts)}}}"
    if isinstance(value, (int, np.integer)):
        return str(int(value))
    if isinstance(value, (float, np.floating)):
        return repr(float(value))
    return f"{{{', '.join(_initializer(x) for x in value)}}}"
