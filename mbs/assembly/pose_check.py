"""Check of an assembly: bodies in the tree have the poses of the description.

The poses of all bodies and joints are computed twice, in numpy only, at random positions and
symbol values: from the description, connection by connection, and from the frames of the links.
The two computations share no formula. A convention that holds for one sign of a symbol only, or a
cancellation of digits, therefore cannot be wrong in both.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import casadi
import numpy as np
from casadi import DM, SX, Function
from numpy.typing import NDArray

from mbs.assembly.graph import Port, is_weld
from mbs.assembly.khalil_frames import KhalilTree
from mbs.assembly.tables import Places
from mbs.assembly.tree import Frame, Tree
from mbs.components import Description
from mbs.components.component import (
    ElementaryRotation,
    FixedRotation,
    KhalilStep,
    Placement,
    Translation,
)
from mbs.components.joints import Freedom, Motion
from mbs.errors import AssemblyError
from mbs.expressions import Expression, Number, Operation, Parameter
from mbs.expressions._expression import arithmetic

Array = NDArray[np.float64]
"""(..., 4, 4) transforms, (samples, 4, 4) if they contain symbols."""

_SEED = 20261122

_SAME = 1e-12
"""Difference of an element that is above rounding: a chain of a hundred joints has errors of 1e-14,
a frame on the wrong side an error of a link length. Positions are relative to the reach."""

_FUNCTIONS = {"sin": np.sin, "cos": np.cos, "tan": np.tan, "sqrt": np.sqrt, "atan2": np.arctan2}


def check_poses(
    mechanism: Description,
    framed: KhalilTree,
    places: Places,
    symbols: Mapping[str, SX],
    values: Mapping[str, float],
) -> None:
    """Raise if the pose of a body or joint frame in the tree differs from the description.

    Poses are compared at random positions and random values of symbols.

    Args:
        mechanism: components and connections.
        framed: tree of the mechanism.
        places: link and pose of every body and every joint frame.
        symbols: CasADi symbol of every parameter.
        values: value of every parameter; the default if there is one.

    Raises:
        AssemblyError: the message has the body or joint, and the values of the symbols.
    """
    rng = np.random.default_rng(_SEED)
    # magnitudes near 1, so that each symbol has an effect, and far from zero
    some = rng.uniform(0.3, 1.7, len(symbols)) * rng.choice([-1.0, 1.0], len(symbols))
    # three samples: the defaults, numbers of both signs, and the same numbers with opposite signs
    rows = np.array(
        [[values[n] for n in symbols], *([some, -some] if symbols else [])], dtype=float
    )
    known = dict(zip(symbols, rows.T, strict=True))
    q = {link.name: _positions(rng, link.motion, len(rows)) for link in framed.tree.links}
    free = {(c.edge.joint.name, "free"): c.frames[0] for c in framed.cuts if c.welded}
    frames = {**places, **free}
    with np.errstate(all="ignore"):  # some expressions may be undefined
        described = _describe(mechanism, framed, known, q)
        expected = np.array(
            [np.broadcast_to(described[port], (len(rows), 4, 4)) for port in frames]
        )
        found = _assembled(framed.tree, list(frames.values()), symbols, rows, q)
        off = np.abs(found - expected)
        off[..., :3, 3] /= float(np.nanmax(np.abs(expected[..., :3, 3]), initial=0.0)) or 1.0
    # a sample at which the description is undefined, such as the root of a negative number, is
    # ignored
    off = np.where(np.isfinite(expected), np.where(np.isfinite(off), off, np.inf), 0.0)
    if np.max(off, initial=0.0) > _SAME:
        number, sample, *_ = np.unravel_index(int(np.argmax(off)), off.shape)
        name, port = list(frames)[number]
        what = f"frame {port!r} of joint {name!r}" if port else f"body {name!r}"
        where = ", ".join(f"{symbol} = {at[sample]:.6g}" for symbol, at in known.items())
        raise AssemblyError(
            f"{mechanism.name}: the assembled tree puts {what} {np.max(off):.3g} away from where it"
            f" is described{' at ' if where else ''}{where}; this is a fault of mbs: please report"
            " the description, and place the joint in other words until then"
        )


def _positions(rng: np.random.Generator, motion: Motion, samples: int) -> Array:
    """Return random positions (samples, nq) of a joint motion, with unit quaternions."""
    values = rng.uniform(-2.0, 2.0, (samples, motion.nq))
    if motion in (Motion.SPHERICAL, Motion.FREE):
        values[:, -4:] /= np.linalg.norm(values[:, -4:], axis=1, keepdims=True)
    return values


# --- poses from the description -----------------------------------------------------------------


def _describe(
    mechanism: Description, framed: KhalilTree, known: Mapping[str, Array], q: Mapping[str, Array]
) -> dict[tuple[str, str], Array]:
    """Return the poses of bodies and joint frames in the world, from the description.

    `known` are parameter values (samples,) and `q` positions (samples, nq) by name. Free ends of
    cut joints that stay in the tree have the port "free".
    """
    ways: dict[Port, list[tuple[Port, Callable[[], Array]]]] = {}

    def connect(a: Port, b: Port, out: Callable[[], Array], back: Callable[[], Array]) -> None:
        ways.setdefault(a, []).append((b, out))
        ways.setdefault(b, []).append((a, back))

    for a, b in mechanism.connections:
        there, here = (_placement(point.placement, known) for point in (a, b))
        connect(
            (a.owner.name, a.port),
            (b.owner.name, b.port),
            lambda there=there, here=here: there @ _inverse(here),  # type: ignore[misc]
            lambda there=there, here=here: here @ _inverse(there),  # type: ignore[misc]
        )
    cut = {c.edge.joint.name: c for c in framed.cuts}
    kept = [name for name, c in cut.items() if c.welded]
    for joint in mechanism.joints():
        name = joint.name
        moves = () if is_weld(mechanism, joint) else joint.freedoms
        if name not in cut:
            connect(
                (name, "a"),
                (name, "b"),
                lambda name=name, moves=moves: _motion(name, moves, q),  # type: ignore[misc]
                lambda name=name, moves=moves: _inverse(_motion(name, moves, q)),  # type: ignore[misc]
            )
    found: dict[tuple[str, str], Array] = {(mechanism.world.name, ""): np.eye(4)}
    queue = deque(found)
    while queue:
        port = queue.popleft()
        for neighbour, transform in ways.get(port, []):
            if neighbour not in found:
                found[neighbour] = found[port] @ transform()
                queue.append(neighbour)
    for name in kept:
        joint = cut[name].edge.joint
        found[name, "free"] = found[name, "a"] @ _motion(name, joint.freedoms, q)
    return found


def _placement(placement: Placement, known: Mapping[str, Array]) -> Array:
    """Return the transform (..., 4, 4) of a placement at the parameter values `known`."""
    T: Array = np.eye(4)
    for step in placement.steps:
        match step:
            case Translation(x=x, y=y, z=z):
                T = T @ _shift(*(_number(value, known) for value in (x, y, z)))
            case ElementaryRotation(axis=axis, angle=angle):
                T = T @ _turn(axis, _number(angle, known))
            case FixedRotation(rows=rows):
                R = np.eye(4)
                R[:3, :3] = rows
                T = T @ R
            case KhalilStep():
                six = (step.gamma, step.b, step.alpha, step.d, step.theta, step.r)
                T = T @ _khalil(*(np.asarray(_number(value, known)) for value in six))
    return T


def _number(value: Expression, known: Mapping[str, Array]) -> Any:
    """Return the value of an expression at parameter values: a number, or an array (samples,)."""
    if isinstance(value, Number):
        return value.value
    if isinstance(value, Parameter):
        return known[value.name]
    assert isinstance(value, Operation)
    operands = [_number(argument, known) for argument in value.arguments]
    result = arithmetic(value.operator, operands)
    return _FUNCTIONS[value.operator](*operands) if result is None else result


def _motion(name: str, freedoms: Sequence[Freedom], q: Mapping[str, Array]) -> Array:
    """Return the pose of frame_b of joint `name` in its frame_a, at positions q by coordinate."""
    T: Array = np.eye(4)
    for freedom in freedoms:
        T = T @ _elementary_motion(freedom, q[freedom.coordinate_of(name)])
    return T


def _elementary_motion(freedom: Freedom, q: Array) -> Array:
    """Return transforms (samples, 4, 4) of a joint freedom at positions q (samples, nq).

    Rotations follow from Rodrigues' formula.
    """
    T = np.tile(np.eye(4), (len(q), 1, 1))
    x, y, z = freedom.axis
    match freedom.motion:
        case Motion.PRISMATIC:
            T[:, :3, 3] = q * freedom.axis
        case Motion.REVOLUTE:
            K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
            s, c = np.sin(q)[:, :, None], np.cos(q)[:, :, None]
            T[:, :3, :3] = np.eye(3) + s * K + (1 - c) * np.einsum("ij,jk->ik", K, K)
        case _:
            T[:, :3, :3] = _of_quaternion(q[:, -4:])
            if freedom.motion is Motion.FREE:
                T[:, :3, 3] = q[:, :3]
    return T


def _of_quaternion(q: Array) -> Array:
    """Return the rotation matrices (samples, 3, 3) of unit quaternions w, x, y, z (samples, 4)."""
    w, e = q[:, 0, None, None], q[:, 1:]
    x, y, z = e.T
    zero = np.zeros_like(x)
    K = np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]]).transpose(2, 0, 1)
    return np.array(np.eye(3) + 2 * w * K + 2 * np.einsum("sij,sjk->sik", K, K))


def _shift(x: Any, y: Any, z: Any) -> Array:
    """Return the transform (..., 4, 4) of a translation; x, y, z are numbers or arrays."""
    shape = np.broadcast_shapes(*(np.shape(value) for value in (x, y, z)))
    T = np.zeros((*shape, 4, 4))
    T[..., range(4), range(4)] = 1.0
    T[..., 0, 3], T[..., 1, 3], T[..., 2, 3] = x, y, z
    return T


def _turn(axis: str, angle: Any) -> Array:
    """Return the transform (..., 4, 4) of a rotation about the axis "x", "y" or "z" by an angle."""
    k = "xyz".index(axis)
    i, j = (k + 1) % 3, (k + 2) % 3
    T = np.zeros((*np.shape(angle), 4, 4))
    T[..., k, k] = T[..., 3, 3] = 1.0
    T[..., i, i] = T[..., j, j] = np.cos(angle)
    T[..., j, i] = np.sin(angle)
    T[..., i, j] = -T[..., j, i]
    return T


def _inverse(T: Array) -> Array:
    """Return the inverses (..., 4, 4) of rigid transforms."""
    back = np.zeros_like(T)
    R = np.swapaxes(T[..., :3, :3], -1, -2)
    back[..., :3, :3] = R
    back[..., :3, 3] = -np.einsum("...ij,...j->...i", R, T[..., :3, 3])
    back[..., 3, 3] = 1.0
    return back


# --- poses from the tree ------------------------------------------------------------------------


def _assembled(
    tree: Tree,
    frames: Sequence[Frame],
    symbols: Mapping[str, SX],
    rows: Array,
    q: Mapping[str, Array],
) -> Array:
    """Return the poses (frames, samples, 4, 4) in the base of frames on links, from the tree.

    `rows` (samples, symbols) are parameter values and `q` positions by name of the link.
    """
    own = [casadi.vertcat(*frame.parameters) for link in tree.links for frame in link.frames]
    six = np.moveaxis(_at_samples(own, symbols, rows)[..., 0], -1, 0)
    placed = iter(_khalil(*six))
    poses = [np.tile(np.eye(4), (len(rows), 1, 1))]  # poses of the base, then of the links
    for link in tree.links:
        T = poses[link.antecedent + 1]
        for _ in link.frames:
            T = T @ next(placed)
        moved = _elementary_motion(Freedom(link.motion), q[link.name])
        poses.append(T @ (_inverse(moved) if link.backward else moved))
    inside = _at_samples([pose.matrix for _, pose in frames], symbols, rows)
    return np.array(poses)[[link + 1 for link, _ in frames]] @ inside


def _at_samples(values: Sequence[SX], symbols: Mapping[str, SX], rows: Array) -> Array:
    """Return the matrix expressions at every sample, (values, samples, rows, columns).

    `rows` (samples, symbols) are values of the symbols. All expressions have the same shape.
    """
    if not values:
        return np.zeros((0, len(rows), 0, 0))
    shape = values[0].shape
    stacked = casadi.horzcat(*(casadi.densify(value) for value in values))
    if symbols:
        at = Function("values", [casadi.vertcat(*symbols.values())], [stacked])
        numbers = np.array([DM(at(row)).full() for row in rows])
    else:
        numbers = DM(stacked).full()[None]
    return numbers.reshape(len(rows), shape[0], len(values), shape[1]).transpose(2, 0, 1, 3)


def _khalil(gamma: Array, b: Array, alpha: Array, d: Array, theta: Array, r: Array) -> Array:
    """Return the transform (..., 4, 4) of Khalil parameters, written out from its definition.

    Source: Khalil & Kleinfinger 1986.
    """
    cg, sg, ca, sa = np.cos(gamma), np.sin(gamma), np.cos(alpha), np.sin(alpha)
    ct, st = np.cos(theta), np.sin(theta)
    zero, one = np.zeros_like(cg * b * ca * d * ct * r), np.ones_like(cg * b * ca * d * ct * r)
    rows = [
        [cg * ct - sg * ca * st, -cg * st - sg * ca * ct, sg * sa, d * cg + r * sg * sa],
        [sg * ct + cg * ca * st, -sg * st + cg * ca * ct, -cg * sa, d * sg - r * cg * sa],
        [sa * st, sa * ct, ca, r * ca + b],
        [zero, zero, zero, one],
    ]
    return np.moveaxis(np.array([[x + zero for x in row] for row in rows]), (0, 1), (-2, -1))
